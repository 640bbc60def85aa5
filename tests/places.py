"""Folders that several tests read."""

from __future__ import annotations

from functools import cache
from importlib import metadata
from pathlib import Path

EXAMPLES = Path(__file__).parents[1] / "examples"


@cache
def example_robots() -> Path:
    """Return the folder of `example-robot-data`, from the list of files of its package."""
    for file in metadata.files("example-robot-data") or []:
        parts = file.parts
        if "robots" in parts and parts[parts.index("robots") - 1] == "example-robot-data":
            path = Path(str(metadata.distribution("example-robot-data").locate_file(file))).resolve()
            return Path(*path.parts[: path.parts.index("robots", path.parts.index("example-robot-data")) + 1])
    raise FileNotFoundError("example-robot-data holds no robots")

"""Files that people write, read with errors that say which file and why."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any

from multimodal_to.errors import MultimodalError


def read_toml(path: Path, error: type[MultimodalError]) -> dict[str, Any]:
    """Return what a TOML file holds.

    Raises:
        error: the file cannot be read or is not valid TOML.
    """
    try:
        return tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as cause:
        raise error(f"cannot read '{path}': {cause.strerror or cause}") from cause
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as cause:
        raise error(f"'{path}' is not valid TOML: {cause}") from cause

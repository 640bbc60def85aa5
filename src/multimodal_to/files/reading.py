"""Files of others, read as text and data only, with errors that say which file and why.

No file is trusted: it may be huge, a device that never ends, or nested and numbered beyond what Python can hold.
"""

from __future__ import annotations

import math
import os
import re
import tomllib
from pathlib import Path
from typing import Any

from multimodal_to.errors import MultimodalError

LARGEST_TOML = 1_000_000
"""The largest TOML file that is read [byte]; a height field of 100 by 100 takes a tenth of it."""

_DEEP_KEY = re.compile(r"""(?<![\w-])(?:(?:[\w-]+|"[^"\n]*"|'[^'\n]*')[ \t]*\.[ \t]*){32}""")
"""A key of more than 32 parts: `tomllib` takes the square of their number, for ever with a million."""


def read_bytes(path: str | os.PathLike[str], largest: int, error: type[MultimodalError]) -> bytes:
    """Return the content of a regular file of at most so many bytes.

    Args:
        path: of the file.
        largest: the most bytes that are read.
        error: the class of what is raised.

    Raises:
        error: the file cannot be read, is no regular file, or is larger.
    """
    source = Path(path)
    try:
        if source.exists() and not source.is_file():  # a pipe or a device may never end
            raise error(f"cannot read '{source}': it is {'a folder' if source.is_dir() else 'no regular file'}")
        with source.open("rb") as stream:
            content = stream.read(largest + 1)
    except (OSError, ValueError) as cause:
        raise error(f"cannot read '{source}': {getattr(cause, 'strerror', None) or cause}") from cause
    if len(content) > largest:
        raise error(f"'{source}' is larger than {largest / 1e6:g} MB, the most that is read of such a file")
    return content


def read_toml(path: str | os.PathLike[str], error: type[MultimodalError]) -> dict[str, Any]:
    """Return what a TOML file holds.

    Raises:
        error: the file cannot be read, is larger than `LARGEST_TOML`, or is not valid TOML.
    """
    content = read_bytes(path, LARGEST_TOML, error)
    try:
        return parse_toml(content.decode("utf-8"))
    except ValueError as cause:
        raise error(f"'{Path(path)}' is not valid TOML: {cause}") from cause


def parse_toml(text: str) -> dict[str, Any]:
    """Return what a TOML text holds.

    Raises:
        ValueError: the text is not valid TOML, or nests or counts beyond measure.
    """
    if _DEEP_KEY.search(text):
        raise ValueError("a key has more than 32 parts")
    try:
        return tomllib.loads(text)
    except RecursionError as cause:
        raise ValueError("its lists or tables are nested too deep") from cause


def is_number(value: Any) -> bool:
    """Return whether a value of a file is a number that a float can hold."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        return False
    try:
        return math.isfinite(value)
    except OverflowError:  # an integer of hundreds of digits
        return False

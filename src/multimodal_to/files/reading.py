"""Files of others, read as text and data only, with errors that say which file and why.

No file is trusted: it may be huge, a device that never ends, or nested and numbered beyond what Python can hold.
"""

from __future__ import annotations

import math
import os
import re
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from multimodal_to.errors import MultimodalError, shown, unknown

LARGEST_TOML = 1_000_000
"""The largest TOML file that is read [byte]; a height field of 100 by 100 takes a tenth of it."""

_DEEP_KEY = re.compile(r"""(?<![\w-])(?:(?:[\w-]+|"[^"\n]*"|'[^'\n]*')[ \t]*\.[ \t]*){32}""")
"""A key of more than 32 parts: `tomllib` takes the square of their number, for ever with a million."""


def read_bytes(path: str | os.PathLike[str], largest: int, error: type[MultimodalError]) -> bytes:
    """Return the content of a regular file of at most so many bytes.

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


class Table:
    """A table that is read key by key, so that what is missing, mistyped or left over gets named.

    Args:
        content: as `read_toml` returns it.
        where: what the table is called in errors.
        error: what is raised.
    """

    def __init__(self, content: Mapping[str, Any], where: str, error: type[MultimodalError]) -> None:
        self._content, self._where, self._error, self._read = content, where, error, set[str]()

    def __contains__(self, key: str) -> bool:
        self._read.add(key)
        return key in self._content

    def _take(self, key: str) -> Any:
        if key not in self:
            raise self._error(f"{self._where} lacks '{key}'")
        return self._content[key]

    def _wrong(self, key: str, expected: str) -> MultimodalError:
        return self._error(f"'{key}' in {self._where} is {shown(self._content[key])}; expected {expected}")

    def text(self, key: str, default: str | None = None) -> str:
        """Return a text; the default where there is none."""
        if default is not None and key not in self:
            return default
        value = self._take(key)
        if not isinstance(value, str):
            raise self._wrong(key, "a text")
        return value

    def number(self, key: str, default: float | None = None) -> float:
        """Return a finite number; the default where there is none."""
        if default is not None and key not in self:
            return default
        value = self._take(key)
        if not is_number(value):
            raise self._wrong(key, "a finite number")
        return float(value)

    def numbers(self, key: str, count: int, default: NDArray[np.float64] | None = None) -> NDArray[np.float64]:
        """Return a list of so many finite numbers, (count,); the default where there is none."""
        if default is not None and key not in self:
            return default
        value = self._take(key)
        if not isinstance(value, list) or len(value) != count or not all(map(is_number, value)):
            raise self._wrong(key, f"{count} finite numbers")
        return np.array(value, dtype=float)

    def texts(self, key: str) -> tuple[str, ...]:
        """Return a list of different names."""
        value = self._take(key)
        if not isinstance(value, list) or not all(isinstance(item, str) for item in value):
            raise self._wrong(key, "a list of names")
        if len(set(value)) < len(value):
            raise self._wrong(key, "each name once")
        return tuple(value)

    def table(self, key: str) -> Table:
        """Return a table within."""
        value = self._take(key)
        if not isinstance(value, dict):
            raise self._wrong(key, "a table")
        return Table(value, f"[{key}]", self._error)

    def tables(self, key: str) -> list[Table]:
        """Return an array of tables; none where there is no such key."""
        value = self._content[key] if key in self else []
        if not isinstance(value, list) or not all(isinstance(item, dict) for item in value):
            raise self._wrong(key, f"tables, [[{key}]]")
        return [Table(item, f"[[{key}]] number {index}", self._error) for index, item in enumerate(value, start=1)]

    def names(self) -> list[str]:
        """Return the keys."""
        return list(self._content)

    def done(self) -> None:
        """Refuse keys that nothing has asked for."""
        for key in self._content:
            if key not in self._read:
                raise self._error(f"{self._where}: {unknown('key', key, sorted(self._read))}")

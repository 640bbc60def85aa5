"""Output fitted to its stream: what a terminal or a redirected file cannot say is said in ASCII, never refused."""

from __future__ import annotations

import codecs
import io
import json
import sys
from typing import Any

_LOOK_ALIKE = str.maketrans(
    {
        **dict(zip("⁰¹²³⁴⁵⁶⁷⁸⁹⁻", "0123456789-", strict=True)),
        **dict.fromkeys("–—−‐‑", "-"),
        **{"←": "<-", "→": "->", "×": "x", "·": "*", "∘": "*", "±": "+-", "≤": "<=", "≥": ">=", "≈": "~"},
        **{"√": "sqrt", "°": " deg", "…": "..."},
        **dict.fromkeys("‘’", "'"),
        **dict.fromkeys("“”", '"'),
        **dict.fromkeys("│┃", "|"),
        **dict.fromkeys("─━", "-"),
    }
)
"""The library's own signs; letters are escaped instead, so that no name becomes another one."""


def fit() -> None:
    """Let standard output and standard error take every text, whatever their encoding is."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            ascii_only = codecs.lookup(stream.encoding).name == "ascii"
            stream.reconfigure(encoding=_ASCII if ascii_only else None, errors=_FITTED)


def print_json(data: Any) -> None:
    """Print data as JSON; what the stream cannot say is escaped, as JSON does it."""
    text = json.dumps(data, indent=2, ensure_ascii=False)
    sys.stdout.write((text if _sayable(text) else json.dumps(data, indent=2)) + "\n")


def print_toml(text: str) -> None:
    """Print a TOML document without comments; what the stream cannot say is escaped, as TOML does it."""
    escaped = text.encode("ascii", _TOML).decode("ascii")
    sys.stdout.write(text if _sayable(text) else escaped)


def _sayable(text: str) -> bool:
    try:
        text.encode(sys.stdout.encoding or "utf-8")
    except UnicodeEncodeError:
        return False
    return True


def _fitted(error: UnicodeError) -> tuple[str, int]:
    if not isinstance(error, UnicodeEncodeError):
        raise error
    parts = (part.translate(_LOOK_ALIKE) for part in error.object[error.start : error.end])
    return "".join(parts).encode("ascii", "backslashreplace").decode("ascii"), error.end


def _toml_escapes(error: UnicodeError) -> tuple[str, int]:
    if not isinstance(error, UnicodeEncodeError):
        raise error
    return "".join(f"\\U{ord(part):08x}" for part in error.object[error.start : error.end]), error.end


def _ascii_by_our_name(name: str) -> codecs.CodecInfo | None:
    """Return ASCII under a name of our own: click takes a stream that is ASCII by name for a mistake, and for UTF-8."""
    if name != _ASCII:
        return None
    plain = codecs.lookup("ascii")
    return codecs.CodecInfo(
        plain.encode,
        plain.decode,
        plain.streamreader,
        plain.streamwriter,
        plain.incrementalencoder,
        plain.incrementaldecoder,
        name=_ASCII,
    )


_FITTED, _TOML, _ASCII = "multimodal_to_fitted", "multimodal_to_toml", "multimodal_to_ascii"
codecs.register_error(_FITTED, _fitted)
codecs.register_error(_TOML, _toml_escapes)
codecs.register(_ascii_by_our_name)

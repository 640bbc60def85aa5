"""Numbers in texts, by XML's grammar (`xs:double`) and not by Python's, which takes `1_5`, `nan` and `infinity`."""

from __future__ import annotations

import re

WORD = re.compile(r"[+-]?(?:(?:[0-9]+(?:\.[0-9]*)?|\.[0-9]+)(?:[eE][+-]?[0-9]+)?|INF)", re.ASCII)
_BLANK = re.compile(r"[ \t\r\n]+")
_WHOLE = re.compile(r"[+-]?[0-9]+", re.ASCII)


def number(text: str) -> float:
    """Return the number that a text is, such as `-1.5e3`, `.5` or `INF`; blanks around it don't count.

    Raises:
        ValueError: the text is no number. `nan` is none.
    """
    word = text.strip(" \t\r\n")
    if not WORD.fullmatch(word):
        raise ValueError(f"'{word}' is no number")
    return float(word)


def whole_number(text: str) -> int:
    """Return the whole number that a text is.

    Raises:
        ValueError: the text is none.
    """
    word = text.strip(" \t\r\n")
    if not _WHOLE.fullmatch(word):
        raise ValueError(f"'{word}' is no whole number")
    return int(word)


def numbers(text: str) -> list[float]:
    """Return the numbers of a text, with blanks between them.

    Raises:
        ValueError: a word is no number.
    """
    return [number(word) for word in _BLANK.split(text.strip(" \t\r\n")) if word]

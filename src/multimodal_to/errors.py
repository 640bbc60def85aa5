"""The errors that this library raises on purpose: one base class and its few children."""

from __future__ import annotations

import reprlib
from collections.abc import Iterable
from difflib import get_close_matches
from itertools import islice

LONGEST = 2000
"""Characters of an error's sentence: names and values in it may come from a file of any kind."""
_NAMED = 60
"""So many of the names that exist are listed."""
_COMPARED = 2000
"""So many names are searched for the nearest one, which takes time for each."""


class MultimodalError(Exception):
    """Base of every error that the library raises on purpose; its text is one sentence for a person.

    What cannot be printed, a line break or a terminal's control character, is escaped, and a sentence longer than
    `LONGEST` loses its middle.
    """

    def __init__(self, sentence: str) -> None:
        text = "".join(part if part.isprintable() else ascii(part)[1:-1] for part in shortened(sentence, LONGEST))
        super().__init__(text)


class InputError(MultimodalError, ValueError):
    """An argument has the wrong shape, a NaN, or a value outside its range."""


class ModelError(MultimodalError):
    """A URDF or a robot folder is missing, broken, or says something that no robot can have."""


class ScenarioError(MultimodalError):
    """A scenario is unknown, contradicts itself, or does not fit its robot."""


class FormulationError(MultimodalError):
    """A term, or a formulation, is not what a problem can be made of."""


class SolverError(MultimodalError):
    """The solver could not be run at all; a solve that ends without an answer is a status, not an error."""


class TrajectoryError(MultimodalError):
    """A trajectory file is missing, broken, or lacks a quantity."""


class OutputError(MultimodalError):
    """A result cannot be written where it was asked for."""


def unknown(kind: str, name: str, available: Iterable[str]) -> str:
    """Return the sentence for a name that does not exist: what was asked, the nearest name, and what exists.

    Of many names, only the first `_NAMED` are listed.

    >>> unknown("scenario", "takeoff", ["take-off", "jump"])
    "unknown scenario 'takeoff'; did you mean 'take-off'? Available: take-off, jump"
    """
    names, name = list(available), shortened(name, 100)
    near = get_close_matches(name, islice(names, _COMPARED), n=1)
    hint = f"; did you mean '{near[0]}'?" if near else "."
    return f"unknown {kind} '{name}'{hint} Available: {listed(names)}"


def said(error: BaseException) -> str:
    r"""Return what another library says of an error, in one line: many write several.

    >>> said(ValueError("mass must be positive\nElement 'base'"))
    "mass must be positive Element 'base'"
    """
    return " ".join(str(error).split())


def listed(names: Iterable[str]) -> str:
    """Return names with commas between them; of many, the first ones and how many more there are.

    >>> listed(["a", "b"]), listed([])
    ('a, b', 'none')
    """
    every = list(names)
    more = f" and {len(every) - _NAMED} more" if len(every) > _NAMED else ""
    return ", ".join(shortened(name, 100) for name in every[:_NAMED]) + more or "none"


def shown(value: object) -> str:
    """Return how a value of a file reads in a sentence, in short.

    >>> shown([1, "two"])
    "[1, 'two']"
    """
    try:
        return _SHORT.repr(value)
    except ValueError:  # more digits than Python writes
        return "a number of thousands of digits"


def apart(value: float, *others: float, digits: int = 3) -> str:
    """Return a number with as many digits as tell it from others, at least so many.

    >>> apart(0.1, 0.1003), apart(0.10030412, 0.1), apart(2.0, 3.0)
    ('0.1', '0.1003', '2')
    """
    for count in range(digits, 17):
        text = f"{value:.{count}g}"
        if all(float(text) != float(f"{other:.{count}g}") for other in others if other != value):
            return text
    return repr(float(value))


def shortened(text: str, length: int) -> str:
    """Return a text without its middle where it is longer than so many characters."""
    return text if len(text) <= length else f"{text[: length - length // 3]} … {text[-(length // 3) :]}"


_SHORT = reprlib.Repr()
_SHORT.maxstring = _SHORT.maxother = 100

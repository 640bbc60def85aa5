"""The errors that this library raises on purpose: one base class and its few children."""

from __future__ import annotations

from collections.abc import Iterable
from difflib import get_close_matches


class MultimodalError(Exception):
    """Base of every error that the library raises on purpose; its text is one sentence for a person."""


class InputError(MultimodalError, ValueError):
    """An argument has the wrong shape, a NaN, or a value outside its range."""


class ModelError(MultimodalError):
    """A URDF or a robot folder is missing, broken, or says something that no robot can have."""


class ScenarioError(MultimodalError):
    """A scenario is unknown, contradicts itself, or does not fit its robot."""


class SolverError(MultimodalError):
    """The solver could not be run at all; a solve that ends without an answer is a status, not an error."""


class TrajectoryError(MultimodalError):
    """A trajectory file is missing, broken, or lacks a quantity."""


class OutputError(MultimodalError):
    """A result cannot be written where it was asked for."""


def unknown(kind: str, name: str, available: Iterable[str]) -> str:
    """Return the sentence for a name that does not exist: what was asked, the nearest name, and what exists.

    >>> unknown("scenario", "takeoff", ["take-off", "jump"])
    "unknown scenario 'takeoff'; did you mean 'take-off'? Available: take-off, jump"
    """
    names = list(available)
    near = get_close_matches(name, names, n=1)
    hint = f"; did you mean '{near[0]}'?" if near else "."
    return f"unknown {kind} '{name}'{hint} Available: {', '.join(names) or 'none'}"

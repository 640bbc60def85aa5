"""Instants of a horizon, as tasks say them: a share from 0 to 1, "start" or "end"."""

from __future__ import annotations

from typing import Final, Literal

from multimodal_to.errors import MultimodalError, shown

Instant = float | Literal["start", "end"]
"""A share of the horizon from 0 to 1, "start" or "end" [1]."""
START: Final = "start"
END: Final = "end"
_NAMED = {START: 0.0, END: 1.0}
SAID = f"a share from 0 to 1, '{START}' or '{END}'"


def share(instant: Instant) -> float:
    """Return the share of the horizon that is over at an instant [1].

    >>> share("start"), share(0.25), share("end")
    (0.0, 0.25, 1.0)
    """
    return _NAMED[instant] if isinstance(instant, str) else float(instant)


def knot_at(instant: Instant, knots: int) -> int:
    """Return the knot that is the nearest to an instant.

    Args:
        instant: of the horizon.
        knots: N, the number of intervals.
    """
    return round(share(instant) * knots)


def check_instant(instant: Instant, what: str, error: type[MultimodalError]) -> None:
    """Refuse what is no instant.

    Args:
        instant: that is checked.
        what: errors call it.
        error: class of the error.
    """
    known = instant in _NAMED if isinstance(instant, str) else 0.0 <= instant <= 1.0
    if not known:
        raise error(f"{what} is {shown(instant)}; expected {SAID}")


def check_stretch(
    begin: Instant, end: Instant, what: str, error: type[MultimodalError], *, points: bool = False
) -> None:
    """Refuse a stretch that ends before it begins.

    Args:
        begin: of the stretch.
        end: of the stretch.
        what: errors call it.
        error: class of the error.
        points: take a stretch without length too.
    """
    check_instant(begin, f"{what}: begin", error)
    check_instant(end, f"{what}: end", error)
    if not (share(begin) < share(end) or (points and share(begin) == share(end))):
        order = "no later than" if points else "before"
        raise error(f"{what}: begin is {shown(begin)} and end {shown(end)}; expected a begin {order} the end")

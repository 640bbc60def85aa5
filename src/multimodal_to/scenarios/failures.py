"""Things that fail during a motion."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from multimodal_to.arguments import check_fields
from multimodal_to.errors import ScenarioError, shown, unknown
from multimodal_to.trajectory.instants import Instant, check_instant, knot_at, share


@dataclass(frozen=True, kw_only=True)
class JetFailure:
    """A jet that fails. One that fails at the start never lights; one that fails later gets no more fuel than it must.

    From then on its throttle is at its least. Its thrust runs down by the model of the turbine, to what that model
    idles at.

    Raises:
        ScenarioError: the time is no share of the horizon.
    """

    jet: str
    """The jet, by its name."""
    at: Instant = 0.0
    """When it fails: a share of the horizon below 1, or "start" [1]."""

    def __post_init__(self) -> None:
        check_fields(self, ScenarioError, "failures: ")
        check_instant(self.at, "failures: at", ScenarioError)
        if share(self.at) == 1.0:
            raise ScenarioError(f"failures: at is {shown(self.at)}; expected at least 0 and below 1, of the horizon")


def failing_knots(failures: Sequence[JetFailure], jets: Sequence[str], knots: int) -> dict[int, int]:
    """Return from which knot on each jet that fails has failed, by its place among the jets.

    Args:
        failures: of a scenario.
        jets: the names of the robot's jets.
        knots: N, the number of intervals.

    Raises:
        ScenarioError: there is no jet of a name.
    """
    found = dict[int, int]()
    for failure in failures:
        if failure.jet not in jets:
            raise ScenarioError(f"failures: {unknown('jet', failure.jet, jets)}")
        row, knot = list(jets).index(failure.jet), knot_at(failure.at, knots)
        found[row] = min(knot, found.get(row, knot))
    return found

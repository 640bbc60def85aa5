"""How much longer a solve may take: a guess from what the bundled scenarios took, since nobody can know."""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass

from multimodal_to.scenarios import SCENARIOS
from multimodal_to.scenarios.scenario import Scenario
from multimodal_to.values import FrozenMapping

TYPICAL_ITERATIONS: Mapping[str, int] = FrozenMapping(
    {"take-off": 61, "take-off-and-landing": 122, "landing": 104, "walk-to-fly": 121, "jump": 157, "step-up": 183}
)
"""Iterations of the bundled scenarios, as plans that the robot carries out, in the run that README's table shows."""

_LATELY = 12  # iterations whose pace the guess goes by: those of the rough pass are faster


@dataclass(frozen=True, kw_only=True)
class Expectation:
    """How many iterations a solve may take, because a bundled scenario took so many."""

    iterations: int
    like: str  # name of that scenario

    def __str__(self) -> str:
        """Return the expectation as a clause."""
        return f"{self.like} took {self.iterations} iterations, by which the time left is guessed"


def expect(scenario: Scenario) -> Expectation | None:
    """Return what to expect of a scenario: of the bundled one of its name, or the slowest of its kind; else None.

    Of one kind are scenarios that start and end alike, with or without jets and footsteps in their guess.
    """
    if scenario.name in TYPICAL_ITERATIONS:
        return Expectation(iterations=TYPICAL_ITERATIONS[scenario.name], like=scenario.name)
    alike = [name for name in TYPICAL_ITERATIONS if _kind(SCENARIOS[name]()) == _kind(scenario)]
    if not alike:
        return None
    slowest = max(alike, key=TYPICAL_ITERATIONS.__getitem__)
    return Expectation(iterations=TYPICAL_ITERATIONS[slowest], like=slowest)


def _kind(scenario: Scenario) -> tuple[object, ...]:
    return scenario.start, scenario.terminal, scenario.jets, scenario.guess_steps > 0


class Rest:
    """The time left of a solve, at the pace of its last iterations."""

    def __init__(self, expectation: Expectation) -> None:
        self._expectation = expectation
        self._lately: deque[tuple[int, float]] = deque(maxlen=_LATELY)

    def after(self, iteration: int, elapsed: float) -> str:
        """Return in words what is left after an iteration [s since the start]."""
        self._lately.append((iteration, elapsed))
        left = self._expectation.iterations - iteration
        if left <= 0:
            return f"longer than {self._expectation.like}"
        (first, start), (last, end) = self._lately[0], self._lately[-1]
        if last - first < _LATELY // 2:
            return "time left not known yet"
        return f"perhaps {left * (end - start) / (last - first):.0f} s left"

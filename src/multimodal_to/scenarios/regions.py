"""Where a robot may be: walls that it stays on one side of, and boxes that it keeps out of or stays in."""

from __future__ import annotations

import math
from dataclasses import dataclass

from multimodal_to.arguments import check_fields
from multimodal_to.errors import ScenarioError, shown
from multimodal_to.trajectory.instants import Instant, check_stretch

Vector3 = tuple[float, float, float]


@dataclass(frozen=True, kw_only=True)
class Wall:
    """A half-space that the robot stays in: n·p ≥ offset for the unit normal n, which points to where the robot is.

    Raises:
        ScenarioError: numbers that make no half-space or no stretch.
    """

    normal: Vector3
    """Direction from the wall to where the robot may be, of any length, in world axes [1]."""
    offset: float
    """Where the wall is: n·p of its points, with n of length 1 [m]."""
    of: tuple[str, ...] = ()
    """Links or frames whose origins stay there; without any, all capsules of the robot's links do."""
    distance: float = 0.0
    """How far they stay away from the wall [m]."""
    begin: Instant = 0.0
    """From when on: a share of the horizon, "start" or "end" [1]."""
    end: Instant = 1.0
    """Until when, likewise [1]."""

    def __post_init__(self) -> None:
        _check(self, "walls")
        length = math.hypot(*self.normal)
        if not (0.0 < length < math.inf and math.isfinite(self.offset)):
            raise ScenarioError(
                f"walls: normal is {shown(self.normal)} and offset {shown(self.offset)}; expected a direction with a "
                "length, and a finite number"
            )

    @property
    def unit(self) -> Vector3:
        """Return n, of length 1."""
        x, y, z = (number / math.hypot(*self.normal) for number in self.normal)
        return x, y, z


@dataclass(frozen=True, kw_only=True)
class Box:
    """A box along the world's axes that the robot keeps out of or, if it says so, stays in.

    Raises:
        ScenarioError: numbers that make no box or no stretch.
    """

    lower: Vector3
    """Its corner with the least x, y and z [m]."""
    upper: Vector3
    """Its corner with the greatest x, y and z [m]."""
    inside: bool = False
    """Whether the robot stays in it, and does not keep out of it."""
    of: tuple[str, ...] = ()
    """Links or frames whose origins do so; without any, all capsules of the robot's links do."""
    distance: float = 0.0
    """How far they stay away from its faces [m]."""
    begin: Instant = 0.0
    """From when on: a share of the horizon, "start" or "end" [1]."""
    end: Instant = 1.0
    """Until when, likewise [1]."""

    def __post_init__(self) -> None:
        _check(self, "boxes")
        if not all(-math.inf < low < high < math.inf for low, high in zip(self.lower, self.upper, strict=True)):
            raise ScenarioError(
                f"boxes: lower is {shown(self.lower)} and upper {shown(self.upper)}; expected finite numbers that rise "
                "along each axis"
            )


Region = Wall | Box


def _check(region: Wall | Box, what: str) -> None:
    if isinstance(region.of, str):
        object.__setattr__(region, "of", (region.of,))
    check_fields(region, ScenarioError, f"{what}: ")
    object.__setattr__(region, "of", tuple(region.of))
    for name in ("normal", "lower", "upper"):
        if (value := getattr(region, name, None)) is not None:
            if len(value) != 3:
                raise ScenarioError(f"{what}: {name} is {shown(value)}; expected three numbers")
            object.__setattr__(region, name, tuple(map(float, value)))
    check_stretch(region.begin, region.end, what, ScenarioError, points=True)
    if not 0.0 <= region.distance < math.inf:
        raise ScenarioError(f"{what}: distance is {shown(region.distance)}; expected at least zero [m]")

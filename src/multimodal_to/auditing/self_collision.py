"""How near links and plumes come to each other on a motion, by exact distances that no row of the problem has."""

from __future__ import annotations

from dataclasses import dataclass

from multimodal_to.adam.spatial import Array
from multimodal_to.arguments import checked
from multimodal_to.auditing.findings import Worst, worst_of
from multimodal_to.auditing.property import Judged, Property
from multimodal_to.models import capsule_pairs
from multimodal_to.models.capsule import pair_name
from multimodal_to.models.robot import Robot
from multimodal_to.trajectory import Trajectory

SELF_COLLISION = (
    Property(
        name="link distance",
        unit="m",
        limit=1e-4,
        reason="zero is where capsules touch; the limit is for rounding and for what a smooth distance may be over",
        meaning="overlap of two capsules of links or plumes, minus their distance where they are apart; all pairs of "
        "`robot.capsule_pairs`, by exact distances",
        judged=Judged.WITH_CAPSULES,
    ),
)


@dataclass(frozen=True, kw_only=True)
class Clearance:
    """How near two bodies come on a motion."""

    pair: str  # as `left foot – right foot`
    distance: float  # the least on the motion; negative where they overlap [m]
    knot: int  # at which it is


@checked
def link_findings(robot: Robot, trajectory: Trajectory) -> list[Worst]:
    """Return the largest overlap of two capsules at a knot; nothing for a robot without capsules."""
    if not robot.capsules:
        return []
    names = tuple(pair_name(pair) for pair in robot.capsule_pairs)
    return [worst_of("link distance", -_distances(robot, trajectory), names)]


@checked
def link_clearances(robot: Robot, trajectory: Trajectory) -> tuple[Clearance, ...]:
    """Return the least distance of every pair of `robot.capsule_pairs` over the knots, nearest pairs first.

    Args:
        robot: the robot of the trajectory, with the jets whose plumes count.
        trajectory: its joints are used.
    """
    distances = _distances(robot, trajectory)
    found = [
        Clearance(pair=pair_name(pair), distance=float(row.min()), knot=int(row.argmin()))
        for pair, row in zip(robot.capsule_pairs, distances, strict=True)
    ]
    return tuple(sorted(found, key=lambda entry: entry.distance))


def _distances(robot: Robot, trajectory: Trajectory) -> Array:
    return capsule_pairs.distances(robot.kindyn, trajectory.joint_positions, robot.capsule_pairs)

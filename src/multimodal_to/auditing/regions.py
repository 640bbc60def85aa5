"""Whether a motion keeps out of boxes, and stays in others and on its side of walls, by exact distances."""

from __future__ import annotations

import numpy as np

from multimodal_to.adam.spatial import Array
from multimodal_to.auditing.findings import Motion, Worst, worst_of
from multimodal_to.auditing.property import Judged, Property
from multimodal_to.models.bodies import bodies_of
from multimodal_to.models.capsule import Capsule
from multimodal_to.models.robot import Robot
from multimodal_to.scenarios.regions import Box, Region, Wall
from multimodal_to.scenarios.scenario import Scenario
from multimodal_to.trajectory.instants import knot_at

REGIONS = (
    Property(
        name="beyond a wall or a box",
        unit="m",
        limit=1e-5,
        reason="what a feasible motion may miss its row by; smooth distances are shorter",
        meaning="how much nearer than its `distance` a capsule or an origin is to a face that it has to keep away from",
        judged=Judged.WITH_REGIONS,
    ),
)
_PARTS = 50  # of a capsule's segment, at whose ends it is looked at


def region_findings(motion: Motion, scenario: Scenario) -> list[Worst]:
    """Compare a motion with the walls and boxes of its scenario; without any there is nothing to judge."""
    regions: tuple[Region, ...] = (*scenario.walls, *scenario.boxes)
    if not regions:
        return []
    trajectory, rows, names = motion.trajectory, list[Array](), list[str]()
    for region in regions:
        first, last = (knot_at(when, trajectory.knots) for when in (region.begin, region.end))
        for body in bodies_of(motion.robot, region.of):
            row = np.full(trajectory.knots + 1, -np.inf)
            within = slice(first, last + 1)
            free = room(motion.robot, region, body, motion.base[within], trajectory.joint_positions[:, within])
            row[within] = region.distance - free
            rows.append(row)
            names.append(body.name)
    return [worst_of("beyond a wall or a box", np.array(rows), tuple(names))]


def room(robot: Robot, region: Region, body: Capsule, bases: Array, joints: Array) -> Array:
    """Return how far a body is from a region's faces in many postures, on the side where it may be [m], (count,).

    Args:
        robot: whose body it is.
        region: a wall or a box.
        body: a capsule of a link.
        bases: w_H_base of each posture, (count, 4, 4).
        joints: positions of the joints [rad or m], (n, count).
    """
    count = bases.shape[0]
    side_by_side = np.array(robot.kindyn.forward_kinematics_fun(body.frame).map(count)(np.hstack(list(bases)), joints))
    poses = side_by_side.reshape(4, count, 4).transpose(1, 0, 2)
    shares = np.linspace(0.0, 1.0, _PARTS + 1 if body.length else 1)[:, None]
    places = body.start + shares * (body.end - body.start)
    points = np.einsum("kij,pj->kpi", poses[:, :3, :3], places) + poses[:, None, :3, 3]
    return np.asarray(_distances(region, points).min(axis=1) - body.radius)


def _distances(region: Wall | Box, points: Array) -> Array:
    """Return how far points are from the faces, on the side where they may be [m], (..., 3) → (...)."""
    if isinstance(region, Wall):
        return np.asarray(points @ np.array(region.unit) - region.offset)
    lower, upper = np.array(region.lower), np.array(region.upper)
    beyond = np.maximum(lower - points, points - upper)
    if region.inside:
        return np.asarray(-beyond.max(axis=-1))
    outside = np.linalg.norm(np.maximum(beyond, 0.0), axis=-1)
    return np.asarray(outside + np.minimum(beyond.max(axis=-1), 0.0))

"""The rows of walls and boxes: capsules of links, or origins of frames, stay on one side of their faces."""

from __future__ import annotations

import math

import casadi as cs
import numpy as np

from multimodal_to.adam.spatial import SX
from multimodal_to.models.bodies import bodies_of
from multimodal_to.models.capsule import Capsule
from multimodal_to.ocp.knot import Knot
from multimodal_to.ocp.parameters import Parameters
from multimodal_to.ocp.schedule import Flags
from multimodal_to.ocp.terms import Constraint, at_least
from multimodal_to.scenarios.regions import Box, Region, Wall
from multimodal_to.scenarios.scenario import Scenario
from multimodal_to.trajectory.instants import knot_at

_ROUND = 0.005
"""Over how much the edges of a box that is kept out of are rounded off, outwards [L]."""


def room(knot: Knot, parameters: Parameters) -> SX:
    """How far each ball of each body is from each face, less its radius and the distance that is asked for.

    Of a wall or a box that the robot stays in, the balls are those at both ends of a capsule. Of a box that it keeps
    out of, they stand along the capsule and cover it. There the row is a smooth max(|p − c| − h) over the axes, with
    the box's middle c and half its sides h, which is never more than the distance itself.
    """
    robot, rows = parameters.robot, [cs.SX(0, 1)]
    for region in regions_of(parameters.scenario):
        for body in bodies_of(robot, region.of):
            pose = knot.pose(body.frame)
            places, radius = _balls(region, body)
            for place in places:
                point = pose.rotation @ cs.DM(place) + pose.translation
                rows.append(_room(region, point, _ROUND * robot.standing_height) - radius - region.distance)
    return cs.vertcat(*rows)


def regions_of(scenario: Scenario) -> tuple[Region, ...]:
    """Return the walls, then the boxes of a scenario."""
    return (*scenario.walls, *scenario.boxes)


def _balls(region: Region, body: Capsule) -> tuple[list[np.ndarray], float]:
    """Return where the balls of a body are, in its frame [m], and their radius [m]."""
    if not body.length:
        return [body.start], body.radius
    if isinstance(region, Wall) or region.inside:
        return [body.start, body.end], body.radius
    count = 1 + math.ceil(body.length / body.radius)
    places = [body.start + share * (body.end - body.start) for share in np.linspace(0.0, 1.0, count)]
    return places, math.hypot(body.radius, 0.5 * body.length / (count - 1))


def _room(region: Region, point: SX, rounding: float) -> SX:
    """Return how far a point is from the faces of a region [m]: one row, or one for each face of a box around it.

    Args:
        region: a wall or a box.
        point: in the world [m], (3, 1).
        rounding: of the edges of a box that is kept out of [m].
    """
    if isinstance(region, Wall):
        return cs.dot(cs.DM(region.unit), point) - region.offset
    if region.inside:
        return cs.vertcat(point - cs.DM(region.lower), cs.DM(region.upper) - point)
    lower, upper = np.array(region.lower), np.array(region.upper)
    off = cs.sqrt((point - cs.DM(0.5 * (lower + upper))) ** 2 + rounding**2) - cs.DM(0.5 * (upper - lower))
    greatest = off[0]
    for other in (off[1], off[2]):
        greatest = 0.5 * (greatest + other + cs.sqrt((greatest - other) ** 2 + rounding**2))
    return greatest - 2.0 * rounding


def _count(region: Region) -> int:
    return 6 if isinstance(region, Box) and region.inside else 1


def _within(parameters: Parameters) -> Flags:
    """Return at which knots each row holds, (rows, N + 1)."""
    scenario, rows = parameters.scenario, list[np.ndarray]()
    knots = np.arange(scenario.knots + 1)
    for region in regions_of(scenario):
        first, last = (knot_at(when, scenario.knots) for when in (region.begin, region.end))
        count = sum(len(_balls(region, body)[0]) for body in bodies_of(parameters.robot, region.of))
        rows += [(knots >= first) & (knots <= last)] * (count * _count(region))
    return np.array(rows, dtype=bool).reshape(-1, knots.size)


def _labels(parameters: Parameters) -> tuple[str, ...]:
    labels, scenario = list[str](), parameters.scenario
    named: list[tuple[str, Region]] = [(f"wall {index}", wall) for index, wall in enumerate(scenario.walls, 1)]
    named += [(f"box {index}", box) for index, box in enumerate(scenario.boxes, 1)]
    for what, region in named:
        faces = ["-x", "-y", "-z", "+x", "+y", "+z"] if _count(region) > 1 else [""]
        for body in bodies_of(parameters.robot, region.of):
            for ball in range(1, len(_balls(region, body)[0]) + 1):
                labels += [f"{body.name} {ball} {what} {face}".rstrip() for face in faces]
    return tuple(labels)


def _any(parameters: Parameters) -> bool:
    return bool(regions_of(parameters.scenario))


ROOM = Constraint(value=room, within=at_least(0.0), unit="m", scale=0.1, labels=_labels, when=_any, present=_within)

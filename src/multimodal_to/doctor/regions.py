"""Whether the robot starts, and keyframes ask for frames, where walls and boxes let them be."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from multimodal_to.auditing.regions import room
from multimodal_to.doctor.diagnosis import Symptom, error
from multimodal_to.doctor.task import Task
from multimodal_to.errors import ModelError
from multimodal_to.models.bodies import bodies_of
from multimodal_to.models.units import Sized
from multimodal_to.ocp.regions import regions_of
from multimodal_to.scenarios.regions import Region, Vector3, Wall
from multimodal_to.trajectory.instants import knot_at

_NEAR = Sized(1e-5, "m")
"""By how much a start may be nearer than the distance that is asked for."""


def regions(task: Task) -> Iterator[Symptom]:
    """Look for bodies that a standing start puts beyond a wall or a box, and for names that the robot has not."""
    robot, posture = task.robot, task.start_posture
    for region in regions_of(task.scenario):
        try:
            bodies = bodies_of(robot, region.of)
        except ModelError as cause:
            yield error("walls and boxes", str(cause), "name frames of the robot in 'of', or give it capsules")
            continue
        if posture is None or knot_at(region.begin, task.scenario.knots) > 0:
            continue
        base, joints = posture.base_transform[None], posture.joint_positions[:, None]
        free = {body.name: float(room(robot, region, body, base, joints)[0]) - region.distance for body in bodies}
        name = min(free, key=lambda body: free[body])
        if free[name] < -_NEAR.of(task.robot.units):
            yield error(
                "walls and boxes",
                f"in the posture in which the motion starts, '{name}' is {-free[name]:.3g} m beyond where "
                f"{region} lets it be",
                "move the region, start elsewhere, or let the region begin later",
            )


def targets(task: Task) -> Iterator[Symptom]:
    """Look for frames that a keyframe asks to be where a wall or a box that names them in `of` does not let them be.

    A frame with a tolerance may be anywhere within that.
    """
    knots = task.scenario.knots
    for one in task.scenario.own_keyframes():
        for name, target in one.keyframe.frames.items():
            if one.keyframe.weight is not None or not isinstance(target.position, tuple):
                continue
            for region in regions_of(task.scenario):
                within = knot_at(region.begin, knots) <= one.knot <= knot_at(region.end, knots)
                if not within or name not in region.of:
                    continue
                slack = target.position_tolerance * math.sqrt(3.0)
                if (lacks := region.distance - _free(region, target.position) - slack) > _NEAR.of(task.robot.units):
                    yield error(
                        one.label,
                        f"{name} has to be at {target.position} m, {lacks:.3g} m beyond where {region} lets it be",
                        "move the region, or ask for another point",
                    )


def _free(region: Region, place: Vector3) -> float:
    """Return how far a point is within where a region lets it be [m]; negative beyond."""
    point = np.array(place)
    if isinstance(region, Wall):
        return float(np.array(region.unit) @ point) - region.offset
    out = np.maximum(np.array(region.lower) - point, point - np.array(region.upper))  # of each face, positive outside
    away = float(np.linalg.norm(np.maximum(out, 0.0))) + min(float(out.max()), 0.0)
    return -away if region.inside else away

"""Whether the robot starts where walls and boxes let it be."""

from __future__ import annotations

from collections.abc import Iterator

from multimodal_to.auditing.regions import room
from multimodal_to.doctor.diagnosis import Symptom, error
from multimodal_to.doctor.task import Task
from multimodal_to.errors import ModelError
from multimodal_to.models.bodies import bodies_of
from multimodal_to.models.units import Sized
from multimodal_to.ocp.regions import regions_of

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
        if posture is None or round(region.begin * task.scenario.knots) > 0:
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

"""Whether contact points and jets are as near to the CoM as the problem wants them."""

from __future__ import annotations

from collections.abc import Iterator

import casadi as cs
import numpy as np

from multimodal_to.doctor.balance import knot_of
from multimodal_to.doctor.diagnosis import Symptom, error, warning
from multimodal_to.doctor.task import Task
from multimodal_to.ocp import paper
from multimodal_to.ocp.terms import Constraint
from multimodal_to.ocp.variables import CONTACT_REACH, JET_REACH

_TOLERANCE = 1e-6  # [1]


def reach(task: Task) -> Iterator[Symptom]:
    """Hold contact points and jets, in the posture that the problem is built around, to their reach from the CoM."""
    robot = task.robot
    for term, names, limits, constant in (
        (paper.CONTACT_REACH, robot.contact_names, CONTACT_REACH, "CONTACT_REACH"),
        (paper.JET_REACH, robot.jet_names, JET_REACH, "JET_REACH"),
    ):
        if task.held(term):
            yield from _beyond(task, term, names, limits, constant)


def _beyond(
    task: Task, term: Constraint, names: tuple[str, ...], limits: tuple[float, ...], constant: str
) -> Iterator[Symptom]:
    robot = task.robot
    knot = knot_of(task, task.posture, cs.SX.zeros(3 * len(robot.contacts)), cs.SX.zeros(len(robot.jets)))

    arms = np.abs(np.array(cs.evalf(term.rows(knot, task.parameters).expression))).reshape(-1, 3)
    if arms.max(initial=0.0) <= 1 + _TOLERANCE:
        return
    point, axis = np.unravel_index(int(arms.argmax()), arms.shape)
    # A robot without moving joints that has to be upright somewhere can bring nothing nearer there.
    certain = task.rigid and bool(task.hovers) and not np.any(task.posture.base_quaternion_xyzw[:3])
    yield (error if certain else warning)(
        "reach",
        f"{names[point]} is {arms[point, axis] * limits[axis]:.3g} m from the CoM along {'xyz'[axis]} in the posture "
        f"that the problem is built around, and the problem allows {limits[axis]:g} m",
        f"bring it nearer, or widen {constant} in ocp/variables.py for a robot of this size",
    )

"""Whether contact points and jets are as near to the CoM as the problem wants them."""

from __future__ import annotations

from collections.abc import Iterator

import casadi as cs
import numpy as np

from multimodal_to.adam.spatial import Array
from multimodal_to.doctor.balance import knot_of
from multimodal_to.doctor.diagnosis import Symptom, error, warning
from multimodal_to.doctor.task import Task
from multimodal_to.errors import apart
from multimodal_to.ocp import paper
from multimodal_to.ocp.terms import Constraint

_TOLERANCE = 1e-6  # [1]


def reach(task: Task) -> Iterator[Symptom]:
    """Hold contact points and jets, in the posture that the problem is built around, to their reach from the CoM."""
    robot = task.robot
    jets = tuple(f"the jet {name}" for name in robot.jet_names)
    for term, names, limits, key in (
        (paper.CONTACT_REACH, robot.contact_names, robot.contact_reach, "contacts"),
        (paper.JET_REACH, jets, robot.jet_reach, "jets"),
    ):
        if task.held(term):
            yield from _beyond(task, term, names, limits, key)


def _upright(task: Task) -> bool:
    """Return whether the posture that the problem is built around has the attitude of a hover."""
    along = task.posture.base_quaternion_xyzw @ task.robot.upright.base_quaternion_xyzw
    return bool(abs(abs(along) - 1.0) < _TOLERANCE)


def _beyond(task: Task, term: Constraint, names: tuple[str, ...], limits: Array, key: str) -> Iterator[Symptom]:
    robot = task.robot
    forces, thrusts = cs.SX.zeros(3 * len(robot.contacts)), cs.SX.zeros(len(robot.jets))
    knot = knot_of(task, task.posture, forces, thrusts)
    arms = np.abs(np.array(cs.evalf(term.rows(knot, task.parameters).expression))).reshape(-1, 3)
    if arms.max(initial=0.0) <= 1 + _TOLERANCE:
        return
    point, axis = np.unravel_index(int(arms.argmax()), arms.shape)
    # A robot without moving joints that has to be upright somewhere can bring nothing nearer there.
    certain = task.rigid and bool(task.hovers) and _upright(task)
    length = float(arms[point, axis] * limits[axis])
    away = apart(length, limits[axis])
    found = (
        f"{names[point]} is {away} m from the CoM along {'xyz'[axis]} in the posture that the problem is built around, "
        f"and the problem allows {limits[axis]:g} m"
    )
    if (
        term == paper.CONTACT_REACH
        and task.stands_at_start
        and task.rests_first
        and axis == 2
        and arms[:, 2].min() > 1 + _TOLERANCE
    ):
        certain = True  # feet that carry the robot are still where they were, and so is its CoM
        found += " from knot 1 on, when a robot that starts at rest has not moved yet"
    yield (error if certain else warning)(
        "reach", found, f"bring it nearer, or widen '{key}' in the [reach] of the robot's robot.toml"
    )

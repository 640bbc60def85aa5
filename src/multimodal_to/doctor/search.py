"""A posture that fulfils some of the problem's own rows, by inverse kinematics and statics."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import casadi as cs
import numpy as np

from multimodal_to.adam import centroidal
from multimodal_to.adam.spatial import SX, Array
from multimodal_to.doctor.balance import knot_of
from multimodal_to.doctor.task import Task
from multimodal_to.models.robot import Posture
from multimodal_to.ocp.knot import Knot
from multimodal_to.ocp.terms import Constraint
from multimodal_to.scenarios.scenario import Vector3


def search(
    task: Task,
    start: Posture,
    com: Vector3,
    *,
    constraints: Sequence[Constraint],
    objective: Callable[[Knot], SX],
    thrusts: Array,
) -> Posture | None:
    """Return the posture with the least objective at rest, without contact forces and within constraints, if found.

    The base keeps its orientation; its position, joints and thrusts are free. Solved by IPOPT, from one start: none
    found is no proof that there is none.

    Args:
        task: robot and scenario.
        start: posture to begin from, moved to where its CoM is at `com`.
        com: [m].
        constraints: of a knot.
        objective: of a knot.
        thrusts: the greatest of each jet [N], (jets,); begun from in equal shares that carry the weight.
    """
    robot, limits = task.robot, task.robot.joint_limits
    position, joints = cs.SX.sym("p", 3), cs.SX.sym("s", len(robot.joint_names))
    thrust = cs.SX.sym("T", len(robot.jets))
    posed = replace(
        knot_of(task, start, cs.SX.zeros(3 * len(robot.contacts)), thrust),
        base_position=position,
        joint_positions=joints,
    )
    knot = replace(
        posed,
        com_position=centroidal.com_position(robot.kindyn.tree, posed.base, joints),
        contact_positions=cs.vertcat(*(posed.pose(name).translation for name in robot.contact_names)),
    )
    parameters = task.parameters
    asked = [term.rows(knot, parameters) for term in constraints]
    variables = cs.vertcat(position, joints, thrust)
    if sum(some.expression.shape[0] for some in asked if some.lower == some.upper) > variables.shape[0]:
        return None  # more equations than unknowns, as for a robot with few joints
    problem = {
        "x": variables,
        "f": objective(knot),
        "g": cs.vertcat(*(some.expression / cs.DM(some.scale) for some in asked)),
    }
    options = {"print_time": False, "ipopt": {"print_level": 0, "sb": "yes", "max_iter": 200, "tol": 1e-6}}
    solver = cs.nlpsol("search", "ipopt", problem, options)
    there = start.base_position + np.array(com) - task.robot.com_at(start)
    share = thrusts * min(robot.weight / max(thrusts.sum(), 1e-9), 1.0)
    answer = solver(
        x0=np.concatenate([there, start.joint_positions, share]),
        lbx=np.concatenate([np.full(3, -np.inf), limits.lower, np.zeros(share.size)]),
        ubx=np.concatenate([np.full(3, np.inf), limits.upper, thrusts]),
        lbg=np.concatenate([some.lower / some.scale for some in asked]),
        ubg=np.concatenate([some.upper / some.scale for some in asked]),
    )
    if not solver.stats()["success"]:
        return None
    values = np.array(answer["x"]).ravel()
    return replace(start, base_position=values[:3], joint_positions=values[3 : 3 + joints.shape[0]])

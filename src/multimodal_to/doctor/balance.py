"""Which forces hold a posture still: a linear programme over contact forces and thrusts, on the problem's own rows."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import casadi as cs
import numpy as np

from multimodal_to.adam.spatial import Array
from multimodal_to.doctor.task import Task
from multimodal_to.models.contact import FrictionCone
from multimodal_to.models.robot import Posture, Robot
from multimodal_to.ocp import constraints
from multimodal_to.ocp.guess import contact_positions
from multimodal_to.ocp.knot import Knot
from multimodal_to.ocp.schedule import Flags

LONG_LEVER = 100.0
"""A lever far longer than any robot [m]: forces are met first, and what is left over is a moment if it can be one."""


@dataclass(frozen=True, kw_only=True)
class Residual:
    """What the forces at hand leave over of weight and moment."""

    force: float  # [N]
    moment: float  # about the CoM [N m]
    carried: float  # the weight [N]
    lever: float  # what makes a force of a moment [m], see `lever_of`

    @property
    def share(self) -> float:
        """Return the residual as a share of the weight, a moment as the force that makes it at `lever`."""
        return (self.force + self.moment / self.lever) / self.carried

    @property
    def nothing(self) -> bool:
        """Return whether the posture is held still, up to a ten-thousandth of the weight."""
        return self.share <= 1e-4

    def __str__(self) -> str:
        return f"{self.force:.3g} N and {self.moment:.3g} N m"


def residual(
    task: Task, posture: Posture, *, feet: bool | Flags, thrusts: Array, lever: float | None = None
) -> Residual:
    """Return the least residual, ‖force‖₁ + ‖moment‖₁ / lever, of a posture at rest.

    Contact forces lie in the friction pyramid, which holds the second-order cone.

    Args:
        task: robot and scenario.
        posture: where everything is.
        feet: whether the contact points push, or which of them do, (contacts,).
        thrusts: the greatest thrust of each jet [N], (jets,).
        lever: what moments are divided by [m], by default `lever_of`; with an infinite one forces act wherever they are
            wanted.
    """
    lever = lever_of(task.robot) if lever is None else lever
    robot, scenario = task.robot, replace(task.scenario, friction_cone=FrictionCone.PYRAMID)
    parameters = replace(task.parameters, scenario=scenario)
    forces = cs.SX.sym("f", 3 * len(robot.contacts))
    thrust = cs.SX.sym("T", len(robot.jets))
    knot = knot_of(task, posture, forces, thrust)
    balance = constraints.static_equilibrium(knot, parameters)
    cone = constraints.friction_cone(knot, parameters)
    free = cs.vertcat(forces, thrust)
    rows = cs.Function("rows", [free], [cs.vertcat(balance, cone), cs.jacobian(cs.vertcat(balance, cone), free)])
    offset, matrix = (np.array(part) for part in rows(np.zeros(free.shape[0])))
    missed = np.vstack([np.eye(6), np.zeros((cone.shape[0], 6))])
    matrix = np.hstack([matrix, missed, -missed])
    counts = np.array([1.0] * 3 + [1.0 / lever] * 3)
    reach = np.where(np.repeat(np.broadcast_to(feet, len(robot.contacts)), 3), np.inf, 0.0)
    programme = cs.conic(
        "balance",
        "highs",
        {"h": cs.Sparsity(matrix.shape[1], matrix.shape[1]), "a": cs.DM(matrix).sparsity()},
        {"highs": {"output_flag": False}},
    )
    answer = programme(
        g=np.concatenate([np.zeros(free.shape[0]), counts, counts]),
        a=matrix,
        lba=-offset,
        uba=np.concatenate([-offset[:6], np.full((cone.shape[0], 1), np.inf)]),
        lbx=np.concatenate([-reach, np.zeros(len(robot.jets) + 12)]),
        ubx=np.concatenate([reach, thrusts, np.full(12, np.inf)]),
    )
    left = np.array(answer["x"]).ravel()[-12:]
    over = left[:6] - left[6:]
    return Residual(
        force=float(np.linalg.norm(over[:3])),
        moment=float(np.linalg.norm(over[3:])) if math.isfinite(lever) else 0.0,
        carried=robot.weight,
        lever=lever_of(robot),
    )


def lever_of(robot: Robot) -> float:
    """Return what weighs a moment against a force [m]: how far along the ground feet may be from the CoM."""
    return float(robot.contact_reach[:2].max())


def knot_of(task: Task, posture: Posture, forces: cs.SX, thrust: cs.SX) -> Knot:
    """Return a knot at rest in a posture, with contact forces [N] and thrusts [N] as symbols.

    Args:
        task: robot and scenario.
        posture: where everything is.
        forces: contact forces on the robot [N], (3 contacts, 1), world.
        thrust: of each jet [N], (jets, 1).
    """
    robot = task.robot
    count, jets = len(robot.joint_names), len(robot.jets)
    return Knot(
        robot=robot,
        com_position=cs.SX(robot.com_at(posture)),
        com_velocity=cs.SX.zeros(3),
        angular_momentum=cs.SX.zeros(3),
        base_position=cs.SX(posture.base_position),
        base_quaternion_xyzw=cs.SX(posture.base_quaternion_xyzw),
        base_linear_velocity=cs.SX.zeros(3),
        base_angular_velocity=cs.SX.zeros(3),
        joint_positions=cs.SX(posture.joint_positions),
        joint_velocities=cs.SX.zeros(count),
        contact_positions=cs.SX(contact_positions(robot, posture)),
        contact_forces=forces,
        thrust=thrust,
        thrust_rate=cs.SX.zeros(jets),
        throttle=cs.SX.zeros(jets),
    )

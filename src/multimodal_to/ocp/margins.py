"""Terms that keep a plan away from the edge of what the robot can do, by the scenario's `Margins`.

Each is a short function of a knot or of an interval; a margin of zero leaves its term out of the problem.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import casadi as cs
import numpy as np
from numpy.typing import NDArray

from multimodal_to.adam.kinematics import Pose, forward_kinematics
from multimodal_to.adam.rnea import inverse_dynamics
from multimodal_to.adam.spatial import SX
from multimodal_to.models import contact
from multimodal_to.models.centroidal import thrust_force
from multimodal_to.models.robot import Robot
from multimodal_to.models.sole import PRESSURE_SLACK, soles
from multimodal_to.ocp import constraints, contacts, costs, paper, pushes
from multimodal_to.ocp.integration import Interval
from multimodal_to.ocp.knot import Knot
from multimodal_to.ocp.parameters import Parameters
from multimodal_to.ocp.self_collision import link_distances, link_pair_labels
from multimodal_to.ocp.terms import Constraint, JointUnits, Where, at_least, between
from multimodal_to.trajectory.pushes import KnownPush


def generalised_forces(interval: Interval, pushed: Sequence[KnownPush] = ()) -> SX:
    """Return M ν̇ + C ν + g − Σ Jᵀ f, (6 + n, 1): wrench left for the base [N, N m], then joint torques [N m].

    At the instant at which velocities change: there the accelerations (ν⁺ − ν) / Δt, the forces and the velocities
    belong together.

    Args:
        interval: with its acceleration.
        pushed: what pushes from outside then.
    """
    knot, tree = interval.at_accelerations, interval.end.robot.kindyn.tree
    lift, rotation = knot.lift, knot.base.rotation
    forces = [lift(rotation.T @ force) for force in knot.forces]
    wrenches = {
        name: cs.vertcat(force, cs.SX(3, 1)) for name, force in zip(knot.robot.contact_names, forces, strict=True)
    }
    base = Pose(cs.SX(cs.DM.eye(3)), cs.SX(3, 1))  # all of it is in its axes
    for index, jet in enumerate(knot.robot.jets):
        nozzle = forward_kinematics(tree, tree.frame(jet.frame), base, knot.joint_positions)
        force = thrust_force(nozzle.rotation, knot.thrust[index])
        moment = jet.drag * force if jet.drag else cs.SX(3, 1)
        wrenches[jet.frame] = wrenches.get(jet.frame, cs.SX(6, 1)) + cs.vertcat(force, moment)
    for push in pushed:
        force = lift(rotation.T @ cs.DM(push.force))
        wrenches[push.of] = wrenches.get(push.of, cs.SX(6, 1)) + cs.vertcat(force, cs.SX(3, 1))
    acceleration = interval.rate(lambda knot: knot.base_linear_velocity) - cs.DM(knot.robot.gravity)
    turning = interval.rate(lambda knot: knot.base_angular_velocity)
    in_base = inverse_dynamics(
        tree,
        base,
        knot.joint_positions,
        cs.vertcat(cs.SX(3, 1), lift(rotation.T @ knot.base_angular_velocity)),
        lift(knot.joint_velocities),
        cs.vertcat(lift(rotation.T @ acceleration), lift(rotation.T @ turning)),
        lift(interval.rate(lambda knot: knot.joint_velocities)),
        cs.SX(3, 1),
        wrenches,
    )
    return cs.vertcat(rotation @ in_base[:3], rotation @ in_base[3:6], in_base[6:])


def limited_joints(robot: Robot) -> NDArray[np.intp]:
    """Return which joints have an effort limit, as their places in s."""
    return np.flatnonzero(np.isfinite(robot.joint_limits.effort))


def joint_torques(interval: Interval, parameters: Parameters) -> SX:
    """τ / τ_max of the joints that have an effort limit, by RNEA."""
    joints = limited_joints(parameters.robot)
    return generalised_forces(interval)[6 + joints] / cs.DM(parameters.robot.joint_limits.effort[joints])


def joint_torques_pushed(interval: Interval, parameters: Parameters) -> SX:
    """τ / τ_max of the joints that have an effort limit, by RNEA under pushes from outside."""
    joints, limits = limited_joints(parameters.robot), parameters.robot.joint_limits.effort
    rows = [
        generalised_forces(interval, some)[6 + joints] / cs.DM(limits[joints]) for some, _ in pushes.groups(parameters)
    ]
    return cs.vertcat(cs.SX(0, 1), *rows)


def friction_cone(knot: Knot, parameters: Parameters) -> SX:
    """|t·f| ≤ η μ n·f as the scenario's pyramid or cone, with the share η of the friction that a plan may use."""
    share = parameters.scenario.margins.friction or 1.0
    return constraints.friction_cone(knot, replace(parameters, friction=share * parameters.friction))


def centre_of_pressure(knot: Knot, parameters: Parameters) -> SX:
    """Moment of the normal forces about each edge of the sole, shrunk about its middle, over m |g| L.

    Σ e_⊥ · (r_i − η a) n·f_i with the place r_i of each contact point in the sole, an edge from a along e, and the
    share η of the sole that a plan may use. None negative where the centre of pressure is inside.
    """
    share = parameters.scenario.margins.pressure
    loads = [
        contact.normal_force(parameters.surface, point, force) / parameters.robot.weight
        for point, force in zip(knot.points, knot.forces, strict=True)
    ]
    rows = [
        cs.dot(cs.DM(edge / parameters.robot.standing_height), cs.vertcat(*(loads[index] for index in sole.members)))
        for sole in soles(parameters.robot)
        for edge in sole.leverage(share)
    ]
    return cs.vertcat(cs.SX(0, 1), *rows)


def touch_down(interval: Interval, parameters: Parameters) -> SX:
    """(Δt (v + κ d⁺) − (d − d⁺)) / L: a point comes down the slower the nearer it is to the ground."""
    robot = parameters.robot
    speed = parameters.scenario.margins.touch_down_speed * robot.units.of("m/s")
    rate = contact.DESCENT_RATE * robot.units.frequency
    rows = []
    for before, after in zip(interval.start.points, interval.end.points, strict=True):
        low = parameters.surface.distance(after)
        rows.append(interval.duration * (speed + rate * low) - (parameters.surface.distance(before) - low))
    return cs.vertcat(*rows) / robot.standing_height


@dataclass(frozen=True)
class _Asked:
    """Whether the scenario asks for a margin; a value, so that terms compare and can be pickled."""

    name: str

    def __call__(self, parameters: Parameters) -> bool:
        return bool(getattr(parameters.scenario.margins, self.name) > 0.0)


def _asked(name: str) -> Callable[[Parameters], bool]:
    return _Asked(name)


def _torque(parameters: Parameters) -> float:
    return parameters.scenario.margins.torque


def _torque_other_way(parameters: Parameters) -> float:
    return -parameters.scenario.margins.torque


def _limited_joint_names(parameters: Parameters) -> tuple[str, ...]:
    return tuple(parameters.robot.joint_names[index] for index in limited_joints(parameters.robot))


def _pushed_joint_names(parameters: Parameters) -> tuple[str, ...]:
    return _limited_joint_names(parameters) * len(pushes.groups(parameters))


def _unpushed(parameters: Parameters) -> NDArray[np.bool_]:
    return pushes.unpushed(parameters, limited_joints(parameters.robot).size)


def _pushed(parameters: Parameters) -> NDArray[np.bool_]:
    return pushes.pushed(parameters, limited_joints(parameters.robot).size)


def _torque_asked_and_pushed(parameters: Parameters) -> bool:
    return bool(parameters.scenario.pushes) and parameters.scenario.margins.torque > 0.0


def _contact_names(parameters: Parameters) -> tuple[str, ...]:
    return parameters.robot.contact_names


def _distance(parameters: Parameters) -> float:
    return parameters.scenario.margins.distance * parameters.robot.standing_height


def _edges(parameters: Parameters) -> tuple[str, ...]:
    names = parameters.robot.contact_names
    return tuple(f"{names[one]} – {names[other]}" for sole in soles(parameters.robot) for one, other in sole.edges)


JOINT_TORQUES = Constraint(
    value=joint_torques,
    within=between(_torque_other_way, _torque),
    unit="1",
    holds=Where.EVERY_INTERVAL,
    labels=_limited_joint_names,
    when=_asked("torque"),
    present=_unpushed,
    lazy=True,  # a torque couples the velocities of two intervals, so that fronts are half as large again
)
JOINT_TORQUES_PUSHED = replace(
    JOINT_TORQUES,
    name="joint_torques_pushed",
    value=joint_torques_pushed,
    labels=_pushed_joint_names,
    when=_torque_asked_and_pushed,
    present=_pushed,
)
FRICTION_CONE = replace(paper.FRICTION_CONE, value=friction_cone)
CENTRE_OF_PRESSURE = Constraint(
    value=centre_of_pressure,
    within=at_least(-PRESSURE_SLACK),
    unit="1",
    holds=(Where.FIRST_KNOT, Where.LATER_KNOTS),
    scale=0.01,
    labels=_edges,
    when=_asked("pressure"),
    present=contacts.loaded_edges,
)
TOUCH_DOWN = Constraint(
    value=touch_down,
    within=at_least(0.0),
    unit="1",
    holds=Where.EVERY_INTERVAL,
    scale=0.1,
    labels=_contact_names,
    when=_asked("touch_down_speed"),
    present=contacts.not_on,
)

LINK_DISTANCES = Constraint(
    value=link_distances,
    within=at_least(_distance),
    unit="m",
    scale=0.1,
    labels=link_pair_labels,
    when=_asked("distance"),
)
CONSTRAINTS = (CENTRE_OF_PRESSURE, TOUCH_DOWN, JOINT_TORQUES, JOINT_TORQUES_PUSHED, LINK_DISTANCES)
COSTS = (
    paper.running(costs.throttle_rate, "%/s", Where.EVERY_INTERVAL, scale=50.0),
    paper.running(costs.joint_accelerations, JointUnits("rad/s²"), Where.EVERY_INTERVAL, scale=10.0),
    paper.running(costs.foot_tilt, "1", scale=0.1),
    paper.running(costs.skimming, "1", Where.EVERY_INTERVAL, scale=0.1),
)
TERMS = (*CONSTRAINTS, *COSTS)
"""What a plan that the robot carries out asks for beside the terms of the paper."""

"""The paper's constraints as functions; `paper.py` says where each holds and in which set it lies.

Equation numbers are those of L'Erario et al. 2022.
"""

from __future__ import annotations

from functools import partial

import casadi as cs
import numpy as np

from multimodal_to.adam import centroidal as rigid_body
from multimodal_to.adam import quaternion
from multimodal_to.adam.spatial import SX
from multimodal_to.models import attitude, contact
from multimodal_to.models.robot import Robot
from multimodal_to.models.units import OwnSize
from multimodal_to.ocp.integration import Interval
from multimodal_to.ocp.knot import Knot
from multimodal_to.ocp.parameters import Parameters
from multimodal_to.scenarios.keyframes import attitude_at

LOAD = OwnSize(50.0, of_a_point=True)
"""Size of the force of a contact point that the solver takes for one [N], and of its rate [N/s]."""
FORCE = OwnSize(50.0)
"""Size of a force, and of a moment and of rates of thrust, that the solver takes for one [N, N m, N/s or N/s²]."""

# -------------------------------------------------------------------- at a knot


def com_kinematics(knot: Knot, parameters: Parameters) -> SX:
    """x − CoM(q) = 0 (eq. 15)."""
    com = rigid_body.com_position(knot.robot.kindyn.tree, knot.base, knot.joint_positions)
    return knot.com_position - com


def angular_momentum_kinematics(interval: Interval, parameters: Parameters) -> SX:
    """hω − [0 1] J_CMM(q) ν = 0 (eq. 16), with the CoM taken from its own variable.

    Momenta about the base's origin, moved to the CoM: hω = R k − (x − p) × R l. The sum over the limbs then stays a
    sum in the Hessian, where the product of their CoM and their linear momentum would couple each limb with each. All
    at the instant of the velocities.
    """
    knot = interval.at_velocities
    base = knot.base
    turning = knot.lift(base.rotation.T @ knot.base_angular_velocity)
    momentum, _ = rigid_body.momentum_in_base(
        knot.robot.kindyn.tree, knot.joint_positions, turning, knot.joint_velocities
    )
    linear, angular = cs.vertsplit(knot.lift(cs.vertcat(momentum.linear, momentum.angular)), 3)
    arm = knot.com_position - knot.base_position
    about_com = base.rotation @ angular - cs.cross(arm, base.rotation @ linear)
    return knot.angular_momentum - about_com


def contact_kinematics(knot: Knot, parameters: Parameters) -> SX:
    """p_i − fk_i(q) = 0 (eq. 17)."""
    positions = [knot.pose(name).translation for name in knot.robot.contact_names]
    return knot.contact_positions - cs.vertcat(*positions)


def heights(knot: Knot, parameters: Parameters) -> SX:
    """d(p_i) (eq. 18)."""
    return cs.vertcat(*(parameters.surface.distance(point) for point in knot.points))


def contact_forces(knot: Knot, parameters: Parameters) -> SX:
    """f_i."""
    return knot.contact_forces


def friction_cone(knot: Knot, parameters: Parameters) -> SX:
    """|t·f| ≤ μ n·f as the scenario's pyramid or cone, which holds n·f ≥ 0 as well (eq. 12, 18, 19)."""
    inside = contact.FRICTION[parameters.scenario.friction_cone]
    size = LOAD.of("N", parameters.robot.units)
    faces = [
        inside(parameters.surface, point, force, parameters.friction, size)
        for point, force in zip(knot.points, knot.forces, strict=True)
    ]
    return cs.vertcat(*faces)


def complementarity(knot: Knot, parameters: Parameters) -> SX:
    """d(p_i) n·f_i ≤ ε_n (eq. 20)."""
    return _lifted_forces(knot.points, knot.forces, parameters)


def complementarity_before(interval: Interval, parameters: Parameters) -> SX:
    """d(p_i) n·f_i⁺ ≤ ε_n: a force acts from half an interval before its knot on, when its point stands already."""
    return _lifted_forces(interval.start.points, interval.end.forces, parameters)


def complementarity_after(interval: Interval, parameters: Parameters) -> SX:
    """d(p_i⁺) n·f_i ≤ ε_n: a force acts until half an interval after its knot, when its point still stands."""
    return _lifted_forces(interval.end.points, interval.start.forces, parameters)


def _lifted_forces(points: list[SX], forces: list[SX], parameters: Parameters) -> SX:
    """Return height × normal force of each contact point [N m]."""
    products = [
        contact.complementarity(parameters.surface, point, force) for point, force in zip(points, forces, strict=True)
    ]
    return cs.vertcat(*products)


def contact_reach(knot: Knot, parameters: Parameters) -> SX:
    """|p_i − x| within the robot's `contact_reach`, by axis, as a fraction of it."""
    arms = [(point - knot.com_position) / cs.DM(knot.robot.contact_reach) for point in knot.points]
    return cs.vertcat(*arms)


def jet_reach(knot: Knot, parameters: Parameters) -> SX:
    """|p_j − x| within the robot's `jet_reach`, by axis, as a fraction of it (with p_j = fk_j(q), eq. 22)."""
    reach = cs.DM(knot.robot.jet_reach)
    arms = [(knot.pose(jet.frame).translation - knot.com_position) / reach for jet in knot.robot.jets]
    return cs.vertcat(cs.SX(0, 1), *arms)


def static_equilibrium(knot: Knot, parameters: Parameters) -> SX:
    """0 = m g + Σ f and 0 = Σ (p − x) × f: the forces hold the robot where it stands; no rate is left at knot 0."""
    return cs.vertcat(*knot.momentum_rate)


def steady_thrust(knot: Knot, parameters: Parameters) -> SX:
    """0 = f(T, 0) + g(T, 0, u): the throttle holds the thrust; no rate is left at knot 0 (eq. 23).

    Of an engine of order one 0 = (k u − T) / τ, and of one without a lag 0 = T(u) − T.
    """
    return _by_engine(knot, thrust_acceleration(knot), tuple(range(len(knot.robot.jets))))


def final_steady_thrust(knot: Knot, parameters: Parameters) -> SX:
    """0 = f(T, 0) + g(T, 0, u) or 0 = (k u − T) / τ; an engine without a lag holds its thrust by its own row."""
    jets = lagging_jets(knot.robot)
    return _by_engine(knot, thrust_acceleration(knot), jets)


def lagging_jets(robot: Robot) -> tuple[int, ...]:
    """Return which jets have an engine that lags behind its throttle."""
    return tuple(index for index, jet in enumerate(robot.jets) if jet.model.order > 0)


def _by_engine(knot: Knot, accelerations: SX, jets: tuple[int, ...]) -> SX:
    """Return T̈ of engines of order two, and what others are off their thrust by.

    Args:
        knot: with thrusts and throttles.
        accelerations: T̈ of all jets [N/s²], (jets, 1).
        jets: that are asked for.
    """
    rows = [
        accelerations[index]
        if knot.robot.jets[index].model.order == 2
        else knot.robot.jets[index].model.imbalance(knot.thrust[index], knot.throttle[index])
        for index in jets
    ]
    return cs.vertcat(cs.SX(0, 1), *rows)


def unit_quaternion(knot: Knot, parameters: Parameters) -> SX:
    """|ρ|² − 1 = 0 where the orientation is found; later knots inherit it through their integration."""
    return cs.sumsqr(knot.base_quaternion_xyzw) - 1


def off_upright_first(knot: Knot, parameters: Parameters) -> SX:
    """ρ̄⁻¹ ∘ ρ less none: half the angles from the upright ρ̄ about two level axes and the vertical, and w − 1.

    ρ̄ is `Robot.upright`, with home's heading or, where a keyframe of the first knot asks for it, another attitude. The
    axes are the base's own, turned so that the last is the vertical.
    """
    return off_attitude_at(knot, parameters, 0)


def off_upright_last(knot: Knot, parameters: Parameters) -> SX:
    """ρ̄⁻¹ ∘ ρ less none, as at the first knot, with what the keyframes of the last knot ask for."""
    return off_attitude_at(knot, parameters, parameters.scenario.knots)


def off_attitude_at(knot: Knot, parameters: Parameters, knot_index: int) -> SX:
    """Return how far the base is off the attitude of a hover, (4, 1), as `off_upright_first` says.

    Args:
        knot: with the base.
        parameters: with the robot and the scenario.
        knot_index: which knot of the horizon it is.
    """
    robot = parameters.robot
    asked = attitude_at(robot, parameters.scenario.placed(), knot_index)
    turn = quaternion.product(quaternion.conjugate(cs.DM(asked)), knot.base_quaternion_xyzw)
    vertical = np.array(quaternion.rotation_matrix(cs.DM(asked))).T @ robot.up
    return cs.vertcat(cs.DM(attitude.axes_about(vertical)) @ turn[:3], turn[3] - 1)


# -------------------------------------------------------------------- over an interval


def momentum_at_start(interval: Interval, parameters: Parameters) -> SX:
    """ẋ and hω at the instant of the first knot, under leapfrog: the means of v_−½ and v_½."""
    knot = interval.at_accelerations
    return cs.vertcat(knot.com_velocity, knot.angular_momentum)


def base_twist_at_start(interval: Interval, parameters: Parameters) -> SX:
    """ṗ and ω at the instant of the first knot, under leapfrog: the means of v_−½ and v_½."""
    knot = interval.at_accelerations
    return cs.vertcat(knot.base_linear_velocity, knot.base_angular_velocity)


def joint_velocities_at_start(interval: Interval, parameters: Parameters) -> SX:
    """ṡ at the instant of the first knot, under leapfrog: the mean of v_−½ and v_½."""
    return interval.at_accelerations.joint_velocities


def thrust_rate_at_start(interval: Interval, parameters: Parameters) -> SX:
    """Ṫ at the instant of the first knot, under leapfrog: the mean of v_−½ and v_½."""
    return interval.at_accelerations.thrust_rate


def momentum_dynamics(interval: Interval, parameters: Parameters) -> SX:
    """m (ẋ⁺ − ẋ) = Δt (m g + Σ f⁺) and hω⁺ − hω = Δt Σ (p⁺ − x⁺) × f⁺ (eq. 14 with gravity, 24a, 24c)."""
    mass = parameters.robot.mass
    return cs.vertcat(
        interval.velocity_gap(lambda knot: knot.com_velocity, lambda knot: knot.momentum_rate[0] / mass),
        interval.velocity_gap(lambda knot: knot.angular_momentum, lambda knot: knot.momentum_rate[1]),
    )


def com_integration(interval: Interval, parameters: Parameters) -> SX:
    """x⁺ − x − ẋ⁺ Δt = 0 (eq. 24b)."""
    return interval.gap(lambda knot: knot.com_position, lambda knot: knot.com_velocity)


def base_position_integration(interval: Interval, parameters: Parameters) -> SX:
    """p⁺ − p − ṗ⁺ Δt = 0 (eq. 25a)."""
    return interval.gap(lambda knot: knot.base_position, lambda knot: knot.base_linear_velocity)


def base_orientation_integration(interval: Interval, parameters: Parameters) -> SX:
    """ρ⁺ − Exp(ω⁺ Δt) ∘ ρ = 0 (eq. 25b)."""
    return interval.rotation_gap(lambda knot: knot.base_quaternion_xyzw, lambda knot: knot.base_angular_velocity)


def joint_integration(interval: Interval, parameters: Parameters) -> SX:
    """s⁺ − s − ṡ⁺ Δt = 0 (eq. 25c)."""
    return interval.gap(lambda knot: knot.joint_positions, lambda knot: knot.joint_velocities)


def thrust_integration(interval: Interval, parameters: Parameters) -> SX:
    """T⁺ − T − Ṫ⁺ Δt = 0 (eq. 26a)."""
    return interval.gap(lambda knot: knot.thrust, lambda knot: knot.thrust_rate)


def thrust_dynamics(interval: Interval, parameters: Parameters) -> SX:
    """Ṫ⁺ − Ṫ − (f(T⁺, Ṫ⁺) + g(T⁺, Ṫ⁺, u⁺)) Δt = 0 (eq. 23, 26b).

    Of an engine of order one Ṫ⁺ − (k u⁺ − T⁺) / τ = 0, by leapfrog with the mean over both ends of the interval. Of one
    without a lag T(u⁺) − T⁺ = 0.
    """
    gaps = interval.velocity_gap(lambda knot: knot.thrust_rate, thrust_acceleration)
    for index, jet in enumerate(interval.end.robot.jets):
        if jet.model.order == 1:
            gaps[index] = interval.end.thrust_rate[index] - interval.mean(partial(_imbalance, index))
        elif jet.model.order == 0:
            gaps[index] = _imbalance(index, interval.end)
    return gaps


def _imbalance(index: int, knot: Knot) -> SX:
    return knot.robot.jets[index].model.imbalance(knot.thrust[index], knot.throttle[index])


def sliding(interval: Interval, parameters: Parameters) -> SX:
    """|t·(p_i⁺ − p_i)| n·f_i⁺ ≤ ε_t (eq. 21)."""
    return _slips(interval, interval.end.forces, parameters)


def sliding_after(interval: Interval, parameters: Parameters) -> SX:
    """|t·(p_i⁺ − p_i)| n·f_i ≤ ε_t: a point stays where it is until half an interval after the knot of its force."""
    return _slips(interval, interval.start.forces, parameters)


def _slips(interval: Interval, forces: list[SX], parameters: Parameters) -> SX:
    products = [
        contact.sliding(parameters.surface, after, force, after - before)
        for before, after, force in zip(interval.start.points, interval.end.points, forces, strict=True)
    ]
    return cs.vertcat(*products)


def thrust_acceleration(knot: Knot) -> SX:
    """Return T̈ of each jet from its thrust, thrust rate and throttle [N/s²], (jets, 1) (eq. 23).

    It is zero of engines of a lower order.
    """
    accelerations = [
        jet.model.slopes(knot.thrust[index], knot.thrust_rate[index], knot.throttle[index])[1]
        for index, jet in enumerate(knot.robot.jets)
    ]
    return cs.vertcat(cs.SX(0, 1), *accelerations)

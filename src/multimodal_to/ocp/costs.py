"""The paper's costs as residuals; `paper.py` says where each is charged and which weight of the scenario it has."""

from __future__ import annotations

import casadi as cs

from multimodal_to.adam import quaternion
from multimodal_to.adam.spatial import SX
from multimodal_to.ocp.integration import Interval
from multimodal_to.ocp.knot import Knot
from multimodal_to.ocp.parameters import Parameters

SKIM_HEIGHT = 0.02
"""δ: height at which a speed along the ground counts half, as a share of the standing height L [1]."""


def com_velocity(knot: Knot, parameters: Parameters) -> SX:
    """ẋ."""
    return knot.com_velocity


def com_acceleration(interval: Interval, parameters: Parameters) -> SX:
    """ẍ = (ẋ⁺ − ẋ) / Δt."""
    return interval.rate(lambda knot: knot.com_velocity)


def angular_momentum(knot: Knot, parameters: Parameters) -> SX:
    """hω."""
    return knot.angular_momentum


def angular_momentum_rate(interval: Interval, parameters: Parameters) -> SX:
    """ḣω = (hω⁺ − hω) / Δt."""
    return interval.rate(lambda knot: knot.angular_momentum)


def base_acceleration(interval: Interval, parameters: Parameters) -> SX:
    """v̇ = (v⁺ − v) / Δt of the base's twist v = (ṗ, ω)."""
    return interval.rate(lambda knot: cs.vertcat(knot.base_linear_velocity, knot.base_angular_velocity))


def joint_velocities(knot: Knot, parameters: Parameters) -> SX:
    """ṡ."""
    return knot.joint_velocities


def posture(knot: Knot, parameters: Parameters) -> SX:
    """s − s̄, with the posture in which the robot stands at the end, else at the start, as s̄ (`Parameters.target`)."""
    return knot.joint_positions - cs.DM(parameters.target.joint_positions)


def base_orientation(knot: Knot, parameters: Parameters) -> SX:
    """Vector part of ρ ∘ ρ̄⁻¹, half the angle from the home orientation ρ̄ for small ones."""
    home = quaternion.conjugate(cs.DM(parameters.robot.home.base_quaternion_xyzw))
    return quaternion.product(knot.base_quaternion_xyzw, home)[:3]


def contact_forces(knot: Knot, parameters: Parameters) -> SX:
    """f."""
    return knot.contact_forces


def contact_force_rates(interval: Interval, parameters: Parameters) -> SX:
    """ḟ = (f⁺ − f) / Δt."""
    return interval.rate(lambda knot: knot.contact_forces)


def thrust(knot: Knot, parameters: Parameters) -> SX:
    """T."""
    return knot.thrust


def thrust_rate(knot: Knot, parameters: Parameters) -> SX:
    """Ṫ."""
    return knot.thrust_rate


def throttle(knot: Knot, parameters: Parameters) -> SX:
    """u."""
    return knot.throttle


def throttle_rate(interval: Interval, parameters: Parameters) -> SX:
    """u̇ = (u⁺ − u) / Δt."""
    return interval.rate(lambda knot: knot.throttle)


def joint_accelerations(interval: Interval, parameters: Parameters) -> SX:
    """s̈ = (ṡ⁺ − ṡ) / Δt."""
    return interval.rate(lambda knot: knot.joint_velocities)


def foot_tilt(knot: Knot, parameters: Parameters) -> SX:
    """d(p_i) less the mean of the foot's points, over L: zero for a sole that is level with the ground."""
    rows = []
    for members in knot.robot.feet.values():
        heights = cs.vertcat(*(parameters.surface.distance(knot.points[index]) for index in members))
        rows.append((heights - cs.sum1(heights) / len(members)) / knot.robot.standing_height)
    return cs.vertcat(cs.SX(0, 1), *rows)


def skimming(interval: Interval, parameters: Parameters) -> SX:
    """Speed of each contact point along the ground in √(g L), the less the higher it is: t·Δp / Δt / √(1 + (d / δ)²).

    δ is `SKIM_HEIGHT`. A foot that swings is lifted by it, and one that stands or hovers is not moved.
    """
    robot, rows = parameters.robot, []
    for before, after in zip(interval.start.points, interval.end.points, strict=True):
        along = parameters.surface.tangents(after).T @ (after - before) / (interval.duration * robot.units.of("m/s"))
        height = 0.5 * (parameters.surface.distance(before) + parameters.surface.distance(after))
        rows.append(along / cs.sqrt(1 + (height / (SKIM_HEIGHT * robot.standing_height)) ** 2))
    return cs.vertcat(cs.SX(0, 1), *rows)

"""The costs, one residual function each; its name is the name of its weight and of its share in the report.

A cost is weight × |residual|² (× Δt when running).
"""

from __future__ import annotations

from collections.abc import Callable

import casadi as cs

from multimodal_to.adam import quaternion
from multimodal_to.adam.spatial import SX
from multimodal_to.ocp.constraints import World
from multimodal_to.ocp.variables import Knot

Residual = Callable[[Knot, Knot, SX, World], SX]
"""A function of an interval's start and end knot, Δt and the world."""


def com_velocity(start: Knot, end: Knot, dt: SX, world: World) -> SX:
    """ẋ."""
    return end.com_velocity


def com_acceleration(start: Knot, end: Knot, dt: SX, world: World) -> SX:
    """ẍ = (ẋ⁺ − ẋ) / Δt."""
    return (end.com_velocity - start.com_velocity) / dt


def angular_momentum(start: Knot, end: Knot, dt: SX, world: World) -> SX:
    """hω."""
    return end.angular_momentum


def angular_momentum_rate(start: Knot, end: Knot, dt: SX, world: World) -> SX:
    """ḣω = (hω⁺ − hω) / Δt."""
    return (end.angular_momentum - start.angular_momentum) / dt


def base_acceleration(start: Knot, end: Knot, dt: SX, world: World) -> SX:
    """v̇ = (v⁺ − v) / Δt of the base's twist v = (ṗ, ω)."""
    return (
        cs.vertcat(
            end.base_linear_velocity - start.base_linear_velocity,
            end.base_angular_velocity - start.base_angular_velocity,
        )
        / dt
    )


def joint_velocities(start: Knot, end: Knot, dt: SX, world: World) -> SX:
    """ṡ."""
    return end.joint_velocities


def posture(start: Knot, end: Knot, dt: SX, world: World) -> SX:
    """s − s̄, with the posture in which the robot stands as s̄ (`World.standing`)."""
    return end.joint_positions - cs.DM(world.standing.joint_positions)


def initial_posture(start: Knot, end: Knot, dt: SX, world: World) -> SX:
    """s − s̄ at the interval's start."""
    return start.joint_positions - cs.DM(world.standing.joint_positions)


def base_orientation(start: Knot, end: Knot, dt: SX, world: World) -> SX:
    """Vector part of ρ ∘ ρ̄⁻¹, half the angle from the home orientation ρ̄ for small ones."""
    home = quaternion.conjugate(cs.DM(world.robot.home.base_quaternion_xyzw))
    return quaternion.product(end.base_quaternion_xyzw, home)[:3]


def contact_forces(start: Knot, end: Knot, dt: SX, world: World) -> SX:
    """f."""
    return end.contact_forces


def contact_force_rates(start: Knot, end: Knot, dt: SX, world: World) -> SX:
    """ḟ = (f⁺ − f) / Δt."""
    return (end.contact_forces - start.contact_forces) / dt


def thrust(start: Knot, end: Knot, dt: SX, world: World) -> SX:
    """T."""
    return end.thrust


def thrust_rate(start: Knot, end: Knot, dt: SX, world: World) -> SX:
    """Ṫ."""
    return end.thrust_rate


def throttle(start: Knot, end: Knot, dt: SX, world: World) -> SX:
    """u."""
    return end.throttle


RUNNING: tuple[Residual, ...] = (
    com_velocity,
    com_acceleration,
    angular_momentum,
    angular_momentum_rate,
    base_acceleration,
    joint_velocities,
    posture,
    base_orientation,
    contact_forces,
    contact_force_rates,
    thrust,
    thrust_rate,
    throttle,
)
FINAL: tuple[Residual, ...] = (posture, com_velocity, com_acceleration, angular_momentum, angular_momentum_rate)

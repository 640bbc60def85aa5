"""The constraints, one function each; what a function returns is a set of named rows, and its name is their name.

A knot function takes a knot, an interval function its start, its end and Δt; neither knows where on the horizon it is.
Equation numbers are those of L'Erario et al. 2022.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import casadi as cs
import numpy as np

from multimodal_to.adam import centroidal as rigid_body
from multimodal_to.adam.spatial import SX
from multimodal_to.models import contact
from multimodal_to.models.centroidal import momentum_rate, thrust_force
from multimodal_to.models.contact import FrictionCone
from multimodal_to.models.robot import Posture, Robot
from multimodal_to.models.terrain import Remembered, Surface
from multimodal_to.ocp.integrators import gap, rotation_gap
from multimodal_to.ocp.variables import Knot
from multimodal_to.scenarios.scenario import Scenario


@dataclass(frozen=True, kw_only=True)
class World:
    """What the rows and costs may ask for beside the variables."""

    robot: Robot
    surface: Surface
    friction: float
    friction_cone: FrictionCone
    complementarity_max: float  # ε_n [N m]
    sliding_max: float  # ε_t [N m]
    standing: Posture  # near home, with the CoM where the motion starts

    @classmethod
    def of(cls, robot: Robot, scenario: Scenario, standing: Posture) -> World:
        """Return what a scenario says of the world; a friction that it leaves open is the robot's."""
        return cls(
            robot=robot,
            surface=Remembered(scenario.surface),
            friction=scenario.friction or robot.friction,
            friction_cone=scenario.friction_cone,
            complementarity_max=scenario.complementarity_max,
            sliding_max=scenario.sliding_max,
            standing=standing,
        )


@dataclass(frozen=True, kw_only=True)
class Rows:
    """lower ≤ expression ≤ upper, in `unit`; `scale` is the size that the solver sees as one."""

    expression: SX  # (m, 1)
    lower: float
    upper: float
    unit: str
    scale: float = 1.0
    of: str = "robot"  # "robot", "joint", "contact" or "jet": what the rows are repeated for
    components: tuple[str, ...] = ()  # the name of each row among them, as `stages` gives it


ON_GROUND = 1e-5
"""Largest height of a contact point that stands [m]: a sole has more corners than a plane needs."""

KnotRows = Callable[[Knot, World], Rows]
IntervalRows = Callable[[Knot, Knot, SX, World], Rows]


def _equal(expression: SX, unit: str, scale: float = 1.0, of: str = "robot") -> Rows:
    return Rows(expression=expression, lower=0.0, upper=0.0, unit=unit, scale=scale, of=of)


# -------------------------------------------------------------------- at a knot


def com_kinematics(knot: Knot, world: World) -> Rows:
    """x = CoM(q) (eq. 15)."""
    com = rigid_body.com_position(world.robot.kindyn.tree, knot.base, knot.joint_positions)
    return _equal(knot.com_position - com, "m")


def angular_momentum_kinematics(knot: Knot, world: World) -> Rows:
    """hω = [0 1] J_CMM(q) ν (eq. 16), with the CoM taken from its own variable.

    Momenta about the base's origin, moved to the CoM: hω = R k − (x − p) × R l. The sum over the limbs then stays a
    sum in the Hessian, where the product of their CoM and their linear momentum would couple each limb with each.
    """
    base = knot.base
    turning = base.rotation.T @ knot.base_angular_velocity
    momentum, _ = rigid_body.momentum_in_base(
        world.robot.kindyn.tree, knot.joint_positions, turning, knot.joint_velocities
    )
    arm = knot.com_position - knot.base_position
    about_com = base.rotation @ momentum.angular - cs.cross(arm, base.rotation @ momentum.linear)
    return _equal(knot.angular_momentum - about_com, "kg m²/s")


def contact_kinematics(knot: Knot, world: World) -> Rows:
    """p_i = fk_i(q) (eq. 17)."""
    positions = [knot.pose(name).translation for name in world.robot.contact_names]
    return _equal(knot.contact_positions - cs.vertcat(*positions), "m", of="contact")


def non_penetration(knot: Knot, world: World) -> Rows:
    """d(p_i) ≥ 0 (eq. 18)."""
    return Rows(
        expression=cs.vertcat(*(world.surface.distance(point) for point in knot.points)),
        lower=0.0,
        upper=np.inf,
        unit="m",
        of="contact",
    )


def friction_cone(knot: Knot, world: World) -> Rows:
    """|t·f| ≤ μ n·f as the scenario's pyramid or cone, which holds n·f ≥ 0 as well (eq. 12, 18, 19)."""
    inside = contact.FRICTION[world.friction_cone]
    faces = [
        inside(world.surface, point, force, world.friction)
        for point, force in zip(knot.points, knot.forces, strict=True)
    ]
    return Rows(expression=cs.vertcat(*faces), lower=0.0, upper=np.inf, unit="N", scale=50.0, of="contact")


def complementarity(knot: Knot, world: World) -> Rows:
    """d(p_i) n·f_i ≤ ε_n (eq. 20)."""
    products = [
        contact.complementarity(world.surface, point, force)
        for point, force in zip(knot.points, knot.forces, strict=True)
    ]
    return Rows(
        expression=cs.vertcat(*products), lower=-np.inf, upper=world.complementarity_max, unit="N m", of="contact"
    )


def contact_reach(knot: Knot, world: World) -> Rows:
    """|p_i − x| within the robot's `contact_reach`, by axis, as a fraction of it."""
    arms = [(point - knot.com_position) / cs.DM(knot.robot.contact_reach) for point in knot.points]
    return Rows(expression=cs.vertcat(*arms), lower=-1.0, upper=1.0, unit="1", of="contact")


def jet_reach(knot: Knot, world: World) -> Rows:
    """|p_j − x| within the robot's `jet_reach`, by axis, as a fraction of it (with p_j = fk_j(q), eq. 22)."""
    reach = cs.DM(knot.robot.jet_reach)
    arms = [(knot.pose(jet.frame).translation - knot.com_position) / reach for jet in world.robot.jets]
    return Rows(expression=cs.vertcat(cs.SX(0, 1), *arms), lower=-1.0, upper=1.0, unit="1", of="jet")


def static_equilibrium(knot: Knot, world: World) -> Rows:
    """0 = m g + Σ f and 0 = Σ (p − x) × f: the forces hold the robot where it stands; no rate is left at knot 0."""
    linear, angular = _momentum_rate(knot, world)
    return _equal(cs.vertcat(linear, angular), "N, N m", scale=50.0)


def steady_thrust(knot: Knot, world: World) -> Rows:
    """0 = f(T, 0) + g(T, 0, u): the throttle holds the thrust; no rate is left at knot 0 (eq. 23)."""
    return _equal(_thrust_acceleration(knot, world), "N/s²", scale=50.0, of="jet")


def unit_quaternion(knot: Knot, world: World) -> Rows:
    """|ρ|² = 1 where the orientation is found; later knots inherit it through their integration."""
    return _equal(cs.sumsqr(knot.base_quaternion_xyzw) - 1, "1")


def standing_height(knot: Knot, world: World) -> Rows:
    """0 ≤ d(p_i) ≤ ON_GROUND: every contact point stands."""
    rows = non_penetration(knot, world)
    return Rows(expression=rows.expression, lower=0.0, upper=ON_GROUND, unit="m", of="contact")


# -------------------------------------------------------------------- over an interval


def momentum_dynamics(start: Knot, end: Knot, dt: SX, world: World) -> Rows:
    """m (ẋ⁺ − ẋ) = Δt (m g + Σ f⁺) and hω⁺ − hω = Δt Σ (p⁺ − x⁺) × f⁺ (eq. 14 with gravity, 24a, 24c)."""
    linear, angular = _momentum_rate(end, world)
    return _equal(
        cs.vertcat(
            gap(start.com_velocity, end.com_velocity, linear / world.robot.mass, dt),
            gap(start.angular_momentum, end.angular_momentum, angular, dt),
        ),
        "m/s, kg m²/s",
    )


def com_integration(start: Knot, end: Knot, dt: SX, world: World) -> Rows:
    """x⁺ = x + ẋ⁺ Δt (eq. 24b)."""
    return _equal(gap(start.com_position, end.com_position, end.com_velocity, dt), "m")


def base_position_integration(start: Knot, end: Knot, dt: SX, world: World) -> Rows:
    """p⁺ = p + ṗ⁺ Δt (eq. 25a)."""
    return _equal(gap(start.base_position, end.base_position, end.base_linear_velocity, dt), "m")


def base_orientation_integration(start: Knot, end: Knot, dt: SX, world: World) -> Rows:
    """ρ⁺ = Exp(ω⁺ Δt) ∘ ρ (eq. 25b)."""
    return _equal(
        rotation_gap(start.base_quaternion_xyzw, end.base_quaternion_xyzw, end.base_angular_velocity, dt), "1"
    )


def joint_integration(start: Knot, end: Knot, dt: SX, world: World) -> Rows:
    """s⁺ = s + ṡ⁺ Δt (eq. 25c)."""
    return _equal(gap(start.joint_positions, end.joint_positions, end.joint_velocities, dt), "rad", of="joint")


def thrust_integration(start: Knot, end: Knot, dt: SX, world: World) -> Rows:
    """T⁺ = T + Ṫ⁺ Δt (eq. 26a)."""
    return _equal(gap(start.thrust, end.thrust, end.thrust_rate, dt), "N", scale=50.0, of="jet")


def thrust_dynamics(start: Knot, end: Knot, dt: SX, world: World) -> Rows:
    """Ṫ⁺ = Ṫ + (f(T⁺, Ṫ⁺) + g(T⁺, Ṫ⁺, u⁺)) Δt (eq. 23, 26b)."""
    return _equal(
        gap(start.thrust_rate, end.thrust_rate, _thrust_acceleration(end, world), dt), "N/s", scale=50.0, of="jet"
    )


def sliding(start: Knot, end: Knot, dt: SX, world: World) -> Rows:
    """|t·(p_i⁺ − p_i)| n·f_i⁺ ≤ ε_t (eq. 21).

    The force is the one that acts over the interval: under backward Euler its end's.
    """
    products = [
        contact.sliding(world.surface, after, force, after - before)
        for before, after, force in zip(start.points, end.points, end.forces, strict=True)
    ]
    return Rows(
        expression=cs.vertcat(*products), lower=-world.sliding_max, upper=world.sliding_max, unit="N m", of="contact"
    )


def _thrust_acceleration(knot: Knot, world: World) -> SX:
    accelerations = [
        jet.model.acceleration(knot.thrust[index], knot.thrust_rate[index], knot.throttle[index])
        for index, jet in enumerate(world.robot.jets)
    ]
    return cs.vertcat(cs.SX(0, 1), *accelerations)


def _momentum_rate(knot: Knot, world: World) -> tuple[SX, SX]:
    """Return m ẍ and ḣω under all contacts and jets."""
    robot = world.robot
    forces = list(zip(knot.points, knot.forces, strict=True))
    for index, jet in enumerate(robot.jets):
        pose = knot.pose(jet.frame)
        forces.append((pose.translation, thrust_force(pose.rotation, knot.thrust[index])))
    return momentum_rate(robot.mass, cs.DM(robot.gravity), knot.com_position, forces)

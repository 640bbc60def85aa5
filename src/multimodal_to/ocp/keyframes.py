"""Keyframes in the problem: what is held at a knot as bounds, and the terms for all else that is asked there.

The start, the end and the height at mid-horizon are keyframes as those of a scenario's `keyframes` are.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import partial

import casadi as cs
import numpy as np

from multimodal_to.adam import quaternion
from multimodal_to.adam.spatial import SX
from multimodal_to.errors import shortened
from multimodal_to.models.attitude import signed_like
from multimodal_to.models.joint_units import joint_units
from multimodal_to.models.robot import Posture, Robot
from multimodal_to.models.state import State
from multimodal_to.ocp import constraints, given
from multimodal_to.ocp.contacts import ON_GROUND
from multimodal_to.ocp.guess import contact_positions
from multimodal_to.ocp.integration import Interval
from multimodal_to.ocp.knot import Knot
from multimodal_to.ocp.paper import UPRIGHT, UPRIGHT_FIRST
from multimodal_to.ocp.parameters import Parameters
from multimodal_to.ocp.terms import (
    Constraint,
    Cost,
    Intervals,
    Knots,
    Labels,
    Term,
    Units,
    Within,
    at_least,
    at_most,
    between,
    each,
    equal,
)
from multimodal_to.ocp.variables import Bounds
from multimodal_to.scenarios.failures import failing_knots
from multimodal_to.scenarios.keyframes import AXES, Placed, Vector3, by_axis
from multimodal_to.scenarios.scenario import Scenario, Start
from multimodal_to.trajectory import rules

_AT_REST = ("base_linear_velocity", "base_angular_velocity", "joint_velocities")


def hold(
    bounds: Bounds, robot: Robot, scenario: Scenario, standing: Posture, rule: str, initial: State | None = None
) -> None:
    """Hold the knots of the keyframes at rest, in the air or on the ground, and the first one as the start says.

    Args:
        bounds: of every variable at every knot; they are changed.
        robot: with the jets that the scenario uses.
        scenario: the task.
        standing: the posture that a motion that starts on its feet starts in.
        rule: name of the integration rule.
        initial: the state that a motion with a given start starts in.

    Raises:
        ScenarioError: what is held is outside its range.
    """
    if initial is not None:
        given.set_start(bounds, robot, scenario, initial, rule)
    else:
        _set_start(bounds, robot, scenario, standing)
    for one in scenario.placed():
        if one.knot and one.keyframe.still:
            _still(bounds, robot, scenario, one, rule)


def _set_start(bounds: Bounds, robot: Robot, scenario: Scenario, standing: Posture) -> None:
    fix = bounds.fix
    fix("com_position", 0, np.array(scenario.start_com))
    for name in (*_AT_REST, "com_velocity", "angular_momentum", "thrust_rate"):
        fix(name, 0, 0.0)
    if scenario.start is Start.HOVER:
        fix("contact_forces", 0, 0.0, within=given.NO_FORCE.of(robot.units))
        return
    fix("base_position", 0, standing.base_position)
    fix("base_quaternion_xyzw", 0, signed_like(standing.base_quaternion_xyzw, robot.upright.base_quaternion_xyzw))
    fix("joint_positions", 0, standing.joint_positions)
    fix("contact_positions", 0, contact_positions(robot, standing))
    fix("thrust", 0, 0.0)
    idle = [np.clip(jet.model.steady_throttle(0.0), jet.throttle_min, jet.throttle_max) for jet in robot.jets]
    fix("throttle", 0, np.array(idle))


def _still(bounds: Bounds, robot: Robot, scenario: Scenario, one: Placed, rule: str) -> None:
    """Let nothing move at a later knot; in a hover and standing the forces balance too.

    Velocities of base and joints hold the CoM's velocity and the angular momentum as well. These at a neighbour of the
    knot make the accelerations there zero: of the last knot at the one before, over the last interval.

    Args:
        bounds: of every variable at every knot; they are changed.
        robot: with the jets that the scenario uses.
        scenario: the task.
        one: the keyframe.
        rule: name of the integration rule.
    """
    fix, knot, between_knots = bounds.fix, one.knot, bool(rules.instant(rule, "com_velocity"))
    for name in _AT_REST:
        fix(name, knot, 0.0)
    if not (one.keyframe.hover or one.keyframe.standing):
        return
    last = knot == scenario.knots
    neighbour = knot + 1 if between_knots and not last else knot - 1
    for name in ("com_velocity", "angular_momentum"):
        fix(name, neighbour, 0.0)
    if one.keyframe.hover:
        failed = failing_knots(scenario.failures, robot.jet_names, scenario.knots)
        for at in (neighbour, knot):
            running = [row for row in range(len(robot.jets)) if not 0 < failed.get(row, 0) <= at]
            fix("thrust_rate", at, 0.0, rows=running)  # one that has failed is still running down
        # Where velocities are between knots, the forces of the knot before the last one make the last velocity.
        for at in (neighbour, knot) if between_knots and last else (knot,):
            fix("contact_forces", at, 0.0, within=given.NO_FORCE.of(robot.units))


# -------------------------------------------------------------------- terms


def terms(robot: Robot, scenario: Scenario, rule: str) -> tuple[Term, ...]:
    """Return the terms of a scenario's keyframes, each at its knot, but for what the first knot's posture gives.

    Args:
        robot: with the jets that the scenario uses.
        scenario: the task, with numbers for every CoM.
        rule: name of the integration rule.
    """
    found = list[Term]()
    for one in scenario.placed():
        asking = _Asking(robot=robot, scenario=scenario, rule=rule, one=one)
        found += [*asking.com(), *asking.base(), *asking.joints(), *asking.frames(), *asking.momentum(), *asking.rest()]
    return tuple(found)


@dataclass(frozen=True, kw_only=True, eq=False)
class _Asking:
    """What one keyframe asks for, as terms."""

    robot: Robot
    scenario: Scenario
    rule: str
    one: Placed

    def term(self, what: str, residual: Callable[..., SX], unit: Units, labels: Labels, tolerance: float = 0.0) -> Term:
        """Return a residual that is held within a tolerance of zero or, where the keyframe has a weight, is a cost.

        Args:
            what: the term is about.
            residual: what should be zero.
            unit: of its rows.
            labels: of its rows.
            tolerance: how far each row may be from zero, in its unit.
        """
        weight = self.one.keyframe.weight
        if weight is None:
            within = between(-tolerance, tolerance) if tolerance else equal()
            return self.held(what, residual, within, unit, labels)
        place, name = Knots((self.one.knot,)), self._name(what)
        return Cost(name=name, residual=residual, weight=weight, unit=unit, charged=place, per_second=False)

    def held(
        self, what: str, value: Callable[..., SX], within: Within, unit: Units, labels: Labels, *, rigid: bool = False
    ) -> Constraint:
        """Return a constraint at the keyframe's knot.

        Args:
            what: the constraint is about.
            value: what is held.
            within: the set that it is held in.
            unit: of the rows.
            labels: of the rows.
            rigid: whether `relax` keeps it.
        """
        return Constraint(
            name=self._name(what),
            value=value,
            within=within,
            unit=unit,
            holds=Knots((self.one.knot,)),
            labels=labels,
            rigid=rigid,
        )

    def _name(self, what: str) -> str:
        return f"{self.one.label}: {what}"

    @property
    def is_start(self) -> bool:
        """Return whether the posture at the knot is the one that the motion starts standing in."""
        return not self.one.knot and self.scenario.start is Start.STANDING and self.one.keyframe.weight is None

    def com(self) -> Iterator[Term]:
        """Return the terms of the CoM; at the start it is a bound of its own."""
        keyframe = self.one.keyframe
        if not self.one.knot and keyframe.weight is None:
            return
        if not isinstance(keyframe.com, str) and (com := by_axis(keyframe.com)):
            yield self.term("CoM", partial(off_com, asked=com), "m", tuple(com))
        if low := keyframe.com_min:
            yield self.held("CoM from below", partial(off_com, asked=low), at_least(0.0), "m", tuple(low))
        if high := keyframe.com_max:
            yield self.held("CoM from above", partial(off_com, asked=high), at_most(0.0), "m", tuple(high))

    def base(self) -> Iterator[Term]:
        """Return the terms of the base; in a hover its attitude is that of `rest`."""
        keyframe = self.one.keyframe
        if position := by_axis(keyframe.base_position):
            yield self.term("base position", partial(off_base_position, asked=position), "m", tuple(position))
        if keyframe.hover or self.is_start:
            return
        tolerance = keyframe.orientation_tolerance
        if keyframe.base_orientation is not None:
            turned = partial(off_orientation, asked=keyframe.base_orientation)
            yield self.term("orientation", turned, "rad", tuple(AXES), tolerance)
        if keyframe.yaw is not None:
            yield self.term("yaw", partial(off_yaw, asked=keyframe.yaw), "rad", ("",), tolerance)

    def joints(self) -> Iterator[Term]:
        """Return the term of joints."""
        asked = self.one.keyframe.joints
        if asked and not self.is_start:
            units = joint_units(self.robot, "rad")
            own = tuple(units[self.robot.joint_names.index(name)] for name in asked)
            tolerance = self.one.keyframe.joint_tolerance
            yield self.term("joints", partial(off_joints, asked=asked), own, tuple(asked), tolerance)

    def frames(self) -> Iterator[Term]:
        """Return the terms of frames."""
        for name, target in self.one.keyframe.frames.items():
            short = shortened(name, 30)
            if position := by_axis(target.position):
                off = partial(off_frame, frame=name, asked=position)
                yield self.term(f"{short} position", off, "m", tuple(position), target.position_tolerance)
            if target.orientation is not None:
                turned = partial(off_frame_orientation, frame=name, asked=target.orientation)
                tolerance = target.orientation_tolerance
                yield self.term(f"{short} orientation", turned, "rad", tuple(AXES), tolerance)

    def momentum(self) -> Iterator[Term]:
        """Return the terms of the momentum.

        Where velocities are between knots, that of a knot is the mean of the two that meet there; none follows the
        last.
        """
        asked, knot = self.one.keyframe.momentum, self.one.knot
        if asked is None:
            return
        meets = bool(rules.instant(self.rule, "com_velocity")) and knot < self.scenario.knots
        place = Intervals((knot + 1,)) if meets else Knots((knot,))
        for term in (
            self._momentum("linear", asked.linear, off_linear_momentum, "kg m/s"),
            self._momentum("angular", asked.angular, off_angular_momentum, "kg m²/s"),
        ):
            if isinstance(term, Constraint):
                yield replace(term, holds=place)
            elif term is not None:
                yield replace(term, charged=place)

    def _momentum(
        self, kind: str, asked: Vector3 | Mapping[str, float] | None, off: Callable[..., SX], unit: str
    ) -> Term | None:
        values = by_axis(asked)
        return self.term(f"{kind} momentum", partial(off, asked=values), unit, tuple(values)) if values else None

    def rest(self) -> Iterator[Term]:
        """Return the terms of standing and hovering between the ends, where the formulation has terms of its own."""
        keyframe, knot = self.one.keyframe, self.one.knot
        if not 0 < knot < self.scenario.knots:
            return
        if keyframe.standing:
            feet = between(0.0, ON_GROUND)
            yield self.held("feet on the ground", constraints.heights, feet, "m", each("contact"), rigid=True)
        if keyframe.hover:
            off = partial(constraints.off_attitude_at, knot_index=knot)
            yield self.held("upright", off, between(-UPRIGHT, UPRIGHT), "1", UPRIGHT_FIRST.labels)


# -------------------------------------------------------------------- what is off


def off_com(knot: Knot, parameters: Parameters, asked: Mapping[str, float]) -> SX:
    """x − x̄ along the axes that are asked for.

    Args:
        knot: whose it is.
        parameters: of the problem.
        asked: coordinates by axis [m].
    """
    return _off(knot.com_position, asked)


def off_base_position(knot: Knot, parameters: Parameters, asked: Mapping[str, float]) -> SX:
    """p − p̄ along the axes that are asked for.

    Args:
        knot: whose it is.
        parameters: of the problem.
        asked: coordinates by axis [m].
    """
    return _off(knot.base_position, asked)


def off_orientation(knot: Knot, parameters: Parameters, asked: tuple[float, ...]) -> SX:
    """Log(ρ̄⁻¹ ∘ ρ): the rotation vector from the orientation that is asked for, in its axes.

    Args:
        knot: whose it is.
        parameters: of the problem.
        asked: world-from-base, a quaternion x y z w.
    """
    return quaternion.log(quaternion.product(quaternion.conjugate(cs.DM(asked)), knot.base_quaternion_xyzw))


def off_yaw(knot: Knot, parameters: Parameters, asked: float) -> SX:
    """Angle of the turn about the vertical in ρ ∘ ρ̄⁻¹, with home's ρ̄, less the yaw that is asked for.

    It is 2 atan2(v · up, w) of Exp(−yaw up) ∘ ρ ∘ ρ̄⁻¹ = (v, w), written with twice the angle, so that ρ and −ρ agree.

    Args:
        knot: whose it is.
        parameters: of the problem.
        asked: from home's heading [rad].
    """
    up = cs.DM(parameters.robot.up)
    home = quaternion.conjugate(cs.DM(parameters.robot.upright.base_quaternion_xyzw))
    turn = quaternion.product(quaternion.exp(-asked * up), quaternion.product(knot.base_quaternion_xyzw, home))
    along = cs.dot(turn[:3], up)
    return cs.atan2(2 * along * turn[3], turn[3] ** 2 - along**2)


def off_joints(knot: Knot, parameters: Parameters, asked: Mapping[str, float]) -> SX:
    """s − s̄ of the joints that are asked for.

    Args:
        knot: whose it is.
        parameters: of the problem.
        asked: positions by name [rad or m].
    """
    index = [parameters.robot.joint_names.index(name) for name in asked]
    return knot.joint_positions[index] - cs.DM(list(asked.values()))


def off_frame(knot: Knot, parameters: Parameters, frame: str, asked: Mapping[str, float]) -> SX:
    """Origin of a frame less where it is asked to be, along the axes that are asked for.

    Args:
        knot: whose it is.
        parameters: of the problem.
        frame: its name.
        asked: coordinates by axis [m].
    """
    return _off(knot.pose(frame).translation, asked)


def off_frame_orientation(knot: Knot, parameters: Parameters, frame: str, asked: tuple[float, ...]) -> SX:
    """Log(R̄ᵀ R): the rotation vector of a frame from the orientation that is asked for, in its axes.

    Args:
        knot: whose it is.
        parameters: of the problem.
        frame: its name.
        asked: world-from-frame, a quaternion x y z w.
    """
    return rotation_vector(cs.DM(quaternion.rotation_matrix(cs.DM(asked))).T @ knot.pose(frame).rotation)


def off_linear_momentum(at: Knot | Interval, parameters: Parameters, asked: Mapping[str, float]) -> SX:
    """m ẋ less what is asked for, along its axes.

    Args:
        at: a knot, or an interval that begins at it.
        parameters: of the problem.
        asked: by axis [kg m/s].
    """
    return _off(_meeting(at).com_velocity * parameters.robot.mass, asked)


def off_angular_momentum(at: Knot | Interval, parameters: Parameters, asked: Mapping[str, float]) -> SX:
    """hω less what is asked for, along its axes.

    Args:
        at: a knot, or an interval that begins at it.
        parameters: of the problem.
        asked: by axis [kg m²/s].
    """
    return _off(_meeting(at).angular_momentum, asked)


def rotation_vector(rotation: SX) -> SX:
    """Return Log(R) [rad], (3, 1): θ / sin θ times the vector part of (R − Rᵀ) / 2, smooth through R = 1."""
    skew = 0.5 * (rotation - rotation.T)
    vector = cs.vertcat(skew[2, 1], skew[0, 2], skew[1, 0])
    squared, cosine = cs.sumsqr(vector), 0.5 * (rotation[0, 0] + rotation[1, 1] + rotation[2, 2] - 1)
    small = squared < _SMALL
    sine = cs.sqrt(cs.if_else(small, 1, squared))
    return cs.if_else(small, 1 + squared / 6, cs.atan2(sine, cosine) / sine) * vector


_SMALL = 1e-8
"""Below this squared sine the series of θ / sin θ is exact to 1e-16."""


def _off(position: SX, asked: Mapping[str, float]) -> SX:
    index = [AXES.index(axis) for axis in asked]
    return position[index] - cs.DM(list(asked.values()))


def _meeting(at: Knot | Interval) -> Knot:
    """Return the knot where two intervals meet, with the mean of their velocities, or the knot itself."""
    return at.at_accelerations if isinstance(at, Interval) else at

"""The terms of the paper's problem: where each of its functions holds or is charged, in which unit and within what.

They are made as a user's own terms are. The first few places matter: rows and costs stand in the problem in this order.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from multimodal_to.adam.spatial import Array
from multimodal_to.models.contact import FACES
from multimodal_to.models.units import ONE, ONE_OF_A_POINT, OwnSize
from multimodal_to.ocp import constraints, contacts, costs, failures, limits, one_line, pushes, regions
from multimodal_to.ocp.contacts import ON_GROUND
from multimodal_to.ocp.parameters import Parameters
from multimodal_to.ocp.schedule import Flags
from multimodal_to.ocp.terms import (
    Constraint,
    Cost,
    EngineUnits,
    IntervalFunction,
    JointUnits,
    KnotFunction,
    Units,
    Where,
    at_least,
    at_most,
    between,
    each,
    equal,
)
from multimodal_to.scenarios.scenario import Start, Terminal
from multimodal_to.trajectory.quantities import TWIST, XYZ, XYZW, row_labels

UPRIGHT = 1e-3
"""How far each part of the base's quaternion, from upright, may be off in a hover [1]: 2e-3 rad about each axis."""


def _lagging_jets(parameters: Parameters) -> tuple[str, ...]:
    return tuple(parameters.robot.jet_names[index] for index in constraints.lagging_jets(parameters.robot))


def _running_lagging_jets(parameters: Parameters) -> Flags:
    return failures.running(parameters)[list(constraints.lagging_jets(parameters.robot))]


def _faces(parameters: Parameters) -> tuple[str, ...]:
    return row_labels(parameters.robot, "contact", FACES[parameters.scenario.friction_cone])


def _complementarity_max(parameters: Parameters) -> float:
    return parameters.complementarity_max


def _sliding_max(parameters: Parameters) -> float:
    return parameters.sliding_max


def _sliding_min(parameters: Parameters) -> float:
    return -parameters.sliding_max


@dataclass(frozen=True)
class _WeightOf:
    """The scenario's weight of a name, as a value: terms that hold it compare and can be pickled."""

    name: str

    def __call__(self, parameters: Parameters) -> float | Array:
        value = getattr(parameters.scenario.weights, self.name)
        if isinstance(value, int | float):
            return float(value)
        by_joint = np.zeros(len(parameters.robot.joint_names))
        for group, number in value.items():
            by_joint[parameters.robot.group_indices(group)] = number
        return by_joint


def weight_of(name: str) -> Callable[[Parameters], float | Array]:
    """Return the scenario's weight of a name; one by joint group becomes one for each joint."""
    return _WeightOf(name)


def _hovers_first(parameters: Parameters) -> bool:
    return parameters.scenario.start is Start.HOVER


def _starts_given(parameters: Parameters) -> bool:
    return parameters.scenario.start is Start.GIVEN


def _starts_at_rest(parameters: Parameters) -> bool:
    return parameters.scenario.start is not Start.GIVEN


def _hovers_last(parameters: Parameters) -> bool:
    return parameters.scenario.terminal is Terminal.HOVER


def _unpushed(parameters: Parameters) -> NDArray[np.bool_]:
    return pushes.unpushed(parameters, len(TWIST)) & one_line.needed_over_intervals(parameters)


def _pushed(parameters: Parameters) -> NDArray[np.bool_]:
    return pushes.pushed(parameters, len(TWIST))


def _pushed_labels(parameters: Parameters) -> tuple[str, ...]:
    return TWIST * len(pushes.groups(parameters))


def _pushed_units(parameters: Parameters) -> tuple[str, ...]:
    """m/s, kg m²/s."""
    return ("m/s", "m/s", "m/s", "kg m²/s", "kg m²/s", "kg m²/s") * len(pushes.groups(parameters))


def _is_pushed(parameters: Parameters) -> bool:
    return bool(parameters.scenario.pushes)


def _stands_last(parameters: Parameters) -> bool:
    return parameters.scenario.terminal is Terminal.STANDING


# -------------------------------------------------------------------- constraints

UNIT_QUATERNION = Constraint(
    value=constraints.unit_quaternion, within=equal(), unit="1", holds=Where.FIRST_KNOT, when=_hovers_first
)
UPRIGHT_FIRST = Constraint(
    name="upright_first",
    value=constraints.off_upright_first,
    within=between(-UPRIGHT, UPRIGHT),
    unit="1",
    holds=Where.FIRST_KNOT,
    labels=("level 1", "level 2", "vertical", "w"),
    when=_hovers_first,
)
UPRIGHT_LAST = replace(
    UPRIGHT_FIRST,
    name="upright_last",
    value=constraints.off_upright_last,
    holds=Where.LAST_KNOT,
    when=_hovers_last,
)
COM_KINEMATICS = Constraint(value=constraints.com_kinematics, within=equal(), unit="m", labels=XYZ)
ANGULAR_MOMENTUM_KINEMATICS = Constraint(
    value=constraints.angular_momentum_kinematics,
    within=equal(),
    unit="kg m²/s",
    holds=Where.EVERY_INTERVAL,
    labels=XYZ,
)
CONTACT_KINEMATICS = Constraint(
    value=constraints.contact_kinematics, within=equal(), unit="m", labels=each("contact", *XYZ)
)
NON_PENETRATION = Constraint(
    name="non_penetration",
    value=constraints.heights,
    within=at_least(0.0),
    unit="m",
    labels=each("contact"),
    rigid=True,
    present=contacts.not_held,
)
FRICTION_CONE = Constraint(
    value=constraints.friction_cone,
    within=at_least(0.0),
    unit="N",
    holds=(Where.FIRST_KNOT, Where.LATER_KNOTS),
    scale=constraints.LOAD,
    labels=_faces,
    present=contacts.loaded_faces,
)
COMPLEMENTARITY = Constraint(
    value=constraints.complementarity,
    within=at_most(_complementarity_max),
    unit="N m",
    holds=Where.LATER_KNOTS,
    scale=ONE_OF_A_POINT,
    labels=each("contact"),
    present=contacts.found_at_knot,
)
CONTACT_REACH = Constraint(
    value=constraints.contact_reach,
    within=between(-1.0, 1.0),
    unit="1",
    holds=Where.LATER_KNOTS,
    labels=each("contact", *XYZ),
)
JET_REACH = Constraint(
    value=constraints.jet_reach,
    within=between(-1.0, 1.0),
    unit="1",
    holds=Where.LATER_KNOTS,
    labels=each("jet", *XYZ),
)
STATIC_EQUILIBRIUM = Constraint(
    value=constraints.static_equilibrium,
    within=equal(),
    unit=("N", "N", "N", "N m", "N m", "N m"),
    holds=Where.FIRST_KNOT,
    scale=constraints.FORCE,
    labels=TWIST,
    when=_starts_at_rest,
    present=one_line.needed_first,
)
STEADY_THRUST = Constraint(
    value=constraints.steady_thrust,
    within=equal(),
    unit=EngineUnits("N", "N/s", "N/s²"),
    holds=Where.FIRST_KNOT,
    scale=constraints.FORCE,
    labels=each("jet"),
    when=_hovers_first,
)
MOMENTUM_DYNAMICS = Constraint(
    value=constraints.momentum_dynamics,
    within=equal(),
    unit=("m/s", "m/s", "m/s", "kg m²/s", "kg m²/s", "kg m²/s"),
    holds=Where.EVERY_INTERVAL,
    labels=TWIST,
    present=_unpushed,
)
MOMENTUM_DYNAMICS_PUSHED = Constraint(
    value=pushes.momentum_dynamics_pushed,
    within=equal(),
    unit=_pushed_units,
    holds=Where.EVERY_INTERVAL,
    labels=_pushed_labels,
    when=_is_pushed,
    present=_pushed,
)
COM_INTEGRATION = Constraint(
    value=constraints.com_integration, within=equal(), unit="m", holds=Where.EVERY_INTERVAL, labels=XYZ
)
BASE_POSITION_INTEGRATION = Constraint(
    value=constraints.base_position_integration, within=equal(), unit="m", holds=Where.EVERY_INTERVAL, labels=XYZ
)
BASE_ORIENTATION_INTEGRATION = Constraint(
    value=constraints.base_orientation_integration,
    within=equal(),
    unit="1",
    holds=Where.EVERY_INTERVAL,
    labels=XYZW,
)
JOINT_INTEGRATION = Constraint(
    value=constraints.joint_integration,
    within=equal(),
    unit=JointUnits("rad"),
    holds=Where.EVERY_INTERVAL,
    labels=each("joint"),
)
THRUST_INTEGRATION = Constraint(
    value=constraints.thrust_integration,
    within=equal(),
    unit="N",
    holds=Where.EVERY_INTERVAL,
    scale=constraints.FORCE,
    labels=each("jet"),
)
THRUST_DYNAMICS = Constraint(
    value=constraints.thrust_dynamics,
    within=equal(),
    unit=EngineUnits("N", "N/s", "N/s"),
    holds=Where.EVERY_INTERVAL,
    scale=constraints.FORCE,
    labels=each("jet"),
)
SLIDING = Constraint(
    value=constraints.sliding,
    within=between(_sliding_min, _sliding_max),
    unit="N m",
    holds=Where.EVERY_INTERVAL,
    scale=ONE_OF_A_POINT,
    labels=each("contact", "x", "y"),
    present=contacts.slides_before,
)
STANDING_HEIGHT = Constraint(
    name="standing_height",
    value=constraints.heights,
    within=between(0.0, ON_GROUND),
    unit="m",
    holds=Where.LAST_KNOT,
    labels=each("contact"),
    when=_stands_last,
    rigid=True,
    present=contacts.not_held,
)

COMPLEMENTARITY_BEFORE = Constraint(
    value=constraints.complementarity_before,
    within=at_most(_complementarity_max),
    unit="N m",
    holds=Where.EVERY_INTERVAL,
    scale=ONE_OF_A_POINT,
    labels=each("contact"),
    present=contacts.found_before,
)
COMPLEMENTARITY_AFTER = replace(
    COMPLEMENTARITY_BEFORE,
    name="complementarity_after",
    value=constraints.complementarity_after,
    present=contacts.found_after,
)
SLIDING_AFTER = replace(SLIDING, name="sliding_after", value=constraints.sliding_after, present=contacts.slides_after)
FINAL_EQUILIBRIUM = Constraint(
    name="final_equilibrium",
    value=constraints.static_equilibrium,
    within=equal(),
    unit=("N", "N", "N", "N m", "N m", "N m"),
    holds=Where.LAST_KNOT,
    scale=constraints.FORCE,
    labels=TWIST,
    when=_stands_last,
)
FINAL_STEADY_THRUST = Constraint(
    name="final_steady_thrust",
    value=constraints.final_steady_thrust,
    within=equal(),
    unit=EngineUnits("N", "N/s", "N/s²", lagging=True),
    holds=Where.LAST_KNOT,
    scale=constraints.FORCE,
    labels=_lagging_jets,
    when=_hovers_last,
    present=_running_lagging_jets,
)
MOMENTUM_AT_START = Constraint(
    value=constraints.momentum_at_start,
    within=equal(),  # to what the given state says, as `ocp.given` has it; so do the next three
    unit=("m/s", "m/s", "m/s", "kg m²/s", "kg m²/s", "kg m²/s"),
    holds=Where.FIRST_INTERVAL,
    labels=TWIST,
    when=_starts_given,
)
BASE_TWIST_AT_START = Constraint(
    value=constraints.base_twist_at_start,
    within=equal(),
    unit=("m/s", "m/s", "m/s", "rad/s", "rad/s", "rad/s"),
    holds=Where.FIRST_INTERVAL,
    labels=TWIST,
    when=_starts_given,
)
JOINT_VELOCITIES_AT_START = Constraint(
    value=constraints.joint_velocities_at_start,
    within=equal(),
    unit=JointUnits("rad/s"),
    holds=Where.FIRST_INTERVAL,
    labels=each("joint"),
    when=_starts_given,
)
THRUST_RATE_AT_START = Constraint(
    value=constraints.thrust_rate_at_start,
    within=equal(),
    unit="N/s",
    holds=Where.FIRST_INTERVAL,
    scale=constraints.FORCE,
    labels=each("jet"),
    when=_starts_given,
)
LEAPFROG = (
    COMPLEMENTARITY_BEFORE,
    COMPLEMENTARITY_AFTER,
    SLIDING_AFTER,
    FINAL_EQUILIBRIUM,
    FINAL_STEADY_THRUST,
    MOMENTUM_AT_START,
    BASE_TWIST_AT_START,
    JOINT_VELOCITIES_AT_START,
    THRUST_RATE_AT_START,
)
"""What leapfrog asks for beside: a force acts half an interval before and after its knot, and none follows the last;
the velocities of a given state are the means of those before and after it.
"""

CONSTRAINTS = (
    UNIT_QUATERNION,
    UPRIGHT_FIRST,
    UPRIGHT_LAST,
    COM_KINEMATICS,
    ANGULAR_MOMENTUM_KINEMATICS,
    CONTACT_KINEMATICS,
    NON_PENETRATION,
    FRICTION_CONE,
    COMPLEMENTARITY,
    CONTACT_REACH,
    JET_REACH,
    STATIC_EQUILIBRIUM,
    STEADY_THRUST,
    MOMENTUM_DYNAMICS,
    COM_INTEGRATION,
    BASE_POSITION_INTEGRATION,
    BASE_ORIENTATION_INTEGRATION,
    JOINT_INTEGRATION,
    THRUST_INTEGRATION,
    THRUST_DYNAMICS,
    SLIDING,
    STANDING_HEIGHT,
    *contacts.CONSTRAINTS,
    *failures.CONSTRAINTS,
    MOMENTUM_DYNAMICS_PUSHED,
    regions.ROOM,
    limits.LIMITS,
)

# -------------------------------------------------------------------- costs


def running(
    residual: KnotFunction | IntervalFunction,
    unit: Units,
    *charged: Where,
    scale: float | OwnSize = ONE,
) -> Cost:
    """Return a cost that is charged per second, with the scenario's weight of the residual's name.

    Args:
        residual: of a knot or of an interval.
        unit: of its rows, or of each.
        charged: where; by default at every knot but the first.
        scale: its usual size, in its unit.
    """
    name = residual.__name__
    places = charged or (Where.LATER_KNOTS,)
    return Cost(residual=residual, weight=weight_of(name), unit=unit, charged=places, scale=scale)


def _once(name: str, residual: KnotFunction | IntervalFunction, unit: Units, where: Where = Where.LAST_KNOT) -> Cost:
    """Return a cost that is charged once."""
    return Cost(name=name, residual=residual, weight=weight_of(name), unit=unit, charged=where, per_second=False)


_TWIST_RATE = ("m/s²", "m/s²", "m/s²", "rad/s²", "rad/s²", "rad/s²")

COSTS = (
    running(costs.com_velocity, "m/s"),
    running(costs.com_acceleration, "m/s²", Where.EVERY_INTERVAL),
    running(costs.angular_momentum, "kg m²/s"),
    running(costs.angular_momentum_rate, "N m", Where.EVERY_INTERVAL),
    running(costs.base_acceleration, _TWIST_RATE, Where.EVERY_INTERVAL),
    running(costs.joint_velocities, JointUnits("rad/s")),
    running(costs.posture, JointUnits("rad")),
    running(costs.base_orientation, "1"),
    running(costs.contact_forces, "N", Where.FIRST_KNOT, Where.LATER_KNOTS, scale=constraints.LOAD),
    running(costs.contact_force_rates, "N/s", Where.EVERY_INTERVAL, scale=constraints.LOAD),
    running(costs.thrust, "N", scale=OwnSize(100.0)),
    running(costs.thrust_rate, "N/s", scale=constraints.FORCE),
    running(costs.throttle, "%", scale=50.0),
    _once("initial_posture", costs.posture, JointUnits("rad"), Where.FIRST_KNOT),
    _once("final_posture", costs.posture, JointUnits("rad")),
    _once("final_com_velocity", costs.com_velocity, "m/s"),
    _once("final_com_acceleration", costs.com_acceleration, "m/s²", Where.LAST_INTERVAL),
    _once("final_angular_momentum", costs.angular_momentum, "kg m²/s"),
    _once("final_angular_momentum_rate", costs.angular_momentum_rate, "N m", Where.LAST_INTERVAL),
)

TERMS = (*CONSTRAINTS, *COSTS)
"""Every term of the paper's problem, in order."""

"""What an audit judges: each property with its unit, its limit, where the limit comes from, and when it is judged.

The findings take unit and limit from this table, and the reference page of the audit is made from it.

Many limits follow from the solver. It counts a motion as feasible when no row is missed by more than 1e-5 of the row's
scale (`solving.solver.FEASIBLE`). For the iRonCub that is 1e-5 m, rad, m/s or kg m²/s, and 5e-4 N or N/s for rows with
a scale of 50. The scales grow and shrink with the robot, and so do these limits. The others are shares of the robot's
size (`Of`).
"""

from __future__ import annotations

from collections.abc import Mapping

from multimodal_to.arguments import checked
from multimodal_to.auditing import keyframes
from multimodal_to.auditing.contacts import CONTACTS
from multimodal_to.auditing.failures import FAILURES
from multimodal_to.auditing.limits import LIMITS
from multimodal_to.auditing.margins import MARGINS
from multimodal_to.auditing.property import Judged, Of, Property
from multimodal_to.auditing.regions import REGIONS
from multimodal_to.auditing.self_collision import SELF_COLLISION
from multimodal_to.errors import InputError, unknown
from multimodal_to.models.robot import Robot
from multimodal_to.scenarios.scenario import Scenario
from multimodal_to.trajectory.derived import LOADED_SHARE
from multimodal_to.values import FrozenMapping

_FEASIBLE = "what a feasible motion may miss its row by"
_TWICE_FEASIBLE = "twice what a feasible motion may miss its row by"
_BOUND = "a bound, which the solver holds; the limit is for rounding"

_PHYSICS = (
    Property(
        name="CoM consistency",
        unit="m",
        limit=1e-5,
        reason=_FEASIBLE,
        meaning="difference of the stored CoM from that of the stored posture",
    ),
    Property(
        name="momentum consistency",
        unit="kg m²/s",
        limit=1e-4,
        reason="ten times what a feasible motion may miss its row by, since the CoM's own miss enters too",
        meaning="difference of the stored angular momentum hω from J_CMM(q) ν",
    ),
    Property(
        name="contact point consistency",
        unit="m",
        limit=1e-5,
        reason=_FEASIBLE,
        meaning="difference of a stored contact point from forward kinematics",
    ),
    Property(
        name="quaternion norm",
        unit="1",
        limit=1e-6,
        reason="integration by the exponential keeps the norm; the limit is for rounding and small misses that add up",
        meaning="difference of |ρ| from one",
    ),
    Property(
        name="force balance",
        unit="N",
        limit=2.3e-5,
        of=Of.WEIGHT,
        reason="a feasible motion may miss its row by 1e-5 m/s, which over 0.05 s is 2e-5 of the weight",
        meaning="m g + Σ f − m ẍ, largest component: Newton for the whole robot",
    ),
    Property(
        name="moment balance",
        unit="N m",
        limit=4e-5,
        of=Of.MOMENT,
        reason="chosen: twice the share of the force balance",
        meaning="Σ (p − x) × f − ḣω, largest component: Euler for the whole robot",
    ),
    Property(
        name="torque beyond effort",
        unit="N m",
        of_joints=True,
        limit=4e-6,
        of=Of.MOMENT,
        reason="the effort limit of `robot.toml`, or the URDF's; the rest is for rounding",
        meaning="torque of a joint by inverse dynamics (RNEA) minus its effort limit, of every joint that has one; "
        "the term `joint_torques` holds torques below a share of it, the scenario's `margins.torque`",
    ),
    Property(
        name="unexplained base force",
        unit="N",
        limit=0.01,
        of=Of.WEIGHT,
        reason="chosen: one hundredth of the robot's weight",
        meaning="force that RNEA asks for at the base, where nothing pushes",
    ),
    Property(
        name="unexplained base moment",
        unit="N m",
        limit=0.004,
        of=Of.MOMENT,
        reason="chosen: for the iRonCub 1 N m, small beside the torque of one leg joint",
        meaning="moment that RNEA asks for at the base, where nothing pushes",
    ),
)

GAPS = (
    ("com_position", "com_velocity", "m", 1e-5, Of.SIZE),
    ("com_velocity", "com_acceleration", "m/s", 1e-5, Of.SIZE),
    ("angular_momentum", "angular_momentum_rate", "kg m²/s", 1e-5, Of.SIZE),
    ("base_position", "base_linear_velocity", "m", 1e-5, Of.SIZE),
    ("joint_positions", "joint_velocities", "rad", 1e-5, Of.SIZE),
    ("contact_forces", "contact_force_rates", "N", 2.3e-6, Of.WEIGHT),
    ("thrust", "thrust_rate", "N", 1e-3, Of.SIZE),
    ("thrust_rate", "thrust_acceleration", "N/s", 1e-3, Of.SIZE),
)
"""The quantities that a rule integrates: name, its rate, unit and limit of what is left, and the limit's `Of`."""
_DIFFERENCES = ("com_acceleration", "angular_momentum_rate", "contact_force_rates", "thrust_acceleration")
"""Rates that are no variables of the problem: the library's own files hold the difference itself."""


def _gap_reason(rate: str, limit: float) -> str:
    if rate in _DIFFERENCES:
        return "this library's files hold the difference itself as the rate; the limit is for files from elsewhere"
    return _FEASIBLE if limit == 1e-5 else _TWICE_FEASIBLE


_INTEGRATION = (
    *(
        Property(
            name=f"gap of {name}",
            unit=unit,
            limit=limit,
            of=of,
            of_joints=name == "joint_positions",
            reason=_gap_reason(rate, limit),
            meaning=f"gain of `{name}` over an interval minus `{rate}` at its end × Δt",
        )
        for name, rate, unit, limit, of in GAPS
    ),
    Property(
        name="gap of base orientation",
        unit="rad",
        limit=1e-5,
        reason=_FEASIBLE,
        meaning="turn of the base over an interval against Exp(ω Δt), ω at the interval's end",
    ),
)

_ACTUATION_AND_CONTACT = (
    Property(
        name="thrust dynamics",
        unit="N/s²",
        limit=1e-3,
        reason="ten times what an answer misses its row by: 1e-7 of 50 N/s over 0.05 s is 1e-4 N/s²",
        meaning="difference of the stored T̈ from what the turbine's model gives for T, Ṫ and u",
    ),
    Property(
        name="penetration",
        unit="m",
        limit=1e-5,
        reason=_FEASIBLE,
        meaning="depth of a contact point below the ground",
    ),
    Property(
        name="pulling normal force",
        unit="N",
        limit=1e-3,
        of=Of.POINT,
        reason=_TWICE_FEASIBLE,
        meaning="contact force towards the ground's inside, −n·f",
    ),
    Property(
        name="friction beyond cone",
        unit="N",
        limit=1e-3,
        second_order_limit=1e-2,
        of=Of.POINT,
        reason=f"{_TWICE_FEASIBLE}; under the second-order cone more, because a row of squares is met less sharply "
        "where forces vanish",
        meaning="|t·f| − μ n·f under the scenario's cone and friction",
    ),
    Property(
        name="normal force × height",
        unit="N m",
        limit=3.2e-4,
        of=Of.POINT_MOMENT,
        reason="twice the default of `complementarity_max`",
        meaning="normal force of a contact point × its height, under leapfrog the greatest height of its knot and the "
        "two beside it, within which the force acts: force in the air",
    ),
    Property(
        name="slip under load",
        unit="m",
        limit=1.75e-3,
        of=Of.HEIGHT,
        reason="for the iRonCub 1 mm, above what the default of `sliding_max` lets a point with 5 N slip: 0.4 mm along "
        "each tangent",
        meaning="way of a contact point along the ground over an interval at whose end it carries load, under leapfrog "
        "at either end: "
        f"more than {100 * LOADED_SHARE:g} % of the weight over the number of points (iRonCub: 5 N)",
    ),
    Property(
        name="joint range",
        unit="rad",
        of_joints=True,
        limit=1e-6,
        reason=f"`lower` and `upper` in robot.toml: {_BOUND}",
        meaning="how far a joint is outside its range",
    ),
    Property(
        name="joint speed",
        unit="rad/s",
        of_joints=True,
        limit=1e-6,
        reason=f"`speed` in robot.toml: {_BOUND}",
        meaning="how far a joint's speed is above its greatest",
    ),
    Property(
        name="thrust range",
        unit="N",
        limit=1e-4,
        reason=f"zero and `thrust_max` in robot.toml: {_BOUND}",
        meaning="how far a thrust is outside its range",
    ),
    Property(
        name="throttle range",
        unit="%",
        limit=1e-4,
        reason=f"`throttle` in robot.toml: {_BOUND}",
        meaning="how far a throttle is outside its range",
    ),
    Property(
        name="thrust off CVODES, interval",
        unit="N",
        limit=1 / 32,
        first_order_limit=1 / 16,
        of=Of.THRUST,
        reason="chosen, twice what plans by a rule of order two with steps of 0.2 s are off where throttles jump; for "
        "the iRonCub 5 N, by a rule of order one 10 N",
        meaning="thrust at an interval's end minus that of an adaptive integrator started at the interval's start",
        judged=Judged.WITH_JETS,
    ),
    Property(
        name="thrust off CVODES, horizon",
        unit="N",
        limit=1 / 32,
        first_order_limit=1 / 8,
        of=Of.THRUST,
        reason="chosen: the limit of one interval, since errors of a rule of order two do not add up; by one of order "
        "one twice as much",
        meaning="thrust at a knot minus that of an adaptive integrator started at the first knot",
        judged=Judged.WITH_JETS,
    ),
)

_SECOND_ORDER = "chosen, at least twice what plans by a rule of order two with steps of 0.1 s are off"
_BY_CONTROLS = (
    "an accurate integrator that started from the file up to 2 √(L/g) before, under the file's contact forces, "
    "throttles and joint motion"
)
_ORDER = (
    Property(
        name="CoM off integrator, stretch",
        unit="m",
        limit=0.05,
        first_order_limit=0.2,
        of=Of.HEIGHT,
        reason=f"{_SECOND_ORDER}; one of order one is off by half an interval of each change of a force",
        meaning=f"distance of the CoM at a knot from that of {_BY_CONTROLS}",
    ),
    Property(
        name="base off integrator, stretch",
        unit="rad",
        limit=0.1,
        first_order_limit=0.6,
        reason=f"{_SECOND_ORDER}; one of order one is off by half an interval of each change of a moment",
        meaning=f"angle of the base at a knot to that of {_BY_CONTROLS}",
    ),
    Property(
        name="CoM off integrator, horizon",
        unit="m",
        limit=0.25,
        first_order_limit=10.0,
        of=Of.HEIGHT,
        reason=f"{_SECOND_ORDER}; backward Euler has contact forces half an interval before thrusts, which leaves a "
        "speed of ½ g Δt after a take-off: metres in ten seconds",
        meaning="distance of the CoM at a knot from that of an accurate integrator that started at the first knot, "
        "under the file's contact forces, thrusts and posture",
    ),
)
"""Whether the motion is also right between the knots, which its rows at the knots cannot say."""


def _com(when: str) -> Property:
    return Property(
        name=f"{when}: CoM",
        unit="m",
        limit=1e-5,
        reason=_FEASIBLE,
        meaning=f"distance of the CoM from `{'initial' if when == 'start' else 'final'}_com`, by axis",
        judged=Judged.WITH_SCENARIO if when == "start" else Judged.WITH_END_COM,
    )


def _rest(when: str, condition: Judged) -> tuple[Property, ...]:
    return (
        Property(
            name=f"{when}: speed",
            unit="m/s, rad/s",
            limit=1e-5,
            reason="zero is asked for; the limit is that of a feasible motion",
            meaning="largest component of the velocities of CoM, base and joints",
            judged=condition,
        ),
        Property(
            name=f"{when}: angular momentum",
            unit="kg m²/s",
            limit=1e-4,
            reason="zero is asked for; the limit is that of the momentum consistency",
            meaning="largest component of hω",
            judged=condition,
        ),
    )


def _standing(when: str, condition: Judged) -> Property:
    return Property(
        name=f"{when}: feet off the ground",
        unit="m",
        limit=2e-5,
        reason="the row lets a sole's corner be 1e-5 m high, and a feasible motion may miss it by as much",
        meaning="distance of a contact point from the ground",
        judged=condition,
    )


def _hovering(when: str, condition: Judged) -> tuple[Property, ...]:
    return (
        Property(
            name=f"{when}: contact force",
            unit="N",
            limit=0.011,
            of=Of.POINT,
            reason="the problem leaves 0.01 N; a tenth of that for rounding",
            meaning="largest component of a contact force",
            judged=condition,
        ),
        Property(
            name=f"{when}: base off upright",
            unit="rad",
            limit=3e-3,
            reason="the problem leaves 2e-3 rad about each of two level axes, 2.83e-3 rad in all; a twentieth of that "
            "for rounding",
            meaning="angle between the vertical in the base's axes and where it is there when the robot is upright: at "
            "home, without its lean",
            judged=condition,
        ),
        Property(
            name=f"{when}: thrust off weight",
            unit="N",
            limit=0.1,
            reason="the problem leaves 0.01 N at each contact point; enough for ten",
            meaning="sum of the thrusts plus m g, largest component",
            judged=condition,
        ),
        Property(
            name=f"{when}: thrust rate",
            unit="N/s",
            limit=1e-3,
            reason="zero is asked for; the limit is twice that of a feasible motion",
            meaning="largest Ṫ",
            judged=condition,
        ),
    )


def _equilibrium(when: str, condition: Judged) -> tuple[Property, ...]:
    return (
        Property(
            name=f"{when}: force balance",
            unit="N",
            limit=2.3e-5,
            of=Of.WEIGHT,
            reason="the limit of the force balance",
            meaning="Σ f + m g, largest component, whatever accelerations the file states",
            judged=condition,
        ),
        Property(
            name=f"{when}: moment balance",
            unit="N m",
            limit=4e-5,
            of=Of.MOMENT,
            reason="the limit of the moment balance",
            meaning="Σ (p − x) × f, largest component, whatever rates the file states",
            judged=condition,
        ),
    )


_TASK = (
    _com("start"),
    *_rest("start", Judged.START_AT_REST),
    _standing("start", Judged.STANDING_START),
    Property(
        name="start: thrust",
        unit="N",
        limit=1e-4,
        reason=f"zero is asked for: {_BOUND}",
        meaning="largest thrust",
        judged=Judged.STANDING_START,
    ),
    *_hovering("start", Judged.HOVERING_START),
    *_equilibrium("start", Judged.START_AT_REST),
    Property(
        name="knots",
        unit="1",
        limit=0.0,
        reason="`knots` of the scenario, exactly",
        meaning="difference of the number of intervals from what is asked",
        judged=Judged.WITH_SCENARIO,
    ),
    Property(
        name="time step range",
        unit="s",
        limit=1e-6,
        reason=f"`interval_min` and `interval_max` of the scenario: {_BOUND}",
        meaning="how far a time step is outside its range",
        judged=Judged.WITH_SCENARIO,
    ),
    Property(
        name="base speed range",
        unit="m/s, rad/s",
        limit=1e-6,
        reason=f"`base_speed_max` of the scenario: {_BOUND}",
        meaning="how far a component of the base's twist is above its greatest",
        judged=Judged.WITH_SCENARIO,
    ),
    Property(
        name="CoM range",
        unit="m",
        limit=1e-6,
        reason=f"`com_range` of the scenario: {_BOUND}",
        meaning="how far the CoM is outside its range, by axis",
        judged=Judged.WITH_SCENARIO,
    ),
    Property(
        name="middle: CoM below",
        unit="m",
        limit=1e-5,
        reason=_FEASIBLE,
        meaning="how far the CoM at mid-horizon is below `mid_height_min`",
        judged=Judged.WITH_MID_HEIGHT,
    ),
    *keyframes.PROPERTIES,
    *_rest(keyframes.NAME, Judged.WITH_KEYFRAMES),
    _standing(keyframes.NAME, Judged.WITH_KEYFRAMES),
    *_hovering(keyframes.NAME, Judged.WITH_KEYFRAMES),
    _com("end"),
    *_rest("end", Judged.END_AT_REST),
    _standing("end", Judged.STANDING_END),
    *_hovering("end", Judged.HOVERING_END),
    *_equilibrium("end", Judged.HOVERING_END),
)

PROPERTIES: Mapping[str, Property] = FrozenMapping(
    {
        entry.name: entry
        for entry in (
            *_PHYSICS,
            *_INTEGRATION,
            *_ACTUATION_AND_CONTACT,
            *_ORDER,
            *SELF_COLLISION,
            *MARGINS,
            *_TASK,
            *CONTACTS,
            *FAILURES,
            *REGIONS,
            *LIMITS,
        )
    }
)
"""Every property by name, in the order of an audit's findings."""


@checked
def judged(scenario: Scenario | None, robot: Robot) -> list[str]:
    """Return the names of the properties that a motion of a robot is judged by, in the order of the table."""
    known = {name: entry.judged for name, entry in PROPERTIES.items() if entry.judged.applies(scenario, robot)}
    asked = keyframes.kinds(scenario) if scenario else set()
    return [name for name, condition in known.items() if condition is not Judged.WITH_KEYFRAMES or name in asked]


@checked
def check_allowances(robot: Robot, scenario: Scenario) -> None:
    """Refuse a scenario that allows more of a property which its audit does not judge.

    Args:
        robot: with the jets that the scenario uses.
        scenario: whose allowances are looked at.

    Raises:
        InputError: no property of the audit has the name of an allowance.
    """
    known = judged(scenario, robot)
    for name in scenario.allowances:
        if name not in known:
            raise InputError(unknown("property to allow more of", name, known))

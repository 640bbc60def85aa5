"""The audit judges start, end and ranges by the scenario that a file keeps, and thrusts by integrating them again."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import multimodal_to as mt
from multimodal_to import scenarios
from multimodal_to.auditing import PROPERTIES
from multimodal_to.auditing.audit import audit
from multimodal_to.auditing.thrust import thrust_findings
from multimodal_to.models.terrain import FlatGround
from multimodal_to.scenarios import Start, Terminal
from multimodal_to.scenarios.data import stored, to_json
from multimodal_to.trajectory import rules
from synthetic import take_off as synthetic_take_off


def spoiled(trajectory, name, row, knot, amount):
    array = getattr(trajectory, name).copy()
    array[row, knot] += amount
    return replace(trajectory, **{name: array})


def test_a_solved_motion_keeps_its_scenario_and_does_what_it_asks(ironcub, take_off):
    assert stored(take_off.trajectory) == scenarios.take_off()
    report = audit(ironcub, take_off.trajectory)
    assert report.scenario == scenarios.take_off()
    assert [finding for finding in report.findings if not finding.holds] == []
    assert len([finding for finding in report.findings if finding.name.startswith(("start:", "end:"))]) >= 14


@pytest.mark.parametrize(
    ("property_name", "quantity", "row", "knot", "amount"),
    [
        ("start: CoM", "com_position", 1, 0, 1e-4),
        ("start: speed", "joint_velocities", 3, 0, 1e-3),
        ("start: speed", "base_angular_velocity", 1, 0, 1e-3),
        ("start: angular momentum", "angular_momentum", 0, 0, 1e-2),
        ("start: feet off the ground", "base_position", 2, 0, 1e-3),
        ("start: thrust", "thrust", 2, 0, 1.0),
        ("start: force balance", "contact_forces", 2, 0, 1.0),
        ("start: moment balance", "contact_forces", 2, 0, 1.0),
        ("base speed range", "base_linear_velocity", 2, 20, 3.0),
        ("CoM range", "com_position", 0, 20, 2.0),
        ("end: CoM", "com_position", 2, -1, 1e-4),
        ("end: speed", "com_velocity", 2, -1, 1e-3),
        ("end: angular momentum", "angular_momentum", 1, -1, 1e-2),
        ("end: contact force", "contact_forces", 5, -1, 0.1),
        ("end: base off upright", "base_quaternion_xyzw", 0, -1, 0.01),
        ("end: thrust off weight", "thrust", 0, -1, 1.0),
        ("end: thrust rate", "thrust_rate", 0, -1, 0.1),
        ("end: force balance", "thrust", 0, -1, 1.0),
        ("end: moment balance", "thrust", 0, -1, 1.0),
    ],
)
def test_a_motion_that_misses_its_task_is_found_where_it_does(
    ironcub, take_off, property_name, quantity, row, knot, amount
):
    trajectory = take_off.trajectory
    if property_name in ("end: force balance", "end: moment balance"):
        knot -= bool(rules.instant(trajectory.rule, "com_velocity"))  # the last knot from which a row leads on
    assert audit(ironcub, trajectory)[property_name].holds
    finding = audit(ironcub, spoiled(trajectory, quantity, row, knot, amount))[property_name]
    assert not finding.holds
    assert finding.knot == range(trajectory.knots + 1)[knot]


@pytest.mark.parametrize(
    ("change", "property_name"),
    [
        ({"final_com": (0.0, 0.0, 0.71)}, "end: CoM"),
        ({"initial_com": (0.0, 0.01, 0.57)}, "start: CoM"),
        ({"start": Start.HOVER}, "start: contact force"),
        ({"start": Start.HOVER}, "start: thrust off weight"),
        ({"terminal": Terminal.STANDING}, "end: feet off the ground"),
        ({"surface": FlatGround(height=0.01)}, "start: feet off the ground"),
        ({"mid_height_min": 0.65}, "middle: CoM below"),
        ({"knots": 60}, "knots"),
        ({"interval_max": 0.06}, "time step range"),
        ({"base_speed_max": 0.05}, "base speed range"),
        ({"com_range": (1.5, 1.5, 0.7), "final_com": (0.0, 0.0, 0.69)}, "end: CoM"),
    ],
)
def test_another_task_than_the_one_that_was_solved_is_not_met(ironcub, take_off, change, property_name):
    other = replace(scenarios.take_off(), **change)
    assert not audit(ironcub, take_off.trajectory, other)[property_name].holds
    kept = replace(take_off.trajectory, scenario_json=to_json(other))
    assert not audit(ironcub, kept)[property_name].holds


def test_a_free_end_is_judged_by_its_com_alone(ironcub, take_off):
    report = audit(ironcub, take_off.trajectory, replace(scenarios.take_off(), terminal=Terminal.FREE))
    assert [finding.name for finding in report.findings if finding.name.startswith("end:")] == ["end: CoM"]


def test_without_a_scenario_only_physics_is_judged(ironcub, take_off):
    report = audit(ironcub, replace(take_off.trajectory, scenario_json=""))
    assert report.scenario is None
    assert not [finding for finding in report.findings if finding.name.startswith(("start:", "end:"))]
    assert report.holds


def test_thrusts_that_follow_their_dynamics_closely_are_not_off_and_those_that_do_not_are(ironcub):
    """Runge and Kutta with 200 steps an interval, against the audit's CVODES."""
    drawn, steps = synthetic_take_off(ironcub), 200
    thrust, rate = drawn.thrust.copy(), drawn.thrust_rate.copy()
    dt = drawn.duration / drawn.knots / steps
    for row, jet in enumerate(ironcub.jets):

        def slope(state, throttle, model=jet.model):
            return np.array([state[1], model.acceleration(state[0], state[1], throttle)])

        state = np.array([20.0, 0.0])
        thrust[row, 0], rate[row, 0] = state
        for knot in range(1, drawn.knots + 1):
            for _ in range(steps):
                throttle = drawn.throttle[row, knot]
                k1 = slope(state, throttle)
                k2 = slope(state + dt / 2 * k1, throttle)
                k3 = slope(state + dt / 2 * k2, throttle)
                k4 = slope(state + dt * k3, throttle)
                state = state + dt / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
            thrust[row, knot], rate[row, knot] = state
    true = replace(drawn, thrust=thrust, thrust_rate=rate)
    interval, horizon = thrust_findings(ironcub, true)
    assert interval.worst < 1e-5
    assert horizon.worst < 1e-5
    interval, horizon = thrust_findings(ironcub, spoiled(true, "thrust", 1, 7, 15.0))
    assert interval.worst == pytest.approx(15.0, rel=0.1)
    assert interval.body == ironcub.jet_names[1]
    limits = {name: PROPERTIES[name].limit_for(ironcub, None, true.rule) for name in (interval.name, horizon.name)}
    assert interval.worst > limits[interval.name]
    assert horizon.worst < limits[horizon.name]
    assert horizon.knot == 7


def test_backward_euler_is_off_by_a_few_newtons_and_leapfrog_by_tenths(ironcub, take_off, once):
    paper = mt.scenarios.paper("take-off"), mt.Formulation.paper()
    plain = once("paper take-off", lambda: mt.solve(mt.build(ironcub, *paper)))
    interval, horizon = thrust_findings(ironcub, plain.trajectory)
    assert 0.1 < interval.worst < 3.0
    assert interval.worst < horizon.worst < 10.0
    better, best = thrust_findings(ironcub, take_off.trajectory)
    assert better.worst < 0.1 * interval.worst
    assert best.worst < 0.1 * horizon.worst


def test_thrusts_that_run_away_are_infinitely_off_and_a_robot_without_jets_has_none(ironcub, take_off):
    (_, horizon) = thrust_findings(ironcub, spoiled(take_off.trajectory, "thrust_rate", 0, 0, 1e6))
    assert horizon.worst > 1e3 > PROPERTIES[horizon.name].limit_for(ironcub, None, take_off.trajectory.rule)
    none = np.zeros((0, take_off.trajectory.knots + 1))
    names = ("thrust", "thrust_rate", "thrust_acceleration", "throttle")
    bare = replace(take_off.trajectory, jet_names=(), **dict.fromkeys(names, none))
    assert thrust_findings(ironcub.with_jets(()), bare) == []

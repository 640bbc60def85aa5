"""Thrusts by an adaptive integrator, against turbines that are followed in fine steps."""

from __future__ import annotations

import numpy as np
import pytest

from drones import drone
from multimodal_to.auditing.thrust import thrust_findings
from multimodal_to.trajectory import QUANTITIES, Trajectory, rules

KNOTS, STEP, FINE = 12, 0.1, 200
INTERVAL, HORIZON = "thrust off CVODES, interval", "thrust off CVODES, horizon"


def slope(jet, state, throttle):
    return np.array([state[1], float(jet.model.acceleration(state[0], state[1], throttle))])


def spooled(jet, throttles, after):
    """Return T and Ṫ at the knots, where each throttle acts for one interval, until `after` intervals past its knot."""
    states, h = [np.zeros(2)], STEP / FINE
    for index in range(KNOTS * FINE):
        state = states[-1]
        throttle = throttles[int(np.ceil((index + 0.5) / FINE - after))]
        k1 = slope(jet, state, throttle)
        k2 = slope(jet, state + h / 2 * k1, throttle)
        k3 = slope(jet, state + h / 2 * k2, throttle)
        states.append(state + h / 6 * (k1 + 2 * k2 + 2 * k3 + slope(jet, state + h * k3, throttle)))
    return np.array(states)[::FINE].T


def before(jet, thrust, rate, throttle, share):
    """Return Ṫ a share of an interval before the knots, from which half a step leads to that of the knots."""
    found = rate
    for _ in range(60):
        found = rate - share * STEP * jet.model.acceleration(thrust, found, throttle)
    return found


def motion(robot, rule, spooling):
    """A motion of zeros, but for thrusts that the turbines have when throttles act as another rule says."""
    bodies = {"robot": 1, "joint": len(robot.joint_names), "contact": len(robot.contact_names), "jet": len(robot.jets)}
    arrays = {name: np.zeros((entry.rows * bodies[entry.of], KNOTS + 1)) for name, entry in QUANTITIES.items()}
    arrays["base_quaternion_xyzw"][3] = 1.0
    for row, jet in enumerate(robot.jets):
        throttles = 40.0 + 30.0 * np.sin(1.1 * np.arange(KNOTS + 1) + row)
        thrust, rate = spooled(jet, throttles, rules.acts_after(spooling))
        arrays["throttle"][row], arrays["thrust"][row] = throttles, thrust
        arrays["thrust_rate"][row] = before(jet, thrust, rate, throttles, rules.instant(rule, "thrust_rate"))
    return Trajectory(
        robot=robot.name,
        scenario="by hand",
        time=STEP * np.arange(KNOTS + 1),
        joint_names=robot.joint_names,
        contact_names=robot.contact_names,
        jet_names=robot.jet_names,
        rule=rule,
        **arrays,
    )


def found(robot, trajectory):
    return {entry.name: entry.worst for entry in thrust_findings(robot, trajectory)}


@pytest.mark.parametrize("rule", [rules.BACKWARD_EULER, rules.STAGGERED, rules.LEAPFROG])
def test_a_turbine_that_follows_its_throttles_as_the_rule_has_them_is_not_off(rule, tmp_path):
    robot = drone(tmp_path)
    entries = found(robot, motion(robot, rule, rule))
    assert entries[INTERVAL] < 1e-4
    assert entries[HORIZON] < 1e-4


def test_a_throttle_of_leapfrog_acts_half_an_interval_before_and_after_its_knot(tmp_path):
    """So the thrusts of turbines that follow it an interval at a time are off, and the reverse."""
    robot = drone(tmp_path)
    late = found(robot, motion(robot, rules.LEAPFROG, rules.STAGGERED))
    early = found(robot, motion(robot, rules.STAGGERED, rules.LEAPFROG))
    for entries in (late, early):
        assert entries[HORIZON] > 0.5
        assert entries[HORIZON] > entries[INTERVAL]

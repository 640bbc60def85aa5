"""The terms of jets that fail: bounds of their thrust or throttle."""

from __future__ import annotations

import casadi as cs
import numpy as np

from multimodal_to.adam.spatial import SX
from multimodal_to.ocp.knot import Knot
from multimodal_to.ocp.parameters import Parameters
from multimodal_to.ocp.schedule import Flags
from multimodal_to.ocp.terms import Constraint, Where, each, equal
from multimodal_to.scenarios.failures import failing_knots


def failed(parameters: Parameters, *, at_start: bool) -> Flags:
    """Return at which knots each jet has failed, (jets, N + 1).

    Args:
        parameters: with the robot and the scenario.
        at_start: those that never light, else those that fail later.
    """
    robot, scenario = parameters.robot, parameters.scenario
    flags = np.zeros((len(robot.jets), scenario.knots + 1), dtype=bool)
    for row, knot in failing_knots(scenario.failures, robot.jet_names, scenario.knots).items():
        if (knot == 0) is at_start:
            flags[row, knot:] = True
    return flags


def thrust(knot: Knot, parameters: Parameters) -> SX:
    """T."""
    return knot.thrust


def throttle_above_least(knot: Knot, parameters: Parameters) -> SX:
    """u − u_min."""
    return knot.throttle - cs.DM([jet.throttle_min for jet in parameters.robot.jets])


def running(parameters: Parameters) -> Flags:
    """Return at which knots a jet has not failed after it was lit."""
    return ~failed(parameters, at_start=False)


def _never_lit(parameters: Parameters) -> Flags:
    return failed(parameters, at_start=True)


def _gone_out(parameters: Parameters) -> Flags:
    return failed(parameters, at_start=False)


def _some_fail(parameters: Parameters) -> bool:
    return bool(parameters.scenario.failures)


NEVER_LIT = Constraint(
    name="never_lit",
    value=thrust,
    within=equal(),
    unit="N",
    holds=(Where.FIRST_KNOT, Where.LATER_KNOTS),
    scale=50.0,
    labels=each("jet"),
    when=_some_fail,
    present=_never_lit,
)
GONE_OUT = Constraint(
    name="gone_out",
    value=throttle_above_least,
    within=equal(),
    unit="%",
    holds=(Where.FIRST_KNOT, Where.LATER_KNOTS),
    scale=50.0,
    labels=each("jet"),
    when=_some_fail,
    present=_gone_out,
)
CONSTRAINTS = (NEVER_LIT, GONE_OUT)
"""What jets that fail ask for; without any there are none of their rows."""

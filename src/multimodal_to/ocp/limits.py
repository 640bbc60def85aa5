"""The term of limits over a stretch: each of its rows is a bound of one variable."""

from __future__ import annotations

from collections.abc import Iterator

import casadi as cs
import numpy as np

from multimodal_to.adam.spatial import SX
from multimodal_to.models.joint_units import joint_units
from multimodal_to.ocp.knot import Knot
from multimodal_to.ocp.parameters import Parameters
from multimodal_to.ocp.schedule import Flags
from multimodal_to.ocp.terms import Constraint, Where, at_least
from multimodal_to.scenarios.limits import Limited, limited


def within_limits(knot: Knot, parameters: Parameters) -> SX:
    """v̄ − v, and v̄ + v of what may be negative, for each speed and thrust v with a greatest size v̄ over a stretch."""
    rows = [one.most - sign * getattr(knot, one.quantity)[one.row] for one, sign in _sides(parameters)]
    return cs.vertcat(cs.SX(0, 1), *rows)


def _sides(parameters: Parameters) -> Iterator[tuple[Limited, float]]:
    """Return what is limited, from above and, if it may be negative, from below."""
    scenario = parameters.scenario
    for one in limited(scenario.limits, parameters.robot, scenario.knots):
        yield one, 1.0
        if one.quantity != "thrust":
            yield one, -1.0


def _labels(parameters: Parameters) -> tuple[str, ...]:
    sides = {1.0: "at most", -1.0: "at least"}
    return tuple(f"{one.what}, {sides[sign]} {sign * one.most:g}" for one, sign in _sides(parameters))


def _units(parameters: Parameters) -> tuple[str, ...]:
    """m/s, rad/s, N."""
    joints = joint_units(parameters.robot, "rad/s")
    units = {"base_linear_velocity": "m/s", "base_angular_velocity": "rad/s", "thrust": "N"}
    return tuple(units.get(one.quantity) or joints[one.row] for one, _ in _sides(parameters))


def _present(parameters: Parameters) -> Flags:
    knots = np.arange(parameters.scenario.knots + 1)
    rows = [np.isin(knots, one.knots) for one, _ in _sides(parameters)]
    return np.array(rows, dtype=bool).reshape(-1, knots.size)


def _any(parameters: Parameters) -> bool:
    return bool(parameters.scenario.limits)


LIMITS = Constraint(
    name="limits",
    value=within_limits,
    within=at_least(0.0),
    unit=_units,
    holds=(Where.FIRST_KNOT, Where.LATER_KNOTS),
    labels=_labels,
    when=_any,
    present=_present,
)
"""What narrower limits ask for; without any there are none of its rows."""

"""Thrusts integrated again by an adaptive method, from the file's throttles: how far the integration rule is off."""

from __future__ import annotations

import casadi as cs
import numpy as np

from multimodal_to.adam.spatial import Array
from multimodal_to.auditing.findings import Worst, worst_of
from multimodal_to.models.jet import StaticMap
from multimodal_to.models.robot import Robot
from multimodal_to.trajectory import Trajectory, rules

_TOLERANCE = 1e-8  # of the integrator, relative and absolute


def thrust_findings(robot: Robot, trajectory: Trajectory) -> list[Worst]:
    """Compare the thrusts with those that their engines' laws give for the same throttles, integrated by CVODES.

    The throttle of an interval is that which its end holds. Under leapfrog a throttle acts from half an interval before
    its knot to half an interval after it: there the interval has the throttle of its start in its first half, and that
    of its end in its second half. Once every interval starts from the file's T and Ṫ, and once the horizon runs through
    from the first knot. Where the file has Ṫ in the middles of intervals, that of a knot is Ṫ_k = Ṫ_k−½ + ½ Δt T̈_k.
    """
    count = len(robot.jets)
    if not count:
        return []
    step, steps = _integrator(robot), np.diff(trajectory.time)
    states, throttles = np.vstack([trajectory.thrust, _rates(robot, trajectory)]), trajectory.throttle
    alone, through = np.zeros((count, steps.size)), np.zeros((count, steps.size))
    state, after = states[:, 0], rules.acts_after(trajectory.rule)
    for index, dt in enumerate(steps):
        end = states[:, index]
        for column, share in ((index, after), (index + 1, 1.0 - after)):
            if share:
                parameters = np.append(throttles[:, column], share * dt)
                state, end = _advance(step, state, parameters), _advance(step, end, parameters)
        for row, jet in enumerate(robot.jets):
            if isinstance(jet.model, StaticMap):
                state[row] = end[row] = jet.model.thrust(throttles[row, index + 1])
        alone[:, index] = end[:count] - trajectory.thrust[:, index + 1]
        through[:, index] = state[:count] - trajectory.thrust[:, index + 1]
    names = robot.jet_names
    return [
        worst_of("thrust off CVODES, interval", np.abs(alone), names, first=1),
        worst_of("thrust off CVODES, horizon", np.abs(through), names, first=1),
    ]


def _rates(robot: Robot, trajectory: Trajectory) -> Array:
    """Return Ṫ of each jet at the knots [N/s], (jets, knots + 1)."""
    rates, time = trajectory.thrust_rate, trajectory.time
    accelerations = [
        jet.model.slopes(trajectory.thrust[row], rates[row], trajectory.throttle[row])[1]
        for row, jet in enumerate(robot.jets)
    ]
    return np.asarray(rates + (time - trajectory.times("thrust_rate")) * np.array(accelerations))


def _advance(step: cs.Function, state: Array, parameters: Array) -> Array:
    """Return the state after an interval; infinite where the model runs away, as it may with throttles beyond range.

    Args:
        step: from `_integrator`.
        state: T [N] of all jets, then Ṫ [N/s] of all jets, (2 jets,).
        parameters: the throttles [%], then Δt [s], (jets + 1,).
    """
    if not np.isfinite(state).all():
        return state
    try:
        return np.array(step(x0=state, p=parameters)["xf"]).ravel()
    except RuntimeError:
        return np.full(state.size, np.inf)


def _integrator(robot: Robot) -> cs.Function:
    """Return the integrator of (T, Ṫ) of all jets over an interval; its parameters are the throttles and Δt [s]."""
    count = len(robot.jets)
    thrust, rate, throttle = (cs.SX.sym(name, count) for name in ("thrust", "rate", "throttle"))
    dt = cs.SX.sym("dt")
    slopes = [jet.model.slopes(thrust[i], rate[i], throttle[i]) for i, jet in enumerate(robot.jets)]
    problem = {
        "x": cs.vertcat(thrust, rate),
        "p": cs.vertcat(throttle, dt),
        "ode": dt * cs.vertcat(*(one[0] for one in slopes), *(one[1] for one in slopes)),  # over one unit of time
    }
    return cs.integrator("thrusts", "cvodes", problem, 0.0, 1.0, {"abstol": _TOLERANCE, "reltol": _TOLERANCE})

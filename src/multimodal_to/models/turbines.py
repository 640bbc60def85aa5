"""What turbines can do: the greatest thrust that one holds, and how fast it gets there at full throttle."""

from __future__ import annotations

from collections.abc import Sequence

import casadi as cs
import numpy as np

from multimodal_to.adam.spatial import Array
from multimodal_to.models.jet import Jet, StaticMap

_THRUSTS, _THROTTLES = 801, 101  # how fine thrust and throttle are looked at


def greatest_held(jet: Jet) -> float:
    """Return the greatest thrust up to the jet's limit that some throttle within its range holds [N]; 0 if none.

    It is rounded up by at most a `_THRUSTS`th of the limit.
    """
    thrust = np.linspace(0.0, jet.thrust_max, _THRUSTS)[:, None]
    throttle = np.linspace(jet.throttle_min, jet.throttle_max, _THROTTLES)
    missing = jet.model.imbalance(thrust, throttle)
    held = (missing.min(axis=1) <= 0) & (missing.max(axis=1) >= 0)
    return min(float(thrust[held].max()) + jet.thrust_max / (_THRUSTS - 1), jet.thrust_max) if held.any() else 0.0


def spool_up(jets: Sequence[Jet], times: Array) -> Array:
    """Return the thrust of each jet at `times` > 0 [s], (jets, times) [N]: from idle at full throttle, by CVODES.

    By the law of its engine, cut at the jet's greatest thrust; a model that runs away counts as there.
    """
    return np.array([_spool_up(jet, times) for jet in jets]).reshape(len(jets), times.size)


def _spool_up(jet: Jet, times: Array) -> Array:
    if isinstance(jet.model, StaticMap):
        return np.full(times.size, min(float(jet.model.thrust(jet.throttle_max)), jet.thrust_max))
    thrust, rate = cs.SX.sym("thrust"), cs.SX.sym("rate")
    ode = {"x": cs.vertcat(thrust, rate), "ode": cs.vertcat(*jet.model.slopes(thrust, rate, jet.throttle_max))}
    options = {"abstol": 1e-6, "reltol": 1e-6, "show_eval_warnings": False, "disable_internal_warnings": True}
    integrator = cs.integrator("spool_up", "cvodes", ode, 0.0, times.tolist(), options)
    try:
        reached = np.array(integrator(x0=[0.0, 0.0])["xf"])[0]
    except RuntimeError:
        return np.full(times.size, jet.thrust_max)
    return np.clip(np.maximum.accumulate(reached), 0.0, jet.thrust_max)

"""A jet's throttle that brings its thrust to where it is wanted, through the turbine's own slow dynamics.

T̈ = T̈* + K_T (T* + ΔT − T) + D_T (Ṫ* − Ṫ), solved for the throttle and kept within its range.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from multimodal_to.adam.spatial import Array
from multimodal_to.models.jet import Jet
from multimodal_to.simulation.reference import Reference

THRUST_STIFFNESS, THRUST_DAMPING = 25.0, 10.0  # K_T [1/s²], D_T [1/s]; a turbine of any robot is about as slow


def throttles(jets: tuple[Jet, ...], plan: Reference, step: int, thrust: Array, rate: Array, change: Array) -> Array:
    """Return the throttle of each jet [%], (jets,).

    Args:
        jets: of the robot.
        plan: with the thrusts that are planned.
        step: row of the plan.
        thrust: T as it is [N], (jets,).
        rate: Ṫ as it is [N/s], (jets,).
        change: ΔT that is wanted beside the plan [N], (jets,).
    """
    found = np.zeros(len(jets))
    for index, jet in enumerate(jets):
        planned = float(plan.thrust[step, index]), float(plan.thrust_rate[step, index])
        wish = min(max(planned[0] + float(change[index]), 0.0), jet.thrust_max)
        acceleration = float(jet.model.acceleration(*planned, float(plan.throttle[step, index])))
        acceleration += THRUST_STIFFNESS * (wish - float(thrust[index]))
        acceleration += THRUST_DAMPING * (planned[1] - float(rate[index]))
        found[index] = throttle(jet, float(thrust[index]), float(rate[index]), acceleration)
    return found


def throttle(jet: Jet, thrust: float, rate: float, acceleration: float) -> float:
    """Return the throttle within its range whose T̈ comes nearest to the one wanted: u + B_UU u² = (T̈ − f) / g.

    Args:
        jet: with its model and range.
        thrust: T [N].
        rate: Ṫ [N/s].
        acceleration: T̈ that is wanted [N/s²].
    """
    model: Any = jet.model
    gain = model.B_U + model.B_T * thrust + model.B_D * rate
    wanted = (acceleration - float(model.acceleration(thrust, rate, 0.0))) / gain
    root = 1.0 + 4.0 * model.B_UU * wanted
    found = jet.throttle_max if root < 0.0 else 2.0 * wanted / (1.0 + root**0.5)
    return float(min(max(found, jet.throttle_min), jet.throttle_max))


def around(
    jets: tuple[Jet, ...], plan: Reference, step: int, thrust: Array, rate: Array, change: Array
) -> Array:
    """Return the throttle of each jet [%] that acts on a thrust as the planned one and a change do about the plan.

    Args:
        jets: of the robot.
        plan: with the thrusts that are planned.
        step: row of the plan.
        thrust: T as it is [N], (jets,).
        rate: Ṫ as it is [N/s], (jets,).
        change: of the throttle [%], (jets,).
    """
    found = np.zeros(len(jets))
    for index, jet in enumerate(jets):
        found[index] = min(max(float(plan.throttle[step, index] + change[index]), jet.throttle_min), jet.throttle_max)
    return found

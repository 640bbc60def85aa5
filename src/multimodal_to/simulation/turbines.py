"""Throttles about those of a plan, within the range of each jet."""

from __future__ import annotations

import numpy as np

from multimodal_to.adam.spatial import Array
from multimodal_to.models.jet import Jet
from multimodal_to.simulation.reference import Reference


def around(jets: tuple[Jet, ...], plan: Reference, step: int, change: Array) -> Array:
    """Return the throttle of each jet [%], (jets,): that of the plan and a change, within the jet's range.

    Args:
        jets: of the robot.
        plan: with the throttles that are planned.
        step: row of the plan.
        change: of the throttles [%], (jets,).
    """
    wanted = plan.throttle[step] + change
    return np.array([min(max(float(u), j.throttle_min), j.throttle_max) for j, u in zip(jets, wanted, strict=True)])

"""A trajectory at other times than its knots, or on another grid of knots."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from multimodal_to.adam.spatial import Array
from multimodal_to.arguments import checked, vector
from multimodal_to.errors import InputError, unknown
from multimodal_to.trajectory import rules
from multimodal_to.trajectory.quantities import QUANTITIES
from multimodal_to.trajectory.trajectory import Trajectory


@checked
def resample(trajectory: Trajectory, times: Sequence[float] | Array) -> Trajectory:
    """Return the trajectory at other times [s], on its grid or between: linear, and the shortest turn of the base.

    Between the instants of two columns, at the share a of the time between them, a quantity is (1 − a) y_k + a y_k+1,
    and the base's orientation q_k ∘ Exp(a Log(q_k⁻¹ ∘ q_k+1)). Every quantity of the result is at its own time.

    Raises:
        InputError: a time is not within the trajectory.
    """
    wanted, grid = vector("the times", times, None), trajectory.time
    if wanted.size and not (grid[0] <= wanted.min() and wanted.max() <= grid[-1]):
        raise InputError(f"times from {wanted.min():g} to {wanted.max():g} s; expected {grid[0]:g} to {grid[-1]:g} s")
    arrays: dict[str, Any] = {name: at_times(trajectory, name, wanted) for name in QUANTITIES}
    rule = trajectory.rule if rules.all_at_knots(trajectory.rule) else rules.SAMPLED
    return replace(trajectory, time=wanted, rule=rule, **arrays)


@checked
def regrid(trajectory: Trajectory, knots: int, rule: str) -> Trajectory:
    """Return the trajectory on equal intervals, with every quantity at the instant that a rule wants.

    Args:
        trajectory: of any rule.
        knots: N, the number of intervals.
        rule: name of the integration rule.

    Raises:
        InputError: there is to be no interval.
    """
    if knots < 1:
        raise InputError(f"the number of intervals is {knots}; expected at least one")
    grid = np.linspace(trajectory.time[0], trajectory.time[-1], knots + 1)
    arrays: dict[str, Any] = {name: at_times(trajectory, name, rules.instants(grid, rule, name)) for name in QUANTITIES}
    return replace(trajectory, time=grid, rule=rule, **arrays)


@checked
def at_times(trajectory: Trajectory, name: str, times: Array) -> Array:
    """Return a quantity at times [s]; before its first instant and after its last it is what it is there.

    Args:
        trajectory: of any rule.
        name: of the quantity.
        times: wanted [s].

    Raises:
        InputError: there is no such quantity.
    """
    if name not in QUANTITIES:
        raise InputError(unknown("quantity", name, QUANTITIES))
    values = getattr(trajectory, name)
    own = trajectory.times(name)
    wanted = np.clip(times, own[0], own[-1])
    before = np.clip(np.searchsorted(own, wanted, side="right") - 1, 0, own.size - 2)
    share = (wanted - own[before]) / (own[before + 1] - own[before])
    start, end = values[:, before], values[:, before + 1]
    if name == "base_quaternion_xyzw":
        return _slerp(start, end, share)
    return np.asarray((1.0 - share) * start + share * end)


def _slerp(start: Array, end: Array, share: Array) -> Array:
    """Return unit quaternions (4, n) a share of the shorter way from start to end.

    Args:
        start: quaternions x y z w of any length, (4, n).
        end: the same.
        share: from 0, the start, to 1, the end, (n,).
    """
    start, end = start / np.linalg.norm(start, axis=0), end / np.linalg.norm(end, axis=0)
    end = end * np.where((start * end).sum(axis=0) < 0.0, -1.0, 1.0)
    angle = np.arctan2(np.linalg.norm(end - start, axis=0), np.linalg.norm(end + start, axis=0)) * 2.0
    near = angle < 1e-6
    sine = np.where(near, 1.0, np.sin(angle))
    weights = np.where(near, 1.0 - share, np.sin((1.0 - share) * angle) / sine)
    mixed = weights * start + np.where(near, share, np.sin(share * angle) / sine) * end
    return np.asarray(mixed / np.linalg.norm(mixed, axis=0))

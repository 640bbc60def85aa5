"""A trajectory at other times than its knots."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from multimodal_to.adam.spatial import Array
from multimodal_to.errors import InputError
from multimodal_to.trajectory.quantities import QUANTITIES
from multimodal_to.trajectory.trajectory import Trajectory


def resample(trajectory: Trajectory, times: Array) -> Trajectory:
    """Return the trajectory at other times [s] on its grid or between: linear, and the shortest turn of the base.

    Between knots k and k + 1, at the share a of the interval, q = q_k ∘ Exp(a Log(q_k⁻¹ ∘ q_{k+1})); every other
    quantity is (1 − a) y_k + a y_{k+1}.

    Raises:
        InputError: a time is not within the trajectory.
    """
    wanted, grid = np.asarray(times, dtype=float), trajectory.time
    if wanted.size and not (grid[0] <= wanted.min() and wanted.max() <= grid[-1]):
        raise InputError(f"times from {wanted.min():g} to {wanted.max():g} s; expected {grid[0]:g} to {grid[-1]:g} s")
    before = np.clip(np.searchsorted(grid, wanted, side="right") - 1, 0, grid.size - 2)
    share = (wanted - grid[before]) / (grid[before + 1] - grid[before])
    arrays = {
        name: (1.0 - share) * getattr(trajectory, name)[:, before] + share * getattr(trajectory, name)[:, before + 1]
        for name in QUANTITIES
    }
    start = trajectory.base_quaternion_xyzw[:, before]
    end = trajectory.base_quaternion_xyzw[:, before + 1]
    arrays["base_quaternion_xyzw"] = _slerp(start, end, share)
    return replace(trajectory, time=wanted, **arrays)


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

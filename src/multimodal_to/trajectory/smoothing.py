"""A trajectory at any times without jumps of velocity, for programs that take frames at a rate of their own.

Every rule moves a position over an interval by the interval's one velocity, so a velocity jumps at a knot, and between
knots a line leaves the true way by a Δt² / 8. Here the velocity at a knot is the mean of the two intervals that meet
there, and between two knots a position is the cubic with the positions and the velocities of both. So it goes through
the knots, its velocity has no jump and is its exact rate, and a motion of constant acceleration comes out exactly.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from multimodal_to.adam.spatial import Array
from multimodal_to.arguments import checked
from multimodal_to.errors import InputError
from multimodal_to.trajectory import rules
from multimodal_to.trajectory.derived import acting_times
from multimodal_to.trajectory.quantities import QUANTITIES
from multimodal_to.trajectory.resampling import at_times
from multimodal_to.trajectory.trajectory import Trajectory
from multimodal_to.values import FrozenMapping

RATES: Mapping[str, str] = FrozenMapping(
    {
        "com_position": "com_velocity",
        "base_position": "base_linear_velocity",
        "joint_positions": "joint_velocities",
        "thrust": "thrust_rate",
    }
)
"""What moves by what; the base's orientation moves by its angular velocity as well, about the world's axes."""
_SMALL = 1e-4
"""Below this angle the series of sin(x)/x and its kin are exact to 1e-16 [rad]."""


@checked
def smooth(trajectory: Trajectory, times: Array) -> Trajectory:
    """Return the trajectory at other times [s], with every quantity at its own time and no jump of velocity.

    With the share σ of the interval Δt, a position is the cubic of Hermite through both knots, and the base's
    orientation is Exp(φ(σ)) ∘ ρ_k with φ the cubic from zero to Log(ρ_k+1 ∘ ρ_k⁻¹); ω = J_l(φ) φ̇. Contact forces and
    throttles act as the rule says, held under leapfrog; what else there is goes along lines.

    Args:
        trajectory: of any rule.
        times: wanted [s], (frames,).

    Raises:
        InputError: a time is not within the trajectory.
    """
    wanted, grid = np.asarray(times, dtype=float), trajectory.time
    if wanted.size and not (grid[0] <= wanted.min() and wanted.max() <= grid[-1]):
        raise InputError(f"times from {wanted.min():g} to {wanted.max():g} s; expected {grid[0]:g} to {grid[-1]:g} s")
    before = np.clip(np.searchsorted(grid, wanted, side="right") - 1, 0, grid.size - 2)
    step = grid[before + 1] - grid[before]
    share = (wanted - grid[before]) / step
    arrays: dict[str, Any] = {name: at_times(trajectory, name, wanted) for name in QUANTITIES}
    for name, rate in RATES.items():
        values, rates = getattr(trajectory, name), _at_knots(trajectory, rate)
        ends = values[:, before], rates[:, before] * step, values[:, before + 1], rates[:, before + 1] * step
        arrays[name], arrays[rate] = _cubic(*ends, share)
        arrays[rate] /= step
    arrays |= _turned(trajectory, before, step, share)
    if rules.acts_after(trajectory.rule):
        acting = np.minimum(np.searchsorted(acting_times(trajectory)[1], wanted - 1e-9), trajectory.knots)
        arrays |= {name: getattr(trajectory, name)[:, acting] for name in rules.HELD}
    return replace(trajectory, time=wanted, rule=rules.SAMPLED, **arrays)


@checked
def frame_times(trajectory: Trajectory, fps: float) -> Array:
    """Return the times of frames at a rate [1/s] from the first knot on, (frames,); a rest at the end is none.

    Raises:
        InputError: the rate is not positive, or gives fewer than two frames.
    """
    if not (np.isfinite(fps) and fps > 0.0):
        raise InputError(f"the rate is {fps:g} frames a second; expected a positive number")
    count = int(np.floor(trajectory.duration * fps + 1e-6)) + 1
    if count < 2:
        raise InputError(
            f"at {fps:g} frames a second, {trajectory.duration:g} s hold {count} frame; expected two or more"
        )
    return np.asarray(np.minimum(trajectory.time[0] + np.arange(count) / fps, trajectory.time[-1]))


def _at_knots(trajectory: Trajectory, name: str) -> Array:
    """Return a velocity at the knots, (rows, knots + 1): the mean of the intervals that meet there."""
    values: Array = getattr(trajectory, name)
    if trajectory.rule not in rules.INSTANTS or trajectory.rule == rules.SAMPLED:
        return values
    if rules.all_at_knots(trajectory.rule):  # no interval ends at the first knot
        values = np.hstack([values[:, 1:2], values[:, 1:]])
    return np.asarray(0.5 * (values + np.hstack([values[:, 1:], values[:, -1:]])))


def _cubic(start: Array, leaving: Array, end: Array, arriving: Array, share: Array) -> tuple[Array, Array]:
    """Return the cubic with given ends and its rate, (rows, frames) each; rates are those of a whole interval.

    Args:
        start: where it begins.
        leaving: its rate there.
        end: where it ends.
        arriving: its rate there.
        share: of the interval, from 0 to 1.
    """
    way, back = end - start, 1.0 - share
    value = start + share**2 * (3.0 - 2.0 * share) * way + share * back * (back * leaving - share * arriving)
    rate = 6.0 * share * back * way + back * (1.0 - 3.0 * share) * leaving + share * (3.0 * share - 2.0) * arriving
    return value, rate


def _turned(trajectory: Trajectory, before: NDArray[np.intp], step: Array, share: Array) -> dict[str, Array]:
    """Return the base's orientation and angular velocity.

    Args:
        trajectory: of any rule.
        before: the knot before each frame, (frames,).
        step: the interval after it [s], (frames,).
        share: of that interval, (frames,).
    """
    quaternions = trajectory.base_quaternion_xyzw / np.linalg.norm(trajectory.base_quaternion_xyzw, axis=0)
    start, end = quaternions[:, before], quaternions[:, before + 1]
    omega = _at_knots(trajectory, "base_angular_velocity")
    turn = rotation_vectors(product(end, start * [[-1.0], [-1.0], [-1.0], [1.0]]))
    arriving = _jacobian(turn, omega[:, before + 1] * step, inverse=True)
    angle, rate = _cubic(np.zeros_like(turn), omega[:, before] * step, turn, arriving, share)
    return {
        "base_quaternion_xyzw": product(_exponential(angle), start),
        "base_angular_velocity": _jacobian(angle, rate) / step,
    }


@checked
def product(left: Array, right: Array) -> Array:
    """Return left ∘ right of quaternions x y z w in columns, (4, count)."""
    v, w, u, s = left[:3], left[3], right[:3], right[3]
    return np.vstack([w * u + s * v + np.cross(v, u, axis=0), w * s - (v * u).sum(axis=0)])


@checked
def rotation_vectors(quaternions: Array) -> Array:
    """Return Log(ρ) of unit quaternions x y z w in columns [rad], (3, count), of at most half a turn."""
    vectors = quaternions[:3] * np.where(quaternions[3] < 0.0, -1.0, 1.0)
    norms = np.linalg.norm(vectors, axis=0)
    angles = 2.0 * np.arctan2(norms, np.abs(quaternions[3]))
    return np.asarray(vectors * np.where(norms < _SMALL, 2.0 + norms**2 / 3.0, angles / np.maximum(norms, _SMALL)))


def _exponential(vectors: Array) -> Array:
    half = np.linalg.norm(vectors, axis=0) / 2.0
    return np.vstack([0.5 * np.sinc(half / np.pi) * vectors, np.cos(half)])


def _jacobian(angle: Array, vectors: Array, *, inverse: bool = False) -> Array:
    """Return J_l(φ) v, or J_l(φ)⁻¹ v, (3, count): from the rate of a rotation vector to ω in world axes, or back.

    Args:
        angle: φ [rad], (3, count).
        vectors: v, (3, count).
        inverse: the way back.
    """
    size = np.linalg.norm(angle, axis=0)
    small, safe = size < _SMALL, np.maximum(size, _SMALL)
    once = np.cross(angle, vectors, axis=0)
    twice = np.cross(angle, once, axis=0)
    if inverse:
        cotangent = np.where(small, 1.0 / 12.0, (1.0 - safe / 2.0 / np.tan(safe / 2.0)) / safe**2)
        return np.asarray(vectors - 0.5 * once + cotangent * twice)
    first = np.where(small, 0.5, (1.0 - np.cos(safe)) / safe**2)
    second = np.where(small, 1.0 / 6.0, (safe - np.sin(safe)) / safe**3)
    return np.asarray(vectors + first * once + second * twice)

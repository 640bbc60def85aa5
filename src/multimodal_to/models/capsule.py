"""Capsules around links and plumes, and the distance of two of them: smooth for a solver, exact for a judge.

A capsule is all that lies within a radius of a segment. Two capsules are |P − Q| − r₁ − r₂ apart, where P and Q are the
nearest points of their segments. The distance is negative where they overlap.

The exact distance has edges: where the nearest point leaves an end, and where segments are parallel. The smooth one
finds P and Q by the same three steps, with the range of each parameter rounded off at its ends and a small pull to the
middles of the segments. It has all derivatives everywhere.
"""

from __future__ import annotations

from dataclasses import dataclass

import casadi as cs
import numpy as np

from multimodal_to.adam.kinematics import Pose
from multimodal_to.adam.spatial import SX, Array
from multimodal_to.arguments import check_fields, vector
from multimodal_to.errors import ModelError
from multimodal_to.values import Value

PULL = 0.02
"""How strongly nearest points are pulled to the middles of their segments, as a share of their squared lengths [1]."""
ROUNDING = 0.05
"""Width over which a nearest point comes to rest at an end, as a share of the segment's length [1]."""
CROSSING = 0.05
"""Distance below which that of crossing segments is rounded off, as a share of r₁ + r₂ [1]."""
OVER = 0.003
"""By how much the square of a smooth distance of two segments exceeds the exact one at most, as a share of the sum of
their squared lengths [1]; so measured over random, parallel, crossing and touching pairs."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Capsule(Value):
    """All points within `radius` of a segment that is fixed in a frame of the robot.

    Raises:
        ModelError: an end is not three finite numbers, or the radius is not positive.
    """

    name: str
    frame: str  # of a link
    start: Array  # one end of the segment, in the frame [m], (3,)
    end: Array  # its other end; the same one for a sphere [m], (3,)
    radius: float  # [m]
    plume: bool = False  # the exhaust of a jet, no solid part

    def __post_init__(self) -> None:
        for key in ("start", "end"):
            point = vector(f"capsule '{self.name}': {key}", getattr(self, key), 3, ModelError)
            object.__setattr__(self, key, point)
        check_fields(self, ModelError, f"capsule '{self.name}': ")
        super().__post_init__()
        if not 0 < self.radius < np.inf:
            raise ModelError(f"capsule '{self.name}': radius is {self.radius}; expected a positive number")

    @property
    def length(self) -> float:
        """Return the length of the segment [m]."""
        return float(np.linalg.norm(self.end - self.start))


CapsulePair = tuple[Capsule, Capsule]


def plume(name: str, frame: str, length: float, radius: float) -> Capsule:
    """Return the capsule of an exhaust that leaves along +z of a frame, from its origin to `length` [m] away.

    Args:
        name: of the capsule.
        frame: of the jet.
        length: of the whole capsule, its round ends included [m]; at least a sphere is left.
        radius: of the capsule [m].
    """
    first, last = min(radius, 0.5 * length), max(length - radius, 0.5 * length)
    start, end = np.array([0.0, 0.0, first]), np.array([0.0, 0.0, last])
    return Capsule(name=name, frame=frame, start=start, end=end, radius=radius, plume=True)


def pair_name(pair: CapsulePair) -> str:
    """Return what a pair is called, as `left foot – right foot`."""
    return f"{pair[0].name} – {pair[1].name}"


# -------------------------------------------------------------------- for a solver


@dataclass(frozen=True)
class Segment:
    """A segment by its middle [m] and its axis, from one end to the other [m], (3, 1) each."""

    middle: SX
    axis: SX


def segment(capsule: Capsule, pose: Pose) -> Segment:
    """Return the segment of a capsule in the axes in which the pose of its frame is given."""
    middle, axis = 0.5 * (capsule.start + capsule.end), capsule.end - capsule.start
    return Segment(pose.rotation @ cs.DM(middle) + pose.translation, pose.rotation @ cs.DM(axis))


def smooth_distance(one: Capsule, one_at: Segment, other: Capsule, other_at: Segment) -> SX:
    """Return the distance of two capsules [m], (1, 1): twice differentiable everywhere, negative where they overlap.

    With middles m, axes a = end − start and P = m₁ + σ a₁, Q = m₂ + τ a₂, |σ|, |τ| ≤ ½, the nearest points make
    |P − Q|² + ε (σ² |a₁|² + τ² |a₂|²) least, ε = `PULL`. Three steps find them: σ of the two lines, τ for that σ, σ for
    that τ. After each step the parameter is brought into its range, rounded off over `ROUNDING`.

    The distance D of P and Q is never below that of the segments. Its square is at most `OVER` (|a₁|² + |a₂|²) above:
    for segments of 0.15 m and radii of 5 cm that touch, 0.7 mm. The result is √(D² + c²) − r₁ − r₂ with
    c = `CROSSING` (r₁ + r₂); where capsules touch, that is an eighth of a percent of r₁ + r₂ more than D − r₁ − r₂.

    Args:
        one: a capsule.
        one_at: where its segment is, in any axes.
        other: another capsule.
        other_at: where its segment is, in the same axes.
    """
    squared = _squared_distance(
        one_at.middle - other_at.middle, one_at.axis, one.length**2, other_at.axis, other.length**2
    )
    radii = one.radius + other.radius
    return cs.sqrt(squared + (CROSSING * radii) ** 2) - radii


def _squared_distance(between: SX, one: SX, one_squared: float, other: SX, other_squared: float) -> SX:
    """Return |P − Q|² of the smoothly nearest points of two segments [m²].

    All of it follows from six products of the vectors, of which two are constant.

    Args:
        between: m₁ − m₂ [m], (3, 1).
        one: a₁ [m], (3, 1).
        one_squared: |a₁|² [m²]; zero for a sphere.
        other: a₂ [m], (3, 1).
        other_squared: |a₂|² [m²]; zero for a sphere.
    """
    squared = cs.sumsqr(between)
    along_one = cs.dot(one, between) if one_squared else 0.0
    along_other = cs.dot(other, between) if other_squared else 0.0
    if not (one_squared and other_squared):  # the nearest point of at most one segment is left to find
        length, along = (one_squared, -along_one) if one_squared else (other_squared, along_other)
        if not length:
            return squared
        place = _in_range(along / (length * (1 + PULL)))
        return squared + place * (length * place - 2 * along)
    both = cs.dot(one, other)
    stiff_one, stiff_other = one_squared * (1 + PULL), other_squared * (1 + PULL)
    sigma = _in_range((both * along_other - stiff_other * along_one) / (stiff_one * stiff_other - both**2))
    tau = _in_range((both * sigma + along_other) / stiff_other)
    sigma = _in_range((both * tau - along_one) / stiff_one)
    return (
        squared
        + sigma * (one_squared * sigma + 2 * (along_one - both * tau))
        + tau * (other_squared * tau - 2 * along_other)
    )


def _in_range(parameter: SX) -> SX:
    """Return a parameter brought into −½ to ½, with round corners: ½ (√((x + ½)² + w²) − √((x − ½)² + w²))."""
    above, below = (cs.sqrt((parameter + half) ** 2 + ROUNDING**2) for half in (0.5, -0.5))
    return 0.5 * (above - below)


# -------------------------------------------------------------------- for a judge


def segment_distances(starts: Array, ends: Array, other_starts: Array, other_ends: Array) -> Array:
    """Return the exact distances of pairs of segments [m], (...,).

    The nearest points are inside both segments, where the lines' nearest points are, or one of them is an end.

    Args:
        starts: of the first segments [m], (..., 3).
        ends: their other ends, (..., 3).
        other_starts: of the second segments, (..., 3).
        other_ends: their other ends, (..., 3).
    """
    found = np.minimum.reduce(
        [
            _point_distances(starts, other_starts, other_ends),
            _point_distances(ends, other_starts, other_ends),
            _point_distances(other_starts, starts, ends),
            _point_distances(other_ends, starts, ends),
        ]
    )
    one, other, between = ends - starts, other_ends - other_starts, starts - other_starts
    a, e, b = _dot(one, one), _dot(other, other), _dot(one, other)
    c, f = _dot(one, between), _dot(other, between)
    determinant = a * e - b * b
    crossed = determinant > 1e-12 * a * e
    safe = np.where(crossed, determinant, 1.0)
    s, t = (b * f - c * e) / safe, (a * f - b * c) / safe
    inside = crossed & (s > 0) & (s < 1) & (t > 0) & (t < 1)
    gaps = between + s[..., None] * one - t[..., None] * other
    return np.asarray(np.where(inside, np.minimum(found, np.linalg.norm(gaps, axis=-1)), found))


def _point_distances(points: Array, starts: Array, ends: Array) -> Array:
    """Return the distances of points from segments [m], (...,).

    Args:
        points: (..., 3) [m].
        starts: of the segments, (..., 3) [m].
        ends: their other ends, (..., 3) [m].
    """
    axes, arms = ends - starts, points - starts
    squared = _dot(axes, axes)
    places = np.clip(_dot(axes, arms) / np.where(squared > 0, squared, 1.0), 0.0, 1.0)
    return np.asarray(np.linalg.norm(arms - places[..., None] * axes, axis=-1))


def _dot(first: Array, second: Array) -> Array:
    return np.asarray((first * second).sum(axis=-1))


def exact_distances(one: Capsule, one_poses: Array, other: Capsule, other_poses: Array) -> Array:
    """Return the exact distances of two capsules in many postures [m], (count,); negative where they overlap.

    Args:
        one: a capsule.
        one_poses: of its frame, in any axes, (count, 4, 4).
        other: another capsule.
        other_poses: of its frame, in the same axes, (count, 4, 4).
    """
    segments = [
        poses[:, :3, :3] @ point + poses[:, :3, 3]
        for capsule, poses in ((one, one_poses), (other, other_poses))
        for point in (capsule.start, capsule.end)
    ]
    return segment_distances(*segments) - one.radius - other.radius

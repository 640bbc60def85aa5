"""Surfaces that the robot stands on: distance d, normal n and tangents t of a point p.

All are graphs z = h(x, y) over the horizontal plane, smooth in the sense that each class states.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Protocol

import casadi as cs
import numpy as np

from multimodal_to.adam.spatial import SX, Array
from multimodal_to.arguments import check_fields, checked
from multimodal_to.errors import InputError
from multimodal_to.models import bspline
from multimodal_to.values import FrozenMapping

Vector2 = tuple[float, float]


class Surface(Protocol):
    """What a contact needs to know of the ground; points are (3, 1) in the world [m]."""

    def distance(self, point: SX) -> SX:
        """Return d(p) [m]: positive above the surface, zero on it."""
        ...

    def normal(self, point: SX) -> SX:
        """Return the unit normal n(p), (3, 1), out of the ground."""
        ...

    def tangents(self, point: SX) -> SX:
        """Return two unit tangents t(p) as columns, (3, 2), orthogonal to n(p) and to each other."""
        ...


@dataclass(frozen=True, kw_only=True)
class FlatGround:
    """The plane z = `height`."""

    height: float = 0.0
    """z of the ground [m]."""

    def __post_init__(self) -> None:
        check_fields(self)
        _finite("height", self.height)

    def distance(self, point: SX) -> SX:
        """Return the height of a point above the plane [m]."""
        return point[2] - self.height

    def normal(self, point: SX) -> SX:
        """Return the vertical, (3, 1)."""
        return cs.DM([0.0, 0.0, 1.0])

    def tangents(self, point: SX) -> SX:
        """Return the world's x and y as columns, (3, 2)."""
        return cs.DM.eye(3)[:, :2]


class Relief(ABC):
    """A surface z = h(x, y) that says its height and slopes; distance, normal and tangents follow.

    d(p) = (z − h) n_z is the signed distance to first order: exact for a plane, and with ∇d = n on the surface itself.
    """

    @abstractmethod
    def height_and_slopes(self, x: SX, y: SX) -> tuple[SX, SX, SX]:
        """Return h [m], ∂h/∂x and ∂h/∂y [1] at x and y [m]."""

    def frame(self, point: SX) -> tuple[SX, SX, SX]:
        """Return d, n and t from one evaluation of the heights."""
        height, along_x, along_y = self.height_and_slopes(point[0], point[1])
        steepness = cs.sqrt(1 + along_x**2 + along_y**2)  # 1 / n_z
        normal = cs.vertcat(-along_x, -along_y, 1) / steepness
        first = cs.vertcat(1, 0, along_x) / cs.sqrt(1 + along_x**2)
        return (point[2] - height) / steepness, normal, cs.horzcat(first, cs.cross(normal, first))

    def distance(self, point: SX) -> SX:
        """Return (z − h) n_z [m]."""
        return self.frame(point)[0]

    def normal(self, point: SX) -> SX:
        """Return (−∂h/∂x, −∂h/∂y, 1) / ‖·‖, (3, 1)."""
        return self.frame(point)[1]

    def tangents(self, point: SX) -> SX:
        """Return the way along the world's x, (1, 0, ∂h/∂x) / ‖·‖, and n × that, as columns, (3, 2)."""
        return self.frame(point)[2]


class CachedSurface:
    """A surface that makes the expressions of each point once, however many rows ask for them."""

    def __init__(self, surface: Surface) -> None:
        self._surface = surface
        self._known: dict[int, tuple[SX, tuple[SX, SX, SX]]] = {}  # with the point, so that its id stays its own

    def __eq__(self, other: object) -> bool:
        return isinstance(other, CachedSurface) and self._surface == other._surface

    def __hash__(self) -> int:
        return hash((CachedSurface, self._surface))

    def __reduce__(self) -> tuple[type[CachedSurface], tuple[Surface]]:
        return CachedSurface, (self._surface,)

    def _frame(self, point: SX) -> tuple[SX, SX, SX]:
        if id(point) not in self._known:
            self._known[id(point)] = point, frame(self._surface, point)
        return self._known[id(point)][1]

    def distance(self, point: SX) -> SX:
        """Return d(p) [m]."""
        return self._frame(point)[0]

    def normal(self, point: SX) -> SX:
        """Return n(p), (3, 1)."""
        return self._frame(point)[1]

    def tangents(self, point: SX) -> SX:
        """Return t(p), (3, 2)."""
        return self._frame(point)[2]


@dataclass(frozen=True, kw_only=True)
class Plane(Relief):
    """The plane through (0, 0, `height`) that rises by `slope` metres per horizontal metre along `direction`.

    Raises:
        InputError: a number is not finite, or the direction has no length.
    """

    slope: float
    """Tangent of the inclination [1]."""
    direction: Vector2 = (1.0, 0.0)
    """Where it rises to: horizontal x and y, of any length [1]."""
    height: float = 0.0
    """z of the plane at the world's origin [m]."""

    def __post_init__(self) -> None:
        check_fields(self)
        _finite("slope", self.slope)
        _finite("height", self.height)
        _unit(self.direction)
        _as_tuples(self, "direction")

    def height_and_slopes(self, x: SX, y: SX) -> tuple[SX, SX, SX]:
        """Return h [m] and the constant slopes [1]."""
        along_x, along_y = (self.slope * part for part in _unit(self.direction))
        return self.height + along_x * x + along_y * y, along_x, along_y


@dataclass(frozen=True, kw_only=True)
class Stairs(Relief):
    """Treads at `heights`, each reached from the one before at one of `edges` along `direction`.

    A riser is a ramp of `width`, centred on its edge: rise × σ(u) with σ = 35 u⁴ − 84 u⁵ + 70 u⁶ − 20 u⁷ for u from 0
    to 1, three times continuously differentiable and exactly flat beyond. A single edge makes a step, down or up.

    Raises:
        InputError: edges and heights don't fit, the edges don't increase, or ramps would overlap.
    """

    edges: tuple[float, ...]
    """Where the risers are: distances from the world's origin along the direction [m]."""
    heights: tuple[float, ...]
    """z of the treads, one more than edges [m]."""
    direction: Vector2 = (1.0, 0.0)
    """Which way the stairs go: horizontal x and y, of any length [1]."""
    width: float = 0.02
    """Width of the ramp that smooths a riser [m]."""

    def __post_init__(self) -> None:
        check_fields(self)
        _unit(self.direction)
        _as_tuples(self, "direction", "edges", "heights")
        _finite("edges", *self.edges)
        _finite("heights", *self.heights)
        if not self.edges or len(self.heights) != len(self.edges) + 1:
            raise InputError(
                f"stairs have {len(self.edges)} edges and {len(self.heights)} heights; expected at least "
                "one edge, and one height more than edges"
            )
        if not 0 < self.width < math.inf:
            raise InputError(f"the width of the stairs' ramps is {self.width} m; expected a positive number")
        if min(np.diff(self.edges), default=math.inf) < self.width:
            raise InputError(
                f"the edges of the stairs are {self.edges} m; expected each at least a ramp's width, "
                f"{self.width} m, beyond the one before"
            )

    def height_and_slopes(self, x: SX, y: SX) -> tuple[SX, SX, SX]:
        """Return h [m] and the slopes [1]; about 20 operations for each edge."""
        unit_x, unit_y = _unit(self.direction)
        along = unit_x * x + unit_y * y
        height, slope = self.heights[0], 0.0
        for edge, rise in zip(self.edges, np.diff(self.heights).tolist(), strict=True):
            u = cs.fmin(cs.fmax((along - edge) / self.width + 0.5, 0), 1)
            height += rise * u**4 * (35 - u * (84 - u * (70 - 20 * u)))
            slope += rise / self.width * 140 * (u * (1 - u)) ** 3
        return height, unit_x * slope, unit_y * slope


@dataclass(frozen=True, kw_only=True)
class HeightField(Relief):
    """Heights on a regular grid, with a twice continuously differentiable cubic spline between (`models.bspline`).

    Beyond the grid the surface goes on with the slope that it has at the edge. A grid of n by m nodes costs about
    10 n m operations per contact point, so take the nodes no closer than the terrain needs.

    Raises:
        InputError: the heights are no grid of at least 4 by 4 and at most `MOST_NODES` finite numbers, or a range does
            not rise.
    """

    x_range: Vector2
    """x of the first and of the last row of nodes [m]."""
    y_range: Vector2
    """y of the first and of the last column of nodes [m]."""
    heights: tuple[tuple[float, ...], ...] = field(repr=False)
    """z of the nodes, one list for each x and one number in it for each y [m]."""

    def __post_init__(self) -> None:
        check_fields(self)
        for label, ends in (("x_range", self.x_range), ("y_range", self.y_range)):
            if len(ends) != 2:
                raise InputError(f"{label} of the height field has {len(ends)} numbers; expected two")
            low, high = ends
            if not -math.inf < low < high < math.inf:
                raise InputError(f"{label} of the height field is {low} to {high} m; expected finite numbers that rise")
        lengths = {len(row) for row in self.heights}
        if len(lengths) != 1 or min(len(self.heights), *lengths) < bspline.LEAST_NODES:
            least = bspline.LEAST_NODES
            raise InputError(
                f"the height field has {len(self.heights)} rows of {sorted(lengths)} heights; expected "
                f"rows of one length, and at least {least} by {least}"
            )
        if (nodes := len(self.heights) * len(self.heights[0])) > MOST_NODES:
            raise InputError(f"the height field has {nodes} nodes; expected at most {MOST_NODES}")
        _finite("heights", *(number for row in self.heights for number in row))
        object.__setattr__(self, "heights", tuple(tuple(map(float, row)) for row in self.heights))
        _as_tuples(self, "x_range", "y_range")

    @classmethod
    @checked
    def sampled(
        cls, height: Callable[[float, float], float], *, x_range: Vector2, y_range: Vector2, spacing: float
    ) -> HeightField:
        """Return the field of a function h(x, y) [m], sampled with nodes at most `spacing` [m] apart.

        Args:
            height: h, of x and y [m].
            x_range: least and greatest x of the nodes [m].
            y_range: least and greatest y of the nodes [m].
            spacing: greatest distance of neighbours [m].
        """
        if not spacing > 0:
            raise InputError(f"spacing is {spacing} m; expected a positive number")
        x, y = (
            np.linspace(low, high, max(bspline.LEAST_NODES, math.ceil((high - low) / spacing - 1e-9) + 1)).tolist()
            for low, high in (x_range, y_range)
        )
        heights = tuple(tuple(height(at_x, at_y) for at_y in y) for at_x in x)
        return cls(x_range=x_range, y_range=y_range, heights=heights)

    @cached_property
    def _coefficients(self) -> Array:
        return bspline.coefficients(np.array(self.heights))

    def height_and_slopes(self, x: SX, y: SX) -> tuple[SX, SX, SX]:
        """Return h [m] and its slopes [1]."""
        per_x = (len(self.heights) - 1) / (self.x_range[1] - self.x_range[0])
        per_y = (len(self.heights[0]) - 1) / (self.y_range[1] - self.y_range[0])
        u, v = (x - self.x_range[0]) * per_x, (y - self.y_range[0]) * per_y
        height, along_u, along_v = bspline.evaluate(self._coefficients, u, v)
        return height, along_u * per_x, along_v * per_y


MOST_NODES = 40_000
"""The most nodes of a height field: with more, expressions take minutes to build."""

SURFACES: Mapping[str, type[FlatGround | Plane | Stairs | HeightField]] = FrozenMapping(
    {"flat": FlatGround, "plane": Plane, "stairs": Stairs, "height-field": HeightField}
)
"""The surfaces that a scenario's file can name, by their kind."""


def frame(surface: Surface, point: SX) -> tuple[SX, SX, SX]:
    """Return d, n and t of a surface at a point."""
    if isinstance(surface, Relief):
        return surface.frame(point)
    return surface.distance(point), surface.normal(point), surface.tangents(point)


def frame_function(surface: Surface) -> cs.Function:
    """Return p → d, n, t of a surface as a function for numbers."""
    point = cs.SX.sym("p", 3)
    parts = [cs.densify(cs.SX(part)) for part in frame(surface, point)]
    return cs.Function("surface", [point], parts, ["p"], ["d", "n", "t"])


def uphill(surface: Surface) -> Vector2 | None:
    """Return the horizontal unit direction that alone changes the ground's height, upwards; None where there is none.

    Across it the ground is the same everywhere.
    """
    if isinstance(surface, Plane):
        unit_x, unit_y = _unit(surface.direction)
        return (unit_x, unit_y) if surface.slope >= 0.0 else (-unit_x, -unit_y)
    if isinstance(surface, Stairs):
        unit_x, unit_y = _unit(surface.direction)
        return (unit_x, unit_y) if surface.heights[-1] >= surface.heights[0] else (-unit_x, -unit_y)
    return None


def heights_below(surface: Surface, points: Array) -> Array:
    """Return the surface's z [m] below or above points (3, count): where d = 0, along the vertical.

    One step of Newton's method from each point, which is exact for a surface whose d is linear in z, as all here are.
    """
    if not points.shape[1]:  # which CasADi does not map over
        return np.zeros(0)
    point = cs.SX.sym("p", 3)
    distance = cs.SX(surface.distance(point))
    step = cs.Function("step", [point], [distance / cs.jacobian(distance, point)[2]])
    return np.asarray(points[2] - np.array(step.map(points.shape[1])(points)).ravel())


def _as_tuples(surface: Plane | Stairs | HeightField, *names: str) -> None:
    """Keep sequences of numbers as tuples of floats, which hash and equal whatever they were given as."""
    for name in names:
        object.__setattr__(surface, name, tuple(map(float, getattr(surface, name))))


def _finite(label: str, *numbers: float) -> None:
    for number in numbers:
        if not math.isfinite(number):
            raise InputError(f"{label} of the surface has {number}; expected finite numbers")


def _unit(direction: Sequence[float]) -> tuple[float, float]:
    """Return a horizontal direction with length 1."""
    length = math.hypot(*direction)
    if len(direction) != 2 or not 0 < length < math.inf:
        raise InputError(f"the direction of the surface is {tuple(direction)}; expected two numbers, not both zero")
    return direction[0] / length, direction[1] / length

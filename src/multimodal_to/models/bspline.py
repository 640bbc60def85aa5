"""Cubic splines over a regular grid, in operations that SX expressions have: no search, no branch, no table.

The function is S(u, v) = Σ c_ij B(u − i) B(v − j) with the uniform cubic B-spline B, in units of the grid: node (i, j)
is at u = i, v = j. It is twice continuously differentiable. Source: C. de Boor, "A practical guide to splines", 1978.
"""

from __future__ import annotations

import casadi as cs
import numpy as np

from multimodal_to.adam.spatial import SX, Array

LEAST_NODES = 4
"""Along each axis, for the not-a-knot conditions at both ends."""


def coefficients(values: Array) -> Array:
    """Return c, (n + 2, m + 2), of the spline through values (n, m); it reproduces cubic polynomials (not-a-knot)."""
    return _along_first_axis(_along_first_axis(values).T).T


def _along_first_axis(values: Array) -> Array:
    """Solve (c_i + 4 c_i+1 + c_i+2) / 6 = value_i, without a jump of the third derivative next to each end."""
    count = values.shape[0]
    matrix = np.zeros((count + 2, count + 2))
    for row in range(count):
        matrix[row, row : row + 3] = 1 / 6, 4 / 6, 1 / 6
    matrix[-2, :5] = matrix[-1, -5:] = 1, -4, 6, -4, 1
    return np.asarray(np.linalg.solve(matrix, np.vstack([values, np.zeros((2, values.shape[1]))])))


def evaluate(c: Array, u: SX, v: SX) -> tuple[SX, SX, SX]:
    """Return S, ∂S/∂u and ∂S/∂v at one point; beyond the grid S goes on with the slope that it has at the edge.

    The sixteen coefficients around a point are picked by sums with 0 and 1, whose derivatives vanish: about 10 n m
    operations for a grid of n by m nodes, and none of them again in any derivative.

    Args:
        c: coefficients of the spline, (n + 2, m + 2), as `coefficients` returns them.
        u: where, along the first axis, in units of the grid.
        v: where, along the second axis, in units of the grid.
    """
    here, along_u, slope_u = _weights(u, c.shape[0] - 2)
    there, along_v, slope_v = _weights(v, c.shape[1] - 2)
    width, height = here.shape[0], there.shape[0]
    rows = [here.T @ cs.DM(c[a : a + width]) for a in range(4)]
    patch = cs.vertcat(*(cs.horzcat(*(row[b : b + height] @ there for b in range(4))) for row in rows))
    across = patch @ along_v
    return along_u.T @ across, slope_u.T @ across, along_u.T @ (patch @ slope_v)


def _weights(u: SX, count: int) -> tuple[SX, SX, SX]:
    """Return which of count − 1 cells holds u, as 0 and 1, and the values and slopes of the four B-splines there."""
    inside = cs.fmin(cs.fmax(u, 0), count - 1)
    cell = cs.fmin(cs.floor(inside), count - 2)
    t, r = inside - cell, 1 - inside + cell
    values = cs.vertcat(r**3, 4 - 3 * t**2 * (1 + r), 4 - 3 * r**2 * (1 + t), t**3) / 6
    slopes = cs.vertcat(-(r**2), t * (3 * t - 4), r * (4 - 3 * r), t**2) / 2
    return cs.vertcat(*(cell == index for index in range(count - 1))), values + (u - inside) * slopes, slopes

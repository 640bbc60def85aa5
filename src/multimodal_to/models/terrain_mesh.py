"""A patch of a surface as triangles and lines, for pictures of it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from multimodal_to.adam.spatial import Array
from multimodal_to.models.terrain import Surface, heights_below
from multimodal_to.values import Value

CELL = 0.05
"""Side of the cells that the patch is made of [m]."""
LINE_EVERY = 5
"""A line is drawn along every fifth row of nodes, 0.25 m apart."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Patch(Value):
    """Nodes of a square grid on a surface, triangles between them, and lines along it."""

    vertices: Array  # (n, 3) [m], world
    faces: NDArray[np.int64]  # (m, 3), into the vertices, seen from above counter-clockwise
    lines: Array  # (3, 2 k) [m], end points in pairs


def patch(surface: Surface, middle: Array, half: float) -> Patch:
    """Return the patch of a surface around `middle` (2,) that reaches `half` metres to each side, at whole cells.

    Args:
        surface: the ground.
        middle: x and y of the middle in the world [m], (2,).
        half: how far it reaches to each side at least [m].
    """
    cells = int(np.ceil(half / (CELL * LINE_EVERY))) * LINE_EVERY
    steps = CELL * np.arange(-cells, cells + 1)
    corner = np.round(middle / (CELL * LINE_EVERY)) * CELL * LINE_EVERY
    x, y = np.meshgrid(corner[0] + steps, corner[1] + steps, indexing="ij")
    flat = np.vstack([x.ravel(), y.ravel(), np.zeros(x.size)])
    vertices = np.column_stack([x.ravel(), y.ravel(), heights_below(surface, flat)])
    node = np.arange(x.size).reshape(x.shape)
    here, ahead, left, across = (some.ravel() for some in (node[:-1, :-1], node[1:, :-1], node[:-1, 1:], node[1:, 1:]))
    faces = np.vstack([np.column_stack([here, ahead, across]), np.column_stack([here, across, left])])
    along_x, along_y = node[:, ::LINE_EVERY], node[::LINE_EVERY].T
    ends = [np.column_stack([rows[:-1].ravel(), rows[1:].ravel()]) for rows in (along_x, along_y)]
    return Patch(vertices=vertices, faces=faces, lines=vertices[np.concatenate(ends).ravel()].T)

from __future__ import annotations

import numpy as np
import pytest

from multimodal_to.models.terrain import Plane, Stairs, heights_below
from multimodal_to.models.terrain_mesh import CELL, LINE_EVERY, patch


@pytest.mark.parametrize("surface", [Plane(slope=0.3), Stairs(edges=(0.2,), heights=(0.0, 0.1), direction=(-1.0, 1.0))])
def test_a_patch_lies_on_its_surface_and_faces_up(surface):
    middle, half = np.array([-0.4, 0.3]), 0.6
    terrain = patch(surface, middle, half)
    for points in (terrain.vertices.T, terrain.lines):
        assert points[2] == pytest.approx(heights_below(surface, points), abs=1e-12)
    assert (terrain.vertices[:, :2].min(axis=0) <= middle - half + CELL * LINE_EVERY / 2).all()
    assert (terrain.vertices[:, :2].max(axis=0) >= middle + half - CELL * LINE_EVERY / 2).all()
    one, two, three = (terrain.vertices[terrain.faces[:, corner]] for corner in range(3))
    up = np.cross(two - one, three - one)
    assert up[:, 2] == pytest.approx(CELL**2), "each face covers half a cell, and all are seen from above"
    assert up[:, 2].sum() / 2 == pytest.approx(np.prod(np.ptp(terrain.vertices[:, :2], axis=0)))


def test_the_lines_are_connected_pieces_along_x_and_y():
    lines = patch(Plane(slope=0.1), np.zeros(2), 0.5).lines
    pieces = lines[:2, 1::2] - lines[:2, ::2]
    assert np.sort(np.abs(pieces), axis=0) == pytest.approx(np.tile([[0.0], [CELL]], pieces.shape[1]))

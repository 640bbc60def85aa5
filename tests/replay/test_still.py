"""Snapshots of a motion that stays where it is stand beside each other, also on ground that is not flat."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from multimodal_to.models.terrain import FlatGround, Plane, Stairs, heights_below
from multimodal_to.replay.motion import _extent, _frozen, _layout
from multimodal_to.replay.visuals import appearance
from odd_robots import at_rest, odd_robot

SURFACES = [
    FlatGround(),
    Plane(slope=0.3, direction=(0.6, -0.8)),
    Plane(slope=-0.2),
    Stairs(edges=(0.05,), heights=(0.0, 0.1), direction=(0.0, 1.0)),
]


@pytest.mark.parametrize("surface", SURFACES, ids=lambda surface: type(surface).__name__)
def test_they_stand_side_by_side_on_ground_of_the_same_height(tmp_path, surface):
    robot = odd_robot(tmp_path, joints={}, feet=True, jets=True)
    motion, visuals = _frozen(at_rest(robot), np.array([0.2]))[0], appearance(robot.urdf).visuals
    ghosts = [
        replace(motion, com_position=np.add(motion.com_position, [[0.01 * index], [0.02], [0.0]])) for index in range(4)
    ]
    direction, offsets, apart = _layout(robot, ghosts, visuals, surface)
    low, high = _extent(robot, motion, visuals, np.zeros((motion.time.size, 3)))
    assert apart
    steps = np.diff(offsets, axis=0)
    assert np.linalg.norm(steps, axis=1).min() > (high - low)[:2].max()
    assert np.cross(direction, steps[0])[2] > 0.0  # from left to right, as the camera sees it
    places = offsets.T + np.array([[0.3], [0.1], [0.0]])
    moved = places if not isinstance(surface, FlatGround) else 0.0 * places
    assert np.ptp(heights_below(surface, moved)) == pytest.approx(0.0, abs=1e-9)

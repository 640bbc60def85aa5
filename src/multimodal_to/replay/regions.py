"""Walls and boxes of a task, drawn: faces that are seen through, with edges."""

from __future__ import annotations

import itertools

import numpy as np

from multimodal_to.adam.spatial import Array
from multimodal_to.replay.scene import Scene, shapes, translation
from multimodal_to.replay.stage import View
from multimodal_to.scenarios.data import OwnSurfaceError, stored
from multimodal_to.scenarios.regions import Box, Region, Wall
from multimodal_to.trajectory import Trajectory
from multimodal_to.trajectory.instants import share

COLOUR = 0x6C4AB6
_OPACITY, _THICKNESS = 0.16, 0.002  # of faces [1], of a wall [m]
_AROUND = 1.2  # size of the part of a wall that is drawn, over what is seen at once [1]


def regions_of(trajectory: Trajectory) -> tuple[Region, ...]:
    """Return the walls and boxes of the task that a trajectory keeps; none where it cannot be read again."""
    try:
        scenario = stored(trajectory)
    except OwnSurfaceError:
        return ()
    return () if scenario is None else (*scenario.walls, *scenario.boxes)


def draw_regions(scene: Scene, view: View, regions: tuple[Region, ...]) -> None:
    """Draw boxes, and of walls the part about what is seen.

    One that holds over a stretch of a motion is seen over that stretch alone.

    Args:
        scene: where to draw.
        view: what the camera has to see.
        regions: of the task.
    """
    faces = shapes.MeshLambertMaterial(color=COLOUR, opacity=_OPACITY, transparent=True, depthWrite=False)
    edges = shapes.LineBasicMaterial(color=COLOUR)
    shares = np.linspace(0.0, 1.0, scene.time.size)
    for index, region in enumerate(regions):
        size, pose = _slab(region, view) if isinstance(region, Wall) else _box(region)
        path = f"regions/{index}"
        scene.add(f"{path}/faces", shapes.Box(size.tolist()), faces, pose, shadow=False)
        lines = shapes.LineSegments(shapes.PointsGeometry(_edges(size)), edges)
        scene.add(f"{path}/edges", lines, None, pose, shadow=False)
        if scene.time.size > 1:
            rounding = 0.5 / (scene.time.size - 1)
            holds = (shares >= share(region.begin) - rounding) & (shares <= share(region.end) + rounding)
            scene.set(path, "visible", holds)


def _box(box: Box) -> tuple[Array, Array]:
    """Return the edges' lengths of a box [m], (3,), and its pose."""
    lower, upper = np.array(box.lower), np.array(box.upper)
    return upper - lower, translation((lower + upper) / 2.0)


def _slab(wall: Wall, view: View) -> tuple[Array, Array]:
    """Return the edges' lengths of the part of a wall about what is seen [m], (3,), and its pose.

    Args:
        wall: of the task.
        view: what the camera has to see.
    """
    side = _AROUND * max(view.width, view.height, view.depth)
    normal = np.array(wall.unit)
    pose = translation(view.middle - (normal @ view.middle - wall.offset + _THICKNESS / 2.0) * normal)
    pose[:3, :3] = _turned(normal)
    return np.array([side, side, _THICKNESS]), pose


def _turned(normal: Array) -> Array:
    """Return a rotation that turns z to a normal and keeps, of a wall that stands, two edges level, (3, 3)."""
    level = np.cross([0.0, 0.0, 1.0], normal)
    size = float(np.linalg.norm(level))
    x = level / size if size > 1e-9 else np.array([1.0, 0.0, 0.0])
    return np.column_stack([x, np.cross(normal, x), normal])


def _edges(size: Array) -> Array:
    """Return the end points of the twelve edges of a box about the origin, in pairs, (3, 24)."""
    corners = [np.array(signs) * size / 2.0 for signs in itertools.product((-1.0, 1.0), repeat=3)]
    ends = [
        end
        for one, other in itertools.combinations(corners, 2)
        if np.count_nonzero(one != other) == 1
        for end in (one, other)
    ]
    return np.array(ends).T

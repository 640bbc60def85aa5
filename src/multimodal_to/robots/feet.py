"""Contact points of a foot: the corners of its sole, or one point, from the shape that the foot has at home."""

from __future__ import annotations

import numpy as np

from multimodal_to.adam.spatial import Array

FLAT = 0.005
"""Points so near to a plane belong to it [L]."""
SOLE = 0.07
"""A plane is a sole where it is at least so wide and so long [L]."""
LEVEL = np.radians(2.0)
"""A sole that is tilted by less is taken as level: meshes are rough [rad]."""
TILTED = np.radians(20.0)
"""A sole is tilted by less than this at home [rad]."""


def contact_points(points: Array, height: float) -> Array:
    """Return where a foot touches the ground, (4, 3) for a sole, else (1, 3), in the axes of the points [m].

    A sole is the largest plane below the foot's convex hull. Its corners are those of the smallest rectangle along x
    and y, from ahead on the left on, counter-clockwise.

    Args:
        points: on the foot at home, x ahead and z up [m], (points, 3).
        height: L, of the CoM above the ground [m].
    """
    sole = _sole(points, height)
    if sole is not None:
        return sole
    lowest = float(points[:, 2].min())
    touching = points[points[:, 2] <= lowest + FLAT * height]
    return np.array([[*(0.5 * (touching[:, :2].min(axis=0) + touching[:, :2].max(axis=0))), lowest]])


def _sole(points: Array, height: float) -> Array | None:
    if np.linalg.matrix_rank(points - points.mean(axis=0), tol=FLAT * height) < 3:
        return None
    import trimesh  # takes a second to import

    hull = trimesh.convex.convex_hull(points)
    downward = hull.face_normals[:, 2] < -np.cos(TILTED)
    best, widest = None, 0.0
    lowest = float(points[:, 2].min())
    for normal, corner in zip(hull.face_normals[downward], hull.triangles[downward][:, 0], strict=True):
        place = points[(points - corner) @ normal > -FLAT * height]
        if place[:, 2].min() > lowest + 2 * SOLE * height:
            continue
        low, high = place[:, :2].min(axis=0), place[:, :2].max(axis=0)
        area = float(np.prod(high - low)) * abs(float(normal[2]))
        if (high - low).min() >= SOLE * height and area > widest * 1.02:
            across = np.array([[high[0], high[1]], [low[0], high[1]], [low[0], low[1]], [high[0], low[1]]])
            level = normal[2] < -np.cos(LEVEL)
            heights = np.full(4, lowest) if level else corner[2] - ((across - corner[:2]) @ normal[:2]) / normal[2]
            best, widest = np.column_stack([across, heights]), area
    return best

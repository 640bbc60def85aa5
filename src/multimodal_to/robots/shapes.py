"""Points on the shapes of links: of the collision shapes of a URDF, or else of its visuals."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np

from multimodal_to.adam.spatial import Array
from multimodal_to.adam.urdf import parse_urdf
from multimodal_to.errors import MultimodalError

_AROUND = 24  # points around a cylinder's rim
_RINGS = 13  # of a sphere


def points_of_links(urdf: Path, links: Iterable[str]) -> dict[str, Array]:
    """Return points on the surface of each link that has a shape, in the link's frame [m], (points, 3).

    A link has its collision shapes, or its visuals where it has none or their meshes cannot be read.
    """
    shapes = {link.name: link for link in parse_urdf(urdf, collisions=True).links}
    found = {}
    for name in set(links) & shapes.keys():
        points = _points(shapes[name].collisions, urdf)
        found[name] = points if len(points) else _points(shapes[name].visuals, urdf)
    return {name: points for name, points in found.items() if len(points)}


def _points(shapes: Iterable[Any], urdf: Path) -> Array:
    found = [np.zeros((0, 3))]
    for shape in shapes:
        origin = np.eye(4) if shape.origin is None else np.asarray(shape.origin, dtype=float)
        own = _of_geometry(shape.geometry, urdf)
        found.append(own @ origin[:3, :3].T + origin[:3, 3])
    return np.vstack(found)


def _of_geometry(geometry: Any, urdf: Path) -> Array:
    if geometry.box is not None:
        signs = np.array(np.meshgrid([-0.5, 0.5], [-0.5, 0.5], [-0.5, 0.5])).reshape(3, -1).T
        return np.asarray(signs * np.asarray(geometry.box.size, dtype=float))
    angles = np.linspace(0.0, 2.0 * np.pi, _AROUND, endpoint=False)
    circle = np.column_stack([np.cos(angles), np.sin(angles)])
    if geometry.cylinder is not None:
        radius, half = float(geometry.cylinder.radius), 0.5 * float(geometry.cylinder.length)
        return np.vstack([np.column_stack([radius * circle, np.full(_AROUND, z)]) for z in (-half, half)])
    if geometry.sphere is not None:
        heights = np.cos(np.linspace(0.0, np.pi, _RINGS))
        rings = [np.column_stack([np.sqrt(1.0 - z * z) * circle, np.full(_AROUND, z)]) for z in heights]
        return float(geometry.sphere.radius) * np.vstack(rings)
    from multimodal_to.replay.meshes import load_parts  # takes a second to import

    mesh = geometry.mesh
    scale = np.ones(3) if mesh.scale is None else np.broadcast_to(np.asarray(mesh.scale, dtype=float), 3)
    try:
        return np.vstack([part.vertices for part in load_parts(mesh.filename, urdf, scale)])
    except MultimodalError:
        return np.zeros((0, 3))

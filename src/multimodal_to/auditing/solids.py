"""How near solid links come to each other on a motion, by their shapes in place of capsules. Needs the extra `solids`.

The shapes are boxes, cylinders and spheres of a URDF, or the convex hulls of meshes. `coal` computes the distances.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Any

import numpy as np

from multimodal_to.adam.spatial import Array
from multimodal_to.adam.urdf import parse_urdf
from multimodal_to.arguments import checked
from multimodal_to.auditing.self_collision import Clearance
from multimodal_to.errors import OutputError
from multimodal_to.models.capsule_pairs import FEWEST_JOINTS, joints_between, poses_in_base
from multimodal_to.models.robot import Robot
from multimodal_to.trajectory import Trajectory
from multimodal_to.values import Value


@dataclass(frozen=True, kw_only=True, eq=False)
class Solid(Value):
    """A convex part of a link."""

    link: str
    transform: Array  # link_H_solid, (4, 4)
    shape: Any  # of coal
    radius: float  # of the sphere around the solid's origin that holds it [m]


@checked
def urdf_solids(robot: Robot) -> tuple[Solid, ...]:
    """Return the boxes, cylinders and spheres among the visuals of a robot's URDF.

    Raises:
        OutputError: `coal` is not installed.
    """
    coal = _coal()
    found = []
    for link in parse_urdf(robot.urdf).links:
        for visual in link.visuals:
            transform, geometry = np.eye(4) if visual.origin is None else visual.origin, visual.geometry
            if geometry.box is not None:
                size = np.asarray(geometry.box.size, dtype=float)
                shape, radius = coal.Box(*size), 0.5 * float(np.linalg.norm(size))
            elif geometry.cylinder is not None:
                across, along = geometry.cylinder.radius, geometry.cylinder.length
                shape, radius = coal.Cylinder(across, along), float(np.hypot(across, 0.5 * along))
            elif geometry.sphere is not None:
                shape, radius = coal.Sphere(geometry.sphere.radius), geometry.sphere.radius
            else:
                continue
            found.append(Solid(link=link.name, transform=transform, shape=shape, radius=radius))
    return tuple(found)


@checked
def hull(link: str, transform: Array, vertices: Array) -> Solid:
    """Return the convex hull of a mesh as a part of a link.

    Args:
        link: that carries it.
        transform: link_H_mesh, (4, 4).
        vertices: of the mesh [m], (n, 3).

    Raises:
        OutputError: `coal` is not installed.
    """
    coal = _coal()
    middle = 0.5 * (vertices.min(axis=0) + vertices.max(axis=0))
    arms = vertices - middle
    points = coal.StdVec_Vec3s()
    points.extend(list(arms))
    placed = np.array(transform)
    placed[:3, 3] += placed[:3, :3] @ middle
    shape = coal.Convex.convexHull(points, False, "")
    return Solid(link=link, transform=placed, shape=shape, radius=float(np.linalg.norm(arms, axis=1).max()))


@checked
def solid_clearances(
    robot: Robot, trajectory: Trajectory, solids: Sequence[Solid] | None = None
) -> tuple[Clearance, ...]:
    """Return the least distance of every pair of links over the knots, nearest pairs first.

    Left out are links with fewer than `FEWEST_JOINTS` joints between them, and links that touch at home.

    Args:
        robot: the robot of the trajectory.
        trajectory: its joints are used.
        solids: the parts of the links; by default `urdf_solids`.

    Raises:
        OutputError: `coal` is not installed.
    """
    parts: dict[str, list[Solid]] = {}
    for solid in urdf_solids(robot) if solids is None else solids:
        parts.setdefault(solid.link, []).append(solid)
    postures = np.column_stack([robot.home.joint_positions, trajectory.joint_positions])
    poses = {link: poses_in_base(robot.kindyn, link, postures) for link in parts}
    found = []
    for pair in combinations(parts, 2):
        if joints_between(robot.kindyn.tree, *pair) >= FEWEST_JOINTS:
            couples = _couples(parts, poses, pair)
            if _least(couples, slice(0, 1))[0] > 0:
                distance, knot = _least(couples, slice(1, None))
                found.append(Clearance(pair=" – ".join(pair), distance=distance, knot=knot))
    return tuple(sorted(found, key=lambda entry: entry.distance))


Couple = tuple[Solid, Array, Solid, Array]
"""Two solids, each with its poses in the base, (count, 4, 4)."""


def _couples(parts: Mapping[str, Sequence[Solid]], poses: Mapping[str, Array], pair: tuple[str, str]) -> list[Couple]:
    """Return the parts of one link with those of another.

    Args:
        parts: of each link.
        poses: of each link in the base, (count, 4, 4).
        pair: names of the two links.
    """
    one, other = ([(solid, poses[link] @ solid.transform) for solid in parts[link]] for link in pair)
    return [(*first, *second) for first in one for second in other]


def _least(couples: Sequence[Couple], columns: slice) -> tuple[float, int]:
    """Return the least distance of all couples at some postures [m], and at which of them it is.

    Spheres around the solids say which couples and postures have to be looked at.

    Args:
        couples: of solids.
        columns: which of their poses count.
    """
    coal = _coal()
    bounds = np.array(
        [
            np.linalg.norm(first[columns, :3, 3] - second[columns, :3, 3], axis=1) - one.radius - other.radius
            for one, first, other, second in couples
        ]
    )
    best, where = np.inf, 0
    request, result = coal.DistanceRequest(), coal.DistanceResult()
    for place in np.argsort(bounds, axis=None):
        row, column = divmod(int(place), bounds.shape[1])
        if bounds[row, column] >= best:
            break
        one, first, other, second = couples[row]
        at = [coal.Transform3s(pose[:3, :3], pose[:3, 3]) for pose in (first[columns][column], second[columns][column])]
        result.clear()
        distance = float(coal.distance(one.shape, at[0], other.shape, at[1], request, result))
        if distance < best:
            best, where = distance, column
    return best, where


def _coal() -> Any:
    """Return the library.

    Raises:
        OutputError: it is not installed.
    """
    try:
        import coal
    except ImportError as error:
        raise OutputError("distances of solids need coal: pip install 'multimodal-to[solids]'") from error
    return coal

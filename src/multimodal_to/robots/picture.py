"""A picture of a robot at home: its shapes, contact points, capsules, the base's frame and what its jets push."""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np
import trimesh
from matplotlib.figure import Figure
from mpl_toolkits.mplot3d.art3d import Poly3DCollection

from multimodal_to.adam.spatial import Array
from multimodal_to.models.capsule import Capsule
from multimodal_to.models.robot import Robot
from multimodal_to.replay.meshes import MeshWarning, simplified
from multimodal_to.replay.visuals import Visual, appearance

_FACES = 9000  # of all meshes together
_VIEWS = (
    ("from ahead on the left", 18.0, 38.0, None),
    ("from the right", 0.0, -90.0, "y"),
    ("from ahead", 0.0, 0.0, "x"),
)
_AXES = ("#d62728", "#2ca02c", "#1f77b4")  # x, y, z
_CONTACT, _JET, _CAPSULE = "#d62728", "#9467bd", "#ff7f0e"
_LIGHT = np.array([0.4, -0.5, 0.8]) / np.linalg.norm([0.4, -0.5, 0.8])


def draw_home(robot: Robot, *, capsules: bool = True) -> Figure:
    """Return a figure of a robot at home from three sides.

    Red points are contact points, and purple arrows show which way the thrusts push. The base's axes x, y, z are red,
    green and blue. Capsules are orange.

    Args:
        robot: that is drawn.
        capsules: draw the shapes that keep away from each other.
    """
    figure = Figure(figsize=(16.0, 6.2), layout="constrained")
    triangles, colours = _surfaces(robot)
    shells = [_capsule(robot, capsule) for capsule in robot.link_capsules] if capsules else []
    frames = [contact.frame for contact in robot.contacts]
    points = np.array([robot.pose_at_home(frame)[:3, 3] for frame in frames]).reshape(-1, 3)
    seen = np.vstack([triangles.reshape(-1, 3), points, robot.home.base_position])
    low, high = seen.min(axis=0), seen.max(axis=0)
    size = float((high - low).max())
    for index, (title, elevation, azimuth, along) in enumerate(_VIEWS):
        axes: Any = figure.add_subplot(1, len(_VIEWS), index + 1, projection="3d", computed_zorder=False)
        axes.add_collection3d(Poly3DCollection(triangles, facecolors=colours, edgecolors="none", zorder=1))
        for shell in shells:
            axes.add_collection3d(Poly3DCollection(shell, facecolors=_CAPSULE, alpha=0.12, edgecolors="none", zorder=2))
        axes.scatter(*points.T, color=_CONTACT, s=22, depthshade=False, zorder=4)
        _draw_axes(axes, robot, 0.15 * size)
        for jet in robot.jets:
            pose = robot.pose_at_home(jet.frame)
            axes.quiver(*pose[:3, 3], *(-0.25 * size * pose[:3, 2]), color=_JET, linewidth=2.0, zorder=5)
        middle = 0.5 * (low + high)
        for name, centre in zip("xyz", middle, strict=True):
            getattr(axes, f"set_{name}lim")(centre - 0.5 * size, centre + 0.5 * size)
            getattr(axes, f"set_{name}label")(f"{name} [m]")
        if along is not None:  # seen along this axis, whose numbers lie on each other
            getattr(axes, f"set_{along}ticks")([])
            getattr(axes, f"set_{along}label")("")
        axes.set_box_aspect((1, 1, 1), zoom=1.25)
        axes.set_proj_type("ortho")
        axes.view_init(elevation, azimuth)
        axes.set_title(title)
    figure.suptitle(
        f"{robot.name} at home: {robot.mass:.3g} kg, CoM {robot.standing_height:.3g} m above its contact points, "
        f"{len(robot.joint_names)} joints, {len(robot.feet)} feet, {len(robot.jets)} jets"
    )
    return figure


def _draw_axes(axes: Any, robot: Robot, length: float) -> None:
    pose = robot.home.base_transform
    for column, colour in enumerate(_AXES):
        axes.plot(*np.column_stack([pose[:3, 3], pose[:3, 3] + length * pose[:3, column]]), color=colour, zorder=5)


def _surfaces(robot: Robot) -> tuple[Array, Array]:
    """Return the triangles of all links in the world [m], (count, 3, 3), and their colours, (count, 4)."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", MeshWarning)  # what is missing is missing in the picture
        visuals = appearance(robot.urdf).visuals
    parts = iter(simplified([visual.part for visual in visuals if visual.part is not None], _FACES))
    triangles, colours = [np.zeros((0, 3, 3))], [np.zeros((0, 4))]
    for visual in visuals:
        part = None if visual.part is None else next(parts)
        own = _primitive(visual) if part is None else part.vertices[part.faces]
        pose = robot.pose_at_home(visual.link) @ visual.transform
        own = own @ pose[:3, :3].T + pose[:3, 3]
        normals = np.cross(own[:, 1] - own[:, 0], own[:, 2] - own[:, 0])
        lengths = np.linalg.norm(normals, axis=1, keepdims=True)
        shade = 0.65 + 0.35 * np.abs((normals / np.where(lengths > 0, lengths, 1.0)) @ _LIGHT)
        colour = np.tile(np.array(visual.rgba), (len(own), 1))
        colour[:, :3] = np.clip((0.25 + 0.75 * colour[:, :3]) * shade[:, None], 0.0, 1.0)
        colour[:, 3] = 0.55  # what is inside and behind is seen
        triangles.append(own)
        colours.append(colour)
    return np.vstack(triangles), np.vstack(colours)


def _primitive(visual: Visual) -> Array:
    geometry = visual.primitive
    if geometry.box is not None:
        mesh = trimesh.creation.box(np.asarray(geometry.box.size, dtype=float))
    elif geometry.cylinder is not None:
        mesh = trimesh.creation.cylinder(float(geometry.cylinder.radius), float(geometry.cylinder.length), sections=16)
    else:
        mesh = trimesh.creation.icosphere(2, float(geometry.sphere.radius))
    return np.asarray(mesh.triangles, dtype=float)


def _capsule(robot: Robot, capsule: Capsule) -> Array:
    mesh = trimesh.creation.capsule(height=max(capsule.length, 1e-6), radius=capsule.radius, count=[12, 8])
    axis = (capsule.end - capsule.start) / capsule.length if capsule.length else np.array([0.0, 0.0, 1.0])
    turn = np.asarray(trimesh.geometry.align_vectors([0.0, 0.0, 1.0], axis))  # type: ignore[no-untyped-call]
    own = np.array(mesh.triangles, dtype=float)
    own[:, :, 2] -= 0.5 * (own[:, :, 2].min() + own[:, :, 2].max())
    pose = robot.pose_at_home(capsule.frame)
    placed = own @ turn[:3, :3].T + 0.5 * (capsule.start + capsule.end)
    return np.asarray(placed @ pose[:3, :3].T + pose[:3, 3])

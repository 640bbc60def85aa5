"""The links of a robot in the scene, nested as in the URDF, so that joints move them and they stay together."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from multimodal_to.adam.spatial import Array
from multimodal_to.adam.urdf import parse_urdf
from multimodal_to.models.robot import Robot
from multimodal_to.replay.meshes import shaded
from multimodal_to.replay.scene import Y_TO_Z, Scene, SmoothMesh, quaternions, segment, shapes
from multimodal_to.replay.visuals import Appearance, Visual
from multimodal_to.trajectory import Trajectory
from multimodal_to.trajectory.derived import frame_poses

FINENESS = 2.0**-13
"""Vertices of meshes are on a grid this fine [m]: what ends in zeros packs well."""
Drawn = tuple[Any, Any, Array]
"""Geometry, material and transform of a visual, as the scene takes them."""


def link_paths(robot: Robot, appearance: Appearance, root: str) -> dict[str, str]:
    """Return where in the scene the links are that have a shape or a jet: each below the nearest such link above it.

    Args:
        robot: whose links.
        appearance: its visuals.
        root: path in the scene that all links are below.
    """
    described = parse_urdf(robot.urdf)
    shown = {visual.link for visual in appearance.visuals} | {jet.frame for jet in robot.jets}
    above = {joint.child: joint.parent for joint in described.joints}
    above |= {name: frame.link for name, frame in robot.added_frames.items()}

    def path(name: str) -> str:
        parts, link = [segment(name)], above.get(name)
        while link is not None:
            if link in shown:
                parts.append(segment(link))
            link = above.get(link)
        return "/".join([root, *reversed(parts)])

    names = (*(link.name for link in described.links), *robot.added_frames)
    return {name: path(name) for name in names if name in shown}


def link_poses(robot: Robot, trajectory: Trajectory, paths: Mapping[str, str]) -> dict[str, Array]:
    """Return the pose of each link in its parent in the scene at every knot, (knots + 1, 4, 4).

    Args:
        robot: whose links.
        trajectory: its motion.
        paths: path in the scene of each link, from `link_paths`.
    """
    poses = {name: frame_poses(robot, trajectory, name) for name in paths}
    by_path = {path: name for name, path in paths.items()}
    parents = {name: by_path.get(path.rpartition("/")[0]) for name, path in paths.items()}
    return {
        name: pose if (parent := parents[name]) is None else np.linalg.inv(poses[parent]) @ pose
        for name, pose in poses.items()
    }


def draw_links(scene: Scene, paths: Mapping[str, str], poses: Mapping[str, Array]) -> None:
    """Let the links of `paths` move as their poses say, (knots + 1, 4, 4) each.

    Args:
        scene: where to draw.
        paths: path in the scene of each link, from `link_paths`.
        poses: of each link in its parent in the scene at every knot, (knots + 1, 4, 4), from `link_poses`.
    """
    for name, path in paths.items():
        scene.set(path, "position", poses[name][:, :3, 3])
        scene.set(path, "quaternion", quaternions(poses[name]))


def draw_visuals(scene: Scene, paths: Mapping[str, str], visuals: Mapping[Visual, Drawn]) -> None:
    """Put the visuals on their links.

    Args:
        scene: where to draw.
        paths: path in the scene of each link, from `link_paths`.
        visuals: each visual as `drawn` or `faded` returns it.
    """
    for visual, (geometry, material, transform) in visuals.items():
        scene.add(f"{paths[visual.link]}/{visual.name}", geometry, material, transform)


def drawn(visual: Visual) -> Drawn:
    """Return a visual in three.js's words."""
    material = _material(visual, 1.0)
    if visual.part is not None:
        vertices, faces, normals = shaded(visual.part)
        on_grid = np.round(vertices / FINENESS) * FINENESS
        return SmoothMesh(on_grid, faces, normals), material, visual.transform
    geometry, turned = _primitive(visual.primitive)
    return geometry, material, visual.transform @ turned


def faded(visuals: Mapping[Visual, Drawn], opacity: float) -> dict[Visual, Drawn]:
    """Return the visuals with their opacity times the one given."""
    return {
        visual: (geometry, _material(visual, opacity), transform)
        for visual, (geometry, _, transform) in visuals.items()
    }


def _material(visual: Visual, opacity: float) -> Any:
    red, green, blue = (round(255 * part) for part in visual.rgba[:3])
    return shapes.MeshPhongMaterial(
        color=red << 16 | green << 8 | blue, opacity=visual.rgba[3] * opacity, specular=0x222222, shininess=25
    )


def _primitive(geometry: Any) -> tuple[Any, Array]:
    """Return meshcat's geometry for a box, cylinder or sphere of the URDF, and how it must be turned."""
    if geometry.box is not None:
        return shapes.Box([float(length) for length in geometry.box.size]), np.eye(4)
    if geometry.cylinder is not None:
        return shapes.Cylinder(float(geometry.cylinder.length), float(geometry.cylinder.radius)), Y_TO_Z
    return shapes.Sphere(float(geometry.sphere.radius)), np.eye(4)

"""What a robot's motion is made of, drawn: flames at the jets, arrows at the contact points, the CoM and its way."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from multimodal_to.models.robot import Robot
from multimodal_to.replay.scene import Y_TO_Z, Scene, SmoothMesh, shapes, translation, turns_from_z
from multimodal_to.trajectory import Array, Trajectory

FLAME_LENGTH = 0.45
"""Length of the flame of the robot's strongest jet at its greatest thrust; others in proportion to their thrust [m]."""

ARROW_LENGTH = 1.5
"""Length of the arrow of a contact force as large as the robot's weight [m]."""

SMALLEST_FORCE = 1.0
"""Contact forces below this have no arrow [N]."""

_NOZZLE_RADIUS = 0.033  # of the flame of the strongest jet [m]
_FULL_WIDTH_LENGTH = 0.08  # arrows and flames shorter than this are also thinner [m]
_LAYERS = (  # of a flame, inside out: colour, width and length of the whole, opacity at full thrust
    ("core", 0xFFF6DC, 0.50, 0.45, 0.95),
    ("middle", 0xFFB545, 0.78, 0.72, 0.60),
    ("plume", 0xF06A12, 1.00, 1.00, 0.36),
)
_FAINTEST = 0.25  # opacity of a flame almost without thrust, as a share of that at full thrust
_COM_COLOUR = 0x2B6CE0


def draw_flames(scene: Scene, robot: Robot, thrust: Array, paths: Mapping[str, str], opacity: float = 1.0) -> None:
    """Draw at each jet a flame along +z of its frame, where the exhaust leaves.

    Its length is `FLAME_LENGTH` T / T_max of the strongest jet; its opacity grows linearly with T / T_max of its own.

    Args:
        scene: where to draw.
        robot: whose jets burn.
        thrust: T of each jet at every knot [N], (jets, knots + 1).
        paths: where the links are.
        opacity: of the robot in all.
    """
    strongest = max((jet.thrust_max for jet in robot.jets), default=1.0)
    for jet, row in zip(robot.jets, np.maximum(thrust, 0.0), strict=True):
        path, radius = f"{paths[jet.frame]}/flame", _NOZZLE_RADIUS * math.sqrt(jet.thrust_max / strongest)
        glow = opacity * (_FAINTEST + (1.0 - _FAINTEST) * np.minimum(row / jet.thrust_max, 1.0))
        for name, colour, width, length, brightest in _LAYERS:
            material = shapes.MeshBasicMaterial(
                color=colour, opacity=float(brightest * glow[0]), transparent=True, depthWrite=False
            )
            scene.add(f"{path}/{name}", _plume(width * radius, length), material, np.eye(4), shadow=False)
            if np.ptp(glow) > 0.0:
                scene.move(f"{path}/{name}/<object>", "material.opacity", brightest * glow)
        _stretch(scene, path, FLAME_LENGTH * row / strongest)


def draw_contact_forces(scene: Scene, robot: Robot, trajectory: Trajectory, root: str = "contact_forces") -> None:
    """Draw each contact force as an arrow that starts at its contact point."""
    colour = shapes.MeshLambertMaterial(color=0x1FA34A, emissive=0x08401B)
    positions, forces = trajectory.per_contact("contact_positions"), trajectory.per_contact("contact_forces")
    for name, position, force in zip(trajectory.contact_names, positions, forces, strict=True):
        path, size = f"{root}/{name}", np.linalg.norm(force, axis=0)
        shaft, tip = shapes.Cylinder(0.75, radius=0.006), shapes.Cylinder(0.25, radiusTop=0.0, radiusBottom=0.015)
        scene.add(f"{path}/shaft", shaft, colour, translation([0.0, 0.0, 0.375]) @ Y_TO_Z)
        scene.add(f"{path}/tip", tip, colour, translation([0.0, 0.0, 0.875]) @ Y_TO_Z)
        scene.set(path, "position", position.T)
        scene.set(path, "quaternion", turns_from_z(force.T, SMALLEST_FORCE))
        _stretch(scene, path, ARROW_LENGTH * np.where(size < SMALLEST_FORCE, 0.0, size) / robot.weight)


def draw_com(scene: Scene, trajectory: Trajectory) -> None:
    """Draw the CoM as a sphere that is seen through the robot, and its way as a line."""
    seen_through = shapes.MeshBasicMaterial(color=_COM_COLOUR, opacity=0.85, transparent=True, depthTest=False)
    scene.add("com/sphere", shapes.Sphere(0.018), seen_through, np.eye(4), shadow=False)
    scene.set("com", "position", trajectory.com_position.T)
    draw_com_trace(scene, trajectory)


def draw_com_trace(scene: Scene, trajectory: Trajectory) -> None:
    """Draw the way of the CoM as a line."""
    way = shapes.Line(shapes.PointsGeometry(trajectory.com_position), shapes.LineBasicMaterial(color=_COM_COLOUR))
    scene.add("com_trace", way, None, np.eye(4))


def _plume(radius: float, length: float, rings: int = 14, sides: int = 24) -> SmoothMesh:
    """Return a body of revolution about z that swells a little behind the nozzle and tapers off to a point."""
    along = np.linspace(0.0, 1.0, rings)
    widths = radius * (1.0 + 0.6 * along) * (1.0 - along**1.6)
    angles = np.linspace(0.0, 2.0 * np.pi, sides, endpoint=False)
    around = np.column_stack([np.cos(angles), np.sin(angles), np.zeros(sides)])
    vertices = (widths[:, None, None] * around + length * along[:, None, None] * [0.0, 0.0, 1.0]).reshape(-1, 3)
    first = (sides * np.arange(rings - 1)[:, None] + np.arange(sides)).ravel()
    beside = (sides * np.arange(rings - 1)[:, None] + np.roll(np.arange(sides), -1)).ravel()
    faces = np.vstack(
        [np.column_stack([first, beside, beside + sides]), np.column_stack([first, beside + sides, first + sides])]
    )
    return SmoothMesh(vertices, faces, np.tile(around, (rings, 1)))


def _stretch(scene: Scene, path: str, lengths: Array) -> None:
    """Scale a node of length 1 along its z to a length [m] at every knot; hide it while it has none."""
    widths = np.minimum(1.0, lengths / _FULL_WIDTH_LENGTH)
    shown = lengths > 0.0
    scene.set(path, "scale", np.column_stack([widths, widths, lengths]))
    scene.set(path, "visible", shown | np.append(shown[1:], False))  # holds until the next knot

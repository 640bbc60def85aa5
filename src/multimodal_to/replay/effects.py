"""What a robot's motion is made of, drawn: flames at the jets, arrows at the contact points, the CoM and its way."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np

from multimodal_to.adam.spatial import Array
from multimodal_to.models.jet import JetModel
from multimodal_to.models.robot import Robot
from multimodal_to.replay.scene import Y_TO_Z, Scene, SmoothMesh, segment, shapes, translation, turns_from_z
from multimodal_to.trajectory import Trajectory
from multimodal_to.trajectory.derived import at_knots, flight_force, frame_poses

FLAME_LENGTH = 0.45
"""Length of the flame of the robot's strongest jet at its greatest thrust; others in proportion to their thrust [m]."""

ARROW_LENGTH = 1.5
"""Length of the arrow of a contact force as large as the robot's weight [m]."""

_NOZZLE_RADIUS = 0.033  # of the flame of the strongest jet [m]
_FULL_WIDTH_LENGTH = 0.08  # arrows and flames shorter than this are also thinner [m]
_LAYERS = (  # of a flame, each drawn over those before: colour, width and length of the whole, opacity at full thrust
    ("plume", 0xF06A12, 1.00, 1.00, 0.42),
    ("middle", 0xFFA935, 0.74, 0.74, 0.60),
    ("core", 0xFFF6DC, 0.46, 0.46, 0.85),
)
_AIR = (("plume", 0xBFD9EC, 1.0, 1.0, 0.30), ("core", 0xFFFFFF, 0.5, 0.7, 0.35))  # of what does not burn, likewise
_FAINTEST = 0.25  # opacity of a flame almost without thrust, as a share of that at full thrust
_CONTACT_COLOURS, _PUSH_COLOURS = (0x1FA34A, 0x08401B), (0xB5179E, 0x4A0940)  # of arrows, in and out of the light
_COM_COLOUR = 0x2B6CE0
_TRACE_RADIUS = 0.003  # of the way of the CoM [m]
_TRACE_STEP = 0.002  # points of it that are nearer than this to the one before are left out [m]
_TRACE_WITHIN = 0.35  # opacity of its part that is inside the robot


def draw_flames(
    scene: Scene, robot: Robot, thrust: Array, paths: Mapping[str, str], *, opacity: float = 1.0, steady: bool = False
) -> None:
    """Draw at each turbine a flame along +z of its frame, where the exhaust leaves, and at a rotor its stream of air.

    Its length is `FLAME_LENGTH` T / T_max of the strongest jet; its opacity grows linearly with T / T_max of its own.

    Args:
        scene: where to draw.
        robot: whose jets burn.
        thrust: T of each jet at every knot [N], (jets, knots + 1).
        paths: where the links are.
        opacity: of the robot in all.
        steady: keep the opacity of full thrust, for a viewer that cannot move what belongs to a material.
    """
    strongest = max((jet.thrust_max for jet in robot.jets), default=1.0)
    frames = list[str]()
    for jet, row in zip(robot.jets, np.maximum(thrust, 0.0), strict=True):
        burning = frames.count(jet.frame)
        frames.append(jet.frame)
        path = f"{paths[jet.frame]}/flame" + (f"_{burning}" if burning else "")
        radius = _NOZZLE_RADIUS * math.sqrt(jet.thrust_max / strongest)
        glow = opacity * (_FAINTEST + (1.0 - _FAINTEST) * np.minimum(row / jet.thrust_max, 1.0))
        burns = isinstance(jet.model, JetModel)
        for name, colour, width, length, brightest in _LAYERS if burns else _AIR:
            material = shapes.MeshBasicMaterial(
                color=colour,
                opacity=float(brightest * (opacity if steady else glow[0])),
                transparent=True,
                depthWrite=False,
            )
            scene.add(f"{path}/{name}", _plume(width * radius, length), material, np.eye(4), shadow=False)
            if np.ptp(glow) > 0.0 and not steady:
                scene.move(f"{path}/{name}/<object>", "material.opacity", brightest * glow)
        _stretch(scene, path, FLAME_LENGTH * row / strongest)


def draw_contact_forces(scene: Scene, robot: Robot, trajectory: Trajectory, root: str = "contact_forces") -> None:
    """Draw each contact force at the instants of the knots as an arrow that starts at its contact point.

    A force below `flight_force` has none.

    Args:
        scene: where to draw.
        robot: whose weight is the measure of the arrows.
        trajectory: whose contact positions [m] and forces [N].
        root: path in the scene that all arrows are below.
    """
    positions, smallest = trajectory.per_contact("contact_positions"), flight_force(robot)
    forces = at_knots(trajectory, "contact_forces").reshape(positions.shape)
    for name, position, force in zip(trajectory.contact_names, positions, forces, strict=True):
        lengths = _arrow(scene, f"{root}/{segment(name)}", force, robot.weight, smallest, _CONTACT_COLOURS)
        scene.set(f"{root}/{segment(name)}", "position", position.T)
        _stretch(scene, f"{root}/{segment(name)}", lengths)


def draw_pushes(
    scene: Scene,
    robot: Robot,
    trajectory: Trajectory,
    pushes: Sequence[tuple[str, Array]],
    root: str = "pushes",
) -> None:
    """Draw each known push as an arrow that ends where it pushes, as long as a contact force of its size.

    Args:
        scene: where to draw.
        robot: whose weight is the measure of the arrows.
        trajectory: whose frames are pushed.
        pushes: the frame and its force at every knot [N], (3, knots + 1).
        root: path in the scene that all arrows are below.
    """
    for index, (frame, force) in enumerate(pushes):
        path = f"{root}/{index}"
        lengths = _arrow(scene, path, force, robot.weight, flight_force(robot), _PUSH_COLOURS)
        along = force.T / np.maximum(np.linalg.norm(force, axis=0), 1e-9)[:, None]
        scene.set(path, "position", frame_poses(robot, trajectory, frame)[:, :3, 3] - lengths[:, None] * along)
        _stretch(scene, path, lengths)


def _arrow(scene: Scene, path: str, force: Array, weight: float, smallest: float, colours: tuple[int, int]) -> Array:
    """Add an arrow of length 1 that points along a force, and return how long it is at every knot [m], (knots + 1,).

    Args:
        scene: where to draw.
        path: of the arrow.
        force: at every knot [N], (3, knots + 1).
        weight: of the robot, whose arrow is `ARROW_LENGTH` long [N].
        smallest: force that has an arrow [N].
        colours: of the arrow, and what it has where no light falls on it.
    """
    colour, size = shapes.MeshLambertMaterial(color=colours[0], emissive=colours[1]), np.linalg.norm(force, axis=0)
    shaft, tip = shapes.Cylinder(0.75, radius=0.006), shapes.Cylinder(0.25, radiusTop=0.0, radiusBottom=0.015)
    scene.add(f"{path}/shaft", shaft, colour, translation([0.0, 0.0, 0.375]) @ Y_TO_Z)
    scene.add(f"{path}/tip", tip, colour, translation([0.0, 0.0, 0.875]) @ Y_TO_Z)
    scene.set(path, "quaternion", turns_from_z(force.T, smallest))
    return np.asarray(ARROW_LENGTH * np.where(size < smallest, 0.0, size) / weight)


def draw_com(scene: Scene, trajectory: Trajectory) -> None:
    """Draw the CoM as a sphere that is seen through the robot, and its way as a line."""
    seen_through = shapes.MeshBasicMaterial(color=_COM_COLOUR, opacity=0.85, transparent=True, depthTest=False)
    scene.add("com/sphere", shapes.Sphere(0.018), seen_through, np.eye(4), shadow=False)
    scene.set("com", "position", trajectory.com_position.T)
    draw_com_trace(scene, trajectory)


def draw_com_trace(scene: Scene, trajectory: Trajectory) -> None:
    """Draw the way of the CoM as a thin tube, which shines through the robot; nothing where the CoM stays."""
    points = [trajectory.com_position[:, 0]]
    for point in trajectory.com_position.T[1:]:
        if np.linalg.norm(point - points[-1]) > _TRACE_STEP:
            points.append(point)
    if len(points) == 1:
        return
    tube = _tube(np.array(points), _TRACE_RADIUS)
    within = shapes.MeshBasicMaterial(color=_COM_COLOUR, opacity=_TRACE_WITHIN, transparent=True, depthTest=False)
    scene.add("com_trace/within", tube, within, np.eye(4), shadow=False)
    scene.add("com_trace/outside", tube, shapes.MeshBasicMaterial(color=_COM_COLOUR), np.eye(4), shadow=False)


def _tube(points: Array, radius: float, sides: int = 6) -> SmoothMesh:
    """Return one prism about each segment between points, no two of which in a row coincide.

    Args:
        points: of the middle line [m], (n, 3).
        radius: [m].
        sides: of each prism.
    """
    along = np.diff(points, axis=0) / np.linalg.norm(np.diff(points, axis=0), axis=1)[:, None]
    aside = np.cross(along, np.where(np.abs(along[:, 2:]) < 0.9, [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]))
    aside /= np.linalg.norm(aside, axis=1)[:, None]
    angles = np.linspace(0.0, 2.0 * np.pi, sides, endpoint=False)[:, None]
    normals = np.cos(angles) * aside[:, None] + np.sin(angles) * np.cross(along, aside)[:, None]  # (n - 1, sides, 3)
    rings = np.concatenate([points[:-1, None] + radius * normals, points[1:, None] + radius * normals], axis=1)
    here, beside = np.arange(sides), np.roll(np.arange(sides), -1)
    prism = np.vstack(
        [np.column_stack([here, beside, beside + sides]), np.column_stack([here, beside + sides, here + sides])]
    )
    faces = (2 * sides * np.arange(len(along))[:, None, None] + prism).reshape(-1, 3)
    return SmoothMesh(rings.reshape(-1, 3), faces, np.concatenate([normals, normals], axis=1).reshape(-1, 3))


def _plume(radius: float, length: float, rings: int = 14, sides: int = 24) -> SmoothMesh:
    """Return a body of revolution about z that swells a little behind the nozzle and tapers off to a point.

    Args:
        radius: at the nozzle [m].
        length: along z, as a share of the whole flame [1].
        rings: of vertices along z.
        sides: vertices of each ring.
    """
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
    """Scale a node of length 1 along its z to a length [m] at every knot; hide it while it has none.

    Args:
        scene: where the node is.
        path: of the node.
        lengths: at every knot [m], (knots + 1,).
    """
    widths = np.minimum(1.0, lengths / _FULL_WIDTH_LENGTH)
    shown = lengths > 0.0
    scene.set(path, "scale", np.column_stack([widths, widths, lengths]))
    scene.set(path, "visible", shown | np.append(shown[1:], False))  # holds until the next knot

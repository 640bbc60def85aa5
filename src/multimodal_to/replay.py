"""Replay of a `Trajectory`: one page that opens from disk without a network, or a live viewer; both drawn by meshcat.

Links are nested in the scene as they are in the URDF, and keyframes are the knots: between two of them the viewer moves
positions linearly and turns rotations about a fixed axis, so each joint moves linearly and the links stay together.
"""

from __future__ import annotations

import base64
import html
import io
import math
import os
import warnings
from contextlib import redirect_stdout
from dataclasses import dataclass, field
from pathlib import Path
from string import Template
from typing import Any

import numpy as np
import trimesh
import umsgpack
import yourdfpy

from multimodal_to.derived import frame_poses
from multimodal_to.errors import OutputError
from multimodal_to.models.robot import Robot
from multimodal_to.models.terrain import FlatGround
from multimodal_to.ocp.scenario_data import stored
from multimodal_to.terrain_mesh import Patch, patch
from multimodal_to.trajectory import Array, Trajectory

with warnings.catch_warnings():  # meshcat imports a module of pyzmq that says it is deprecated
    warnings.simplefilter("ignore", DeprecationWarning)
    import meshcat
    from meshcat import geometry as shapes
    from meshcat.animation import Animation, AnimationClip, AnimationTrack, js_quaternion

FLAME_LENGTH = 0.45
"""Length of the flame of the robot's strongest jet at its greatest thrust; others in proportion to their thrust [m]."""

ARROW_LENGTH = 1.5
"""Length of the arrow of a contact force as large as the robot's weight [m]."""

SMALLEST_FORCE = 1.0
"""Contact forces below this have no arrow [N]."""

HOLD = 1.0
"""The last pose stands this long before the motion starts again [s]."""

_NOZZLE_RADIUS = 0.033  # of the flame of the strongest jet [m]
_FULL_WIDTH_LENGTH = 0.08  # arrows and flames shorter than this are also thinner [m]
_STILL = 1e-9  # a property that changes less than this needs no keyframes
_GRID_SPACING, _GRID_CELLS = 0.25, 16  # of the ground around the motion, in cells from its middle [m]
_TERRAIN_AROUND = 2.0  # how far terrain is drawn beyond the motion [m]
_CAMERA_DIRECTION = np.array([-0.72, -0.66, 0.22])  # from the middle of the motion: half left of a robot that faces −x
_CAMERA_ZOOM = 1.75
_CAMERA_DISTANCE = 1.55  # per metre of height or width that must be seen
_HEAD_ABOVE_COM = 0.7  # of a standing humanoid, per height of its CoM
_VIEWER = Path(meshcat.__file__).parent / "viewer" / "dist" / "main.min.js"
_TRACK_TYPES = {"position": "vector3", "quaternion": "quaternion", "scale": "vector3", "visible": "boolean"}
_Y_TO_Z = np.array([[1.0, 0, 0, 0], [0, 0, -1, 0], [0, 1, 0, 0], [0, 0, 0, 1]])  # meshcat's cylinders are along y
_OVERHEAD_LIGHT = {  # in three.js's own words: the one light whose shadows are drawn
    "metadata": {"version": 4.5, "type": "Object"},
    "object": {
        "uuid": "overhead-light", "type": "PointLight", "color": 0xFFFFFF, "intensity": 0.5, "distance": 0, "decay": 1,
        "matrix": [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, -0.8, -1.2, 4.0, 1],
        "shadow": {"normalBias": 0.03, "mapSize": [2048, 2048], "radius": 3},
    },
}  # fmt: skip
_PLAIN = (0.8, 0.8, 0.82, 1.0)  # colour of a visual without one


def write_html(robot: Robot, trajectory: Trajectory, path: str | os.PathLike[str]) -> Path:
    """Write one page that plays the motion in a browser, from disk, with networking off.

    Opened with ``#t=2.5`` at its address's end, it stands still at 2.5 s; ``#t=2.5&bare`` hides the panels as well.

    Raises:
        OutputError: the folder does not exist or cannot be written.
    """
    recorder = _Recorder()
    draw(meshcat.Visualizer(window=recorder), robot, trajectory)
    page = _PAGE.substitute(
        scenario=html.escape(trajectory.scenario),
        robot=html.escape(trajectory.robot),
        duration=f"{trajectory.duration:.6f}",
        viewer=_VIEWER.read_text(encoding="utf-8"),
        commands=",\n".join(f'"{base64.b64encode(command).decode("ascii")}"' for command in recorder.commands),
    )
    target = Path(path)
    try:
        target.write_text(page, encoding="utf-8")
    except OSError as error:
        raise OutputError(f"cannot write the replay to '{target}': {error.strerror or error}") from error
    return target


def show(robot: Robot, trajectory: Trajectory) -> meshcat.Visualizer:
    """Start meshcat's server, draw the motion there and return the visualizer; a browser at its `url()` plays it."""
    with redirect_stdout(io.StringIO()):  # meshcat prints the address
        visualizer = meshcat.Visualizer()
    draw(visualizer, robot, trajectory)
    return visualizer


def draw(visualizer: meshcat.Visualizer, robot: Robot, trajectory: Trajectory) -> None:
    """Draw stage, robot, flames, contact forces and CoM, and set the animation that moves them, at true speed."""
    scene = _Scene(visualizer=visualizer, time=trajectory.time - trajectory.time[0])
    urdf = yourdfpy.URDF.load(str(robot.urdf), build_scene_graph=False, load_meshes=False)
    _draw_stage(scene, trajectory)
    paths = _draw_links(scene, robot, trajectory, urdf)
    _draw_flames(scene, robot, trajectory, paths)
    _draw_contact_forces(scene, robot, trajectory)
    _draw_com(scene, trajectory)
    visualizer.set_animation(scene.animation, play=True, repetitions=math.inf)


@dataclass(frozen=True)
class _Command:
    """A command as the viewer reads it, for what meshcat's own classes cannot say."""

    content: dict[str, Any]

    def lower(self) -> dict[str, Any]:
        return self.content


class _Recorder:
    """Stands where meshcat expects its window: keeps each command, packed as the viewer reads it."""

    def __init__(self) -> None:
        self.commands: list[bytes] = []

    def send(self, command: Any) -> None:
        self.commands.append(umsgpack.packb(command.lower()))


@dataclass(frozen=True, kw_only=True)
class _Scene:
    """Where things are drawn, when the knots are [s], and the animation as far as it has been collected."""

    visualizer: meshcat.Visualizer
    time: Array
    animation: Animation = field(default_factory=lambda: Animation(default_framerate=1))

    def add(self, path: str, shape: Any, material: Any, transform: Array) -> None:
        """Put a shape at a fixed place in its parent."""
        self.visualizer[path].set_object(shape, material)
        self.visualizer[path].set_transform(transform)

    def set_shadow(self, path: str, cast: bool) -> None:
        """Let an object cast a shadow or not; meshcat's `set_property` would write the key in small letters."""
        content = {"type": "set_property", "path": f"{path}/<object>", "property": "castShadow", "value": cast}
        self.visualizer.window.send(_Command(content))

    def set(self, path: str, key: str, values: Array) -> None:
        """Give a node its property at every knot, (knots + 1, ...): as keyframes, or once if it never changes."""
        node = self.visualizer[path]
        if np.abs(values.astype(float) - values[0]).max() < _STILL:
            node.set_property(key, values[0].tolist())
            return
        clip = self.animation.clips.setdefault(node.path, AnimationClip(fps=1))  # so that a frame is a second
        times, keys = self.time.tolist(), values.tolist()
        clip.tracks[key] = AnimationTrack(key, _TRACK_TYPES[key], [*times, times[-1] + HOLD], [*keys, keys[-1]])


def _draw_stage(scene: _Scene, trajectory: Trajectory) -> None:
    """Draw background, ground, lights and camera around the motion."""
    visualizer = scene.visualizer
    visualizer["/Background"].set_property("top_color", [0.42, 0.55, 0.70])
    visualizer["/Background"].set_property("bottom_color", [0.90, 0.93, 0.95])
    visualizer["/Grid"].set_property("visible", False)
    visualizer["/Axes"].set_property("visible", False)

    low, high = trajectory.com_position.min(axis=1), trajectory.com_position.max(axis=1)
    extent, top = float((high - low)[:2].max()), float(high[2] + _HEAD_ABOVE_COM * low[2])
    middle = np.array([*(low + high)[:2] / 2, top / 2])
    visualizer.set_transform(_translation(-middle))  # the viewer's camera turns about the origin: put the motion there
    scenario = stored(trajectory)
    surface = scenario.surface if scenario else FlatGround()
    if isinstance(surface, FlatGround):
        ground = np.array([*np.round(middle[:2] / _GRID_SPACING) * _GRID_SPACING, surface.height])
        cells = _GRID_CELLS + math.ceil(extent / 2 / _GRID_SPACING)
        disc, grey = shapes.Cylinder(0.02, 1.6 * cells * _GRID_SPACING), shapes.MeshLambertMaterial(color=0xB4BDC7)
        scene.add("ground/disc", disc, grey, _translation(ground - [0.0, 0.0, 0.012]) @ _Y_TO_Z)
        scene.set_shadow("/meshcat/ground/disc", False)
        faint = shapes.LineBasicMaterial(color=0x7F8B98, opacity=0.45)
        grid = shapes.LineSegments(shapes.PointsGeometry(_grid(cells)), faint)
        scene.add("ground/grid", grid, None, _translation(ground))
    else:
        _draw_terrain(scene, patch(surface, middle[:2], extent / 2 + _TERRAIN_AROUND))

    for light, intensity in (("AmbientLight", 0.6), ("FillLight", 0.2), ("PointLightPositiveX", 0.35)):
        visualizer[f"/Lights/{light}/<object>"].set_property("intensity", intensity)
    visualizer["/Lights/PointLightPositiveX/<object>"].set_property("position", [2.0, 1.5, 1.5])
    visualizer["/Lights/PointLightNegativeX"].set_property("visible", False)
    visualizer.window.send(_Command({"type": "set_object", "path": "/Lights/overhead", "object": _OVERHEAD_LIGHT}))

    distance = _CAMERA_DISTANCE * max(top, extent + top / 2)
    x, y, z = distance * _CAMERA_DIRECTION / np.linalg.norm(_CAMERA_DIRECTION)
    camera = visualizer["/Cameras/default/rotated/<object>"]
    camera.set_property("position", [x, z, -y])  # the camera's axes have y up
    camera.set_property("zoom", _CAMERA_ZOOM)


def _draw_terrain(scene: _Scene, terrain: Patch) -> None:
    """Draw a patch of ground that is not flat, with lines that show its shape."""
    mesh = shapes.TriangularMeshGeometry(terrain.vertices, terrain.faces)
    scene.add("ground/terrain", mesh, shapes.MeshLambertMaterial(color=0xB4BDC7), _translation([0.0, 0.0, -0.002]))
    scene.set_shadow("/meshcat/ground/terrain", False)
    lines = shapes.LineSegments(
        shapes.PointsGeometry(terrain.lines), shapes.LineBasicMaterial(color=0x7F8B98, opacity=0.7)
    )
    scene.add("ground/lines", lines, None, np.eye(4))


def _draw_links(scene: _Scene, robot: Robot, trajectory: Trajectory, urdf: yourdfpy.URDF) -> dict[str, str]:
    """Draw every link that has a shape or a jet, and return the paths of these links in the scene."""
    jet_frames = {jet.frame for jet in robot.jets}
    links = {link.name: link for link in urdf.robot.links if link.visuals or link.name in jet_frames}
    above = {joint.child: joint.parent for joint in urdf.robot.joints}

    def drawn_parent(name: str) -> str | None:
        parent = above.get(name)
        return parent if parent is None or parent in links else drawn_parent(parent)

    def path(name: str) -> str:
        parent = drawn_parent(name)
        return f"robot/{name}" if parent is None else f"{path(parent)}/{name}"

    palette = {material.name: material for material in urdf.robot.materials}
    poses = {name: frame_poses(robot, trajectory, name) for name in links}
    for name, link in links.items():
        parent = drawn_parent(name)
        pose = poses[name] if parent is None else np.linalg.inv(poses[parent]) @ poses[name]
        scene.set(path(name), "position", pose[:, :3, 3])
        scene.set(path(name), "quaternion", _quaternions(pose))
        for index, visual in enumerate(link.visuals):
            shape, transform = _shape(visual.geometry, robot.urdf.parent)
            if shape is not None:
                origin = np.eye(4) if visual.origin is None else visual.origin
                scene.add(f"{path(name)}/visual_{index}", shape, _material(visual, palette), origin @ transform)
    return {name: path(name) for name in links}


def _draw_flames(scene: _Scene, robot: Robot, trajectory: Trajectory, paths: dict[str, str]) -> None:
    """Draw at each jet a flame along +z of its frame, where the exhaust leaves, as long as the thrust is large."""
    strongest = max((jet.thrust_max for jet in robot.jets), default=1.0)
    core = shapes.MeshBasicMaterial(color=0xFFE9A8)
    plume = shapes.MeshBasicMaterial(color=0xFF7A00, opacity=0.42, depthWrite=False)
    for jet, thrust in zip(robot.jets, trajectory.thrust, strict=True):
        path, radius = f"{paths[jet.frame]}/flame", _NOZZLE_RADIUS * math.sqrt(jet.thrust_max / strongest)
        for name, glow, width, length in (("core", core, 0.6 * radius, 0.65), ("plume", plume, radius, 1.0)):
            cone = shapes.Cylinder(length, radiusTop=0.1 * width, radiusBottom=width)
            scene.add(f"{path}/{name}", cone, glow, _translation([0.0, 0.0, length / 2]) @ _Y_TO_Z)
            scene.set_shadow(f"/meshcat/{path}/{name}", False)
        _stretch(scene, path, FLAME_LENGTH * np.maximum(thrust, 0.0) / strongest)


def _draw_contact_forces(scene: _Scene, robot: Robot, trajectory: Trajectory) -> None:
    """Draw each contact force as an arrow that starts at its contact point."""
    colour = shapes.MeshLambertMaterial(color=0x1FA34A, emissive=0x08401B)
    positions, forces = trajectory.per_contact("contact_positions"), trajectory.per_contact("contact_forces")
    for name, position, force in zip(trajectory.contact_names, positions, forces, strict=True):
        path, size = f"contact_forces/{name}", np.linalg.norm(force, axis=0)
        shaft, tip = shapes.Cylinder(0.75, radius=0.006), shapes.Cylinder(0.25, radiusTop=0.0, radiusBottom=0.015)
        scene.add(f"{path}/shaft", shaft, colour, _translation([0.0, 0.0, 0.375]) @ _Y_TO_Z)
        scene.add(f"{path}/tip", tip, colour, _translation([0.0, 0.0, 0.875]) @ _Y_TO_Z)
        scene.set(path, "position", position.T)
        scene.set(path, "quaternion", _turns_from_z(force.T))
        _stretch(scene, path, ARROW_LENGTH * np.where(size < SMALLEST_FORCE, 0.0, size) / robot.weight)


def _draw_com(scene: _Scene, trajectory: Trajectory) -> None:
    """Draw the CoM as a sphere that is seen through the robot, and its way as a line."""
    seen_through = shapes.MeshBasicMaterial(color=0x2B6CE0, opacity=0.85, transparent=True, depthTest=False)
    scene.add("com/sphere", shapes.Sphere(0.018), seen_through, np.eye(4))
    scene.set_shadow("/meshcat/com/sphere", False)
    scene.set("com", "position", trajectory.com_position.T)
    way = shapes.Line(shapes.PointsGeometry(trajectory.com_position), shapes.LineBasicMaterial(color=0x2B6CE0))
    scene.add("com_trace", way, None, np.eye(4))


def _stretch(scene: _Scene, path: str, lengths: Array) -> None:
    """Scale a node of length 1 along its z to a length [m] at every knot; hide it while it has none."""
    widths = np.minimum(1.0, lengths / _FULL_WIDTH_LENGTH)
    shown = lengths > 0.0
    scene.set(path, "scale", np.column_stack([widths, widths, lengths]))
    scene.set(path, "visible", shown | np.append(shown[1:], False))  # holds until the next knot


def _shape(geometry: yourdfpy.urdf.Geometry, folder: Path) -> tuple[Any, Array]:
    """Return meshcat's geometry for one of the URDF, and how it must be turned; None for a mesh that is missing."""
    if geometry.box is not None:
        return shapes.Box([float(length) for length in geometry.box.size]), np.eye(4)
    if geometry.cylinder is not None:
        return shapes.Cylinder(float(geometry.cylinder.length), float(geometry.cylinder.radius)), _Y_TO_Z
    if geometry.sphere is not None:
        return shapes.Sphere(float(geometry.sphere.radius)), np.eye(4)
    file = Path(yourdfpy.urdf.filename_handler_magic(geometry.mesh.filename, dir=str(folder)))
    if not file.is_file():
        return None, np.eye(4)
    mesh = trimesh.load_mesh(file)
    scale = np.ones(3) if geometry.mesh.scale is None else np.broadcast_to(geometry.mesh.scale, 3)
    return shapes.TriangularMeshGeometry(mesh.vertices * scale, mesh.faces), np.eye(4)


def _material(visual: yourdfpy.urdf.Visual, palette: dict[str, Any]) -> Any:
    """Return the colour of a visual: its own, or the robot's of that name."""
    material = visual.material
    if material is not None and material.color is None:
        material = palette.get(material.name)
    rgba = _PLAIN if material is None or material.color is None else material.color.rgba
    red, green, blue = (round(255 * float(part)) for part in rgba[:3])
    return shapes.MeshPhongMaterial(
        color=red << 16 | green << 8 | blue, opacity=float(rgba[3]), specular=0x222222, shininess=25
    )


def _translation(offset: Any) -> Array:
    transform: Array = np.eye(4)
    transform[:3, 3] = offset
    return transform


def _quaternions(poses: Array) -> Array:
    """Return the rotations of poses (n, 4, 4) as quaternions x y z w (n, 4) without jumps of sign."""
    quaternions = np.array([js_quaternion(pose) for pose in poses])
    turned_back = (quaternions[1:] * quaternions[:-1]).sum(axis=1) < 0.0
    quaternions[1:][np.cumsum(turned_back) % 2 == 1] *= -1.0
    return quaternions


def _turns_from_z(vectors: Array) -> Array:
    """Return the smallest rotations (n, 4), x y z w, that turn +z to vectors (n, 3); none for a vector without length.

    q = (e_z × v, |v| + e_z · v) / ‖·‖, and half a turn about x for a vector that points straight down.
    """
    size = np.linalg.norm(vectors, axis=1)
    x, y, z = vectors.T
    quaternions = np.column_stack([-y, x, np.zeros_like(x), size + z])
    norms = np.linalg.norm(quaternions, axis=1)
    quaternions[norms <= 1e-9 * size] = [1.0, 0.0, 0.0, 0.0]
    quaternions[size < SMALLEST_FORCE] = [0.0, 0.0, 0.0, 1.0]
    return np.asarray(quaternions / np.linalg.norm(quaternions, axis=1, keepdims=True))


def _grid(cells: int) -> Array:
    """Return the end points (3, 4 (2 cells + 1)) of the lines of a square grid at z = 0, in pairs."""
    half = cells * _GRID_SPACING
    steps = np.linspace(-half, half, 2 * cells + 1)
    along_x = np.array([[[-half, step, 0.0], [half, step, 0.0]] for step in steps])
    return np.concatenate([along_x, along_x[:, :, [1, 0, 2]]]).reshape(-1, 3).T


_PAGE = Template("""<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>$scenario · $robot</title>
<link rel="icon" href="data:,">
<style>
  body { margin: 0; font: 14px/1.5 system-ui, sans-serif; color: #1c2733; }
  #meshcat-pane { width: 100vw; height: 100vh; overflow: hidden; }
  .panel { position: absolute; padding: 8px 14px; border-radius: 8px; background: rgba(255, 255, 255, 0.78); }
  #caption { left: 16px; top: 16px; max-width: 26em; }
  #caption h1 { margin: 0; font-size: 18px; }
  #caption .key { display: inline-block; width: 11px; height: 11px; border-radius: 6px; margin-right: 6px; }
  #player { left: 16px; right: 16px; bottom: 16px; display: flex; gap: 14px; align-items: center; }
  #player input { flex: 1; }
  #player output { min-width: 8em; text-align: right; font-variant-numeric: tabular-nums; }
</style>
</head>
<body>
<div id="meshcat-pane"></div>
<div id="caption" class="panel">
  <h1>$scenario · $robot</h1>
  <div><span class="key" style="background: #ff7a1a"></span>flame: thrust of a jet</div>
  <div><span class="key" style="background: #1fa34a"></span>arrow: contact force</div>
  <div><span class="key" style="background: #2b6ce0"></span>sphere and line: centre of mass</div>
  <div>Drag to turn, scroll to zoom.</div>
</div>
<div id="player" class="panel">
  <button id="toggle" type="button">Pause</button>
  <input id="time" type="range" min="0" max="$duration" step="0.001" value="0" aria-label="time">
  <output id="clock"></output>
</div>
<script>
$viewer
</script>
<script>
const commands = [
$commands
];
const duration = $duration;
const [toggle, slider, clock] = ["toggle", "time", "clock"].map(id => document.getElementById(id));
try {
  var viewer = new MeshCat.Viewer(document.getElementById("meshcat-pane"));
  for (const command of commands) {
    viewer.handle_command_bytearray(Uint8Array.from(atob(command), letter => letter.charCodeAt(0)));
  }
  toggle.onclick = () => viewer.animator.playing ? viewer.animator.pause() : viewer.animator.play();
  slider.oninput = () => { viewer.animator.pause(); viewer.animator.seek(Number(slider.value)); };
  const update = () => {
    const time = viewer.animator.playing ? Math.min(viewer.animator.time, duration) : Number(slider.value);
    slider.value = time;
    clock.textContent = time.toFixed(2) + " / " + duration.toFixed(2) + " s";
    toggle.textContent = viewer.animator.playing ? "Pause" : "Play";
    requestAnimationFrame(update);
  };
  const asked = new URLSearchParams(location.hash.slice(1));
  if (asked.has("t")) { slider.value = asked.get("t"); slider.oninput(); }
  if (asked.has("bare")) { document.querySelectorAll(".panel, .dg").forEach(panel => panel.remove()); }
  update();
} catch (error) {
  document.getElementById("caption").append("This page needs a browser with WebGL: " + error.message);
}
</script>
</body>
</html>
""")

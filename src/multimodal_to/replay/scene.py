"""The scene that meshcat draws: nodes in a tree, their properties at the knots, and geometry by three.js."""

from __future__ import annotations

import re
import warnings
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import umsgpack

from multimodal_to.adam.spatial import Array

with warnings.catch_warnings():  # meshcat imports a module of pyzmq that says it is deprecated
    warnings.simplefilter("ignore", DeprecationWarning)
    import meshcat
    from meshcat import geometry as shapes
    from meshcat.animation import Animation, AnimationClip, AnimationTrack, js_quaternion

__all__ = [
    "HOLD",
    "Y_TO_Z",
    "Command",
    "Recorder",
    "Scene",
    "SmoothMesh",
    "meshcat",
    "quaternions",
    "segment",
    "shapes",
    "translation",
    "turns_from_z",
]

HOLD = 1.0
"""The last pose stands this long before the motion starts again [s]."""

_PART = re.compile(r"flame(_[0-9]+)?|(visual|.*_mesh)_[0-9]+(_[0-9]+)?|<object>", re.DOTALL)
_STILL = 1e-9  # a property that changes less than this needs no keyframes
_TRACK_TYPES = {
    "position": "vector3",
    "quaternion": "quaternion",
    "scale": "vector3",
    "visible": "boolean",
    "material.opacity": "number",
}
Y_TO_Z = np.array([[1.0, 0, 0, 0], [0, 0, -1, 0], [0, 1, 0, 0], [0, 0, 0, 1]])
"""Turns meshcat's cylinders, which are along y, to z."""


class SmoothMesh(shapes.Geometry):  # type: ignore[misc]
    """Triangles with a normal at each vertex, which meshcat's own class has not."""

    def __init__(self, vertices: Array, faces: np.ndarray, normals: Array) -> None:
        super().__init__()
        self._vertices, self._faces, self._normals = vertices, faces, normals

    def lower(self, object_data: Any) -> dict[str, Any]:
        """Return the geometry in three.js's words.

        Normals are whole numbers of 8 bits, which three.js takes for numbers from −1 to 1.
        """
        position = shapes.pack_numpy_array(np.float32(self._vertices.T))
        whole = np.round(np.clip(self._normals, -1.0, 1.0) * 127.0).astype(np.int8)
        normal = shapes.pack_numpy_array(whole.view(np.uint8).T) | {"type": "Int8Array", "normalized": True}
        index = shapes.pack_numpy_array(np.uint32(self._faces.T))
        attributes = {"position": position, "normal": normal}
        return {"uuid": self.uuid, "type": "BufferGeometry", "data": {"attributes": attributes, "index": index}}


@dataclass(frozen=True, kw_only=True)
class Command:
    """A command as the viewer reads it, for what meshcat's own classes cannot say."""

    content: dict[str, Any]

    def lower(self) -> dict[str, Any]:
        """Return the command as it is."""
        return self.content


class Recorder:
    """Stands where meshcat expects its window: keeps each command, packed as the viewer reads it."""

    def __init__(self) -> None:
        self.commands: list[bytes] = []

    def send(self, command: Any) -> None:
        """Keep a command."""
        self.commands.append(umsgpack.packb(command.lower()))


@dataclass(frozen=True, kw_only=True)
class Scene:
    """Where things are drawn, when the knots are [s], and the animation as far as it has been collected."""

    visualizer: meshcat.Visualizer
    time: Array
    animation: Animation = field(default_factory=lambda: Animation(default_framerate=1))

    def add(self, path: str, shape: Any, material: Any, transform: Array, *, shadow: bool = True) -> None:
        """Put a shape at a fixed place in its parent.

        Args:
            path: of the new node in the scene.
            shape: meshcat's geometry, or an object that needs no material.
            material: meshcat's; None for such an object.
            transform: of the shape in its parent node, (4, 4) [m].
            shadow: let it cast one.
        """
        self.visualizer[path].set_object(shape, material)
        self.visualizer[path].set_transform(transform)
        if not shadow:  # meshcat's `set_property` would write the key in small letters
            where = f"{self.visualizer[path].path.lower()}/<object>"
            content = {"type": "set_property", "path": where, "property": "castShadow", "value": False}
            self.visualizer.window.send(Command(content=content))

    def set(self, path: str, key: str, values: np.ndarray) -> None:
        """Give a node its property at every knot, (knots + 1, ...): as keyframes, or once if it never changes.

        Args:
            path: of the node in the scene.
            key: name of the property, one of `_TRACK_TYPES`.
            values: of the property at every knot, (knots + 1, ...).
        """
        node = self.visualizer[path]
        if np.abs(values.astype(float) - values[0]).max() < _STILL:
            node.set_property(key, values[0].tolist())
            return
        self.move(path, key, values)

    def move(self, path: str, key: str, values: np.ndarray) -> None:
        """Give a node keyframes of a property at every knot, (knots + 1, ...).

        Args:
            path: of the node in the scene; empty for its root.
            key: name of the property, one of `_TRACK_TYPES`.
            values: of the property at every knot, (knots + 1, ...).
        """
        node = self.visualizer[path] if path else self.visualizer
        clip = self.animation.clips.setdefault(node.path, AnimationClip(fps=1))  # a frame is a second
        times, keys = self.time.tolist(), values.tolist()
        clip.tracks[key] = AnimationTrack(key, _TRACK_TYPES[key], [*times, times[-1] + HOLD], [*keys, keys[-1]])


def translation(offset: Any) -> Array:
    """Return the (4, 4) transform that moves by an offset."""
    transform: Array = np.eye(4)
    transform[:3, 3] = offset
    return transform


def segment(name: str) -> str:
    """Return a link's or frame's name as one segment of a path: no two are the same, and none is that of a part of one.

    A segment holds no slash. Parts of a link are its flame and its visuals.
    """
    safe = name.replace("%", "%25").replace("/", "%2F")
    return f"%{safe}" if _PART.fullmatch(name) else safe


def quaternions(poses: Array) -> Array:
    """Return the rotations of poses (n, 4, 4) as quaternions x y z w (n, 4) without jumps of sign."""
    found = np.array([js_quaternion(pose) for pose in poses])
    turned_back = (found[1:] * found[:-1]).sum(axis=1) < 0.0
    found[1:][np.cumsum(turned_back) % 2 == 1] *= -1.0
    return found


def turns_from_z(vectors: Array, smallest: float) -> Array:
    """Return the smallest rotations (n, 4), x y z w, that turn +z to vectors (n, 3); none for a shorter vector.

    q = (e_z × v, |v| + e_z · v) / ‖·‖, and half a turn about x for a vector that points straight down.
    """
    size = np.linalg.norm(vectors, axis=1)
    x, y, z = vectors.T
    turns = np.column_stack([-y, x, np.zeros_like(x), size + z])
    norms = np.linalg.norm(turns, axis=1)
    turns[norms <= 1e-9 * size] = [1.0, 0.0, 0.0, 0.0]
    turns[size < smallest] = [0.0, 0.0, 0.0, 1.0]
    return np.asarray(turns / np.linalg.norm(turns, axis=1, keepdims=True))

"""What stands around a motion: background, ground, lights, and the camera that sees all of it."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import trimesh

from multimodal_to.adam.spatial import Array
from multimodal_to.models.terrain import FlatGround, Surface
from multimodal_to.models.terrain_mesh import patch
from multimodal_to.replay.scene import Y_TO_Z, Command, Scene, SmoothMesh, shapes, translation

_GRID_SPACING, _GRID_CELLS = 0.25, 16  # of the ground around the motion, in cells from its middle [m]
_TERRAIN_AROUND = 2.0  # how far terrain is drawn beyond what is seen at once [m]
_GROUND_COLOUR, _STEEP_COLOUR, _LINE_COLOUR = 0xB9C1CA, 0x8793A1, 0x7F8B98
_STEEP = math.cos(math.radians(30.0))  # ground whose normal's z is less, as the riser of a step, has its own colour
_FIELD = math.tan(math.radians(37.5))  # half the height that the viewer's camera sees, per metre of distance, zoom 1
_MARGIN = 1.1  # of what is seen over what must be


@dataclass(frozen=True, kw_only=True, eq=False)
class View:
    """What the camera has to see: a box that stands on the ground, from a direction."""

    middle: Array  # of the box, in the world [m], (3,)
    width: float  # [m]
    height: float  # [m]
    depth: float  # towards the camera [m]
    direction: Array  # from the middle to the camera, (3,)
    aspect: float = 1.0  # width over height of the picture
    zoom: float = 1.75  # the more, the farther off the camera stands

    @property
    def distance(self) -> float:
        """Return how far from the middle the camera stands [m]."""
        return _MARGIN * self.zoom * max(self.height, self.width / self.aspect) / (2.0 * _FIELD) + self.depth / 2.0


def draw_stage(scene: Scene, view: View, surface: Surface, reach: float = 0.0) -> None:
    """Draw background, ground, lights and camera; the view's middle becomes the origin that the camera turns about.

    Args:
        scene: where to draw.
        view: what the camera has to see.
        surface: the ground.
        reach: how far the ground goes on beyond what is seen at once [m], for a camera that follows.
    """
    visualizer = scene.visualizer
    visualizer["/Background"].set_property("top_color", [0.55, 0.64, 0.74])
    visualizer["/Background"].set_property("bottom_color", [0.93, 0.95, 0.96])
    visualizer["/Grid"].set_property("visible", False)
    visualizer["/Axes"].set_property("visible", False)
    visualizer.set_property("position", (-view.middle).tolist())
    _draw_ground(scene, view, surface, reach)
    _draw_lights(scene, view)
    x, y, z = view.distance * view.direction / np.linalg.norm(view.direction)
    camera = visualizer["/Cameras/default/rotated/<object>"]
    camera.set_property("position", [x, z, -y])  # the camera's axes have y up
    camera.set_property("zoom", view.zoom)


def _draw_ground(scene: Scene, view: View, surface: Surface, reach: float) -> None:
    """Draw the ground: a disc with a grid where it is flat, else a patch of it with lines that show its shape.

    Args:
        scene: where to draw.
        view: what the camera has to see.
        surface: the ground.
        reach: how far it goes on beyond what is seen at once [m].
    """
    if not isinstance(surface, FlatGround):
        terrain = patch(surface, view.middle[:2], view.width / 2 + reach + _TERRAIN_AROUND)
        one, two, three = (terrain.vertices[terrain.faces[:, corner]] for corner in range(3))
        up = np.cross(two - one, three - one)
        steep = up[:, 2] < _STEEP * np.linalg.norm(up, axis=1)
        for name, faces, colour in (
            ("terrain", terrain.faces[~steep], _GROUND_COLOUR),
            ("steep_terrain", terrain.faces[steep], _STEEP_COLOUR),
        ):
            part = trimesh.Trimesh(terrain.vertices, faces)  # drops the vertices that it does not use
            if len(part.faces):
                mesh = SmoothMesh(np.asarray(part.vertices), np.asarray(part.faces), np.asarray(part.vertex_normals))
                grey = shapes.MeshLambertMaterial(color=colour)
                scene.add(f"ground/{name}", mesh, grey, translation([0.0, 0.0, -0.002]), shadow=False)
        lines = shapes.LineBasicMaterial(color=_LINE_COLOUR, opacity=0.7)
        scene.add("ground/lines", shapes.LineSegments(shapes.PointsGeometry(terrain.lines), lines), None, np.eye(4))
        return
    place = np.array([*np.round(view.middle[:2] / _GRID_SPACING) * _GRID_SPACING, surface.height])
    cells = _GRID_CELLS + math.ceil((view.width / 2 + reach) / _GRID_SPACING)
    disc, grey = shapes.Cylinder(0.02, 1.6 * cells * _GRID_SPACING), shapes.MeshLambertMaterial(color=_GROUND_COLOUR)
    scene.add("ground/disc", disc, grey, translation(place - [0.0, 0.0, 0.012]) @ Y_TO_Z, shadow=False)
    faint = shapes.LineBasicMaterial(color=_LINE_COLOUR, opacity=0.35)
    scene.add("ground/grid", shapes.LineSegments(shapes.PointsGeometry(_grid(cells)), faint), None, translation(place))


def _draw_lights(scene: Scene, view: View) -> None:
    visualizer = scene.visualizer
    for light, intensity in (("AmbientLight", 0.5), ("FillLight", 0.15), ("PointLightPositiveX", 0.3)):
        visualizer[f"/Lights/{light}/<object>"].set_property("intensity", intensity)
    visualizer["/Lights/PointLightPositiveX/<object>"].set_property("position", [2.0, 1.5, 1.5])
    visualizer["/Lights/PointLightNegativeX"].set_property("visible", False)
    overhead = _overhead_light(max(view.width, view.height))
    command = {"type": "set_object", "path": "/Lights/overhead", "object": overhead}
    visualizer.window.send(Command(content=command))


def _overhead_light(reach: float) -> dict[str, Any]:
    """Return in three.js's own words the one light that casts shadows, over all within `reach` [m] of the middle."""
    edges = {"left": -reach, "right": reach, "top": reach, "bottom": -reach, "near": 0.1, "far": 12.0 + 4.0 * reach}
    camera = {"uuid": "overhead-camera", "type": "OrthographicCamera", "zoom": 1, **edges}
    place = np.array([-0.2, -0.3, 1.0]) * (4.0 + reach)
    return {
        "metadata": {"version": 4.5, "type": "Object"},
        "object": {
            "uuid": "overhead-light",
            "type": "DirectionalLight",
            "color": 0xFFFFFF,
            "intensity": 0.42,
            "matrix": translation(place).T.ravel().tolist(),
            "shadow": {"normalBias": 0.02, "mapSize": [2048, 2048], "radius": 3, "camera": camera},
        },
    }


def _grid(cells: int) -> Array:
    """Return the end points (3, 8 cells (2 cells + 1)) of the edges of a square grid at z = 0, in pairs.

    Edge by edge, since a line that reaches behind the camera is not drawn everywhere.
    """
    steps = _GRID_SPACING * np.arange(-cells, cells + 1)
    along, across = (grid.ravel() for grid in np.meshgrid(steps[:-1], steps, indexing="ij"))
    along_x = np.array([[along, across], [along + _GRID_SPACING, across]]).transpose(2, 0, 1).reshape(-1, 2)
    ends = np.vstack([along_x, along_x[:, ::-1]])
    return np.column_stack([ends, np.zeros(len(ends))]).T

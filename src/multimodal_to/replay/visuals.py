"""What a robot looks like: the visuals of its URDF, or the meshes of another package in which they are dressed."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from multimodal_to.adam.spatial import Array
from multimodal_to.adam.urdf import parse_urdf
from multimodal_to.errors import MultimodalError, listed
from multimodal_to.replay.dress import Dress, read_dress
from multimodal_to.replay.meshes import MeshWarning, Part, load_parts, simplified
from multimodal_to.values import Value

FACES = 80_000
"""Triangles of all meshes of a robot together; those of heavier robots are thinned out to about as many."""

PLAIN = (0.8, 0.8, 0.82, 1.0)
"""Colour of a visual without one."""

_NAMED = 3  # so many meshes that cannot be drawn are named in the warning


@dataclass(frozen=True, kw_only=True, eq=False)
class Visual(Value):
    """One shape of a link: a primitive of the URDF, or triangles."""

    link: str
    name: str
    transform: Array  # link_H_visual, (4, 4)
    rgba: tuple[float, ...]
    primitive: Any = None  # the URDF's box, cylinder or sphere, as `parse_urdf` has it
    part: Part | None = None


@dataclass(frozen=True, kw_only=True)
class Appearance:
    """The visuals of a robot, and whose work the meshes among them are."""

    visuals: tuple[Visual, ...]
    attribution: str  # empty where none is owed


def appearance(urdf: Path, *, meshes: bool = True) -> Appearance:
    """Return the visuals of a robot's URDF, dressed as the `dress.toml` beside it says if its package is installed.

    Meshes that cannot be drawn are named in one `MeshWarning`, and the collision shapes of their links stand in for
    them. Without `meshes` there are only primitives.
    """
    robot = parse_urdf(urdf, collisions=True)
    dress = read_dress(urdf.parent) if meshes else None
    problems: dict[str, str] = {}
    palette = _palette(robot)
    found = []
    replaced = []
    for link in robot.links:
        own = [visual for visual in link.visuals if dress is None or not dress.replaces(link.name, visual.name)]
        shapes = [
            _shapes(link.name, f"visual_{index}", visual, urdf, palette, problems, meshes)
            for index, visual in enumerate(own)
        ]
        found += [shape for drawn in shapes for shape in drawn]
        missing = [visual for visual, drawn in zip(own, shapes, strict=True) if not drawn]
        if missing and (stand_ins := _stand_ins(link, missing[0], urdf, palette, meshes)):
            found += stand_ins
            replaced.append(link.name)
    if dress is not None:
        found += _dressed(dress, robot, problems)
    _warn(problems, replaced)
    return Appearance(visuals=tuple(_thinned(found)), attribution=dress.attribution if dress else "")


def _shapes(
    link: str, name: str, visual: Any, urdf: Path, palette: Mapping[str, Any], problems: dict[str, str], meshes: bool
) -> list[Visual]:
    """Return the shapes of one <visual>: none for a mesh that cannot be drawn.

    Args:
        link: name of the link that has the visual.
        name: of the visual in the scene.
        visual: as `parse_urdf` has it.
        urdf: the file, from which paths of meshes are relative.
        palette: materials of the robot by name.
        problems: takes why a mesh cannot be drawn, by its address.
        meshes: look for meshes at all.
    """
    origin = np.eye(4) if visual.origin is None else visual.origin
    stated = _stated_colour(visual, palette)
    mesh = visual.geometry.mesh
    if mesh is None:
        return [Visual(link=link, name=name, transform=origin, rgba=stated or PLAIN, primitive=visual.geometry)]
    if not meshes:
        return []
    scale = np.ones(3) if mesh.scale is None else np.broadcast_to(np.asarray(mesh.scale, dtype=float), 3)
    try:
        parts = load_parts(mesh.filename, urdf, scale)
    except MultimodalError as error:
        problems[mesh.filename] = str(error)
        return []
    return [
        Visual(
            link=link,
            name=name if len(parts) == 1 else f"{name}_{index}",
            transform=origin,
            rgba=stated or part.rgba or PLAIN,
            part=part,
        )
        for index, part in enumerate(parts)
    ]


def _stand_ins(link: Any, visual: Any, urdf: Path, palette: Mapping[str, Any], meshes: bool) -> list[Visual]:
    """Return the collision shapes of a link, in the colour that is stated for a visual of it that cannot be drawn.

    Args:
        link: as `parse_urdf` has it.
        visual: that cannot be drawn.
        urdf: the file, from which paths of meshes are relative.
        palette: materials of the robot by name.
        meshes: look for meshes at all.
    """
    found = []
    for index, collision in enumerate(link.collisions, start=len(link.visuals)):
        collision.material = visual.material
        found += _shapes(link.name, f"visual_{index}", collision, urdf, palette, {}, meshes)
    return found


def _palette(robot: Any) -> dict[str, Any]:
    """Return the materials of a URDF that have a colour, by name: the robot's own, then those defined in a visual.

    Where visuals define one name differently, that of the link whose name comes first holds, whatever their order.
    """
    inner = [
        visual.material
        for link in sorted(robot.links, key=lambda link: str(link.name))
        for visual in link.visuals
        if visual.material is not None
    ]
    materials = [entry for entry in (*robot.materials, *inner) if entry.color is not None and entry.name]
    return {entry.name: entry for entry in reversed(materials)}


def _stated_colour(visual: Any, palette: Mapping[str, Any]) -> tuple[float, ...] | None:
    """Return the colour that a URDF gives a visual: its own, or the robot's of that name."""
    material = visual.material
    if material is not None and material.color is None:
        material = palette.get(material.name)
    if material is None or material.color is None:
        return None
    red, green, blue, opacity = np.clip([*material.color.rgba, 1.0][:4], 0.0, 1.0).tolist()
    return red, green, blue, opacity


def _dressed(dress: Dress, robot: Any, problems: dict[str, str]) -> list[Visual]:
    """Return the meshes of the other model as visuals of this robot's links.

    Args:
        dress: which visuals of the other model go where.
        robot: this one, as `parse_urdf` has it.
        problems: takes why a mesh cannot be drawn, by its address.
    """
    other = parse_urdf(dress.urdf)
    links, palette = {link.name: link for link in other.links}, _palette(other)
    found = []
    for garment, placement in zip(dress.garments, dress.placements(robot, other), strict=True):
        for index, visual in enumerate(links[garment.source].visuals):
            name = f"{garment.source}_mesh_{index}"
            for shape in _shapes(garment.link, name, visual, dress.urdf, palette, problems, True):
                colour = garment.rgba or shape.rgba
                found.append(replace(shape, transform=placement @ shape.transform, rgba=colour))
    return found


def _thinned(visuals: list[Visual]) -> list[Visual]:
    parts = iter(simplified([visual.part for visual in visuals if visual.part is not None], FACES))
    return [visual if visual.part is None else replace(visual, part=next(parts)) for visual in visuals]


def _warn(problems: Mapping[str, str], replaced: Sequence[str]) -> None:
    """Warn of meshes that cannot be drawn, by their address, and say on which links collision shapes stand in."""
    if problems:
        named = "; ".join(f"'{uri}': {problem}" for uri, problem in list(problems.items())[:_NAMED])
        more = f"; and {len(problems) - _NAMED} more" if len(problems) > _NAMED else ""
        count = "1 mesh is" if len(problems) == 1 else f"{len(problems)} meshes are"
        links = ("" if len(replaced) == 1 else "s") + f" {listed(replaced)}"
        stand_in = f"; the collision shapes of the link{links} stand in" if replaced else ""
        warnings.warn(f"{count} not drawn: {named}{more}{stand_in}", MeshWarning, stacklevel=2)

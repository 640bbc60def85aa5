"""Collada files that are valid and that `pycollada` drops parts of: put in the form whose every triangle it reads.

It drops a shape whose material cannot be made, as one with a texture whose image is not declared, and it knows neither
strips nor fans. Without a scene it finds nothing to show.
"""

from __future__ import annotations

import copy
import io
from typing import Any

import numpy as np
from lxml import etree

_STRIPS = ("tristrips", "trifans")
_MATERIAL = ("asset", "library_images", "library_effects", "library_materials")
"""What materials are made of, in the order of the schema."""


def mended(content: bytes) -> bytes:
    """Return the file with all shapes that it has: without materials that cannot be made, strips as triangles.

    A file in which nothing has to change is returned as it is.
    """
    root = etree.fromstring(
        content, etree.XMLParser(resolve_entities=False, load_dtd=False, no_network=True, huge_tree=True)
    )
    space = f"{{{etree.QName(root).namespace}}}" if etree.QName(root).namespace else ""
    changes = [_triangulate(root, space), _set_scene(root, space), _drop_materials(root, space)]
    return etree.tostring(root, encoding="utf-8", xml_declaration=True) if any(changes) else content


def _triangulate(root: Any, space: str) -> bool:
    """Turn strips and fans into triangles; return whether there were any."""
    found = [element for tag in _STRIPS for element in root.iter(f"{space}{tag}")]
    for element in found:
        stride = 1 + max(int(entry.get("offset", 0)) for entry in element.iterchildren(f"{space}input"))
        triangles = []
        for path in element.iterchildren(f"{space}p"):
            corners = np.array((path.text or "").split(), dtype=np.int64).reshape(-1, stride)
            triangles += _fan(corners) if element.tag.endswith("trifans") else _strip(corners)
            element.remove(path)
        element.tag, path = f"{space}triangles", etree.SubElement(element, f"{space}p")
        element.set("count", str(len(triangles)))
        path.text = " ".join(str(index) for triangle in triangles for index in triangle.ravel())
    return bool(found)


def _strip(corners: Any) -> list[Any]:
    """Return the triangles of a strip, all seen from the same side: every second one is turned over."""
    turned = ([0, 1, 2], [1, 0, 2])
    return [corners[first : first + 3][turned[first % 2]] for first in range(len(corners) - 2)]


def _fan(corners: Any) -> list[Any]:
    return [corners[[0, last - 1, last]] for last in range(2, len(corners))]


def _set_scene(root: Any, space: str) -> bool:
    """Show every geometry as it stands where the file has none that it says to show; return whether it had none."""
    if root.find(f"{space}scene/{space}instance_visual_scene") is not None:
        return False
    scenes = etree.SubElement(root, f"{space}library_visual_scenes")
    scene = etree.SubElement(scenes, f"{space}visual_scene", id="every-geometry")
    for geometry in root.iter(f"{space}geometry"):
        node = etree.SubElement(scene, f"{space}node", id=f"every-{geometry.get('id')}")
        etree.SubElement(node, f"{space}instance_geometry", url=f"#{geometry.get('id')}")
    for stated in root.findall(f"{space}scene"):
        root.remove(stated)
    etree.SubElement(etree.SubElement(root, f"{space}scene"), f"{space}instance_visual_scene", url="#every-geometry")
    return True


def _drop_materials(root: Any, space: str) -> bool:
    """Take materials that cannot be made off the shapes that name them, which keep no colour; return if there are any.

    Whether one can be made, pycollada says.
    """
    import collada

    uses = [*root.iter(f"{space}instance_material")]
    if not uses:
        return False
    alone = etree.Element(root.tag, attrib=dict(root.attrib), nsmap=root.nsmap)
    alone.extend(copy.deepcopy(child) for tag in _MATERIAL for child in root.findall(f"{space}{tag}"))
    made = collada.Collada(io.BytesIO(etree.tostring(alone)), ignore=[collada.common.DaeError])
    known = {f"#{material.id}" for material in made.materials}
    broken = [use for use in uses if use.get("target") not in known]
    for use in broken:
        use.getparent().remove(use)
    return bool(broken)

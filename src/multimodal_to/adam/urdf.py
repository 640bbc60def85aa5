"""The URDF reader: `yourdfpy` parses, this file checks and hands over links and joints."""

from __future__ import annotations

import io
import logging
import os
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import yourdfpy
from lxml import etree

from multimodal_to.adam.lean_tree import build_tree
from multimodal_to.adam.tree import Joint, Link, Mimic, Tree
from multimodal_to.errors import ModelError

_MOVING = ("revolute", "continuous", "prismatic")
_SUPPORTED = (*_MOVING, "fixed")
_NO_DIRECTION = 1e-6
"""An axis shorter than this says nothing."""
_UNIT = 1e-6
"""An axis whose length differs from 1 by less than this was meant as a unit one."""


def load_tree(
    urdf: str | os.PathLike[str],
    joint_names: Sequence[str] | None = None,
    locked: Mapping[str, float] | None = None,
) -> Tree:
    """Read a URDF into a `Tree`.

    Args:
        urdf: a path, or the XML text itself.
        joint_names: the joints that move, in the order of s; by default all that can, in the order of the file.
        locked: positions [rad or m] of joints that can move but are not in `joint_names`; zero where not given.

    Raises:
        ModelError: the file is missing or no URDF, or it describes something that no robot can have.
    """
    links, joints = read_urdf(urdf)
    if isinstance(joint_names, str):
        raise ModelError(f"the joints that move are given as the text '{joint_names}'; expected a list of names")
    if joint_names is None:
        joint_names = [joint.name for joint in joints if joint.kind != "fixed" and joint.name not in (locked or {})]
    return build_tree(links, joints, joint_names, locked)


def read_urdf(urdf: str | os.PathLike[str]) -> tuple[list[Link], list[Joint]]:
    """Return the links and joints of a URDF (a path, or the XML text itself), checked one by one."""
    robot = _parse(urdf)
    _refuse_duplicates("link", (link.name for link in robot.links))
    _refuse_duplicates("joint", (joint.name for joint in robot.joints))
    if not robot.links:
        raise ModelError("the URDF holds no links")
    return [_link(link) for link in robot.links], [_joint(joint) for joint in robot.joints]


def _parse(urdf: str | os.PathLike[str]) -> Any:
    text, source = _read(urdf)
    try:
        # Entities are not expanded and nothing is fetched: a URDF from elsewhere is only text.
        root = etree.fromstring(text, etree.XMLParser(resolve_entities=False, no_network=True, remove_comments=True))
    except (etree.XMLSyntaxError, ValueError) as error:
        raise ModelError(f"{source} is not valid XML: {error}") from error
    if root.getroottree().docinfo.internalDTD is not None:
        raise ModelError(f"{source} declares a document type; entities are not read")
    if root.tag != "robot":
        raise ModelError(f"{source} is no URDF: its root element is <{root.tag}>, expected <robot>")
    if root.get("name") is None:
        root.set("name", "robot")
    _refuse_missing(root, source)
    _refuse_non_numbers(root, source)
    logger = logging.getLogger("yourdfpy")
    level = logger.level
    logger.setLevel(logging.CRITICAL)  # it logs what is reported here
    try:
        return yourdfpy.URDF.load(
            io.BytesIO(etree.tostring(root)), build_scene_graph=False, load_meshes=False,
            build_collision_scene_graph=False, load_collision_meshes=False,
        ).robot  # fmt: skip
    except Exception as error:  # yourdfpy raises whatever its parsing runs into
        raise ModelError(f"{source} is no URDF that can be read: {error!r}") from error
    finally:
        logger.setLevel(level)


def _read(urdf: str | os.PathLike[str]) -> tuple[bytes, str]:
    if isinstance(urdf, str) and urdf.lstrip().startswith("<"):
        return urdf.strip().encode(), "the URDF text"
    path = Path(urdf)
    try:
        return path.read_bytes(), f"'{path}'"
    except (OSError, ValueError) as error:
        raise ModelError(f"cannot read the URDF '{str(path)[:200]}': {getattr(error, 'strerror', error)}") from error


_NEEDED = {"link": ("name",), "joint": ("name", "type")}
_NEEDED_IN_JOINT = {"parent": "link", "child": "link"}
_NEEDED_NUMBERS = {"mass": ("value",), "inertia": ("ixx", "ixy", "ixz", "iyy", "iyz", "izz"), "axis": ("xyz",)}


def _refuse_missing(root: Any, source: str) -> None:
    """Name the attribute or element that a link or joint cannot do without."""
    for element in root.iterchildren("link", "joint"):
        owner = f'<{element.tag} name="{element.get("name", "")}">'
        for key in _NEEDED[element.tag]:
            if not element.get(key):
                raise ModelError(f"{source}: {owner} has no {key}")
        for tag, key in _NEEDED_IN_JOINT.items() if element.tag == "joint" else ():
            child = element.find(tag)
            if child is None or not child.get(key):
                raise ModelError(f"{source}: {owner} names no {tag} link")
        for child in element.iter(*_NEEDED_NUMBERS):
            if missing := [key for key in _NEEDED_NUMBERS[child.tag] if child.get(key) is None]:
                raise ModelError(f"{source}: <{child.tag}> in {owner} has no {', '.join(missing)}")


def _refuse_non_numbers(root: Any, source: str) -> None:
    """Name the attribute that holds no finite number, before it turns into a NaN somewhere."""
    for element in root.iter("origin", "axis", "mass", "inertia", "limit", "mimic"):
        for key, value in element.attrib.items():
            if key == "joint":
                continue
            count = 3 if key in ("xyz", "rpy") else 1
            infinite = element.tag == "limit" and "inf" in value.lower()
            if not infinite and not _finite(value, count):
                owner = next(up for up in element.iterancestors() if up.get("name") or up.tag == "robot")
                expected = "a finite number" if count == 1 else f"{count} finite numbers"
                raise ModelError(
                    f"{source}: {key}=\"{value}\" of <{element.tag}> in '{owner.get('name')}' is not {expected}"
                )


def _finite(text: str, count: int) -> bool:
    try:
        numbers = [float(word) for word in text.split()]
    except ValueError:
        return False
    return len(numbers) == count and bool(np.isfinite(numbers).all())


def _refuse_duplicates(kind: str, names: Iterable[str]) -> None:
    if repeated := [name for name, count in Counter(names).items() if count > 1]:
        raise ModelError(f"the URDF has more than one {kind} named {', '.join(repeated)}")


def _link(link: Any) -> Link:
    inertial = link.inertial
    if inertial is None:
        return Link(name=link.name, remarks=("has no <inertial>, so no mass",))
    remarks = [f"has no <{part}>" for part in ("mass", "inertia") if getattr(inertial, part) is None]
    mass = 0.0 if inertial.mass is None else float(inertial.mass)
    if mass < 0:
        raise ModelError(f"link '{link.name}' has the mass {mass} kg; expected zero or more")
    origin = np.eye(4) if inertial.origin is None else inertial.origin
    inertia = np.zeros((3, 3)) if inertial.inertia is None else np.asarray(inertial.inertia, dtype=float)
    inertia = origin[:3, :3] @ inertia @ origin[:3, :3].T
    return Link(name=link.name, mass=mass, com=origin[:3, 3], inertia=inertia, remarks=tuple(remarks))


def _joint(joint: Any) -> Joint:
    if joint.type not in _SUPPORTED:
        raise ModelError(f"joint '{joint.name}' is of type '{joint.type}'; supported are {', '.join(_SUPPORTED)}")
    origin = np.eye(4) if joint.origin is None else joint.origin
    axis, remarks = np.array([1.0, 0.0, 0.0]), []
    if joint.type in _MOVING:
        given = axis if joint.axis is None else np.asarray(joint.axis, dtype=float)
        length = float(np.linalg.norm(given))
        if length < _NO_DIRECTION:
            raise ModelError(f"joint '{joint.name}' has the axis {given.tolist()}, which has no direction")
        if abs(length - 1) > _UNIT:
            remarks.append(f"had an axis of length {length:.6g}, which was made a unit one")
        axis = given / length
    limits, unlimited = _limits(joint)
    return Joint(
        name=joint.name, kind=joint.type, parent=joint.parent, child=joint.child, rotation=origin[:3, :3],
        translation=origin[:3, 3], axis=axis, mimic=_mimic(joint), remarks=(*remarks, *unlimited), **limits,
    )  # fmt: skip


def _limits(joint: Any) -> tuple[dict[str, float], tuple[str, ...]]:
    """Return the limits with URDF's defaults, 0 for a range that is not written, and remarks on what is missing.

    A continuous joint has no range. No <limit> at all means no limits, and so does a missing effort or velocity,
    though URDF wants both.
    """
    if joint.type == "fixed":
        return {}, ()
    if joint.limit is None:
        return {}, () if joint.type == "continuous" else ("has no <limit>, so no limits",)
    remarks = tuple(f"states no limit of {key}" for key in ("effort", "velocity") if getattr(joint.limit, key) is None)
    limits = {key: getattr(joint.limit, key) for key in ("effort", "velocity")}
    if joint.type != "continuous":
        limits |= {key: getattr(joint.limit, key) or 0.0 for key in ("lower", "upper")}
        if limits["lower"] > limits["upper"]:
            raise ModelError(
                f"joint '{joint.name}' has the lower limit {limits['lower']} above its upper limit {limits['upper']}"
            )
    return {key: float(value) for key, value in limits.items() if value is not None}, remarks


def _mimic(joint: Any) -> Mimic | None:
    if joint.mimic is None:
        return None
    multiplier, offset = joint.mimic.multiplier, joint.mimic.offset
    return Mimic(
        joint=joint.mimic.joint,
        multiplier=1.0 if multiplier is None else float(multiplier),
        offset=0.0 if offset is None else float(offset),
    )

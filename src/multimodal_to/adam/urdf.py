"""The URDF reader: `yourdfpy` parses, this file checks and hands over links and joints."""

from __future__ import annotations

import io
import logging
import os
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from lxml import etree

from multimodal_to.adam.lean_tree import build_tree, independent
from multimodal_to.adam.leftovers import refuse_leftovers, unread
from multimodal_to.adam.tree import Joint, Link, Mimic, Tree
from multimodal_to.arguments import checked
from multimodal_to.errors import ModelError, listed, said, shortened
from multimodal_to.files.numbers import numbers
from multimodal_to.files.reading import read_bytes

LARGEST_URDF = 10_000_000
"""The largest URDF that is read [byte]."""
MOST_ELEMENTS = 50_000
"""The most XML elements of a URDF; a humanoid with all its visuals has a tenth."""
MOST_LINKS = 1_000
"""The most links of a robot, and the most joints: each takes some milliseconds before anything is computed with it."""
LARGEST_NUMBER = 1e9
"""No length [m], angle [rad], mass [kg] or inertia [kg m²] is larger; limits of joints may be."""

_ENTITIES = "declares a document type, whose entities are not read; write out what they stand for"
_TEXT = "the URDF text"
_BLANK = " \t\r\n\v\f\ufeff"  # with the mark that some programs begin a file with
_MOVING = ("revolute", "continuous", "prismatic")
_SUPPORTED = (*_MOVING, "fixed")
_NO_DIRECTION = 1e-6
"""An axis shorter than this says nothing."""
_UNIT = 1e-6
"""An axis whose length differs from 1 by less than this was meant as a unit one."""


@checked
def load_tree(
    urdf: str | os.PathLike[str],
    joint_names: Sequence[str] | None = None,
    locked: Mapping[str, float] | None = None,
) -> Tree:
    """Read a URDF into a `Tree`.

    Args:
        urdf: a path, or the XML text itself.
        joint_names: the joints that move on their own, in the order of s; by default all that can, in the order of the
            file. A mimic joint follows its leader, and is none of them.
        locked: positions [rad or m] of joints that can move but are not in `joint_names`; zero where not given.

    Raises:
        ModelError: the file is missing, too large or no URDF, or it describes something that no robot can have.
    """
    links, joints = read_urdf(urdf)
    if isinstance(joint_names, str):
        raise ModelError(f"the joints that move are given as the text '{joint_names}'; expected a list of names")
    if joint_names is None:
        joint_names = independent(joints, locked or {})
    return build_tree(links, joints, joint_names, locked)


def read_urdf(urdf: str | os.PathLike[str]) -> tuple[list[Link], list[Joint]]:
    """Return the links and joints of a URDF (a path, or the XML text itself), checked one by one."""
    robot = parse_urdf(urdf)
    return [_link(link) for link in robot.links], [_joint(joint) for joint in robot.joints]


def parse_urdf(urdf: str | os.PathLike[str], *, collisions: bool = False) -> Any:
    """Return what a URDF holds as `yourdfpy` has it: its links with their visuals, joints and materials.

    No mesh is looked for. Every element that is kept has what it cannot do without, in finite numbers, and names are
    not given twice; whether the joints form a tree, `load_tree` says. Collision shapes are kept only if they are asked
    for; one that cannot be read is left out.

    Raises:
        ModelError: the file is missing, larger than `LARGEST_URDF` or no URDF, or it has no links, or more than
            `MOST_LINKS` or `MOST_ELEMENTS`.
    """
    import yourdfpy  # takes longer to import than all the rest, and what reads no URDF does without

    root, source = _root(urdf)
    _keep_what_is_used(root, collisions=collisions)
    _check_names(root, source)
    _refuse_missing(root, source)
    _refuse_non_numbers(root, source)
    logger = logging.getLogger("yourdfpy")
    level = logger.level
    logger.setLevel(logging.CRITICAL)  # it logs what is reported here
    try:
        return yourdfpy.URDF.load(
            io.BytesIO(etree.tostring(root)),
            build_scene_graph=False,
            load_meshes=False,
            build_collision_scene_graph=False,
            load_collision_meshes=False,
        ).robot
    except Exception as error:  # yourdfpy raises whatever its parsing runs into
        raise ModelError(f"{source} is no URDF that can be read: {said(error)}") from error
    finally:
        logger.setLevel(level)


def unread_elements(urdf: str | os.PathLike[str]) -> tuple[tuple[str, str], ...]:
    """Return the elements of a URDF that are not known, as (what they stand in, how many of which): nothing reads them.

    Raises:
        ModelError: as `parse_urdf` does.
    """
    return unread(_root(urdf)[0])


def _root(urdf: str | os.PathLike[str]) -> tuple[Any, str]:
    """Return the element <robot> of a URDF, of which nothing is left to expand, and what to call the URDF in errors.

    The encoding that a file declares is the file's; a text has been decoded already, whatever it declares.
    """
    text, source = _read(urdf)
    try:
        # Entities are not expanded and nothing is fetched: a URDF from elsewhere is only text.
        root = etree.fromstring(
            text,
            etree.XMLParser(
                resolve_entities=False,
                load_dtd=False,
                no_network=True,
                remove_comments=True,
                remove_pis=True,
                encoding="utf-8" if source == _TEXT else None,
            ),
        )
    except (etree.XMLSyntaxError, ValueError) as error:
        if b"<!DOCTYPE" in text:  # whose entities the parser has stumbled over
            raise ModelError(f"{source} {_ENTITIES}") from error
        raise ModelError(f"{source} is not valid XML: {said(error)}") from error
    if root.getroottree().docinfo.internalDTD is not None:
        raise ModelError(f"{source} {_ENTITIES}")
    _drop_namespace(root)
    if root.tag != "robot":
        other = "; MJCF is not read, convert it to a URDF" if root.tag == "mujoco" else ""
        raise ModelError(f"{source} is no URDF: its root element is <{root.tag}>, expected <robot>{other}")
    if (count := sum(1 for _ in root.iter())) > MOST_ELEMENTS:
        raise ModelError(f"{source} has {count} elements; at most {MOST_ELEMENTS} are read")
    if root.get("name") is None:
        root.set("name", "robot")
    refuse_leftovers(root, source)
    return root, source


def _drop_namespace(root: Any) -> None:
    """Take a namespace that the whole file stands in off its elements; that of xacro stays."""
    space = etree.QName(root).namespace
    if space and "xacro" not in space and root.prefix is None:
        for element in root.iter(f"{{{space}}}*"):
            element.tag = etree.QName(element).localname
        etree.cleanup_namespaces(root)


def _read(urdf: str | os.PathLike[str]) -> tuple[bytes, str]:
    if isinstance(urdf, str) and (written := urdf.lstrip(_BLANK)).startswith("<"):
        if len(urdf) > LARGEST_URDF:
            raise ModelError(f"the URDF text is longer than {LARGEST_URDF / 1e6:g} MB, the most that is read")
        try:
            return written.rstrip().encode("utf-8"), _TEXT
        except UnicodeEncodeError as error:
            raise ModelError(f"{_TEXT} holds {error.object[error.start]!a}, which is no character") from error
    if isinstance(urdf, str) and not urdf.strip(_BLANK):
        raise ModelError(f"{_TEXT} is empty; expected a path, or the XML itself")
    return read_bytes(urdf, LARGEST_URDF, ModelError), f"'{Path(urdf)}'"


_USED = ("link", "joint", "material")
_USED_WITHIN = {"link": ("inertial", "visual"), "joint": ("parent", "child", "origin", "axis", "limit", "mimic")}
_NEEDED = {"link": ("name",), "joint": ("name", "type")}
_NEEDED_IN_JOINT = {"parent": "link", "child": "link"}
_NEEDED_WITHIN = {
    "mass": ("value",),
    "inertia": ("ixx", "ixy", "ixz", "iyy", "iyz", "izz"),
    "axis": ("xyz",),
    "mimic": ("joint",),
    "box": ("size",),
    "cylinder": ("radius", "length"),
    "sphere": ("radius",),
    "mesh": ("filename",),
}
_SHAPES = ("box", "cylinder", "sphere", "mesh")


def _keep_what_is_used(root: Any, *, collisions: bool) -> None:
    """Drop what is neither a body, a joint nor something to draw: it may be of any form, and nothing here reads it."""
    for owner in (root, *root.iterchildren("link", "joint")):
        used = (*_USED_WITHIN.get(owner.tag, _USED), *["collision"] * (collisions and owner.tag == "link"))
        for element in [child for child in owner if child.tag not in used]:
            owner.remove(element)
    for shape in [*root.iterfind("link/visual"), *root.iterfind("link/collision")]:
        geometry = shape.find("geometry")
        drawn = geometry is not None and len(geometry) and geometry[0].tag in _SHAPES
        if not drawn or (shape.tag == "collision" and _is_broken(shape)):
            shape.getparent().remove(shape)


def _is_broken(shape: Any) -> bool:
    """Return whether a collision shape lacks an attribute or holds one that is no number."""
    texts = {(child.tag, key): child.get(key) for child in shape.iter(*_COUNTS) for key in _COUNTS[child.tag]}
    lacking = (child.get(key) is None for child in shape.iter(*_NEEDED_WITHIN) for key in _NEEDED_WITHIN[child.tag])
    return any(lacking) or any(
        text is not None and _number_fault(text, _COUNTS[tag][key], LARGEST_NUMBER) is not None
        for (tag, key), text in texts.items()
    )


def _check_names(root: Any, source: str) -> None:
    """Refuse a URDF of no link, of too many links or joints, or of two with one name."""
    for kind in ("link", "joint"):
        names = [element.get("name") for element in root.iterfind(kind)]
        if kind == "link" and not names:
            raise ModelError(f"{source} holds no links")
        if len(names) > MOST_LINKS:
            raise ModelError(f"{source} has {len(names)} {kind}s; at most {MOST_LINKS} are read")
        counts = Counter(names)
        if repeated := [name for name, count in counts.items() if count > 1 and name]:
            raise ModelError(f"{source} has more than one {kind} named {listed(repeated)}")


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
        for child in element.iter(*_NEEDED_WITHIN):
            if missing := [key for key in _NEEDED_WITHIN[child.tag] if child.get(key) is None]:
                raise ModelError(f"{source}: <{child.tag}> in {owner} has no {', '.join(missing)}")


_COUNTS: Mapping[str, Mapping[str, tuple[int, ...]]] = {
    "origin": {"xyz": (3,), "rpy": (3,)},
    "axis": {"xyz": (3,)},
    "mass": {"value": (1,)},
    "inertia": dict.fromkeys(_NEEDED_WITHIN["inertia"], (1,)),
    "mimic": {"multiplier": (1,), "offset": (1,)},
    "limit": dict.fromkeys(("lower", "upper", "effort", "velocity"), (1,)),
    "box": {"size": (3,)},
    "cylinder": {"radius": (1,), "length": (1,)},
    "sphere": {"radius": (1,)},
    "mesh": {"scale": (1, 3)},
    "color": {"rgba": (3, 4)},
}
"""How many numbers the attributes of each element hold."""


def _refuse_non_numbers(root: Any, source: str) -> None:
    """Name the attribute that holds no finite number, before it turns into a NaN somewhere."""
    for element in root.iter(*_COUNTS):
        for key, counts in _COUNTS[element.tag].items():
            text, largest = element.get(key), np.inf if element.tag == "limit" else LARGEST_NUMBER
            if text is not None and (wrong := _number_fault(text, counts, largest)) is not None:
                owner = next(up for up in element.iterancestors() if up.get("name") or up.tag == "robot")
                raise ModelError(
                    f"{source}: {key}=\"{shortened(text, 60)}\" of <{element.tag}> in '{owner.get('name')}' {wrong}"
                )


def _number_fault(text: str, counts: Sequence[int], largest: float) -> str | None:
    """Return what is wrong with a text of numbers, as the end of a sentence about it."""
    finite = "is not a finite number" if counts == (1,) else f"is not {counts[-1]} finite numbers"
    finite += "; expected blanks between numbers, and a point in them" * ("," in text or ";" in text)
    try:
        found = numbers(text)
    except ValueError:
        return finite
    if len(found) not in counts:
        return finite
    greatest = max(map(abs, found))
    return None if greatest <= largest else finite if np.isinf(greatest) else f"is larger than {largest:g}"


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
        name=joint.name,
        kind=joint.type,
        parent=joint.parent,
        child=joint.child,
        rotation=origin[:3, :3],
        translation=origin[:3, 3],
        axis=axis,
        mimic=_mimic(joint),
        remarks=(*remarks, *unlimited),
        **limits,
    )


def _limits(joint: Any) -> tuple[dict[str, float], tuple[str, ...]]:
    """Return the limits with URDF's defaults, 0 for a range that is not written, and remarks on what is missing.

    A continuous joint has no range, and a mimic joint that states none has what its leader's leaves it. No <limit> at
    all means no limits, and so does a missing effort or velocity, though URDF wants both.
    """
    if joint.type == "fixed":
        return {}, ()
    if joint.limit is None:
        return {}, () if joint.type == "continuous" else ("has no <limit>, so no limits",)
    remarks = tuple(f"states no limit of {key}" for key in ("effort", "velocity") if getattr(joint.limit, key) is None)
    limits = {key: getattr(joint.limit, key) for key in ("effort", "velocity")}
    bounded = joint.mimic is None or not (joint.limit.lower is joint.limit.upper is None)
    if joint.type != "continuous" and bounded:
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

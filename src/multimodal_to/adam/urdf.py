"""The URDF reader: `yourdfpy` parses, this file checks and hands over links and joints. The only file that knows it."""

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

from multimodal_to.adam.tree import Joint, Link, Tree, build_tree
from multimodal_to.errors import ModelError

_MOVING = ("revolute", "continuous", "prismatic")
_SUPPORTED = (*_MOVING, "fixed")


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
    except etree.XMLSyntaxError as error:
        raise ModelError(f"{source} is not valid XML: {error}") from error
    if root.tag != "robot":
        raise ModelError(f"{source} is no URDF: its root element is <{root.tag}>, expected <robot>")
    _refuse_non_numbers(root, source)
    logger = logging.getLogger("yourdfpy")
    level = logger.level
    logger.setLevel(logging.CRITICAL)  # it logs what is reported here
    try:
        return yourdfpy.URDF.load(
            io.BytesIO(etree.tostring(root)), build_scene_graph=False, load_meshes=False, build_collision_scene_graph=False,
            load_collision_meshes=False,
        ).robot  # fmt: skip
    except Exception as error:  # yourdfpy raises whatever its parsing runs into
        raise ModelError(f"{source} is no URDF that can be read: {error!r}") from error
    finally:
        logger.setLevel(level)


def _read(urdf: str | os.PathLike[str]) -> tuple[bytes, str]:
    if isinstance(urdf, str) and urdf.lstrip().startswith("<"):
        return urdf.encode(), "the URDF text"
    path = Path(urdf)
    try:
        return path.read_bytes(), f"'{path}'"
    except OSError as error:
        raise ModelError(f"cannot read the URDF '{path}': {error.strerror or error}") from error


def _refuse_non_numbers(root: Any, source: str) -> None:
    """Name the attribute that holds no finite number, before it turns into a NaN somewhere."""
    for element in root.iter("origin", "axis", "mass", "inertia", "limit"):
        for key, value in element.attrib.items():
            try:
                finite = all(np.isfinite(float(word)) for word in value.split())
            except ValueError:
                finite = False
            if not finite and not (element.tag == "limit" and "inf" in value.lower()):
                owner = next(up for up in element.iterancestors() if up.get("name") or up.tag == "robot")
                raise ModelError(
                    f"{source}: {key}=\"{value}\" of <{element.tag}> in '{owner.get('name')}' is not a finite number"
                )


def _refuse_duplicates(kind: str, names: Iterable[str]) -> None:
    if repeated := [name for name, count in Counter(names).items() if count > 1]:
        raise ModelError(f"the URDF has more than one {kind} named {', '.join(repeated)}")


def _link(link: Any) -> Link:
    inertial = link.inertial
    if inertial is None:
        return Link(name=link.name)
    mass = 0.0 if inertial.mass is None else float(inertial.mass)
    if mass < 0:
        raise ModelError(f"link '{link.name}' has the mass {mass} kg; expected zero or more")
    origin = np.eye(4) if inertial.origin is None else inertial.origin
    inertia = np.zeros((3, 3)) if inertial.inertia is None else np.asarray(inertial.inertia, dtype=float)
    inertia = origin[:3, :3] @ inertia @ origin[:3, :3].T
    smallest = float(np.linalg.eigvalsh(inertia)[0])
    if smallest < -1e-9 * max(1.0, float(np.abs(inertia).max())):
        raise ModelError(f"link '{link.name}' has an inertia with the negative principal value {smallest:.3g} kg m²")
    return Link(name=link.name, mass=mass, com=origin[:3, 3], inertia=inertia)


def _joint(joint: Any) -> Joint:
    if joint.type not in _SUPPORTED:
        raise ModelError(f"joint '{joint.name}' is of type '{joint.type}'; supported are {', '.join(_SUPPORTED)}")
    if joint.mimic is not None:
        raise ModelError(f"joint '{joint.name}' mimics '{joint.mimic.joint}'; mimic joints are not supported")
    origin = np.eye(4) if joint.origin is None else joint.origin
    axis = np.array([1.0, 0.0, 0.0]) if joint.axis is None else np.asarray(joint.axis, dtype=float)
    length = float(np.linalg.norm(axis))
    if joint.type in _MOVING and length < 1e-6:
        raise ModelError(f"joint '{joint.name}' has the axis {axis.tolist()}, which has no direction")
    unbounded = joint.type == "continuous" or joint.limit is None
    limit = joint.limit

    def value(number: float | None, default: float) -> float:
        return default if number is None else float(number)

    return Joint(
        name=joint.name,
        kind=joint.type,
        parent=joint.parent,
        child=joint.child,
        rotation=origin[:3, :3],
        translation=origin[:3, 3],
        axis=axis / length if length > 0 else axis,
        # URDF's defaults: a limit that is not written is 0 for the range, and no limit where <limit> is absent
        lower=-np.inf if unbounded else value(limit.lower, 0.0),
        upper=np.inf if unbounded else value(limit.upper, 0.0),
        effort=np.inf if limit is None else value(limit.effort, np.inf),
        velocity=np.inf if limit is None else value(limit.velocity, np.inf),
    )

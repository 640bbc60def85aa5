"""What a URDF holds that no reader of URDF takes: refused where it is a part of the robot, named where it may be none.

A file that xacro has not expanded still parses as XML, and so does one with a misspelt element. Dropping these without
a word would make another robot of it.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator
from typing import Any

from lxml import etree

from multimodal_to.errors import ModelError, shortened

_OWN = {
    "robot": {"link", "joint", "material"},
    "link": {"inertial", "visual", "collision"},
    "joint": {"parent", "child", "origin", "axis", "limit", "mimic", "dynamics", "calibration", "safety_controller"},
    "inertial": {"origin", "mass", "inertia"},
}
"""The elements of URDF that say what the robot is, by what they stand in."""
_OTHERS = {
    "robot": {"gazebo", "transmission", "sensor", "ros2_control", "mujoco", "model", "verbose"},
    "link": {"contact", "self_collision_checking", "verbose", "type", "gazebo", "sensor"},
    "joint": {"gazebo", "hardwareInterface"},
    "inertial": set[str](),
}
"""Elements that other programs read, and that are no part of the robot."""
_PARTS = {name.lower() for names in _OWN.values() for name in names - {"origin", "dynamics"}} | {"robot", "include"}
_ONCE = {
    "link": ("inertial",),
    "inertial": ("origin", "mass", "inertia"),
    "joint": ("parent", "child", "origin", "axis", "limit", "mimic"),
}
_UNEXPANDED = re.compile(r"\$+[{(]")
_EXPAND = "expand the file with xacro first"


def refuse_leftovers(root: Any, source: str) -> None:
    """Refuse a URDF with a part of the robot that no reader of URDF takes.

    Raises:
        ModelError: an element of xacro is left, or an attribute that xacro has to fill in; a link, a joint or a part of
            one stands where it is not read; or an element that there is one of stands twice.
    """
    _refuse_unexpanded(root, source)
    for owner, element in _unread(root):
        if (part := _part_of_robot(root, element)) is not None:
            inside = "" if part is element else f" in <{_tag(element)}>"
            right = [tag for tag, names in _OWN.items() if _local(part).lower() in names and not _namespace(part)]
            raise ModelError(
                f"{source}: {_named(part)}{inside} in {_named(owner)} is not read; expected "
                + (
                    f"<{_local(part).lower()}> in <{right[0]}>"
                    if right
                    else "links and joints in <robot>, in URDF's names"
                )
            )
    for element in _read(root):
        for tag in _ONCE.get(element.tag, ()):
            if len(element.findall(tag)) > 1:
                raise ModelError(f"{source}: {_named(_owner(element))} has more than one <{tag}>")


def unread(root: Any) -> tuple[tuple[str, str], ...]:
    """Return the elements that are not known, as (what they stand in, how many of which), in the file's order."""
    counts = Counter((_subject(owner), _tag(element)) for owner, element in _unread(root))
    return tuple((owner, f"<{tag}>" if count == 1 else f"{count} <{tag}>") for (owner, tag), count in counts.items())


def _unread(root: Any) -> Iterator[tuple[Any, Any]]:
    """Yield what stands in the robot, its links, joints and inertials and is not known, with what it stands in."""
    for owner in _read(root):
        known = _OWN[owner.tag] | _OTHERS[owner.tag]
        for child in owner:
            if isinstance(child.tag, str) and child.tag not in known:
                yield owner, child


def _read(root: Any) -> Iterator[Any]:
    yield root
    for element in root.iterchildren("link", "joint"):
        yield element
        yield from element.iterchildren("inertial")


def _part_of_robot(root: Any, element: Any) -> Any | None:
    """Return the element, or what is in it, if that looks like a part of the robot."""
    if _local(element).lower() in _PARTS:
        return element
    links, joints = ({found.get("name") for found in root.iterchildren(tag)} for tag in ("link", "joint"))
    for inner in element.iterdescendants():
        if not isinstance(inner.tag, str):
            continue
        name, tag = inner.get("name"), _local(inner).lower()
        if _prefix(inner) == "xacro" or tag == "inertial":
            return inner
        if (tag == "link" and name and name not in links) or (
            tag == "joint" and inner.get("type") and name not in joints
        ):
            return inner
    return None


def _refuse_unexpanded(root: Any, source: str) -> None:
    """Refuse a file that xacro has not expanded: an element of xacro, or an attribute of a known one with `${` or `$(`.

    What other programs read is left alone.
    """
    for element in _own(root):
        if _prefix(element) == "xacro":
            raise ModelError(f"{source} still holds <xacro:{_local(element)}>{_within(element)}; {_EXPAND}")
        for key, text in element.attrib.items():
            if _UNEXPANDED.search(text):
                raise ModelError(
                    f'{source} still holds {etree.QName(key).localname}="{shortened(text, 60)}" of '
                    f"<{_tag(element)}>{_within(element)}; {_EXPAND}"
                )


def _own(element: Any) -> Iterator[Any]:
    """Yield an element and all that stands in it, without what other programs read."""
    yield element
    for child in element:
        if isinstance(child.tag, str) and child.tag not in _OTHERS.get(element.tag, ()):
            yield from _own(child)


def _within(element: Any) -> str:
    """Return what an element stands in, up to the first that has a name, as the end of a sentence."""
    parts = [_named(up) for up in element.iterancestors()]
    named = [index for index, part in enumerate(parts) if " name=" in part]
    return "".join(f" in {part}" for part in parts[: named[0] + 1 if named else 1])


def _named(element: Any) -> str:
    name = element.get("name")
    named = "" if name is None or element.tag == "robot" else f' name="{shortened(name, 60)}"'
    return f"<{_tag(element)}{named}>"


def _subject(element: Any) -> str:
    element = _owner(element)
    return "the robot" if element.tag == "robot" else f"{element.tag} '{element.get('name', '')}'"


def _owner(element: Any) -> Any:
    return element.getparent() if element.tag == "inertial" else element


def _tag(element: Any) -> str:
    prefix = _prefix(element)
    return f"{prefix}:{_local(element)}" if prefix else _local(element)


def _local(element: Any) -> str:
    return str(etree.QName(element).localname).rpartition(":")[2]


def _namespace(element: Any) -> str:
    return etree.QName(element).namespace or ""


def _prefix(element: Any) -> str:
    """Return the prefix of an element, "xacro" for whatever stands in a namespace of xacro; empty where it has none."""
    if "xacro" in _namespace(element):
        return "xacro"
    return element.prefix or str(element.tag).rpartition(":")[0].rpartition("}")[2]

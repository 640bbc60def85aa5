"""Robots with other masses, lengths, jets or friction: the files of a robot, changed, in a folder of their own."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from contextlib import suppress
from hashlib import sha256
from pathlib import Path
from typing import Any

import numpy as np
import tomli_w
from lxml import etree

from multimodal_to.adam.spatial import Array
from multimodal_to.errors import InputError, ModelError, OutputError, listed, shown, unknown
from multimodal_to.files.reading import is_number, read_toml
from multimodal_to.files.writing import scratch, write_text
from multimodal_to.models.loading import ROBOT_FILE, bundled_robots, load_robot
from multimodal_to.models.robot import Robot

PREFIX = "robot."
"""What keys begin with that change the robot."""
EVERY = "*"
"""Stands for every link, or every jet."""
KEYS = (
    "robot.mass",
    "robot.friction",
    "robot.link.NAME.mass",
    "robot.link.NAME.inertia",
    "robot.link.NAME.length",
    "robot.jet.NAME.thrust_max",
    "robot.jet.NAME.place",
    "robot.jet.NAME.tilt",
)
"""What of a robot can change: `mass`, `inertia` and `length` are factors, the rest is what it becomes.

`robot.mass` is a factor of all masses and inertias; `mass` of a link one of its mass and inertia. A link of another
`length` is as much larger in every direction, with the same mass: what hangs on it and its CoM are farther, its inertia
grows by the square. `thrust_max` [N]; `place` is a shift [m] along the axes of the link that the jet is fixed to;
`tilt` are turns about x and y of the jet's frame [°]. NAME is that of a link or a jet, or `*` for all of them.
"""


def variant(robot: str, changes: Mapping[str, Any], folder: Path) -> Path:
    """Write a changed robot below a folder, once, and return its folder; its name says nothing but what was changed.

    Its base is at home as much higher or lower as its feet ask for.

    Args:
        robot: bundled one by name, or a robot's folder.
        changes: by `KEYS`.
        folder: where changed robots are.

    Raises:
        InputError: a key is unknown, or a value is not what its key takes.
        ModelError: the robot lacks a link or a jet, or what comes out is no robot.
        OutputError: it cannot be written.
    """
    source = bundled_robots().get(robot, Path(robot))
    text = json.dumps([robot, dict(sorted(changes.items()))])
    target = folder / sha256(text.encode()).hexdigest()[:16]
    if (target / ROBOT_FILE).exists():
        return target
    table, before = read_toml(source / ROBOT_FILE, ModelError), load_robot(robot)
    parser = etree.XMLParser(resolve_entities=False, load_dtd=False, no_network=True)
    root = etree.parse(str(before.urdf), parser).getroot()
    if "://" in table["urdf"]:
        table["urdf"] = before.urdf.name  # the changed one is a file of its own
    for key, value in changes.items():
        _change(key, value, table, root)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with scratch(folder) as made:  # another process may make the same one
            (made / table["urdf"]).parent.mkdir(parents=True, exist_ok=True)
            (made / table["urdf"]).write_bytes(
                etree.tostring(etree.ElementTree(root), encoding="utf-8", xml_declaration=True)
            )
            write_text(made / ROBOT_FILE, tomli_w.dumps(table))
            write_text(made / ROBOT_FILE, tomli_w.dumps(_on_its_feet(before, table, made)))
            with suppress(OSError):  # the other was first
                made.replace(target)
    except OSError as error:
        raise OutputError(f"cannot write a robot to '{folder}': {error.strerror or error}") from error
    return target


def check_key(key: str) -> None:
    """Refuse a key that is none of `KEYS`.

    Raises:
        InputError: it is none.
    """
    if _parts(key) not in [pattern.removeprefix(PREFIX).replace("NAME", "") for pattern in KEYS]:
        raise InputError(unknown("key of a robot", key, KEYS))


def _parts(key: str) -> str:
    """Return a key without its prefix and its name: `link..mass` of `robot.link.chest.mass`."""
    words = key.removeprefix(PREFIX).split(".")
    return ".".join(words) if len(words) == 1 else f"{words[0]}..{words[-1]}"


def _change(key: str, value: Any, table: dict[str, Any], root: Any) -> None:
    """Change the files of a robot.

    Args:
        key: one of `KEYS` with its name.
        value: as the sweep has it.
        table: of the `robot.toml`.
        root: of the URDF.
    """
    check_key(key)
    words = key.removeprefix(PREFIX).split(".")
    kind, name, what = words[0], ".".join(words[1:-1]), words[-1]
    if kind == "friction":
        table["contact"]["friction"] = _positive(key, value)
    elif kind == "mass":
        _weigh(root.iter("link"), _positive(key, value), mass=True)
    elif kind == "link":
        links = {link.get("name"): link for link in root.iter("link")}
        own = _named("link", name, links)
        factor = _positive(key, value)
        if what == "length":
            _stretch(root, own, factor)
        else:
            _weigh((links[link] for link in own), factor, mass=what == "mass")
    else:
        jets = {jet["name"]: jet for jet in table.get("jet", ())}
        for jet in _named("jet", name, jets):
            _JET[what](jets[jet], key, value, root)


def _named(kind: str, name: str, known: Mapping[str, Any]) -> list[str]:
    """Return the names that a name stands for.

    Args:
        kind: of what is named.
        name: or `EVERY`.
        known: all of them by name.
    """
    if name == EVERY:
        return list(known)
    if name not in known:
        raise ModelError(unknown(kind, name, known))
    return [name]


def _positive(key: str, value: Any) -> float:
    if not (is_number(value) and value > 0):
        raise InputError(f"'{key}' is {shown(value)}; expected a positive number")
    return float(value)


def _numbers(key: str, value: Any, count: int) -> Array:
    if not (isinstance(value, list | tuple) and len(value) == count and all(map(is_number, value))):
        raise InputError(f"'{key}' is {shown(value)}; expected {count} numbers")
    return np.array(value, dtype=float)


def _weigh(links: Any, factor: float, *, mass: bool) -> None:
    for link in links:
        for element in (*(link.iter("mass") if mass else ()), *link.iter("inertia")):
            for attribute, number in element.attrib.items():
                element.set(attribute, repr(float(number) * factor))


def _stretch(root: Any, links: list[str], factor: float) -> None:
    """Move what hangs on links, and their CoM, away from their frames.

    Args:
        root: of the URDF.
        links: by name.
        factor: of the lengths.
    """
    for joint in root.iter("joint"):
        parent = joint.find("parent")
        if parent is not None and parent.get("link") in links:
            _scale_origin(joint.find("origin"), factor)
    for link in root.iter("link"):
        if link.get("name") in links:
            for part in link:
                _scale_origin(part.find("origin"), factor)
            _weigh([link], factor**2, mass=False)


def _scale_origin(origin: Any, factor: float) -> None:
    if origin is not None:
        numbers = [float(word) * factor for word in origin.get("xyz", "0 0 0").split()]
        origin.set("xyz", " ".join(map(repr, numbers)))


def _thrust(jet: dict[str, Any], key: str, value: Any, root: Any) -> None:
    jet["thrust_max"] = _positive(key, value)


def _place(jet: dict[str, Any], key: str, value: Any, root: Any) -> None:
    origin = _mount(jet, root)
    before = np.array([float(word) for word in origin.get("xyz", "0 0 0").split()])
    origin.set("xyz", " ".join(map(repr, (before + _numbers(key, value, 3)).tolist())))


def _tilt(jet: dict[str, Any], key: str, value: Any, root: Any) -> None:
    origin = _mount(jet, root)
    roll, pitch, yaw = (float(word) for word in origin.get("rpy", "0 0 0").split())
    about_x, about_y = np.radians(_numbers(key, value, 2))
    turned = _turn(2, yaw) @ _turn(1, pitch) @ _turn(0, roll) @ _turn(0, about_x) @ _turn(1, about_y)
    angles = (
        np.arctan2(turned[2, 1], turned[2, 2]),
        np.arctan2(-turned[2, 0], np.hypot(turned[0, 0], turned[1, 0])),
        np.arctan2(turned[1, 0], turned[0, 0]),
    )
    origin.set("rpy", " ".join(repr(float(angle)) for angle in angles))


_JET: Mapping[str, Callable[[dict[str, Any], str, Any, Any], None]] = {
    "thrust_max": _thrust,
    "place": _place,
    "tilt": _tilt,
}


def _mount(jet: Mapping[str, Any], root: Any) -> Any:
    """Return the origin of the joint that fixes a jet's frame.

    Args:
        jet: its table.
        root: of the URDF.
    """
    for joint in root.iter("joint"):
        child = joint.find("child")
        if child is not None and child.get("link") == jet["frame"] and joint.get("type") == "fixed":
            origin = joint.find("origin")
            return etree.SubElement(joint, "origin") if origin is None else origin
    fixed = [joint.find("child").get("link") for joint in root.iter("joint") if joint.get("type") == "fixed"]
    raise ModelError(
        f"the frame of jet '{jet['name']}', '{jet['frame']}', is not fixed to a link; fixed are {listed(fixed)}"
    )


def _turn(axis: int, angle: float) -> Array:
    one, two = [(1, 2), (2, 0), (0, 1)][axis]
    rotation = np.eye(3)
    rotation[one, one] = rotation[two, two] = np.cos(angle)
    rotation[two, one], rotation[one, two] = np.sin(angle), -np.sin(angle)
    return rotation


def _on_its_feet(before: Robot, table: dict[str, Any], folder: Path) -> dict[str, Any]:
    """Return the table with the base at home so high that the lowest contact point is where it was.

    Args:
        before: the robot without changes.
        table: of the changed one.
        folder: with its URDF.
    """
    if not before.contacts:
        return table
    rise = _lowest(before) - _lowest(load_robot(folder))
    x, y, z = table["home"]["base_position"]
    return {**table, "home": {**table["home"], "base_position": [x, y, float(z + rise)]}}


def _lowest(robot: Robot) -> float:
    return min(float(robot.pose_at_home(name)[2, 3]) for name in robot.contact_names)

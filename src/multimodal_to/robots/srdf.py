"""Postures of an SRDF: the group states that MoveIt and others keep beside a URDF."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

from lxml import etree

from multimodal_to.errors import ModelError
from multimodal_to.files.numbers import numbers
from multimodal_to.files.reading import read_bytes

LARGEST_SRDF = 10_000_000
"""The largest SRDF that is read [byte]."""
_PREFERRED = ("half_sitting", "standing", "home", "reference", "straight_standing", "default")
_ROUNDED = 1e-2  # of the norm of a quaternion
_LYING = ("rest", "sit", "fold", "lying")


@dataclass(frozen=True, kw_only=True)
class GroupState:
    """Positions of joints by name."""

    name: str
    source: Path
    positions: Mapping[str, float]  # [rad or m]
    base_quaternion_xyzw: tuple[float, float, float, float]  # upright where the state says none


def home_state(urdf: Path, robot_name: str, joints: frozenset[str]) -> GroupState | None:
    """Return the group state that is most likely a home: of the SRDF that lies beside a URDF, if one does.

    Args:
        urdf: the file.
        robot_name: as the URDF has it; an SRDF of another robot is none of it.
        joints: that can move.
    """
    states = [state for path in _beside(urdf) for state in _states(path, robot_name, urdf.stem, joints)]
    states = [state for state in states if 2 * len(state.positions) > len(joints)]
    return max(states, key=_rank, default=None)


def _rank(state: GroupState) -> tuple[bool, int, int]:
    name = state.name.lower()
    place = next((index for index, known in enumerate(_PREFERRED) if known in name), len(_PREFERRED))
    return not any(word in name for word in _LYING), -place, len(state.positions)


def _beside(urdf: Path) -> Iterator[Path]:
    folder = urdf.resolve().parent
    for place in (folder, folder / "srdf", folder.parent / "srdf", folder.parent):
        if place.is_dir():
            yield from sorted(place.glob("*.srdf"))


def _states(path: Path, robot_name: str, stem: str, joints: frozenset[str]) -> Iterator[GroupState]:
    """Yield the group states of an SRDF of this robot; none of a file that cannot be read.

    Args:
        path: of the SRDF.
        robot_name: of the URDF.
        stem: of the URDF's name.
        joints: that can move.
    """
    try:
        text = read_bytes(path, LARGEST_SRDF, ModelError)
        root = etree.fromstring(
            text, etree.XMLParser(resolve_entities=False, load_dtd=False, no_network=True, remove_comments=True)
        )
    except (ModelError, etree.XMLSyntaxError, ValueError):
        return
    if root.get("name") != robot_name and not stem.startswith(path.stem):
        return
    for state in root.iterfind("group_state"):
        positions, turn = {}, (0.0, 0.0, 0.0, 1.0)
        for joint in state.iterfind("joint"):
            try:
                values = numbers(joint.get("value", ""))
            except ValueError:
                continue
            if len(values) == 1 and joint.get("name") in joints:
                positions[joint.get("name")] = values[0]
            elif len(values) == 7 and abs(sum(value**2 for value in values[3:]) - 1.0) < _ROUNDED:  # of a floating base
                turn = values[3], values[4], values[5], values[6]
        if positions:
            yield GroupState(name=state.get("name", ""), source=path, positions=positions, base_quaternion_xyzw=turn)

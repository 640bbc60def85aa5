"""`dress.toml`: which meshes of another, installed model a robot wears, and where on its links they belong."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from importlib import metadata
from pathlib import Path
from typing import Any

import numpy as np

from multimodal_to.errors import ModelError, unknown
from multimodal_to.reading import read_toml
from multimodal_to.replay.meshes import package_file
from multimodal_to.trajectory import Array

DRESS_FILE = "dress.toml"


@dataclass(frozen=True, kw_only=True)
class Garment:
    """The meshes of one link of the other model on one of this robot's."""

    link: str  # of this robot
    source: str  # of the other model
    at: str  # the link, of both, whose origins are made to meet
    rgba: tuple[float, ...] | None = None  # None: the other model's colours


@dataclass(frozen=True, kw_only=True)
class Dress:
    """A robot's clothes: where the other model is, what of it is worn, and what of the robot's own stays visible."""

    urdf: Path
    root: str
    garments: tuple[Garment, ...]
    kept: frozenset[str]
    attribution: str

    def replaces(self, link: str, visual: str | None) -> bool:
        """Return whether a visual of this robot's link gives way to the meshes."""
        return visual not in self.kept and any(garment.link == link for garment in self.garments)

    def placements(self, robot: Any, other: Any) -> list[Array]:
        """Return link_H_mesh of every garment, (4, 4), from both models at zero posture.

        With the roots of both in one place, a garment keeps its orientation and moves by what lies between the origins
        of its link `at` in the two models: p = p_at − p'_at.

        Raises:
            ModelError: one of the models lacks a link.
        """
        ours, theirs = zero_poses(robot, self.root), zero_poses(other, self.root)
        placements = []
        for garment in self.garments:
            for model, names in ((ours, (garment.link, garment.at)), (theirs, (garment.source, garment.at))):
                for name in names:
                    if name not in model:
                        raise ModelError(f"{DRESS_FILE}: {unknown('link', name, model)}")
            moved = theirs[garment.source].copy()
            moved[:3, 3] += ours[garment.at][:3, 3] - theirs[garment.at][:3, 3]
            placements.append(np.linalg.inv(ours[garment.link]) @ moved)
        return placements


def zero_poses(robot: Any, root: str) -> dict[str, Array]:
    """Return root_H_link, (4, 4), of every link of a URDF below the root, with all joints at zero."""
    children: dict[str, list[Any]] = {}
    for joint in robot.joints:
        children.setdefault(joint.parent, []).append(joint)
    poses, waiting = {root: np.eye(4)}, [root]
    while waiting:
        parent = waiting.pop()
        for joint in children.get(parent, []):
            poses[joint.child] = poses[parent] @ (np.eye(4) if joint.origin is None else joint.origin)
            waiting.append(joint.child)
    return poses


def read_dress(folder: Path) -> Dress | None:
    """Return what a robot's folder says of its clothes; None where it says nothing or their package is missing.

    Raises:
        ModelError: the file is no TOML or lacks a key.
    """
    path = folder / DRESS_FILE
    if not path.is_file():
        return None
    table = read_toml(path, ModelError)
    try:
        package = str(table["package"])
        urdf = package_file(package, str(table["urdf"]))
        if urdf is None:
            return None
        return Dress(
            urdf=urdf,
            root=str(table["root"]),
            garments=tuple(_garment(entry) for entry in table["garment"]),
            kept=frozenset(table["kept"]),
            attribution=str(table["attribution"]).format(version=metadata.version(package)),
        )
    except KeyError as error:
        raise ModelError(f"'{path}' lacks {error}") from error


def _garment(entry: Mapping[str, Any]) -> Garment:
    link = str(entry["link"])
    rgba = tuple(float(part) for part in entry["rgba"]) if "rgba" in entry else None
    return Garment(link=link, source=str(entry.get("source", link)), at=str(entry.get("at", link)), rgba=rgba)

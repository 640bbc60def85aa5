"""`dress.toml`: which meshes of another, installed model a robot wears, and where on its links they belong."""

from __future__ import annotations

from dataclasses import dataclass
from importlib import metadata
from pathlib import Path
from typing import Any

import numpy as np

from multimodal_to.adam.spatial import Array
from multimodal_to.errors import ModelError, unknown
from multimodal_to.files.packages import package_file
from multimodal_to.files.reading import read_toml
from multimodal_to.files.records import Records

DRESS_FILE = "dress.toml"
_RECORDS = Records(what="the dress", error=ModelError)


@dataclass(frozen=True, kw_only=True)
class GarmentTable:
    """One of the tables `[[garment]]`."""

    link: str
    """The robot's link that wears it."""
    source: str | None = None
    """The link of the other model whose meshes it is; where there is none, the one called like `link`."""
    at: str | None = None
    """The link, of both models, whose origins are made to meet; where there is none, `link`."""
    rgba: tuple[float, float, float, float] | None = None
    """Its colour, red, green, blue and opacity from 0 to 1 [1]; where there is none, the other model's colours."""


@dataclass(frozen=True, kw_only=True)
class DressFile:
    """What a `dress.toml` holds: the only list of its keys."""

    package: str
    """The installed package that holds the other model."""
    urdf: str
    """Path of its URDF in the package, or the end of it."""
    attribution: str
    """Whose the meshes are; `{version}` becomes the package's version."""
    root: str
    """The link, of both models, that is put in one place."""
    kept: tuple[str, ...]
    """Visuals of the robot's own that stay on the links that wear something."""
    garment: tuple[GarmentTable, ...] = ()
    """What is worn."""


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
    links = {link.name for link in robot.links}
    children: dict[str, list[Any]] = {}
    for joint in robot.joints:
        if joint.child in links:
            children.setdefault(joint.parent, []).append(joint)
    waiting = [root] if root in links else []
    poses = {name: np.eye(4) for name in waiting}
    while waiting:
        parent = waiting.pop()
        for joint in children.get(parent, []):
            if joint.child not in poses:  # a loop would never end
                poses[joint.child] = poses[parent] @ (np.eye(4) if joint.origin is None else joint.origin)
                waiting.append(joint.child)
    return poses


def read_dress(folder: Path) -> Dress | None:
    """Return what a robot's folder says of its clothes; None where it says nothing or their package is missing.

    Raises:
        ModelError: the file is no TOML, lacks a key, or has one that is unknown or of a wrong value.
    """
    path = folder / DRESS_FILE
    if not path.is_file():
        return None
    table = read_toml(path, ModelError)
    try:
        return _dress(_RECORDS.read(DressFile, table))
    except ModelError as error:
        raise ModelError(f"{path}: {error}") from error


def _dress(file: DressFile) -> Dress | None:
    urdf = package_file(file.package, file.urdf)
    if urdf is None:
        return None
    credit = file.attribution.replace("{version}", metadata.version(file.package))
    garments = tuple(_garment(entry) for entry in file.garment)
    return Dress(urdf=urdf, root=file.root, garments=garments, kept=frozenset(file.kept), attribution=credit)


def _garment(entry: GarmentTable) -> Garment:
    rgba = None if entry.rgba is None else tuple(np.clip(entry.rgba, 0.0, 1.0).tolist())
    return Garment(link=entry.link, source=entry.source or entry.link, at=entry.at or entry.link, rgba=rgba)

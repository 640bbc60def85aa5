"""`init`: a URDF into a folder that `load_robot` reads at once."""

from __future__ import annotations

import os
import shutil
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from multimodal_to.adam.urdf import parse_urdf
from multimodal_to.arguments import checked
from multimodal_to.errors import ModelError, MultimodalError, OutputError, listed
from multimodal_to.files.packages import package_file
from multimodal_to.files.writing import write_text
from multimodal_to.models.loading import ROBOT_FILE, load_robot
from multimodal_to.models.robot import Robot
from multimodal_to.robots.drafting import draft
from multimodal_to.robots.writing import toml


@dataclass(frozen=True, kw_only=True)
class Made:
    """A robot's folder that was made, and what to look at first."""

    folder: Path
    robot: Robot
    notes: tuple[str, ...]  # a sentence each


@checked
def init(
    urdf: str | os.PathLike[str],
    output: str | os.PathLike[str],
    *,
    jets: Sequence[str] = (),
    contacts: bool = True,
    name: str | None = None,
) -> Made:
    """Write a folder with a `robot.toml` for a URDF, and the URDF itself, a copy of it or a link to it.

    Joints, groups, a home posture, contact points and jets come from the URDF and from guesses, each with a comment
    that says so. A URDF of an installed package stays where it is; another is copied, or linked to where its meshes
    would not be found from the copy.

    Args:
        urdf: path of the URDF. MJCF is not read.
        output: the folder; made where it is missing.
        jets: frames of links that an engine sits in.
        contacts: look for feet; without, the robot touches nothing.
        name: of the robot, by default the URDF's own.

    Raises:
        ModelError: the URDF cannot be read, a frame does not exist, or the robot has nothing to stand on.
        OutputError: the folder holds a robot already, or cannot be written.
    """
    source, folder = Path(urdf), Path(output)
    if (folder / ROBOT_FILE).exists():
        raise OutputError(f"'{folder / ROBOT_FILE}' exists; expected a folder without a robot")
    if source.suffix.lower() == ".xml" and b"<mujoco" in source.read_bytes()[:10_000]:
        raise ModelError(f"'{source}' is an MJCF, which is not read; convert it to a URDF")
    found = draft(source, jets=jets, contacts=contacts, name=name)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise OutputError(f"cannot make the folder '{folder}': {error.strerror or error}") from error
    text = toml(found, _placed(source, folder))
    write_text(folder / ROBOT_FILE, text)
    notes = [f"joint '{joint}' is held at zero: {reason}" for joint, reason in found.left_out.items()]
    guessed = [joint.name for joint, of in zip(found.joints, found.ranges, strict=True) if of.guesses]
    if guessed:
        notes.append(f"the URDF has placeholders for limits of {len(guessed)} joints, which were guessed")
    if stuck := [joint.name for joint in found.joints if joint.lower == joint.upper]:
        notes.append(f"the URDF leaves {listed(stuck)} no range to move in; state one there")
    if found.bent_legs:
        notes.append(f"straight legs were bent at home: {', '.join(found.bent_legs)}")
    if not found.feet:
        notes.append("the robot touches nothing")
    if found.jets:
        notes.append("directions, thrusts and engines of the jets are guesses")
    return Made(folder=folder, robot=load_robot(folder), notes=tuple(notes))


def _placed(source: Path, folder: Path) -> str:
    """Put a URDF into a folder, and return what a `robot.toml` there calls it."""
    if address := _in_package(source.resolve()):
        return address
    target = folder / source.name
    if target.exists():
        if target.samefile(source):
            return source.name
        raise OutputError(f"'{target}' exists; expected a folder without another URDF of that name")
    try:
        shutil.copyfile(source, target)
        if not _finds_as_many_meshes(target, source):
            target.unlink()
            target.symlink_to(source.resolve())
    except OSError as error:
        raise OutputError(f"cannot write '{target}': {error.strerror or error}") from error
    return source.name


def _in_package(source: Path) -> str:
    """Return the address of a file of an installed package, and an empty text for any other."""
    for folder in source.parents:
        if (folder / "package.xml").is_file():
            inside = source.relative_to(folder).as_posix()
            installed = package_file(folder.name, f"{folder.name}/{inside}")
            known = installed is not None and installed.resolve() == source
            return f"package://{folder.name}/{inside}" if known else ""
    return ""


def _finds_as_many_meshes(copy: Path, source: Path) -> bool:
    meshes = {
        visual.geometry.mesh.filename
        for link in parse_urdf(source).links
        for visual in link.visuals
        if visual.geometry.mesh is not None
    }
    return all(_is_found(mesh, copy) for mesh in meshes if _is_found(mesh, source))


def _is_found(mesh: str, urdf: Path) -> bool:
    from multimodal_to.replay.meshes import find_mesh

    try:
        find_mesh(mesh, urdf)
    except MultimodalError:
        return False
    return True

"""`load_robot`: a robot from a folder with a URDF and a `robot.toml`, or a bundled one by its name."""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from multimodal_to.adam import KinDynComputations
from multimodal_to.adam.inspection import is_placeholder
from multimodal_to.adam.spatial import Array, rotation_from_rpy
from multimodal_to.adam.tree import FixedFrame
from multimodal_to.adam.urdf import read_urdf
from multimodal_to.arguments import checked
from multimodal_to.errors import ModelError, MultimodalError, listed, unknown
from multimodal_to.files.packages import ROOT_VARIABLES, package_file, package_folders
from multimodal_to.files.reading import read_toml
from multimodal_to.files.records import Records
from multimodal_to.models import proportions
from multimodal_to.models.capsule import Capsule, plume
from multimodal_to.models.contact import ContactPoint
from multimodal_to.models.jet import ENGINES, Jet
from multimodal_to.models.proportions import Gait
from multimodal_to.models.robot import JointLimits, NamePairs, Posture, Robot, offsets_from_com
from multimodal_to.models.robot_keys import UNIONS, JetTable, JointTable, RobotFile
from multimodal_to.values import FrozenMapping

ROBOT_FILE = "robot.toml"
_RECORDS = Records(what="the robot", error=ModelError, unions=UNIONS)


def bundled_robots() -> dict[str, Path]:
    """Return the folders of the robots that come with the library, by name."""
    package = Path(__file__).parents[1]
    for folder in (package / "robots", package.parents[1] / "robots"):  # in a wheel; a checkout has them beside src/
        if found := {path.parent.name: path.parent for path in sorted(folder.glob(f"*/{ROBOT_FILE}"))}:
            return found
    return {}


@checked
def load_robot(robot: str | os.PathLike[str]) -> Robot:
    """Load a bundled robot by name, or any other from its folder.

    Raises:
        ModelError: there is no such robot, or its files are broken.
    """
    bundled = bundled_robots()
    folder = bundled.get(str(robot), Path(robot))
    if not os.path.isdir(folder):  # which takes names that no folder can have, too
        raise ModelError(f"{unknown('robot', str(robot), bundled)}; nor is there a folder of that name")
    path = folder / ROBOT_FILE
    table = read_toml(path, ModelError)
    try:
        return _robot(_RECORDS.read(RobotFile, _with_kinds(table)), folder)
    except MultimodalError as error:
        raise ModelError(f"{path}: {error}") from error


def _with_kinds(table: dict[str, Any]) -> dict[str, Any]:
    """Return the table of a file with the kind of each jet model said: the first where it is not."""
    models = table.get("jet_models")
    if not isinstance(models, dict):
        return table
    kind = {"kind": next(iter(ENGINES))}
    return {**table, "jet_models": {name: kind | of if isinstance(of, dict) else of for name, of in models.items()}}


def _robot(file: RobotFile, folder: Path) -> Robot:
    urdf = _urdf(file.urdf, folder)
    _refuse_faults(file, urdf)
    frames = _added_frames(file)
    kindyn = KinDynComputations(urdf, tuple(file.joints)).with_frames(frames)
    contacts = tuple(
        ContactPoint(frame=frame, foot=foot) for foot, frames in file.contact.feet.items() for frame in frames
    )
    home, links = _home(file), _link_capsules(file)
    jets = _jets(file, kindyn, home)
    contact_reach, jet_reach, gait = _proportions(file, kindyn, home)
    return Robot(
        name=file.name,
        urdf=urdf,
        kindyn=kindyn,
        joint_groups=FrozenMapping(file.joint_groups),
        joint_limits=_limits(file, kindyn),
        contacts=contacts,
        friction=file.contact.friction,
        jets=jets,
        home=home,
        contact_reach=contact_reach,
        jet_reach=jet_reach,
        gait=gait,
        link_capsules=links,
        ignored_pairs=_named_pairs("ignore", file.collision.ignore, links, jets),
        held_pairs=_named_pairs("hold_apart", file.collision.hold_apart, links, jets),
        lean_xyzw=_unit(file.home.lean_xyzw),
        added_frames=FrozenMapping(frames),
    )


def _urdf(address: str, folder: Path) -> Path:
    """Return the URDF that a robot's file names: inside its folder, where it may be a link, or in a package.

    Raises:
        ModelError: it is not found, or outside.
    """
    scheme, found, inside = address.partition("://")
    if found:
        return _in_package(address, scheme, inside, folder)
    if os.path.isabs(address) or Path(os.path.normpath(address)).parts[:1] in ((), ("..",)):  # a link may lead out
        raise ModelError(
            f"'urdf' is '{address}', which is outside the robot's folder; expected a path inside it, where a link may "
            "lie, or package://NAME/PATH"
        )
    return folder / address


def _in_package(address: str, scheme: str, inside: str, folder: Path) -> Path:
    name, _, path = inside.partition("/")
    path = os.path.normpath(path.replace("\\", "/")).lstrip("/") if path else ""
    if scheme not in ("package", "model") or not path or path.split("/", 1)[0] in ("..", "."):
        raise ModelError(f"'urdf' is '{address}'; expected a path inside the robot's folder, or package://NAME/PATH")
    folders = [root for root in package_folders(name, folder.absolute() / ROBOT_FILE) if root.is_dir()]
    for root in folders:
        if (root / path).is_file():
            return root / path
    if (installed := package_file(name, path)) is not None:
        return installed
    if folders:
        raise ModelError(f"'urdf' is '{address}', and the folder '{folders[0]}' has no '{path}'")
    raise ModelError(
        f"'urdf' is '{address}', which is not found: no folder '{name}' lies beside the robot's folder, above it or in "
        f"{', '.join(ROOT_VARIABLES)}, and no package '{name}' with this file is installed"
    )


def _refuse_faults(file: RobotFile, urdf: Path) -> None:
    """Refuse a file that names what does not exist, or twice; all of it is named at once.

    Raises:
        ModelError: it does, or the URDF cannot be read.
    """
    links, joints = read_urdf(urdf)
    movable = [joint.name for joint in joints if joint.kind != "fixed"]
    faults = [unknown("joint", name, movable) for name in file.joints if name not in movable]
    strange: dict[str, str] = {}  # a joint's first group
    for group, members in file.joint_groups.items():
        for member in (member for member in members if member not in file.joints):
            strange.setdefault(member, group)
        faults += _repeated(f"joint group '{group}': joint", members)
    faults += [f"joint group '{group}': {unknown('joint', name, file.joints)}" for name, group in strange.items()]
    names = [link.name for link in links]
    faults += [
        f"'frames.{name}': {unknown('link', of.link, names)}"
        for name, of in file.frames.items()
        if of.link not in names
    ]
    faults += [f"the frame '{name}' exists already; expected another name" for name in file.frames if name in names]
    known = dict.fromkeys((*names, *file.frames))
    contacts = [frame for frames in file.contact.feet.values() for frame in frames]
    used = (*contacts, *(jet.frame for jet in file.jet), *(capsule.link for capsule in file.capsule))
    faults += [unknown("frame", frame, known) for frame in dict.fromkeys(used) if frame not in known]
    faults += _repeated("contact point", contacts) + _repeated("jet", [jet.name for jet in file.jet])
    models = dict.fromkeys(jet.model for jet in file.jet if jet.model not in file.jet_models)
    faults += [unknown("jet model", model, file.jet_models) for model in models]
    if faults:
        raise ModelError("; ".join(faults))


def _repeated(kind: str, names: Sequence[str]) -> list[str]:
    repeated = [name for name, count in Counter(names).items() if count > 1]
    return [f"{kind} given twice: {listed(repeated)}"] if repeated else []


def _added_frames(file: RobotFile) -> dict[str, FixedFrame]:
    """Return the frames that the file adds, and one for each jet whose thrust is not along −z of the frame it names."""
    added = {
        name: FixedFrame(
            link=frame.link, rotation=rotation_from_rpy(*frame.rpy), translation=np.array(frame.position, dtype=float)
        )
        for name, frame in file.frames.items()
    }
    for jet in file.jet:
        if _thrust_frame(jet) != jet.frame:
            turn = _turn_to(-np.array(jet.thrust_axis))
            under = added.get(jet.frame, FixedFrame(link=jet.frame))
            added[_thrust_frame(jet)] = FixedFrame(
                link=under.link, rotation=under.rotation @ turn, translation=under.translation
            )
    return added


def _thrust_frame(jet: JetTable) -> str:
    """Return the frame whose −z is the direction of a jet's thrust."""
    x, y, z = jet.thrust_axis
    return jet.frame if x == y == 0 and z < 0 else f"{jet.frame} thrust of {jet.name}"


def _turn_to(direction: Array) -> Array:
    """Return the smallest rotation that brings z to a direction, (3, 3)."""
    z = direction / np.linalg.norm(direction)
    if z[2] < -1 + 1e-12:
        return np.diag([1.0, -1.0, -1.0])
    skew = np.array([[0.0, 0.0, z[0]], [0.0, 0.0, z[1]], [-z[0], -z[1], 0.0]])  # of e_z × z
    return np.asarray(np.eye(3) + skew + skew @ skew / (1.0 + z[2]))


def _limits(file: RobotFile, kindyn: KinDynComputations) -> JointLimits:
    """Return what the file says to plan in; of joints that others follow, cut to what the followers allow."""
    joints, tree = tuple(file.joints.values()), kindyn.tree
    lower, upper, speed = (np.array([getattr(joint, key) for joint in joints]) for key in ("lower", "upper", "speed"))
    for index in sorted({tree.joint_names.index(how.joint) for how in tree.followers.values()}):
        allowed, home = tree.joints[index], joints[index].home
        lower[index], upper[index] = max(lower[index], allowed.lower), min(upper[index], allowed.upper)
        speed[index] = min(speed[index], allowed.velocity) if allowed.velocity > 0 else speed[index]
        if not lower[index] <= home <= upper[index]:
            raise ModelError(
                f"home {home:g} of '{allowed.name}' is not within {lower[index]:g} to {upper[index]:g}, the range in "
                "which its mimic joints keep theirs"
            )
    return JointLimits(
        lower=lower,
        upper=upper,
        speed=speed,
        effort=np.array(
            [_effort(joint, stated.effort) for joint, stated in zip(joints, kindyn.tree.joints, strict=True)]
        ),
    )


def _effort(joint: JointTable, stated: float) -> float:
    """Return the effort limit of a joint [N m or N]; inf where none is known.

    Args:
        joint: its table in `robot.toml`, which may state one.
        stated: what the URDF states [N m or N]; a placeholder counts as nothing.
    """
    if joint.effort is not None:
        return joint.effort
    return np.inf if is_placeholder(stated) else stated


def _home(file: RobotFile) -> Posture:
    return Posture(
        base_position=np.array(file.home.base_position),
        base_quaternion_xyzw=_unit(file.home.base_quaternion_xyzw),
        joint_positions=np.array([joint.home for joint in file.joints.values()]),
    )


def _unit(quaternion_xyzw: Sequence[float]) -> Array:
    return np.asarray(np.array(quaternion_xyzw) / np.linalg.norm(quaternion_xyzw))


def _link_capsules(file: RobotFile) -> tuple[Capsule, ...]:
    return tuple(
        Capsule(
            name=entry.name or entry.link,
            frame=entry.link,
            start=np.array(entry.start),
            end=np.array(entry.start if entry.end is None else entry.end),
            radius=entry.radius,
        )
        for entry in file.capsule
    )


def _named_pairs(
    key: str, pairs: Sequence[tuple[str, str]], links: Sequence[Capsule], jets: Sequence[Jet]
) -> NamePairs:
    """Return the pairs of a key of `[collision]`.

    Args:
        key: of the table.
        pairs: as the file has them.
        links: the capsules of links.
        jets: whose plumes are capsules too.
    """
    names = [capsule.name for capsule in (*links, *(jet.plume for jet in jets if jet.plume is not None))]
    strange = dict.fromkeys(name for pair in pairs for name in pair if name not in names)
    faults = _repeated("capsule", names) + [f"'collision.{key}': {unknown('capsule', name, names)}" for name in strange]
    if faults:
        raise ModelError("; ".join(faults))
    return frozenset(frozenset(pair) for pair in pairs)


def _jets(file: RobotFile, kindyn: KinDynComputations, home: Posture) -> tuple[Jet, ...]:
    """Return the jets with their plumes.

    Args:
        file: with their tables.
        kindyn: kinematics of the robot, which are asked only for the length of a plume that is not stated.
        home: the home posture.
    """
    jets = []
    for entry in file.jet:
        jets.append(
            Jet(
                name=entry.name,
                frame=_thrust_frame(entry),
                model=file.jet_models[entry.model],
                thrust_max=entry.thrust_max,
                throttle_min=entry.throttle[0],
                throttle_max=entry.throttle[1],
                plume=_plume(entry, file, kindyn, home),
                drag=entry.drag,
            )
        )
    return tuple(jets)


def _plume(entry: JetTable, file: RobotFile, kindyn: KinDynComputations, home: Posture) -> Capsule | None:
    if entry.plume_length is None and entry.plume_radius is None:
        return None
    length = _standing_height(file, kindyn, home) if entry.plume_length is None else entry.plume_length
    radius = proportions.PLUME_RADIUS * length if entry.plume_radius is None else entry.plume_radius
    return plume(f"{entry.name} plume", _thrust_frame(entry), length, radius)


def _standing_height(file: RobotFile, kindyn: KinDynComputations, home: Posture) -> float:
    return proportions.standing_height(*_from_com(file, kindyn, home))


def _from_com(file: RobotFile, kindyn: KinDynComputations, home: Posture) -> tuple[Array, Array]:
    """Return where contact points and jets are from the CoM at home, in world axes [m], (count, 3) each."""
    contacts = [frame for frames in file.contact.feet.values() for frame in frames]
    return offsets_from_com(kindyn, home, contacts), offsets_from_com(kindyn, home, [jet.frame for jet in file.jet])


def _proportions(file: RobotFile, kindyn: KinDynComputations, home: Posture) -> tuple[Array, Array, Gait]:
    """Return the reach of contact points and of jets [m], (3,) each, and the gait: as stated, else in units of L.

    Args:
        file: what may state them.
        kindyn: kinematics of the robot, which are asked only for what is not stated.
        home: the home posture.
    """
    reach, gait = file.reach, file.gait
    if reach.contacts is not None and reach.jets is not None and gait.lift is not None:
        return np.array(reach.contacts), np.array(reach.jets), Gait(lift=gait.lift, swing=gait.swing)
    contacts, jets = _from_com(file, kindyn, home)
    height = proportions.standing_height(contacts, jets)
    return (
        _contact_reach(file, contacts, height) if reach.contacts is None else np.array(reach.contacts),
        proportions.turned_reach(jets, height) if reach.jets is None else np.array(reach.jets),
        Gait(lift=proportions.LIFT * height if gait.lift is None else gait.lift, swing=gait.swing),
    )


def _contact_reach(file: RobotFile, contacts: Array, height: float) -> Array:
    """Return the default reach of contact points [m], (3,); those that no joint moves tilt with the body, as jets do.

    Args:
        file: with its joints.
        contacts: offsets of the contact points [m], (contacts, 3).
        height: L [m].
    """
    return (proportions.contact_reach if file.joints else proportions.turned_reach)(contacts, height)

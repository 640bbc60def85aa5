"""`Robot`: a rigid-body tree with contact points and jets, read from a folder with a URDF and a `robot.toml`."""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import casadi as cs
import numpy as np

from multimodal_to.adam import KinDynComputations, quaternion
from multimodal_to.adam.inspection import is_placeholder
from multimodal_to.adam.spatial import Array, rotation_from_rpy
from multimodal_to.adam.tree import FixedFrame
from multimodal_to.adam.urdf import read_urdf
from multimodal_to.arguments import check_fields, checked, vector
from multimodal_to.errors import ModelError, MultimodalError, listed, unknown
from multimodal_to.files.packages import ROOT_VARIABLES, package_file, package_folders
from multimodal_to.files.reading import read_toml
from multimodal_to.files.records import Records
from multimodal_to.models import attitude, capsule_pairs, proportions
from multimodal_to.models.capsule import Capsule, CapsulePair, plume
from multimodal_to.models.contact import ContactPoint
from multimodal_to.models.jet import ENGINES, Jet
from multimodal_to.models.proportions import Gait
from multimodal_to.models.robot_keys import UNIONS, JetTable, JointTable, RobotFile
from multimodal_to.models.units import EARTH, Units
from multimodal_to.values import FrozenMapping, Value

ROBOT_FILE = "robot.toml"
_RECORDS = Records(what="the robot", error=ModelError, unions=UNIONS)
NamePairs = frozenset[frozenset[str]]
"""Pairs of capsules by their names."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Posture(Value):
    """A configuration of the robot: base in the world and joints; of ρ and −ρ it keeps the one of `attitude.signed`.

    Raises:
        InputError: a field is no vector of finite numbers, or one of another size.
    """

    base_position: Array  # (3,) [m]
    base_quaternion_xyzw: Array  # (4,), unit, world-from-base
    joint_positions: Array  # (n,) [rad or m]

    def __post_init__(self) -> None:
        for name, size in (("base_position", 3), ("base_quaternion_xyzw", 4), ("joint_positions", None)):
            object.__setattr__(self, name, vector(f"the posture's {name}", getattr(self, name), size))
        super().__post_init__()
        self.__setstate__({"base_quaternion_xyzw": attitude.signed(self.base_quaternion_xyzw)})

    @property
    def base_transform(self) -> Array:
        """Return w_H_base, (4, 4)."""
        transform = np.eye(4)
        transform[:3, :3] = np.array(quaternion.rotation_matrix(cs.DM(self.base_quaternion_xyzw)))
        transform[:3, 3] = self.base_position
        return transform


@dataclass(frozen=True, kw_only=True, eq=False)
class JointLimits(Value):
    """Ranges to plan in, each (n,) in the order of the joints.

    Raises:
        InputError: one is no vector of numbers.
    """

    lower: Array  # [rad or m]
    upper: Array  # [rad or m]
    speed: Array  # [rad/s or m/s]
    effort: Array  # [N m or N]; inf where none is known

    def __post_init__(self) -> None:
        for entry in fields(self):
            limits = vector(f"the joint limits' {entry.name}", getattr(self, entry.name), None, finite=False)
            object.__setattr__(self, entry.name, limits)
        super().__post_init__()


@dataclass(frozen=True, kw_only=True, eq=False)
class Robot(Value):
    """Everything that depends on the robot and not on the task.

    Raises:
        ModelError: a field is not what it is said to be here.
    """

    name: str
    urdf: Path
    kindyn: KinDynComputations = field(repr=False)
    joint_groups: Mapping[str, tuple[str, ...]]
    joint_limits: JointLimits
    contacts: tuple[ContactPoint, ...]
    friction: float
    jets: tuple[Jet, ...]
    home: Posture
    contact_reach: Array  # greatest distance of a contact point from the CoM in a plan, by world axis [m], (3,)
    jet_reach: Array  # greatest distance of a jet's frame from the CoM in a plan, by world axis [m], (3,)
    gait: Gait
    link_capsules: tuple[Capsule, ...] = ()  # shapes of links; `capsules` has the plumes beside
    ignored_pairs: NamePairs = frozenset()  # of capsules that may come as near as they like
    held_pairs: NamePairs = frozenset()  # of capsules that a problem holds apart; empty: `near_capsule_pairs` chooses
    lean_xyzw: Array = field(default_factory=lambda: np.array([0.0, 0.0, 0.0, 1.0]))
    """Rotation from upright to home in the base's axes, (4,): ρ_home = ρ_upright ∘ lean."""
    added_frames: Mapping[str, FixedFrame] = field(default_factory=lambda: FrozenMapping({}))
    """Frames that the URDF lacks, by name; `kindyn` has them."""

    def __post_init__(self) -> None:
        for name, size in (("contact_reach", 3), ("jet_reach", 3), ("lean_xyzw", 4)):
            object.__setattr__(self, name, vector(f"the robot's {name}", getattr(self, name), size, ModelError))
        check_fields(self, ModelError, "the robot's ")
        if not 0.0 <= self.friction < np.inf:
            raise ModelError(f"the robot's friction is {self.friction}; expected a number of at least zero")
        super().__post_init__()

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Return the joints in the order of s."""
        return self.kindyn.joint_names

    @property
    def contact_names(self) -> tuple[str, ...]:
        """Return the frames of the contact points."""
        return tuple(contact.frame for contact in self.contacts)

    @cached_property
    def feet(self) -> Mapping[str, tuple[int, ...]]:
        """Return the feet by name: which of the contact points each has, in order."""
        names = dict.fromkeys(contact.foot for contact in self.contacts)
        return {
            name: tuple(index for index, contact in enumerate(self.contacts) if contact.foot == name) for name in names
        }

    @property
    def jet_names(self) -> tuple[str, ...]:
        """Return the names of the jets."""
        return tuple(jet.name for jet in self.jets)

    @property
    def mass(self) -> float:
        """Return the total mass [kg]."""
        return self.kindyn.get_total_mass()

    @property
    def gravity(self) -> Array:
        """Return the acceleration of free fall in world axes [m/s²], (3,)."""
        return self.kindyn.gravity

    @property
    def weight(self) -> float:
        """Return m |g| [N]."""
        return self.mass * float(np.linalg.norm(self.gravity))

    @property
    def up(self) -> Array:
        """Return the unit vector against gravity in world axes, (3,); without gravity it is z."""
        strength = float(np.linalg.norm(self.gravity))
        return -self.gravity / strength if strength else np.array([0.0, 0.0, 1.0])

    @property
    def upright(self) -> Posture:
        """Return home without its lean: the attitude of the base in a hover, with home's heading."""
        turned = attitude.product(self.home.base_quaternion_xyzw, attitude.conjugate(self.lean_xyzw))
        return replace(self.home, base_quaternion_xyzw=attitude.tidied(turned))

    @cached_property
    def standing_height(self) -> float:
        """Return L [m], the robot's own unit of length: the height of its CoM above its contact points at home."""
        contacts = _offsets(self.kindyn, self.home, self.contact_names)
        jets = _offsets(self.kindyn, self.home, [jet.frame for jet in self.jets])
        return proportions.standing_height(contacts, jets)

    @checked
    def pose_at_home(self, frame: str) -> Array:
        """Return the pose of a link or frame at home in the world [m], (4, 4)."""
        return np.array(self.kindyn.forward_kinematics(frame, self.home.base_transform, self.home.joint_positions))

    @cached_property
    def units(self) -> Units:
        """Return the robot's own units: m, L and g, and how many contact points share the weight."""
        strength = float(np.linalg.norm(self.gravity))
        return Units(
            mass=self.mass,
            length=self.standing_height,
            gravity=strength or EARTH,
            contact_points=max(len(self.contacts), 1),
        )

    @cached_property
    def home_com(self) -> tuple[float, float, float]:
        """Return the CoM of home above the world's origin, with the lowest contact points at z = 0 [m], (x, y, z).

        Without contact points it is the CoM of home as `robot.toml` places it.
        """
        contacts = _offsets(self.kindyn, self.home, self.contact_names)
        if not len(contacts):
            x, y, z = (float(one) for one in self.com_at(self.home))
            return x, y, z
        return 0.0, 0.0, -float(contacts[:, 2].min())

    @property
    def capsules(self) -> tuple[Capsule, ...]:
        """Return the shapes of links, then the plumes of the jets that are in use."""
        return (*self.link_capsules, *(jet.plume for jet in self.jets if jet.plume is not None))

    @cached_property
    def _apart_at_home(self) -> dict[CapsulePair, float]:
        pairs = capsule_pairs.apart_at_home(
            self.kindyn, self.home.joint_positions, self.capsules, self.standing_height, self.held_pairs
        )
        return {pair: away for pair, away in pairs.items() if frozenset(c.name for c in pair) not in self.ignored_pairs}

    @cached_property
    def capsule_pairs(self) -> tuple[CapsulePair, ...]:
        """Return the pairs of capsules that have to keep apart: `models.capsule_pairs.apart_at_home`."""
        return tuple(self._apart_at_home)

    @cached_property
    def near_capsule_pairs(self) -> tuple[CapsulePair, ...]:
        """Return those of `capsule_pairs` that a problem holds apart.

        They are `held_pairs`. A robot that does not say them has those that are nearer than `models.capsule_pairs.NEAR`
        L at home, and can meet within the ranges of the joints.

        Raises:
            ModelError: two capsules of `held_pairs` are neighbours, or overlap at home, or are ignored.
        """
        if self.held_pairs:
            return self._stated_pairs()
        nearest = capsule_pairs.NEAR * self.standing_height
        pairs = [pair for pair, away in self._apart_at_home.items() if away < nearest]
        return capsule_pairs.within_reach(self.kindyn, self.joint_limits.lower, self.joint_limits.upper, pairs)

    def _stated_pairs(self) -> tuple[CapsulePair, ...]:
        by_names = {frozenset(capsule.name for capsule in pair): pair for pair in self.capsule_pairs}
        present = {capsule.name for capsule in self.capsules}  # not the plumes of jets that are not in use
        for names in self.held_pairs:
            if names <= present and names not in by_names:
                raise ModelError(
                    f"the capsules {listed(sorted(names))} cannot be held apart: they are neighbours in the tree, or "
                    "overlap at home, or are ignored"
                )
        return tuple(pair for names, pair in by_names.items() if names in self.held_pairs)

    @checked
    def with_jets(self, names: Sequence[str]) -> Robot:
        """Return the robot with only the jets of these names, in this order; with none it has none to use.

        Raises:
            ModelError: there is no such jet.
        """
        known = {jet.name: jet for jet in self.jets}
        for name in names:
            if name not in known:
                raise ModelError(unknown("jet", name, known))
        return replace(self, jets=tuple(known[name] for name in names))

    @checked
    def com_at(self, posture: Posture) -> Array:
        """Return where the CoM is in a posture, in the world [m], (3,)."""
        return np.array(self.kindyn.CoM_position(posture.base_transform, posture.joint_positions)).ravel()

    @checked
    def with_gravity(self, gravity: Sequence[float] | Array) -> Robot:
        """Return the robot under another gravity: three numbers in world axes [m/s²].

        Raises:
            InputError: gravity is not three finite numbers.
        """
        return replace(self, kindyn=self.kindyn.with_gravity(gravity))

    @checked
    def group_indices(self, group: str) -> list[int]:
        """Return where the joints of a named group stand in s.

        Raises:
            ModelError: there is no such group.
        """
        if group not in self.joint_groups:
            raise ModelError(unknown("joint group", group, self.joint_groups))
        return [self.joint_names.index(name) for name in self.joint_groups[group]]


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
    return _offsets(kindyn, home, contacts), _offsets(kindyn, home, [jet.frame for jet in file.jet])


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


def _offsets(kindyn: KinDynComputations, posture: Posture, frames: Sequence[str]) -> Array:
    """Return where frames are from the CoM in a posture, in world axes [m], (frames, 3).

    Args:
        kindyn: kinematics of the robot.
        posture: where it is.
        frames: names of links or frames.
    """
    com = np.array(kindyn.CoM_position(posture.base_transform, posture.joint_positions)).ravel()
    poses = [kindyn.forward_kinematics(frame, posture.base_transform, posture.joint_positions) for frame in frames]
    return np.array([np.array(pose)[:3, 3] - com for pose in poses]).reshape(-1, 3)

"""`Robot`: a rigid-body tree with contact points and jets, read from a folder with a URDF and a `robot.toml`."""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from types import MappingProxyType

import casadi as cs
import numpy as np

from multimodal_to.adam import KinDynComputations, quaternion
from multimodal_to.adam.spatial import Array
from multimodal_to.errors import ModelError, MultimodalError, listed, shown, unknown
from multimodal_to.files.reading import Table, read_toml
from multimodal_to.models import proportions
from multimodal_to.models.contact import ContactPoint
from multimodal_to.models.jet import Jet, JetModel
from multimodal_to.models.proportions import Gait

ROBOT_FILE = "robot.toml"


@dataclass(frozen=True, kw_only=True, eq=False)
class Posture:
    """A configuration of the robot: base in the world and joints."""

    base_position: Array  # (3,) [m]
    base_quaternion_xyzw: Array  # (4,), unit, world-from-base
    joint_positions: Array  # (n,) [rad or m]

    @property
    def base_transform(self) -> Array:
        """Return w_H_base, (4, 4)."""
        transform = np.eye(4)
        transform[:3, :3] = np.array(quaternion.rotation_matrix(cs.DM(self.base_quaternion_xyzw)))
        transform[:3, 3] = self.base_position
        return transform


@dataclass(frozen=True, kw_only=True, eq=False)
class JointLimits:
    """Ranges to plan in, each (n,) in the order of the joints."""

    lower: Array  # [rad or m]
    upper: Array  # [rad or m]
    speed: Array  # [rad/s or m/s]
    effort: Array  # [N m or N], as the URDF states it


@dataclass(frozen=True, kw_only=True, eq=False)
class Robot:
    """Everything that depends on the robot and not on the task."""

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

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Return the joints in the order of s."""
        return self.kindyn.joint_names

    @property
    def contact_names(self) -> tuple[str, ...]:
        """Return the frames of the contact points."""
        return tuple(contact.frame for contact in self.contacts)

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

    @cached_property
    def standing_height(self) -> float:
        """Return L [m], the robot's own unit of length: the height of its CoM above its contact points at home."""
        contacts = _offsets(self.kindyn, self.home, self.contact_names)
        jets = _offsets(self.kindyn, self.home, [jet.frame for jet in self.jets])
        return proportions.standing_height(contacts, jets)

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
    inside = package / "robots"  # in an installed wheel; a checkout keeps them beside src/
    folder = inside if inside.is_dir() else package.parents[1] / "robots"
    return {path.parent.name: path.parent for path in sorted(folder.glob(f"*/{ROBOT_FILE}"))}


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
        return _robot(Table(table, "the top level", ModelError), folder)
    except MultimodalError as error:
        raise ModelError(f"{path}: {error}") from error


def _robot(table: Table, folder: Path) -> Robot:
    name, urdf = table.text("name"), folder / table.text("urdf")
    if folder.resolve() not in urdf.resolve().parents:
        raise ModelError(f"'urdf' is '{urdf}', which is outside the robot's folder")
    joints = table.table("joints")
    joint_names = joints.names()
    kindyn = KinDynComputations(urdf, joint_names)
    limits, home_joints = _joints(joints, joint_names, kindyn)
    groups = table.table("joint_groups")
    joint_groups = {group: groups.texts(group) for group in groups.names()}
    for group, members in joint_groups.items():
        for member in members:
            if member not in joint_names:
                raise ModelError(f"joint group '{group}': {unknown('joint', member, joint_names)}")
    contact, home = table.table("contact"), table.table("home")
    friction = contact.number("friction")
    if friction <= 0:
        raise ModelError(f"'friction' is {friction}; expected a positive number")
    feet = contact.table("feet")
    contacts = tuple(ContactPoint(frame=frame, foot=foot) for foot in feet.names() for frame in feet.texts(foot))
    jets = _jets(table)
    _refuse_repeated("contact point", [point.frame for point in contacts])
    _refuse_repeated("jet", [jet.name for jet in jets])
    for frame in (*(point.frame for point in contacts), *(jet.frame for jet in jets)):
        kindyn.tree.frame(frame)
    quaternion = home.numbers("base_quaternion_xyzw", 4)
    if abs(np.linalg.norm(quaternion) - 1) > 1e-3:
        raise ModelError(f"'base_quaternion_xyzw' has the norm {np.linalg.norm(quaternion):.4f}; expected 1")
    posture = Posture(
        base_position=home.numbers("base_position", 3),
        base_quaternion_xyzw=quaternion / np.linalg.norm(quaternion),
        joint_positions=home_joints,
    )
    contact_reach, jet_reach, gait = _proportions(table, kindyn, posture, contacts, jets)
    for part in (contact, home, table):
        part.done()
    return Robot(
        name=name,
        urdf=urdf,
        kindyn=kindyn,
        joint_groups=MappingProxyType(joint_groups),
        joint_limits=limits,
        contacts=contacts,
        friction=friction,
        jets=jets,
        home=posture,
        contact_reach=contact_reach,
        jet_reach=jet_reach,
        gait=gait,
    )


def _proportions(
    table: Table, kindyn: KinDynComputations, home: Posture, contacts: Sequence[ContactPoint], jets: Sequence[Jet]
) -> tuple[Array, Array, Gait]:
    """Return the reach of contact points and of jets [m], (3,) each, and the gait: as stated, else in units of L."""
    reach, gait = (table.table(key) if key in table else Table({}, f"[{key}]", ModelError) for key in ("reach", "gait"))
    points = _offsets(kindyn, home, [contact.frame for contact in contacts])
    nozzles = _offsets(kindyn, home, [jet.frame for jet in jets])
    height = proportions.standing_height(points, nozzles)
    contact_reach = reach.numbers("contacts", 3, default=proportions.contact_reach(points, height))
    jet_reach = reach.numbers("jets", 3, default=proportions.jet_reach(nozzles, height))
    lift = gait.number("lift", default=proportions.LIFT * height)
    swing = gait.number("swing", default=proportions.SWING)
    for key, axes in (("contacts", contact_reach), ("jets", jet_reach)):
        if min(axes) <= 0:
            raise ModelError(f"'{key}' in [reach] is {shown(axes.tolist())}; expected three positive numbers [m]")
    if lift <= 0:
        raise ModelError(f"'lift' in [gait] is {lift}; expected a positive number [m]")
    if not 0 < swing <= 1:
        raise ModelError(f"'swing' in [gait] is {swing}; expected a number above 0 and at most 1")
    reach.done()
    gait.done()
    return contact_reach, jet_reach, Gait(lift=lift, swing=swing)


def _offsets(kindyn: KinDynComputations, posture: Posture, frames: Sequence[str]) -> Array:
    """Return where frames are from the CoM in a posture, in world axes [m], (frames, 3)."""
    com = np.array(kindyn.CoM_position(posture.base_transform, posture.joint_positions)).ravel()
    poses = [kindyn.forward_kinematics(frame, posture.base_transform, posture.joint_positions) for frame in frames]
    return np.array([np.array(pose)[:3, 3] - com for pose in poses]).reshape(-1, 3)


def _refuse_repeated(kind: str, names: Sequence[str]) -> None:
    if repeated := [name for name, count in Counter(names).items() if count > 1]:
        raise ModelError(f"{kind} given twice: {listed(repeated)}")


def _joints(joints: Table, names: Sequence[str], kindyn: KinDynComputations) -> tuple[JointLimits, Array]:
    rows = []
    for name in names:
        entry = joints.table(name)
        lower, upper, home = entry.number("lower"), entry.number("upper"), entry.number("home")
        speed = entry.number("speed")
        entry.done()
        if not lower <= home <= upper:
            raise ModelError(f"joint '{name}': home {home} is not within its range {lower} to {upper}")
        if speed <= 0:
            raise ModelError(f"joint '{name}': speed is {speed}; expected a positive number")
        rows.append((lower, upper, speed, home))
    columns = np.array(rows, dtype=float).reshape(-1, 4).T
    effort = np.array([joint.effort for joint in kindyn.tree.joints])
    return JointLimits(lower=columns[0], upper=columns[1], speed=columns[2], effort=effort), columns[3]


def _jets(table: Table) -> tuple[Jet, ...]:
    coefficients = tuple(JetModel.__dataclass_fields__)
    entries = table.tables("jet")
    models: dict[str, JetModel] = {}
    if entries:
        known = table.table("jet_models")
        for name in known.names():
            entry = known.table(name)
            models[name] = JetModel(**{key: entry.number(key) for key in coefficients})
            entry.done()
    jets = []
    for entry in entries:
        model = entry.text("model")
        if model not in models:
            raise ModelError(unknown("jet model", model, models))
        throttle_min, throttle_max = entry.numbers("throttle", 2)
        jet = Jet(
            name=entry.text("name"),
            frame=entry.text("frame"),
            model=models[model],
            thrust_max=entry.number("thrust_max"),
            throttle_min=float(throttle_min),
            throttle_max=float(throttle_max),
        )
        entry.done()
        if not (jet.thrust_max > 0 and throttle_min < throttle_max):
            raise ModelError(f"jet '{jet.name}': expected a positive thrust_max and a throttle range that rises")
        jets.append(jet)
    return tuple(jets)

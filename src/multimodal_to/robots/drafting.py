"""What a URDF tells of a robot, and guesses at what it does not: feet, limbs, a home posture, ranges and jets."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import casadi as cs
import numpy as np

from multimodal_to.adam import KinDynComputations, quaternion
from multimodal_to.adam.inspection import VELOCITY_PLACEHOLDER
from multimodal_to.adam.lean_tree import independent
from multimodal_to.adam.spatial import Array, rotation_from_rpy
from multimodal_to.adam.tree import BASE, FixedFrame, Joint, Link
from multimodal_to.adam.urdf import parse_urdf, read_urdf
from multimodal_to.errors import ModelError, unknown
from multimodal_to.models import attitude, proportions
from multimodal_to.robots.feet import contact_points
from multimodal_to.robots.posture import Leg, Stance, balanced, near_zero
from multimodal_to.robots.shapes import points_of_links
from multimodal_to.robots.srdf import GroupState, home_state
from multimodal_to.robots.structure import (
    Limb,
    body_points,
    carried,
    feet_of,
    leaves,
    limbs_of,
    middle_of,
    named,
    others_named,
)
from multimodal_to.values import FrozenMapping, Value

LIGHT = 0.005
"""A joint of no leg that carries less than this share of the robot's mass is held still [1]."""
FULL_TURNS = 4.0 * np.pi
"""A range longer than this is a placeholder [rad]."""
FOLDED, ALMOST_STRAIGHT = 2.8, 0.1  # range of a knee whose URDF states none [rad]
SPEED = 2.0
"""Speed of a joint whose URDF states none [√(g / L) rad/s, or √(g L) m/s]."""
LONGER = 0.05
"""How much farther from the CoM than with its leg stretched a contact point may be [L]."""
ALONG = 0.6
"""How far along the ground a contact point may be from its hip, as a share of the leg's length [1]."""
AHEAD = 0.02
"""How far ahead of the ankle the middle of a sole is at least where it tells where ahead is [L]."""
_SAME_PLACE = 1e-3  # of a contact point and a link's frame [m]


@dataclass(frozen=True, kw_only=True)
class Range:
    """Range and speed of a joint to plan in, and what of it is a guess."""

    lower: float
    upper: float
    speed: float
    guesses: tuple[str, ...]


@dataclass(frozen=True, kw_only=True, eq=False)
class Draft(Value):
    """A robot as it is found; x is ahead, y to the left and z up at home."""

    name: str
    urdf: Path
    kindyn: KinDynComputations  # with the frames of contact points
    joints: tuple[Joint, ...]  # those that move, as the URDF has them
    ranges: tuple[Range, ...]  # of each
    stance: Stance  # at home
    state: GroupState | None  # that home was taken from
    bent_legs: tuple[str, ...]  # that were straight there
    left_out: Mapping[str, str]  # joints that are held still, each with the reason
    groups: Mapping[str, tuple[str, ...]]
    frames: Mapping[str, FixedFrame]  # contact points that are no links
    feet: Mapping[str, tuple[str, ...]]
    jets: Mapping[str, tuple[float, float, float]]  # direction of the thrust in each jet's frame
    reach: Array | None  # of contact points [m], (3,)

    @property
    def base_height(self) -> float:
        """Return how high the base's origin is where the lowest contact point is on the ground [m]."""
        return -float(self.contacts[:, 2].min(initial=0.0))

    @property
    def home(self) -> Array:
        """Return s at home, (n,)."""
        return self.stance.joints

    @property
    def base_quaternion_xyzw(self) -> Array:
        """Return how the base is turned at home, (4,)."""
        if self.state is not None:
            return np.array(self.state.base_quaternion_xyzw)
        yaw = np.arctan2(self.stance.turn[1, 0], self.stance.turn[0, 0])
        return attitude.tidied(np.array([0.0, 0.0, np.sin(0.5 * yaw), np.cos(0.5 * yaw)]))

    @property
    def contacts(self) -> Array:
        """Return the contact points at home, with the base at the world's origin [m], (points, 3)."""
        return self.stance.places([name for names in self.feet.values() for name in names])

    @property
    def standing_height(self) -> float:
        """Return L [m]."""
        com = self.stance.com
        return proportions.standing_height(self.contacts - com, self.stance.places(tuple(self.jets)) - com)


def draft(urdf: Path, *, jets: Sequence[str] = (), contacts: bool = True, name: str | None = None) -> Draft:
    """Return what a URDF tells of a robot, and guesses at the rest.

    Args:
        urdf: the file.
        jets: frames that an engine sits in.
        contacts: look for feet; without, the robot touches nothing.
        name: of the robot, by default the URDF's own.

    Raises:
        ModelError: the URDF cannot be read, a frame does not exist, or the robot has nothing to stand on.
    """
    links, joints = read_urdf(urdf)
    own_name = str(parse_urdf(urdf).name)
    left_out = {joint.name: "the URDF gives it no effort and no speed" for joint in joints if _undriven(joint)}
    kindyn = KinDynComputations(urdf, [one for one in independent(joints, {}) if one not in left_out])
    for frame in jets:
        if frame not in kindyn.tree.frames:
            raise ModelError(unknown("frame", frame, kindyn.tree.frames))
    ends = _links_of(kindyn, (BASE, *leaves(kindyn.tree)))
    points = points_of_links(urdf, ends)
    state = home_state(urdf, own_name, frozenset(kindyn.joint_names))
    stance = _stance(kindyn, state)
    feet = feet_of(stance, body_points(stance, points))
    if light := _light(kindyn, links, feet):
        soles = [kindyn.tree.bodies[foot].name for foot in feet]
        left_out |= light
        kindyn = KinDynComputations(urdf, [one for one in kindyn.joint_names if one not in light])
        feet = tuple(kindyn.tree.frame(link).body for link in soles)
        stance = _stance(kindyn, state)
    shapes = body_points(stance, points)
    if state is None and (turned := _heading(stance, shapes, feet)):
        stance = replace(stance, turn=rotation_from_rpy(0.0, 0.0, -0.5 * np.pi * turned))
        shapes = body_points(stance, points)
    if contacts and not feet and (kindyn.joint_names or BASE not in shapes) and not jets:
        raise ModelError(_no_feet(kindyn, shapes))
    return _with_contacts(
        urdf=urdf,
        name=name or own_name,
        stance=stance,
        state=state,
        shapes=shapes,
        feet=(feet or (BASE,) * (BASE in shapes)) if contacts else (),
        jets=jets,
        left_out=left_out,
    )


def _with_contacts(
    *,
    urdf: Path,
    name: str,
    stance: Stance,
    state: GroupState | None,
    shapes: Mapping[int, Array],
    feet: Sequence[int],
    jets: Sequence[str],
    left_out: Mapping[str, str],
) -> Draft:
    """Return the draft of a robot whose feet are known.

    Args:
        urdf: the file.
        name: of the robot.
        stance: with the joints that move.
        state: that it comes from.
        shapes: points on bodies [m], (points, 3).
        feet: bodies that the robot stands on.
        jets: frames of engines.
        left_out: joints that are held still.
    """
    tree = stance.kindyn.tree
    ends = {end: middle_of(stance, end, shapes) for end in leaves(tree)}
    legs, others, torso = limbs_of(tree, feet, ends)
    legs_by_name, others_by_name = named(legs, ends, "leg"), others_named(others, ends)
    by_foot = {limb.end: leg.replace("leg", "foot") for leg, limb in legs_by_name.items()} or {BASE: "base"}
    frames: dict[str, FixedFrame] = {}
    contacts = {by_foot[foot]: _contact_frames(stance, shapes, foot, by_foot[foot], frames) for foot in feet}
    kindyn = stance.kindyn.with_frames(frames)
    stance = replace(stance, kindyn=kindyn)
    standing = {leg: _leg(stance, limb, contacts[by_foot[limb.end]]) for leg, limb in legs_by_name.items()}
    bent_legs = []
    for name_of_leg, leg in standing.items():
        bent_legs += [name_of_leg] if leg.is_straight(stance.joints) else []
        stance = replace(stance, joints=leg.bent(stance.joints))
    stance = balanced(stance, tuple(standing.values()))
    unfinished = Draft(
        name=name,
        urdf=urdf,
        kindyn=kindyn,
        joints=kindyn.tree.joints,
        ranges=(),
        stance=stance,
        state=state,
        bent_legs=tuple(bent_legs),
        left_out=FrozenMapping(left_out),
        groups=FrozenMapping(_groups(kindyn, legs_by_name, others_by_name, torso)),
        frames=FrozenMapping(frames),
        feet=FrozenMapping(contacts),
        jets=FrozenMapping({frame: _up_in(stance, frame) for frame in jets}),
        reach=None,
    )
    height = unfinished.standing_height
    knees = {kindyn.joint_names[int(np.abs(leg.stretch(stance.joints)[0]).argmax())] for leg in standing.values()}
    ranges = (
        _range(joint, home, joint.name in knees, height)
        for joint, home in zip(kindyn.tree.joints, stance.joints, strict=True)
    )
    return replace(unfinished, ranges=tuple(ranges), reach=_reach(stance, tuple(standing.values()), height))


def _groups(
    kindyn: KinDynComputations, legs: Mapping[str, Limb], others: Mapping[str, Limb], torso: tuple[str, ...]
) -> dict[str, tuple[str, ...]]:
    """Return the groups of joints: each limb, all legs, all arms, the torso, and all that is no leg.

    Args:
        kindyn: kinematics of the robot.
        legs: by name.
        others: by name.
        torso: joints that carry several limbs.
    """
    groups = {name: limb.joints for name, limb in (*legs.items(), *others.items())}
    arms = [limb for name, limb in others.items() if "arm" in name]
    for group, limbs in (("legs", tuple(legs.values())), ("arms", tuple(arms))):
        if limbs:
            groups[group] = _in_order(kindyn, (joint for limb in limbs for joint in limb.joints))
    if torso:
        groups["torso"] = torso
    if upper := _in_order(kindyn, (*torso, *(joint for limb in others.values() for joint in limb.joints))):
        groups["upper_body"] = upper
    return groups


# -------------------------------------------------------------------- joints


def _undriven(joint: Joint) -> bool:
    endless = not np.isfinite(joint.upper - joint.lower) or joint.upper - joint.lower > FULL_TURNS
    return joint.kind != "fixed" and endless and joint.effort <= 0 and joint.velocity <= 0


def _stance(kindyn: KinDynComputations, state: GroupState | None) -> Stance:
    """Return how the robot stands in an SRDF, or else with joints at zero, or near zero where that is outside."""
    stated = {} if state is None else state.positions
    values = [stated.get(joint.name, near_zero(joint.lower, joint.upper)) for joint in kindyn.tree.joints]
    limits = [(joint.lower, joint.upper) for joint in kindyn.tree.joints]
    joints = np.array([min(max(value, lower), upper) for value, (lower, upper) in zip(values, limits, strict=True)])
    turn = np.eye(3)
    if state is not None:
        turn = np.array(quaternion.rotation_matrix(cs.DM(attitude.tidied(np.array(state.base_quaternion_xyzw)))))
    return Stance(kindyn=kindyn, turn=turn, joints=joints)


def _light(kindyn: KinDynComputations, links: Sequence[Link], feet: Sequence[int]) -> dict[str, str]:
    """Return the joints of no leg that carry next to nothing, each with the reason to hold it still.

    Args:
        kindyn: kinematics of the robot.
        links: of the URDF.
        feet: bodies that the robot stands on.
    """
    tree, found = kindyn.tree, {}
    in_legs = {tree.bodies[body].column for foot in feet for body in tree.path(foot)}
    for column, name in enumerate(tree.joint_names):
        moved = {i for i in range(len(tree.bodies)) if any(tree.bodies[body].column == column for body in tree.path(i))}
        mass = sum(link.mass for link in links if tree.frame(link.name).body in moved)
        if column not in in_legs and mass < LIGHT * tree.total_mass:
            found[name] = f"it carries {1000 * mass:.3g} g, less than {100 * LIGHT:g} % of the robot"
    return found


def _range(joint: Joint, home: float, is_knee: bool, height: float) -> Range:
    """Return what to plan a joint in, with guesses where the URDF has placeholders.

    Args:
        joint: as the URDF has it, with what its followers allow.
        home: where it is at home [rad or m].
        is_knee: it is the joint that changes the length of a leg most.
        height: L [m].
    """
    lower, upper, speed, guesses = joint.lower, joint.upper, joint.velocity, []
    if not upper - lower <= FULL_TURNS:
        if is_knee and abs(home) > ALMOST_STRAIGHT:
            ends = sorted(np.sign(home) * np.array([ALMOST_STRAIGHT, max(FOLDED, abs(home))]))
            lower, upper = float(ends[0]), float(ends[1])
            guesses.append("range guessed, a knee that bends one way: the URDF has a placeholder")
        else:
            lower, upper = min(-3.14, home), max(3.14, home)
            guesses.append("range guessed: the URDF has a placeholder")
    elif lower == upper:
        guesses.append(
            f"it cannot move: the URDF's range is {lower:g} to {upper:g}, which it also is where none is stated"
        )
    if not 0 < speed < VELOCITY_PLACEHOLDER:
        unit = (9.81 * height) ** 0.5 if joint.kind == "prismatic" else (9.81 / height) ** 0.5
        speed = float(f"{SPEED * unit:.2g}")
        guesses.append(f"speed guessed: the URDF has {joint.velocity:g}")
    return Range(lower=lower, upper=upper, speed=speed, guesses=tuple(guesses))


def _in_order(kindyn: KinDynComputations, joints: Iterable[str]) -> tuple[str, ...]:
    wanted = set(joints)
    return tuple(name for name in kindyn.joint_names if name in wanted)


# -------------------------------------------------------------------- feet


def _no_feet(kindyn: KinDynComputations, shapes: Mapping[int, Array]) -> str:
    """Return why a robot has nothing to stand on."""
    what = "no shape of a link was found to stand on"
    if shapes:
        lowest = min(shapes, key=lambda body: float(shapes[body][:, 2].min()))
        what = f"the lowest link is '{kindyn.tree.bodies[lowest].name}', and no limb reaches below the base"
    return (
        f"no feet were found: {what}. An arm on a table or a robot on wheels is none that walks or flies; name the "
        "frames of its engines with --jet, or make a robot that touches nothing with --no-contacts"
    )


def _contact_frames(
    stance: Stance, shapes: Mapping[int, Array], foot: int, name: str, frames: dict[str, FixedFrame]
) -> tuple[str, ...]:
    """Return the frames of the contact points of a foot; those that are no link's are added to `frames`.

    Args:
        stance: of the robot at home.
        shapes: points on bodies [m], (points, 3).
        foot: the body.
        name: of the foot.
        frames: takes what is new.
    """
    tree = stance.kindyn.tree
    lowest = min(float(points[:, 2].min()) for points in shapes.values())
    places = contact_points(shapes[foot], float(stance.com[2]) - lowest)
    link = tree.bodies[foot].name if foot != BASE else tree.base
    pose = stance.pose(link)
    own = [one for one, frame in tree.frames.items() if frame.body == foot]
    origins = stance.places(own)
    found = []
    for index, place in enumerate(places):
        near = np.linalg.norm(origins - place, axis=1)
        if near.min() < _SAME_PLACE:
            found.append(own[int(near.argmin())])
            continue
        new = name if len(places) == 1 else f"{name}_{index + 1}"
        while new in tree.frames:
            new += "_contact"
        frames[new] = FixedFrame(link=link, translation=np.round(pose[:3, :3].T @ (place - pose[:3, 3]), 5))
        found.append(new)
    return tuple(found)


def _leg(stance: Stance, limb: Limb, contacts: tuple[str, ...]) -> Leg:
    tree = stance.kindyn.tree
    columns = tuple(tree.joint_names.index(name) for name in limb.joints)
    first = next(body for body in tree.path(limb.end) if tree.bodies[body].column in columns)
    turn = np.full(len(tree.joints), np.pi)
    return Leg(
        kindyn=stance.kindyn,
        turn=stance.turn,
        root=tree.bodies[first].name,
        contacts=contacts,
        columns=columns,
        lower=np.maximum([joint.lower for joint in tree.joints], -turn),
        upper=np.minimum([joint.upper for joint in tree.joints], turn),
    )


def _reach(stance: Stance, legs: Sequence[Leg], height: float) -> Array | None:
    """Return how far from the CoM contact points may be, by world axis [m], (3,): by the lengths of legs.

    Args:
        stance: of the robot at home.
        legs: of the robot; None is returned where there are none.
        height: L [m].
    """
    found, tree = [], stance.kindyn.tree
    for leg in legs:
        links = [tree.bodies[body].name for body in tree.path(tree.frame(leg.contacts[0]).body)]
        chain = stance.places(links[links.index(leg.root) :])
        foot = leg.places(stance.joints)[0]
        length = np.linalg.norm(np.diff(chain, axis=0), axis=1).sum() + np.linalg.norm(foot - chain[-1], axis=1).max()
        hip = chain[0] - stance.com
        along = np.linalg.norm(hip[:2]) + ALONG * length
        found.append([along, along, abs(hip[2]) + length + LONGER * height])
    return np.round(np.max(found, axis=0), 3) if found else None


# -------------------------------------------------------------------- places


def _links_of(kindyn: KinDynComputations, bodies: Sequence[int]) -> list[str]:
    links = carried(kindyn.tree)
    return [link for body in bodies for link in links.get(body, ())]


def _heading(stance: Stance, shapes: Mapping[int, Array], feet: Sequence[int]) -> int:
    """Return where soles point to from their ankles, in quarter turns to the left of x; zero where they do not say.

    Args:
        stance: of the robot at home.
        shapes: points on bodies [m], (points, 3).
        feet: bodies that the robot stands on.
    """
    ahead, height = [], float(stance.com[2]) - min((float(of[:, 2].min()) for of in shapes.values()), default=0.0)
    for foot in feet:
        corners = contact_points(shapes[foot], height)
        if len(corners) > 1:
            ahead.append((corners.mean(axis=0) - stance.places([stance.kindyn.tree.bodies[foot].name])[0])[:2])
    x, y = np.mean(ahead, axis=0) if ahead else (0.0, 0.0)
    if max(abs(x), abs(y)) < AHEAD * height or min(abs(x), abs(y)) > 0.5 * max(abs(x), abs(y)):
        return 0
    return int(np.round(np.arctan2(y, x) / (0.5 * np.pi)))


def _up_in(stance: Stance, frame: str) -> tuple[float, float, float]:
    """Return which axis of a frame, or its opposite, points up most at home."""
    up = stance.pose(frame)[2, :3]
    axis = int(np.abs(up).argmax())
    found = [0.0, 0.0, 0.0]
    found[axis] = float(np.sign(up[axis]))
    return found[0], found[1], found[2]

"""Links and joints into a `Tree` with fixed and locked joints gone, in the form that needs the fewest operations.

A symbolic algorithm pays for every operation in all derivatives to come, so the tree is made lean without changing the
robot:

* Every joint moves its body about or along the body's **z**. Frames follow Denavit and Hartenberg in Craig's form where
  a body has a next joint: x along the common normal of the two axes, so that the constant rotation from one body to
  the next is Rx(α), a signed permutation on most robots.
* Mass is **regrouped** towards the base (Gautier and Khalil 1990): a thin rod along a revolute axis neither gains nor
  loses momentum when the joint turns, so that part of each body's inertia (its mass, the first moment along z, and
  Iyy) belongs to the parent as well. The bodies behind revolute joints end up without mass, and most terms vanish.

CoM, momenta, energies, mass matrix and all forces of the whole robot are the same as before; the inertia of one single
body is not the one of its URDF link any more.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import casadi as cs
import numpy as np

from multimodal_to.adam.spatial import Inertia, rotation_from_rpy
from multimodal_to.adam.tree import BASE, Body, Frame, Joint, Link, Mimic, Tree
from multimodal_to.errors import ModelError, listed, unknown

_SNAP, _FINE_SNAP = 1e-12, 1e-14
"""Entries of constant rotations and offsets closer than this to 0 or ±1 are taken as meant [1, m]. The fine one holds
for a robot whose angles were rounded to about this size, as 1.57079632679: the other would catch some of them only."""
_PARALLEL = 1e-3
"""Axes whose angle has a smaller sine count as parallel: their common normal would be too far away."""
_NOISE = 1e-16
"""First moments [kg m] and inertias [kg m²] smaller than this are rounding."""
_FAR = 1e9
"""No joint is held farther away than this [rad or m]."""
_NEGATIVE = 1e-6
"""A principal inertia below zero by more than this part of the largest is no rounding."""


@dataclass(kw_only=True)
class _Draft:
    """A body while the tree is made (numpy): its frame in the parent's at zero, what it carries, who hangs on it."""

    name: str
    parent: int
    joint: Joint | None
    follows: Mimic | None  # of the moving joints; itself, once, where it is one of them
    rotation: np.ndarray
    translation: np.ndarray
    inertia: Inertia = field(default_factory=Inertia.zero)
    offset: float = 0.0
    frames: dict[str, tuple[np.ndarray, np.ndarray]] = field(default_factory=dict)
    children: list[_Draft] = field(default_factory=list)


def build_tree(
    links: Sequence[Link], joints: Sequence[Joint], moving: Sequence[str], locked: Mapping[str, float] | None = None
) -> Tree:
    """Return the tree of a robot in which the joints named in `moving` move, in that order, and those that mimic them.

    Every other joint that could move is held at its value in `locked` [rad or m], or at zero, or, when it mimics
    another, where that one holds it. A mimic joint that is named in `locked` is held there, whatever moves.

    Args:
        links: of the URDF.
        joints: of the URDF.
        moving: names of the joints that move, in the order of s.
        locked: positions of other joints, by name [rad or m].

    Raises:
        ModelError: the links and joints form no tree with one root, a name is unknown or given twice, a joint of
            `moving` mimics another, mimic joints lead nowhere, or the masses are no robot's.
    """
    by_name = {joint.name: joint for joint in joints}
    _check_names(by_name, moving, locked or {})
    held, followers = _held_and_following(by_name, moving, locked or {})
    follows = {name: Mimic(joint=name) for name in moving} | followers
    root, below = _connect(links, joints)
    link_of = {link.name: link for link in links}
    columns = {name: column for column, name in enumerate(moving)}
    drafts = [_Draft(name=root, parent=-1, joint=None, follows=None, rotation=np.eye(3), translation=np.zeros(3))]

    pending = [(root, BASE, np.eye(3), np.zeros(3))]
    while pending:
        name, body, rotation, translation = pending.pop()
        drafts[body].frames[name] = (rotation, translation)
        drafts[body].inertia += _inertia(link_of[name]).rotated(cs.DM(rotation)).shifted(cs.DM(translation))
        for joint in reversed(below.get(name, [])):
            child_rotation = rotation @ joint.rotation
            child_translation = translation + rotation @ joint.translation
            how = follows.get(joint.name)
            if joint.kind != "fixed":  # a follower starts where it is when its leader is at zero
                start = held[joint.name] if how is None else how.offset
                child_rotation, child_translation = _displaced(joint, start, child_rotation, child_translation)
            if how is None:
                pending.append((joint.child, body, child_rotation, child_translation))
                continue
            child = _Draft(
                name=joint.child,
                parent=body,
                joint=joint,
                follows=how,
                rotation=child_rotation,
                translation=child_translation,
            )
            drafts[body].children.append(child)
            drafts.append(child)
            pending.append((joint.child, len(drafts) - 1, np.eye(3), np.zeros(3)))

    _check_masses(drafts)
    for draft in drafts[1:]:
        _choose_frame(draft)
    snap = _snap(drafts[1:])
    for draft in reversed(drafts[1:]):
        _regroup(draft, drafts[draft.parent], snap)
    return Tree(
        base=root,
        bodies=tuple(_finish(draft, columns, snap) for draft in drafts),
        frames={
            name: Frame(
                body=body, rotation=cs.DM(_snapped(rotation, snap)), translation=cs.DM(_snapped(translation, snap))
            )
            for body, draft in enumerate(drafts)
            for name, (rotation, translation) in draft.frames.items()
        },
        joints=tuple(_limited(by_name[name], followers, by_name) for name in moving),
        followers=followers,
        locked=held,
        merged={name: draft.name for draft in drafts for name in draft.frames if name != draft.name},
        total_mass=float(sum(link.mass for link in links)),
    )


def _check_names(by_name: Mapping[str, Joint], moving: Sequence[str], locked: Mapping[str, float]) -> None:
    movable = {name: joint for name, joint in by_name.items() if joint.kind != "fixed"}
    for name in (*moving, *locked):
        if name not in movable:
            raise ModelError(unknown("joint", name, movable))
    if repeated := [name for name, count in Counter(moving).items() if count > 1]:
        raise ModelError(f"joint given twice: {listed(repeated)}")
    if both := sorted(set(moving) & set(locked)):
        raise ModelError(f"joint both moving and locked: {listed(both)}")


def independent(joints: Sequence[Joint], locked: Mapping[str, float]) -> list[str]:
    """Return the joints that can move on their own: neither fixed nor locked, and mimics of no other."""
    return [
        joint.name for joint in joints if joint.kind != "fixed" and joint.mimic is None and joint.name not in locked
    ]


def _held_and_following(
    by_name: Mapping[str, Joint], moving: Sequence[str], locked: Mapping[str, float]
) -> tuple[dict[str, float], dict[str, Mimic]]:
    """Return of the joints that could move but are not in `moving` where they are held, or how they follow one of it.

    Mimic joints of mimic joints are put together: q = m (m' q' + o') + o. What leads to a joint that is locked, fixed,
    or left out of `moving` is held.
    """
    stated = {name: float(value) for name, value in locked.items()}
    if wrong := [name for name, value in stated.items() if not np.isfinite(value)]:
        raise ModelError(f"joint '{wrong[0]}' is locked at {stated[wrong[0]]}; expected a finite number")
    for name in moving:
        if mimic := by_name[name].mimic:
            raise ModelError(
                f"joint '{name}' mimics '{mimic.joint}' and cannot move on its own; leave it out of the joints that "
                "move, and it follows"
            )

    held: dict[str, float] = {}
    followers: dict[str, Mimic] = {}
    for name in (name for name, joint in by_name.items() if joint.kind != "fixed" and name not in moving):
        how, passed = Mimic(joint=name), [name]
        while how.joint not in moving and how.joint not in stated and (mimic := by_name[how.joint].mimic) is not None:
            if by_name[how.joint].kind == "fixed":
                break
            _check_leader(passed, mimic.joint, by_name)
            passed.append(mimic.joint)
            how = Mimic(
                joint=mimic.joint,
                multiplier=how.multiplier * mimic.multiplier,
                offset=how.multiplier * mimic.offset + how.offset,
            )
        _check_size(name, how)
        if how.joint in moving and how.multiplier:
            followers[name] = how
        else:
            held[name] = how.multiplier * stated.get(how.joint, 0.0) + how.offset
            if not abs(held[name]) <= _FAR:
                raise ModelError(f"joint '{name}' is held at {held[name]:g}; expected at most {_FAR:g} in size")
    return held, followers


def _check_leader(passed: Sequence[str], leader: str, by_name: Mapping[str, Joint]) -> None:
    """Refuse a mimic joint, the last of `passed`, whose leader does not exist or has been passed on the way to it."""
    if leader not in by_name:
        movable = [name for name, joint in by_name.items() if joint.kind != "fixed"]
        raise ModelError(f"joint '{passed[-1]}' mimics an {unknown('joint', leader, movable)}")
    if leader in passed:
        circle = passed[passed.index(leader) :]
        if len(circle) == 1:
            raise ModelError(f"joint '{leader}' mimics itself; expected another joint")
        raise ModelError(f"the joints {listed(circle)} mimic each other in a circle; expected one that moves first")


def _check_size(name: str, how: Mimic) -> None:
    for what, number in (("multiplier", how.multiplier), ("offset", how.offset)):
        if not abs(number) <= _FAR:
            raise ModelError(f"joint '{name}' mimics '{how.joint}' by the {what} {number:g}; expected at most {_FAR:g}")


def _limited(leader: Joint, followers: Mapping[str, Mimic], by_name: Mapping[str, Joint]) -> Joint:
    """Return a joint with the limits that its followers keep as well.

    Its range is what its own and theirs have in common: lower ≤ m q + o ≤ upper. With its speed q̇ they move at m q̇, so
    each allows its own limit over |m|. Its torque τ gives a follower τ / m, so each allows its own limit times |m|, as
    in a train of gears, where all of the load may be at one of them. Limits of speed and torque of zero or less stand
    for none. Where the ranges have nothing in common, the joint keeps its own, and `inspection` says so.
    """
    lower, upper, velocity, effort = [leader.lower], [leader.upper], [leader.velocity], [leader.effort]
    for name, how in followers.items():
        if how.joint != leader.name:
            continue
        follower, size = by_name[name], abs(how.multiplier)
        ends = sorted((end - how.offset) / how.multiplier for end in (follower.lower, follower.upper))
        lower.append(ends[0])
        upper.append(ends[1])
        velocity += [follower.velocity / size] if follower.velocity > 0 else []
        effort += [follower.effort * size] if follower.effort > 0 else []
    low, high = max(lower) + 0.0, min(upper) + 0.0  # no −0
    if low > high:
        low, high = leader.lower, leader.upper
    return replace(leader, lower=low, upper=high, velocity=min(velocity), effort=min(effort))


def _check_masses(drafts: Sequence[_Draft]) -> None:
    """Refuse a robot without mass and bodies that no density could make; a light link may err if its body does not."""
    if sum(float(draft.inertia.mass) for draft in drafts) <= 0:
        raise ModelError("the robot has no mass: no link has an <inertial> with one")
    for draft in drafts:
        mass, first = float(draft.inertia.mass), np.array(draft.inertia.first_moment).ravel()
        about_com = np.array(draft.inertia.about_origin)
        if mass > 0:
            about_com = about_com - (first @ first * np.eye(3) - np.outer(first, first)) / mass
        smallest, _, largest = np.linalg.eigvalsh(about_com)
        if smallest < -_NEGATIVE * max(abs(largest), abs(smallest) / 2, 1e-9):
            others = [name for name in draft.frames if name != draft.name]
            merged = f" (with {listed(others)}, which move with it)" if others else ""
            raise ModelError(
                f"link '{draft.name}'{merged} has an inertia with the negative principal value {smallest:.3g} kg m²"
            )


def _connect(links: Sequence[Link], joints: Sequence[Joint]) -> tuple[str, dict[str, list[Joint]]]:
    """Return the root's name and the joints below each link; refuse everything that is no tree."""
    names = dict.fromkeys(link.name for link in links)
    above: dict[str, Joint] = {}
    below: dict[str, list[Joint]] = {}
    for joint in joints:
        for end in (joint.parent, joint.child):
            if end not in names:
                raise ModelError(f"joint '{joint.name}' names the link '{end}', which does not exist")
        if joint.child in above:
            other = above[joint.child].name
            raise ModelError(f"link '{joint.child}' is the child of two joints, '{other}' and '{joint.name}'")
        above[joint.child] = joint
        below.setdefault(joint.parent, []).append(joint)
    roots = [name for name in names if name not in above]
    reached = set(roots)
    pending = [*roots]
    while pending:
        found = [joint.child for joint in below.get(pending.pop(), [])]
        reached.update(found)
        pending.extend(found)
    if loop := [name for name in names if name not in reached]:
        raise ModelError(f"the joints form a loop through the links {listed(loop)}; expected a tree")
    if len(roots) != 1:
        raise ModelError(f"the links form {len(roots)} trees, with the roots {listed(roots)}; expected one root")
    return roots[0], below


def _inertia(link: Link) -> Inertia:
    return Inertia(link.mass, cs.DM.zeros(3, 1), cs.DM(link.inertia)).shifted(cs.DM(link.com))


def _displaced(
    joint: Joint, value: float, rotation: np.ndarray, translation: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return the child's frame after the joint has moved from zero to `value` [rad or m].

    Args:
        joint: the joint that moves.
        value: its position [rad or m].
        rotation: of the child's frame with the joint at zero, (3, 3).
        translation: of the child's frame with the joint at zero, (3,) [m].
    """
    if value == 0:
        return rotation, translation
    if joint.kind == "prismatic":
        return rotation, translation + rotation @ joint.axis * value
    skew = np.array(cs.skew(cs.DM(joint.axis)))
    turned = np.eye(3) + np.sin(value) * skew + (1 - np.cos(value)) * skew @ skew
    return rotation @ turned, translation


def _choose_frame(draft: _Draft) -> None:
    """Put a body's frame on its joint's axis: z along it, x and origin by the common normal with the next joint's axis.

    A body without a next joint takes the previous one, which is z through the parent's origin.
    """
    assert draft.joint is not None
    axis = draft.joint.axis
    if draft.children:
        following = draft.children[0]
        assert following.joint is not None
        point, other = following.translation, following.rotation @ following.joint.axis
    else:
        point, other = -draft.rotation.T @ draft.translation, draft.rotation.T @ np.array([0.0, 0.0, 1.0])
    normal, along = _common_normal(axis, point, other)
    turn = np.column_stack([normal, np.cross(axis, normal), axis])  # old-from-new
    shift = np.zeros(3) if draft.joint.kind == "prismatic" else axis * along
    _reframe(draft, turn, shift)
    if draft.joint.kind != "prismatic":
        _absorb_offset(draft)


def _common_normal(axis: np.ndarray, point: np.ndarray, other: np.ndarray) -> tuple[np.ndarray, float]:
    """Return the direction of the common normal of `axis` through 0 and `other` through `point`, and its foot [m].

    (Nearly) parallel lines get one in the direction of `point`, or any, with its foot at 0.
    """
    normal = np.cross(axis, other)
    sine = np.linalg.norm(normal)
    if sine > _PARALLEL:
        return normal / sine, float(np.cross(point, other) @ normal / sine**2)
    across = point - axis * (axis @ point)
    if np.linalg.norm(across) < _PARALLEL:
        across = np.eye(3)[np.argmin(np.abs(axis))]
        across = across - axis * (axis @ across)
    return across / np.linalg.norm(across), 0.0


def _reframe(draft: _Draft, turn: np.ndarray, shift: np.ndarray) -> None:
    """Replace a body's frame by one turned and shifted (old-from-new), and restate everything seen from it."""
    draft.translation = draft.translation + draft.rotation @ shift
    draft.rotation = draft.rotation @ turn
    draft.inertia = draft.inertia.shifted(cs.DM(-shift)).rotated(cs.DM(turn.T))
    for child in draft.children:
        child.translation, child.rotation = turn.T @ (child.translation - shift), turn.T @ child.rotation
    for name, (rotation, translation) in draft.frames.items():
        draft.frames[name] = (turn.T @ rotation, turn.T @ (translation - shift))


def _absorb_offset(draft: _Draft) -> None:
    """Split the constant rotation C = Rz(θ) Rx(α) Rz(ψ) and keep C Rz(−ψ): the joint's angle starts at ψ instead."""
    rotation = draft.rotation
    if np.hypot(rotation[2, 0], rotation[2, 1]) > _PARALLEL:  # bottom row: (sin α sin ψ, sin α cos ψ, cos α)
        offset = np.arctan2(rotation[2, 0], rotation[2, 1])
    else:  # α is 0 or π, and all turning counts as ψ
        offset = np.arctan2(rotation[1, 0], rotation[0, 0]) * np.sign(rotation[2, 2])
    draft.rotation = rotation @ rotation_from_rpy(0.0, 0.0, -offset)
    draft.offset = float(offset)


def _regroup(draft: _Draft, parent: _Draft, snap: float) -> None:
    """Hand to the parent the part of its child's inertia that moves as if it belonged to the parent."""
    assert draft.joint is not None
    whole = draft.inertia
    if draft.joint.kind == "prismatic":  # the bodies turn together
        given = Inertia(0.0, cs.DM.zeros(3, 1), whole.about_origin)
    else:  # a thin rod along the axis
        along, about = whole.first_moment[2], whole.about_origin[1, 1]
        given = Inertia(whole.mass, cs.vertcat(0, 0, along), cs.diag(cs.vertcat(about, about, 0)))
    draft.inertia = Inertia(
        whole.mass - given.mass, whole.first_moment - given.first_moment, whole.about_origin - given.about_origin
    )
    parent.inertia += given.rotated(cs.DM(_snapped(draft.rotation, snap))).shifted(cs.DM(draft.translation))


def _snap(drafts: Sequence[_Draft]) -> float:
    """Return how close to 0 or ±1 an entry is taken as meant: finer where some are about `_SNAP` away."""
    entries = [values.ravel() for draft in drafts for values in (draft.rotation, draft.translation)]
    entries += [values.ravel() for draft in drafts for pose in draft.frames.values() for values in pose]
    away = np.concatenate([np.zeros(1), *(np.abs(values - _nearest(values)) for values in entries)])
    return _FINE_SNAP if ((away >= _SNAP) & (away < 10 * _SNAP)).any() else _SNAP


def _nearest(values: np.ndarray) -> np.ndarray:
    return np.clip(np.round(values), -1, 1)


def _snapped(values: np.ndarray, snap: float) -> np.ndarray:
    """Return the values with 0 and ±1 where they are closer than `snap`."""
    nearest = _nearest(values)
    return np.where(np.abs(values - nearest) < snap, nearest, values)


def _finish(draft: _Draft, columns: Mapping[str, int], snap: float) -> Body:
    joint = draft.joint
    return Body(
        name=draft.name,
        parent=draft.parent,
        joint=None if joint is None else joint.name,
        prismatic=joint is not None and joint.kind == "prismatic",
        column=-1 if draft.follows is None else columns[draft.follows.joint],
        multiplier=1.0 if draft.follows is None else draft.follows.multiplier,
        rotation=cs.DM(_snapped(draft.rotation, snap)),
        translation=cs.DM(_snapped(draft.translation, snap)),
        offset=draft.offset,
        inertia=Inertia(
            float(draft.inertia.mass),
            cs.DM(_without_noise(draft.inertia.first_moment)),
            cs.DM(_without_noise(draft.inertia.about_origin)),
        ),
    )


def _without_noise(values: cs.DM) -> np.ndarray:
    array = np.array(values)
    return np.where(np.abs(array) < _NOISE, 0.0, array)

"""What a URDF holds, for a person: the tree with its masses, what was merged or locked, and what looks wrong."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from multimodal_to.adam.lean_tree import build_tree, independent
from multimodal_to.adam.singular import described, massless_motions
from multimodal_to.adam.tree import Joint, Link, Mimic, Tree
from multimodal_to.adam.urdf import read_urdf, unread_elements
from multimodal_to.arguments import checked

EFFORT_PLACEHOLDER = 1e4
"""No joint of a robot that walks gives this much [N m or N]."""
VELOCITY_PLACEHOLDER = 1e3
"""No joint of a robot that walks turns this fast [rad/s or m/s]."""
FAR = 2.0
"""A CoM farther than this from its link's origin [m] is most likely in the wrong unit."""
RADIUS = 5.0
"""A radius of gyration above this [m] is most likely in the wrong unit."""
_ROUNDING = 1e-3
"""Principal inertias that miss the triangle inequality by less than this part were rounded."""


@dataclass(frozen=True, kw_only=True)
class Finding:
    """Something that looks wrong: of which link or joint, and what, as the end of a sentence about it."""

    subject: str
    text: str

    def __str__(self) -> str:
        return f"{self.subject} {self.text}"


@dataclass(frozen=True, kw_only=True)
class Branch:
    """A link in the tree, and the joint that it hangs on (None for the base)."""

    depth: int
    link: Link
    joint: Joint | None
    state: str  # "base", "moves", "fixed", "follows ...", or "locked at ..."


@dataclass(frozen=True, kw_only=True)
class Description:
    """What a URDF holds."""

    tree: Tree
    branches: tuple[Branch, ...]  # depth first
    findings: tuple[Finding, ...]

    def __str__(self) -> str:
        tree, moving = self.tree, len(self.tree.joints)
        lines = [
            f"{len(self.branches)} links, {moving} moving joints ({6 + moving} degrees of freedom with the base "
            f"'{tree.base}'), {tree.total_mass:.3f} kg",
            "",
            *(_line(branch) for branch in self.branches),
            "",
            f"frames: {len(tree.frames)}, one for each link; merged into the body they move with: {len(tree.merged)}",
            *(f"  {link} → {body}" for link, body in tree.merged.items()),
            f"mimic joints: {len(tree.followers)}",
            *(f"  {joint} = {how}" for joint, how in tree.followers.items()),
            f"locked joints: {len(tree.locked)}",
            *(f"  {joint} at {value:g}" for joint, value in tree.locked.items()),
            f"looks wrong: {len(self.findings)}",
            *(f"  {finding}" for finding in self.findings),
        ]
        return "\n".join(lines)


@checked
def describe(
    urdf: str | os.PathLike[str],
    joint_names: Sequence[str] | None = None,
    locked: Mapping[str, float] | None = None,
) -> Description:
    """Return what a URDF holds; by default all joints move that can, and those that mimic another follow it.

    Args:
        urdf: path of a URDF, or its XML text.
        joint_names: joints that move, in the order of s.
        locked: positions of joints held still, by name [rad or m]; zero by default.

    Raises:
        ModelError: the file is missing or no URDF, or it describes something that no robot can have.
    """
    links, joints = read_urdf(urdf)
    locked = dict(locked or {})
    if joint_names is None:
        joint_names = independent(joints, locked)
    tree = build_tree(links, joints, joint_names, locked)
    unread = (
        Finding(subject=owner, text=f"holds {elements}, which is not known and not read")
        for owner, elements in unread_elements(urdf)
    )
    return Description(
        tree=tree, branches=_branches(tree, links, joints), findings=(*unread, *findings(tree, links, joints))
    )


def findings(tree: Tree, links: Sequence[Link], joints: Sequence[Joint]) -> tuple[Finding, ...]:
    """Return what looks wrong about the links and joints, link by link and joint by joint.

    Args:
        tree: the robot that the links and joints form.
        links: of the URDF.
        joints: of the URDF.
    """
    found = [Finding(subject=f"link '{link.name}'", text=text) for link in links for text in _link_findings(link)]
    moving, carried = {joint.name: joint for joint in tree.joints}, _carried_masses(tree, links, joints)
    for joint in joints:
        texts = list(joint.remarks)
        if joint.name in tree.followers:
            texts += _follower_findings(joint, tree.followers[joint.name], moving)
        elif joint.kind != "fixed":
            kept = moving.get(joint.name, joint)
            why = "" if (kept.lower, kept.upper) == (joint.lower, joint.upper) else " with what its mimic joints allow"
            texts += _joint_findings(kept, carried.get(joint.name), why)
        found += [Finding(subject=f"joint '{joint.name}'", text=text) for text in texts]
    for group in massless_motions(tree):
        if len(group) > 1 or not group[0] or carried[group[0]] > 0:  # else the joint itself has said it
            subject, text = described(tree, group)
            found.append(Finding(subject=subject, text=text))
    return tuple(found)


def _link_findings(link: Link) -> Iterator[str]:
    """Yield what looks wrong about one link; a link without any inertial is a frame and no fault."""
    if link.mass == 0 and not link.inertia.any():
        return
    yield from link.remarks
    if link.mass == 0:
        yield "has an inertia but no mass"
    if np.linalg.norm(link.com) > FAR:
        yield f"has its CoM {np.linalg.norm(link.com):.3g} m from its origin"
    smallest, middle, largest = np.linalg.eigvalsh(link.inertia)
    if smallest < 0:
        yield f"has the negative principal inertia {smallest:.3g} kg m²"
    elif largest == 0:
        yield f"has a mass of {link.mass:g} kg but no inertia"
    elif largest - smallest - middle > _ROUNDING * largest:
        yield (
            "has an inertia that no body can have: of its principal values "
            f"{smallest:.3g}, {middle:.3g} and {largest:.3g} kg m², the last is more than the others together"
        )
    if link.mass > 0 and largest > link.mass * RADIUS**2:
        yield f"has an inertia of {largest:.3g} kg m², far too much for {link.mass:g} kg"


def is_placeholder(effort: float) -> bool:
    """Return whether an effort limit [N m or N] is a number that stands for none: `EFFORT_PLACEHOLDER`, or zero."""
    return bool(np.isfinite(effort) and (effort >= EFFORT_PLACEHOLDER or effort <= 0))


def _joint_findings(joint: Joint, carried_mass: float | None, why: str) -> Iterator[str]:
    """Yield what looks wrong about one joint that can move.

    Args:
        joint: in the range that is left to it.
        carried_mass: what it moves [kg], None if it is locked.
        why: its range is smaller than the URDF says, as a part of a sentence; empty where it is not.
    """
    if is_placeholder(joint.effort):
        yield f"has the effort limit {joint.effort:g}, which looks like a placeholder"
    if np.isfinite(joint.velocity) and (joint.velocity >= VELOCITY_PLACEHOLDER or joint.velocity <= 0):
        yield f"has the velocity limit {joint.velocity:g}, which looks like a placeholder"
    if joint.lower == joint.upper:
        yield f"has the range {joint.lower:g} to {joint.upper:g}{why}, so it cannot move"
    if joint.kind == "revolute" and joint.upper - joint.lower > 4 * np.pi and np.isfinite(joint.upper - joint.lower):
        yield f"has the range {joint.lower:g} to {joint.upper:g} rad, which looks like a placeholder or degrees"
    if carried_mass == 0:
        yield "moves nothing that has mass, so its acceleration is undefined"


def _follower_findings(joint: Joint, how: Mimic, moving: Mapping[str, Joint]) -> Iterator[str]:
    """Yield what looks wrong about how a joint follows another.

    Args:
        joint: the follower.
        how: it follows.
        moving: the joints that move on their own, by name, in ranges that their followers keep if they can.
    """
    leader = moving[how.joint]
    ends = sorted(how.multiplier * end + how.offset for end in (leader.lower, leader.upper))
    if ends[0] < joint.lower - _ROUNDING or ends[1] > joint.upper + _ROUNDING:
        yield (
            f"follows '{how.joint}' at {how}, which leaves its own range {joint.lower:g} to {joint.upper:g}: no range "
            f"of '{how.joint}' keeps all that follow it in theirs"
        )


def _carried_masses(tree: Tree, links: Sequence[Link], joints: Sequence[Joint]) -> dict[str, float]:
    """Return for each joint that moves on its own the mass [kg] that it and its followers carry."""
    below, carried = _masses_below(links, joints), dict.fromkeys(tree.joint_names, 0.0)
    for joint in joints:
        leader = tree.followers[joint.name].joint if joint.name in tree.followers else joint.name
        if leader in carried:
            carried[leader] += below[joint.child]
    return carried


def _masses_below(links: Sequence[Link], joints: Sequence[Joint]) -> dict[str, float]:
    """Return for each link the mass [kg] of all that hangs on it, itself included."""
    above = {joint.child: joint.parent for joint in joints}
    carried = dict.fromkeys((link.name for link in links), 0.0)
    for link in links:
        name: str | None = link.name
        while name is not None:
            carried[name] += link.mass
            name = above.get(name)
    return carried


def _branches(tree: Tree, links: Sequence[Link], joints: Sequence[Joint]) -> tuple[Branch, ...]:
    link_of = {link.name: link for link in links}
    below: dict[str, list[Joint]] = {}
    for joint in joints:
        below.setdefault(joint.parent, []).append(joint)
    branches: list[Branch] = []
    pending: list[tuple[int, str, str, Joint | None]] = [(0, tree.base, "base", None)]
    while pending:
        depth, name, state, above = pending.pop()
        branches.append(Branch(depth=depth, link=link_of[name], joint=above, state=state))
        for joint in reversed(below.get(name, [])):
            if joint.name in tree.followers:
                how = tree.followers[joint.name]
                state = f"follows {how.joint}" + (f": {how}" if str(how) != how.joint else "")
            elif joint.name in tree.locked:
                state = f"locked at {tree.locked[joint.name]:g}"
            else:
                state = "fixed" if joint.kind == "fixed" else "moves"
            pending.append((depth + 1, joint.child, state, joint))
    return tuple(branches)


def _line(branch: Branch) -> str:
    mass = f"{branch.link.mass:.3f} kg" if branch.link.mass else "no mass"
    start = f"{'  ' * branch.depth}{branch.link.name}  {mass}"
    if branch.joint is None:
        return start
    joint = branch.joint
    state = joint.kind if branch.state == "moves" else branch.state
    if branch.state == "moves" and np.isfinite(joint.upper - joint.lower):
        state += f" {joint.lower:g} to {joint.upper:g} {'m' if joint.kind == 'prismatic' else 'rad'}"
    return f"{start}  ← {joint.name} ({state})"

"""What the branches of a robot's tree are: its legs, its torso, and its other limbs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from multimodal_to.adam.spatial import Array
from multimodal_to.adam.tree import BASE, Tree
from multimodal_to.robots.posture import Stance

AS_LOW = 0.1
"""A foot is at most this much higher than the lowest point of the robot, as a share of the robot's height [1]."""
_ASIDE = 0.1
"""A limb hangs on a side where it is farther from the middle than this, as a share of the robot's width [1]."""


@dataclass(frozen=True, kw_only=True)
class Limb:
    """A chain of joints that ends in a body without a joint behind it."""

    end: int  # its last body
    joints: tuple[str, ...]  # those of its own, from the torso on


def carried(tree: Tree) -> dict[int, tuple[str, ...]]:
    """Return the links that each body carries, by the body's index."""
    found: dict[int, list[str]] = {}
    for name, frame in tree.frames.items():
        found.setdefault(frame.body, []).append(name)
    return {body: tuple(names) for body, names in found.items()}


def leaves(tree: Tree) -> tuple[int, ...]:
    """Return the bodies that no joint hangs on, the base left out."""
    parents = {body.parent for body in tree.bodies}
    return tuple(index for index in range(1, len(tree.bodies)) if index not in parents)


def body_points(stance: Stance, points: Mapping[str, Array]) -> dict[int, Array]:
    """Return points on each body that has a shape [m], (points, 3).

    Args:
        stance: of the robot.
        points: on links, in the links' frames [m], (points, 3).
    """
    found: dict[int, list[Array]] = {}
    for link, own in points.items():
        pose = stance.pose(link)
        found.setdefault(stance.kindyn.tree.frame(link).body, []).append(own @ pose[:3, :3].T + pose[:3, 3])
    return {body: np.vstack(parts) for body, parts in found.items()}


def feet_of(stance: Stance, points: Mapping[int, Array]) -> tuple[int, ...]:
    """Return the bodies that a robot stands on: ends of limbs as low as its lowest one, and lower than its base.

    There are none where the CoM is not above them: an arm hangs down beside its table.

    Args:
        stance: of the robot at home.
        points: on its bodies [m], (points, 3).
    """
    ends = leaves(stance.kindyn.tree)
    lowest = {end: float(points[end][:, 2].min()) for end in ends if end in points}
    if not lowest:
        return ()
    bodies = [points[body] for body in (BASE, *lowest) if body in points]
    height = float(np.ptp(np.vstack(bodies)[:, 2]))
    under = float(points[BASE][:, 2].min()) if BASE in points else 0.0
    floor = min(lowest.values())
    found = [end for end, low in lowest.items() if low <= floor + AS_LOW * height and low < under - AS_LOW * height]
    if not found:
        return ()
    away = np.mean([_middle(points[end]) for end in found], axis=0) - stance.com
    return tuple(found) if np.linalg.norm(away[:2]) < -away[2] else ()


def middle_of(stance: Stance, body: int, points: Mapping[int, Array]) -> Array:
    """Return the middle of a body, or its frame's origin where it has no shape [m], (3,).

    Args:
        stance: of the robot.
        body: its index.
        points: on bodies [m], (points, 3).
    """
    if body in points:
        return _middle(points[body])
    return np.asarray(stance.places([stance.kindyn.tree.bodies[body].name])[0])


def _middle(points: Array) -> Array:
    return np.asarray(0.5 * (points.min(axis=0) + points.max(axis=0)))


def limbs_of(
    tree: Tree, feet: Sequence[int], where: Mapping[int, Array]
) -> tuple[tuple[Limb, ...], tuple[Limb, ...], tuple[str, ...]]:
    """Return the legs of a robot, its other limbs, and the joints of its torso.

    The torso is what carries limbs of both sides, or a leg and another limb.

    Args:
        tree: of the robot.
        feet: the bodies at the ends of its legs.
        where: the ends of its limbs are at home [m], (3,) each.
    """
    ends = leaves(tree)
    below: dict[int, set[int]] = {}
    for end in ends:
        for body in tree.path(end):
            below.setdefault(body, set()).add(end)
    width = float(np.ptp([where[end][1] for end in ends])) if ends else 0.0

    def carries_both(body: int) -> bool:
        sides = [where[end][1] for end in below[body]]
        feet_below = sum(1 for end in below[body] if end in feet)
        return (max(sides) > _ASIDE * width and min(sides) < -_ASIDE * width) or 0 < feet_below < len(sides)

    torso = [body for body in below if carries_both(body)]
    done: set[str] = {name for body in torso for name in _joints(tree, (body,))}
    limbs: dict[int, Limb] = {}
    for end in sorted(ends, key=lambda end: (end not in feet, -len(tree.path(end)))):
        own = tuple(name for name in _joints(tree, tree.path(end)) if name not in done)
        done |= set(own)
        if own:
            limbs[end] = Limb(end=end, joints=own)
    order = {name: index for index, name in enumerate(tree.joint_names)}
    known = sorted(limbs.values(), key=lambda limb: order[limb.joints[0]])
    torso_joints = {name for body in torso for name in _joints(tree, (body,))}
    return (
        tuple(limb for limb in known if limb.end in feet),
        tuple(limb for limb in known if limb.end not in feet),
        tuple(name for name in tree.joint_names if name in torso_joints),
    )


def _joints(tree: Tree, bodies: Sequence[int]) -> tuple[str, ...]:
    """Return the joints of bodies that move on their own; a follower has its leader's."""
    return tuple(dict.fromkeys(tree.joint_names[tree.bodies[body].column] for body in bodies))


def named(limbs: Sequence[Limb], where: Mapping[int, Array], kind: str) -> dict[str, Limb]:
    """Return limbs by names that say where they are, as `left_leg` or `front_right_leg`.

    Args:
        limbs: all of one kind.
        where: their ends are at home [m], (3,) each; x ahead, y to the left.
        kind: what a limb is called.
    """
    places = np.array([where[limb.end] for limb in limbs]).reshape(-1, 3)
    spread, middle = np.ptp(places, axis=0) if limbs else np.zeros(3), places.mean(axis=0) if limbs else np.zeros(3)
    names = []
    for place in places - middle:
        aside = ("left_" if place[1] > 0 else "right_") if spread[1] > _ASIDE * spread.max() else ""
        ahead = ("front_" if place[0] > 0 else "hind_") if len(limbs) > 2 and spread[0] > 0.3 * spread[1] else ""
        names.append(ahead + aside + kind)
    if len(set(names)) < len(names):
        names = [f"{kind}_{index + 1}" for index in range(len(limbs))]
    return dict(zip(names, limbs, strict=True))


def others_named(limbs: Sequence[Limb], where: Mapping[int, Array]) -> dict[str, Limb]:
    """Return limbs that are no legs by names: arms at the sides, and a head or a tail in the middle.

    Args:
        limbs: that are no legs.
        where: their ends are at home [m], (3,) each; x ahead, y to the left.
    """
    sides = np.array([where[limb.end][1] for limb in limbs])
    width = float(np.ptp(sides)) if limbs else 0.0
    central = [abs(side) < 2 * _ASIDE * width for side in sides - (0.5 * (sides.max() + sides.min()) if limbs else 0.0)]
    arms = [limb for limb, inside in zip(limbs, central, strict=True) if not inside]
    rest = [limb for limb, inside in zip(limbs, central, strict=True) if inside]
    return named(arms, where, "arm") | named(rest, where, "head")

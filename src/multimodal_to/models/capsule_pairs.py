"""Which pairs of capsules have to keep apart: chosen by the tree, the home posture and the ranges of the joints.

Nothing is chosen by chance: the random postures are the same in every run.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from itertools import combinations

import numpy as np

from multimodal_to.adam import KinDynComputations
from multimodal_to.adam.spatial import Array
from multimodal_to.adam.tree import Tree
from multimodal_to.models.capsule import Capsule, CapsulePair, exact_distances

FEWEST_JOINTS = 3
"""Capsules with fewer joints between them are neighbours, which meet where they are joined."""
AT_HOME = 0.03
"""Capsules that are nearer than this at home touch there: neighbours, or a fault of their fit [L]."""
NEAR = 0.45
"""A problem holds those pairs apart that are nearer than this at home [L]: motions stay around it."""
POSTURES = 4000
"""Random postures that tell whether two capsules can meet."""
MEET = 0.001
"""Two capsules can meet that overlap in this share of the random postures [1]."""


def apart_at_home(
    kindyn: KinDynComputations,
    home: Array,
    capsules: Sequence[Capsule],
    standing_height: float,
    stated: Collection[frozenset[str]] = (),
) -> dict[CapsulePair, float]:
    """Return the pairs that have to keep apart, each with its distance at home [m].

    Left out are pairs with fewer than `FEWEST_JOINTS` joints between their bodies, pairs of two plumes, and pairs that
    are nearer than `AT_HOME` L at home. A pair that is stated is left out only where it overlaps at home.

    Args:
        kindyn: kinematics of the robot.
        home: positions of the joints at home, (n,).
        capsules: of links and plumes.
        standing_height: L [m].
        stated: pairs that shall keep apart, by the names of their capsules.
    """
    tree = kindyn.tree
    pairs = [
        (one, other)
        for one, other in combinations(capsules, 2)
        if not (one.plume and other.plume) and joints_between(tree, one.frame, other.frame) >= FEWEST_JOINTS
    ]
    at_home = distances(kindyn, home[:, None], pairs)[:, 0]
    return {
        pair: float(distance)
        for pair, distance in zip(pairs, at_home, strict=True)
        if distance >= (0.0 if frozenset(one.name for one in pair) in stated else AT_HOME * standing_height)
    }


def within_reach(
    kindyn: KinDynComputations, lower: Array, upper: Array, pairs: Sequence[CapsulePair]
) -> tuple[CapsulePair, ...]:
    """Return the pairs that overlap in a share `MEET` of `POSTURES` random postures within the ranges of the joints.

    Args:
        kindyn: kinematics of the robot.
        lower: least positions of the joints, (n,).
        upper: greatest positions, (n,).
        pairs: to choose from.
    """
    postures = np.random.default_rng(0).uniform(lower, upper, (POSTURES, lower.size)).T
    shares = (distances(kindyn, postures, pairs) < 0).mean(axis=1)
    return tuple(pair for pair, share in zip(pairs, shares, strict=True) if share >= MEET)


def joints_between(tree: Tree, one: str, other: str) -> int:
    """Return how many joints lie between the bodies of two frames.

    Args:
        tree: of the robot.
        one: name of a frame.
        other: name of another.
    """
    paths = [set(tree.path(tree.frame(frame).body)) for frame in (one, other)]
    return len(paths[0] ^ paths[1])


def distances(kindyn: KinDynComputations, postures: Array, pairs: Sequence[CapsulePair]) -> Array:
    """Return the exact distances of pairs [m], (pairs, count).

    Args:
        kindyn: kinematics of the robot.
        postures: positions of the joints, (n, count).
        pairs: of capsules.
    """
    count = postures.shape[1]
    poses = {
        frame: poses_in_base(kindyn, frame, postures)
        for frame in dict.fromkeys(capsule.frame for pair in pairs for capsule in pair)
    }
    found = [exact_distances(one, poses[one.frame], other, poses[other.frame]) for one, other in pairs]
    return np.array(found).reshape(len(pairs), count)


def poses_in_base(kindyn: KinDynComputations, frame: str, postures: Array) -> Array:
    """Return base_H_frame in many postures, (count, 4, 4).

    Args:
        kindyn: kinematics of the robot.
        frame: name of a link or frame.
        postures: positions of the joints, (n, count).
    """
    count = postures.shape[1]
    side_by_side = kindyn.forward_kinematics_fun(frame).map(count)(np.tile(np.eye(4), (1, count)), postures)
    return np.array(side_by_side).reshape(4, count, 4).transpose(1, 0, 2)

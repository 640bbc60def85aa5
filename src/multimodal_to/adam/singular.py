"""Motions that move no mass: where a robot has one, its mass matrix is singular and accelerations are undefined."""

from __future__ import annotations

import casadi as cs
import numpy as np

from multimodal_to.adam import crba
from multimodal_to.adam.kinematics import Pose
from multimodal_to.adam.tree import Tree
from multimodal_to.errors import ModelError

_POSTURES = 3
"""A motion counts that moves no mass in each of so many random postures."""
_NOTHING = 1e-11
"""Eigenvalues of the scaled mass matrix below this are rounding [1]."""
_TOUCHED = 1e-6
"""Parts of the motions' projector below this are rounding [1]."""


def massless_motions(tree: Tree) -> tuple[tuple[str, ...], ...]:
    """Return what can move together without moving any mass: in each group the base, as "", and joints by name.

    They are the null space of M(s), scaled to a diagonal of ones, in random postures; the one with the least null space
    counts, so that a posture in which axes happen to meet names nothing.
    """
    n = len(tree.joints)
    s = cs.SX.sym("s", n)
    matrix = cs.Function("M", [s], [crba.mass_matrix(tree, Pose(cs.SX.eye(3), cs.SX.zeros(3)), s)])
    rng = np.random.default_rng(0)
    spaces = [_null_space(np.array(matrix(rng.uniform(-1.0, 1.0, n)))) for _ in range(_POSTURES)]
    space = min(spaces, key=lambda found: found.shape[1])
    projector = np.abs(space @ space.T) > _TOUCHED
    projector[:6, :6] |= projector[:6, :6].any()  # the base is one thing
    names = [*[""] * 6, *tree.joint_names]
    groups, left = list[tuple[str, ...]](), [index for index in range(6 + n) if projector[index].any()]
    while left:
        group = {left[0]}
        while (more := {int(index) for index in np.flatnonzero(projector[sorted(group)].any(axis=0))} | group) != group:
            group = more
        groups.append(tuple(dict.fromkeys(names[index] for index in sorted(group))))
        left = [index for index in left if index not in group]
    return tuple(groups)


def _null_space(matrix: np.ndarray) -> np.ndarray:
    """Return a basis of the motions that move no mass, (6 + n, count); velocities are in units of √M_ii."""
    scale = np.sqrt(np.maximum(np.diag(matrix), 0.0))
    scale[scale == 0.0] = 1.0
    values, vectors = np.linalg.eigh(matrix / np.outer(scale, scale))
    return np.asarray(vectors[:, values < _NOTHING])


def described(tree: Tree, group: tuple[str, ...]) -> tuple[str, str]:
    """Return who a group of `massless_motions` is, and what is wrong, as subject and end of a sentence.

    Args:
        tree: the robot.
        group: one of its groups.
    """
    who = " and ".join(f"joint '{name}'" if name else f"the base '{tree.base}'" for name in group)
    if len(group) > 1:
        return who, "can move together without moving any mass, so their accelerations are undefined"
    if not group[0]:
        return who, "turns without moving any mass, so its acceleration is undefined"
    return who, "moves nothing that has mass, so its acceleration is undefined"


def refuse_massless_motions(tree: Tree) -> None:
    """Refuse a robot whose accelerations are undefined.

    Raises:
        ModelError: something moves without moving any mass: a joint with nothing behind it, a base without mass, or two
            joints on one axis with no mass between.
    """
    for group in massless_motions(tree):
        raise ModelError(" ".join(described(tree, group)))

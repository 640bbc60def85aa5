"""A home posture: knees bent where legs would be straight, and feet as flat as they were."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import casadi as cs
import numpy as np

from multimodal_to.adam import KinDynComputations
from multimodal_to.adam.spatial import Array
from multimodal_to.values import Value

BENT = 0.08
"""A leg is straight where no joint changes its length by more than this for each radian, as a share of its length."""
SHORTER = 0.06
"""How much a straight leg is shortened, as a share of its length [1]."""
_SEEDS, _STEPS, _SPREAD = 24, 60, 0.8  # of the search; the last in rad
_THIGH = 0.8  # of the leg is left where a hip ends [1]
_LONGEST, _DONE = 0.3, 1e-5  # step [rad]
_NEAR = 1e-3  # m
_DAMPING, _PULL = 1e-5, 1e-3
_SWINGS, _OFF_MIDDLE = 5, 0.4  # how often legs are swung; how far the CoM may be off, of the half-width of the feet [1]
_AHEAD = 0.2  # what a knee ahead by the length of the leg is worth [rad²]


def near_zero(lower: float, upper: float) -> float:
    """Return zero, or what lies a quarter of the range inside the end nearest to zero, of a range without zero.

    A knee that cannot be straight is bent by so little that its foot is still the lowest part of the leg.
    """
    if lower <= 0.0 <= upper:
        return 0.0
    return 0.75 * lower + 0.25 * upper if lower > 0.0 else 0.25 * lower + 0.75 * upper


@dataclass(frozen=True, kw_only=True, eq=False)
class Stance(Value):
    """A robot with its base's origin at the world's, turned as at home, and its joints somewhere."""

    kindyn: KinDynComputations
    turn: Array  # w_R_base, (3, 3)
    joints: Array  # s, (n,)

    @property
    def base(self) -> Array:
        """Return w_H_base, (4, 4)."""
        transform = np.eye(4)
        transform[:3, :3] = self.turn
        return transform

    @property
    def com(self) -> Array:
        """Return the CoM [m], (3,)."""
        return np.array(self.kindyn.CoM_position(self.base, self.joints)).ravel()

    def pose(self, frame: str) -> Array:
        """Return w_H_frame, (4, 4)."""
        return np.array(self.kindyn.forward_kinematics(frame, self.base, self.joints))

    def places(self, frames: Sequence[str]) -> Array:
        """Return the origins of frames [m], (frames, 3)."""
        return np.array([self.pose(frame)[:3, 3] for frame in frames]).reshape(-1, 3)


@dataclass(frozen=True, kw_only=True)
class Leg:
    """A leg of a robot, and where it may be."""

    kindyn: KinDynComputations
    turn: Array  # w_R_base at home, (3, 3)
    root: str  # its first link
    contacts: tuple[str, ...]  # frames of its contact points
    columns: tuple[int, ...]  # of s that are its joints
    lower: Array  # of s, (n,)
    upper: Array  # of s, (n,)

    @cached_property
    def _function(self) -> cs.Function:
        joints = cs.SX.sym("s", len(self.kindyn.joint_names))
        base = self._at(np.zeros(joints.shape[0])).base
        poses = [self.kindyn.forward_kinematics(name, cs.SX(base), joints) for name in self.contacts]
        places = cs.vertcat(*(pose[:3, 3] for pose in poses))
        return cs.Function("places", [joints], [places, cs.jacobian(places, joints)])

    @cached_property
    def _foot(self) -> cs.Function:
        joints, tree = cs.SX.sym("s", len(self.kindyn.joint_names)), self.kindyn.tree
        last = self.contacts[0] if len(self.contacts) < 3 else tree.bodies[tree.frame(self.contacts[0]).body].name
        base = self._at(np.zeros(joints.shape[0])).base
        foot = self.kindyn.forward_kinematics(last, cs.SX(base), joints)[:3, 3]
        return cs.Function("foot", [joints], [foot, cs.jacobian(foot, joints)])

    def _at(self, joints: Array) -> Stance:
        return Stance(kindyn=self.kindyn, turn=self.turn, joints=joints)

    def places(self, joints: Array) -> tuple[Array, Array]:
        """Return where the contact points are, with the base at the world's origin [m], (points, 3), and ∂/∂s."""
        places, jacobian = (np.array(part) for part in self._function(joints))
        return places.reshape(-1, 3), jacobian

    def stretch(self, joints: Array) -> tuple[Array, float]:
        """Return how much each joint of the robot changes the length of the leg [m/rad], (n,), and that length [m].

        The leg ends in its contact point, or in the ankle where it has a sole. It begins in that one of its first
        joints that the others turn about most purely: hips have their axes apart.
        """
        tree = self.kindyn.tree
        foot, jacobian = (np.array(part) for part in self._foot(joints))
        chain = [tree.bodies[body].name for body in tree.path(tree.frame(self.contacts[0]).body)]
        hips = self._at(joints).places(chain[chain.index(self.root) :])
        arms = foot.ravel() - hips
        lengths = np.linalg.norm(arms, axis=1)
        own, best = list(self.columns), (np.zeros(joints.size), 0.0)
        for arm, length in zip(arms, lengths, strict=True):
            if length < _THIGH * lengths.max() or not length:
                continue
            rates = np.zeros(joints.size)
            rates[own] = (arm @ jacobian / length)[own]
            if not best[1] or np.abs(rates).max() < np.abs(best[0]).max():
                best = rates, float(length)
        return best

    def is_straight(self, joints: Array) -> bool:
        """Return whether no joint changes the length of the leg by more than `BENT` of it."""
        change, length = self.stretch(joints)
        return length > _NEAR and float(np.abs(change).max(initial=0.0)) < BENT * length

    def bent(self, joints: Array) -> Array:
        """Return a posture with the leg bent where it is straight, and its sole flat where it is tilted.

        It is the nearest such posture; of two ways to bend, the knee goes ahead. A leg that needs neither, or that
        cannot do it, stays as it is.
        """
        places, length = self.places(joints)[0], self.stretch(joints)[1]
        straight, tilted = self.is_straight(joints), float(np.ptp(places[:, 2])) > _NEAR
        if not (straight or tilted):
            return joints
        wanted = _flat(places) + straight * SHORTER * length * np.array([0.0, 0.0, 1.0])
        own, best, least = list(self.columns), joints, np.inf
        for draw in np.random.default_rng(0).uniform(-_SPREAD, _SPREAD, (_SEEDS, len(own))):
            start = joints.copy()
            start[own] = np.clip(joints[own] + straight * draw, self.lower[own], self.upper[own])
            found = self._reached(wanted, start, joints)
            if np.abs(self.places(found)[0] - wanted).max() > max(_NEAR, 0.02 * length):
                continue
            cost = float(((found - joints) ** 2).sum()) - straight * _AHEAD * self._ahead(found) / length
            if cost < least - 1e-6:
                best, least = found, cost
        return best

    def moved(self, joints: Array, way: Array) -> Array:
        """Return a posture with the contact points moved along the ground, as near as the leg gets.

        Args:
            joints: s, (n,).
            way: how far, along x and y [m], (2,).
        """
        wanted = self.places(joints)[0] + np.append(way, 0.0)
        return self._reached(wanted, joints, joints)

    def _ahead(self, joints: Array) -> float:
        """Return how far ahead the links of the leg are together [m]."""
        tree = self.kindyn.tree
        links = [tree.bodies[body].name for body in tree.path(tree.frame(self.contacts[0]).body)]
        return float(self._at(joints).places(links)[:, 0].sum())

    def _reached(self, wanted: Array, start: Array, near: Array) -> Array:
        """Return the posture that the method of Levenberg and Marquardt gets to.

        Args:
            wanted: where the contact points shall be [m], (points, 3).
            start: s to start from, (n,).
            near: s to stay near, (n,).
        """
        joints, own = start.copy(), list(self.columns)
        for _ in range(_STEPS):
            places, jacobian = self.places(joints)
            matrix = np.vstack([jacobian[:, own], _PULL * np.eye(len(own))])
            target = np.concatenate([(wanted - places).ravel(), _PULL * (near[own] - joints[own])])
            step = np.linalg.solve(matrix.T @ matrix + _DAMPING * np.eye(len(own)), matrix.T @ target)
            joints[own] = np.clip(joints[own] + np.clip(step, -_LONGEST, _LONGEST), self.lower[own], self.upper[own])
            if np.abs(step).max() < _DONE:
                break
        return joints


def balanced(stance: Stance, legs: Sequence[Leg]) -> Stance:
    """Return a stance with the CoM above the feet: legs are swung where it is too far from the middle of the feet.

    Args:
        stance: of the robot.
        legs: that it stands on.
    """
    contacts = [name for leg in legs for name in leg.contacts]
    for _ in range(_SWINGS):
        if not legs:
            break
        places = stance.places(contacts)[:, :2]
        way = stance.com[:2] - 0.5 * (places.min(axis=0) + places.max(axis=0))
        if (np.abs(way) <= _OFF_MIDDLE * 0.5 * np.ptp(places, axis=0) + _NEAR).all():
            break
        for leg in legs:
            stance = replace(stance, joints=leg.moved(stance.joints, way))
    return stance


def _flat(places: Array) -> Array:
    """Return points of a tilted plane turned about their middle until they are level, (points, 3)."""
    middle = places.mean(axis=0)
    if len(places) < 3:
        return np.column_stack([places[:, :2], np.full(len(places), middle[2])])
    normal = np.linalg.svd(places - middle)[2][2]
    normal = normal * np.sign(normal[2])
    axis = np.cross(normal, [0.0, 0.0, 1.0])
    skew = np.array([[0.0, -axis[2], axis[1]], [axis[2], 0.0, -axis[0]], [-axis[1], axis[0], 0.0]])
    turn = np.eye(3) + skew + skew @ skew / (1.0 + normal[2])
    return np.asarray((places - middle) @ turn.T + middle)

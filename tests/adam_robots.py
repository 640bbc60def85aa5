"""The robots that the tests of `adam/` use, their random states, and Pinocchio's model of them in our coordinates."""

from __future__ import annotations

import tomllib
from dataclasses import dataclass
from pathlib import Path

import casadi as cs
import numpy as np
import pinocchio as pin

from multimodal_to.adam import GRAVITY, KinDynComputations, Representations, Tree, quaternion
from places import example_robots

IRONCUB = Path(__file__).parents[1] / "robots" / "ironcub"
BODY = Representations.BODY_FIXED_REPRESENTATION
MIXED = Representations.MIXED_REPRESENTATION
INERTIAL = Representations.INERTIAL_FIXED_REPRESENTATION


def ironcub_joints() -> list[str]:
    return list(tomllib.loads((IRONCUB / "robot.toml").read_text(encoding="utf-8"))["joints"])


def random_rotation(rng: np.random.Generator) -> np.ndarray:
    values = rng.normal(size=4)
    return np.array(quaternion.rotation_matrix(cs.DM(values / np.linalg.norm(values))))


@dataclass(frozen=True, kw_only=True)
class State:
    H: np.ndarray  # (4, 4)
    s: np.ndarray
    v: np.ndarray  # (6,), in whatever representation the test says
    s_dot: np.ndarray
    v_dot: np.ndarray
    s_ddot: np.ndarray

    @property
    def pose(self) -> tuple[np.ndarray, ...]:
        return self.H, self.s

    @property
    def motion(self) -> tuple[np.ndarray, ...]:
        return self.H, self.s, self.v, self.s_dot

    @property
    def nu(self) -> np.ndarray:
        return np.concatenate([self.v, self.s_dot])

    @property
    def nu_dot(self) -> np.ndarray:
        return np.concatenate([self.v_dot, self.s_ddot])


def random_states(n: int, count: int, seed: int) -> list[State]:
    rng = np.random.default_rng(seed)
    states = []
    for _ in range(count):
        H = np.eye(4)
        H[:3, :3], H[:3, 3] = random_rotation(rng), rng.normal(size=3)
        s, s_dot, s_ddot = rng.uniform(-3, 3, n), 2 * rng.normal(size=n), 5 * rng.normal(size=n)
        states.append(State(H=H, s=s, v=rng.normal(size=6), s_dot=s_dot, v_dot=rng.normal(size=6), s_ddot=s_ddot))
    return states


def skew(a: np.ndarray) -> np.ndarray:
    return np.array([[0, -a[2], a[1]], [a[2], 0, -a[0]], [-a[1], a[0], 0]])


def adjoint(R: np.ndarray, p: np.ndarray) -> np.ndarray:
    """Return X with (v of the world's origin, ω in world axes) = X (v, ω in the frame's own)."""
    return np.block([[R, skew(p) @ R], [np.zeros((3, 3)), R]])


def local_from(representation: Representations, H: np.ndarray) -> np.ndarray:
    """Return what maps a velocity in `representation` to (v, ω) in the frame's own axes, written anew."""
    R, p = H[:3, :3], H[:3, 3]
    if representation is BODY:
        return np.eye(6)
    if representation is MIXED:
        return np.kron(np.eye(2), R.T)
    return np.linalg.inv(adjoint(R, p))


class Peer:
    """Pinocchio's model of a URDF without its mimic support, which refuses leaders behind their followers.

    Ours is reduced from it: q_full = G s + g, v_full = G ν. Joints that we lock are locked at zero.
    """

    def __init__(self, urdf: Path, tree: Tree) -> None:
        model = pin.buildModelFromUrdf(str(urdf), pin.JointModelFreeFlyer())
        moving = {*tree.joint_names, *tree.followers}
        locked = [index for index, name in enumerate(model.names) if index > 1 and name not in moving]
        self.model = pin.buildReducedModel(model, locked, pin.neutral(model)) if locked else model
        self.model.gravity.linear = np.array(GRAVITY)
        self.data = self.model.createData()
        self.tree = tree
        self.joints = {name: self.model.joints[self.model.getJointId(name)] for name in moving}

    def q(self, state: State) -> np.ndarray:
        q = pin.neutral(self.model)
        q[:3], q[3:7] = state.H[:3, 3], pin.Quaternion(state.H[:3, :3]).coeffs()
        values = dict(zip(self.tree.joint_names, state.s, strict=True))
        values |= {name: how.multiplier * values[how.joint] + how.offset for name, how in self.tree.followers.items()}
        for name, joint in self.joints.items():
            value = values[name]
            q[joint.idx_q : joint.idx_q + joint.nq] = [value] if joint.nq == 1 else [np.cos(value), np.sin(value)]
        return q

    def into(self, state: State, representation: Representations) -> np.ndarray:
        """Return the matrix that maps ν in our order and `representation` to Pinocchio's v."""
        names = self.tree.joint_names
        matrix = np.zeros((self.model.nv, 6 + len(names)))
        matrix[:6, :6] = local_from(representation, state.H)
        for column, name in enumerate(names, start=6):
            matrix[self.joints[name].idx_v, column] = 1
        for name, how in self.tree.followers.items():
            matrix[self.joints[name].idx_v, 6 + names.index(how.joint)] = how.multiplier
        return matrix


@dataclass(frozen=True)
class Example:
    """A robot of `example-robot-data`: its file, and the joints to lock at zero."""

    path: str
    locked: tuple[str, ...] = ()

    @property
    def urdf(self) -> Path:
        return example_robots() / self.path

    def kindyn(self, representation: Representations = MIXED) -> KinDynComputations:
        locked = dict.fromkeys(self.locked, 0.0)
        return KinDynComputations(self.urdf, representation=representation, locked_joints=locked)

"""Forward kinematics, Jacobians and accelerations of the frames of a `Tree`, in the mixed representation.

Throughout, `base` is ``w_H_base`` and `s` holds the joint positions [rad or m], (n, 1).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import casadi as cs

from multimodal_to.adam.spatial import SX, rotation_about_z
from multimodal_to.adam.tree import BASE, Body, Frame, Tree


@dataclass(frozen=True)
class Pose:
    """A frame seen from another: rotation (3, 3) and translation (3, 1) [m]."""

    rotation: SX
    translation: SX

    def __matmul__(self, other: Pose) -> Pose:
        return Pose(self.rotation @ other.rotation, self.rotation @ other.translation + self.translation)


def joint_angle(body: Body, s: SX) -> tuple[SX, SX]:
    """Return cos and sin of a revolute joint's angle, measured from where its body's x stands."""
    quarter = body.offset / (math.pi / 2)
    angle = body.joint_value(s)
    if abs(quarter - round(quarter)) > 1e-12:
        angle, quarter = angle + body.offset, 0
    cosine, sine = cs.cos(angle), cs.sin(angle)
    turned: tuple[tuple[SX, SX], ...] = ((cosine, sine), (-sine, cosine), (-cosine, -sine), (sine, -cosine))
    return turned[round(quarter) % 4]


def joint_pose(body: Body, s: SX) -> Pose:
    """Return the body's frame in its parent's: C Rz(q) for a revolute joint, a shift along z for a prismatic one."""
    if body.prismatic:
        return Pose(body.rotation, body.translation + body.rotation[:, 2] * body.joint_value(s))
    return Pose(body.rotation @ rotation_about_z(*joint_angle(body, s)), body.translation)


def body_poses(tree: Tree, base: Pose, s: SX) -> list[Pose]:
    """Return the pose of every body in whatever frame `base` is given in.

    Args:
        tree: the robot.
        base: pose of the base in any frame; the result is in the same one.
        s: joint positions, (n, 1) [rad or m].
    """
    poses = [base]
    for body in tree.bodies[1:]:
        poses.append(poses[body.parent] @ joint_pose(body, s))
    return poses


def frame_in_base(tree: Tree, frame: Frame, s: SX) -> Pose:
    """Return base_H_frame, multiplied from the frame to the base, so that the constant ends fold.

    Only y, z and p of the frame travel along the chain; x = y × z follows at its end.

    Args:
        tree: the robot.
        frame: the frame, fixed in a body of the tree.
        s: joint positions, (n, 1) [rad or m].
    """
    columns = cs.SX(cs.horzcat(frame.rotation[:, 1:], frame.translation))
    path = tree.path(frame.body)
    for index in reversed(path):
        pose = joint_pose(tree.bodies[index], s)
        columns = pose.rotation @ columns
        columns[:, 2] += pose.translation
    return _from_columns(columns) if path else Pose(frame.rotation, frame.translation)


def forward_kinematics(tree: Tree, frame: Frame, base: Pose, s: SX) -> Pose:
    """Return w_H_frame; the base's rotation has to be one, since x of the frame is taken as y × z.

    Args:
        tree: the robot.
        frame: the frame, fixed in a body of the tree.
        base: w_H_base, the pose of the base in the world.
        s: joint positions, (n, 1) [rad or m].
    """
    if frame.body == BASE:
        return base @ Pose(frame.rotation, frame.translation)
    seen = frame_in_base(tree, frame, s)
    columns = base.rotation @ cs.horzcat(seen.rotation[:, 1:], seen.translation)
    columns[:, 2] += base.translation
    return _from_columns(columns)


def _from_columns(columns: SX) -> Pose:
    """Return the pose with (y, z, p) as the columns of a (3, 3) matrix."""
    y, z, translation = cs.horzsplit(columns)
    return Pose(cs.horzcat(cs.cross(y, z), y, z), translation)


@dataclass(frozen=True)
class Chain:
    """The way from the base to a frame: its bodies with their poses, in whatever frame the base is given in."""

    base: Pose
    bodies: tuple[tuple[Body, Pose], ...]
    end: Pose

    @classmethod
    def to(cls, tree: Tree, frame: Frame, base: Pose, s: SX) -> Chain:
        """Return the chain that ends in `frame`.

        Args:
            tree: the robot.
            frame: the frame, fixed in a body of the tree.
            base: w_H_base, the pose of the base in the world.
            s: joint positions, (n, 1) [rad or m].
        """
        pose, bodies = base, []
        for index in tree.path(frame.body):
            pose = pose @ joint_pose(tree.bodies[index], s)
            bodies.append((tree.bodies[index], pose))
        return cls(base, tuple(bodies), pose @ Pose(frame.rotation, frame.translation))


def geometric_jacobian(chain: Chain, n: int) -> SX:
    """Return J, (6, 6 + n), of the chain's end: (ṗ_frame, ω_frame) = J ν for ν = (ṗ_base, ω_base, ṡ).

    The column of a revolute joint at p_i with axis a_i is (a_i × (p_frame − p_i), a_i), of a prismatic one (a_i, 0);
    a mimic joint adds its own, times its multiplier, to its leader's.
    """
    end = chain.end.translation
    jacobian = cs.SX(6, 6 + n)
    jacobian[:3, :3] = jacobian[3:, 3:6] = cs.SX.eye(3)
    jacobian[:3, 3:6] = -cs.skew(end - chain.base.translation)
    for body, pose in chain.bodies:
        axis = body.multiplier * pose.rotation[:, 2]
        if body.prismatic:
            jacobian[:3, 6 + body.column] += axis
        else:
            jacobian[:3, 6 + body.column] += cs.cross(axis, end - pose.translation)
            jacobian[3:, 6 + body.column] += axis
    return cs.sparsify(jacobian)


@dataclass(frozen=True)
class Motion:
    """Velocity (ṗ, ω) of a frame and its acceleration (p̈, ω̇), (3, 1) each, in the axes of its pose."""

    linear: SX
    angular: SX
    linear_rate: SX
    angular_rate: SX


def chain_motions(chain: Chain, base: Motion, s_dot: SX) -> list[Motion]:
    """Return how the base, every body of the chain and its end move while s̈ = 0.

    With the arm r from one origin to the next: ṗ' = ṗ + ω × r, p̈' = p̈ + ω̇ × r + ω × (ω × r). A revolute joint adds
    a q̇ to ω and ω × a q̇ to ω̇, a prismatic one a q̇ to ṗ and 2 ω × a q̇ to p̈.

    Args:
        chain: the bodies from the base to a frame.
        base: how the base moves, in world axes.
        s_dot: joint velocities, (n, 1) [rad/s or m/s].
    """
    motions, origin = [base], chain.base.translation
    for body, pose in chain.bodies:
        last = _carried(motions[-1], pose.translation - origin)
        own = pose.rotation[:, 2] * body.joint_value(s_dot)
        turned = cs.cross(last.angular, own)
        if body.prismatic:
            last = Motion(last.linear + own, last.angular, last.linear_rate + 2 * turned, last.angular_rate)
        else:
            last = Motion(last.linear, last.angular + own, last.linear_rate, last.angular_rate + turned)
        motions.append(last)
        origin = pose.translation
    return [*motions, _carried(motions[-1], chain.end.translation - origin)]


def _carried(motion: Motion, arm: SX) -> Motion:
    """Return the motion of the point at `arm`, fixed in the same body."""
    turned = cs.cross(motion.angular, arm)
    return Motion(
        motion.linear + turned,
        motion.angular,
        motion.linear_rate + cs.cross(motion.angular_rate, arm) + cs.cross(motion.angular, turned),
        motion.angular_rate,
    )


def geometric_jacobian_rate(chain: Chain, motions: list[Motion], n: int) -> SX:
    """Return J̇, (6, 6 + n), of the chain's end while it moves as `chain_motions` says.

    With ȧ_i = ω_i × a_i: (ȧ_i × (p_frame − p_i) + a_i × (ṗ_frame − ṗ_i), ȧ_i), and (ȧ_i, 0) when prismatic.

    Args:
        chain: the bodies from the base to a frame.
        motions: of the base, of every body of the chain and of its end.
        n: the number of joints.
    """
    end, last = chain.end.translation, motions[-1].linear
    rate = cs.SX(6, 6 + n)
    rate[:3, 3:6] = -cs.skew(last - motions[0].linear)
    for (body, pose), motion in zip(chain.bodies, motions[1:-1], strict=True):
        axis = body.multiplier * pose.rotation[:, 2]
        turned = cs.cross(motion.angular, axis)
        if body.prismatic:
            rate[:3, 6 + body.column] += turned
        else:
            arm = cs.cross(turned, end - pose.translation)
            rate[:3, 6 + body.column] += arm + cs.cross(axis, last - motion.linear)
            rate[3:, 6 + body.column] += turned
    return cs.sparsify(rate)

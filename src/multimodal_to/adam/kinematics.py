"""Forward kinematics, frame velocities and Jacobians of a `Tree`, in world axes.

Throughout, `rotation` and `position` of the base are R and p of ``w_H_base``, and `s` holds the joint positions.
"""

from __future__ import annotations

from dataclasses import dataclass

import casadi as cs

from multimodal_to.adam.spatial import SX, rotation_about_z
from multimodal_to.adam.tree import Body, Frame, Tree


@dataclass(frozen=True)
class Pose:
    """A frame seen from another: rotation (3, 3) and translation (3, 1) [m]."""

    rotation: SX
    translation: SX

    def __matmul__(self, other: Pose) -> Pose:
        return Pose(self.rotation @ other.rotation, self.rotation @ other.translation + self.translation)


def joint_angle(body: Body, s: SX) -> tuple[SX, SX]:
    """Return cos and sin of a revolute joint's angle, measured from where its body's x stands."""
    quarter = body.offset / (cs.pi / 2)
    angle = s[body.column]
    if abs(quarter - round(quarter)) > 1e-12:
        angle, quarter = angle + body.offset, 0
    cosine, sine = cs.cos(angle), cs.sin(angle)
    return [(cosine, sine), (-sine, cosine), (-cosine, -sine), (sine, -cosine)][round(quarter) % 4]


def joint_pose(body: Body, s: SX) -> Pose:
    """Return the body's frame in its parent's: C Rz(q) for a revolute joint, a shift along z for a prismatic one."""
    if body.prismatic:
        return Pose(body.rotation, body.translation + body.rotation[:, 2] * s[body.column])
    return Pose(body.rotation @ rotation_about_z(*joint_angle(body, s)), body.translation)


def body_poses(tree: Tree, base: Pose, s: SX) -> list[Pose]:
    """Return the pose of every body in whatever frame `base` is given in."""
    poses = [base]
    for body in tree.bodies[1:]:
        poses.append(poses[body.parent] @ joint_pose(body, s))
    return poses


def frame_in_base(tree: Tree, frame: Frame, s: SX) -> Pose:
    """Return base_H_frame, multiplied from the frame to the base, so that the constant ends fold."""
    pose = Pose(frame.rotation, frame.translation)
    for index in reversed(tree.path(frame.body)):
        pose = joint_pose(tree.bodies[index], s) @ pose
    return pose


def forward_kinematics(tree: Tree, frame: Frame, base: Pose, s: SX) -> Pose:
    """Return w_H_frame."""
    return base @ frame_in_base(tree, frame, s)


def geometric_jacobian(tree: Tree, frame: Frame, base: Pose, s: SX) -> tuple[SX, SX]:
    """Return J (6, 6 + n) of the frame's origin in world axes, and the rotation w_R_frame.

    J ν = (ṗ_frame, ω_frame) for ν = (ṗ_base, ω_base, ṡ). The column of a revolute joint at p_i with axis a_i is
    (a_i × (p_frame − p_i), a_i), of a prismatic one (a_i, 0).
    """
    path = tree.path(frame.body)
    pose, chain = base, []
    for index in path:
        pose = pose @ joint_pose(tree.bodies[index], s)
        chain.append((tree.bodies[index], pose))
    end = pose @ Pose(frame.rotation, frame.translation)
    jacobian = cs.SX(6, 6 + len(tree.joints))
    jacobian[:3, :3] = jacobian[3:, 3:6] = cs.SX.eye(3)
    jacobian[:3, 3:6] = -cs.skew(end.translation - base.translation)
    for body, pose in chain:
        axis = pose.rotation[:, 2]
        if body.prismatic:
            jacobian[:3, 6 + body.column] = axis
        else:
            jacobian[:3, 6 + body.column] = cs.cross(axis, end.translation - pose.translation)
            jacobian[3:, 6 + body.column] = axis
    return cs.sparsify(jacobian), end.rotation


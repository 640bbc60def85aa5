"""What LocoMuJoCo keeps of a model beside its motion, as MuJoCo has it: how bodies, joints and sites hang together."""

from __future__ import annotations

import numpy as np

from multimodal_to.adam.spatial import Array
from multimodal_to.adam.urdf import read_urdf
from multimodal_to.exporting.frames import Frames, quaternions

WXYZ = [3, 0, 1, 2]
"""Where w x y z stand in x y z w."""


def _parents(frames: Frames) -> list[int]:
    """Return which body of the layout each hangs on, −1 for the base."""
    _, joints = read_urdf(frames.robot.urdf)
    above, bodies = {joint.child: joint.parent for joint in joints}, frames.layout.bodies
    parents = []
    for body in bodies:
        link = above.get(body)
        while link is not None and link not in bodies:
            link = above.get(link)
        parents.append(-1 if link is None else bodies.index(link))
    return parents


def subtree_coms(frames: Frames) -> Array:
    """Return MuJoCo's subtree_com: the CoM of each body with all that hangs on it [m], (frames, 1 + bodies, 3)."""
    parents, masses, coms = _parents(frames), np.array([body.mass for body in frames.masses]), frames.body_coms
    carried = np.zeros((len(parents), len(parents)))  # [body, what is in its subtree]
    for index in range(len(parents)):
        above = index
        while above >= 0:
            carried[above, index] = masses[index]
            above = parents[above]
    totals = np.maximum(carried.sum(axis=1), 1e-12)
    found = np.einsum("bi,tix->tbx", carried / totals[:, None], coms)
    return np.concatenate([found[:, parents.index(-1)][:, None], found], axis=1)


def model_arrays(frames: Frames, sites: list[str]) -> dict[str, Array]:
    """Return what LocoMuJoCo keeps of a model: kinds of joints, and how bodies and sites are fixed to one another.

    Args:
        frames: whose layout is the model.
        sites: frames by name.
    """
    kinds = {joint.name: joint.kind for joint in read_urdf(frames.robot.urdf)[1]}
    free, slide, hinge = 0, 2, 3  # mjtJoint
    tree, parents, home = frames.robot.kindyn.tree, _parents(frames), frames.body_poses[0]
    at_zero = _poses_at_zero(frames)
    relative = [at_zero[i] if p < 0 else np.linalg.inv(at_zero[p]) @ at_zero[i] for i, p in enumerate(parents)]
    relative[parents.index(-1)] = home[parents.index(-1)]
    owners = [_owner(frames, frame) for frame in sites]
    placed = [
        np.array(frames.robot.kindyn.forward_kinematics(frame, np.eye(4), np.zeros(len(tree.joints))))
        for frame in sites
    ]
    mounted = [np.linalg.inv(at_zero[owner]) @ pose for owner, pose in zip(owners, placed, strict=True)]
    principal = [np.linalg.eigh(body.inertia)[1] for body in frames.masses]
    principal = [axes * np.sign(np.linalg.det(axes)) for axes in principal]
    count = len(parents) + 1
    return {
        "njnt": np.array(len(frames.layout.joints) + 1),
        "jnt_type": np.array([free, *(slide if kinds[n] == "prismatic" else hinge for n in frames.layout.joints)]),
        "nbody": np.array(count),
        "body_rootid": np.array([0] + [1 + parents.index(-1)] * len(parents)),
        "body_weldid": np.arange(count),
        "body_mocapid": np.full(count, -1),
        "body_pos": np.array([np.zeros(3), *(pose[:3, 3] for pose in relative)]),
        "body_quat": _quaternions_wxyz([np.eye(3), *(pose[:3, :3] for pose in relative)]),
        "body_ipos": np.array([np.zeros(3), *(body.com for body in frames.masses)]),
        "body_iquat": _quaternions_wxyz([np.eye(3), *principal]),
        "nsite": np.array(len(sites)),
        "site_bodyid": np.array([owner + 1 for owner in owners], dtype=int),
        "site_pos": np.array([pose[:3, 3] for pose in mounted]).reshape(-1, 3),
        "site_quat": _quaternions_wxyz([pose[:3, :3] for pose in mounted]),
    }


def _quaternions_wxyz(rotations: list[Array]) -> Array:
    return quaternions(np.array(rotations).reshape(-1, 3, 3)).T[:, WXYZ]


def _poses_at_zero(frames: Frames) -> list[Array]:
    kindyn = frames.robot.kindyn
    still = np.zeros(len(kindyn.tree.joints))
    return [np.array(kindyn.forward_kinematics(body, np.eye(4), still)) for body in frames.layout.bodies]


def _owner(frames: Frames, frame: str) -> int:
    """Return the body of the layout that a frame belongs to.

    Args:
        frames: with the layout.
        frame: a link by name.
    """
    above = {joint.child: joint.parent for joint in read_urdf(frames.robot.urdf)[1]}
    while frame not in frames.layout.bodies:
        frame = above[frame]
    return frames.layout.bodies.index(frame)

"""Links and plumes keep apart: the distances of the robot's capsules at a knot."""

from __future__ import annotations

from collections.abc import Sequence

import casadi as cs

from multimodal_to.adam.kinematics import Pose, joint_pose
from multimodal_to.adam.spatial import SX
from multimodal_to.adam.tree import Tree
from multimodal_to.models.capsule import Capsule, Segment, pair_name, segment, smooth_distance
from multimodal_to.ocp.knot import Knot
from multimodal_to.ocp.parameters import Parameters


def link_distances(knot: Knot, parameters: Parameters) -> SX:
    """Distance of each pair of capsules of links and plumes that a problem holds apart.

    The pairs are `robot.near_capsule_pairs`, the distance is `models.capsule.smooth_distance`. A robot without capsules
    has no rows. Each pair is seen from the last body that carries both, so that a row depends on the joints between
    the two alone.
    """
    tree = knot.robot.kindyn.tree
    joints = [joint_pose(body, knot.joint_positions) for body in tree.bodies[1:]]
    seen = dict[tuple[Capsule, tuple[int, ...]], Segment]()
    rows = []
    for one, other in knot.robot.near_capsule_pairs:
        keys = _ways(tree, (one, other))
        for key in keys:
            if key not in seen:
                seen[key] = _segment(tree, *key, joints)
        rows.append(smooth_distance(one, seen[keys[0]], other, seen[keys[1]]))
    return cs.vertcat(cs.SX(0, 1), *rows)


def link_pair_labels(parameters: Parameters) -> tuple[str, ...]:
    """Return what the rows of `link_distances` are called, as `left foot – right foot`."""
    return tuple(pair_name(pair) for pair in parameters.robot.near_capsule_pairs)


def _ways(tree: Tree, pair: Sequence[Capsule]) -> list[tuple[Capsule, tuple[int, ...]]]:
    """Return each capsule of a pair with the bodies that lead to it from the last one that carries both."""
    paths = [tree.path(tree.frame(capsule.frame).body) for capsule in pair]
    shared = len(set(paths[0]) & set(paths[1]))
    return [(capsule, tuple(path[shared:])) for capsule, path in zip(pair, paths, strict=True)]


def _segment(tree: Tree, capsule: Capsule, way: Sequence[int], joints: Sequence[Pose]) -> Segment:
    """Return the segment of a capsule in the axes of the body from which a way starts, multiplied from its end.

    Args:
        tree: of the robot.
        capsule: at the end of the way.
        way: the bodies from the first below that body to the one that carries the capsule.
        joints: pose of each body in its parent, without that of the base.
    """
    frame = tree.frame(capsule.frame)
    at = segment(capsule, Pose(cs.SX(frame.rotation), cs.SX(frame.translation)))
    columns = cs.horzcat(at.axis, at.middle)
    for body in reversed(way):
        columns = joints[body - 1].rotation @ columns
        columns[:, 1] += joints[body - 1].translation
    return Segment(columns[:, 1], columns[:, 0])

"""The start guess between keyframes: the way of the CoM, attitudes and joints, and who carries the weight."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import casadi as cs
import numpy as np

from multimodal_to.adam import quaternion
from multimodal_to.adam.spatial import Array
from multimodal_to.models import attitude
from multimodal_to.models.robot import Posture, Robot
from multimodal_to.ocp.reaching import Reached, reached
from multimodal_to.scenarios.keyframes import AXES, Keyframe, Placed, by_axis
from multimodal_to.scenarios.scenario import Scenario, Start, Terminal


def com(scenario: Scenario, early: float = 1.0) -> Array:
    """Return the CoM at every knot [m], (3, N + 1): along each axis on lines between the knots that ask for it.

    Args:
        scenario: the task, with numbers for every CoM.
        early: share of the last stretch in which its way is made.
    """
    paths = list[Array]()
    for index, axis in enumerate(AXES):
        known = {0: scenario.start_com[index]}
        for one in scenario.own_keyframes():
            position = by_axis(one.keyframe.com) if not isinstance(one.keyframe.com, str) else {}
            if one.knot and axis in position:
                known[one.knot] = position[axis]
        if scenario.final_com is not None:
            known[scenario.knots] = scenario.end_com[index]
        path = _between(_soon(known, scenario.knots, early), scenario.knots)
        for one in scenario.own_keyframes():  # what is out of a range at its knot becomes a point of the way as well
            low, high = one.keyframe.com_min.get(axis, -np.inf), one.keyframe.com_max.get(axis, np.inf)
            if one.knot and not low <= path[one.knot] <= high:
                known[one.knot] = float(np.clip(path[one.knot], low, high))
        paths.append(_between(_soon(known, scenario.knots, early), scenario.knots))
    return np.array(paths)


def _soon(known: Mapping[int, float], last: int, early: float) -> dict[int, float]:
    """Return the points of a way of which the last one is reached early, after a share of its stretch.

    Args:
        known: values by knot.
        last: the last knot.
        early: the share.
    """
    if early == 1.0 or last not in known:
        return dict(known)
    before = max(knot for knot in known if knot < last)
    return {**known, before + max(round(early * (last - before)), 1): known[last]}


def _between(known: Mapping[int, float], last: int) -> Array:
    """Return values at every knot, (N + 1,), on lines between those that are known."""
    order = sorted(known)
    return np.asarray(np.interp(np.arange(last + 1), order, [known[knot] for knot in order]))


def flown(scenario: Scenario) -> Array:
    """Return the share of the weight that the thrusts carry at every knot, (N + 1,): evenly from keyframe to keyframe.

    What hovers is carried by the thrusts, what stands by the feet.
    """
    known = {0: 0.0 if scenario.start is Start.STANDING else 1.0}
    for one in scenario.own_keyframes():
        if one.knot and (one.keyframe.hover or one.keyframe.standing):
            known[one.knot] = float(one.keyframe.hover)
    if scenario.terminal is not Terminal.FREE:
        known[scenario.knots] = float(scenario.terminal is Terminal.HOVER)
    return _between(known, scenario.knots)


def pose(robot: Robot, scenario: Scenario, view: Mapping[str, Array], points: Array) -> Array:
    """Turn and bend the robot about its CoM as keyframes ask, in place, and return its contact points.

    Args:
        robot: whose guess it is.
        scenario: the task.
        view: the variables by name, (rows, N + 1) each, with one posture all along; base and joints are changed.
        points: of contact [m], (contacts, 3, N + 1).
    """
    own = [one for one in scenario.own_keyframes() if one.knot or scenario.start is Start.HOVER]
    reaching = _reaching(robot, own, view)
    for index, name in enumerate(robot.joint_names):
        first = view["joint_positions"][index, 0]
        back = {scenario.knots: first} if reaching else {}  # frames are let go again
        reach = {knot: found.posture.joint_positions[index] for knot, found in reaching.items()}
        asked = {one.knot: one.keyframe.joints[name] for one in own if name in one.keyframe.joints}
        if reach or asked:
            view["joint_positions"][index] = _between({0: first, **back, **reach, **asked}, scenario.knots)
    turned = {one.knot: _attitude(robot, one.keyframe) for one in own}
    asked_attitudes = {knot: value for knot, value in turned.items() if value is not None}
    if asked_attitudes:
        first = view["base_quaternion_xyzw"][:, 0].copy()
        turns = _turns(first, {0: first, **asked_attitudes}, scenario.knots + 1)
        view["base_quaternion_xyzw"][:] = np.array([attitude.product(turn, first) for turn in turns]).T
        about = view["com_position"]
        for knot, turn in enumerate(turns):
            rotation = np.array(quaternion.rotation_matrix(cs.DM(turn)))
            arm = (points[:, :, knot] - about[:, knot]) @ rotation.T
            points[:, :, knot] = about[:, knot] + arm
    if reaching or asked_attitudes or any(one.keyframe.joints for one in own):
        _keep_com(robot, view)
    for one in own:
        if one.knot in reaching:
            _carry(robot, one, reaching[one.knot].posture, points)
    return points


def _reaching(robot: Robot, own: Sequence[Placed], view: Mapping[str, Array]) -> dict[int, Reached]:
    """Return the postures that bring frames to where keyframes ask for them, by knot.

    Args:
        robot: whose guess it is.
        own: the keyframes.
        view: the variables by name, with one posture all along.
    """
    found = dict[int, Reached]()
    for one in own:
        if not any(target.position for target in one.keyframe.frames.values()):
            continue
        near = Posture(
            base_position=view["base_position"][:, one.knot],
            base_quaternion_xyzw=view["base_quaternion_xyzw"][:, one.knot],
            joint_positions=view["joint_positions"][:, one.knot],
        )
        posture = reached(robot, one, view["com_position"][:, one.knot], near, still=True)
        if posture is not None:
            found[one.knot] = posture
    return found


def _carry(robot: Robot, one: Placed, posture: Posture, points: Array) -> None:
    """Bring the contact points of frames that are asked for along, in place: there and back on straight lines.

    Args:
        robot: whose guess it is.
        one: the keyframe.
        posture: in which its frames are where it asks for them.
        points: of contact [m], (contacts, 3, N + 1).
    """
    tree, last = robot.kindyn.tree, points.shape[2] - 1
    bodies = {tree.frame(name).body for name, target in one.keyframe.frames.items() if target.position}
    for index, name in enumerate(robot.contact_names):
        if tree.frame(name).body in bodies:
            pose = robot.kindyn.forward_kinematics(name, posture.base_transform, posture.joint_positions)
            moved = np.array(pose)[:3, 3] - points[index, :, one.knot]
            points[index] += moved[:, None] * _between({0: 0.0, last: 0.0, one.knot: 1.0}, last)


def _attitude(robot: Robot, keyframe: Keyframe) -> Array | None:
    """Return the attitude of the base that a keyframe asks for, if it does, (4,)."""
    upright: Array = robot.upright.base_quaternion_xyzw
    if keyframe.base_orientation is not None:
        return attitude.signed_like(np.array(keyframe.base_orientation), upright)
    if keyframe.yaw is None:
        return None
    half = 0.5 * keyframe.yaw
    return attitude.product(np.append(np.sin(half) * robot.up, np.cos(half)), upright)


def _turns(first: Array, known: Mapping[int, Array], count: int) -> Sequence[Array]:
    """Return the rotation from a first attitude at every knot, as quaternions: evenly from keyframe to keyframe.

    Args:
        first: attitude.
        known: attitudes by knot.
        count: number of knots.
    """
    order = sorted(known)
    vectors = [
        np.array(quaternion.log(cs.DM(attitude.product(known[knot], attitude.conjugate(first))))).ravel()
        for knot in order
    ]
    at = [np.interp(np.arange(count), order, [vector[axis] for vector in vectors]) for axis in range(3)]
    return [np.array(quaternion.exp(cs.DM(vector))).ravel() for vector in np.array(at).T]


def _keep_com(robot: Robot, view: Mapping[str, Array]) -> None:
    """Move the base so that the CoM stays where it is."""
    count = view["com_position"].shape[1]
    bases = []
    for knot in range(count):
        base = np.eye(4)
        base[:3, :3] = np.array(quaternion.rotation_matrix(cs.DM(view["base_quaternion_xyzw"][:, knot])))
        base[:3, 3] = view["base_position"][:, knot]
        bases.append(base)
    there = np.array(robot.kindyn.CoM_position_fun().map(count)(np.hstack(bases), view["joint_positions"]))
    view["base_position"][:] += view["com_position"] - there

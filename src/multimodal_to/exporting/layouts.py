"""In which order another program has the joints and bodies of a robot, and whether its own model is of that robot."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

from multimodal_to.adam import KinDynComputations
from multimodal_to.adam.spatial import Array
from multimodal_to.adam.tree import Joint
from multimodal_to.adam.urdf import read_urdf
from multimodal_to.arguments import checked
from multimodal_to.errors import InputError, ModelError, OutputError, listed, said, shown, unknown
from multimodal_to.files.reading import read_toml
from multimodal_to.models.robot import Robot
from multimodal_to.values import FrozenMapping

APART = 1e-4
"""A body of a model is where the robot's link is, up to this share of the robot's height L, and this angle [rad]."""


@dataclass(frozen=True, kw_only=True)
class Layout:
    """The joints and bodies of a program's model, each in its order; the first body is the base."""

    joints: tuple[str, ...]
    bodies: tuple[str, ...]  # links
    free_joint: str = "root"  # what the joint of the base is called, where it has a name


@checked
def layout_of(
    robot: Robot,
    order: str,
    *,
    names: str | os.PathLike[str] | None = None,
    model: str | os.PathLike[str] | None = None,
) -> Layout:
    """Return the joints and bodies as a program has them.

    Bodies are the base and every link that a joint moves; links behind fixed joints belong to the body that they are
    fixed to, unless a model or a file of names has them.

    Args:
        robot: whose joints and links they are.
        order: one of `ORDERS`, of which a URDF is read.
        names: TOML file with `joint_names`, and `body_names` if those differ: what goes before the order.
        model: the program's own model, a URDF or MuJoCo's XML: its joints and bodies, in the order of such a model.

    Raises:
        InputError: there is no such order, or a name is not one of the robot.
        ModelError: the model cannot be read, or is not one of the robot.
    """
    if order not in ORDERS:
        raise InputError(unknown("order of joints", order, ORDERS))
    joints = moving_joints(robot)
    found = _arranged(joints, robot.kindyn.tree.base, ORDERS[order])
    if model is not None:
        found = _of_model(robot, Path(model), order)
    if names is not None:
        found = _of_names(Path(names), found)
    _refuse_misfit(robot, joints, found, what=f"'{names or model}'" if names or model else f"the order '{order}'")
    return found


@checked
def moving_joints(robot: Robot) -> tuple[Joint, ...]:
    """Return all joints of the robot's URDF, fixed ones too, in the order of the file.

    Raises:
        OutputError: the URDF is no longer the one that the robot was read from.
    """
    _, joints = read_urdf(robot.urdf)
    tree = robot.kindyn.tree
    moving = {joint.name for joint in joints if joint.kind != "fixed"}
    if changed := {*tree.joint_names, *tree.followers, *tree.locked} ^ moving:
        raise OutputError(f"'{robot.urdf}' no longer has the joints of {robot.name}: {listed(sorted(changed))} changed")
    return tuple(joints)


# ---------------------------------------------------------------- orders of a URDF's joints

Order = Callable[[Sequence[Joint], str], list[Joint]]
"""Returns the joints that can move, in a program's order, from all joints and the name of the base."""


def _below(joints: Sequence[Joint]) -> dict[str, list[Joint]]:
    below: dict[str, list[Joint]] = {}
    for joint in joints:
        below.setdefault(joint.parent, []).append(joint)
    return below


def _depth_first(joints: Sequence[Joint], base: str, key: Callable[[Joint], Any]) -> list[Joint]:
    """Return the joints that can move as a program meets them that goes down each branch to its end.

    Args:
        joints: of the URDF, fixed ones too.
        base: where it begins.
        key: by which joints on one link are sorted.
    """
    below, found = _below(joints), []
    pending = sorted(below.get(base, []), key=key)[::-1]
    while pending:
        joint = pending.pop()
        if joint.kind != "fixed":
            found.append(joint)
        pending += sorted(below.get(joint.child, []), key=key)[::-1]
    return found


@checked
def by_mujoco(joints: Sequence[Joint], base: str) -> list[Joint]:
    """Return them depth first; of several on a link, in the order of the file."""
    return _depth_first(joints, base, key=lambda joint: 0)


@checked
def by_pinocchio(joints: Sequence[Joint], base: str) -> list[Joint]:
    """Return them depth first; of several on a link, by name in the order of bytes, as urdfdom keeps them."""
    return _depth_first(joints, base, key=lambda joint: joint.name.encode("utf-8"))


@checked
def by_isaac(joints: Sequence[Joint], base: str) -> list[Joint]:
    """Return them breadth first over bodies that move, links behind fixed joints merged; on one body by name."""
    below, found, level = _below(joints), [], [base]
    while level:
        following = []
        for body in level:
            own, links = [], [body]
            while links:
                for joint in below.get(links.pop(), []):
                    (links.append(joint.child) if joint.kind == "fixed" else own.append(joint))
            own.sort(key=lambda joint: joint.name.encode("utf-8"))
            found += own
            following += [joint.child for joint in own]
        level = following
    return found


@checked
def by_file(joints: Sequence[Joint], base: str) -> list[Joint]:
    """Return them in the order of the file."""
    return [joint for joint in joints if joint.kind != "fixed"]


ORDERS: Mapping[str, Order] = FrozenMapping(
    {"urdf": by_file, "mujoco": by_mujoco, "pinocchio": by_pinocchio, "isaac": by_isaac}
)
"""In which order programs have the joints of a URDF, by the program's name; `urdf` is that of the file."""


def _arranged(joints: Sequence[Joint], base: str, order: Order) -> Layout:
    """Return the layout of a URDF.

    Args:
        joints: of the URDF, fixed ones too.
        base: its first link.
        order: of the joints that can move.
    """
    ordered = order(joints, base)
    return Layout(joints=tuple(j.name for j in ordered), bodies=(base, *(j.child for j in ordered)))


# ---------------------------------------------------------------- other sources of names


def _of_names(path: Path, otherwise: Layout) -> Layout:
    """Return the layout that a file of names says; what it does not say stays.

    Args:
        path: of the TOML file.
        otherwise: the layout without it.
    """
    table = read_toml(path, InputError)
    if stranger := sorted(set(table) - {"joint_names", "body_names"}):
        raise InputError(f"'{path}' has {listed(stranger)}; expected joint_names, and body_names or not")
    found = {}
    for key, before in (("joint_names", otherwise.joints), ("body_names", otherwise.bodies)):
        names = table.get(key, list(before))
        if not (isinstance(names, list) and names and all(isinstance(name, str) for name in names)):
            raise InputError(f"'{path}': {key} is {shown(names)}; expected a list of names")
        found[key] = tuple(names)
    return Layout(joints=found["joint_names"], bodies=found["body_names"], free_joint=otherwise.free_joint)


def _of_model(robot: Robot, path: Path, order: str) -> Layout:
    """Return the layout of a program's own model after a look whether it is one of the robot.

    Args:
        robot: whose model it should be.
        path: of a URDF or MuJoCo's XML.
        order: of which a URDF is read.
    """
    if path.suffix == ".urdf":
        _, joints = read_urdf(path)
        kindyn = KinDynComputations(path)
        found = _arranged(joints, kindyn.tree.base, ORDERS[order])
        _refuse_misfit(robot, moving_joints(robot), found, what=f"'{path}'")
        placed = _placed_by_urdf(kindyn)
    elif path.suffix == ".xml":
        found, placed = _of_mujoco(path, order)
        _refuse_misfit(robot, moving_joints(robot), found, what=f"'{path}'")
    else:
        raise ModelError(f"'{path}' is no .urdf and no .xml, which models are")
    _refuse_elsewhere(robot, path, found, placed)
    return found


Placing = Callable[[Mapping[str, float]], Callable[[str], Array]]
"""Gives for positions of joints by name what tells the pose of a body in the base, (4, 4)."""


def _placed_by_urdf(kindyn: KinDynComputations) -> Placing:
    def placed(values: Mapping[str, float]) -> Callable[[str], Array]:
        joints = np.array([values[name] for name in kindyn.joint_names])
        return lambda body: np.array(kindyn.forward_kinematics(body, np.eye(4), joints))

    return placed


def _of_mujoco(path: Path, order: str) -> tuple[Layout, Placing]:
    """Return the layout of the robot in a MuJoCo model, and where its bodies are.

    The robot is the tree of the first free joint; without one, of the first body.

    Args:
        path: of the XML.
        order: "isaac" has joints and bodies breadth first, all others as MuJoCo has them.
    """
    mujoco = imported_mujoco()
    try:
        model = mujoco.MjModel.from_xml_path(str(path))
    except ValueError as error:
        raise ModelError(f"MuJoCo cannot read '{path}': {said(error)}") from error
    free = [index for index in range(model.njnt) if model.jnt_type[index] == int(mujoco.mjtJoint.mjJNT_FREE)]
    root = int(model.jnt_bodyid[free[0]]) if free else 1
    bodies = [index for index in range(model.nbody) if index and model.body_rootid[index] == model.body_rootid[root]]
    if order == "isaac":
        bodies.sort(key=lambda index: _depth(model, index))  # a sort keeps the order of those that are as deep
    joints = [index for body in bodies for index in range(model.njnt) if model.jnt_bodyid[index] == body]
    kinds = (int(mujoco.mjtJoint.mjJNT_HINGE), int(mujoco.mjtJoint.mjJNT_SLIDE))
    own = [index for index in joints if index not in free]
    if others := [model.joint(index).name for index in own if model.jnt_type[index] not in kinds]:
        raise ModelError(f"'{path}' has joints that neither turn nor slide: {listed(others)}")
    data = mujoco.MjData(model)

    def placed(values: Mapping[str, float]) -> Callable[[str], Array]:
        for index in own:
            data.qpos[model.jnt_qposadr[index]] = values[model.joint(index).name]
        mujoco.mj_kinematics(model, data)
        base = _pose(data, root)
        return lambda body: np.asarray(np.linalg.inv(base) @ _pose(data, model.body(body).id))

    layout = Layout(
        joints=tuple(model.joint(index).name for index in own),
        bodies=tuple(model.body(index).name for index in bodies),
        free_joint=(model.joint(free[0]).name or "root") if free else "root",
    )
    return layout, placed


def _depth(model: Any, body: int) -> int:
    depth = 0
    while body:
        body, depth = int(model.body_parentid[body]), depth + 1
    return depth


def _pose(data: Any, body: int) -> Array:
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = data.xmat[body].reshape(3, 3), data.xpos[body]
    return pose


def imported_mujoco() -> ModuleType:
    """Return the package.

    Raises:
        OutputError: it is not installed.
    """
    try:
        import mujoco
    except ImportError as error:
        raise OutputError("MuJoCo's models need MuJoCo: pip install 'multimodal-to[sim]'") from error
    return mujoco  # type: ignore[no-any-return]


# ---------------------------------------------------------------- what does not fit


def _refuse_misfit(robot: Robot, joints: Sequence[Joint], layout: Layout, *, what: str) -> None:
    """Name joints and bodies that are not the robot's, that stand twice, or that a program lacks though they move.

    Args:
        robot: whose they should be.
        joints: of its URDF.
        layout: of the program.
        what: the program's model is called in errors.
    """
    movable = [joint.name for joint in joints if joint.kind != "fixed"]
    for kind, given, known in (("joints", layout.joints, movable), ("bodies", layout.bodies, robot.kindyn.frame_names)):
        if strangers := [name for name in given if name not in known]:
            raise ModelError(f"{what} has {kind} that {robot.name} does not have: {listed(strangers)}")
        if len(set(given)) < len(given):
            raise ModelError(f"{what} has {kind} twice: {listed(sorted({n for n in given if given.count(n) > 1}))}")
    if missing := [name for name in movable if name not in layout.joints and name not in robot.kindyn.tree.locked]:
        raise ModelError(f"{what} lacks joints that {robot.name} moves: {listed(missing)}")
    if (base := robot.kindyn.tree.base) not in layout.bodies:
        raise ModelError(f"{what} lacks the base of {robot.name}, '{base}'; its bodies are {listed(layout.bodies)}")


def _refuse_elsewhere(robot: Robot, path: Path, layout: Layout, placed: Placing) -> None:
    """Name the body of a model that is farthest from the robot's link of its name, in postures over the joints' ranges.

    Args:
        robot: whose model it should be.
        path: of the model.
        layout: of the model.
        placed: where it has its bodies.
    """
    tree, limits = robot.kindyn.tree, robot.joint_limits
    rng = np.random.default_rng(0)
    worst: tuple[float, str] = (0.0, "")
    for share in (rng.uniform(size=len(robot.joint_names)) for _ in range(3)):
        joints = limits.lower + share * (limits.upper - limits.lower)
        values = {name: float(value[0]) for name, value in tree.joint_values(joints[:, None]).items()}
        there = placed({name: values[name] for name in layout.joints})
        base = there(tree.base)
        for body in layout.bodies:
            ours = np.array(robot.kindyn.forward_kinematics(body, np.eye(4), joints))
            theirs = np.linalg.inv(base) @ there(body)
            away = float(np.linalg.norm(theirs[:3, 3] - ours[:3, 3])) / robot.standing_height
            turned = float(np.linalg.norm(theirs[:3, :3] - ours[:3, :3])) / np.sqrt(2.0)
            worst = max(worst, (max(away, turned), body))
    if worst[0] > APART:
        raise ModelError(
            f"'{path}' is another robot than {robot.name}: its body '{worst[1]}' is off by {worst[0]:.2g} of the "
            f"robot's height or radians; expected at most {APART:g}"
        )

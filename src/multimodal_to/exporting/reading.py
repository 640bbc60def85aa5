"""Motion files of others into a `Trajectory`, after a look whether their joints and bodies are the robot's."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from multimodal_to.adam.spatial import Array
from multimodal_to.arguments import checked
from multimodal_to.errors import InputError, TrajectoryError, listed, shown, unknown
from multimodal_to.exporting.frames import body_masses
from multimodal_to.exporting.layouts import Layout, layout_of
from multimodal_to.exporting.motion import FLAVOURS, WORLD, order_and_names
from multimodal_to.files.numbers import number
from multimodal_to.files.reading import read_bytes
from multimodal_to.models.robot import Robot
from multimodal_to.trajectory import QUANTITIES, Trajectory, rules
from multimodal_to.trajectory.archive import LARGEST_CONTENT, numbers, read_archive, refuse_missing, text, texts
from multimodal_to.trajectory.derived import base_poses, contact_points, frame_poses
from multimodal_to.trajectory.smoothing import product, rotation_vectors

APART = 0.03
"""A body of a file is where the robot has it, up to this share of its height L, and this angle [rad]: files from
motion capture are smoothed, and made with another edition of the robot, by half of that."""
_XYZW = [1, 2, 3, 0]
"""Where x y z w stand in w x y z."""
_BODIES = ("body_pos_w", "body_quat_w", "body_lin_vel_w", "body_ang_vel_w")
_KEYS: Mapping[str, tuple[str, ...]] = {
    "locomujoco": ("qpos", "qvel", "joint_names", "frequency"),
    "holosoma": ("fps", "joint_pos", "joint_vel", *_BODIES, "joint_names", "body_names"),
    "mjlab": ("fps", "joint_pos", "joint_vel", *_BODIES),
    "beyondmimic": ("fps", "joint_pos", "joint_vel", *_BODIES),
}


@dataclass(frozen=True, kw_only=True, eq=False)
class _Motion:
    """What a motion file holds, frames in columns."""

    fps: float
    joint_names: tuple[str, ...]
    base_position: Array  # [m], (3, frames)
    base_quaternion_xyzw: Array  # (4, frames)
    joint_positions: Array  # [rad or m], (joints, frames)
    base_linear_velocity: Array | None = None  # [m/s], (3, frames); None: not in the file
    base_angular_velocity: Array | None = None  # world axes [rad/s], (3, frames)
    joint_velocities: Array | None = None  # [rad/s or m/s], (joints, frames)
    bodies: Mapping[str, tuple[Array, Array]] | None = None  # position [m] and quaternion x y z w, (frames, 3 and 4)


@checked
def read_motion(
    robot: Robot,
    path: str | os.PathLike[str],
    *,
    flavour: str | None = None,
    fps: float | None = None,
    joint_order: str | os.PathLike[str] | None = None,
    model: str | os.PathLike[str] | None = None,
) -> Trajectory:
    """Read a motion file of a robot that the library knows.

    Joints go by the names in the file. A file without names has the order of its flavour, or of what is given here;
    where it has bodies, forward kinematics has to put them where the file does, so that a wrong order is refused.
    Forces, thrusts and throttles are those of this library's own files, else zero: such a motion is for replay, plots,
    a start guess, and the kinematic part of an audit.

    Args:
        robot: whose motion it is.
        path: of the file.
        flavour: one of `FLAVOURS`; by default told from the file.
        fps: frames a second of a CSV that does not say it; by default 30.
        joint_order: for files without names: one of `ORDERS`, or a TOML file with `joint_names` and `body_names`.
        model: for files without names: the model that the file was made with, a URDF or MuJoCo's XML.

    Raises:
        InputError: there is no such flavour or order, or the file needs its flavour named.
        TrajectoryError: the file is broken, or its joints and bodies are not those of the robot.
        ModelError: the model is not one of the robot.
    """
    source = Path(path)
    if flavour is not None and flavour not in FLAVOURS:
        raise InputError(unknown("flavour of motion", flavour, FLAVOURS))
    table = source.suffix.lower() == ".csv"
    stored = {} if table else read_archive(source, leave_out_pickled=True)
    known: tuple[str, ...] = ("unitree-csv",) if table else flavours_of(stored)
    if not known:
        raise TrajectoryError(f"'{source}' is no motion file: its arrays are {listed(sorted(stored))}")
    flavours = known if flavour is None else (flavour,)
    refused: list[TrajectoryError] = []
    for name in flavours:  # a file without names may be of two
        order, names = order_and_names(joint_order, FLAVOURS[name].order)
        layout = layout_of(robot, order, names=names, model=model)
        try:
            found = _read(name, stored, source, robot, layout, fps)
            _refuse_other_joints(found, robot, source)
            _refuse_shuffled(found, robot, source)
            return _trajectory(robot, found, _extras(stored, source), source)
        except TrajectoryError as error:
            refused.append(error)
    raise refused[0]


@checked
def flavours_of(stored: Mapping[str, Array]) -> tuple[str, ...]:
    """Return which flavours an archive may be of, by its keys; none where it is no motion file.

    Args:
        stored: the arrays of the archive by name.
    """
    if "flavour" in stored and stored["flavour"].shape == () and str(stored["flavour"]) in FLAVOURS:
        return (str(stored["flavour"]),)
    fitting = [name for name, keys in _KEYS.items() if set(keys) <= set(stored)]
    if "holosoma" in fitting:
        columns, names = stored["joint_pos"].shape[-1], stored["joint_names"].size
        return ("holosoma",) if columns == names + 7 else ("mjlab", "beyondmimic")
    return tuple(fitting)


# ---------------------------------------------------------------- what each flavour holds


def _read(
    flavour: str, stored: Mapping[str, Any], source: Path, robot: Robot, layout: Layout, fps: float | None
) -> _Motion:
    """Return what a file holds.

    Args:
        flavour: of the file.
        stored: the arrays of the archive by name.
        source: the file.
        robot: whose motion it should be.
        layout: order of joints and bodies where the file names none.
        fps: frames a second where the file does not say it.
    """
    if flavour == "unitree-csv":
        return _read_unitree(source, layout, fps)
    refuse_missing(stored, _KEYS[flavour], source)
    if flavour == "locomujoco":
        return _read_locomujoco(stored, source)
    names = texts(stored, "joint_names", source) if "joint_names" in stored else layout.joints
    bodies = texts(stored, "body_names", source) if "body_names" in stored else layout.bodies
    rate = _rate(stored, "fps", source)
    if flavour == "holosoma":
        qpos, qvel = numbers(stored, "joint_pos", source), numbers(stored, "joint_vel", source)
        found = _from_coordinates(qpos, qvel, names, rate, source)
        return replace(found, bodies=_placed(stored, source, bodies))
    joints, rates = numbers(stored, "joint_pos", source), numbers(stored, "joint_vel", source)
    _refuse_shape(joints, len(names), "joint_pos", source)
    _refuse_shape(rates, len(names), "joint_vel", source)
    placed, base = _placed(stored, source, bodies), robot.kindyn.tree.base
    if base not in placed:
        raise TrajectoryError(f"'{source}' lacks the base of {robot.name}, '{base}'; its bodies are {listed(bodies)}")
    linear, angular = (numbers(stored, name, source)[:, bodies.index(base)] for name in _BODIES[2:])
    position, quaternion = placed[base]
    if FLAVOURS[flavour].com_velocities:
        pose = _rotations(quaternion)
        linear = linear - np.cross(angular, pose @ body_masses(robot, (base,))[0].com)
    return _Motion(
        fps=rate,
        joint_names=names,
        base_position=position.T,
        base_quaternion_xyzw=quaternion.T,
        joint_positions=joints.T,
        base_linear_velocity=linear.T,
        base_angular_velocity=angular.T,
        joint_velocities=rates.T,
        bodies=placed,
    )


def _read_locomujoco(stored: Mapping[str, Any], source: Path) -> _Motion:
    names = texts(stored, "joint_names", source)[1:]  # the first is the free one
    qpos, qvel = numbers(stored, "qpos", source), numbers(stored, "qvel", source)
    found = _from_coordinates(qpos, qvel, names, _rate(stored, "frequency", source), source)
    if not {"xpos", "xquat", "body_names"} <= set(stored):
        return found
    arrays = {"body_pos_w": stored["xpos"], "body_quat_w": stored["xquat"]}
    return replace(found, bodies=_placed(arrays, source, texts(stored, "body_names", source)))


def _read_unitree(source: Path, layout: Layout, fps: float | None) -> _Motion:
    lines = read_bytes(source, LARGEST_CONTENT // 4, TrajectoryError).decode("utf-8", "replace").splitlines()
    said = dict(line[1:].strip().split(": ", 1) for line in lines if line.startswith("#") and ": " in line)
    try:
        rows = np.loadtxt(lines, delimiter=",", ndmin=2)
        rate = number(said["fps"]) if fps is None and "fps" in said else fps
    except ValueError as error:
        raise TrajectoryError(f"'{source}' is no table of numbers with commas between them: {error}") from error
    names = tuple(said["joint_names"].split(",")) if "joint_names" in said else layout.joints
    _refuse_shape(rows, 7 + len(names), "a row", source)
    return _Motion(
        fps=FLAVOURS["unitree-csv"].fps if rate is None else rate,
        joint_names=names,
        base_position=rows[:, :3].T,
        base_quaternion_xyzw=rows[:, 3:7].T,
        joint_positions=rows[:, 7:].T,
    )


def _from_coordinates(qpos: Array, qvel: Array, names: Sequence[str], fps: float, source: Path) -> _Motion:
    """Return a motion from MuJoCo's coordinates of a free base.

    Args:
        qpos: positions, quaternion w x y z, (frames, 7 + joints).
        qvel: velocities, the angular one in the base's axes, (frames, 6 + joints).
        names: of the joints.
        fps: frames a second.
        source: the file.
    """
    _refuse_shape(qpos, 7 + len(names), "qpos", source)
    _refuse_shape(qvel, 6 + len(names), "qvel", source)
    quaternion = qpos[:, 3:7][:, _XYZW]
    return _Motion(
        fps=fps,
        joint_names=tuple(names),
        base_position=qpos[:, :3].T,
        base_quaternion_xyzw=quaternion.T,
        joint_positions=qpos[:, 7:].T,
        base_linear_velocity=qvel[:, :3].T,
        base_angular_velocity=np.einsum("kij,kj->ik", _rotations(quaternion), qvel[:, 3:6]),
        joint_velocities=qvel[:, 6:].T,
    )


def _placed(stored: Mapping[str, Any], source: Path, names: Sequence[str]) -> dict[str, tuple[Array, Array]]:
    """Return where bodies are by name.

    Args:
        stored: with their positions and quaternions w x y z.
        source: the file.
        names: of the bodies.
    """
    positions, quaternions = numbers(stored, "body_pos_w", source), numbers(stored, "body_quat_w", source)
    if positions.ndim != 3 or positions.shape[1:] != (len(names), 3) or quaternions.shape[1:] != (len(names), 4):
        raise TrajectoryError(
            f"'{source}': bodies have the shapes {positions.shape} and {quaternions.shape}; expected (frames, "
            f"{len(names)}, 3 and 4) for {listed(names)}"
        )
    return {name: (positions[:, i], quaternions[:, i][:, _XYZW]) for i, name in enumerate(names) if name != WORLD}


def _rate(stored: Mapping[str, Any], name: str, source: Path) -> float:
    values = numbers(stored, name, source)
    if values.size != 1 or not (np.isfinite(values).all() and values.item() > 0.0):
        raise TrajectoryError(f"'{source}': '{name}' is {shown(values.tolist())}; expected one positive number")
    return float(values.item())


def _refuse_shape(values: Array, columns: int, name: str, source: Path) -> None:
    """Raise an error unless there are two frames or more, of so many numbers.

    Args:
        values: (frames, columns).
        columns: expected.
        name: of the values.
        source: the file.
    """
    if values.ndim != 2 or values.shape[0] < 2 or values.shape[1] != columns:
        raise TrajectoryError(
            f"'{source}': {name} has the shape {values.shape}; expected two frames or more of {columns}"
        )


def _rotations(quaternions_xyzw: Array) -> Array:
    """Return rotation matrices, (frames, 3, 3), of quaternions x y z w, (frames, 4)."""
    x, y, z, w = (quaternions_xyzw / np.linalg.norm(quaternions_xyzw, axis=1)[:, None]).T
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    ).transpose(2, 0, 1)


# ---------------------------------------------------------------- what does not fit


def _refuse_other_joints(found: _Motion, robot: Robot, source: Path) -> None:
    if len(set(found.joint_names)) < len(found.joint_names):
        raise TrajectoryError(f"'{source}' names a joint twice: {listed(found.joint_names)}")
    if missing := [name for name in robot.joint_names if name not in found.joint_names]:
        raise TrajectoryError(f"'{source}' lacks joints of {robot.name}: {listed(missing)}")
    tree = robot.kindyn.tree
    known = {*robot.joint_names, *tree.followers, *tree.locked}
    if strangers := [name for name in found.joint_names if name not in known]:
        raise TrajectoryError(f"'{source}' has joints that {robot.name} does not have: {listed(strangers)}")


def _refuse_shuffled(found: _Motion, robot: Robot, source: Path) -> None:
    """Name the body of a file that is farthest from where forward kinematics of the file's joints has it.

    Bodies that the robot does not have, as those of a hand or of what it carries, are passed over.

    Args:
        found: in the file.
        robot: whose motion it should be.
        source: the file.
    """
    if not found.bodies:
        return
    posed = _bare(robot, found, source)
    known = {name: placed for name, placed in found.bodies.items() if name in robot.kindyn.frame_names}
    if not known:
        raise TrajectoryError(f"'{source}' has no body of {robot.name}: {listed(found.bodies)}")
    worst: tuple[float, str, int] = (0.0, "", 0)
    for name, (positions, quaternions) in known.items():
        ours = frame_poses(robot, posed, name)
        away = np.linalg.norm(positions - ours[:, :3, 3], axis=1) / robot.standing_height
        turned = np.linalg.norm(_rotations(quaternions) - ours[:, :3, :3], axis=(1, 2)) / np.sqrt(2.0)
        off = np.maximum(away, turned)
        worst = max(worst, (float(off.max()), name, int(off.argmax())))
    if not worst[0] <= APART:  # not-a-number too
        raise TrajectoryError(
            f"'{source}' has its joints or bodies in another order than their names, or is of another robot: the body "
            f"'{worst[1]}' of frame {worst[2]} is off by {worst[0]:.2g} of the height of {robot.name} or radians from "
            f"where the joints put it; expected at most {APART:g}"
        )


# ---------------------------------------------------------------- the trajectory


def _bare(robot: Robot, found: _Motion, source: Path) -> Trajectory:
    """Return the motion with zeros for all that is no posture and no velocity."""
    count = found.base_position.shape[1]
    bodies = {"robot": 1, "joint": len(robot.joint_names), "contact": len(robot.contacts), "jet": len(robot.jets)}
    arrays: dict[str, Any] = {name: np.zeros((q.rows * bodies[q.of], count)) for name, q in QUANTITIES.items()}
    rows = [found.joint_names.index(name) for name in robot.joint_names]
    arrays["base_position"], arrays["base_quaternion_xyzw"] = found.base_position, found.base_quaternion_xyzw
    arrays["joint_positions"] = found.joint_positions[rows]
    step = 1.0 / found.fps
    if found.joint_velocities is None:
        quaternion = found.base_quaternion_xyzw / np.linalg.norm(found.base_quaternion_xyzw, axis=0)
        arrays["joint_velocities"] = np.gradient(arrays["joint_positions"], step, axis=1)
        arrays["base_linear_velocity"] = np.gradient(found.base_position, step, axis=1)
        arrays["base_angular_velocity"] = _turning(quaternion, step)
    else:
        arrays["joint_velocities"] = found.joint_velocities[rows]
        arrays["base_linear_velocity"] = found.base_linear_velocity
        arrays["base_angular_velocity"] = found.base_angular_velocity
    try:
        return Trajectory(
            robot=robot.name,
            scenario=source.stem.replace("_", "-"),
            time=np.asarray(np.arange(count) * step, dtype=float),
            joint_names=robot.joint_names,
            contact_names=robot.contact_names,
            jet_names=robot.jet_names,
            rule=rules.SAMPLED,
            **arrays,
        )
    except TrajectoryError as error:
        raise TrajectoryError(f"'{source}': {error}") from error


def _turning(quaternion: Array, step: float) -> Array:
    """Return the angular velocity in world axes by differences of the neighbours [rad/s], (3, frames).

    Args:
        quaternion: unit, x y z w, (4, frames).
        step: between frames [s].
    """
    count = quaternion.shape[1]
    before, after = np.maximum(np.arange(count) - 1, 0), np.minimum(np.arange(count) + 1, count - 1)
    conjugate = quaternion[:, before] * [[-1.0], [-1.0], [-1.0], [1.0]]
    return np.asarray(rotation_vectors(product(quaternion[:, after], conjugate)) / ((after - before) * step))


def _trajectory(robot: Robot, found: _Motion, extras: Mapping[str, Any], source: Path) -> Trajectory:
    """Return the whole trajectory: CoM, momentum and contact points follow from postures and velocities.

    Args:
        robot: whose motion it is.
        found: in the file.
        extras: forces and thrusts of this library's own files.
        source: the file.
    """
    bare, kindyn = _bare(robot, found, source), robot.kindyn
    count, step = bare.time.size, 1.0 / found.fps
    base = np.hstack(list(base_poses(bare)))
    matrices = np.array(kindyn.centroidal_momentum_matrix_fun().map(count)(base, bare.joint_positions))
    rates = np.vstack([bare.base_linear_velocity, bare.base_angular_velocity, bare.joint_velocities])
    momentum = np.einsum("rkc,ck->rk", matrices.reshape(6, count, -1), rates)
    points = contact_points(robot, bare)
    acting: dict[str, Any] = _acting(bare, extras, step)
    return replace(
        bare,
        com_position=np.array(kindyn.CoM_position_fun().map(count)(base, bare.joint_positions)),
        com_velocity=momentum[:3] / robot.mass,
        com_acceleration=np.gradient(momentum[:3] / robot.mass, step, axis=1),
        angular_momentum=momentum[3:],
        angular_momentum_rate=np.gradient(momentum[3:], step, axis=1),
        contact_positions=points.transpose(0, 2, 1).reshape(-1, count),
        **acting,
    )


def _acting(bare: Trajectory, extras: Mapping[str, Any], step: float) -> dict[str, Array]:
    """Return forces, thrusts and throttles of a file that names the robot's points and jets; nothing else.

    Args:
        bare: the motion.
        extras: of the file, by the names of `exporting.motion`.
        step: between frames [s].
    """
    count, found = bare.time.size, {}
    forces = np.asarray(extras.get("contact_force", ()), dtype=float)
    if tuple(extras.get("contact_names", ())) == bare.contact_names and forces.shape[:1] == (count,):
        found["contact_forces"] = forces.reshape(count, -1).T
        found["contact_force_rates"] = np.gradient(found["contact_forces"], step, axis=1)
    if tuple(extras.get("jet_names", ())) == bare.jet_names and bare.jet_names:
        for name in ("thrust", "throttle"):
            found[name] = np.asarray(extras.get(name, np.zeros((count, len(bare.jet_names)))), dtype=float).T
        found["thrust_rate"] = np.gradient(found["thrust"], step, axis=1)
        found["thrust_acceleration"] = np.gradient(found["thrust_rate"], step, axis=1)
    return found


def _extras(stored: Mapping[str, Any], source: Path) -> dict[str, Any]:
    """Return what this library's own files hold beside what readers need."""
    if "metadata" in stored and stored["metadata"].dtype.kind == "U":
        try:
            table = json.loads(text(stored, "metadata", source))
        except ValueError:
            return {}  # another program's
        return table if isinstance(table, dict) else {}
    found: dict[str, Any] = {
        name: texts(stored, name, source) for name in ("contact_names", "jet_names") if name in stored
    }
    return found | {
        name: numbers(stored, name, source) for name in ("contact_force", "thrust", "throttle") if name in stored
    }

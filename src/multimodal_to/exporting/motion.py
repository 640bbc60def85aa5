"""Motion files of trackers and simulators, each with the keys, orders and conventions of its reader."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from multimodal_to.adam.spatial import Array
from multimodal_to.arguments import checked
from multimodal_to.errors import InputError, unknown
from multimodal_to.exporting.frames import Frames, frames_of
from multimodal_to.exporting.layouts import ORDERS, layout_of
from multimodal_to.exporting.locomujoco import WXYZ, model_arrays, subtree_coms
from multimodal_to.files.writing import whole
from multimodal_to.models.robot import Robot
from multimodal_to.trajectory import Trajectory
from multimodal_to.trajectory.derived import base_poses, frame_poses
from multimodal_to.values import FrozenMapping

WORLD = "world"
"""What holosoma and LocoMuJoCo call MuJoCo's body that does not move."""
_EXTRAS = (
    "Readers do not need: time [s]; contact_state, contact_force (frames, points, 3) [N] on the robot in world axes; "
    "thrust [N], throttle [%]; joint_torque [N m or N] by inverse dynamics; com_position [m], com_velocity [m/s]; each "
    "in the order of contact_names, jet_names and joint_names."
)


@dataclass(frozen=True, kw_only=True)
class Flavour:
    """What one family of readers expects."""

    reader: str
    suffix: str
    order: str  # one of `ORDERS`, for joints and bodies where no model says
    fps: float  # that its readers are used to [1/s]
    conventions: str
    write: Callable[[Frames, Path], None]
    com_velocities: bool = False  # linear velocities of bodies are those of their centres of mass, not of their origins


@checked
def write_motion(
    robot: Robot,
    trajectory: Trajectory,
    path: str | os.PathLike[str],
    *,
    flavour: str,
    fps: float | None = None,
    joint_order: str | os.PathLike[str] | None = None,
    model: str | os.PathLike[str] | None = None,
) -> Path:
    """Write a motion file for trackers and simulators, with frames at a steady rate; it appears whole or not at all.

    Between knots the motion is that of `trajectory.smoothing.smooth`. Every file names its joints and bodies.

    Args:
        robot: the robot of the trajectory.
        trajectory: the motion.
        path: of the file, by convention `.npz`, or `.csv` for `unitree-csv`.
        flavour: one of `FLAVOURS`.
        fps: frames a second; by default what the flavour's readers are used to.
        joint_order: one of `ORDERS` for joints and bodies, or a TOML file with `joint_names` and, if wanted,
            `body_names`; by default the flavour's order.
        model: the reader's own model, a URDF or MuJoCo's XML: its joints and bodies, in its order.

    Raises:
        InputError: there is no such flavour or order, or the trajectory is for another robot or too short.
        ModelError: the model, or the names, are not those of the robot.
        OutputError: the file cannot be written, or MuJoCo is not there to read its XML.
    """
    if flavour not in FLAVOURS:
        raise InputError(unknown("flavour of motion", flavour, FLAVOURS))
    wanted = FLAVOURS[flavour]
    order, names = order_and_names(joint_order, wanted.order)
    layout = layout_of(robot, order, names=names, model=model)
    frames = frames_of(robot, trajectory, layout, wanted.fps if fps is None else fps)
    with whole(path) as draft:
        wanted.write(frames, draft)
    return Path(path)


@checked
def order_and_names(
    joint_order: str | os.PathLike[str] | None, usual: str
) -> tuple[str, str | os.PathLike[str] | None]:
    """Return the order of joints, and the file of names if that is what was given.

    Args:
        joint_order: one of `ORDERS`, a TOML file, or None.
        usual: the order where none is given.

    Raises:
        InputError: it is neither an order nor a TOML file.
    """
    if joint_order is None or str(joint_order) in ORDERS:
        return str(joint_order or usual), None
    if Path(joint_order).suffix != ".toml":
        raise InputError(f"{unknown('order of joints', str(joint_order), ORDERS)}; nor is it a .toml file of names")
    return usual, joint_order


# ---------------------------------------------------------------- what the flavours hold


def _write_mjlab(frames: Frames, path: Path) -> None:
    _save(path, frames, "mjlab", {**_joints(frames), **_bodies(frames, frames.body_velocities[..., :3])})


def _write_beyondmimic(frames: Frames, path: Path) -> None:
    _save(path, frames, "beyondmimic", {**_joints(frames), **_bodies(frames, frames.at(frames.body_coms))})


def _write_holosoma(frames: Frames, path: Path) -> None:
    bodies = _bodies(frames, frames.body_velocities[..., :3])
    still = {name: np.zeros_like(values[:, :1]) for name, values in bodies.items()}
    still["body_quat_w"][..., 0] = 1.0
    arrays = {name: np.concatenate([still[name], values], axis=1) for name, values in bodies.items()}
    qpos, qvel = _coordinates(frames)
    arrays |= {"fps": _fps(frames), "joint_pos": qpos, "joint_vel": qvel}
    _save(path, frames, "holosoma", arrays, bodies=(WORLD, *frames.layout.bodies))


def _write_locomujoco(frames: Frames, path: Path) -> None:
    """Write what `Trajectory.load` of LocoMuJoCo takes; it refuses any key that it does not know."""
    qpos, qvel = _coordinates(frames)
    positions, quaternions_wxyz = frames.body_positions, frames.body_quaternions_xyzw[..., WXYZ]
    count, robot, motion = motion_count(frames), frames.robot, frames.motion
    coms = subtree_coms(frames)  # MuJoCo's velocities are those at the CoM of all, which is the world's
    about = frames.at(np.broadcast_to(coms[:, :1], positions.shape))
    cvel = np.concatenate([frames.body_velocities[..., 3:], about], axis=2)
    world = np.zeros((count, 1, 3))
    upright = np.tile([1.0, 0.0, 0.0, 0.0], (count, 1, 1))
    sites = {**{name: name for name in robot.contact_names}, **{jet.name: jet.frame for jet in robot.jets}}
    poses = np.array([frame_poses(robot, motion, frame) for frame in sites.values()]).reshape(-1, count, 4, 4)
    names = (WORLD, *frames.layout.bodies)
    arrays = {
        "qpos": qpos,
        "qvel": qvel,
        "xpos": np.concatenate([world, positions], axis=1),
        "xquat": np.concatenate([upright, quaternions_wxyz], axis=1),
        "cvel": np.concatenate([np.zeros((count, 1, 6)), cvel], axis=1),
        "subtree_com": coms,
        "site_xpos": poses[:, :, :3, 3].transpose(1, 0, 2),
        "site_xmat": poses[:, :, :3, :3].reshape(-1, count, 9).transpose(1, 0, 2),
        "split_points": np.array([0, count]),
        "joint_names": np.array([frames.layout.free_joint, *frames.layout.joints]),
        "body_names": np.array(names),
        "site_names": np.array(list(sites), dtype=np.str_),
        "frequency": np.array(frames.fps),
        **model_arrays(frames, list(sites.values())),
    }
    metadata = {
        name: np.asarray(value).tolist() for name, value in {**_texts(frames, "locomujoco"), **_extras(frames)}.items()
    }
    _savez(path, {**arrays, "metadata": np.array(json.dumps(metadata))})


def _write_unitree(frames: Frames, path: Path) -> None:
    rows = np.hstack([frames.motion.base_position.T, frames.base_quaternion_xyzw, frames.joint_positions])
    texts = _texts(frames, "unitree-csv")
    head = [f"{key}: {texts[key]}" for key in ("flavour", "robot", "scenario", "base")]
    head += [
        f"fps: {frames.fps:g}",
        f"joint_names: {','.join(frames.layout.joints)}",
        *texts["conventions"].split("\n"),
    ]
    with path.open("w", encoding="utf-8", newline="") as stream:
        stream.writelines(f"# {line}\n" for line in head)
        np.savetxt(stream, rows, fmt="%.9f", delimiter=",")


@checked
def motion_count(frames: Frames) -> int:
    """Return the number of frames."""
    return int(frames.motion.time.size)


def _fps(frames: Frames) -> Array:
    return np.array([int(frames.fps) if float(frames.fps).is_integer() else frames.fps])


def _joints(frames: Frames) -> dict[str, Array]:
    return {"fps": _fps(frames), "joint_pos": frames.joint_positions, "joint_vel": frames.joint_velocities}


def _bodies(frames: Frames, linear: Array) -> dict[str, Array]:
    """Return the arrays of bodies.

    Args:
        frames: the motion.
        linear: velocities of the bodies [m/s], (frames, bodies, 3).
    """
    return {
        "body_pos_w": frames.body_positions,
        "body_quat_w": frames.body_quaternions_xyzw[..., WXYZ],
        "body_lin_vel_w": linear,
        "body_ang_vel_w": frames.body_velocities[..., 3:],
    }


def _coordinates(frames: Frames) -> tuple[Array, Array]:
    """Return MuJoCo's qpos and qvel of a free base: quaternion w x y z, angular velocity in the base's axes."""
    motion = frames.motion
    turning = np.einsum("kij,ik->kj", base_poses(motion)[:, :3, :3], motion.base_angular_velocity)
    qpos = np.hstack([motion.base_position.T, frames.base_quaternion_xyzw[:, WXYZ], frames.joint_positions])
    return qpos, np.hstack([motion.base_linear_velocity.T, turning, frames.joint_velocities])


def _texts(frames: Frames, flavour: str) -> dict[str, Any]:
    motion = frames.motion
    return {
        "flavour": flavour,
        "robot": motion.robot,
        "scenario": motion.scenario,
        "base": frames.robot.kindyn.tree.base,
        "conventions": f"{FLAVOURS[flavour].conventions}\n{_EXTRAS if flavour != 'unitree-csv' else 'Time in s.'}",
        "contact_names": motion.contact_names,
        "jet_names": motion.jet_names,
    }


def _extras(frames: Frames) -> dict[str, Array]:
    motion = frames.motion
    return {
        "time": motion.time - motion.time[0],
        "contact_state": frames.contact_state,
        "contact_force": frames.contact_forces,
        "thrust": motion.thrust.T,
        "throttle": motion.throttle.T,
        "joint_torque": frames.joint_torques,
        "com_position": motion.com_position.T,
        "com_velocity": motion.com_velocity.T,
    }


def _save(
    path: Path, frames: Frames, flavour: str, arrays: Mapping[str, Array], bodies: tuple[str, ...] | None = None
) -> None:
    """Write arrays with the names and what readers do not need.

    Args:
        path: of the file.
        frames: the motion.
        flavour: of the file.
        arrays: what readers need.
        bodies: names of the bodies, where they are not those of the layout.
    """
    names = {"joint_names": frames.layout.joints, "body_names": bodies or frames.layout.bodies}
    labels: dict[str, Any] = {
        key: np.array(text, dtype=np.str_) for key, text in {**_texts(frames, flavour), **names}.items()
    }
    _savez(path, {**arrays, **_extras(frames), **labels})


def _savez(path: Path, arrays: Mapping[str, Array]) -> None:
    with path.open("wb") as stream:
        np.savez_compressed(stream, allow_pickle=False, **arrays)


_BODIES = (
    "body_pos_w [m], body_quat_w w x y z, body_lin_vel_w [m/s] and body_ang_vel_w [rad/s] in world axes, (frames, "
    "bodies, ...) in the order of body_names; "
)
_ANGLES = "joint_pos [rad or m] and joint_vel [rad/s or m/s], (frames, joints) in the order of joint_names; "
FLAVOURS: Mapping[str, Flavour] = FrozenMapping(
    {
        "mjlab": Flavour(
            reader="tracking tasks of mjlab",
            suffix=".npz",
            order="mujoco",
            fps=50.0,
            conventions=f"{_ANGLES}{_BODIES}linear velocities are those of the bodies' origins.",
            write=_write_mjlab,
        ),
        "beyondmimic": Flavour(
            reader="whole_body_tracking (BeyondMimic) and other trackers in Isaac Lab",
            suffix=".npz",
            order="isaac",
            fps=50.0,
            conventions=f"{_ANGLES}{_BODIES}linear velocities are those of the bodies' centres of mass.",
            write=_write_beyondmimic,
            com_velocities=True,
        ),
        "holosoma": Flavour(
            reader="whole-body tracking of holosoma",
            suffix=".npz",
            order="mujoco",
            fps=50.0,
            conventions="joint_pos = (base position [m], quaternion w x y z, joints [rad or m]), joint_vel = (base's "
            "linear velocity in world axes [m/s], angular in its own axes [rad/s], joints); " + _BODIES + "linear "
            "velocities are those of the bodies' origins; the first body is the world.",
            write=_write_holosoma,
        ),
        "locomujoco": Flavour(
            reader="LocoMuJoCo 1.x",
            suffix=".npz",
            order="mujoco",
            fps=100.0,
            conventions="Arrays are MuJoCo's of the same names; the first joint is the free one, the first body the "
            "world.",
            write=_write_locomujoco,
        ),
        "unitree-csv": Flavour(
            reader="converters that take Unitree's CSV",
            suffix=".csv",
            order="mujoco",
            fps=30.0,
            conventions="A row for each frame: base x y z [m], quaternion x y z w, joints [rad or m] in the order of "
            "joint_names.",
            write=_write_unitree,
        ),
    }
)
"""The motion files that can be written and read, by the name of the family of readers."""

"""Trajectories for other programs: tables (CSV), MATLAB files, and the coordinates of MuJoCo and Pinocchio."""

from __future__ import annotations

import csv
import os
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np

from multimodal_to.adam.spatial import Array
from multimodal_to.errors import OutputError
from multimodal_to.files.writing import whole
from multimodal_to.models.robot import Robot
from multimodal_to.trajectory import QUANTITIES, Trajectory, labels, row_labels
from multimodal_to.trajectory.derived import JOINT_TORQUES, base_poses, joint_torques, sampled
from multimodal_to.values import FrozenMapping

_NAMES = ("joint_names", "contact_names", "jet_names")
_RATES = (
    "Rates at knot k are those of the interval that ends at k where backward Euler was the rule, and none at knot 0; "
    "where the rule was leapfrog, all quantities are at the knots."
)
CONVENTIONS = (
    "Time in s. All vectors are in world axes, z up. Quaternions are world-from-base, x y z w.",
    _RATES,
    "Contact forces act on the robot at its contact points; thrusts act along -z of the jets' frames.",
    "Joint torques follow from the motion by inverse dynamics, at the knots. They have no meaning at the knot whose "
    "acceleration the motion does not tell: the first of backward Euler, the last of leapfrog.",
)


def columns(robot: Robot, trajectory: Trajectory) -> dict[str, tuple[str, Array]]:
    """Return every row of every quantity by name, as ``joint_positions.l_knee``, with its unit and values.

    The last ones are the joint torques, which follow from the motion.

    Args:
        robot: the robot of the trajectory, for the torques.
        trajectory: the motion.
    """
    torques, trajectory = joint_torques(robot, trajectory), sampled(trajectory)
    table = {"time": ("s", trajectory.time)}
    for name, quantity in QUANTITIES.items():
        for row, label in enumerate(labels(name, trajectory, separator=".")):
            place = label.replace(" ", "_") if quantity.of == "jet" else label
            table[".".join(filter(None, (name, place)))] = (quantity.unit, getattr(trajectory, name)[row])
    for joint, values in zip(row_labels(trajectory, JOINT_TORQUES.of, JOINT_TORQUES.axes), torques, strict=True):
        table[f"joint_torques.{joint}"] = (JOINT_TORQUES.unit, values)
    return table


def write_csv(robot: Robot, trajectory: Trajectory, path: str | os.PathLike[str]) -> Path:
    """Write one row for each knot; lines that start with # say the conventions, the first other one names and units.

    Args:
        robot: the robot of the trajectory, for the torques.
        trajectory: the motion.
        path: of the file, by convention `.csv`.
    """
    table = columns(robot, trajectory)
    with whole(path) as draft, draft.open("w", encoding="utf-8", newline="") as stream:
        for line in (f"robot {trajectory.robot}, scenario {trajectory.scenario}", *CONVENTIONS):
            stream.write(f"# {line}\n")
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerow(f"{name} [{unit}]" for name, (unit, _) in table.items())
        writer.writerows(np.column_stack([values for _, values in table.values()]).tolist())
    return Path(path)


def write_mat(robot: Robot, trajectory: Trajectory, path: str | os.PathLike[str]) -> Path:
    """Write a MATLAB file (version 5): every quantity and the joint torques, (rows, knots + 1), names, units.

    Names are cells; units are a struct.

    Args:
        robot: the robot of the trajectory, for the torques.
        trajectory: the motion.
        path: of the file, by convention `.mat`.

    Raises:
        OutputError: SciPy is not installed, or the file cannot be written.
    """
    try:
        from scipy.io import savemat
    except ImportError as error:
        raise OutputError("MATLAB files need SciPy: pip install 'multimodal-to[mat]'") from error
    torques, trajectory = joint_torques(robot, trajectory), sampled(trajectory)
    content = {
        "robot": trajectory.robot,
        "scenario": trajectory.scenario,
        "conventions": "\n".join(CONVENTIONS),
        "units": {name: quantity.unit for name, quantity in {**QUANTITIES, "joint_torques": JOINT_TORQUES}.items()},
        "time": trajectory.time,
        **{name: np.array(getattr(trajectory, name), dtype=object) for name in _NAMES},
        **{name: getattr(trajectory, name) for name in QUANTITIES},
        "joint_torques": torques,
    }
    with whole(path) as draft:
        savemat(draft, content, oned_as="row", long_field_names=True)
    return Path(path)


def write_mujoco(robot: Robot, trajectory: Trajectory, path: str | os.PathLike[str]) -> Path:
    """Write an `.npz` with MuJoCo's qpos, qvel and ctrl for a free base, a row for each knot, and `conventions`.

    qpos = (p, quaternion w x y z, s); qvel = (ṗ in world axes, ω in the base's axes, ṡ); ctrl = (joint torques by
    inverse dynamics [N m], thrusts [N]). Joints and jets are in the order of `joint_names` and `jet_names`.

    Args:
        robot: the robot of the trajectory, for the torques.
        trajectory: the motion.
        path: of the file, by convention `.npz`.
    """
    torques, trajectory = joint_torques(robot, trajectory), sampled(trajectory)
    parts = {
        "qpos": [trajectory.base_position, _unit_quaternions(trajectory)[[3, 0, 1, 2]], trajectory.joint_positions],
        "qvel": [
            trajectory.base_linear_velocity,
            _in_base(trajectory, "base_angular_velocity"),
            trajectory.joint_velocities,
        ],
        "ctrl": [torques, trajectory.thrust],
    }
    return _write_arrays(
        robot,
        trajectory,
        path,
        parts,
        (
            "qpos = (base position [m], quaternion w x y z, joints [rad]).",
            "qvel = (base's linear velocity in world axes [m/s], angular in its own axes [rad/s], joints [rad/s]).",
            "ctrl = (joint torques [N m], thrusts [N]).",
        ),
    )


def write_pinocchio(robot: Robot, trajectory: Trajectory, path: str | os.PathLike[str]) -> Path:
    """Write an `.npz` with Pinocchio's q, v and tau for a free flyer, a row for each knot, and `conventions`.

    q = (p, quaternion x y z w, s); v = (ṗ and ω, both in the base's axes, ṡ); tau = joint torques by inverse dynamics
    [N m]. Joints are in the order of `joint_names`, which need not be that of a Pinocchio model.

    Args:
        robot: the robot of the trajectory, for the torques.
        trajectory: the motion.
        path: of the file, by convention `.npz`.
    """
    torques, trajectory = joint_torques(robot, trajectory), sampled(trajectory)
    parts = {
        "q": [trajectory.base_position, _unit_quaternions(trajectory), trajectory.joint_positions],
        "v": [
            _in_base(trajectory, "base_linear_velocity"),
            _in_base(trajectory, "base_angular_velocity"),
            trajectory.joint_velocities,
        ],
        "tau": [torques],
    }
    return _write_arrays(
        robot,
        trajectory,
        path,
        parts,
        (
            "q = (base position [m], quaternion x y z w, joints [rad]).",
            "v = (base's linear velocity [m/s] and angular velocity [rad/s], both in its own axes, joints [rad/s]).",
            "tau = joint torques [N m].",
        ),
    )


def _write_arrays(
    robot: Robot,
    trajectory: Trajectory,
    path: str | os.PathLike[str],
    parts: Mapping[str, list[Array]],
    order: tuple[str, ...],
) -> Path:
    arrays = {name: np.vstack(rows).T for name, rows in parts.items()}
    rows = "One row for each knot; time in s; joints and jets in the order of joint_names and jet_names."
    texts = {
        "robot": trajectory.robot,
        "scenario": trajectory.scenario,
        "base": robot.kindyn.tree.base,
        "conventions": "\n".join((rows, *order, _RATES)),
        **{name: getattr(trajectory, name) for name in ("joint_names", "jet_names")},
    }
    labels = {name: np.array(text, dtype=np.str_) for name, text in texts.items()}
    with whole(path) as draft, draft.open("wb") as stream:
        np.savez_compressed(stream, allow_pickle=False, time=trajectory.time, **arrays, **labels)
    return Path(path)


def _unit_quaternions(trajectory: Trajectory) -> Array:
    quaternion = trajectory.base_quaternion_xyzw
    return np.asarray(quaternion / np.linalg.norm(quaternion, axis=0))


def _in_base(trajectory: Trajectory, name: str) -> Array:
    """Return a quantity that is in world axes, (3, knots + 1), in the axes of the base."""
    return np.asarray(np.einsum("kij,ik->jk", base_poses(trajectory)[:, :3, :3], getattr(trajectory, name)))


Writer = Callable[[Robot, Trajectory, str | os.PathLike[str]], Path]
EXPORTS: Mapping[str, tuple[str, Writer]] = FrozenMapping(
    {
        "csv": (".csv", write_csv),
        "mat": (".mat", write_mat),
        "mujoco": (".npz", write_mujoco),
        "pinocchio": (".npz", write_pinocchio),
    }
)
"""What a trajectory can be exported to: the file's suffix and what writes it."""

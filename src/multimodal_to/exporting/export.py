"""Trajectories for other programs: tables (CSV), MATLAB files, and the coordinates of MuJoCo and Pinocchio."""

from __future__ import annotations

import csv
import os
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np

from multimodal_to.adam.spatial import Array
from multimodal_to.arguments import checked
from multimodal_to.errors import OutputError
from multimodal_to.exporting.consumers import WholeMotion, whole_motion
from multimodal_to.exporting.layouts import layout_of
from multimodal_to.exporting.recording import write_rerun
from multimodal_to.files.writing import whole as whole_file
from multimodal_to.models.joint_units import described
from multimodal_to.models.robot import Robot
from multimodal_to.trajectory import QUANTITIES, Quantity, Trajectory, labels, row_labels, row_units
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


@checked
def columns(robot: Robot, trajectory: Trajectory) -> dict[str, tuple[str, Array]]:
    """Return every row of every quantity by name, as ``joint_positions.l_knee``, with its unit and values.

    The last ones are the joint torques, which follow from the motion, and mimic joints, which follow others.

    Args:
        robot: the robot of the trajectory, for the torques.
        trajectory: the motion.
    """
    torques, trajectory = joint_torques(robot, trajectory), sampled(trajectory)
    table = {"time": ("s", trajectory.time)}
    for name, quantity in QUANTITIES.items():
        rows = labels(name, trajectory, separator=".")
        without_blanks = [row.replace(" ", "_") for row in rows]
        places = without_blanks if quantity.of == "jet" and len({*without_blanks}) == len(rows) else rows
        units = row_units(quantity, robot, len(rows))
        for place, unit, values in zip(places, units, getattr(trajectory, name), strict=True):
            table[".".join(filter(None, (name, place)))] = (unit, values)
    names = row_labels(trajectory, JOINT_TORQUES.of, JOINT_TORQUES.axes)
    for joint, unit, values in zip(names, row_units(JOINT_TORQUES, robot), torques, strict=True):
        table[f"joint_torques.{joint}"] = (unit, values)
    slides = {body.joint: body.prismatic for body in robot.kindyn.tree.bodies}
    for what, of_all in _followers(robot, trajectory).items():
        for joint, values in zip(robot.kindyn.tree.followers, of_all, strict=True):
            unit = ("m" if slides[joint] else "rad") + "/s" * (what == "follower_velocities")
            table[f"{what}.{joint}"] = (unit, values)
    return table


def _followers(robot: Robot, trajectory: Trajectory) -> dict[str, Array]:
    """Return positions and velocities of the mimic joints that move, (followers, knots + 1); nothing without any.

    Args:
        robot: whose joints follow others.
        trajectory: its motion, sampled at the knots.
    """
    tree = robot.kindyn.tree
    if not tree.followers:
        return {}
    positions, rates = tree.joint_values(trajectory.joint_positions), tree.joint_rates(trajectory.joint_velocities)
    return {
        "follower_positions": np.array([positions[name] for name in tree.followers]),
        "follower_velocities": np.array([rates[name] for name in tree.followers]),
    }


@checked
def write_csv(robot: Robot, trajectory: Trajectory, path: str | os.PathLike[str]) -> Path:
    """Write one row for each knot; lines that start with # say the conventions, the first other one names and units.

    Args:
        robot: the robot of the trajectory, for the torques.
        trajectory: the motion.
        path: of the file, by convention `.csv`.
    """
    table = columns(robot, trajectory)
    with whole_file(path) as draft, draft.open("w", encoding="utf-8", newline="") as stream:
        for line in (f"robot {trajectory.robot}, scenario {trajectory.scenario}", *CONVENTIONS):
            stream.write(f"# {line}\n")
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerow(f"{name} [{unit}]" for name, (unit, _) in table.items())
        writer.writerows(np.column_stack([values for _, values in table.values()]).tolist())
    return Path(path)


@checked
def write_mat(robot: Robot, trajectory: Trajectory, path: str | os.PathLike[str]) -> Path:
    """Write a MATLAB file (version 5): every quantity and the joint torques, (rows, knots + 1), names, units.

    Names are cells; units are a struct, with one text for a quantity or, where joints differ, a cell for each of them.
    Mimic joints, if there are any, are `follower_positions` and `follower_velocities`, in the order of
    `follower_names`.

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
    followers = robot.kindyn.tree.followers
    content = {
        "robot": trajectory.robot,
        "scenario": trajectory.scenario,
        "conventions": "\n".join(CONVENTIONS),
        "units": {
            name: _mat_units(quantity, robot)
            for name, quantity in {**QUANTITIES, "joint_torques": JOINT_TORQUES}.items()
        },
        "time": trajectory.time,
        **{name: np.array(getattr(trajectory, name), dtype=object) for name in _NAMES},
        **{name: getattr(trajectory, name) for name in QUANTITIES},
        "joint_torques": torques,
        **_followers(robot, trajectory),
        **({"follower_names": np.array(tuple(followers), dtype=object)} if followers else {}),
    }
    with whole_file(path) as draft:
        savemat(draft, content, oned_as="row", long_field_names=True)
    return Path(path)


def _mat_units(quantity: Quantity, robot: Robot) -> str | Array:
    """Return the unit of a quantity, or the cells of its rows' units where they are not all the same."""
    units = row_units(quantity, robot)
    return np.array(units, dtype=object) if len(set(units)) > 1 else next(iter(units), quantity.unit)


@checked
def write_mujoco(
    robot: Robot,
    trajectory: Trajectory,
    path: str | os.PathLike[str],
    *,
    model: str | os.PathLike[str] | None = None,
) -> Path:
    """Write an `.npz` with MuJoCo's qpos, qvel and ctrl for a free base, a row for each knot, and `conventions`.

    qpos = (p, quaternion w x y z, s); qvel = (ṗ in world axes, ω in the base's axes, ṡ); ctrl = (joint torques by
    inverse dynamics [N m or N], thrusts [N]). Joints are all that can move, in the order of MuJoCo's own model of the
    URDF with a free joint at its root, which `joint_names` says; jets are in the order of `jet_names`.

    Args:
        robot: the robot of the trajectory.
        trajectory: the motion.
        path: of the file, by convention `.npz`.
        model: the other program's own model, MuJoCo's XML or a URDF: its joints, in its order.

    Raises:
        InputError: the trajectory is for another robot.
        ModelError: the model is not one of the robot.
    """
    whole, trajectory = _whole(robot, trajectory, "mujoco", model), sampled(trajectory)
    parts = {
        "qpos": [trajectory.base_position, _unit_quaternions(trajectory)[[3, 0, 1, 2]], whole.positions],
        "qvel": [trajectory.base_linear_velocity, _in_base(trajectory, "base_angular_velocity"), whole.velocities],
        "ctrl": [whole.torques, trajectory.thrust],
    }
    conventions = (
        "Joints are all that can move, in the order of MuJoCo's model of the URDF with a free joint at its root; those "
        "that the plan holds still are where it holds them.",
        f"qpos = (base position [m], quaternion w x y z, joints [{_joint_units(whole, 'rad')}]).",
        "qvel = (base's linear velocity in world axes [m/s], angular in its own axes [rad/s], joints "
        f"[{_joint_units(whole, 'rad/s')}]).",
        f"ctrl = (joint torques [{_joint_units(whole, 'N m')}], thrusts [N]).",
    )
    return _write_arrays(robot, trajectory, path, parts, conventions, whole)


@checked
def write_pinocchio(
    robot: Robot,
    trajectory: Trajectory,
    path: str | os.PathLike[str],
    *,
    model: str | os.PathLike[str] | None = None,
) -> Path:
    """Write an `.npz` with Pinocchio's q, v and tau for a free flyer, a row for each knot, and `conventions`.

    q = (p, quaternion x y z w, s); v = (ṗ and ω, both in the base's axes, ṡ); tau = joint torques by inverse dynamics
    [N m or N]. They are those of `pinocchio.buildModelFromUrdf(urdf, pinocchio.JointModelFreeFlyer())`: joints are all
    that can move, in Pinocchio's order, which `joint_names` says, and a continuous joint has its cosine and sine in q.

    Args:
        robot: the robot of the trajectory.
        trajectory: the motion.
        path: of the file, by convention `.npz`.
        model: the other program's own model, MuJoCo's XML or a URDF: its joints, in its order.

    Raises:
        InputError: the trajectory is for another robot.
        ModelError: the model is not one of the robot.
    """
    whole, trajectory = _whole(robot, trajectory, "pinocchio", model), sampled(trajectory)
    rows = [
        row
        for joint, values in zip(whole.joints, whole.positions, strict=True)
        for row in ((np.cos(values), np.sin(values)) if joint.kind == "continuous" else (values,))
    ]
    parts = {
        "q": [
            trajectory.base_position,
            _unit_quaternions(trajectory),
            np.array(rows).reshape(len(rows), trajectory.time.size),
        ],
        "v": [
            _in_base(trajectory, "base_linear_velocity"),
            _in_base(trajectory, "base_angular_velocity"),
            whole.velocities,
        ],
        "tau": [whole.torques],
    }
    conventions = (
        "Joints are all that can move, in the order of Pinocchio's model of the URDF with a free flyer; those that the "
        "plan holds still are where it holds them.",
        "q = (base position [m], quaternion x y z w, joints, continuous ones as cosine and sine, "
        f"[{_joint_units(whole, 'rad')}]).",
        "v = (base's linear velocity [m/s] and angular velocity [rad/s], both in its own axes, joints "
        f"[{_joint_units(whole, 'rad/s')}]).",
        f"tau = joint torques [{_joint_units(whole, 'N m')}].",
    )
    return _write_arrays(robot, trajectory, path, parts, conventions, whole)


def _whole(robot: Robot, trajectory: Trajectory, order: str, model: str | os.PathLike[str] | None) -> WholeMotion:
    """Return the motion of all joints of another program's model.

    Args:
        robot: the robot of the trajectory.
        trajectory: the motion.
        order: that of the program.
        model: its own, or None for that of the robot's URDF.
    """
    return whole_motion(robot, trajectory, layout_of(robot, order, model=model).joints)


def _joint_units(whole: WholeMotion, unit: str) -> str:
    """Return the unit of a value of all joints in words.

    Args:
        whole: with the joints.
        unit: of a joint that turns.
    """
    return described({joint.name: joint.kind == "prismatic" for joint in whole.joints}, unit)


def _write_arrays(
    robot: Robot,
    trajectory: Trajectory,
    path: str | os.PathLike[str],
    parts: Mapping[str, list[Array]],
    conventions: tuple[str, ...],
    whole: WholeMotion,
) -> Path:
    """Write arrays with what they are.

    Args:
        robot: the robot of the trajectory.
        trajectory: the motion at the knots.
        path: of the file.
        parts: the rows of each array.
        conventions: what they are, in sentences.
        whole: with the joints in their order.
    """
    arrays = {name: np.vstack(rows).T for name, rows in parts.items()}
    rows = "One row for each knot; time in s; joints and jets in the order of joint_names and jet_names."
    texts = {
        "robot": trajectory.robot,
        "scenario": trajectory.scenario,
        "base": robot.kindyn.tree.base,
        "conventions": "\n".join((rows, *conventions, _RATES)),
        "joint_names": whole.names,
        "jet_names": trajectory.jet_names,
    }
    labels = {name: np.array(text, dtype=np.str_) for name, text in texts.items()}
    with whole_file(path) as draft, draft.open("wb") as stream:
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
        "rerun": (".rrd", write_rerun),
    }
)
"""What a trajectory can be exported to: the file's suffix and what writes it."""

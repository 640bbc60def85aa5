"""Trajectories of others: bare arrays under this library's names, as the paper's data, into a `Trajectory`."""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from multimodal_to.arguments import checked
from multimodal_to.errors import TrajectoryError, shown
from multimodal_to.models.robot import Robot
from multimodal_to.trajectory.archive import numbers, read_archive, refuse_missing
from multimodal_to.trajectory.derived import contact_points
from multimodal_to.trajectory.quantities import QUANTITIES
from multimodal_to.trajectory.trajectory import Trajectory

COMPUTED = ("contact_positions",)
"""What bare arrays need not hold: it follows from the others."""


@checked
def import_arrays(robot: Robot, path: str | os.PathLike[str]) -> Trajectory:
    """Read an `.npz` of bare arrays for a robot.

    The archive holds `total_time` [s] and every array of `QUANTITIES` but those of `COMPUTED`, each (dim, knots + 1),
    in the robot's order of joints, contact points and jets. The contact points come from forward kinematics. Base
    velocities at the first knot, which some files leave without meaning, are kept as they are.

    Raises:
        TrajectoryError: the file is missing, broken or too large, lacks an array, or holds one that fits no trajectory.
    """
    source = Path(path)
    stored = read_archive(source)
    wanted = [name for name in ("total_time", *QUANTITIES) if name not in COMPUTED]
    refuse_missing(stored, wanted, source)
    arrays: dict[str, Any] = {name: numbers(stored, name, source) for name in wanted}
    total_time = arrays.pop("total_time")
    if total_time.size != 1 or not (np.isfinite(total_time).all() and total_time.item() > 0):
        raise TrajectoryError(f"'{source}': 'total_time' is {shown(total_time.tolist())}; expected one positive number")
    if arrays["com_position"].ndim != 2:
        raise TrajectoryError(
            f"'{source}': 'com_position' has shape {arrays['com_position'].shape}; expected (3, knots + 1)"
        )
    count, contacts = arrays["com_position"].shape[1], len(robot.contacts)
    try:
        bare = Trajectory(
            robot=robot.name,
            scenario=source.stem.replace("_", "-"),
            time=np.linspace(0.0, total_time.item(), count),
            joint_names=robot.joint_names,
            contact_names=robot.contact_names,
            jet_names=robot.jet_names,
            contact_positions=np.zeros((3 * contacts, count)),
            **arrays,
        )
    except TrajectoryError as error:
        raise TrajectoryError(f"'{source}': {error}") from error
    points = contact_points(robot, bare)
    return replace(bare, contact_positions=points.transpose(0, 2, 1).reshape(-1, count))

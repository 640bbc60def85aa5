"""A motion as a recording that the viewer of Rerun plays: the robot of the URDF, its CoM, forces and thrusts."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np

from multimodal_to.arguments import checked
from multimodal_to.errors import OutputError
from multimodal_to.exporting.consumers import whole_motion
from multimodal_to.exporting.layouts import layout_of
from multimodal_to.files.writing import whole as whole_file
from multimodal_to.models.robot import Robot
from multimodal_to.trajectory import Trajectory

WORLD = "world"
"""The frame of the recording that the base, the CoM and the forces are in."""
_PER_WEIGHT = 0.5  # length of an arrow as long as the robot's weight is large [m]


@checked
def write_rerun(robot: Robot, trajectory: Trajectory, path: str | os.PathLike[str]) -> Path:
    """Write a recording of Rerun, `.rrd`: links and meshes of the URDF, and at each knot where all is.

    Values are those of each knot's column. Lengths are in metres, forces in newtons, time in seconds.

    Args:
        robot: the robot of the trajectory.
        trajectory: the motion.
        path: of the file.

    Raises:
        InputError: the trajectory is for another robot.
        OutputError: Rerun is not installed, or the file cannot be written.
    """
    try:
        import rerun
        from rerun.urdf import UrdfTree
    except ImportError as error:
        raise OutputError("recordings of Rerun need its package: pip install 'multimodal-to[rerun]'") from error
    joints = whole_motion(robot, trajectory, layout_of(robot, "urdf").joints)
    count, points = trajectory.time.size, len(trajectory.contact_names)
    with whole_file(path) as draft:
        recording = rerun.RecordingStream("multimodal-to")
        recording.save(draft)
        tree = UrdfTree.from_file_path(robot.urdf, robot.name)
        tree.log_urdf_to_recording(recording)
        time = rerun.TimeColumn("time", duration=trajectory.time)
        base = rerun.Transform3D.columns(
            translation=trajectory.base_position.T,
            quaternion=trajectory.base_quaternion_xyzw.T,
            parent_frame=[WORLD] * count,
            child_frame=[tree.root_link().name] * count,
        )
        recording.send_columns("base", [time], base)
        for name, values in zip(joints.names, joints.positions, strict=True):
            joint = tree.get_joint_by_name(name)
            where = rerun.new_entity_path(["joints", name])
            recording.send_columns(where, [time], joint.compute_transform_columns(values, clamp=False))
        for entity in ("com", "contact_forces"):
            recording.log(entity, rerun.CoordinateFrame(WORLD), static=True)
        recording.send_columns("com", [time], rerun.Points3D.columns(positions=trajectory.com_position.T))
        arrows = rerun.Arrows3D.columns(
            origins=trajectory.contact_positions.T.reshape(-1, 3),
            vectors=trajectory.contact_forces.T.reshape(-1, 3) * (_PER_WEIGHT / robot.weight),
        )
        recording.send_columns("contact_forces", [time], arrows.partition(np.full(count, points)))
        for name, thrust in zip(trajectory.jet_names, trajectory.thrust, strict=True):
            where = rerun.new_entity_path(["thrust", name])
            recording.send_columns(where, [time], rerun.Scalars.columns(scalars=thrust))
        recording.flush()
        recording.disconnect()
    return Path(path)

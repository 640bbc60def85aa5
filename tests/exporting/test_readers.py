"""The trackers' own loaders read our files. They run where the trackers are installed: see docs/motion.md."""

from __future__ import annotations

import ast
import os
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import multimodal_to as mt
from g1 import g1
from multimodal_to.exporting.recording import write_rerun
from multimodal_to.trajectory.derived import base_poses, frame_poses
from synthetic import take_off

pytestmark = [pytest.mark.readers, pytest.mark.filterwarnings("default")]


@pytest.fixture(scope="module")
def robot(tmp_path_factory):
    return g1(tmp_path_factory.mktemp("robots") / "g1")


@pytest.fixture(scope="module")
def plan(robot):
    return take_off(robot)


def placed_by_mujoco(model, found, frame, joints, rates):
    """MuJoCo's state of a model with the base and the joints of a file, by name."""
    mujoco = pytest.importorskip("mujoco")
    data, names = mujoco.MjData(model), found["joint_names"].tolist()
    base = found["body_names"].tolist().index("pelvis")
    position, quaternion = found["body_pos_w"][frame, base], found["body_quat_w"][frame, base]
    rotation = np.zeros(9)
    mujoco.mju_quat2Mat(rotation, quaternion)
    data.qpos[:7] = *position, *quaternion
    linear, angular = found["body_lin_vel_w"][frame, base], found["body_ang_vel_w"][frame, base]
    data.qvel[:6] = *linear, *(rotation.reshape(3, 3).T @ angular)
    for name, value, rate in zip(names, joints, rates, strict=True):
        data.qpos[model.joint(name).qposadr[0]], data.qvel[model.joint(name).dofadr[0]] = value, rate
    mujoco.mj_forward(model, data)
    return data


def test_mjlabs_loader_plays_our_motion_on_mjlabs_own_g1(robot, plan, tmp_path):
    commands = pytest.importorskip("mjlab.tasks.tracking.mdp.commands")
    import mujoco
    import torch
    from mjlab.asset_zoo.robots.unitree_g1 import g1_constants
    from mjlab.entity import Entity

    entity = Entity(g1_constants.get_g1_robot_cfg())
    xml = Path(g1_constants.G1_XML)
    path = mt.write_motion(robot, plan, tmp_path / "m.npz", flavour="mjlab", model=xml)
    with np.load(path) as archive:
        found = {name: archive[name] for name in archive}
    assert tuple(found["joint_names"].tolist()) == tuple(entity.joint_names)
    assert tuple(found["body_names"].tolist()) == tuple(entity.body_names)
    wanted = ["pelvis", "left_ankle_roll_link", "torso_link", "right_wrist_yaw_link"]
    indices = torch.tensor(entity.find_bodies(wanted, preserve_order=True)[0])
    loaded = commands.MotionLoader(str(path), indices)
    assert loaded.time_step_total == round(plan.duration * 50) + 1
    model = mujoco.MjModel.from_xml_path(str(xml))
    for frame in (0, 60, 100):
        joints, rates = loaded.joint_pos[frame].double().numpy(), loaded.joint_vel[frame].double().numpy()
        data = placed_by_mujoco(model, found, frame, joints, rates)
        for index, name in enumerate(wanted):
            np.testing.assert_allclose(loaded.body_pos_w[frame, index], data.body(name).xpos, atol=1e-5)
            alike = np.abs(loaded.body_quat_w[frame, index].double().numpy() @ data.body(name).xquat)
            np.testing.assert_allclose(alike, 1.0, atol=1e-6)
            velocity = np.zeros(6)
            mujoco.mj_objectVelocity(model, data, mujoco.mjtObj.mjOBJ_XBODY, data.body(name).id, velocity, 0)
            np.testing.assert_allclose(loaded.body_lin_vel_w[frame, index], velocity[3:], atol=1e-5)
            np.testing.assert_allclose(loaded.body_ang_vel_w[frame, index], velocity[:3], atol=1e-5)


def test_mjlabs_converter_reads_our_csv(robot, plan, tmp_path):
    converter = pytest.importorskip("mjlab.scripts.csv_to_npz")
    path = mt.write_motion(robot, plan, tmp_path / "m.csv", flavour="unitree-csv")
    motion = converter.MotionLoader(str(path), input_fps=30, output_fps=50, device="cpu")
    back = mt.read_motion(robot, path)
    assert motion.input_frames == back.time.size
    np.testing.assert_allclose(motion.motion_base_poss_input, back.base_position.T, atol=1e-6)
    np.testing.assert_allclose(motion.motion_base_rots_input[:, 0], back.base_quaternion_xyzw[3], atol=1e-6)
    assert motion.motion_dof_poss_input.shape[1] == 29


def test_holosomas_loader_reads_our_motion_by_its_own_names(robot, plan, tmp_path):
    terms = pytest.importorskip("holosoma.managers.command.terms.wbt")
    path = mt.write_motion(robot, plan, tmp_path / "m.npz", flavour="holosoma")
    bodies, joints = ["torso_link", "pelvis", "left_ankle_roll_link"], list(robot.joint_names[::-1])
    loaded = terms.MotionLoader(str(path), bodies, joints)
    back = mt.read_motion(robot, path)
    np.testing.assert_allclose(loaded.joint_pos, back.joint_positions[::-1].T, atol=1e-6)
    np.testing.assert_allclose(loaded.joint_vel, back.joint_velocities[::-1].T, atol=1e-6)
    np.testing.assert_allclose(loaded.body_pos_w[:, 1], back.base_position.T, atol=1e-6)
    np.testing.assert_allclose(loaded.body_lin_vel_w[:, 1], back.base_linear_velocity.T, atol=1e-6)
    alike = (loaded.body_quat_w[:, 1].double().numpy() * back.base_quaternion_xyzw.T).sum(axis=1)
    np.testing.assert_allclose(np.abs(alike), 1.0, atol=1e-6)


def test_we_read_holosomas_own_motions_of_the_g1(robot):
    holosoma = pytest.importorskip("holosoma")
    folder = Path(holosoma.__file__).parent / "data" / "motions" / "g1_29dof" / "whole_body_tracking"
    files = sorted(folder.glob("*.npz"))
    assert files
    for file in files:
        motion = mt.read_motion(robot, file)
        assert motion.time.size > 300
        assert mt.audit(robot, motion, kinematic=True)["momentum consistency"].holds


def test_locomujocos_loader_reads_our_motion(robot, plan, tmp_path):
    dataclasses = pytest.importorskip("loco_mujoco.trajectory.dataclasses")
    path = mt.write_motion(robot, plan, tmp_path / "m.npz", flavour="locomujoco")
    loaded = dataclasses.Trajectory.load(str(path), backend=np)
    assert loaded.info.joint_names[1:] == list(robot.joint_names)
    assert loaded.info.frequency == 100
    assert loaded.data.is_complete
    assert loaded.info.model.njnt == 30
    np.testing.assert_allclose(loaded.data.qpos[:, :3], mt.read_motion(robot, path).base_position.T)


def test_rerun_verifies_our_recording_and_its_joints_put_a_foot_where_we_do(robot, plan, tmp_path):
    pytest.importorskip("rerun")
    from rerun.urdf import UrdfTree

    path = write_rerun(robot, plan, tmp_path / "m.rrd")
    verified = subprocess.run([sys.executable, "-m", "rerun", "rrd", "verify", str(path)], capture_output=True)
    assert verified.returncode == 0, verified.stderr
    tree, foot, knot = UrdfTree.from_file_path(robot.urdf), "left_ankle_roll_link", plan.knots // 2
    values = dict(zip(plan.joint_names, plan.joint_positions[:, knot], strict=True))
    above = {joint.child_link: joint for joint in tree.joints()}
    placed, link = np.eye(4), foot
    while link in above:
        joint = above[link]
        moved = joint.compute_transform(values.get(joint.name, 0.0), clamp=False)
        step = np.eye(4)
        step[:3, 3] = moved.translation.as_arrow_array().to_pylist()[0]
        step[:3, :3] = Rotation.from_quat(moved.quaternion.as_arrow_array().to_pylist()[0]).as_matrix()
        placed, link = step @ placed, joint.parent_link
    assert link == tree.root_link().name
    ours = np.linalg.inv(base_poses(plan)[knot]) @ frame_poses(robot, plan, foot)[knot]
    np.testing.assert_allclose(placed, ours, atol=1e-6)


def test_beyondmimics_own_loader_reads_our_motion(robot, plan, tmp_path):
    torch = pytest.importorskip("torch")
    clone = os.environ.get("WHOLE_BODY_TRACKING", "")
    if not clone:
        pytest.skip("WHOLE_BODY_TRACKING names no clone of whole_body_tracking")
    (source,) = Path(clone).rglob("tasks/tracking/mdp/commands.py")
    parts = ast.parse(source.read_text(encoding="utf-8")).body  # the rest of the file needs Isaac Sim
    own = [part for part in parts if isinstance(part, ast.ClassDef) and part.name == "MotionLoader"]
    space = {"np": np, "torch": torch, "os": os, "Sequence": Sequence}
    exec(compile(ast.Module(own, []), str(source), "exec"), space)
    path = mt.write_motion(robot, plan, tmp_path / "m.npz", flavour="beyondmimic")
    with np.load(path) as archive:
        bodies = archive["body_names"].tolist()
    wanted = ["pelvis", "left_ankle_roll_link", "torso_link", "right_wrist_yaw_link"]
    loaded = space["MotionLoader"](str(path), [bodies.index(name) for name in wanted])
    back = mt.read_motion(robot, path)
    assert loaded.time_step_total == back.time.size
    for index, name in enumerate(wanted):
        poses = frame_poses(robot, back, name)
        np.testing.assert_allclose(loaded.body_pos_w[:, index], poses[:, :3, 3], atol=1e-6)
        w, x, y, z = loaded.body_quat_w[:, index].double().numpy().T
        np.testing.assert_allclose(
            Rotation.from_quat(np.column_stack([x, y, z, w])).as_matrix(), poses[:, :3, :3], atol=1e-5
        )

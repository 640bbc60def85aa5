from __future__ import annotations

from dataclasses import replace

import mujoco
import numpy as np
import pinocchio as pin
import pytest

from hopper import hopper
from multimodal_to.errors import InputError, ModelError
from multimodal_to.exporting.layouts import layout_of
from multimodal_to.exporting.motion import FLAVOURS, write_motion
from multimodal_to.trajectory import rules
from multimodal_to.trajectory.derived import sampled
from synthetic import take_off

WXYZ, XYZW = [3, 0, 1, 2], [1, 2, 3, 0]


def consistent(robot):
    """A motion whose velocities are the differences of its positions, as a rule leaves them."""
    plan = take_off(robot)
    step = np.diff(plan.time)
    arrays = {}
    pairs = (("base_position", "base_linear_velocity"), ("joint_positions", "joint_velocities"))
    for name, rate in pairs:
        values = getattr(plan, name)
        arrays[rate] = np.hstack([np.zeros_like(values[:, :1]), np.diff(values, axis=1) / step])
    arrays["base_angular_velocity"] = np.zeros_like(plan.base_angular_velocity)
    yaw = 2.0 * np.arctan2(plan.base_quaternion_xyzw[2], plan.base_quaternion_xyzw[3])
    arrays["base_angular_velocity"][2, 1:] = np.diff(yaw) / step
    return replace(plan, rule=rules.LEAPFROG, **arrays)


@pytest.fixture(scope="module")
def plan(ironcub):
    return consistent(ironcub)


def read(path):
    with np.load(path, allow_pickle=False) as archive:
        return {name: archive[name] for name in archive}


@pytest.fixture(scope="module")
def model(ironcub):
    spec = mujoco.MjSpec.from_file(str(ironcub.urdf))
    spec.worldbody.first_body().add_freejoint()
    return spec.compile()


def mujoco_bodies(model, found, frame):
    """Poses and velocities of all bodies of MuJoCo's own model, by name, from joints and base by name."""
    data = mujoco.MjData(model)
    names, bodies = found["joint_names"].tolist(), found["body_names"].tolist()
    base = bodies.index(str(found["base"]))
    data.qpos[:3], data.qpos[3:7] = found["body_pos_w"][frame, base], found["body_quat_w"][frame, base]
    for column, name in enumerate(names):
        data.qpos[model.joint(name).qposadr[0]] = found["joint_pos"][frame, column - len(names)]
        data.qvel[model.joint(name).dofadr[0]] = found["joint_vel"][frame, column - len(names)]
    return data


@pytest.mark.parametrize("flavour", ["mjlab", "holosoma", "beyondmimic"])
def test_mujoco_and_pinocchio_have_every_body_where_the_file_says(ironcub, plan, model, tmp_path, flavour):
    found = read(write_motion(ironcub, plan, tmp_path / "m.npz", flavour=flavour))
    names, bodies = found["joint_names"].tolist(), found["body_names"].tolist()
    peer = pin.buildModelFromUrdf(str(ironcub.urdf), pin.JointModelFreeFlyer())
    own = peer.createData()
    base = bodies.index("root_link")
    assert found["fps"].tolist() == [50]
    frames = found["joint_pos"].shape[0]
    assert frames == round(plan.duration * 50) + 1
    for frame in (0, 37, 63, frames - 1):
        data = mujoco.MjData(model)
        quaternion = found["body_quat_w"][frame, base]
        rotation = pin.Quaternion(quaternion[XYZW]).matrix()
        linear, angular = found["body_lin_vel_w"][frame, base], found["body_ang_vel_w"][frame, base]
        if flavour == "beyondmimic":
            com = model.body("root_link").ipos
            linear = linear - np.cross(angular, rotation @ com)
        joints = found["joint_pos"][frame, -len(names) :]
        rates = found["joint_vel"][frame, -len(names) :]
        data.qpos[:7] = *found["body_pos_w"][frame, base], *quaternion
        data.qvel[:6] = *linear, *(rotation.T @ angular)
        q, v = pin.neutral(peer), np.zeros(peer.nv)
        q[:7] = *found["body_pos_w"][frame, base], *quaternion[XYZW]
        v[:6] = *(rotation.T @ linear), *(rotation.T @ angular)
        for name, position, rate in zip(names, joints, rates, strict=True):
            data.qpos[model.joint(name).qposadr[0]], data.qvel[model.joint(name).dofadr[0]] = position, rate
            index = peer.getJointId(name)
            q[peer.joints[index].idx_q], v[peer.joints[index].idx_v] = position, rate
        if flavour == "holosoma":
            np.testing.assert_allclose(found["joint_pos"][frame], data.qpos, atol=1e-12)
            np.testing.assert_allclose(found["joint_vel"][frame], data.qvel, atol=1e-12)
        mujoco.mj_forward(model, data)
        pin.forwardKinematics(peer, own, q, v)
        pin.updateFramePlacements(peer, own)
        for index, name in enumerate(bodies):
            at, velocity = data.body(name), np.zeros(6)
            np.testing.assert_allclose(found["body_pos_w"][frame, index], at.xpos, atol=1e-6)
            np.testing.assert_allclose(np.abs(found["body_quat_w"][frame, index] @ at.xquat), 1.0, atol=1e-12)
            point = mujoco.mjtObj.mjOBJ_BODY if flavour == "beyondmimic" else mujoco.mjtObj.mjOBJ_XBODY
            mujoco.mj_objectVelocity(model, data, point, at.id, velocity, 0)
            np.testing.assert_allclose(found["body_ang_vel_w"][frame, index], velocity[:3], atol=1e-6)
            np.testing.assert_allclose(found["body_lin_vel_w"][frame, index], velocity[3:], atol=1e-6)
            if name == "world":
                continue
            placed = own.oMf[peer.getFrameId(name)]
            np.testing.assert_allclose(found["body_pos_w"][frame, index], placed.translation, atol=1e-6)
            twist = pin.getFrameVelocity(peer, own, peer.getFrameId(name), pin.LOCAL_WORLD_ALIGNED)
            np.testing.assert_allclose(found["body_ang_vel_w"][frame, index], twist.angular, atol=1e-6)
            if flavour != "beyondmimic":
                np.testing.assert_allclose(found["body_lin_vel_w"][frame, index], twist.linear, atol=1e-6)


def test_bodies_and_joints_are_in_mujocos_own_order(ironcub, plan, model, tmp_path):
    found = read(write_motion(ironcub, plan, tmp_path / "m.npz", flavour="mjlab"))
    assert found["joint_names"].tolist() == [model.joint(index).name for index in range(1, model.njnt)]
    assert found["body_names"].tolist() == [model.body(index).name for index in range(1, model.nbody)]
    assert found["body_pos_w"].shape[1:] == (model.nbody - 1, 3)
    assert found["joint_pos"].shape[1] == found["joint_vel"].shape[1] == model.nv - 6

from __future__ import annotations

from dataclasses import replace

import mujoco
import numpy as np
import pinocchio as pin
import pytest

from hopper import hopper
from multimodal_to.cli.tasks import given
from multimodal_to.errors import InputError, ModelError, TrajectoryError
from multimodal_to.exporting.export import write_mujoco, write_pinocchio
from multimodal_to.exporting.layouts import layout_of
from multimodal_to.exporting.motion import FLAVOURS, write_motion
from multimodal_to.exporting.reading import read_motion
from multimodal_to.trajectory import rules
from multimodal_to.trajectory.derived import frame_poses
from multimodal_to.trajectory.resampling import resample
from multimodal_to.trajectory.smoothing import product, rotation_vectors, smooth
from synthetic import take_off

WXYZ, XYZW = [3, 0, 1, 2], [1, 2, 3, 0]


def consistent(robot):
    """A motion whose velocities are the differences of its positions, as a rule leaves them."""
    plan = take_off(robot)
    each = np.linspace(0.2, 1.2, len(robot.joint_names))[:, None]  # so that no joint is as another
    plan = replace(plan, joint_positions=each * plan.joint_positions)
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


def test_locomujoco_holds_mujocos_own_arrays_and_no_key_that_its_reader_does_not_know(ironcub, plan, model, tmp_path):
    found = read(write_motion(ironcub, plan, tmp_path / "l.npz", flavour="locomujoco", fps=50))
    info = {"joint_names", "model", "frequency", "body_names", "site_names", "metadata"}
    known = {"njnt", "jnt_type", "nbody", "body_rootid", "body_weldid", "body_mocapid", "body_pos", "body_quat"}
    known |= {"body_ipos", "body_iquat", "nsite", "site_bodyid", "site_pos", "site_quat"}
    data = {"qpos", "qvel", "xpos", "xquat", "cvel", "subtree_com", "site_xpos", "site_xmat", "split_points"}
    assert set(found) <= info | known | data
    assert set(found) >= known | data
    assert found["joint_names"].tolist()[1:] == [model.joint(index).name for index in range(1, model.njnt)]
    assert found["body_names"].tolist() == [model.body(index).name for index in range(model.nbody)]
    for name in ("jnt_type", "body_rootid", "body_weldid", "body_mocapid"):
        np.testing.assert_array_equal(found[name], getattr(model, name))
    np.testing.assert_allclose(found["body_ipos"], model.body_ipos, atol=1e-9)
    np.testing.assert_allclose(found["body_pos"][2:], model.body_pos[2:], atol=1e-9)
    np.testing.assert_allclose(np.abs((found["body_quat"] * model.body_quat).sum(axis=1))[2:], 1.0, atol=1e-9)
    state = mujoco.MjData(model)
    for frame in (0, 41, 80):
        state.qpos[:], state.qvel[:] = found["qpos"][frame], found["qvel"][frame]
        mujoco.mj_forward(model, state)
        np.testing.assert_allclose(found["xpos"][frame], state.xpos, atol=1e-9)
        np.testing.assert_allclose(found["subtree_com"][frame], state.subtree_com, atol=1e-6)
        np.testing.assert_allclose(found["cvel"][frame, 1:, :3], state.cvel[1:, :3], atol=1e-9)
        np.testing.assert_allclose(found["cvel"][frame, 1:], state.cvel[1:], atol=1e-6)


def test_a_fall_comes_out_exactly_between_the_knots_of_leapfrog(ironcub):
    """Lines between the knots are g Δt² / 8 off; the cubic is a parabola, and its velocity is g t."""
    plan, fall, turn = take_off(ironcub), -9.81, 0.7
    middle = plan.time - 0.05
    still = {name: np.zeros_like(getattr(plan, name)) for name in RATES}
    position, velocity = np.zeros((3, plan.time.size)), np.zeros((3, plan.time.size))
    position[2], velocity[2] = 1.0 + fall * plan.time**2 / 2.0, fall * middle
    quaternion = np.zeros((4, plan.time.size))
    quaternion[0], quaternion[3] = np.sin(turn * plan.time / 2.0), np.cos(turn * plan.time / 2.0)
    omega = np.zeros((3, plan.time.size))
    omega[0] = turn
    falling = replace(
        plan,
        rule=rules.LEAPFROG,
        **still
        | {
            "base_position": position,
            "base_linear_velocity": velocity,
            "base_quaternion_xyzw": quaternion,
            "base_angular_velocity": omega,
        },
    )
    times = np.linspace(0.0, 1.9, 77)  # no interval follows the last knot, and its velocity is that of the last one
    found = smooth(falling, times)
    np.testing.assert_allclose(found.base_position[2], 1.0 + fall * times**2 / 2.0, atol=1e-12)
    np.testing.assert_allclose(found.base_linear_velocity[2], fall * times, atol=1e-12)
    np.testing.assert_allclose(found.base_quaternion_xyzw[0], np.sin(turn * times / 2.0), atol=1e-12)
    np.testing.assert_allclose(found.base_angular_velocity[0], turn, atol=1e-12)
    lines = resample(falling, times).base_position[2]
    assert np.abs(lines - found.base_position[2]).max() > 0.9 * 9.81 * 0.1**2 / 8.0


RATES = ("joint_velocities", "com_velocity", "thrust_rate")


@pytest.mark.parametrize("rule", [rules.LEAPFROG, rules.BACKWARD_EULER])
def test_velocities_are_the_rates_of_positions_and_the_knots_are_kept(ironcub, rule):
    rng = np.random.default_rng(1)
    plan = replace(consistent(ironcub), rule=rule)
    wild = rng.normal(size=plan.base_angular_velocity.shape)
    plan = replace(plan, base_angular_velocity=wild, base_quaternion_xyzw=rng.normal(size=(4, plan.time.size)))
    step, times = 1e-6, np.linspace(0.01, 1.99, 200)
    before, at, after = (smooth(plan, times + shift) for shift in (-step, 0.0, step))
    for name, rate in (("base_position", "base_linear_velocity"), ("joint_positions", "joint_velocities")):
        slope = (getattr(after, name) - getattr(before, name)) / (2.0 * step)
        np.testing.assert_allclose(getattr(at, rate), slope, atol=1e-6)
        np.testing.assert_allclose(getattr(smooth(plan, plan.time), name), getattr(plan, name), atol=1e-12)
    conjugate = before.base_quaternion_xyzw * [[-1], [-1], [-1], [1]]
    turned = rotation_vectors(product(after.base_quaternion_xyzw, conjugate)) / (2.0 * step)
    np.testing.assert_allclose(at.base_angular_velocity, turned, atol=1e-4)
    knots = plan.base_quaternion_xyzw / np.linalg.norm(plan.base_quaternion_xyzw, axis=0)
    again = smooth(plan, plan.time).base_quaternion_xyzw
    np.testing.assert_allclose(np.abs((again * knots).sum(axis=0)), 1.0, atol=1e-12)


@pytest.mark.parametrize("flavour", list(FLAVOURS))
def test_a_motion_comes_back_as_it_went(ironcub, plan, tmp_path, flavour):
    path = tmp_path / f"m{FLAVOURS[flavour].suffix}"
    back = read_motion(ironcub, write_motion(ironcub, plan, path, flavour=flavour, fps=50))
    went = smooth(plan, back.time)
    assert back.rule == rules.SAMPLED
    for name in ("base_position", "joint_positions"):
        np.testing.assert_allclose(getattr(back, name), getattr(went, name), atol=1e-6)
    np.testing.assert_allclose(np.abs((back.base_quaternion_xyzw * went.base_quaternion_xyzw).sum(axis=0)), 1.0)
    if flavour == "unitree-csv":  # it has no velocities: they are differences of the neighbours
        np.testing.assert_allclose(back.joint_velocities, went.joint_velocities, atol=0.1)
        return
    for name in ("base_linear_velocity", "base_angular_velocity", "joint_velocities"):
        np.testing.assert_allclose(getattr(back, name), getattr(went, name), atol=1e-6)
    for name in ("contact_forces", "thrust", "throttle"):
        np.testing.assert_allclose(getattr(back, name), getattr(went, name), atol=1e-9)


def rewritten(path, change):
    """Write an archive anew after a change of its arrays."""
    arrays = read(path)
    change(arrays)
    np.savez(path, **arrays)
    return path


def without_names(arrays):
    for name in ("joint_names", "body_names", "flavour"):
        del arrays[name]


def test_a_motion_of_another_program_is_a_start_guess_of_a_task_with_jets_and_of_one_without(ironcub, plan, tmp_path):
    file = write_motion(ironcub, plan, tmp_path / "m.npz", flavour="mjlab")
    for settings, jets in (([], plan.jet_names), (["jets=false", "terminal=standing"], ())):
        task = given("take-off", settings, "ironcub", paper=False, warm_start=file, resume=None, quiet=True)
        assert task.start.jet_names == jets
        np.testing.assert_allclose(task.start.joint_positions[:, 0], plan.joint_positions[:, 0], atol=1e-9)


@pytest.mark.parametrize("flavour", ["mjlab", "beyondmimic", "holosoma"])
def test_a_shuffled_order_of_bodies_or_joints_is_refused(ironcub, plan, tmp_path, flavour):
    def bodies(arrays):
        swapped = np.arange(arrays["body_pos_w"].shape[1])
        swapped[[3, 9]] = swapped[[9, 3]]
        for name in ("body_pos_w", "body_quat_w"):
            arrays[name] = arrays[name][:, swapped]

    def joints(arrays):
        arrays["joint_names"] = arrays["joint_names"][::-1]

    for change in (bodies, joints):
        path = write_motion(ironcub, plan, tmp_path / "m.npz", flavour=flavour)
        with pytest.raises(TrajectoryError, match="in another order"):
            read_motion(ironcub, rewritten(path, change))


@pytest.mark.parametrize("flavour", ["mjlab", "beyondmimic"])
def test_a_file_without_names_goes_by_the_order_in_which_its_bodies_fit(ironcub, plan, tmp_path, flavour):
    path = write_motion(ironcub, plan, tmp_path / "m.npz", flavour=flavour)
    back = read_motion(ironcub, rewritten(path, without_names))
    np.testing.assert_allclose(back.joint_positions, smooth(plan, back.time).joint_positions, atol=1e-9)
    np.testing.assert_allclose(back.base_linear_velocity, smooth(plan, back.time).base_linear_velocity, atol=1e-9)
    other = "isaac" if flavour == "mjlab" else "mujoco"
    with pytest.raises(TrajectoryError, match="in another order"):
        read_motion(ironcub, path, flavour=flavour, joint_order=other)


def readers_model(ironcub, path, change=lambda spec: None):
    """MuJoCo's own model of the URDF as an XML file, with a free joint, after a change."""
    spec = mujoco.MjSpec.from_file(str(ironcub.urdf))
    spec.worldbody.first_body().add_freejoint(name="floating_base")
    spec.compile()
    change(spec)
    path.write_text(spec.to_xml(), encoding="utf-8")
    return path


def test_a_readers_model_says_the_order_and_what_does_not_fit_is_named(ironcub, plan, tmp_path):
    def exported(change=lambda spec: None, **more):
        file = readers_model(ironcub, tmp_path / "robot.xml", change)
        return read(write_motion(ironcub, plan, tmp_path / "m.npz", flavour="locomujoco", model=file, **more))

    assert exported()["joint_names"][0] == "floating_base"
    with pytest.raises(ModelError, match="has joints that ironcub does not have: l_patella"):
        exported(lambda spec: setattr(spec.joint("l_knee"), "name", "l_patella"))
    with pytest.raises(ModelError, match="lacks joints that ironcub moves: l_elbow"):
        exported(lambda spec: spec.delete(spec.joint("l_elbow")))
    with pytest.raises(ModelError, match=r"has bodies that ironcub does not have: hand"):
        exported(lambda spec: setattr(spec.body("l_elbow_1"), "name", "hand"))
    with pytest.raises(ModelError, match=r"is another robot than ironcub: its body '\w+' is off by"):
        exported(lambda spec: setattr(spec.body("torso_2"), "pos", [0.0, 0.05, 0.3]))


def test_names_of_a_file_go_before_the_order_and_strangers_are_named(ironcub, plan, tmp_path):
    names = tmp_path / "names.toml"
    names.write_text(f"joint_names = {sorted(ironcub.joint_names)}", encoding="utf-8")
    found = read(write_motion(ironcub, plan, tmp_path / "m.npz", flavour="mjlab", joint_order=names))
    assert found["joint_names"].tolist() == sorted(ironcub.joint_names)
    assert found["body_names"].tolist() == list(layout_of(ironcub, "mujoco").bodies)
    names.write_text("body_names = ['root_link', 'wing']", encoding="utf-8")
    with pytest.raises(ModelError, match="has bodies that ironcub does not have: wing"):
        write_motion(ironcub, plan, tmp_path / "m.npz", flavour="mjlab", joint_order=names)
    with pytest.raises(InputError, match="unknown order of joints 'abc'"):
        write_motion(ironcub, plan, tmp_path / "m.npz", flavour="mjlab", joint_order="abc")


def test_a_model_says_the_order_of_joints_of_the_exports_to_mujoco_and_pinocchio(ironcub, plan, tmp_path):
    """A URDF whose joints are written in another order: Pinocchio sorts by name, MuJoCo goes by the file."""
    text = ironcub.urdf.read_text(encoding="utf-8")
    left, right = text.index('<joint name="l_hip_pitch"'), text.index('<joint name="r_hip_pitch"')
    ends = [text.index("</joint>", at) + len("</joint>") for at in (left, right)]
    one, two = text[left : ends[0]], text[right : ends[1]]
    swapped = text[:left] + two + text[ends[0] : right] + one + text[ends[1] :]
    file = tmp_path / "other.urdf"
    file.write_text(swapped, encoding="utf-8")
    spec = mujoco.MjSpec.from_file(str(file))
    spec.worldbody.first_body().add_freejoint()
    model = spec.compile()
    own = [model.joint(index).name for index in range(1, model.njnt)]
    assert own != list(layout_of(ironcub, "mujoco").joints)
    found = read(write_mujoco(ironcub, plan, tmp_path / "q.npz", model=file))
    assert found["joint_names"].tolist() == own
    state = mujoco.MjData(model)
    state.qpos[:] = found["qpos"][-1]
    mujoco.mj_forward(model, state)
    for foot, link in (("l_sole_1", "l_ankle_2"), ("r_sole_1", "r_ankle_2")):
        assert foot in ironcub.contact_names
        np.testing.assert_allclose(state.body(link).xpos, frame_poses(ironcub, plan, link)[-1, :3, 3], atol=1e-9)
    peer = pin.buildModelFromUrdf(str(file), pin.JointModelFreeFlyer())
    q = read(write_pinocchio(ironcub, plan, tmp_path / "q.npz", model=file))
    assert q["joint_names"].tolist() == list(peer.names)[2:]
    xml = readers_model(ironcub, tmp_path / "robot.xml")
    assert read(write_mujoco(ironcub, plan, tmp_path / "q.npz", model=xml))["joint_names"].tolist() == list(
        layout_of(ironcub, "mujoco").joints
    )


def test_isaac_has_bodies_breadth_first_and_those_behind_fixed_joints_belong_to_others(ironcub):
    found = layout_of(ironcub, "isaac")
    assert found.joints[:6] == (
        "l_hip_pitch",
        "r_hip_pitch",
        "torso_pitch",
        "l_hip_roll",
        "r_hip_roll",
        "torso_roll",
    )
    assert found.bodies[0] == "root_link"
    assert len(found.bodies) == 1 + len(ironcub.joint_names)


def test_a_hopper_with_a_mast_that_its_plan_holds_still_exports_the_mast_too(tmp_path):
    robot = hopper(tmp_path / "h", mast=True, kinds=("continuous", "revolute"))
    found = read(write_motion(robot, take_off(robot), tmp_path / "m.npz", flavour="mjlab"))
    assert "mast" in found["joint_names"].tolist()
    assert found["thrust"].shape[1] == len(robot.jets)

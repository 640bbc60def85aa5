from __future__ import annotations

import csv
from dataclasses import fields, replace

import numpy as np
import pinocchio as pin
import pytest

from hopper import hopper
from multimodal_to.adam import KinDynComputations
from multimodal_to.errors import InputError
from multimodal_to.exporting import export
from multimodal_to.models.robot import JointLimits
from multimodal_to.trajectory import QUANTITIES
from multimodal_to.trajectory.derived import frame_poses, generalised_forces, joint_torques, sampled
from synthetic import KNOTS, take_off
from tied_hopper import FOLLOWERS, tied_hopper


@pytest.fixture(scope="module")
def trajectory(ironcub):
    """A motion with velocities of its own, so that no axis is at zero."""
    rng = np.random.default_rng(4)
    plain = take_off(ironcub)
    names = ("base_linear_velocity", "base_angular_velocity", "joint_velocities")
    return replace(plain, **{name: rng.normal(size=getattr(plain, name).shape) for name in names})


def test_a_table_holds_every_row_under_its_name_with_its_unit(ironcub, trajectory, tmp_path):
    path = export.write_csv(ironcub, trajectory, tmp_path / "t.csv")
    lines = path.read_text(encoding="utf-8").splitlines()
    assert lines[0] == "# robot ironcub, scenario take-off & hover"
    assert any("world-from-base, x y z w" in line for line in lines if line.startswith("#"))
    rows = list(csv.reader(line for line in lines if not line.startswith("#")))
    assert len(rows) == KNOTS + 2
    assert len(rows[0]) == 1 + sum(len(getattr(trajectory, name)) for name in QUANTITIES) + len(ironcub.joint_names)
    values = dict(zip(rows[0], np.array(rows[1:], dtype=float).T, strict=True))
    knee = trajectory.joint_names.index("l_knee")
    np.testing.assert_array_equal(values["joint_positions.l_knee [rad]"], trajectory.joint_positions[knee])
    np.testing.assert_array_equal(values["contact_forces.r_sole_1.z [N]"], trajectory.contact_forces[14])
    np.testing.assert_array_equal(values["thrust.left_arm [N]"], trajectory.thrust[0])
    np.testing.assert_array_equal(values["joint_torques.l_knee [N m]"], joint_torques(ironcub, trajectory)[knee])


def test_a_matlab_file_holds_arrays_names_and_units(ironcub, trajectory, tmp_path):
    scipy_io = pytest.importorskip("scipy.io")
    content = scipy_io.loadmat(export.write_mat(ironcub, trajectory, tmp_path / "t.mat"), simplify_cells=True)
    for name in QUANTITIES:
        np.testing.assert_array_equal(content[name], getattr(trajectory, name))
    assert tuple(content["joint_names"]) == trajectory.joint_names
    np.testing.assert_array_equal(content["joint_torques"], joint_torques(ironcub, trajectory))
    assert content["units"]["thrust"] == "N"
    assert content["units"]["joint_torques"] == "N m"
    assert "backward Euler" in content["conventions"]


def read(path):
    with np.load(path, allow_pickle=False) as archive:
        return {name: archive[name] for name in archive}


def agrees_with_pinocchio(robot, trajectory, path):
    """Frames, velocities and torques of what is exported, put straight into Pinocchio's own model of the URDF."""
    found = read(export.write_pinocchio(robot, trajectory, path))
    model = pin.buildModelFromUrdf(str(robot.urdf), pin.JointModelFreeFlyer())
    model.gravity.linear = robot.gravity
    data = model.createData()
    assert (found["q"].shape[1], found["v"].shape[1]) == (model.nq, model.nv)
    assert tuple(found["joint_names"]) == tuple(model.names)[2:]
    base, feet = robot.kindyn.tree.base, robot.contact_names
    for knot in (0, 7, KNOTS):
        pin.forwardKinematics(model, data, found["q"][knot], found["v"][knot])
        pin.updateFramePlacements(model, data)
        for name in (*feet, *(jet.frame for jet in robot.jets)):
            placed = data.oMf[model.getFrameId(name)].homogeneous
            np.testing.assert_allclose(placed, frame_poses(robot, trajectory, name)[knot], atol=1e-9)
        twist = pin.getFrameVelocity(model, data, model.getFrameId(base), pin.LOCAL_WORLD_ALIGNED)
        np.testing.assert_allclose(twist.linear, trajectory.base_linear_velocity[:, knot], atol=1e-12)
        np.testing.assert_allclose(twist.angular, trajectory.base_angular_velocity[:, knot], atol=1e-12)
        acceleration = np.zeros(model.nv)
        still = pin.rnea(model, data, found["q"][knot], np.zeros(model.nv), acceleration)
        pushes = np.zeros(model.nv)
        for name, force in zip(feet, trajectory.per_contact("contact_forces")[:, :, knot], strict=True):
            jacobian = pin.computeFrameJacobian(
                model, data, found["q"][knot], model.getFrameId(name), pin.LOCAL_WORLD_ALIGNED
            )
            pushes += jacobian[:3].T @ force
        yield found, knot, still - pushes


def test_pinocchio_puts_the_robot_where_we_do_and_moves_it_as_we_do(ironcub, trajectory, tmp_path):
    for found, _, _ in agrees_with_pinocchio(ironcub, trajectory, tmp_path / "p.npz"):
        names = [str(name) for name in found["joint_names"]]
        assert "own axes" in str(found["conventions"])
        order = [ironcub.joint_names.index(name) for name in names]
        np.testing.assert_array_equal(found["tau"].T, generalised_forces(ironcub, trajectory)[6:][order])


def test_pinocchio_gets_cosines_of_continuous_joints_and_those_that_are_locked(tmp_path):
    """A wing that turns without end, a mast that slides and is locked at 0.15 m: Pinocchio's model moves all three."""
    robot = hopper(tmp_path / "mast", mast=True, kinds=("continuous", "revolute"))
    text = (tmp_path / "mast" / "hopper.urdf").read_text(encoding="utf-8")
    kindyn = KinDynComputations(text, ["right_pitch", "left_pitch"], locked_joints={"mast": 0.15})
    keep = [2, 0]
    limits = JointLimits(**{f.name: getattr(robot.joint_limits, f.name)[keep] for f in fields(JointLimits)})
    home = replace(robot.home, joint_positions=robot.home.joint_positions[keep])
    robot = replace(robot, kindyn=kindyn, joint_limits=limits, home=home, joint_groups={})
    plan = take_off(robot)
    still = replace(plan, **{name: 0.0 * getattr(plan, name) for name in STILL}, thrust=0.0 * plan.thrust)
    for found, knot, torques in agrees_with_pinocchio(robot, still, tmp_path / "p.npz"):
        assert tuple(found["joint_names"]) == ("left_pitch", "mast", "right_pitch")
        angle = still.joint_positions[1, knot]
        np.testing.assert_allclose(found["q"][knot, 7:10], [np.cos(angle), np.sin(angle), 0.15])
        if 0 < knot < KNOTS:
            np.testing.assert_allclose(found["tau"][knot], torques[6:], atol=1e-8)


STILL = ("base_linear_velocity", "base_angular_velocity", "joint_velocities", "com_velocity", "angular_momentum")


def wild(seed):
    """A URDF of links, joints and names in no order, with fixed joints between."""
    rng = np.random.default_rng(seed)
    inertial = (
        '<inertial><origin xyz="0 0 0.1"/><mass value="1"/>'
        '<inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial>'
    )
    parts = [f'<link name="l{index}">{inertial}</link>' for index in range(9)]
    for index in range(1, 9):
        kind = rng.choice(["fixed", "revolute", "continuous", "prismatic"])
        name = f"{rng.choice(list('abzAZ_9é'))}{index}"
        parts.append(
            f'<joint name="{name}" type="{kind}"><parent link="l{rng.integers(index)}"/><child link="l{index}"/>'
            '<axis xyz="0 0.6 0.8"/><limit lower="-1" upper="1" effort="1" velocity="1"/></joint>'
        )
    return f'<robot name="wild">{"".join(rng.permutation(parts))}</robot>'


@pytest.mark.parametrize("seed", range(8))
def test_the_order_of_joints_is_that_of_the_programs_own_models(tmp_path, seed):
    mujoco = pytest.importorskip("mujoco")
    file = tmp_path / "wild.urdf"
    file.write_text(wild(seed), encoding="utf-8")
    robot = hopper(tmp_path / "any")
    jets = tuple(replace(jet, frame="l0") for jet in robot.jets)
    contacts = tuple(replace(contact, frame=f"l{index}") for index, contact in enumerate(robot.contacts))
    robot = replace(robot, urdf=file, kindyn=KinDynComputations(file), jets=jets, contacts=contacts)
    plan = take_off(robot)
    spec = mujoco.MjSpec.from_string(wild(seed))
    spec.worldbody.first_body().add_freejoint()
    model = spec.compile()
    own = [model.joint(index).name for index in range(1, model.njnt)]
    assert read(export.write_mujoco(robot, plan, tmp_path / "m.npz"))["joint_names"].tolist() == own
    peer = pin.buildModelFromXML(wild(seed), pin.JointModelFreeFlyer())
    found = read(export.write_pinocchio(robot, plan, tmp_path / "p.npz"))
    assert found["joint_names"].tolist() == list(peer.names)[2:]
    assert (found["q"].shape[1], found["v"].shape[1]) == (peer.nq, peer.nv)


def test_a_motion_of_another_robot_is_not_exported(ironcub, trajectory, tmp_path):
    for write in (export.write_pinocchio, export.write_mujoco):
        with pytest.raises(InputError, match="for another robot"):
            write(hopper(tmp_path / "hopper"), trajectory, tmp_path / "p.npz")


def test_mujoco_has_the_scalar_first_and_only_the_angular_velocity_in_the_base(ironcub, trajectory, tmp_path):
    with np.load(export.write_mujoco(ironcub, trajectory, tmp_path / "m.npz"), allow_pickle=False) as archive:
        qpos, qvel, ctrl = (archive[name] for name in ("qpos", "qvel", "ctrl"))
    assert qpos.shape == (KNOTS + 1, 30)
    assert qvel.shape == (KNOTS + 1, 29)
    assert ctrl.shape == (KNOTS + 1, 27)
    np.testing.assert_allclose(qpos[:, 3], trajectory.base_quaternion_xyzw[3], atol=1e-12)
    np.testing.assert_allclose(qpos[:, 4:7], trajectory.base_quaternion_xyzw[:3].T, atol=1e-12)
    np.testing.assert_array_equal(qvel[:, :3], trajectory.base_linear_velocity.T)
    for knot in (0, KNOTS):
        rotation = frame_poses(ironcub, trajectory, "root_link")[knot, :3, :3]
        np.testing.assert_allclose(rotation @ qvel[knot, 3:6], trajectory.base_angular_velocity[:, knot], atol=1e-12)
    np.testing.assert_array_equal(ctrl[:, 23:], trajectory.thrust.T)


def test_mimic_joints_are_where_their_leader_has_them_in_every_export(tmp_path):
    """Pinocchio's model moves them one by one: it gets them all, and what would move each of them."""
    robot = tied_hopper(tmp_path)
    plan = take_off(robot)
    assert robot.joint_names == ("left_pitch",)
    angle, rate = sampled(plan).joint_positions[0], sampled(plan).joint_velocities[0]
    expected = {"left_pitch": (angle, rate)}
    expected |= {name: (m * angle + o, m * rate) for name, (m, o) in FOLLOWERS.items()}
    still = replace(plan, **{name: 0.0 * getattr(plan, name) for name in STILL}, thrust=0.0 * plan.thrust)
    for found, knot, torques in agrees_with_pinocchio(robot, still, tmp_path / "p.npz"):
        names = found["joint_names"].tolist()
        assert names == ["left_pitch", "mast", "right_pitch"]
        np.testing.assert_allclose(found["q"][:, 7:].T, [expected[name][0] for name in names], atol=1e-15)
        if 0 < knot < KNOTS:
            np.testing.assert_allclose(found["tau"][knot], torques[6:], atol=1e-8)
    velocities = read(export.write_pinocchio(robot, plan, tmp_path / "p.npz"))["v"][:, 6:].T
    np.testing.assert_allclose(velocities, [expected[name][1] for name in names], atol=1e-15)
    qpos = read(export.write_mujoco(robot, plan, tmp_path / "m.npz"))
    for name, values in zip(qpos["joint_names"].tolist(), qpos["qpos"][:, 7:].T, strict=True):
        np.testing.assert_allclose(values, expected[name][0], atol=1e-15)

    table = export.columns(robot, plan)
    mat = pytest.importorskip("scipy.io").loadmat(
        export.write_mat(robot, plan, tmp_path / "m.mat"), simplify_cells=True
    )
    for index, (name, unit) in enumerate((("right_pitch", "rad"), ("mast", "m"))):
        assert table[f"follower_positions.{name}"][0] == unit
        assert table[f"follower_velocities.{name}"][0] == f"{unit}/s"
        np.testing.assert_allclose(table[f"follower_positions.{name}"][1], expected[name][0], atol=1e-15)
        assert mat["follower_names"][index] == name
        np.testing.assert_allclose(mat["follower_velocities"][index], expected[name][1], atol=1e-15)


def test_jets_of_alike_names_have_a_column_each(tmp_path):
    robot = hopper(tmp_path)
    left, right = robot.jets
    for names in (("left arm", "left_arm"), ("a b_c", "a_b c"), ("left", "right")):
        named = replace(robot, jets=(replace(left, name=names[0]), replace(right, name=names[1])))
        table = export.columns(named, take_off(named))
        assert sum(name.startswith("thrust.") for name in table) == 2

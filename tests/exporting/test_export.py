from __future__ import annotations

import csv

import numpy as np
import pinocchio as pin
import pytest

from adam_robots import IRONCUB
from multimodal_to.exporting import export
from multimodal_to.trajectory import QUANTITIES
from multimodal_to.trajectory.derived import frame_poses, generalised_forces, joint_torques
from synthetic import KNOTS, take_off


@pytest.fixture(scope="module")
def trajectory(ironcub):
    """A motion with velocities of its own, so that no axis is at zero."""
    from dataclasses import replace

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


def test_pinocchio_puts_the_robot_where_we_do_and_moves_it_as_we_do(ironcub, trajectory, tmp_path):
    with np.load(export.write_pinocchio(ironcub, trajectory, tmp_path / "p.npz"), allow_pickle=False) as archive:
        q, v, names = archive["q"], archive["v"], [str(name) for name in archive["joint_names"]]
        assert "own axes" in str(archive["conventions"])
        np.testing.assert_array_equal(archive["tau"].T, generalised_forces(ironcub, trajectory)[6:])
    model = pin.buildModelFromUrdf(str(IRONCUB / "ironcub.urdf"), pin.JointModelFreeFlyer())
    data = model.createData()
    order = [names.index(name) for name in list(model.names)[2:]]
    poses = frame_poses(ironcub, trajectory, "l_sole")
    for knot in (0, 7, KNOTS):
        here = np.concatenate([q[knot, :7], q[knot, 7:][order]])
        moving = np.concatenate([v[knot, :6], v[knot, 6:][order]])
        pin.forwardKinematics(model, data, here, moving)
        pin.updateFramePlacements(model, data)
        np.testing.assert_allclose(data.oMf[model.getFrameId("l_sole")].homogeneous, poses[knot], atol=1e-9)
        twist = pin.getFrameVelocity(model, data, model.getFrameId("root_link"), pin.LOCAL_WORLD_ALIGNED)
        np.testing.assert_allclose(twist.linear, trajectory.base_linear_velocity[:, knot], atol=1e-12)
        np.testing.assert_allclose(twist.angular, trajectory.base_angular_velocity[:, knot], atol=1e-12)


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

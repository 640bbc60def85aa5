"""What slides is in m, m/s and N, wherever a unit is shown; what turns is in rad, rad/s and N m."""

from __future__ import annotations

import csv
from dataclasses import replace

import numpy as np
import pytest
from typer.testing import CliRunner

import multimodal_to as mt
from hopper import hop, hopper
from multimodal_to.cli import app
from multimodal_to.doctor.formulation import formulation
from multimodal_to.doctor.task import Task
from multimodal_to.exporting import export
from multimodal_to.plotting import plot_joints, plot_torques
from multimodal_to.reporting.report import _facts
from multimodal_to.trajectory.derived import joint_torques, largest_torques
from synthetic import take_off

MAST = 1  # where it stands among the joints


@pytest.fixture(scope="module")
def robot(tmp_path_factory):
    return hopper(tmp_path_factory.mktemp("mast"), mast=True, kinds=("continuous", "revolute"))


@pytest.fixture(scope="module")
def plan(robot):
    return take_off(robot)


def test_a_table_and_a_matlab_file_say_the_unit_of_each_joint(robot, plan, tmp_path):
    lines = export.write_csv(robot, plan, tmp_path / "t.csv").read_text(encoding="utf-8").splitlines()
    heads = next(csv.reader(line for line in lines if not line.startswith("#")))
    for name, turning, sliding in (
        ("joint_positions", "rad", "m"),
        ("joint_velocities", "rad/s", "m/s"),
        ("joint_torques", "N m", "N"),
    ):
        expected = [f"{name}.left_pitch [{turning}]", f"{name}.mast [{sliding}]", f"{name}.right_pitch [{turning}]"]
        assert [head for head in heads if head.startswith(name)] == expected
    scipy_io = pytest.importorskip("scipy.io")
    units = scipy_io.loadmat(export.write_mat(robot, plan, tmp_path / "t.mat"), simplify_cells=True)["units"]
    assert list(units["joint_velocities"]) == ["rad/s", "m/s", "rad/s"]
    assert list(units["joint_torques"]) == ["N m", "N", "N m"]
    assert units["base_angular_velocity"] == "rad/s"


@pytest.mark.parametrize("write", [export.write_mujoco, export.write_pinocchio])
def test_conventions_of_an_export_say_which_joints_slide(robot, plan, tmp_path, write):
    with np.load(write(robot, plan, tmp_path / "t.npz")) as archive:
        said = str(archive["conventions"])
    for expected in ("[rad, of mast m]", "[rad/s, of mast m/s]", "[N m, of mast N]"):
        assert expected in said


def test_findings_of_the_audit_are_in_the_unit_of_their_joint(robot, plan):
    for joint, units in ((MAST, ("m", "m/s", "N", "m")), (0, ("rad", "rad/s", "N m", "rad"))):
        positions, velocities = plan.joint_positions * 0.0, plan.joint_velocities * 0.0
        positions[joint, 5], velocities[joint, 7:9] = 9.0, (50.0, -50.0)
        report = mt.audit(robot, replace(plan, joint_positions=positions, joint_velocities=velocities))
        names = ("joint range", "joint speed", "torque beyond effort", "gap of joint_positions")
        assert tuple(report[name].unit for name in names) == units
        assert {report[name].body for name in names} == {robot.joint_names[joint]}


def test_rows_bounds_and_the_worst_of_them_are_in_the_unit_of_their_joint(robot):
    problem = mt.build(robot, hop(robot, knots=4), mt.Formulation.paper())
    rows = problem.rows["joint_integration"]
    assert set(zip(rows.components, rows.units, strict=True)) == {
        ("left_pitch", "rad"),
        ("mast", "m"),
        ("right_pitch", "rad"),
    }
    for joint, unit in ((MAST, "m"), (2, "rad")):
        x = problem.guess.copy()
        x[problem.layout.rows["joint_positions"].start + joint + 2 * problem.layout.size] += 5.0
        assert problem.unit_at("bounds of joint_positions", x) == unit
        assert problem.unit_at("joint_integration", x) == unit
    assert problem.unit_at("bounds of interval", x) == "s"
    assert problem.unit_at("com_integration", x) == "m"


def far(knot, parameters):
    """The mast's position."""
    return knot.joint_positions[MAST]


FAR = mt.Constraint(value=far, within=mt.at_least(0.5), unit="m", holds=mt.Where.LATER_KNOTS)
"""It cannot be met: the mast reaches 0.2 m."""


def test_progress_and_violations_are_in_the_unit_of_their_worst_row(robot):
    limits = replace(robot.joint_limits, upper=robot.joint_limits.upper + np.array([0.0, 1.0, 0.0]))
    formulation = mt.Formulation.paper().with_terms(FAR)
    problem = mt.build(replace(robot, joint_limits=limits), hop(robot, knots=4), formulation)
    told = []
    solution = mt.solve(problem, mt.Ipopt(max_iterations=3), progress=told.append)
    assert told
    assert not any("," in unit for unit in (*(some.unit for some in told), *solution.units.values()))
    assert {violation.unit for violation in solution.unmet if violation.component == "mast"} <= {"m", "m/s"}


def test_the_doctor_says_a_bound_in_the_unit_of_its_joint(robot):
    task = Task.of(robot, hop(robot, knots=4), mt.Formulation.paper().with_terms(FAR))
    said = [str(some) for some in formulation(task)]
    assert any("joint_positions (mast) has to be at least 0.5 and at most 0.2 m at knot" in line for line in said), said


def test_figures_say_the_unit_of_each_panel(robot, plan):
    figure = plot_joints(robot, plan)
    upper, lower = figure.subfigs
    assert upper.get_supylabel() == "position [rad or m]"
    assert [axes.get_title() for axes in upper.axes[:3]] == ["left_pitch (rad)", "mast (m)", "right_pitch (rad)"]
    assert lower.get_supylabel() == "speed [rad/s or m/s]"
    assert [axes.get_title() for axes in lower.axes] == ["wings (±3 rad/s)", "masts (±0.2 m/s)"]
    torques = plot_torques(robot, plan)
    assert torques.get_supylabel() == "torque or force [N m or N]"
    mixed = replace(robot, joint_groups={"all": robot.joint_names})
    titles = [axes.get_title() for axes in plot_joints(mixed, plan).subfigs[1].axes]
    assert titles == ["all (±3 rad/s)", "all, sliding (±0.2 m/s)"]


def test_figures_of_a_robot_that_only_turns_say_its_one_unit_once(tmp_path):
    robot = hopper(tmp_path)
    figure = plot_joints(robot, take_off(robot))
    assert figure.subfigs[0].get_supylabel() == "position [rad]"
    assert [axes.get_title() for axes in figure.subfigs[0].axes[:2]] == ["left_pitch", "right_pitch"]


def test_torques_reports_and_a_playback_say_what_slides(robot, plan, tmp_path):
    by_joint = {one.joint: one.unit for one in largest_torques(robot, plan)}
    assert by_joint == {"left_pitch": "N m", "mast": "N", "right_pitch": "N m"}
    weak = replace(robot.joint_limits, effort=np.array([1e6, 1e-3, 1e6]))
    weakened = replace(robot, joint_limits=weak)
    said = _facts(weakened, plan, mt.audit(weakened, plan))["largest joint torque"]
    largest = np.abs(joint_torques(robot, plan)[MAST, 1:]).max()
    assert said.startswith(f"{largest:.1f} N of mast")
    file, folder = plan.save(tmp_path / "plan.npz"), str(robot.urdf.parent)
    shown = CliRunner().invoke(app, ["show", str(file), "--torques", "--robot", folder])
    assert any(line.startswith("mast") and " N " in line and "50 N" in line for line in shown.stdout.splitlines())


def test_a_playback_measures_sliding_joints_in_metres(robot, plan):
    simulation = pytest.importorskip("multimodal_to.simulation")
    pytest.importorskip("mujoco")
    played = simulation.play(robot, plan)
    outcome = simulation.tracking(played)
    errors = np.abs(played.qpos[:, 7:] - played.reference.joints)[played.time <= plan.duration].max(axis=0)
    assert (outcome.slide, outcome.slide_name) == (errors[MAST], "mast")
    assert outcome.joint == pytest.approx(np.degrees(np.delete(errors, MAST).max()))
    assert outcome.joint_name.endswith("pitch")

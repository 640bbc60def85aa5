"""A file that names its robot, and one for an own robot that writes anew what a bundled scenario says of another."""

from __future__ import annotations

import json
from dataclasses import replace

import pytest

import multimodal_to as mt
from commands import run
from hopper import hop
from hopper import hopper as make_hopper
from multimodal_to.errors import ScenarioError
from synthetic import take_off as synthetic_take_off

JUMP = """
based_on = "jump"
replace = ["weights.joint_velocities"]
robot = "machines/hopper"
initial_com = "home"
final_com = "home"
mid_height_min = 0.41
weights.joint_velocities.wings = 2.0
"""


@pytest.fixture
def folder(tmp_path):
    make_hopper(tmp_path / "machines" / "hopper")
    (tmp_path / "jump.toml").write_text(JUMP, encoding="utf-8")
    return tmp_path


def test_a_table_that_is_replaced_keeps_nothing_of_the_bundled_scenario(folder):
    task, jump = mt.scenario_files.load(folder / "jump.toml"), mt.scenarios.jump()
    assert task.weights == replace(jump.weights, joint_velocities={"wings": 2.0})
    robot = mt.load_robot(task.robot)
    assert not [one for one in mt.doctor(robot, task).findings if one.name == "weights"]
    (folder / "jump.toml").write_text(JUMP.replace("replace =", "# replace ="), encoding="utf-8")
    merged = mt.scenario_files.load(folder / "jump.toml")
    assert set(merged.weights.joint_velocities) == {"upper_body", "legs", "wings"}
    (found,) = [one for one in mt.doctor(robot, merged).findings if "upper_body" in one.found]
    assert 'replace = ["weights.joint_velocities"]' in found.change


@pytest.mark.parametrize(
    ("line", "sentence"),
    [
        ('replace = ["weights.thrust"]', "unknown key of 'replace' 'weights.thrust'; did you mean 'weights'?"),
        ('replace = "weights"', "'replace' is 'weights'; expected a list of keys"),
        ("replace = [3]", "'replace' is [3]; expected a list of keys"),
    ],
)
def test_what_cannot_be_replaced_is_refused(folder, line, sentence):
    text = JUMP.replace('replace = ["weights.joint_velocities"]', line)
    (folder / "jump.toml").write_text(text, encoding="utf-8")
    with pytest.raises(ScenarioError) as error:
        mt.scenario_files.load(folder / "jump.toml")
    assert sentence in str(error.value)


def test_a_replacement_needs_something_to_replace(tmp_path):
    (tmp_path / "task.toml").write_text('replace = ["weights"]\n', encoding="utf-8")
    with pytest.raises(ScenarioError, match="expected 'based_on' beside it"):
        mt.scenario_files.load(tmp_path / "task.toml")


def test_every_table_that_can_be_replaced_is_as_if_nothing_had_been_said(tmp_path):
    path = tmp_path / "task.toml"
    path.write_text('based_on = "jump"\nreplace = ["weights", "margins", "surface", "allowances"]\n', encoding="utf-8")
    task = mt.scenario_files.load(path)
    assert (task.weights, task.margins, task.surface) == (mt.Weights(), mt.Margins(), mt.FlatGround())


def test_a_robot_is_a_bundled_name_or_a_folder_beside_the_file(folder, monkeypatch, tmp_path_factory):
    monkeypatch.chdir(tmp_path_factory.mktemp("elsewhere"))
    task = mt.scenario_files.load(folder / "jump.toml")
    assert mt.load_robot(task.robot).name == "hopper"
    (folder / "jump.toml").write_text(JUMP.replace("machines/hopper", "ironcub"), encoding="utf-8")
    assert mt.scenario_files.load(folder / "jump.toml").robot == "ironcub"


def test_a_command_takes_the_robot_of_the_task_and_an_option_wins(folder):
    (folder / "jump.toml").write_text(JUMP, encoding="utf-8")
    own = run("doctor", folder / "jump.toml", "--json")
    assert json.loads(own.stdout)["robot"] == "hopper"
    assert own.stderr == ""
    other = run("doctor", folder / "jump.toml", "--robot", "ironcub", "--json")
    assert json.loads(other.stdout)["robot"] == "ironcub"


def test_a_file_without_a_robot_says_which_one_it_is_planned_for(tmp_path):
    path = mt.scenario_files.save(mt.scenarios.take_off(), tmp_path / "task.toml")
    result = run("doctor", path)
    assert f"note: '{path}' names no robot: it is planned for the ironcub" in result.stderr
    assert run("doctor", "take-off").stderr == ""


def test_a_solve_takes_the_robot_of_its_task(folder):
    task = replace(hop(mt.load_robot(folder / "machines" / "hopper")), robot="machines/hopper")
    mt.scenario_files.save(task, folder / "hop.toml")
    result = run("solve", folder / "hop.toml", "-o", folder / "out", "--no-pictures")
    assert result.returncode == 0, result.stderr
    assert mt.Trajectory.load(folder / "out" / "trajectory.npz").robot.endswith("hopper")
    again = run("solve", "--resume", folder / "out" / "trajectory.npz", folder / "hop.toml", "--no-pictures")
    assert again.returncode == 0, again.stderr


def test_a_motion_starts_in_the_measured_state_of_a_file(folder):
    robot = mt.load_robot(folder / "machines" / "hopper")
    first = mt.solve(mt.build(robot, hop(robot))).trajectory
    first.save(folder / "first.npz")
    again = replace(
        hop(robot, final_com=(0.1, 0.0, 0.6)),
        start=None,
        initial_com=None,
        robot="machines/hopper",
        initial_state="first.npz",
        initial_knot=24,
        knots=20,
    )
    assert again.start is mt.Start.GIVEN
    mt.scenario_files.save(again, folder / "again.toml")
    result = run("solve", folder / "again.toml", "-o", folder / "out", "--no-pictures")
    assert result.returncode == 0, result.stdout + result.stderr
    motion = mt.Trajectory.load(folder / "out" / "trajectory.npz")
    measured, planned = mt.state_at(first, first.time[24]), mt.state_at(motion, 0.0)
    for name in ("base_position", "joint_positions", "base_linear_velocity", "thrust", "thrust_rate"):
        assert getattr(planned, name) == pytest.approx(getattr(measured, name), abs=1e-6), name
    resumed = run("solve", "--resume", folder / "out" / "trajectory.npz", folder / "again.toml", "--no-pictures")
    assert resumed.returncode == 0, resumed.stdout + resumed.stderr


@pytest.mark.parametrize(
    ("changes", "sentence"),
    [
        ({"initial_knot": 99}, "initial_knot is 99; 'first.npz' has the knots 0 to 20"),
        ({"initial_state": "second.npz"}, "second.npz"),
    ],
)
def test_a_state_that_is_not_there_is_refused_by_the_doctor_too(ironcub, tmp_path, monkeypatch, changes, sentence):
    monkeypatch.chdir(tmp_path)
    synthetic_take_off(ironcub).save("first.npz")
    task = replace(mt.scenarios.take_off(), start=None, **{"initial_state": "first.npz", **changes})
    with pytest.raises(mt.MultimodalError) as error:
        mt.build(ironcub, task)
    assert sentence in str(error.value)
    assert sentence in mt.doctor(ironcub, task).findings[0].found


def test_a_state_and_another_start_contradict_each_other():
    with pytest.raises(ScenarioError, match="initial_state says how it starts, and start is 'hover'"):
        replace(mt.scenarios.landing(), initial_state="first.npz")
    with pytest.raises(ScenarioError, match="initial_knot is of no file"):
        replace(mt.scenarios.landing(), initial_knot=3)


def test_a_task_that_is_feasible_is_called_so_and_is_solved_from_the_motion_that_shows_it(folder):
    mt.scenario_files.save(
        replace(hop(mt.load_robot(folder / "machines" / "hopper")), robot="machines/hopper"), folder / "hop.toml"
    )
    out = folder / "out"
    options = ("--no-pictures", "-o", out)
    result = run("solve", folder / "hop.toml", "--explain", "--max-iterations", 60, *options)
    assert result.returncode == 1
    assert "explain: nothing has to give way, all rows can be met together" in result.stdout
    again = run("solve", folder / "hop.toml", "--warm-start", out / "explained.npz", *options)
    assert again.returncode == 0, again.stdout

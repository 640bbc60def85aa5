"""Starter tasks: physics of a jump, the same task for robots of one shape, refusals, and their names."""

from __future__ import annotations

import math
import re
from dataclasses import replace

import numpy as np
import pytest

import multimodal_to as mt
from commands import run
from drones import drone
from multimodal_to.errors import ScenarioError
from multimodal_to.ocp.schedule import Schedule
from odd_robots import JOINTS, odd_robot

HEIGHT = 0.05  # of the jump [m]
RUNNING = {
    "com_velocity": "m/s",
    "com_acceleration": "m/s²",
    "angular_momentum": "kg m²/s",
    "angular_momentum_rate": "N m",
    "joint_accelerations": "1/s²",
    "posture": "1",
    "base_orientation": "1",
    "contact_forces": "N",
    "contact_force_rates": "N/s",
    "throttle_rate": "1/s",
    "skimming": "1",
}
"""Running weights and the units of what they weigh."""


@pytest.fixture(scope="module")
def solo():
    return mt.load_robot("solo12")


@pytest.fixture(scope="module")
def jumped(solo):
    problem = mt.build(solo, mt.tasks.jump(solo, height=HEIGHT))
    return problem, mt.solve(problem)


def test_a_jump_is_in_the_air_as_long_as_a_thrown_stone(solo, jumped):
    problem, solution = jumped
    assert solution.status.solved
    report = mt.audit(problem.robot, solution.trajectory, problem.scenario)
    assert report.holds
    g = float(np.linalg.norm(solo.gravity))
    step = problem.scenario.interval_max
    assert report.airborne == pytest.approx(2.0 * math.sqrt(2.0 * HEIGHT / g), abs=1.01 * step)


def test_a_jump_rises_as_high_as_asked_on_a_parabola(solo, jumped):
    problem, solution = jumped
    heights = solution.trajectory.com_position[2]
    assert heights.max() >= solo.home_com[2] + HEIGHT - 1e-6
    flies = np.flatnonzero(Schedule.of(problem.robot, problem.scenario).in_air)
    g, step = float(np.linalg.norm(solo.gravity)), problem.scenario.interval_max
    falls = np.diff(heights, 2)[flies - 1] / step**2
    np.testing.assert_allclose(falls, -g, rtol=1e-3)
    lowest = solution.trajectory.per_contact("contact_positions")[:, 2].min(axis=0)
    assert lowest[len(heights) // 2] >= 0.5 * HEIGHT - 1e-6  # feet, and not the body alone


def in_own_units(scenario, units):
    """The numbers of a scenario in a robot's own units."""
    time, length, weights = units.of("s"), units.of("m"), scenario.weights
    numbers = {"interval": scenario.interval_max / time}
    numbers["height"] = (scenario.mid_height_min or length) / length
    numbers |= {name: getattr(weights, name) * units.of(unit) ** 2 * time for name, unit in RUNNING.items()}
    return numbers


@pytest.mark.parametrize("task", ["jump", "walk", "squat", "trot"])
def test_robots_of_one_shape_get_one_task_in_their_own_units(task, solo):
    """On the moon a robot is another one of the same shape: its time and its forces are others."""
    moon = solo.with_gravity(np.array([0.0, 0.0, -1.62]))
    here, there = (mt.tasks.TASKS[task](robot) for robot in (solo, moon))
    assert here.interval_max != there.interval_max
    assert (here.knots, here.contacts, here.gait) == (there.knots, there.contacts, there.gait)
    assert in_own_units(here, solo.units) == pytest.approx(in_own_units(there, moon.units))


def scaled(folder, size):
    """A robot of three feet, one on a joint, with every length times `size` and every mass times its cube."""
    folder.mkdir()
    odd_robot(folder, joints={"hip": "revolute"}, feet=True, jets=False)
    urdf, toml = folder / "robot.urdf", folder / "robot.toml"
    powers = {"xyz": 1, "size": 1, "value": 3, "ixx": 5, "iyy": 5, "izz": 5}

    def grown(found):
        if found[1] == "xyz" and found.string[: found.start()].endswith("<axis "):
            return found[0]
        numbers = " ".join(str(float(number) * size ** powers[found[1]]) for number in found[3].split())
        return f"{found[1]}={found[2]}{numbers}{found[2]}"

    text = re.sub(r"\b(xyz|size|value|ixx|iyy|izz)=(['\"])([^'\"]+)\2", grown, urdf.read_text())
    urdf.write_text(
        text.replace('<parent link="body"/><child link="back"/>', '<parent link="hip link"/><child link="back"/>')
    )
    toml.write_text(toml.read_text().replace("0.0, 0.0, 0.4]", f"0.0, 0.0, {0.4 * size}]"))
    return mt.load_robot(folder)


def test_a_robot_of_three_times_the_size_gets_the_same_task_in_its_own_units(tmp_path):
    small, large = (scaled(tmp_path / str(size), size) for size in (1.0, 3.0))
    assert large.mass == pytest.approx(27.0 * small.mass)
    assert large.standing_height == pytest.approx(3.0 * small.standing_height)
    here, there = (mt.tasks.jump(robot, height=0.1 * robot.standing_height) for robot in (small, large))
    assert here.knots == there.knots
    assert in_own_units(here, small.units) == pytest.approx(in_own_units(there, large.units))


def test_each_joint_is_weighed_once(solo):
    weights = mt.tasks.squat(solo).weights
    weighed = [joint for group in weights.joint_velocities for joint in solo.joint_groups[group]]
    assert sorted(weighed) == sorted(solo.joint_names)


def refusal(task, robot, **said):
    with pytest.raises(ScenarioError) as refused:
        task(robot, **said)
    return str(refused.value)


def test_what_a_robot_cannot_do_is_refused_with_the_reason(tmp_path, solo):
    floating = odd_robot(tmp_path, joints=JOINTS, feet=False, jets=False)
    assert "has no contact points" in refusal(mt.tasks.jump, floating)
    assert "has no contact points" in refusal(mt.tasks.land, floating)
    assert "has no jets" in refusal(mt.tasks.hover, solo)
    assert "has 2 feet; expected four for a trot" in refusal(mt.tasks.trot, mt.load_robot("talos"))
    assert "has no joints" in refusal(mt.tasks.squat, mt.load_robot("quadrotor"))
    (tmp_path / "stiff").mkdir()
    stiff = odd_robot(tmp_path / "stiff", joints=JOINTS, feet=True, jets=False)
    assert "no joint moves a foot" in refusal(mt.tasks.squat, stiff)
    assert "height is -0.1; expected a positive number [m]" in refusal(mt.tasks.jump, solo, height=-0.1)
    assert "without gravity" in refusal(mt.tasks.jump, solo.with_gravity(np.zeros(3)))


def test_jets_that_are_too_weak_and_feet_on_a_line_are_refused(tmp_path, solo):
    heavy = drone(tmp_path, mass=100.0)
    assert "at full throttle; expected more than its weight" in refusal(mt.tasks.take_off, heavy)
    on_a_line = replace(solo, contacts=solo.contacts[:2])
    assert "on a line, about which it falls" in refusal(mt.tasks.squat, on_a_line)


def test_a_name_of_both_is_the_bundled_scenario_for_the_iron_cub_and_the_starter_task_for_others(solo):
    cub = mt.load_robot("ironcub")
    assert mt.tasks.find("jump", cub) == mt.scenarios.jump()
    assert mt.tasks.find("jump", solo) == mt.tasks.jump(solo)
    assert mt.tasks.find("squat", cub) == mt.tasks.squat(cub)
    assert mt.tasks.find("landing", solo) == mt.scenarios.landing()
    assert mt.tasks.walk(cub, distance=0.4).final_com_shift == (-0.4, 0.0, 0.0)  # it looks towards −x
    assert mt.tasks.step(cub, aside=0.1).final_com_shift == (0.0, -0.1, 0.0)
    assert mt.tasks.walk(solo, distance=0.4).final_com_shift == (0.4, 0.0, 0.0)


def test_numbers_of_a_task_and_of_its_scenario_are_set_alike(solo):
    asked = mt.tasks.find("jump", solo, ["height=0.05", "weights.posture=3"])
    expected = mt.tasks.jump(solo, height=0.05)
    assert asked == replace(expected, weights=replace(expected.weights, posture=3.0))
    with pytest.raises(ScenarioError, match="unknown key 'hight'; did you mean 'height'"):
        mt.tasks.find("jump", solo, ["hight=0.05"])


def test_the_command_line_takes_starter_tasks():
    assert "mid_height_min" in run("show", "jump", "--robot", "solo12", "--set", "height=0.05").stdout
    refused = run("doctor", "hover", "--robot", "solo12")
    assert refused.returncode == 2
    assert "solo12 has no jets; expected some for 'hover'" in refused.stdout.replace("\n", " ")


def test_a_bundled_scenario_is_in_the_units_of_the_robot_that_it_is_not_written_for_and_ahead_of_it():
    cub, mk3 = mt.load_robot("ironcub"), mt.load_robot("ironcub-mk3")
    assert mt.tasks.find("walk-to-fly", cub) == mt.scenarios.walk_to_fly()
    assert mt.tasks.find("jump", mk3) == mt.tasks.jump(mk3)
    own, written = mt.tasks.find("step-up", mk3), mt.scenarios.step_up()
    taller = mk3.standing_height / cub.standing_height
    assert own.initial_com[2] == pytest.approx(taller * written.initial_com[2], rel=1e-4)
    assert own.final_com[0] == pytest.approx(-taller * written.final_com[0], rel=1e-4)  # it looks the other way
    assert own.surface.direction == (1.0, 0.0)
    assert own.surface.heights == pytest.approx([taller * height for height in written.surface.heights], rel=1e-4)
    (wall,) = own.walls  # its heels would slip off the edge
    assert wall.normal == (1.0, 0.0, 0.0)
    assert wall.offset > own.surface.edges[0] + 0.5 * own.surface.width
    assert own.interval_max == pytest.approx(taller**0.5 * written.interval_max, rel=1e-4)
    heavier = mk3.weight / cub.weight
    assert own.weights.contact_forces * heavier**2 * taller**0.5 == pytest.approx(
        written.weights.contact_forces, rel=1e-3
    )

"""Robots that no number was tuned for, from the URDF to a true motion; each was once unsolved, or solved and untrue.

What else was wrong with robots that the library had never seen is tested where it belongs: tables that can be replaced
and left out (`scenarios/test_scenario_robot.py`, `cli/test_odd_robots.py`), headings, turned root links and signs of
quaternions (`ocp/test_heading.py`), a CoM as at home (`scenarios/test_keyframe_data.py`), limits of an audit that grow
and shrink with the robot (`auditing/test_margins.py`), and what a URDF lacks (`robots/test_init.py`).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import multimodal_to as mt
from commands import run
from hopper import heading
from multimodal_to.models.attitude import product, tilt
from multimodal_to.ocp.schedule import Schedule
from multimodal_to.trajectory.derived import base_poses, footsteps, joint_torques
from one_leg import one_leg
from places import example_robots

pytestmark = pytest.mark.robots
ANYMAL = "anymal_b_simple_description/robots/anymal.urdf"
ANYMALS_JETS = ("LF_HIP", "RF_HIP", "LH_HIP", "RH_HIP")


def solved(robot, scenario):
    """The problem and the motion of a task, which is solved, and true by the audit."""
    problem = mt.build(robot, scenario)
    solution = mt.solve(problem)
    assert solution.status.solved, (scenario.title, solution.status)
    report = mt.audit(problem.robot, solution.trajectory, problem.scenario)
    assert report.holds, [str(finding) for finding in report.findings if not finding.holds]
    return problem, solution.trajectory, report


@pytest.fixture(scope="module")
def solo():
    return mt.load_robot("solo12")


def greatest_tilt(robot, motion):
    """How far the base leans from home at most [rad]."""
    home = robot.home.base_transform[:3, :3]
    return max(tilt(pose[:3, :3], home, robot.up) for pose in base_poses(motion))


def test_solo_jumps_level_symmetric_in_the_air_and_within_its_motors(solo):
    """It reared on two legs, with its body at 25° and 240 % of its torque."""
    _, motion, report = solved(solo, mt.tasks.jump(solo))
    assert report.airborne > 0.15
    assert greatest_tilt(solo, motion) < np.radians(3.0)
    assert np.abs(joint_torques(solo, motion) / solo.joint_limits.effort[:, None]).max() <= 0.91
    joints = dict(zip(motion.joint_names, motion.joint_positions, strict=True))
    for leg in ("F", "H"):
        for joint in ("HFE", "KFE"):
            np.testing.assert_allclose(joints[f"{leg}L_{joint}"], joints[f"{leg}R_{joint}"], atol=0.02)


@pytest.mark.parametrize("task", ["walk", "trot"])
def test_solo_lifts_its_feet_and_does_not_skate(solo, task):
    """No foot was above 1.7 mm, and feet went 150 to 230 mm under load."""
    problem, motion, _ = solved(solo, mt.tasks.TASKS[task](solo))
    steps = footsteps(problem.robot, motion, problem.scenario.surface)
    assert {step.foot for step in steps} == set(solo.feet)
    assert min(step.lift for step in steps) > 0.02 * solo.standing_height
    stands = Schedule.of(problem.robot, problem.scenario).on[:, 1:]
    ways = np.linalg.norm(np.diff(motion.per_contact("contact_positions")[:, :2], axis=2), axis=1)
    assert np.where(stands, ways, 0.0).sum(axis=1).max() < 1e-3


@pytest.mark.parametrize("task", ["squat", "step", "walk", "jump"])
def test_talos_does_what_a_robot_on_two_legs_does(task):
    """It was refused: a reach of the iRonCub was a number of the code."""
    talos = mt.load_robot("talos")
    problem, motion, report = solved(talos, mt.tasks.TASKS[task](talos))
    if problem.scenario.gait is not None:
        assert {step.foot for step in footsteps(problem.robot, motion, problem.scenario.surface)} == set(talos.feet)
    assert (report.airborne > 0.1) == (task == "jump")


def test_anymal_with_four_jets_takes_off_and_lands_elsewhere(tmp_path):
    """It was infeasible, by the same reach."""
    robot = mt.robots.init(example_robots() / ANYMAL, tmp_path / "anymal", jets=ANYMALS_JETS).robot
    up, down = mt.tasks.take_off(robot), mt.tasks.land(robot)
    solved(robot, up)
    solved(robot, down)
    off = [stretch for stretch in up.contacts if stretch.state is mt.ContactState.OFF]
    share = 0.5 * off[0].begin  # of the ground, before and after
    feet = off[0].of
    stretches = tuple(
        mt.ContactStretch(of=feet, state=state, begin=begin, end=end)
        for state, begin, end in (
            (mt.ContactState.ON, 0.0, share),
            (mt.ContactState.OFF, share, 1.0 - share),
            (mt.ContactState.ON, 1.0 - share, 1.0),
        )
    )
    there = replace(
        up,
        name="there",
        knots=2 * up.knots,
        terminal=mt.Terminal.STANDING,
        final_com_shift=(0.5, 0.0, 0.0),
        mid_height_min=robot.home_com[2] + 0.2,
        contacts=stretches,
    )
    _, motion, report = solved(robot, there)
    assert report.airborne > 0.5
    feet_moved = motion.per_contact("contact_positions")[:, 0, [0, -1]]
    np.testing.assert_allclose(feet_moved[:, 1] - feet_moved[:, 0], 0.5, atol=0.2)


def test_a_hopper_on_one_leg_hops_by_25_cm(tmp_path):
    """It was infeasible: a greatest speed of the base was 2 m/s, and the hop needs √(2 g h) = 2.2 m/s."""
    robot = one_leg(tmp_path)
    problem, motion, report = solved(robot, mt.tasks.jump(robot, height=0.25))
    assert motion.com_position[2].max() >= robot.home_com[2] + 0.25 - 1e-6
    assert motion.base_linear_velocity[2].max() > 2.0
    assert report.airborne == pytest.approx(
        2.0 * (2.0 * 0.25 / 9.80665) ** 0.5, abs=2.0 * problem.scenario.interval_max
    )


@pytest.mark.parametrize("name", list(mt.scenarios.SCENARIOS))
def test_the_third_iron_cub_does_the_bundled_scenarios_in_its_own_units(name):
    mk3 = mt.load_robot("ironcub-mk3")
    problem, motion, report = solved(mk3, mt.tasks.find(name, mk3))
    if name == "jump":
        assert report.airborne > 0.15  # and does not only stretch its legs
    if name == "walk-to-fly":
        assert len(footsteps(mk3, motion, problem.scenario.surface)) >= 3  # and does not only stand until it flies


@pytest.mark.parametrize("task", ["hover", "take-off", "land"])
def test_a_drone_without_joints_flies(task):
    """It was refused, and needed five empty tables to be so."""
    robot = mt.load_robot("quadrotor")
    _, _, report = solved(robot, mt.tasks.TASKS[task](robot))
    assert report.airborne > 0.5


def test_a_drone_flies_aside():
    robot = mt.load_robot("quadrotor")
    _, motion, _ = solved(robot, mt.tasks.hover(robot, by=(0.0, 0.5, 0.0)))
    assert motion.com_position[1, -1] - motion.com_position[1, 0] == pytest.approx(0.5, abs=1e-3)


def test_the_take_off_of_a_robot_that_heads_elsewhere_is_the_same(ironcub):
    """At 45° it ended at the limit of iterations: a hover was held to the axes of the world."""
    turn = heading(np.pi / 4)
    home = replace(ironcub.home, base_quaternion_xyzw=product(turn, ironcub.home.base_quaternion_xyzw))
    turned = replace(ironcub, home=home)
    short = replace(mt.scenarios.take_off(), knots=35, interval_min=0.1, interval_max=0.2)
    objectives = []
    for robot in (ironcub, turned):
        problem = mt.build(robot, short)
        solution = mt.solve(problem)
        assert solution.status.solved
        objectives.append(solution.objective)
    assert objectives[1] == pytest.approx(objectives[0], rel=2e-2)


def test_a_starter_task_is_gone_on_from_by_its_name(tmp_path):
    folder = tmp_path / "squat"
    first = run("solve", "squat", "--robot", "solo12", "-o", folder, "--max-iterations", 3, "--no-pictures")
    assert first.returncode == 1
    again = run("solve", "--resume", folder / "trajectory.npz", "squat", "--no-pictures")
    assert again.returncode == 0, again.stdout + again.stderr

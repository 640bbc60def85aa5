"""What the doctor refuses, what it lets pass, and that what it says of jets, forces and postures is so."""

from __future__ import annotations

import json
import re
import time
from dataclasses import replace

import numpy as np
import pytest
from typer.testing import CliRunner

import multimodal_to as mt
from commands import run
from drones import drone
from multimodal_to import scenarios
from multimodal_to.cli import app
from multimodal_to.doctor import Severity
from multimodal_to.doctor.balance import residual
from multimodal_to.doctor.formulation import formulation
from multimodal_to.doctor.ground import hold
from multimodal_to.doctor.hover import trimmed, upright
from multimodal_to.doctor.task import Task
from multimodal_to.models.terrain import Plane
from multimodal_to.models.turbines import greatest_held, spool_up
from multimodal_to.scenarios.scenario import Start, Terminal
from multimodal_to.scenarios.weights import Weights

SECONDS = 2.0  # of one processor, for one diagnosis


def examined(robot, scenario):
    """Return a diagnosis that was made in time; of processor time, since others may use the machine."""
    began = time.process_time()
    diagnosis = mt.doctor(robot, scenario)
    assert time.process_time() - began < SECONDS
    return diagnosis


def hop(**changes):
    """Return a short flight for the small robots, from standing to a hover 20 cm higher."""
    return replace(
        mt.Scenario(
            name="hop",
            title="hop",
            knots=30,
            initial_com=(0.0, 0.0, 0.4),
            final_com=(0.0, 0.0, 0.6),
            terminal=Terminal.HOVER,
            interval_min=0.1,
            interval_max=0.2,
            weights=Weights(com_velocity=1e3, com_acceleration=1e2, contact_forces=1e-2),
        ),
        **changes,
    )


# ------------------------------------------------------------------------------------------ what is refused


def weak(robot):
    return replace(robot, jets=tuple(replace(jet, thrust_max=0.5 * jet.thrust_max) for jet in robot.jets))


def same(robot):
    return robot


HOPELESS = {
    "too heavy": (weak, "take-off", {}, "thrust", "439 N (44.7 kg) and its 4 jets together hold at most 380 N"),
    "a hover without jets": (same, "take-off", {"jets": False}, "thrust", "the scenario leaves them off"),
    "no time to spool up": (same, "take-off", {"knots": 35}, "spool-up", "at most 3.5 s long"),
    "a start that legs don't reach": (
        same,
        "take-off",
        {"initial_com": (0.0, 0.0, 0.75)},
        "standing start",
        "no posture of ironcub within its joint limits stands",
    ),
    "an end that legs don't reach": (
        same,
        "take-off-and-landing",
        {"final_com": (0.0, 0.0, 0.2)},
        "standing end",
        "the nearest that the legs are found to reach is 0.3",
    ),
    "an end beyond the reach of contacts": (
        same,
        "landing",
        {"final_com": (0.0, 0.0, 0.62)},
        "standing end",
        "beyond the reach of contact points",
    ),
    "a height outside the range": (
        same,
        "take-off-and-landing",
        {"mid_height_min": 1.6, "com_range": (1.5, 1.5, 1.5)},
        "bounds",
        "at least 1.6 and at most 1.5 m at knot 100",
    ),
    "a slope too steep for friction": (
        same,
        "take-off",
        {"surface": Plane(slope=0.5, direction=(-1.0, 0.0))},
        "friction at the start",
        "inclined by up to 26.6°, and friction, 0.33, which holds 18.3°",
    ),
    "ice": (same, "jump", {"surface": Plane(slope=0.1), "friction": 0.05}, "friction at the start", "which holds 2.9°"),
    "too little time for the distance": (
        same,
        "jump",
        {"knots": 6, "interval_max": 0.05, "mid_height_min": None, "final_com": (-0.3, 0.0, 0.57)},
        "time for the distance",
        "friction, 0.33, moves it by at most 0.0809 m",
    ),
    "too little speed for the height": (
        same,
        "take-off-and-landing",
        {"mid_height_min": 1.2, "base_speed_max": 0.02},
        "time for the distance",
        "down from mid_height_min in at most 9.8 s",
    ),
    "no time to fall": (
        same,
        "jump",
        {"knots": 8, "interval_max": 0.05, "mid_height_min": 0.9},
        "leap",
        "and back takes 0.49 s, and the horizon is at most 0.4 s long",
    ),
    "a jump too high for the speed": (
        same,
        "jump",
        {"mid_height_min": 1.3, "base_speed_max": 1.0},
        "leap",
        "lifts off at 3.7 m/s",
    ),
    "a group that does not exist": (
        same,
        "take-off",
        {"weights": Weights(joint_velocities={"lgs": 1.0})},
        "weights",
        "did you mean 'legs'",
    ),
    "an allowance of a property that does not exist": (
        same,
        "take-off",
        {"allowances": {"slip": 1.0}},
        "allowances",
        "unknown property to allow more of 'slip'",
    ),
}


@pytest.mark.parametrize(("change", "name", "changes", "finding", "sentence"), HOPELESS.values(), ids=HOPELESS)
def test_a_hopeless_task_is_refused_in_time_with_one_reason(ironcub, change, name, changes, finding, sentence):
    diagnosis = examined(change(ironcub), replace(scenarios.find(name), **changes))
    (error,) = diagnosis.of(Severity.ERROR)
    assert diagnosis.hopeless
    assert error.name == finding
    assert sentence in str(error)
    assert error.change


@pytest.mark.parametrize("name", scenarios.SCENARIOS)
def test_the_bundled_scenarios_pass_in_time_and_without_a_warning(ironcub, name):
    diagnosis = examined(ironcub, scenarios.find(name))
    assert not diagnosis.hopeless
    assert diagnosis.of(Severity.WARNING) == ()


def test_what_the_doctor_suggests_helps(ironcub):
    """The knots that it asks for leave time to spool up, and the height that it offers can be stood at."""
    short = replace(scenarios.take_off(), knots=35)
    (error,) = mt.doctor(ironcub, short).of(Severity.ERROR)
    knots = int(error.change.split("knots = ")[1].split()[0])
    assert not mt.doctor(ironcub, replace(short, knots=knots)).hopeless
    assert mt.doctor(ironcub, replace(short, knots=knots - 1)).hopeless

    low = replace(scenarios.take_off_and_landing(), final_com=(0.0, 0.0, 0.2))
    (error,) = mt.doctor(ironcub, low).of(Severity.ERROR)
    height = float(error.change.split(" is ")[1].split()[0])
    assert not mt.doctor(ironcub, replace(low, final_com=(0.0, 0.0, height + 1e-3))).hopeless


# ------------------------------------------------------------------------------------------ warnings


def test_a_horizon_that_is_just_long_enough_to_spool_up_is_warned_of(ironcub):
    diagnosis = mt.doctor(ironcub, replace(scenarios.take_off(), knots=44))
    assert [finding.name for finding in diagnosis.of(Severity.WARNING)] == ["spool-up"]
    assert not diagnosis.hopeless


def test_weights_that_drown_each_other_or_count_twice_are_warned_of(ironcub):
    weights = replace(scenarios.take_off().weights, com_velocity=1e14, joint_velocities={"legs": 1.0, "left_leg": 1e5})
    found = {str(finding) for finding in mt.doctor(ironcub, replace(scenarios.take_off(), weights=weights)).findings}
    assert any("l_knee" in text and "more than one group" in text for text in found)
    assert any("throttle costs 2.5e+02 and com_velocity 1.0e+14: the objective cannot see" in text for text in found)
    assert any(text.startswith("scale of the objective: the greatest cost, com_velocity, is 1.0e+10") for text in found)


def test_a_task_without_a_cost_and_one_of_another_size_are_warned_of(ironcub):
    slow = replace(scenarios.jump(), weights=Weights(), interval_max=10.0)
    found = {finding.name: finding for finding in mt.doctor(ironcub, slow).of(Severity.WARNING)}
    assert "no cost has a weight" in found["weights"].found
    assert "interval will be about 10 s" in found["scales"].found


def test_a_variable_that_no_row_and_no_cost_sees_is_named(tmp_path):
    """The antenna has no mass: no row but its integration holds it, until a cost does."""
    robot = drone(tmp_path, antenna=True)
    (finding,) = (found for found in mt.doctor(robot, hop()).findings if found.name == "unseen variables")
    assert finding.severity is Severity.WARNING
    assert "no row and no cost sees joint_positions of 'antenna', joint_velocities of 'antenna'" in finding.found
    weights = replace(hop().weights, posture=1.0)
    assert list(formulation(Task.of(robot, hop(weights=weights)))) == []


# ------------------------------------------------------------------------------------------ what it rests on


def test_what_a_turbine_holds_is_held_by_a_throttle_within_its_range(ironcub):
    for jet in ironcub.jets:
        held = greatest_held(jet)
        assert 0.98 * jet.thrust_max < held <= jet.thrust_max
        assert jet.throttle_min <= jet.model.steady_throttle(0.99 * held) <= jet.throttle_max
        choked = replace(jet, throttle_max=50.0)
        assert choked.model.steady_throttle(greatest_held(choked)) == pytest.approx(50.0, abs=0.5)
        assert greatest_held(choked) < 0.65 * jet.thrust_max


def test_spooling_up_agrees_with_small_steps_of_its_equation(ironcub):
    times = np.linspace(0.5, 2.0, 4)
    for jet, reached in zip(ironcub.jets, spool_up(ironcub.jets, times), strict=True):
        thrust = rate = 0.0
        step = 5e-4
        for index in range(round(times[-1] / step)):
            rate += step * jet.model.acceleration(thrust, rate, jet.throttle_max)
            thrust += step * rate
            for time_reached, value in zip(times, reached, strict=True):
                if index + 1 == round(time_reached / step):
                    assert value == pytest.approx(thrust, rel=5e-3)


def test_a_turbine_whose_model_runs_away_counts_as_there_and_says_nothing(ironcub, capfd):
    wild = replace(ironcub.jets[0], model=replace(ironcub.jets[0].model, K_DD=5.0, B_U=50.0))
    assert spool_up([wild], np.array([0.05, 1.0])).tolist() == [[160.0, 160.0]]
    assert capfd.readouterr() == ("", "")


def test_a_posture_without_a_trim_is_bent_into_one_with(ironcub):
    task = Task.of(ironcub, scenarios.take_off())
    before = residual(task, upright(task), feet=False, thrusts=task.thrusts_held)
    posture = trimmed(task, (0.0, 0.0, 0.70))
    after = residual(task, posture, feet=False, thrusts=task.thrusts_held)
    assert before.share > 0.01
    assert after.share < 1e-5
    assert np.all(posture.joint_positions <= ironcub.joint_limits.upper)


def test_feet_hold_a_slope_up_to_their_friction(ironcub):
    for slope, holds in ((0.30, True), (0.36, False)):
        task = Task.of(ironcub, replace(scenarios.take_off(), surface=Plane(slope=slope, direction=(-1.0, 0.0))))
        assert (list(hold(task)) == []) == holds


def test_a_robot_whose_com_is_beside_its_feet_has_no_support(tmp_path):
    robot = drone(tmp_path)
    front = replace(robot, contacts=robot.contacts[:2])
    (error,) = mt.doctor(front, hop()).of(Severity.ERROR)
    assert error.name == "support at the start"
    assert "leave 0 N and 39.2 N m over" in error.found  # 20 kg × 9.80665 m/s² × 0.2 m


# ------------------------------------------------------------------------------------------ other robots


def test_a_drone_whose_jets_are_a_little_askew_is_warned_of_in_silence(tmp_path, capfd):
    """Within its tolerance of upright it may still hover; that the search has too few unknowns is not to be seen."""
    (warning,) = mt.doctor(drone(tmp_path, tilt="3.13 0 0"), hop()).of(Severity.WARNING)
    assert warning.name == "hover trim"
    assert capfd.readouterr() == ("", "")


def test_a_drone_without_joints_hops(tmp_path):
    diagnosis = examined(drone(tmp_path), hop())
    assert not diagnosis.hopeless
    assert diagnosis.of(Severity.WARNING) == ()


@pytest.mark.parametrize(
    ("shape", "finding", "sentence"),
    [
        ({"mass": 60.0}, "thrust", "588 N (60.0 kg) and its 2 jets together hold at most 440 N"),
        ({"jets": False}, "thrust", "without jets: drone has none"),
        ({"tilt": "1.57079632679 0 0"}, "hover trim", "no joint moves, and within their limits the thrusts leave"),
        ({"tilt": "1.57079632679 0 0", "antenna": True}, "hover trim", "the jets sit on the base"),
        ({"more": "[reach]\ncontacts = [0.1, 0.3, 0.6]"}, "reach", "foot_0 is 0.2 m from the CoM along x"),
        ({"more": "[reach]\njets = [0.3, 0.1, 0.3]"}, "reach", "the jet left is 0.2 m from the CoM along y"),
    ],
)
def test_a_drone_that_cannot_fly_is_refused(tmp_path, shape, finding, sentence):
    (error,) = examined(drone(tmp_path, **shape), hop()).of(Severity.ERROR)
    assert error.name == finding
    assert sentence in error.found


def test_a_robot_without_jets_may_stand(tmp_path):
    robot = drone(tmp_path, jets=False)
    standing = hop(final_com=(0.0, 0.0, 0.4), terminal=Terminal.STANDING)
    assert not examined(robot, standing).hopeless


def test_a_robot_without_feet_is_refused_where_it_has_to_stand_and_only_there(tmp_path):
    robot = replace(drone(tmp_path), contacts=())
    (error,) = mt.doctor(robot, hop()).of(Severity.ERROR)
    assert error.name == "contacts"
    assert not mt.doctor(robot, hop(start=Start.HOVER)).hopeless


# ------------------------------------------------------------------------------------------ the command line


def test_the_command_prints_its_findings_for_programs():
    result = CliRunner().invoke(app, ["doctor", "take-off", "--set", "knots=20", "--json"])
    data = json.loads(result.stdout)
    assert result.exit_code == 2
    assert data["hopeless"]
    assert data["findings"][0]["name"] == "spool-up"
    assert data["findings"][0]["severity"] == "error"
    assert "allow knots = 40" in data["findings"][0]["change"]


def test_a_scenario_that_cannot_be_made_is_one_finding(tmp_path):
    (tmp_path / "far.toml").write_text('based_on = "take-off"\nfinal_com = [0, 0, 2]\ncom_range = [1.5, 1.5, 1.5]\n')
    result = CliRunner().invoke(app, ["doctor", str(tmp_path / "far.toml")])
    assert result.exit_code == 2
    assert "far.toml: final_com has z = 2.0 m, beyond com_range, 1.5 m" in result.stdout


def test_a_sound_task_leaves_zero():
    result = CliRunner().invoke(app, ["doctor", "landing"])
    assert result.exit_code == 0
    assert "landing: nothing found that makes it hopeless (errors: 0, warnings: 0" in result.stdout


def test_a_hopeless_solve_is_refused_and_writes_nothing_unless_it_is_forced(tmp_path):
    task = ("solve", "take-off", "--set", "knots=4", "--no-pictures", "--output", "out")
    refused = run(*task, cwd=tmp_path)
    assert refused.returncode == 2
    assert refused.stderr.startswith("error: spool-up: the jets need 4.0 s")
    assert list(tmp_path.iterdir()) == []

    forced = run(*task, "--force", "--max-iterations", 2, cwd=tmp_path)
    assert forced.returncode == 1
    assert "error: spool-up" in forced.stderr
    assert "iteration limit" in forced.stdout
    assert (tmp_path / "out" / "trajectory.npz").is_file()


def test_the_height_that_stiff_legs_reach_is_told_from_the_one_asked_for_and_is_accepted(tmp_path):
    robot = drone(tmp_path)
    task = replace(scenarios.take_off(), initial_com=(0.0, 0.0, 0.4003), final_com=(0.0, 0.0, 0.7))
    task = replace(task, weights=replace(task.weights, joint_velocities={}))
    (symptom,) = [some for some in mt.doctor(robot, task).of(Severity.ERROR) if some.name == "standing start"]
    height = float(re.search(r"reach is (\S+) m", symptom.change)[1])
    assert height == pytest.approx(0.4, abs=1e-4)
    assert height != 0.4003
    again = mt.doctor(robot, replace(task, initial_com=(0.0, 0.0, height)))
    assert "standing start" not in [some.name for some in again.findings]

"""What an answer depends on is in its file, and whoever judges it takes it from there."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from typer.testing import CliRunner

import multimodal_to as mt
from hopper import hop, hopper
from multimodal_to.adam import KinDynComputations
from multimodal_to.cli import app
from multimodal_to.cli.common import loaded
from multimodal_to.errors import TrajectoryError
from multimodal_to.trajectory.conditions import differences
from multimodal_to.trajectory.derived import joint_torques
from multimodal_to.trajectory.resampling import resample

MARS = (0.0, 0.0, -3.7)


@pytest.fixture(scope="module")
def earth(tmp_path_factory):
    return hopper(tmp_path_factory.mktemp("hopper"))


@pytest.fixture(scope="module")
def mars(earth):
    """The hopper on dusty ground on Mars."""
    kindyn = KinDynComputations(earth.urdf, earth.joint_names, gravity=MARS)
    return replace(earth, kindyn=kindyn, friction=0.3)


@pytest.fixture(scope="module")
def flight(mars):
    """A hop there, solved."""
    solution = mt.solve(mt.build(mars, hop(mars, knots=20, interval_min=0.2, interval_max=0.4), mt.Formulation.paper()))
    assert solution.status is mt.Status.OPTIMAL
    return solution.trajectory


def failing(report):
    return {finding.name for finding in report.findings if not finding.holds}


def test_a_motion_of_mars_is_judged_under_the_gravity_there(tmp_path, earth, mars, flight):
    file = flight.save(tmp_path / "flight.npz")
    read = mt.Trajectory.load(file)
    there, here = mt.audit(mars, flight), mt.audit(earth, read)
    assert here.findings == there.findings
    assert here["force balance"].holds
    assert here["end: thrust off weight"].holds
    forgetful = replace(read, robot_json="")
    assert {"force balance", "end: thrust off weight", "start: force balance"} <= failing(mt.audit(earth, forgetful))
    np.testing.assert_array_equal(joint_torques(earth, read), joint_torques(mars, flight))
    assert loaded(file, str(earth.urdf.parent))[0].gravity.tolist() == list(MARS)
    result = CliRunner().invoke(app, ["audit", str(file), "--robot", str(earth.urdf.parent), "--json"])
    found = {finding["name"]: finding["worst"] for finding in json.loads(result.stdout)["findings"]}
    assert found["force balance"] == pytest.approx(there["force balance"].worst)


def test_friction_that_the_scenario_leaves_to_the_robot_is_that_of_the_file(earth, mars, flight):
    """Pushed along the ground by 0.4 of the normal force: too much for the dust, and not for the folder's robot."""
    forces = flight.contact_forces.copy()
    forces[0::3] = 0.4 * forces[2::3]
    pushed = replace(flight, contact_forces=forces)
    assert mt.audit(earth, pushed)["friction beyond cone"] == mt.audit(mars, pushed)["friction beyond cone"]
    assert not mt.audit(earth, pushed)["friction beyond cone"].holds
    assert mt.audit(earth, replace(pushed, robot_json=""))["friction beyond cone"].holds


def test_a_playback_is_under_the_gravity_of_the_file(earth, flight):
    simulation = pytest.importorskip("multimodal_to.simulation")
    pytest.importorskip("mujoco")
    short = resample(flight, np.linspace(0.0, 0.2, 3))
    played = simulation.play(earth, short)
    assert played.robot.gravity.tolist() == list(MARS)
    assert np.abs(played.com - played.reference.com).max() < 0.02  # under its own weight it would sink


def test_what_differs_of_the_robot_is_said(earth, mars, flight):
    assert differences(mars, flight) == differences(earth, flight) == ()
    assert differences(earth, replace(flight, robot_json="")) == ()
    limits = replace(earth.joint_limits, upper=earth.joint_limits.upper - np.array([0.0, 0.2]))
    jets = (replace(earth.jets[0], thrust_max=200.0), *earth.jets[1:])
    said = differences(replace(earth, joint_limits=limits, jets=jets), flight)
    assert said == (
        "joint_limits.right_pitch.upper is 0.8 there and 0.6000000000000001 here",
        "jets.left.thrust_max is 220.0 there and 200.0 here",
    )
    assert any(line.startswith("upright is") for line in differences(_lying(earth), flight))


def _lying(robot):
    """The robot with a home in which its body lies on its side."""
    return replace(robot, home=replace(robot.home, base_quaternion_xyzw=np.array([0.5**0.5, 0.0, 0.0, 0.5**0.5])))


def test_the_command_says_what_differs(tmp_path, earth, flight):
    other = hopper(tmp_path / "other")
    toml = other.urdf.parent / "robot.toml"
    toml.write_text(toml.read_text(encoding="utf-8").replace("220.0", "250.0"), encoding="utf-8")
    file = str(flight.save(tmp_path / "flight.npz"))
    result = CliRunner().invoke(app, ["audit", file, "--robot", str(toml.parent)])
    assert "planned for another robot: jets.left.thrust_max is 220.0 there and 250.0 here" in result.stdout
    same = CliRunner().invoke(app, ["audit", file, "--robot", str(earth.urdf.parent)])
    assert "another robot" not in same.stdout


def test_a_solve_that_goes_on_keeps_the_gravity_of_its_file(tmp_path, earth, flight):
    file, folder = flight.save(tmp_path / "flight.npz"), str(earth.urdf.parent)
    options = ["--max-iterations", "1", "--no-pictures", "--quiet", "--force", "--output", str(tmp_path)]
    CliRunner().invoke(app, ["solve", "--resume", str(file), "--robot", folder, *options])
    again = mt.Trajectory.load(tmp_path / "trajectory.npz")
    assert json.loads(again.robot_json)["gravity"] == list(MARS)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("{", "it is no JSON"),
        ("[]", "it is no JSON object"),
        ('{"gravity": [0, 0]}', "gravity is .0, 0.; expected three numbers"),
        ('{"gravity": [0, 0, NaN]}', "gravity is .*; expected three numbers"),
        ('{"friction": -1}', "friction is -1; expected a positive number"),
    ],
)
def test_what_is_no_record_of_a_robot_is_refused_in_one_sentence(earth, flight, text, expected):
    with pytest.raises(TrajectoryError, match=f"keeps of its robot cannot be read: {expected}"):
        mt.audit(earth, replace(flight, robot_json=text))


def test_a_robot_under_another_gravity_leaves_the_first_one_alone(earth):
    lifted = earth.with_gravity(MARS)
    assert lifted.weight == pytest.approx(earth.mass * 3.7)
    assert earth.gravity[2] == pytest.approx(-9.80665)
    terms = [np.array(robot.kindyn.gravity_term(np.eye(4), np.zeros(2)))[2, 0] for robot in (earth, lifted, earth)]
    assert terms == pytest.approx([earth.weight, lifted.weight, earth.weight])

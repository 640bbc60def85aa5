"""A heading is where a robot looks, upright is how it stands under gravity, and neither is a base frame or a sign."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import multimodal_to as mt
from hopper import body_rotation, heading, hop, hopper, yaw_of
from multimodal_to.models.attitude import axes_about, continuous, product, signed, tilt

PAPER = mt.Formulation.paper()


@pytest.fixture(scope="module")
def straight(tmp_path_factory):
    """The hopper that heads along x, its body the base, and its hop."""
    robot = hopper(tmp_path_factory.mktemp("straight"))
    return robot, mt.solve(mt.build(robot, hop(robot), PAPER))


@pytest.mark.parametrize(
    ("angle", "sign", "mount"),
    [
        (0.3, -1.0, None),
        (np.pi, 1.0, None),
        (0.0, -1.0, (np.pi / 2, 0.0, 0.0)),
        (1.0, -1.0, (0.4, -0.7, 1.1)),
    ],
)
def test_a_hop_is_the_same_wherever_the_robot_heads_and_whatever_its_base_frame(tmp_path, straight, angle, sign, mount):
    _, first = straight
    robot = hopper(tmp_path, turn=sign * heading(angle), mount=mount)
    turned = mt.solve(mt.build(robot, hop(robot), PAPER))
    assert turned.status is mt.Status.OPTIMAL
    assert turned.objective == pytest.approx(first.objective, rel=1e-5)
    assert abs(turned.iterations - first.iterations) <= 0.3 * first.iterations
    assert np.abs(body_rotation(robot, turned.trajectory.base_quaternion_xyzw[:, -1]) - yaw_of(angle)).max() < 3e-3
    assert mt.audit(robot, turned.trajectory)["end: base off upright"].worst < 2.9e-3


def test_a_landing_starts_upright_with_the_heading_of_home(tmp_path):
    """By leapfrog, on bounds where home is the world's frame and on rows where it isn't: both have the same start."""
    for angle, mount in ((0.0, None), (1.0, (np.pi / 2, 0.0, 0.0))):
        robot = hopper(tmp_path / f"{angle}", turn=heading(angle), mount=mount)
        scenario = hop(robot, start=mt.Start.HOVER, initial_com=(0.0, 0.0, 0.6), knots=6)
        problem = mt.build(robot, scenario)
        for x in (problem.guess, problem.guess + 1e-2):
            missed = problem.largest_violations(x)
            assert (missed["upright_first"] > 5e-3) == (x is not problem.guess), angle
            assert (missed["upright_last"] > 5e-3) == (x is not problem.guess), angle


def test_the_doctor_finds_the_same_wherever_the_robot_heads(tmp_path):
    """With the jets turned aside no posture hovers; that is said in the same words of both."""

    def found(robot):
        jets = tuple(replace(jet, thrust_max=jet.thrust_max * 0.6) for jet in robot.jets[:1]) + robot.jets[1:]
        return [str(finding) for finding in mt.doctor(replace(robot, jets=jets), hop(robot)).findings]

    straight = found(hopper(tmp_path / "straight"))
    assert straight
    assert found(hopper(tmp_path / "turned", turn=heading(np.pi / 2))) == straight
    assert found(hopper(tmp_path / "lying", mount=(np.pi / 2, 0.0, 0.0))) == straight


def test_the_audit_sees_a_tilt_and_no_heading(straight, tmp_path):
    robot, solution = straight
    plan = solution.trajectory
    for turn, off in ((heading(0.5), 0.0), (np.array([0.02, 0.0, 0.0, 1.0]), 0.04)):
        quaternions = np.array([product(turn, column) for column in plan.base_quaternion_xyzw.T]).T
        finding = mt.audit(robot, replace(plan, base_quaternion_xyzw=quaternions))["end: base off upright"]
        assert finding.worst == pytest.approx(off, abs=2e-4)
        assert finding.holds == (off == 0.0)


def test_upright_goes_by_gravity():
    up = np.array([0.0, 0.6, 0.8])
    assert tilt(np.eye(3), yaw_of(1.0), np.array([0.0, 0.0, 1.0])) == pytest.approx(0.0, abs=1e-12)
    assert tilt(np.eye(3), yaw_of(np.pi), up) == pytest.approx(2 * np.arctan2(0.6, 0.8))
    axes = axes_about(up)
    assert axes @ axes.T == pytest.approx(np.eye(3))
    assert axes[2] == pytest.approx(up)
    assert np.linalg.det(axes) == pytest.approx(1.0)


def test_a_robot_without_lean_is_upright_at_home_and_one_with_lean_is_not(ironcub, tmp_path):
    robot = hopper(tmp_path, turn=heading(0.3))
    assert np.array_equal(robot.upright.base_quaternion_xyzw, robot.home.base_quaternion_xyzw)
    assert np.array_equal(ironcub.upright.base_quaternion_xyzw, [0.0, 0.0, 0.0, 1.0])
    turned = replace(ironcub.home, base_quaternion_xyzw=product(heading(1.0), ironcub.home.base_quaternion_xyzw))
    assert replace(ironcub, home=turned).upright.base_quaternion_xyzw == pytest.approx(heading(1.0))


# ---------------------------------------------------------------- signs


def test_a_quaternion_and_its_negative_are_one_attitude():
    rng = np.random.default_rng(3)
    for quaternion in (*rng.normal(size=(20, 4)), heading(np.pi), heading(-np.pi), np.array([1.0, 0.0, 0.0, 0.0])):
        assert np.array_equal(signed(quaternion), signed(-quaternion))
    walk = np.array([heading(angle) for angle in np.linspace(0.0, 7.0, 40)]).T
    for signs in (rng.choice([-1.0, 1.0], 40), -np.ones(40)):
        assert np.array_equal(continuous(walk * signs), walk)


@pytest.mark.parametrize("signs", ["all", "some"])
def test_a_motion_with_other_signs_is_the_same_motion(tmp_path, straight, signs):
    """As it is made, as its file is read, and as it starts a solve."""
    robot, solution = straight
    plan = solution.trajectory
    flips = -np.ones(31) if signs == "all" else np.random.default_rng(1).choice([-1.0, 1.0], 31)
    flipped = replace(plan, base_quaternion_xyzw=plan.base_quaternion_xyzw * flips)
    assert np.array_equal(flipped.base_quaternion_xyzw, plan.base_quaternion_xyzw)
    arrays = dict(np.load(plan.save(tmp_path / "plan.npz")))
    arrays["base_quaternion_xyzw"] = arrays["base_quaternion_xyzw"] * flips
    np.savez(tmp_path / "flipped.npz", **arrays)
    read = mt.Trajectory.load(tmp_path / "flipped.npz")
    assert np.array_equal(read.base_quaternion_xyzw, plan.base_quaternion_xyzw)
    problem = mt.build(robot, hop(robot), PAPER)
    assert np.array_equal(problem.start_from(read), problem.start_from(plan))


def test_a_start_near_half_a_turn_gets_the_sign_of_the_problem(tmp_path, straight):
    """Two motions that head a little to either side of half a turn have opposite signs in their files."""
    _, solution = straight
    robot = hopper(tmp_path, turn=heading(np.pi))
    problem = mt.build(robot, hop(robot), PAPER)
    layout = problem.layout
    plan = solution.trajectory
    for angle in (np.pi - 1e-3, np.pi + 1e-3):
        quaternions = np.array([product(heading(angle), column) for column in plan.base_quaternion_xyzw.T]).T
        x = problem.start_from(replace(plan, base_quaternion_xyzw=quaternions)) * problem.scale
        rho = layout.read_horizon(x)["base_quaternion_xyzw"]
        assert (problem.robot.upright.base_quaternion_xyzw @ rho > 0.99).all()


def test_the_other_sign_of_a_quaternion_that_is_given_leaves_the_problem_as_it_is(tmp_path, straight):
    """Of home, of the state that a motion starts in, and of a keyframe: no bit of the problem changes."""
    _, solution = straight
    first = hopper(tmp_path / "first", turn=heading(1.0))
    other = hopper(tmp_path / "other", turn=-heading(1.0))
    asked = mt.Keyframe(when="end", base_orientation=tuple(heading(1.2)), orientation_tolerance=0.3)
    counter = replace(asked, base_orientation=tuple(-heading(1.2)))
    task = {"knots": 4, "start": mt.Start.GIVEN, "initial_com": None, "terminal": mt.Terminal.FREE}
    state = mt.state_at(solution.trajectory, 0.5)
    turned = replace(state, base_quaternion_xyzw=-np.asarray(state.base_quaternion_xyzw))
    problems = [
        mt.build(robot, hop(robot, **task, keyframes=(keyframe,)), initial=start)
        for robot, keyframe, start in ((first, asked, state), (other, counter, turned))
    ]
    for name in ("guess", "lower", "upper", "row_lower", "row_upper"):
        assert np.array_equal(*(getattr(problem, name) for problem in problems)), name
    x = problems[0].guess + 0.01 * np.random.default_rng(0).normal(size=problems[0].guess.size)
    assert problems[1].rows_at(x) == pytest.approx(problems[0].rows_at(x), rel=1e-12, abs=1e-12)
    costs = [problem.costs(x) for problem in problems]
    assert costs[1] == pytest.approx(costs[0], rel=1e-12)

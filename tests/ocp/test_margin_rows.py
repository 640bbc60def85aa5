"""Rows and costs that keep a plan within what the robot can do, against physics done by hand or by another way."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import casadi as cs
import numpy as np
import pytest

import multimodal_to as mt
from multimodal_to.auditing.margins import pressure_shares
from multimodal_to.models import capsule_pairs
from multimodal_to.models.contact import DESCENT_RATE
from multimodal_to.models.sole import PRESSURE_SLACK, soles
from multimodal_to.ocp import costs, margins
from multimodal_to.ocp.flights import flights, thrown
from multimodal_to.ocp.guess import contact_positions, standing_posture, start_guess
from multimodal_to.ocp.integration import BACKWARD_EULER, LEAPFROG, Interval
from multimodal_to.ocp.knot import Knot
from multimodal_to.ocp.parameters import Parameters
from multimodal_to.ocp.schedule import Schedule
from multimodal_to.ocp.variables import Layout
from multimodal_to.scenarios import Margins
from multimodal_to.trajectory.derived import largest_torques
from solo import solo

ROWS_OF = {
    "torque": "joint_torques",
    "pressure": "centre_of_pressure",
    "touch_down_speed": "touch_down",
    "distance": "link_distances",
}
"""The rows that each margin adds."""


def parameters_of(robot, surface=None, **changes):
    scenario = replace(mt.scenarios.take_off(), margins=replace(Margins(), **changes))
    scenario = scenario if surface is None else replace(scenario, surface=surface)
    return Parameters.of(robot, scenario, robot.home)


def knot_at_home(robot, raised=0.0, **changes):
    """A knot in the home posture, with its feet so far above the ground [m]; all else is zero but the changes."""
    layout = Layout.of(robot)
    lift = np.array([0.0, 0.0, raised])
    values = {name: np.zeros(rows.stop - rows.start) for name, rows in layout.rows.items()}
    values["base_position"] = robot.home.base_position + lift
    values["base_quaternion_xyzw"] = robot.home.base_quaternion_xyzw
    values["joint_positions"] = robot.home.joint_positions
    values["contact_positions"] = contact_positions(robot, robot.home) + np.tile(lift, len(robot.contacts))
    return Knot(robot, **{name: cs.SX(cs.DM(values[name])) for name in layout.rows} | _columns(changes))


def _columns(changes):
    return {name: cs.SX(cs.DM(np.asarray(value, dtype=float).ravel())) for name, value in changes.items()}


def moved(knot, by):
    """The knot with all of its contact points somewhere else [m]."""
    return replace(knot, contact_positions=knot.contact_positions + np.tile(by, len(knot.robot.contacts)))


def number(expression):
    return np.array(cs.evalf(expression)).ravel()


# ------------------------------------------------------------------------------------------ torques


def random_motion(robot, seed=0):
    """Values of two knots that follow each other, by name: no plan, but every term of the equations counts."""
    random, layout, knots = np.random.default_rng(seed), Layout.of(robot), []
    for _ in range(2):
        values = {name: random.normal(size=rows.stop - rows.start) for name, rows in layout.rows.items()}
        values["base_quaternion_xyzw"] /= np.linalg.norm(values["base_quaternion_xyzw"])
        values["contact_forces"] *= 100.0
        values["thrust"] = random.uniform(20.0, 200.0, values["thrust"].size)
        knots.append(values)
    return knots


def transform(values):
    x, y, z, w = values["base_quaternion_xyzw"]
    turned = np.eye(4)
    turned[:3, :3] = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    turned[:3, 3] = values["base_position"]
    return turned


def twist(values):
    return np.concatenate([values["base_linear_velocity"], values["base_angular_velocity"]])


def wrenches(robot, values):
    """What the world applies at feet and jets, by frame: force and moment, (6,)."""
    base, pushes = transform(values), {}
    for name, force in zip(robot.contact_names, values["contact_forces"].reshape(-1, 3), strict=True):
        pushes[name] = np.concatenate([force, np.zeros(3)])
    for jet, thrust in zip(robot.jets, values["thrust"], strict=True):
        axis = np.array(robot.kindyn.forward_kinematics(jet.frame, base, values["joint_positions"]))[:3, 2]
        pushes[jet.frame] = np.concatenate([-thrust * axis, np.zeros(3)])
    return pushes


DURATION = 0.07  # [s]


@pytest.mark.parametrize("rule", [BACKWARD_EULER, LEAPFROG], ids=lambda rule: rule.name)
def test_torque_rows_are_inverse_dynamics_at_the_instant_at_which_velocities_change(ironcub, rule):
    """By backward Euler all is of the end; by leapfrog posture and forces are the start's, velocities the mean."""
    start, end = random_motion(ironcub)
    knots = [Knot(ironcub, **_columns(values)) for values in (start, end)]
    found = number(margins.generalised_forces(Interval(*knots, cs.SX(DURATION), rule)))

    at = end if rule is BACKWARD_EULER else start
    speeds = end if rule is BACKWARD_EULER else {name: 0.5 * (start[name] + end[name]) for name in start}
    expected = ironcub.kindyn.rnea(
        transform(at),
        at["joint_positions"],
        twist(speeds),
        speeds["joint_velocities"],
        (twist(end) - twist(start)) / DURATION,
        (end["joint_velocities"] - start["joint_velocities"]) / DURATION,
        wrenches(ironcub, at),
    )
    assert found == pytest.approx(np.array(expected).ravel(), rel=1e-9, abs=1e-8)


def test_torque_rows_are_the_equation_of_motion_with_matrices_made_another_way(ironcub):
    """M ν̇ + C ν + g − Σ Jᵀ f by the mass matrix, the bias force and Jacobians, in shares of the effort limits."""
    start, end = random_motion(ironcub, seed=4)
    knots = [Knot(ironcub, **_columns(values)) for values in (start, end)]
    shares = number(margins.joint_torques(Interval(*knots, cs.SX(DURATION), LEAPFROG), parameters_of(ironcub)))

    kindyn, base, joints = ironcub.kindyn, transform(start), start["joint_positions"]
    velocities = [np.concatenate([twist(values), values["joint_velocities"]]) for values in (start, end)]
    mean = 0.5 * (velocities[0] + velocities[1])
    forces = np.array(kindyn.mass_matrix(base, joints)) @ (velocities[1] - velocities[0]) / DURATION
    forces += np.array(kindyn.bias_force(base, joints, mean[:6], mean[6:])).ravel()
    for frame, wrench in wrenches(ironcub, start).items():
        forces -= np.array(kindyn.jacobian(frame, base, joints)).T @ wrench
    assert shares * ironcub.joint_limits.effort == pytest.approx(forces[6:], rel=1e-9, abs=1e-7)


@pytest.mark.parametrize("rule", [BACKWARD_EULER, LEAPFROG], ids=lambda rule: rule.name)
def test_derivatives_of_the_torque_rows_are_those_of_finite_differences(ironcub, rule):
    layout, start_and_end = Layout.of(ironcub), random_motion(ironcub, seed=2)
    z = cs.SX.sym("z", 2 * layout.size + 1)
    knots = [Knot(ironcub, **layout.read(part)) for part in (z[: layout.size], z[layout.size : -1])]
    rows = margins.joint_torques(Interval(*knots, z[-1], rule), parameters_of(ironcub))
    function = cs.Function("rows", [z], [rows, cs.jacobian(rows, z)])
    at = np.concatenate([*(values[name] for values in start_and_end for name in layout.rows), [DURATION]])
    random = np.random.default_rng(5)
    for _ in range(5):
        along = random.normal(size=at.size) * np.append(np.ones(at.size - 1), 0.01)
        before, after = (np.array(function(at + sign * 1e-6 * along)[0]).ravel() for sign in (-1, 1))
        slope = np.array(function(at)[1] @ cs.DM(along)).ravel()
        assert slope == pytest.approx((after - before) / 2e-6, rel=1e-5, abs=1e-4)


def test_a_joint_without_an_effort_limit_has_no_row(ironcub):
    effort = ironcub.joint_limits.effort.copy()
    effort[[0, 5]] = np.inf
    free = replace(ironcub, joint_limits=replace(ironcub.joint_limits, effort=effort))
    names = [name for index, name in enumerate(ironcub.joint_names) if index not in (0, 5)]
    assert list(margins.JOINT_TORQUES.labels(parameters_of(free))) == names


# ------------------------------------------------------------------------------------------ feet that stand


def test_a_row_of_the_centre_of_pressure_is_zero_just_where_it_is_on_the_edge_of_the_shrunk_sole(ironcub):
    """On one foot that carries the weight, rows are how far inside each edge it is over L, as seen from above."""
    share, random = 0.75, np.random.default_rng(3)
    parameters, home = parameters_of(ironcub, pressure=share), contact_positions(ironcub, ironcub.home).reshape(-1, 3)
    sole = soles(ironcub)[0]
    places = home[list(sole.members), :2]
    middle = places.mean(axis=0)
    ring = [middle + share * (places[corner] - middle) for corner in (*sole.corners, sole.corners[0])]
    on_edges = [np.full(4, (1.0 - share) / 4) for _ in range(4)]
    for loads, (here, there) in zip(on_edges, pairwise((*sole.corners, sole.corners[0])), strict=True):
        loads[[here, there]] += 0.5 * share
    anywhere = random.dirichlet(np.ones(4), size=20)
    for index, loads in enumerate([*on_edges, *anywhere]):
        forces = np.zeros((8, 3))
        forces[list(sole.members)] = np.column_stack([0.1 * loads, -0.2 * loads, loads]) * ironcub.weight
        rows = number(margins.centre_of_pressure(knot_at_home(ironcub, contact_forces=forces), parameters))
        inside = list(margin_of(loads @ places, ring))
        assert rows[:4] * ironcub.standing_height == pytest.approx(inside, abs=1e-6)
        assert rows[4:] == pytest.approx(np.zeros(4))  # nothing is on the other foot
        if index < 4:
            assert rows[index] == pytest.approx(0.0, abs=1e-6)


def margin_of(point, ring):
    """How far inside each edge of a convex ring a point is [m], whichever way the ring goes round."""
    middle = np.mean(ring[:-1], axis=0)
    for here, there in pairwise(ring):
        normal = np.array([-(there - here)[1], (there - here)[0]]) / np.linalg.norm(there - here)
        yield (point - here) @ normal * np.sign((middle - here) @ normal)


def test_a_foot_without_load_is_inside_the_set_and_the_rows_are_labelled_by_edges(ironcub):
    parameters = parameters_of(ironcub)
    rows = number(margins.centre_of_pressure(knot_at_home(ironcub), parameters))
    labels = margins.CENTRE_OF_PRESSURE.labels(parameters)
    assert len(labels) == rows.size == 8
    assert rows.min() == 0.0 > -PRESSURE_SLACK
    assert [label.count("l_sole_") for label in labels] == [2] * 4 + [0] * 4
    assert labels[4].startswith("r_sole_")
    assert len(set(labels)) == 8


def test_a_robot_of_point_feet_has_no_rows_of_soles(tmp_path):
    robot = solo(tmp_path)
    parameters = parameters_of(robot)
    assert number(margins.centre_of_pressure(knot_at_home(robot), parameters)).size == 0
    assert margins.CENTRE_OF_PRESSURE.labels(parameters) == ()


@pytest.mark.parametrize(("margin", "share"), [(0.85, 0.85), (0.5, 0.5), (0.0, 1.0)])
def test_a_plan_may_use_its_share_of_the_friction_alone(ironcub, margin, share):
    """A force that pulls aside with just that share of μ n is on the edge; without a margin it is all of it."""
    parameters = parameters_of(ironcub, friction=margin)
    aside = share * ironcub.friction * 50.0
    forces = np.tile([aside, 0.0, 50.0], (8, 1))
    rows = number(margins.friction_cone(knot_at_home(ironcub, contact_forces=forces), parameters)).reshape(8, 4)
    assert rows.min(axis=1) == pytest.approx(np.zeros(8), abs=1e-9)
    forces[:, 0] *= 1.01
    rows = number(margins.friction_cone(knot_at_home(ironcub, contact_forces=forces), parameters)).reshape(8, 4)
    assert (rows.min(axis=1) < -1e-3).all()


# ------------------------------------------------------------------------------------------ feet that move


def test_a_point_comes_down_as_fast_as_its_margin_and_height_say(ironcub):
    """From 3 cm to 1 cm in 0.1 s: 0.2 m/s, where v + κ d with d = 1 cm is allowed."""
    parameters = parameters_of(ironcub, touch_down_speed=0.05)
    length, gravity = ironcub.standing_height, 9.80665
    before, after = knot_at_home(ironcub, 0.03), knot_at_home(ironcub, 0.01)
    allowed = 0.05 * np.sqrt(gravity * length) + DESCENT_RATE * np.sqrt(gravity / length) * 0.01
    rows = number(margins.touch_down(Interval(before, after, cs.SX(0.1), LEAPFROG), parameters))
    assert rows == pytest.approx(np.full(8, 0.1 * (allowed - 0.2) / length), abs=1e-5)
    slow = cs.SX(0.02 / allowed)  # the time in which it would be just as fast as it may
    assert number(margins.touch_down(Interval(before, after, slow, LEAPFROG), parameters)) == pytest.approx(
        np.zeros(8), abs=1e-5
    )
    up = number(margins.touch_down(Interval(after, before, cs.SX(0.1), LEAPFROG), parameters))
    assert (up > 0.0).all()  # it may rise as it likes


@pytest.mark.parametrize("surface", [mt.FlatGround(), mt.FlatGround(height=0.3), mt.Plane(slope=0.3)])
def test_a_sole_that_is_level_with_its_ground_is_not_tilted(ironcub, surface):
    posture = standing_posture(ironcub, surface, (0.0, 0.0, surface_height(surface) + 0.57))
    points = contact_positions(ironcub, posture)
    knot = knot_at_home(ironcub, contact_positions=points)
    parameters = parameters_of(ironcub, surface)
    assert number(costs.foot_tilt(knot, parameters)) == pytest.approx(np.zeros(8), abs=1e-5)
    normal = number(parameters.surface.normal(cs.SX(cs.DM(points[:3]))))
    assert number(costs.foot_tilt(moved(knot, 0.1 * normal), parameters)) == pytest.approx(np.zeros(8), abs=1e-5)


def surface_height(surface):
    return getattr(surface, "height", 0.0)


def test_a_tilted_sole_is_charged_by_the_heights_of_its_points_over_the_standing_height(ironcub):
    home = contact_positions(ironcub, ironcub.home).reshape(-1, 3)
    left = [contact.foot == "left" for contact in ironcub.contacts]
    tilted = home.copy()
    tilted[left, 2] += 0.1 * (home[left, 0] - home[left, 0].mean())  # by 0.1 about y
    rows = number(costs.foot_tilt(knot_at_home(ironcub, contact_positions=tilted), parameters_of(ironcub)))
    expected = 0.1 * (home[:, 0] - home[left, 0].mean()) / ironcub.standing_height * left
    assert rows == pytest.approx(expected, abs=1e-5)


def test_skimming_falls_with_height_and_is_nothing_for_what_stands_or_goes_up(ironcub):
    parameters, duration = parameters_of(ironcub), cs.SX(0.1)

    def charged(height, by):
        before = knot_at_home(ironcub, height)
        return number(costs.skimming(Interval(before, moved(before, by), duration, LEAPFROG), parameters)).reshape(8, 2)

    assert charged(0.0, [0.0, 0.0, 0.0]) == pytest.approx(np.zeros((8, 2)))
    assert charged(0.0, [0.0, 0.0, 0.05]) == pytest.approx(np.zeros((8, 2)))
    speed = 0.5 / np.sqrt(9.80665 * ironcub.standing_height)  # 5 cm in 0.1 s
    scale = costs.SKIM_HEIGHT * ironcub.standing_height
    for height in (0.0, 0.5 * scale, scale, 5.0 * scale):
        expected = np.tile([speed / np.sqrt(1.0 + (height / scale) ** 2), 0.0], (8, 1))
        assert charged(height, [0.05, 0.0, 0.0]) == pytest.approx(expected, abs=1e-5)


# ------------------------------------------------------------------------------------------ in a problem


def test_margins_of_zero_leave_their_rows_out(ironcub):
    short = replace(mt.scenarios.landing(), knots=3)
    assert set(ROWS_OF.values()) <= set(mt.build(ironcub, short).rows)
    bare = mt.build(ironcub, replace(short, margins=Margins.none()))
    assert not set(ROWS_OF.values()) & set(bare.rows)


@pytest.mark.parametrize(("margin", "rows"), ROWS_OF.items())
def test_each_margin_has_rows_of_its_own(ironcub, margin, rows):
    alone = replace(Margins.none(), **{margin: getattr(Margins(), margin)})
    problem = mt.build(ironcub, replace(mt.scenarios.landing(), knots=3, margins=alone))
    assert set(ROWS_OF.values()) & set(problem.rows) == {rows}


SQUAT = replace(
    mt.scenarios.take_off(),
    name="squat",
    knots=10,
    interval_min=0.1,
    interval_max=0.1,
    final_com=(-0.02, 0.06, 0.54),
    terminal=mt.Terminal.STANDING,
    jets=False,
)
TIGHT = Margins(torque=0.48, friction=0.4, pressure=0.6, distance=0.085)


@pytest.fixture(scope="module")
def squats(ironcub):
    """A squat to the front left, without margins and with some that it does not keep by itself."""
    return [mt.solve(mt.build(ironcub, replace(SQUAT, margins=some))) for some in (Margins.none(), TIGHT)]


def used(robot, motion):
    """How much of each margin a motion needs, by other ways than the rows."""
    robot, effort = robot.with_jets(()), robot.joint_limits.effort
    torques = largest_torques(robot, motion)
    shares = [abs(one.torque) / effort[robot.joint_names.index(one.joint)] for one in torques]
    forces = motion.per_contact("contact_forces")[:, :, 1:-1]
    friction = (np.abs(forces[:, :2]) / forces[:, 2:]).max() / robot.friction
    pressure = [pressure_shares(robot, sole, forces[list(sole.members), 2]).max() for sole in soles(robot)]
    distances = capsule_pairs.distances(robot.kindyn, motion.joint_positions, robot.near_capsule_pairs)
    return {
        "torque": max(shares),
        "friction": friction,
        "pressure": max(pressure),
        "distance": distances.min() / robot.standing_height,
    }


def test_a_plan_keeps_all_of_its_margins_and_without_them_it_would_not(ironcub, squats):
    bare, kept = (used(ironcub, some.trajectory) for some in squats)
    assert [some.status for some in squats] == [mt.Status.OPTIMAL] * 2
    for name in ("torque", "friction", "pressure"):
        assert kept[name] < getattr(TIGHT, name) + 1e-4, name
        assert bare[name] > getattr(TIGHT, name) + 1e-2, name
    hair = 1e-3 / ironcub.standing_height  # by which the smooth distance is above the exact one
    assert bare["distance"] < TIGHT.distance - hair < kept["distance"]


# ------------------------------------------------------------------------------------------ where it is pulled to


def test_a_robot_that_stands_up_is_pulled_to_the_posture_of_the_end(ironcub):
    """A crouch to a stand: the posture costs nothing where it ends, and the plan ends much nearer to it."""
    low, high = (0.0, 0.0, 0.48), (0.0, 0.0, 0.56)
    times = {"knots": 10, "interval_min": 0.2, "interval_max": 0.2}
    stand_up = replace(SQUAT, name="stand up", **times, initial_com=low, final_com=high, margins=Margins.none())
    problem = mt.build(ironcub, stand_up)
    start, end = (standing_posture(ironcub, stand_up.surface, com).joint_positions for com in (low, high))
    assert np.abs(start - end).max() > 0.3

    def charged(joints):
        x = problem.guess * problem.scale
        problem.layout.read_horizon(x)["joint_positions"][:] = joints[:, None]
        return problem.costs(x / problem.scale)["posture"]

    assert charged(end) == pytest.approx(0.0, abs=1e-6)
    assert charged(start) > 1e4
    solution = mt.solve(problem)
    assert solution.status is mt.Status.OPTIMAL
    reached = solution.trajectory.joint_positions[:, -1]
    assert np.linalg.norm(reached - end) < 0.2 * np.linalg.norm(reached - start)


@pytest.mark.parametrize("name", ["landing", "walk-to-fly", "jump"])
def test_other_motions_are_pulled_to_the_standing_posture_that_they_have(ironcub, name):
    """A landing to that of its end, a walk into the air and a jump to that of their start."""
    scenario = replace(mt.scenarios.find(name), knots=6)
    com = scenario.final_com if name == "landing" else scenario.initial_com
    joints = standing_posture(ironcub, scenario.surface, com).joint_positions
    problem = mt.build(ironcub, scenario)
    x = problem.guess * problem.scale
    problem.layout.read_horizon(x)["joint_positions"][:] = joints[:, None]
    assert problem.costs(x / problem.scale)["posture"] == pytest.approx(0.0, abs=1e-9)


# ------------------------------------------------------------------------------------------ where it starts


def test_a_robot_that_jumps_is_guessed_to_be_thrown_there(ironcub):
    """The CoM reaches the height at mid-horizon in free fall; feet go with it, and in the air nothing pushes."""
    scenario = mt.scenarios.jump()
    robot = ironcub.with_jets(())
    standing, layout = standing_posture(robot, scenario.surface, scenario.initial_com), Layout.of(robot)
    view = layout.read(start_guess(robot, scenario, standing, layout))
    height, middle, step = view["com_position"][2], scenario.knots // 2, scenario.interval_max
    rise = height - scenario.initial_com[2]
    assert height.max() == height[middle] == pytest.approx(scenario.mid_height_min)
    air = np.flatnonzero(rise > 0.0)
    assert air.tolist() == list(range(air[0], air[-1] + 1))
    assert np.diff(height[air], 2) / step**2 == pytest.approx(np.full(air.size - 2, -9.80665))
    assert view["com_velocity"][2, air] == pytest.approx(-9.80665 * step * (air - middle))
    lowest = view["contact_positions"].reshape(8, 3, -1)[:, 2]
    assert lowest == pytest.approx(np.tile(rise, (8, 1)), abs=2e-6)
    assert view["base_position"][2] - standing.base_position[2] == pytest.approx(rise)
    forces = view["contact_forces"].reshape(8, 3, -1)
    assert np.abs(forces[:, :, air]).max() == 0.0
    ground = np.setdiff1d(np.arange(height.size), air)
    assert forces[:, 2, ground].sum(axis=0) == pytest.approx(np.full(ground.size, robot.weight))


def test_what_is_high_enough_already_is_not_thrown(ironcub):
    scenario = replace(mt.scenarios.jump(), mid_height_min=0.5)
    robot = ironcub.with_jets(())
    rise, speed = thrown(robot, scenario, flights(robot, scenario, Schedule.of(robot, scenario), 0.57))
    assert (np.abs(rise).max(), np.abs(speed).max()) == (0.0, 0.0)


def test_the_guess_of_a_posture_puts_its_contact_points_where_the_feet_are(ironcub):
    scenario = mt.scenarios.jump()
    robot = ironcub.with_jets(())
    standing, layout = standing_posture(robot, scenario.surface, scenario.initial_com), Layout.of(robot)
    view = layout.read(start_guess(robot, scenario, standing, layout))
    for knot in (0, scenario.knots // 2):
        posture = replace(standing, base_position=view["base_position"][:, knot])
        assert contact_positions(robot, posture) == pytest.approx(view["contact_positions"][:, knot], abs=1e-6)
        com = robot.kindyn.CoM_position(posture.base_transform, posture.joint_positions)
        assert np.array(com).ravel() == pytest.approx(view["com_position"][:, knot], abs=1e-7)

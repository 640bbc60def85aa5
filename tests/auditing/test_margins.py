"""How far motions made by hand stay from the edge of what a robot can do, against numbers that are known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import linprog

from multimodal_to import scenarios
from multimodal_to.auditing import PROPERTIES, Of
from multimodal_to.auditing.audit import audit
from multimodal_to.auditing.findings import Motion
from multimodal_to.auditing.margins import GLIDE_DISTANCE, GLIDE_HEIGHT, margin_findings, pressure_shares
from multimodal_to.auditing.properties import judged
from multimodal_to.models.contact import DESCENT_RATE
from multimodal_to.models.sole import PRESSURE_SLACK, Sole, soles
from multimodal_to.scenarios.data import to_json
from multimodal_to.scenarios.margins import Margins
from multimodal_to.trajectory import QUANTITIES, Trajectory, rules
from multimodal_to.trajectory.derived import frame_poses, loaded_force
from solo import solo

STEP = 0.1  # [s]
KNOTS = 12
KNOT = 5


def moved(robot, x=None, z=None, load=1.0, rule=rules.LEAPFROG):
    """Return a robot in its home posture whose feet all move alike.

    Args:
        robot: which.
        x: of the base, from home [m], (knots + 1,).
        z: of the feet above the ground [m], (knots + 1,).
        load: of all contact points together, as a share of the weight [1], or by knot, (knots + 1,).
        rule: that the file states.
    """
    time = STEP * np.arange(KNOTS + 1)
    bodies = {"robot": 1, "joint": len(robot.joint_names), "contact": len(robot.contact_names), "jet": len(robot.jets)}
    arrays = {name: np.zeros((quantity.rows * bodies[quantity.of], time.size)) for name, quantity in QUANTITIES.items()}
    arrays["base_position"][:] = robot.home.base_position[:, None]
    arrays["base_quaternion_xyzw"][:] = robot.home.base_quaternion_xyzw[:, None]
    arrays["joint_positions"][:] = robot.home.joint_positions[:, None]
    arrays["contact_forces"].reshape(bodies["contact"], 3, -1)[:, 2] = load * robot.weight / bodies["contact"]

    def trajectory():
        names = {"joint_names": robot.joint_names, "contact_names": robot.contact_names, "jet_names": robot.jet_names}
        return Trajectory(robot=robot.name, scenario="by hand", time=time, rule=rule, **names, **arrays)

    feet = np.array([frame_poses(robot, trajectory(), name)[:, :3, 3] for name in robot.contact_names])
    arrays["base_position"][2] += (0.0 if z is None else z) - feet[:, 0, 2].min()
    arrays["base_position"][0] += 0.0 if x is None else x
    feet = [frame_poses(robot, trajectory(), name)[:, :3, 3].T for name in robot.contact_names]
    arrays["contact_positions"] = np.concatenate(feet)
    coms = robot.kindyn.CoM_position_fun()
    arrays["com_position"] = np.hstack(
        [
            np.array(coms(np.block([[np.eye(3), base[:, None]], [np.zeros(3), 1.0]]), robot.home.joint_positions))
            for base in arrays["base_position"].T
        ]
    )
    return trajectory()


def task(**margins):
    return replace(scenarios.take_off(), margins=replace(Margins.none(), **margins))


def found(robot, trajectory, scenario):
    return {entry.name: entry for entry in margin_findings(Motion.of(robot, trajectory), scenario)}


def pressed(robot, places):
    """Return a motion in which all weight is on the left foot, with its centre of pressure at places of its sole.

    Args:
        robot: whose soles have four corners.
        places: along the sole's first axis, as a share of the way to its edge [1], (knots + 1,).
    """
    trajectory = moved(robot)
    (sole,) = (sole for sole in soles(robot) if sole.foot == "left")
    forces = np.zeros((len(robot.contacts), 3, places.size))
    signs = np.sign(sole.places[:, 0])
    for member, sign in zip(sole.members, signs, strict=True):
        forces[member, 2] = 0.25 * robot.weight * (1.0 + sign * places)
    return sole, replace(trajectory, contact_forces=forces.reshape(-1, places.size))


# ------------------------------------------------------------ centre of pressure


def test_a_centre_of_pressure_is_where_the_weight_is(ironcub):
    """On one foot the place p of the sole's half length a reads p, less what is let go: slack m g L / (a m g)."""
    places = np.linspace(-1.0, 1.0, KNOTS + 1)
    sole, trajectory = pressed(ironcub, places)
    normal = trajectory.per_contact("contact_forces")[list(sole.members), 2]
    half = np.abs(sole.places[:, 0]).max()
    expected = np.maximum(np.abs(places) - PRESSURE_SLACK * ironcub.standing_height / half, 0.0)
    np.testing.assert_allclose(pressure_shares(ironcub, sole, normal), expected, atol=1e-9)


def test_a_foot_that_stands_on_its_edge_is_found_and_one_that_stands_inside_holds(ironcub):
    places = np.full(KNOTS + 1, 0.6)
    scenario = task(pressure=0.75)
    limit = PROPERTIES["centre of pressure"].limit_for(ironcub, scenario)
    assert limit == pytest.approx(0.75, abs=1e-3)
    _, inside = pressed(ironcub, places)
    assert 0.5 < found(ironcub, inside, scenario)["centre of pressure"].worst < limit
    places[KNOT] = -0.95
    _, tipping = pressed(ironcub, places)
    worst = found(ironcub, tipping, scenario)["centre of pressure"]
    assert limit < worst.worst < 0.95
    assert (worst.knot, worst.body) == (KNOT, "left")


def test_a_foot_with_hardly_any_load_counts_as_zero(ironcub):
    sole = soles(ironcub)[0]
    normal = np.zeros((4, 2))
    normal[0] = PRESSURE_SLACK * ironcub.weight, 0.0  # on a corner alone
    np.testing.assert_array_equal(pressure_shares(ironcub, sole, normal), 0.0)


def test_the_share_is_the_gauge_of_the_sole_by_linear_programming(ironcub):
    """Against the least Σ λ with Σ λ corner = centre of pressure, for loads beside which the slack is nothing."""
    generator = np.random.default_rng(7)
    three = np.array([[0.09, 0.01], [-0.03, 0.04], [-0.06, -0.05]])  # toes on one side, a heel, none opposite another
    lopsided = Sole(foot="left", members=(0, 1, 2), places=three - three.mean(axis=0), corners=(0, 1, 2))
    for sole in (*soles(ironcub), lopsided):
        normal = 1e9 * generator.uniform(0.0, 1.0, (len(sole.members), 20)) ** 3
        corners = sole.places[list(sole.corners)].T
        for share, load in zip(pressure_shares(ironcub, sole, normal), normal.T, strict=True):
            place = sole.places.T @ load / load.sum()
            answer = linprog(np.ones(corners.shape[1]), A_eq=corners, b_eq=place)
            assert share == pytest.approx(answer.fun, abs=1e-6)


def test_without_a_margin_a_centre_of_pressure_may_be_anywhere_in_the_sole(ironcub):
    entry = PROPERTIES["centre of pressure"]
    for scenario in (None, task()):
        assert entry.limit_for(ironcub, scenario) == pytest.approx(1.0, abs=1e-3)
        _, tipping = pressed(ironcub, np.ones(KNOTS + 1))
        assert found(ironcub, tipping, scenario)[entry.name].worst < 1.0


# ------------------------------------------------------------ touch-down


def coming_down(robot, speed):
    """Return heights that fall as fast as a touch-down speed [m/s] allows, from 0.1 L to the ground."""
    rate, heights = DESCENT_RATE * robot.units.frequency, [0.1 * robot.standing_height]
    for _ in range(KNOTS):
        heights.append(max((heights[-1] - STEP * speed) / (1.0 + STEP * rate), 0.0))
    return np.array(heights)


def test_a_foot_that_slows_down_as_it_comes_down_has_the_speed_of_its_last_bit(ironcub):
    scenario = task(touch_down_speed=0.04)
    speed = 0.04 * ironcub.units.of("m/s")
    limit = PROPERTIES["touch-down speed"].limit_for(ironcub, scenario)
    assert limit == pytest.approx(speed, rel=0.01)
    heights = coming_down(ironcub, speed)
    assert heights[-1] == 0.0
    gentle = found(ironcub, moved(ironcub, z=heights, load=0.0), scenario)["touch-down speed"]
    assert gentle.worst == pytest.approx(speed, abs=1e-6)
    assert gentle.worst < limit


def test_a_foot_that_falls_to_the_ground_is_found_where_it_lands(ironcub):
    heights = np.maximum(0.3 * STEP * (KNOT - np.arange(KNOTS + 1)), 0.0)  # 0.3 m/s to the ground at the knot
    scenario = task(touch_down_speed=0.04)
    worst = found(ironcub, moved(ironcub, z=heights, load=0.0), scenario)["touch-down speed"]
    assert worst.worst == pytest.approx(0.3, abs=1e-3)
    assert worst.knot == KNOT
    assert worst.worst > PROPERTIES["touch-down speed"].limit_for(ironcub, scenario)
    rising = found(ironcub, moved(ironcub, z=heights[::-1], load=0.0), scenario)["touch-down speed"]
    assert rising.worst <= 0.0


# ------------------------------------------------------------ gliding


@pytest.mark.parametrize("rule", [rules.BACKWARD_EULER, rules.STAGGERED, rules.LEAPFROG])
def test_a_foot_that_skims_the_ground_is_found_and_one_that_is_lifted_is_not(ironcub, rule):
    scenario = task(torque=0.9)
    way = np.zeros(KNOTS + 1)
    way[KNOT - 1 :], way[KNOT:] = 0.01, 0.03  # in two intervals
    low, high = (share * GLIDE_HEIGHT * ironcub.standing_height for share in (0.5, 1.5))
    worst = found(ironcub, moved(ironcub, way, low, load=0.0, rule=rule), scenario)["gliding distance"]
    assert worst.worst == pytest.approx(0.03)
    assert worst.knot >= KNOT
    assert worst.worst > PROPERTIES["gliding distance"].limit_for(ironcub, scenario)
    assert found(ironcub, moved(ironcub, way, high, load=0.0, rule=rule), scenario)["gliding distance"].worst == 0.0
    assert found(ironcub, moved(ironcub, way, low, load=1.0, rule=rule), scenario)["gliding distance"].worst == 0.0


def test_a_foot_that_is_lifted_or_set_down_over_an_interval_does_not_glide(ironcub):
    way, height = np.zeros(KNOTS + 1), np.zeros(KNOTS + 1)
    way[KNOT:], way[KNOT + 1 :] = 0.02, 0.04
    height[KNOT] = 2.0 * GLIDE_HEIGHT * ironcub.standing_height  # up in one interval, down in the next
    assert found(ironcub, moved(ironcub, way, height, load=0.0), task(torque=0.9))["gliding distance"].worst == 0.0


def test_a_foot_that_stands_when_an_interval_begins_does_not_glide_over_it(ironcub):
    """Under leapfrog a force acts half an interval after its knot; under backward Euler it ends there."""
    way, load = np.zeros(KNOTS + 1), np.zeros(KNOTS + 1)
    way[KNOT:] = 0.02
    load[KNOT - 1] = 2.0 * loaded_force(ironcub) * len(ironcub.contacts) / ironcub.weight
    ways = {
        rule: found(ironcub, moved(ironcub, way, load=load, rule=rule), task(torque=0.9))["gliding distance"].worst
        for rule in (rules.BACKWARD_EULER, rules.LEAPFROG)
    }
    assert ways == {rules.BACKWARD_EULER: pytest.approx(0.02), rules.LEAPFROG: 0.0}


def test_a_foot_that_touches_down_between_two_glides_is_judged_by_the_longer_one(ironcub):
    way, load = np.linspace(0.0, 0.01 * KNOTS, KNOTS + 1), np.zeros(KNOTS + 1)
    load[4], way[6:] = 1.0, way[6:] + 0.1  # it stands over the intervals that begin and end at knot 4
    worst = found(ironcub, moved(ironcub, way, load=load), task(torque=0.9))["gliding distance"]
    assert worst.worst == pytest.approx(0.01 * (KNOTS - 5) + 0.1)
    assert worst.knot == KNOTS


# ------------------------------------------------------------ throttles


@pytest.mark.parametrize("before", [0.0, 100.0], ids=["up", "down"])
def test_a_throttle_that_jumps_is_found_and_one_that_a_turbine_follows_holds(ironcub, before):
    trajectory, scenario = moved(ironcub), task(torque=0.9)
    throttle = np.tile(np.linspace(0.0, 100.0, KNOTS + 1), (len(ironcub.jets), 1))
    entry = PROPERTIES["throttle rate"]
    steady = found(ironcub, replace(trajectory, throttle=throttle), scenario)[entry.name]
    assert steady.worst == pytest.approx(100.0 / KNOTS / STEP)
    assert steady.worst < entry.limit_for(ironcub, scenario)
    throttle[1, :KNOT], throttle[1, KNOT:] = before, 100.0 - before
    jump = found(ironcub, replace(trajectory, throttle=throttle), scenario)[entry.name]
    assert jump.worst == pytest.approx(100.0 / STEP)
    assert jump.worst > entry.limit_for(ironcub, scenario)
    assert (jump.knot, jump.body) == (KNOT, ironcub.jet_names[1])


@pytest.mark.parametrize("index", [0, 2], ids=["smaller", "larger"])
def test_the_turbines_are_slower_than_the_limit_of_their_throttles(ironcub, index):
    """The thrust that follows a step has its time constant, 1 / √(product of the poles), at half thrust."""
    model, size = ironcub.jets[index].model, 1e-3
    thrust = 0.5 * ironcub.jets[index].thrust_max
    throttle = model.steady_throttle(thrust)
    stiffness = (
        model.acceleration(thrust - size, 0.0, throttle) - model.acceleration(thrust + size, 0.0, throttle)
    ) / (2.0 * size)
    assert stiffness**-0.5 == pytest.approx(0.7, abs=0.06)
    assert 100.0 / PROPERTIES["throttle rate"].limit < stiffness**-0.5


# ------------------------------------------------------------ when, and by which limits


def test_margins_are_judged_where_they_are_asked_for(ironcub, tmp_path):
    every = {"centre of pressure", "touch-down speed", "gliding distance", "throttle rate"}
    assert every & set(judged(task(touch_down_speed=0.1), ironcub)) == every
    assert every & set(judged(task(torque=0.9), ironcub)) == every - {"touch-down speed"}
    assert every & set(judged(task(), ironcub)) == {"centre of pressure"}
    assert every & set(judged(None, ironcub)) == {"centre of pressure"}
    assert every & set(judged(task(touch_down_speed=0.1), solo(tmp_path))) == every - {"centre of pressure"}


def test_the_audit_takes_the_margins_that_a_file_keeps(ironcub):
    _, trajectory = pressed(ironcub, np.full(KNOTS + 1, 0.9))
    for share, holds in ((0.75, False), (0.95, True)):
        kept = replace(trajectory, scenario_json=to_json(task(pressure=share)))
        assert audit(ironcub, kept)["centre of pressure"].holds is holds


OF_THE_IRONCUB = {
    "force balance": 1e-2,
    "moment balance": 1e-2,
    "torque beyond effort": 1e-3,
    "unexplained base force": 4.39,
    "unexplained base moment": 1.0,
    "gap of contact_forces": 1e-3,
    "normal force × height": 1e-2,
    "slip under load": 1e-3,
    "thrust off CVODES, interval": 5.0,
    "thrust off CVODES, horizon": 5.0,
    "touch-down speed": 0.04 * 2.378,
    "gliding distance": 0.0231,
    "start: force balance": 1e-2,
    "end: moment balance": 1e-2,
}
"""Limits of the bundled robot of 439 N and 0.577 m, in the units of their properties."""


def test_limits_of_the_ironcub_are_round_numbers_in_its_units(ironcub):
    scenario = scenarios.take_off()
    limits = {name: PROPERTIES[name].limit_for(ironcub, scenario) for name in OF_THE_IRONCUB}
    assert limits == {name: pytest.approx(limit, rel=0.03) for name, limit in OF_THE_IRONCUB.items()}


def test_limits_are_as_strict_for_a_small_robot_as_for_a_large_one(ironcub, tmp_path):
    small, scenario = solo(tmp_path), scenarios.take_off()
    lighter, shorter = small.weight / ironcub.weight, small.standing_height / ironcub.standing_height
    shares = {Of.WEIGHT: lighter, Of.HEIGHT: shorter, Of.MOMENT: lighter * shorter, Of.SPEED: shorter**0.5}
    by_points = len(ironcub.contacts) / len(small.contacts)
    shares[Of.POINT_MOMENT] = by_points * lighter * shorter
    sizes = {"m": shorter, "m/s": shorter**0.5, "N": lighter, "N/s": lighter / shorter**0.5, "1": 1.0, "rad": 1.0}
    points = {"N": by_points * lighter}
    assert lighter < 0.1
    for entry in PROPERTIES.values():
        units = {Of.SIZE: sizes, Of.POINT: points}.get(entry.of, {})
        if entry.of in shares or entry.unit in units:
            share = shares[entry.of] if entry.of in shares else units[entry.unit]
            large = entry.limit_for(ironcub, scenario)
            assert entry.limit_for(small, scenario) == pytest.approx(share * large, rel=1e-3), entry.name
    assert {entry.of for entry in PROPERTIES.values()} == set(Of)


def test_a_small_robot_that_skates_does_not_pass_by_the_limits_of_a_large_one(ironcub, tmp_path):
    """Feet that carry the whole weight slip by 0.8 mm an interval, and 5e-3 N hold nothing up."""
    small = solo(tmp_path)
    for robot, holds in ((ironcub, True), (small, False)):
        skating = moved(robot, x=np.linspace(0.0, 8e-4 * KNOTS, KNOTS + 1), load=1.0 - 5e-3 / robot.weight)
        report = audit(robot, skating)
        assert report["slip under load"].worst == pytest.approx(8e-4)
        assert report["force balance"].worst == pytest.approx(5e-3, rel=1e-6)
        assert [report[name].holds for name in ("slip under load", "force balance")] == [holds, holds]


def test_ways_of_a_foot_are_in_the_robots_own_unit(ironcub, tmp_path):
    entry = PROPERTIES["gliding distance"]
    for robot in (ironcub, solo(tmp_path)):
        assert entry.limit_for(robot, None) == pytest.approx(GLIDE_DISTANCE * robot.standing_height)

"""Each property of the audit is violated on purpose, and the audit says so, where it is."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from multimodal_to import scenarios
from multimodal_to.auditing import PROPERTIES, check_allowances
from multimodal_to.auditing.audit import audit
from multimodal_to.auditing.properties import judged
from multimodal_to.errors import InputError
from multimodal_to.models.contact import FrictionCone
from multimodal_to.models.terrain import FlatGround, Plane, Stairs
from multimodal_to.scenarios import (
    ContactState,
    ContactStretch,
    FrameTarget,
    JetFailure,
    Keyframe,
    Limits,
    Momentum,
    Start,
    Terminal,
    Wall,
)
from multimodal_to.trajectory import rules
from synthetic import take_off as take_off_by_hand

KNOT = 20


def spoil(trajectory, name, row, amount, knot=KNOT):
    array = getattr(trajectory, name).copy()
    array[row, knot] += amount
    return replace(trajectory, **{name: array})


@pytest.mark.parametrize(
    ("property_name", "quantity", "row", "amount"),
    [
        ("CoM consistency", "com_position", 1, 1e-4),
        ("momentum consistency", "angular_momentum", 2, 1e-2),
        ("contact point consistency", "contact_positions", 4, 1e-4),
        ("quaternion norm", "base_quaternion_xyzw", 3, 1e-4),
        ("force balance", "contact_forces", 5, 1.0),
        ("moment balance", "contact_forces", 5, 5.0),
        ("torque beyond effort", "joint_velocities", 20, 50.0),
        ("unexplained base force", "contact_forces", 5, 20.0),
        ("unexplained base moment", "contact_forces", 5, 20.0),
        ("gap of com_velocity", "com_acceleration", 0, 1e-2),
        ("gap of joint_positions", "joint_velocities", 7, 1e-2),
        ("gap of base orientation", "base_angular_velocity", 0, 1e-2),
        ("gap of thrust", "thrust_rate", 1, 1.0),
        ("thrust dynamics", "throttle", 1, -1.0),
        ("pulling normal force", "contact_forces", 2, -500.0),
        ("friction beyond cone", "contact_forces", 0, 100.0),
        ("joint range", "joint_positions", 14, 3.0),
        ("joint speed", "joint_velocities", 3, 10.0),
        ("thrust range", "thrust", 2, 300.0),
        ("throttle range", "throttle", 0, 50.0),
    ],
)
def test_a_spoiled_quantity_is_found_where_it_is(ironcub, take_off, property_name, quantity, row, amount):
    trajectory = take_off.trajectory
    assert audit(ironcub, trajectory)[property_name].holds
    finding = audit(ironcub, spoil(trajectory, quantity, row, amount))[property_name]
    assert not finding.holds
    by_interval = property_name == "torque beyond effort" and rules.instant(trajectory.rule, quantity)
    assert finding.knot == (KNOT - 1 if by_interval else KNOT)  # an interval's velocity changes first at its start


@pytest.mark.parametrize("property_name", ["penetration", "normal force × height", "slip under load"])
def test_a_robot_that_is_moved_under_load_is_found(ironcub, take_off, property_name):
    row, amount = {"penetration": (2, -0.01), "normal force × height": (2, 0.01), "slip under load": (0, 0.01)}[
        property_name
    ]
    report = audit(ironcub, spoil(take_off.trajectory, "base_position", row, amount))
    assert not report[property_name].holds
    assert report[property_name].knot in (
        KNOT - 1,
        KNOT,
        KNOT + 1,
    )  # by leapfrog a force reaches the knots beside its own
    assert not report.holds


@pytest.mark.parametrize(
    ("rule", "high", "aside"),
    [(rules.BACKWARD_EULER, {8}, {8, 9}), (rules.STAGGERED, {8, 9}, {8, 9}), (rules.LEAPFROG, {7, 8, 9}, {7, 8, 9})],
)
def test_a_point_stands_where_its_force_reaches(ironcub, rule, high, aside):
    """The feet are up, or aside, at knot 8 alone. One force acts at a time: which ones are found?"""
    motion, home = replace(take_off_by_hand(ironcub), rule=rule), ironcub.home
    columns = np.ones((1, motion.time.size))
    posture = {
        "base_quaternion_xyzw": home.base_quaternion_xyzw[:, None] * columns,
        "joint_positions": home.joint_positions[:, None] * columns,
    }
    for axis, property_name, expected in ((2, "normal force × height", high), (0, "slip under load", aside)):
        position, found = home.base_position[:, None] * columns, set()
        position[axis, 8] += 0.01
        for knot in range(5, 12):
            forces = np.zeros_like(motion.contact_forces)
            forces[2, knot] = 50.0
            moved = replace(motion, base_position=position, contact_forces=forces, **posture)
            found |= set() if audit(ironcub, moved)[property_name].holds else {knot}
        assert found == expected


@pytest.mark.parametrize(
    ("change", "property_name"),
    [
        ({"surface": FlatGround(height=-0.01)}, "normal force × height"),
        ({"surface": FlatGround(height=0.01)}, "penetration"),
        ({"surface": Plane(slope=0.4, direction=(-1.0, 0.0))}, "friction beyond cone"),
        ({"surface": Stairs(edges=(0.0,), heights=(0.0, 0.2), direction=(0.0, 1.0))}, "penetration"),
        ({"friction": 1e-3}, "friction beyond cone"),
    ],
)
def test_the_ground_and_friction_of_the_scenario_are_the_ones_that_count(ironcub, take_off, change, property_name):
    scenario = scenarios.take_off()
    assert audit(ironcub, take_off.trajectory, scenario).holds
    assert not audit(ironcub, take_off.trajectory, replace(scenario, **change))[property_name].holds


def test_a_force_in_a_corner_of_the_pyramid_is_outside_the_second_order_cone(ironcub, take_off):
    forces = take_off.trajectory.contact_forces.copy()
    forces[:2, KNOT] = 0.9 * ironcub.friction * forces[2, KNOT]
    trajectory = replace(take_off.trajectory, contact_forces=forces)
    scenario = scenarios.take_off()
    assert audit(ironcub, trajectory, scenario)["friction beyond cone"].holds
    finding = audit(ironcub, trajectory, replace(scenario, friction_cone=FrictionCone.SECOND_ORDER))[
        "friction beyond cone"
    ]
    assert finding.worst == pytest.approx((0.9 * np.sqrt(2) - 1) * ironcub.friction * forces[2, KNOT])
    assert (finding.knot, finding.body) == (KNOT, ironcub.contact_names[0])


def test_a_trajectory_of_another_robot_is_refused(ironcub, take_off):
    names = ("other", *take_off.trajectory.joint_names[1:])
    with pytest.raises(
        InputError,
        match="the trajectory is for another robot: its joints are other, torso_roll",
    ):
        audit(ironcub, replace(take_off.trajectory, joint_names=names))


def test_the_figures_describe_the_motion(ironcub, take_off):
    report = audit(ironcub, take_off.trajectory)
    assert report.duration == pytest.approx(take_off.trajectory.duration)
    assert report.airborne >= 0.5
    assert report.final_thrust_over_weight == pytest.approx(1.0, abs=0.01)
    assert np.isfinite([finding.worst for finding in report.findings]).all()


def test_a_property_that_does_not_exist_is_refused_with_the_nearest_one(ironcub, take_off):
    report = audit(ironcub, take_off.trajectory)
    with pytest.raises(InputError, match=r"did you mean 'slip under load'\? Available: CoM consistency, "):
        report["slip under lode"]


SOLE = FrameTarget(position={"z": 0.1}, orientation=(0.0, 0.0, 0.0, 1.0))
CHANGES = {
    "as it is": {},
    "from a hover": {"start": Start.HOVER},
    "to a stand": {"terminal": Terminal.STANDING},
    "to a free end": {"terminal": Terminal.FREE},
    "over the middle": {"mid_height_min": 0.6},
    "by way of keyframes": {
        "keyframes": (
            Keyframe(knot=20, standing=True, com_min={"z": 0.5}, yaw=0.0, base_position={"x": 0.0}),
            Keyframe(
                knot=60, hover=True, joints={"l_knee": -0.1}, momentum=Momentum(linear={"z": 0}, angular={"z": 0})
            ),
            Keyframe(knot=50, base_orientation=(0.0, 0.0, 0.0, 1.0), frames={"l_sole_1": SOLE}),
            Keyframe(knot=40, com={"z": 0.9}, weight=1.0),
        ),
    },
    "with contacts": {"contacts": (ContactStretch(of="left", state=ContactState.ON, end=0.5),)},
    "with a jet that fails": {"failures": (JetFailure(jet="left arm", at=0.5),)},
    "under a ceiling": {"walls": (Wall(normal=(0.0, 0.0, -1.0), offset=-2.0),)},
    "more slowly at the end": {"limits": (Limits(base_speed=0.1, thrusts={"left arm": 100.0}, begin=0.9),)},
}


@pytest.mark.parametrize("change", CHANGES.values(), ids=CHANGES)
def test_the_table_says_which_properties_are_judged_and_in_which_order(ironcub, take_off, change):
    scenario = replace(scenarios.take_off(), **change)
    found = [finding.name for finding in audit(ironcub, take_off.trajectory, scenario).findings]
    assert found == judged(scenario, ironcub)


def test_every_property_of_the_table_is_judged_for_some_task(ironcub, take_off):
    seen = set()
    for change in CHANGES.values():
        seen |= set(judged(replace(scenarios.take_off(), **change), ironcub))
    assert seen == set(PROPERTIES)
    physics = [finding.name for finding in audit(ironcub, replace(take_off.trajectory, scenario_json="")).findings]
    assert physics == judged(None, ironcub)
    assert set(physics) - set(judged(None, ironcub.with_jets(()))) == {
        "thrust off CVODES, interval",
        "thrust off CVODES, horizon",
    }


def test_an_allowance_widens_a_limit_and_never_narrows_it(ironcub, take_off):
    scenario = replace(scenarios.take_off(), allowances={"slip under load": 0.5, "penetration": 1e-9})
    report = audit(ironcub, take_off.trajectory, scenario)
    assert report["slip under load"].limit == 0.5
    assert report["penetration"].limit == PROPERTIES["penetration"].limit
    assert report.allowances_used == ()


@pytest.mark.parametrize("name", ["torque", "end: feet off the ground"], ids=["unknown", "of another end"])
def test_an_allowance_that_the_audit_does_not_judge_is_refused_before_anything_is_solved(ironcub, take_off, name):
    scenario = replace(scenarios.take_off(), allowances={name: 1.0})
    for refuse in (
        lambda: check_allowances(ironcub, scenario),
        lambda: audit(ironcub, take_off.trajectory, scenario),
    ):
        with pytest.raises(InputError, match=f"unknown property to allow more of '{name}'"):
            refuse()
    check_allowances(ironcub, scenarios.jump())

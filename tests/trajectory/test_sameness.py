from __future__ import annotations

from dataclasses import replace

import pytest

from multimodal_to.errors import InputError, TrajectoryError
from multimodal_to.trajectory.sameness import refuse_other_robot
from synthetic import take_off


@pytest.fixture(scope="module")
def trajectory(ironcub):
    return take_off(ironcub)


def test_a_motion_is_of_its_own_robot_whatever_that_is_called(ironcub, trajectory):
    refuse_other_robot(trajectory, ironcub)
    refuse_other_robot(trajectory, replace(ironcub, name="a copy"))
    refuse_other_robot(trajectory, trajectory)


@pytest.mark.parametrize(
    ("label", "field"),
    [("joints", "joint_names"), ("contact points", "contact_names"), ("jets", "jet_names")],
)
def test_the_first_names_that_differ_are_told_on_both_sides(ironcub, trajectory, label, field):
    first, *rest = getattr(trajectory, field)
    other = replace(trajectory, **{field: ("other", *rest)})
    for expected in (ironcub, trajectory):
        with pytest.raises(InputError) as error:
            refuse_other_robot(other, expected)
        assert f"the trajectory is for another robot: its {label} are other, {rest[0]}" in str(error.value)
        assert f"; those of ironcub are {first}, {rest[0]}" in str(error.value)


def test_the_same_names_in_another_order_are_another_robot(ironcub, trajectory):
    turned = replace(trajectory, joint_names=trajectory.joint_names[::-1])
    with pytest.raises(TrajectoryError, match="the plan is for another robot: its joints are r_ankle_roll"):
        refuse_other_robot(turned, ironcub, what="the plan", error=TrajectoryError)


def test_only_the_names_asked_for_are_compared(ironcub, trajectory):
    refuse_other_robot(trajectory, ironcub.with_jets(()), of=("joints", "contact points"))
    with pytest.raises(InputError, match="those of ironcub are none"):
        refuse_other_robot(trajectory, ironcub.with_jets(()), of=("jets",))


def test_of_two_motions_the_robots_have_one_name(trajectory):
    with pytest.raises(InputError, match="is for another robot: 'stranger'; expected 'ironcub'"):
        refuse_other_robot(replace(trajectory, robot="stranger"), trajectory)

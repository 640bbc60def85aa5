"""Keyframes as data: round trips, what is taken from the ends, and what is refused in one sentence."""

from __future__ import annotations

import json
import tomllib
from dataclasses import replace

import numpy as np
import pytest
import tomli_w

import multimodal_to as mt
from multimodal_to.errors import InputError, ScenarioError
from multimodal_to.models.attitude import product
from multimodal_to.ocp.schedule import Schedule
from multimodal_to.scenarios import files as scenario_files
from multimodal_to.scenarios.data import from_dict, to_dict, to_json
from multimodal_to.scenarios.failures import failing_knots
from multimodal_to.scenarios.keyframes import Placed, attitude_at
from multimodal_to.scenarios.limits import limited
from multimodal_to.trajectory import rules

TURN = (0.0, 0.0, 1.0, 1.0)  # by a quarter to the left
EVERY = (
    mt.Keyframe(when=0.25, com={"z": 0.6}, com_min={"x": -0.1}, com_max={"x": 0.1}),
    mt.Keyframe(knot=30, base_position=(0.0, 0.1, 0.6), base_orientation=(0.0, 0.0, 1.0, 1.0), rest=True),
    mt.Keyframe(when=0.5, com="home", com_shift=(0.0, 0.1, 0.1), yaw=0.3, orientation_tolerance=0.01),
    mt.Keyframe(
        knot=40,
        joints={"l_elbow": 0.5},
        joint_tolerance=0.1,
        frames={"l_hand_palm": mt.FrameTarget(position={"z": 0.9}, orientation=(1.0, 0.0, 0.0, 0.0))},
    ),
    mt.Keyframe(knot=50, momentum=mt.Momentum(linear=(0.0, 0.0, 0.0), angular={"z": 0.1})),
    mt.Keyframe(knot=55, com={"y": 0.1}, weight=2.0),
    mt.Keyframe(knot=60, hover=True),
)


@pytest.fixture
def scenario():
    return replace(mt.scenarios.take_off(), keyframes=EVERY)


def test_keyframes_survive_data_json_and_toml(scenario, tmp_path):
    assert from_dict(to_dict(scenario)) == scenario
    assert from_dict(json.loads(to_json(scenario))) == scenario
    assert mt.scenario_files.load(mt.scenario_files.save(scenario, tmp_path / "task.toml")) == scenario
    assert hash(from_dict(to_dict(scenario))) == hash(scenario)


def test_a_file_says_keyframes_in_the_words_of_python(tmp_path):
    path = tmp_path / "task.toml"
    path.write_text(
        """
        based_on = "take-off"
        final_com_shift = [0, 0, 0.2]
        [[keyframes]]
        when = 0.5
        com = {z = 0.75}
        yaw = 0.1
        frames.l_hand_palm = {position = [0.3, 0.2, 0.9], position_tolerance = 0.01}
        [[keyframes]]
        when = "end"
        joints.l_elbow = 0.6
        momentum.angular.z = 0
        weight = 3
        """,
        encoding="utf-8",
    )
    target = mt.FrameTarget(position=(0.3, 0.2, 0.9), position_tolerance=0.01)
    assert mt.scenario_files.load(path) == replace(
        mt.scenarios.take_off(),
        name="task",
        final_com="home",
        final_com_shift=(0.0, 0.0, 0.2),
        keyframes=(
            mt.Keyframe(when=0.5, com={"z": 0.75}, yaw=0.1, frames={"l_hand_palm": target}),
            mt.Keyframe(when="end", joints={"l_elbow": 0.6}, momentum=mt.Momentum(angular={"z": 0.0}), weight=3.0),
        ),
    )


def test_a_complete_file_says_of_a_keyframe_only_what_it_asks(scenario):
    assert to_dict(scenario)["keyframes"][0] == {
        "when": 0.25,
        "com": {"z": 0.6},
        "com_min": {"x": -0.1},
        "com_max": {"x": 0.1},
    }


def test_a_keyframe_is_at_the_nearest_knot():
    knots = [mt.Keyframe(rest=True, when=when).at(70) for when in ("start", 0.1, 0.5, 0.999, "end")]
    assert knots == [0, 7, 35, 70, 70]


def test_start_and_end_are_taken_from_their_keyframes():
    task = replace(
        mt.scenarios.take_off(),
        start=None,
        terminal=None,
        initial_com=None,
        final_com=None,
        keyframes=(
            mt.Keyframe(when="start", com=(0.0, 0.0, 0.7), hover=True),
            mt.Keyframe(when=1.0, com="home", standing=True),
        ),
    )
    assert (task.start, task.terminal) == (mt.Start.HOVER, mt.Terminal.STANDING)
    assert (task.start_com, task.initial_com, task.final_com) == ((0.0, 0.0, 0.7), None, None)
    moved = replace(task, keyframes=(mt.Keyframe(when="start", com=(0.0, 0.1, 0.7), hover=True), task.keyframes[1]))
    assert moved.start_com == (0.0, 0.1, 0.7)
    free = replace(
        task, terminal=None, final_com=None, keyframes=(*task.keyframes[:1], mt.Keyframe(when="end", yaw=0.1))
    )
    assert (free.terminal, free.final_com) == (mt.Terminal.FREE, None)
    assert free.end_com == (0.0, 0.0, 0.7)


def test_home_is_where_the_robot_stands_at_home(ironcub):
    assert ironcub.home_com[:2] == (0.0, 0.0)
    lowest = min(
        np.array(ironcub.kindyn.forward_kinematics(name, ironcub.home.base_transform, ironcub.home.joint_positions))[
            2, 3
        ]
        for name in ironcub.contact_names
    )
    assert ironcub.home_com[2] == pytest.approx(ironcub.com_at(ironcub.home)[2] - lowest, abs=1e-12)
    raised = replace(
        mt.scenarios.take_off(),
        initial_com="home",
        final_com="home",
        final_com_shift=(0.1, 0.0, 0.2),
        surface=mt.FlatGround(height=0.3),
        com_range=(2.0, 2.0, 2.0),
    ).for_robot(ironcub)
    height = ironcub.home_com[2]
    assert raised.start_com == pytest.approx((0.0, 0.0, height + 0.3), abs=1e-12)
    assert raised.end_com == pytest.approx((0.1, 0.0, height + 0.5), abs=1e-12)
    posture = mt.standing_posture(ironcub, raised.surface, raised.start_com)
    assert ironcub.com_at(posture) == pytest.approx(raised.start_com, abs=1e-8)


def test_a_yaw_turns_the_attitude_of_a_hover_about_the_vertical(ironcub):
    half = mt.Keyframe(knot=3, yaw=1.0)
    turned = attitude_at(ironcub, [Placed(label="one", knot=3, keyframe=half)], 3)
    about = np.append(np.sin(0.5) * ironcub.up, np.cos(0.5))
    assert turned == pytest.approx(product(about, ironcub.upright.base_quaternion_xyzw))
    assert attitude_at(ironcub, [Placed(label="one", knot=3, keyframe=half)], 4) == pytest.approx(
        ironcub.upright.base_quaternion_xyzw
    )


@pytest.mark.parametrize(
    ("asked", "sentence"),
    [
        ({"yaw": 0.1}, "a keyframe has 'when' or 'knot'; expected one of them"),
        ({"when": 0.5, "knot": 3, "yaw": 0.1}, "a keyframe has 'when' or 'knot'"),
        ({"when": 0.5}, "the keyframe asks for nothing"),
        ({"when": 1.5, "yaw": 0.1}, "when is 1.5; expected a share from 0 to 1, 'start' or 'end'"),
        ({"when": "middle", "yaw": 0.1}, "when is 'middle'"),
        ({"knot": -1, "yaw": 0.1}, "knot is -1"),
        ({"knot": 1, "com": "here"}, "com is 'here'; expected three numbers, some axes, or 'home'"),
        ({"knot": 1, "com": (0.0, 1.0)}, "com is (0.0, 1.0); expected three numbers"),
        ({"knot": 1, "com": {"w": 1.0}}, "com: unknown axis 'w'. Available: x, y, z"),
        ({"knot": 1, "com": (0.0, 0.0, float("nan"))}, "expected finite numbers"),
        ({"knot": 1, "com": (0.0, 0.0, 1.0), "com_shift": (0.0, 0.0, 1.0)}, "com_shift is from home's CoM"),
        ({"knot": 1, "hover": True, "standing": True}, "hover and standing are both asked for"),
        ({"knot": 1, "yaw": 0.1, "base_orientation": (0.0, 0.0, 0.0, 1.0)}, "base_orientation and yaw are both"),
        ({"knot": 1, "base_orientation": (0.0, 0.0, 0.0, 0.0)}, "expected a quaternion x y z w, not all zero"),
        ({"knot": 1, "yaw": 4.0}, "yaw is 4.0 rad; expected a number from −π to π"),
        ({"knot": 1, "rest": True, "orientation_tolerance": 0.1}, "orientation_tolerance is of nothing"),
        ({"knot": 1, "hover": True, "yaw": 0.1, "orientation_tolerance": 0.1}, "a hover is held upright"),
        ({"knot": 1, "hover": True, "weight": 1.0}, "hover is no cost"),
        ({"knot": 1, "com_min": {"z": 1.0}, "weight": 1.0}, "com_min is no cost"),
        ({"knot": 1, "yaw": 1.0, "weight": 0.0}, "weight is 0.0; expected a positive number"),
        ({"knot": 1, "yaw": 1.0, "orientation_tolerance": -1.0}, "orientation_tolerance is -1.0"),
        ({"knot": 1, "joints": 3}, "joints is 3; expected a mapping"),
    ],
)
def test_a_keyframe_that_makes_no_sense_is_refused(asked, sentence):
    with pytest.raises(InputError) as error:
        mt.Keyframe(**asked)
    assert sentence in str(error.value)


@pytest.mark.parametrize(
    ("keyframes", "sentence"),
    [
        ([{"knot": 71, "yaw": 0.1}], "keyframe 1: knot is 71; expected 0 to 70, the number of knots"),
        (
            [{"knot": 5, "com": {"z": 0.6}}, {"knot": 5, "com_min": {"z": 0.7}}],
            "keyframe 1 and keyframe 2: CoM z [m] at knot 5 has to be 0.6 and at least 0.7",
        ),
        ([{"when": "end", "com": {"z": 0.6}}], "end and keyframe 1: CoM z [m] at knot 70 has to be 0.7 and 0.6"),
        ([{"knot": 5, "com_min": {"x": 0.6}, "com_max": {"x": 0.5}}], "keyframe 1: CoM x [m] at knot 5"),
        ([{"knot": 5, "yaw": 0.1}, {"when": 5 / 70, "yaw": 0.2}], "yaw [rad] at knot 5"),
        (
            [{"knot": 5, "hover": True}, {"knot": 5, "standing": True}],
            "keyframe 1 asks for a hover at knot 5 and keyframe 2 for standing; expected one of them",
        ),
        (
            [{"knot": 5, "base_orientation": TURN}, {"knot": 5, "base_orientation": (0.0, 0.0, 0.0, 1.0)}],
            "keyframe 1 and keyframe 2: base at knot 5 has two orientations, 1.57 rad apart",
        ),
        (
            [
                {"knot": 5, "frames": {"head": mt.FrameTarget(orientation=some)}}
                for some in (TURN, (1.0, 0.0, 0.0, 0.0))
            ],
            "frame head at knot 5 has two orientations, 3.14 rad apart",
        ),
        (
            [{"knot": 5, "base_orientation": TURN}, {"knot": 5, "yaw": 0.1}],
            "keyframe 2 asks for a yaw at knot 5 and keyframe 1 for a base_orientation",
        ),
        ([{"when": "end", "standing": True}], "end asks for a hover at knot 70 and keyframe 1 for standing"),
        (
            [{"knot": 5, "rest": True}, {"knot": 5, "momentum": mt.Momentum(linear={"x": 1.0})}],
            "linear momentum x [kg m/s] at knot 5 has to be 0 and 1",
        ),
        (
            [{"when": "start", "base_position": {"z": 0.6}}],
            "keyframe 1 asks for base_position at the first knot, and a start that is 'standing'",
        ),
    ],
)
def test_keyframes_that_contradict_each_other_are_refused(keyframes, sentence):
    with pytest.raises(ScenarioError) as error:
        replace(mt.scenarios.take_off(), keyframes=[mt.Keyframe(**some) for some in keyframes])
    assert sentence in str(error.value)


def test_names_that_the_robot_lacks_are_refused_with_those_that_it_has(ironcub):
    for asked, sentence in (
        ({"joints": {"l_elbo": 0.1}}, "keyframe 1: unknown joint 'l_elbo'; did you mean 'l_elbow'?"),
        ({"frames": {"l_hnd_palm": mt.FrameTarget(position={"z": 1.0})}}, "keyframe 1: unknown frame 'l_hnd_palm'"),
    ):
        task = replace(mt.scenarios.take_off(), keyframes=(mt.Keyframe(knot=3, **asked),))
        with pytest.raises(ScenarioError, match=sentence.replace("?", r"\?")):
            mt.build(ironcub, task)
        (finding,) = mt.doctor(ironcub, task).findings
        assert sentence in finding.found


def test_an_end_without_a_word_is_missed():
    with pytest.raises(ScenarioError, match="lacks 'terminal', or a keyframe for its end"):
        replace(mt.scenarios.take_off(), terminal=None)
    with pytest.raises(ScenarioError, match="lacks 'initial_com', or a keyframe for its start with a whole 'com'"):
        replace(mt.scenarios.take_off(), initial_com=None)
    with pytest.raises(ScenarioError, match="final_com_shift is from home's CoM, and final_com has numbers"):
        replace(mt.scenarios.take_off(), final_com_shift=(0.0, 0.0, 0.1))


INSTANTS = """
based_on = "take-off"
gait = { kind = "walk", steps = 2, begin = "start" }
pushes = [{ of = "chest", force = [0.0, 9.0, 0.0], end = "end" }]
walls = [{ normal = [0.0, 0.0, -1.0], offset = -2.0, begin = "start", end = "start" }]
boxes = [{ lower = [1.0, 1.0, 0.0], upper = [2.0, 2.0, 1.0], begin = "end" }]
failures = [{ jet = "left arm", at = "start" }]
limits = [{ base_speed = 1.0, begin = "start", end = "end" }]
[[contacts]]
of = "left"
state = "on"
begin = "start"
end = "end"
"""


def test_every_place_that_takes_an_instant_reads_start_and_end(ironcub, tmp_path):
    """They mean the shares 0 and 1, in a file as in Python, and a file keeps the words."""
    (tmp_path / "words.toml").write_text(INSTANTS)
    words = scenario_files.load(tmp_path / "words.toml")
    (tmp_path / "shares.toml").write_text(INSTANTS.replace('"start"', "0").replace('"end"', "1"))
    shares = scenario_files.load(tmp_path / "shares.toml")
    np.testing.assert_array_equal(Schedule.of(ironcub, words).on, Schedule.of(ironcub, shares).on)
    assert Schedule.of(ironcub, words).on[0, 1:].all()
    assert words.gait.stretches(ironcub) == shares.gait.stretches(ironcub)
    assert words.pushes[0].knots(10, rules.LEAPFROG) == shares.pushes[0].knots(10, rules.LEAPFROG) == range(10)
    assert failing_knots(words.failures, ironcub.jet_names, 10) == {0: 0}
    assert limited(words.limits, ironcub, 10) == limited(shares.limits, ironcub, 10)
    assert scenario_files.load(scenario_files.save(words, tmp_path / "again.toml")) == words


@pytest.mark.parametrize(
    "key",
    ["gait.begin", "pushes.end", "walls.begin", "boxes.end", "failures.at", "limits.begin", "contacts.end"],
)
def test_another_word_for_an_instant_is_refused_wherever_one_is_said(tmp_path, key):
    group, name = key.split(".")
    table = tomllib.loads(INSTANTS)
    place = table[group] if group == "gait" else table[group][0]
    place[name] = "middle"
    (tmp_path / "wrong.toml").write_text(tomli_w.dumps(table))
    at = key if group == "gait" else rf"{group}\[0\].{name}"
    with pytest.raises(ScenarioError, match=f"'{at}' is 'middle'; expected a finite number or one of start, end"):
        scenario_files.load(tmp_path / "wrong.toml")

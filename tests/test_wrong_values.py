"""A number of the right kind that no picture, motion or simulation can have is refused in one sentence."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

import multimodal_to as mt
from multimodal_to import plotting, replay, simulation
from multimodal_to.errors import InputError
from multimodal_to.trajectory import derived, resampling
from odd_robots import JOINTS, at_rest, odd_robot

NAN = float("nan")
GIVEN: dict[str, Callable[..., object]] = {
    **{
        f"{kind}, size {size}": lambda robot, motion, path, write=write, size=size: write(
            robot, motion, path, size=size
        )
        for kind, write in (("gif", replay.write_gif), ("mp4", replay.write_mp4), ("png", replay.write_snapshots))
        for size in ((0, 0), (640,), (640, 480, 3), (-5, 10), (10**6, 10**6))
    },
    **{
        f"aspect {aspect}": lambda robot, motion, path, aspect=aspect: replay.write_still_html(
            robot, motion, [0.0, 0.1], path, aspect=aspect
        )
        for aspect in (0.0, -1.0, NAN, np.inf)
    },
    **{
        f"times {times}": lambda robot, motion, path, times=times: replay.write_still_html(
            robot, motion, times, path, aspect=1.0
        )
        for times in ([], [0.1, 0.0], [NAN], [9.0])
    },
    "times of texts": lambda robot, motion, path: replay.write_still_html(
        robot, motion, np.array(["a"]), path, aspect=1.0
    ),
    "times in rows": lambda robot, motion, path: resampling.resample(motion, np.zeros((2, 2))),
    "no times": lambda robot, motion, path: resampling.resample(motion, np.array(["a", "b"])),
    "no interval": lambda robot, motion, path: resampling.regrid(motion, 0, "leapfrog"),
    "no quantity": lambda robot, motion, path: derived.at_knots(motion, "nope"),
    "no audit": lambda robot, motion, path: plotting.plot_margins(robot, motion, audits=[]),
    "no state": lambda robot, motion, path: simulation.random_states(robot, 0),
    "a seed below zero": lambda robot, motion, path: simulation.random_states(robot, 1, -1),
    "no reach": lambda robot, motion, path: simulation.build_model(robot, mt.FlatGround(), reach=-1.0),
    "no friction": lambda robot, motion, path: simulation.build_model(robot, mt.FlatGround(), NAN),
    "no middle": lambda robot, motion, path: simulation.build_model(robot, mt.FlatGround(), middle=np.zeros(5)),
    "too many joints": lambda robot, motion, path: robot.kindyn.tree.joint_values(np.zeros(9)),
    "too few joints": lambda robot, motion, path: robot.kindyn.tree.joint_rates(np.zeros(0)),
}


@pytest.fixture(scope="module")
def robot(tmp_path_factory) -> mt.Robot:
    return odd_robot(tmp_path_factory.mktemp("odd"), joints=JOINTS, feet=True, jets=True)


@pytest.mark.parametrize("call", GIVEN.values(), ids=GIVEN)
def test_a_value_that_cannot_be_is_refused(robot, call, tmp_path):
    with pytest.raises(InputError) as caught:
        call(robot, at_rest(robot), tmp_path / "out")
    assert "\n" not in str(caught.value)
    assert list(tmp_path.iterdir()) == []


def test_a_motion_of_another_robot_is_not_shown(robot, tmp_path):
    other = odd_robot(tmp_path, joints={}, feet=False, jets=False)
    for show in (
        lambda: replay.write_html(other, at_rest(robot), tmp_path / "page.html"),
        lambda: replay.write_still_html(other, at_rest(robot), [0.0], tmp_path / "page.html", aspect=1.0),
        lambda: replay.show(other, at_rest(robot)),
        lambda: replay.player(other, at_rest(robot)),
    ):
        with pytest.raises(InputError, match="is for another robot: its joints are hip, mast, wheel"):
            show()
    assert not (tmp_path / "page.html").exists()

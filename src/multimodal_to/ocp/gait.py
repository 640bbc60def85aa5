"""Footsteps for the start guess: the feet go one after the other, each under its share of the load while it stands.

Only a guess: nothing asks the answer to step when, where or how often it does.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from multimodal_to.adam.spatial import Array
from multimodal_to.models.proportions import Gait
from multimodal_to.models.robot import Robot
from multimodal_to.ocp.schedule import Schedule, runs
from multimodal_to.scenarios.scenario import Scenario, Terminal

GROUNDED = 0.8  # share of the horizon before a motion that ends in the air leaves the ground [1]
_ABOVE = 1.25  # how high feet swing, as a share of the clearance that is asked for [1]


def steps(feet: Sequence[str], gait: Gait, scenario: Scenario, travelled: Array) -> tuple[Array, Array]:
    """Return how far each contact point has moved [m], (contacts, 3, N + 1), and its share of the load.

    Args:
        feet: the foot of each contact point.
        gait: how high and how long feet swing.
        scenario: its `guess_steps` are spread evenly over the time on the ground, feet taking turns.
        travelled: how far the CoM has moved at every knot [m], (3, N + 1).
    """
    names = list(dict.fromkeys(feet))
    foot_of = np.array([names.index(foot) for foot in feet])
    count = scenario.knots + 1
    leaves = round(GROUNDED * scenario.knots) if scenario.terminal is Terminal.HOVER else scenario.knots
    moved, stands = np.zeros((len(names), 3, count)), np.ones((len(names), count), dtype=bool)
    window = leaves / scenario.guess_steps
    for step in range(scenario.guess_steps):
        foot, end = step % len(names), round((step + 1) * window)
        begin = max(round((step + 1 - gait.swing) * window), 1)
        stride = travelled[:, leaves] * [1, 1, 0] * (step + 1) / scenario.guess_steps - moved[foot, :, begin]
        phase = np.arange(1, end - begin + 1) / (end - begin + 1)
        moved[foot, :, begin:end] += stride[:, None] * phase
        moved[foot, 2, begin:end] += gait.lift * np.sin(np.pi * phase)
        moved[foot, :, end:] += stride[:, None]
        stands[foot, begin:end] = False
    moved[:, :, leaves:] += travelled[:, leaves:] - travelled[:, [leaves]]
    stands[:, leaves + 1 :] = False
    shares = stands / np.maximum(stands.sum(axis=0), 1)
    return moved[foot_of], shares[foot_of] / np.bincount(foot_of)[foot_of, None]


def footfalls(robot: Robot, schedule: Schedule, travelled: Array) -> tuple[Array, Array]:
    """Return how far each contact point has moved where its contacts are given, as `steps` does.

    A point that is off swings from where it stands to where the CoM is in the middle of its next stance, or at the end.
    One that stays off flies along with the CoM. One of which nothing is given glides along.

    Args:
        robot: with its gait.
        schedule: when its points stand.
        travelled: how far the CoM has moved at every knot [m], (3, N + 1).
    """
    last = travelled.shape[1] - 1
    moved = np.tile(travelled * [[1.0], [1.0], [0.0]], (len(robot.contacts), 1, 1))
    for place, given in zip(moved, schedule.given, strict=True):
        if given.any():
            place[:] = 0.0
    for point, place in enumerate(moved):
        swings = [(first - 1, end) for first, end in runs(schedule.off[point])]
        for index, (begin, end) in enumerate(swings):
            if end == last:
                place[:, begin:] += travelled[:, begin:] - travelled[:, [begin]]
                continue
            leaves = swings[index + 1][0] if index + 1 < len(swings) else last
            over = travelled[:, last] if leaves == last else travelled[:, (end + leaves) // 2]
            stride = over * [1.0, 1.0, 0.0] - place[:, begin]
            phase = np.arange(end - begin + 1) / (end - begin)
            lift = max(robot.gait.lift, _ABOVE * float(schedule.clearance[point, begin : end + 1].max()))
            place[:, begin : end + 1] += stride[:, None] * phase
            place[2, begin : end + 1] += lift * np.sin(np.pi * phase)
            place[:, end + 1 :] += stride[:, None]
    loaded = ~schedule.unloaded
    return moved, loaded / np.maximum(loaded.sum(axis=0), 1)

"""Starter tasks: what a robot can be asked first, with numbers that follow from the robot.

Each is a function of a robot that returns a `Scenario`, from keyframes and given contacts. Lengths are in L, the
standing height of the CoM, times in √(L/g) and forces in m g.
"""

from multimodal_to.tasks.finding import BUNDLED_FOR, TASKS, find
from multimodal_to.tasks.in_air import hover, land, take_off
from multimodal_to.tasks.on_feet import jump, squat, step, trot, walk

__all__ = [
    "BUNDLED_FOR",
    "TASKS",
    "find",
    "hover",
    "jump",
    "land",
    "squat",
    "step",
    "take_off",
    "trot",
    "walk",
]

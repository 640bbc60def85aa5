"""Whether there is a posture in which the thrusts hold the robot in the air, upright, where it has to hover."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace

import casadi as cs
import numpy as np

from multimodal_to.adam.tree import BASE
from multimodal_to.doctor.balance import LONG_LEVER, Residual, residual
from multimodal_to.doctor.diagnosis import Symptom, error, note, warning
from multimodal_to.doctor.search import search
from multimodal_to.doctor.task import Task
from multimodal_to.models.joint_units import joint_units
from multimodal_to.models.robot import Posture
from multimodal_to.ocp import paper
from multimodal_to.ocp.knot import Knot
from multimodal_to.ocp.parameters import Parameters
from multimodal_to.ocp.terms import Constraint, equal
from multimodal_to.scenarios.scenario import Vector3

_SLACK = 2e-2
"""Share of the weight that a base within its tolerance of upright, and what force contacts may keep, cannot make up."""
_HOVER = (
    paper.STATIC_EQUILIBRIUM,
    paper.NON_PENETRATION,
    paper.CONTACT_REACH,
    paper.JET_REACH,
)
"""Constraints of a knot that hovers, beside those that thrusts within their limits and no force fulfil."""


def trim(task: Task) -> Iterator[Symptom]:
    """Look for thrusts that carry weight and moment: first in the posture as it is, then in any."""
    if not (task.hovers and task.lifts):
        return
    posture = upright(task)
    here = residual(task, posture, feet=False, thrusts=task.thrusts_held, lever=LONG_LEVER)
    if here.nothing:
        return
    if reason := _impossible(task, posture, here):
        yield error("hover trim", reason, "change where the jets are or point, or their greatest thrusts")
        return
    for when, com in task.hovers.items():
        found = trimmed(task, com)
        if found is None:
            yield warning(
                "hover trim",
                f"no posture was found in which the thrusts hold the robot upright at the {when}, with the CoM at "
                f"{com} m; in the posture that the problem is built around they leave {here} over",
                "look at where the jets point, their greatest thrusts and the joints' ranges, and whether the feet are "
                "clear of the ground there",
            )
        else:
            moved = np.abs(found.joint_positions - posture.joint_positions)
            most = int(moved.argmax())
            amount = f"{moved[most]:.2f} {joint_units(task.robot, 'rad')[most]}"
            yield note(
                "hover trim",
                f"the posture as it stands cannot hover, thrusts leave {here} over; one with "
                f"{task.robot.joint_names[most]} moved by {amount} can, at the {when}",
            )


def upright(task: Task) -> Posture:
    """Return the posture with the base upright, where a hover has to be within 2e-3 rad of it: `Robot.upright`."""
    return replace(task.posture, base_quaternion_xyzw=task.robot.upright.base_quaternion_xyzw)


def _impossible(task: Task, posture: Posture, here: Residual) -> str:
    """Return why no posture can hover, where that is certain: what the jets point at does not depend on the joints.

    Args:
        task: robot and scenario.
        posture: upright.
        here: what the thrusts leave over in it, with a long lever.
    """
    tree = task.robot.kindyn.tree
    if task.rigid and residual(task, posture, feet=False, thrusts=task.thrusts_held).share > _SLACK:
        return f"no joint moves, and within their limits the thrusts leave {here} over"
    if all(tree.frame(jet.frame).body == BASE for jet in task.robot.jets):
        left = residual(task, posture, feet=False, thrusts=task.thrusts_held, lever=math.inf)
        if left.share > _SLACK:
            return f"the jets sit on the base, and with it upright they leave {left.force:.3g} N of the weight over"
    return ""


def trimmed(task: Task, com: Vector3) -> Posture | None:
    """Return the posture nearest to the one the problem is built around that hovers upright with its CoM at `com` [m].

    None if the search finds none.
    """
    start = upright(task)

    def there(knot: Knot, parameters: Parameters) -> cs.SX:
        return knot.com_position - cs.DM(com)

    def away(knot: Knot) -> cs.SX:
        return cs.sumsqr(knot.joint_positions - start.joint_positions)

    asked = (Constraint(value=there, within=equal(), unit="m"), *task.held(*_HOVER))
    return search(task, start, com, constraints=asked, objective=away, thrusts=task.thrusts_held)

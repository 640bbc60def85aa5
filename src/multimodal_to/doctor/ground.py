"""Whether the robot can stand where it has to: the legs reach, friction holds, and the CoM is above the feet."""

from __future__ import annotations

import math
from collections.abc import Iterator

import casadi as cs
import numpy as np

from multimodal_to.doctor.balance import LONG_LEVER, residual
from multimodal_to.doctor.diagnosis import Symptom, error, warning
from multimodal_to.doctor.search import search
from multimodal_to.doctor.task import Task
from multimodal_to.errors import apart
from multimodal_to.models.robot import Posture
from multimodal_to.models.terrain import FlatGround, frame_function
from multimodal_to.ocp import paper
from multimodal_to.ocp.guess import contact_positions
from multimodal_to.ocp.knot import Knot
from multimodal_to.ocp.parameters import Parameters
from multimodal_to.ocp.terms import Constraint, equal
from multimodal_to.scenarios.scenario import Vector3


def height(task: Task) -> Iterator[Symptom]:
    """Look for the postures in which the robot has to stand, and say which height its legs reach instead."""
    scenario = task.scenario
    if task.stands_at_start and task.start_posture is None:
        yield error("standing start", _no_posture(task, scenario.start_com), _other_height(task, "initial"))
        if scenario.start_com[2] == scenario.end_com[2]:
            return  # the same once more
    if not task.stands_at_end:
        return
    if task.end_posture is None:
        # Elsewhere the ground is another, and the feet may find a place that one search has not; `build` needs the
        # posture where there is no other.
        certain = (task.on_plane or not task.stands_at_start) and task.scenario.says_end_com
        yield (error if certain else warning)(
            "standing end", _no_posture(task, scenario.end_com), _other_height(task, "final")
        )
    elif isinstance(scenario.surface, FlatGround):
        above = scenario.end_com[2] - scenario.surface.height
        reach = task.robot.contact_reach[2]
        if task.held(paper.CONTACT_REACH) and above > reach:
            yield error(
                "standing end",
                f"the CoM has to end {apart(above, reach)} m above the feet, beyond the reach of contact "
                f"points in the problem, {reach:g} m ('contacts' in [reach] of robot.toml)",
                _other_height(task, "final"),
            )


def _no_posture(task: Task, com: Vector3) -> str:
    return (
        f"no posture of {task.robot.name} within its joint limits stands on the ground with its CoM at "
        f"{', '.join(f'{number:g}' for number in com)} m"
    )


def _other_height(task: Task, which: str) -> str:
    com = task.scenario.start_com if which == "initial" else task.scenario.end_com
    reached = _nearest_height(task, com)
    if reached is None:
        return f"choose another {which}_com_height"
    height = apart(reached, com[2], digits=5)
    return f"choose another {which}_com_height; the nearest that the legs are found to reach is {height} m"


def _nearest_height(task: Task, com: Vector3) -> float | None:
    """Return the height of the CoM nearest to that of `com` [m] that the robot can stand at, if a search finds it."""

    def across(knot: Knot, parameters: Parameters) -> cs.SX:
        return knot.com_position[:2] - cs.DM(com[:2])

    def off(knot: Knot) -> cs.SX:
        away = cs.sumsqr(knot.joint_positions - task.robot.home.joint_positions)
        return 1e3 * (knot.com_position[2] - com[2]) ** 2 + 1e-3 * away

    found = search(
        task,
        task.robot.home,
        com,
        constraints=(
            Constraint(value=across, within=equal(), unit="m"),
            *task.held(paper.STANDING_HEIGHT, paper.CONTACT_REACH),
        ),
        objective=off,
        thrusts=np.zeros(len(task.robot.jets)),
    )
    return None if found is None else float(task.robot.com_at(found)[2])


def hold(task: Task) -> Iterator[Symptom]:
    """Ask whether contact forces in the friction pyramid, at the end with thrusts, hold the robot where it stands."""
    idle = np.zeros(len(task.robot.jets))
    start = None if task.start_posture is None else list(_held(task, "start", task.start_posture, idle, True))
    yield from start or ()
    if not start and task.end_posture is not None:
        # The end's posture is not given, but on a plane friction is the same in all of them.
        certain = task.on_plane and not task.robot.jets
        yield from _held(task, "end", task.end_posture, task.thrusts_held, certain)


def _held(task: Task, when: str, posture: Posture, thrusts: np.ndarray, certain: bool) -> Iterator[Symptom]:
    left = residual(task, posture, feet=True, thrusts=thrusts, lever=LONG_LEVER)
    if left.nothing:
        return
    sliding = residual(task, posture, feet=True, thrusts=thrusts, lever=math.inf)
    if not sliding.nothing:
        friction = task.parameters.friction
        yield (error if certain else warning)(
            f"friction at the {when}",
            f"the ground under the feet is inclined by up to {_steepest(task, posture):.1f}°, and friction, "
            f"{friction:g}, which holds {math.degrees(math.atan(friction)):.1f}°, leaves {sliding.force:.3g} N of the "
            "weight over",
            "ask for more friction or flatter ground",
        )
    else:
        yield (error if certain and when == "start" else warning)(
            f"support at the {when}",
            f"contact forces leave {left} over: the CoM is not above the feet",
            "put the feet under the CoM, by the robot's home posture or its contact points",
        )


def _steepest(task: Task, posture: Posture) -> float:
    """Return the greatest inclination of the ground under the contact points [°]."""
    points = contact_positions(task.robot, posture).reshape(-1, 3).T
    normals = np.array(frame_function(task.scenario.surface).map(points.shape[1])(points)[1])
    return float(np.degrees(np.arccos(np.clip(normals[2], -1.0, 1.0))).max())

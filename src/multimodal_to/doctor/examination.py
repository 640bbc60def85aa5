"""`doctor`: all checks in their order, from what is looked up to what has to be computed."""

from __future__ import annotations

from collections.abc import Callable, Iterator

from multimodal_to.arguments import checked
from multimodal_to.doctor import keyframes
from multimodal_to.doctor.contacts import contacts
from multimodal_to.doctor.diagnosis import Diagnosis, Symptom, error
from multimodal_to.doctor.formulation import formulation
from multimodal_to.doctor.ground import height, hold
from multimodal_to.doctor.hover import trim
from multimodal_to.doctor.limits import limits
from multimodal_to.doctor.posture import postures
from multimodal_to.doctor.pushes import pushes
from multimodal_to.doctor.reach import reach
from multimodal_to.doctor.regions import regions, targets
from multimodal_to.doctor.task import Task
from multimodal_to.doctor.thrust import failures, spool_up_time, weight
from multimodal_to.doctor.travel import base_way, leap, momenta, push, speed
from multimodal_to.doctor.weighing import allowances, costs, groups, scales
from multimodal_to.errors import InputError, MultimodalError, ScenarioError, TrajectoryError
from multimodal_to.models.robot import Robot
from multimodal_to.models.state import State
from multimodal_to.ocp.formulation import Formulation
from multimodal_to.scenarios.scenario import Scenario

Check = Callable[[Task], Iterator[Symptom]]

CHECKS: tuple[Check, ...] = (
    groups,
    allowances,
    costs,
    scales,
    weight,
    failures,
    spool_up_time,
    speed,
    base_way,
    momenta,
    push,
    leap,
    height,
    hold,
    reach,
    trim,
    keyframes.joints,
    keyframes.turns,
    keyframes.stands,
    postures,
    keyframes.yaw_without_moment,
    contacts,
    regions,
    targets,
    limits,
    pushes,
)
"""What is asked of every task."""
ONCE_SOUND: tuple[Check, ...] = (formulation,)
"""What is asked of a task in which the others found no error: it needs a problem that can be made."""


@checked
def doctor(
    robot: Robot, scenario: Scenario, formulation: Formulation | None = None, *, initial: State | None = None
) -> Diagnosis:
    """Return what can be said of a task before its problem is built and solved, in about a second.

    An error is certain, or as certain as what `build` refuses: no motion does what is asked. Nothing is raised for a
    task that makes no sense; it is an error among the findings.

    Args:
        robot: whose motion it is.
        scenario: the task.
        formulation: what the problem is made of; by default `Formulation.executable()`.
        initial: the state that a motion with a given start starts in; by default that of the scenario's file.
    """
    try:
        task = Task.of(robot, scenario, formulation, initial)
    except ScenarioError as cause:
        return refusal("keyframes", cause, "name what the robot has, and ask for one thing at a knot")
    except (TrajectoryError, InputError) as cause:
        return refusal("initial_state", cause, "name a trajectory file of this robot")
    if not robot.contacts and (task.stands_at_start or task.stands_at_end):
        return refusal("contacts", f"{robot.name} has no contact points to stand on", "name some in its robot.toml")
    findings = [finding for check in CHECKS for finding in check(task)]
    diagnosis = Diagnosis(findings=tuple(findings))
    if diagnosis.hopeless:
        return diagnosis
    return Diagnosis(findings=(*findings, *(finding for check in ONCE_SOUND for finding in check(task))))


@checked
def refusal(name: str, found: str | MultimodalError, change: str = "") -> Diagnosis:
    """Return the diagnosis of a task that cannot even be looked at.

    Args:
        name: what is wrong in a word.
        found: what is wrong, or the error that says so.
        change: what to do about it.
    """
    return Diagnosis(findings=(error(name, str(found), change),))

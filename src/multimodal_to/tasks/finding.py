"""Tasks by name: the starter tasks for any robot, and the bundled scenarios."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterable, Mapping
from dataclasses import fields
from typing import Any, get_type_hints

from multimodal_to.arguments import checked
from multimodal_to.errors import ScenarioError, unknown
from multimodal_to.models.robot import Robot
from multimodal_to.scenarios.bundled import SCENARIOS
from multimodal_to.scenarios.bundled import find as bundled
from multimodal_to.scenarios.data import HEIGHTS, RECORDS
from multimodal_to.scenarios.files import changed, parted
from multimodal_to.scenarios.scenario import Scenario
from multimodal_to.tasks import in_air, on_feet
from multimodal_to.tasks.sizing import sized
from multimodal_to.values import FrozenMapping

TASKS: Mapping[str, Callable[..., Scenario]] = FrozenMapping(
    {
        "squat": on_feet.squat,
        "jump": on_feet.jump,
        "step": on_feet.step,
        "walk": on_feet.walk,
        "trot": on_feet.trot,
        "hover": in_air.hover,
        "take-off": in_air.take_off,
        "land": in_air.land,
    }
)
"""The starter tasks by name."""
BUNDLED_FOR = ("ironcub", "ironcub-mk3")
"""The robots, by name, for which a name that both have is the bundled scenario; it is written for the first."""
NOT_SIZED = ("jump",)
"""Bundled scenarios that the others of `BUNDLED_FOR` do not get in their own size.

The jump asks for a height of the CoM, which a robot that bends its knees at home reaches standing straight.
"""


def numbers(name: str) -> Mapping[str, Any]:
    """Return what can be said of a starter task: the types of its arguments beside the robot, by name."""
    hints = get_type_hints(TASKS[name])
    return {argument: hints[argument] for argument in inspect.signature(TASKS[name]).parameters if argument != "robot"}


def is_starter(name: str, robot: str) -> bool:
    """Return whether a name is a starter task for the robot of a name."""
    of_others = NOT_SIZED if robot in BUNDLED_FOR[1:] else ()
    is_bundled = name in SCENARIOS and robot in BUNDLED_FOR and name not in of_others
    return name in TASKS and not is_bundled


def follows_from(name: str, robot: str) -> bool:
    """Return whether the numbers of the task of a name follow from the robot of a name."""
    return is_starter(name, robot) or robot in BUNDLED_FOR[1:]


@checked
def find(name: str, robot: Robot, settings: Iterable[str] = ()) -> Scenario:
    """Return the task of a name for a robot: a starter task, or a bundled scenario.

    `jump` and `take-off` are names of both: they are the bundled scenarios for the robots of `BUNDLED_FOR`, and the
    starter tasks for any other. Those of `BUNDLED_FOR` behind the first get bundled scenarios of their own size, by
    `sizing.sized`, but for those of `NOT_SIZED`.

    Args:
        name: of the task.
        robot: that does it.
        settings: changes such as `height=0.1`, for an argument of the starter task, or `weights.thrust=3`, for a value
            of the scenario.

    Raises:
        ScenarioError: there is none of that name, the robot cannot do it, or a change is wrong.
    """
    return asked(name, robot, dict(map(parted, settings)))


@checked
def asked(name: str, robot: Robot, values: Mapping[str, Any]) -> Scenario:
    """Return what `find` does, with changes by dotted keys, as `{"height": 0.1, "weights.thrust": 3.0}`.

    Args:
        name: of the task.
        robot: that does it.
        values: by key, as a file has them.

    Raises:
        ScenarioError: there is none of that name, the robot cannot do it, or a change is wrong.
    """
    if not is_starter(name, robot.name):
        refuse_unknown(name)
        scenario = bundled(name)
        return changed(sized(scenario, robot) if follows_from(name, robot.name) else scenario, values)
    hints, said, rest = numbers(name), dict[str, Any](), dict[str, Any]()
    for key, value in values.items():
        if key in hints:
            said[key] = RECORDS.value(hints[key], value, key)
        elif key.partition(".")[0] in (known := [*hints, *(entry.name for entry in fields(Scenario)), *HEIGHTS]):
            rest[key] = value
        else:
            raise ScenarioError(unknown("key", key, known))
    return changed(TASKS[name](robot, **said), rest)


def refuse_unknown(name: str) -> None:
    """Refuse a name that is no task.

    Raises:
        ScenarioError: it is none.
    """
    if name not in SCENARIOS and name not in TASKS:
        raise ScenarioError(unknown("scenario", name, [*SCENARIOS, *(task for task in TASKS if task not in SCENARIOS)]))

"""Contacts given against contacts found: the same tasks solved both ways, as a table in Markdown.

    python benchmarks/contacts.py [walk trot jump mixed lean]

Needs MuJoCo and the package `example-robot-data`. Seconds are processor time of the solve; iterations do not depend on
the machine.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

import multimodal_to as mt
from multimodal_to.models.contact import ContactPoint
from multimodal_to.models.robot import Robot
from multimodal_to.simulation import play, tracking

EXAMPLES = Path(__file__).parents[1] / "examples"
TABLE = 0.32  # height of the table that the iRonCub leans on [m]
HEAD = "| task | contacts | rows | iterations | seconds | objective | answer | audit | MuJoCo |"


def walk() -> Iterator[tuple[str, Robot, mt.Scenario]]:
    """Give the walk to fly, whose steps are found, and with four steps before the take-off that are given."""
    robot, found = mt.load_robot("ironcub"), mt.scenarios.walk_to_fly()
    yield "found", robot, found
    in_air = mt.ContactStretch(of=tuple(robot.feet), state=mt.ContactState.OFF, begin=0.8)
    plan = mt.GaitPlan(kind=mt.GaitKind.WALK, steps=4, begin=0.05, end=0.8, clearance=0.02)
    yield "given", robot, replace(found, guess_steps=0, gait=plan, contacts=(in_air,))


def trot() -> Iterator[tuple[str, Robot, mt.Scenario]]:
    """Give the trot of Solo12; where it is found, its feet skim, and the start guess steps as often."""
    robot = mt.load_robot("solo12")
    given = mt.tasks.trot(robot, distance=0.3)
    yield "found", robot, replace(given, gait=None, guess_steps=8)
    yield "given", robot, given


def lean() -> Iterator[tuple[str, Robot, mt.Scenario]]:
    """Give the iRonCub that stands on given feet and leans on a table with its hands, whose contacts are found.

    Its CoM comes to rest 2 cm beyond its toes: only hands that bear load hold it. A keyframe says how high the hands
    are; when they touch and what they bear is found. A robot has feet alone in its file, so the hands are added here.
    """
    robot = mt.load_robot("ironcub").with_jets(())
    hands = {"l_arm_jet_turbine": "left hand", "r_arm_jet_turbine": "right hand"}
    points = [ContactPoint(frame=frame, foot=hand) for frame, hand in hands.items()]
    leaning = replace(robot, contacts=(*robot.contacts, *points), contact_reach=np.array([0.5, 0.5, 0.6]))
    at_the_table = {frame: mt.FrameTarget(position={"z": TABLE}) for frame in hands}
    walk_weights = mt.scenarios.walk_to_fly().weights
    task = mt.Scenario(
        name="lean",
        title="Leaning on a table",
        knots=40,
        jets=False,
        start=mt.Start.GIVEN,
        terminal=mt.Terminal.FREE,
        interval_min=0.05,
        interval_max=0.05,
        surface=mt.Stairs(edges=(0.1,), heights=(0.0, TABLE), direction=(-1.0, 0.0), width=0.06),
        contacts=(mt.ContactStretch(of=("left", "right"), state=mt.ContactState.ON),),
        keyframes=(
            mt.Keyframe(when=0.6, frames=at_the_table),
            mt.Keyframe(when=0.8, com={"x": -0.08, "y": 0.0}, rest=True),
            mt.Keyframe(when="end", com={"x": -0.08, "y": 0.0}, rest=True, frames=at_the_table),
        ),
        margins=mt.Margins(touch_down_speed=0.1),
        weights=replace(
            walk_weights, base_orientation=0.0, posture=1e6, joint_velocities={"upper_body": 1e5, "legs": 1e5}
        ),
    )
    yield "feet given, hands found", leaning, task


def mixed() -> Iterator[tuple[str, Robot, mt.Scenario]]:
    """Give the trot with three feet given and one found."""
    robot = mt.load_robot("solo12")
    given = mt.tasks.trot(robot, distance=0.3)
    free = mt.ContactStretch(of=("front_left",), state=mt.ContactState.FREE)
    yield "three feet given, one found", robot, replace(given, contacts=(free,))


def jump() -> Iterator[tuple[str, Robot, mt.Scenario]]:
    """Give the jump onto a box of 10 cm; where it is found, the start guess glides onto the box."""
    robot, given = mt.load_robot("ironcub"), mt.scenario_files.load(EXAMPLES / "jump-onto-box.toml")
    yield "found", robot, replace(given, gait=None)
    yield "given", robot, given


TASKS = {"walk": walk, "trot": trot, "jump": jump, "mixed": mixed, "lean": lean}


def _stand(robot: Robot) -> mt.State:
    """Return the state in which a robot stands on its feet alone, 7 mm lower than at home."""
    feet = replace(robot, contacts=tuple(point for point in robot.contacts if "hand" not in point.foot))
    x, y, z = feet.home_com
    return mt.State.at_rest(robot, mt.standing_posture(feet, mt.FlatGround(), (x, y, z - 0.007)))


def row(task: str, contacts: str, robot: Robot, scenario: mt.Scenario) -> str:
    """Return a row of the table.

    Args:
        task: its name.
        contacts: how they come about.
        robot: that moves.
        scenario: the task.
    """
    problem = mt.build(robot, scenario, initial=_stand(robot) if scenario.start is mt.Start.GIVEN else None)
    began = time.process_time()
    solution = mt.solve(problem)
    seconds = time.process_time() - began
    verdict = mt.audit(problem.robot, solution.trajectory)
    wrong = [finding.name for finding in verdict.findings if not finding.holds]
    end = tracking(play(problem.robot, solution.trajectory)).end if solution.feasible else "–"
    parts = (
        task,
        contacts,
        problem.row_lower.size,
        solution.iterations,
        f"{seconds:.1f}",
        f"{solution.objective:.3g}",
        solution.status.value + (f", airborne {verdict.airborne:.2f} s" if task == "jump" else ""),
        "true" if not wrong else f"{len(wrong)} miss: {', '.join(wrong[:2])}",
        end,
    )
    return "| " + " | ".join(str(part) for part in parts) + " |"


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("tasks", nargs="*", help=f"of {', '.join(TASKS)}")
    print(HEAD)
    print("|--" * (HEAD.count("|") - 1) + "|")
    for name in parser.parse_args().tasks or TASKS:
        for contacts, robot, scenario in TASKS[name]():
            print(row(name, contacts, robot, scenario), flush=True)


if __name__ == "__main__":
    main()

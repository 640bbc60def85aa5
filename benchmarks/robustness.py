"""How well the bundled robots bear variation of their tasks: target, distance, friction, mass and start posture.

    python benchmarks/robustness.py [TASK ...] [--robot ironcub ...] [--variations 10] [--seed 1] [--workers 2]
        [--lines FILE] [--into PAGE]

The iRonCubs have the six bundled scenarios, but that the Mk3's jump is the starter task, and the other robots the
starter tasks of `TASKS`. Every variation changes all of these at once, by lengths that are those of the iRonCub and
follow the robot's L:

- the target's height by up to ±0.05 m (the jump, which is as high as the motors can, by down to −0.05 m) and, where
  there is one, the distance by up to ±0.2 m (the step and the place on it by ±0.1 m); of a starter task its own size,
  the depth, height or distance, by up to ±30 %;
- the friction within 0.25 to 0.6; of other robots than the iRonCubs by up to ±25 %;
- every mass and inertia by up to ±3 %;
- every joint of the posture that the robot stands near by up to ±0.05 rad, within its range.

Each is solved from the plain start guess with default options, and audited. One line each, which `--lines` also appends
to a file: what stands there is not solved again. Then a table of all draws that the file has of these tasks, which
`--into` sets between the marks of a page.
"""

from __future__ import annotations

import argparse
import json
import math
import multiprocessing
import re
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import numpy as np
from lxml import etree
from rich.console import Console

import multimodal_to as mt
from multimodal_to import scenarios
from multimodal_to.models.loading import ROBOT_FILE, bundled_robots
from multimodal_to.models.robot import Robot
from multimodal_to.models.terrain import Stairs
from multimodal_to.models.units import Sized
from multimodal_to.scenarios.scenario import Scenario
from multimodal_to.tasks.finding import is_starter
from pages import put

SIDE_STEP = "side-step"
"""A hover to the left."""
TASKS: Mapping[str, Sequence[str]] = {
    "ironcub": tuple(scenarios.SCENARIOS),
    "ironcub-mk3": tuple(scenarios.SCENARIOS),
    "solo12": ("jump", "walk", "trot"),
    "talos": ("step", "squat", "jump"),
    "quadrotor": ("hover", SIDE_STEP),
}
"""The tasks of each bundled robot."""
SIZES: Mapping[str, tuple[str, float]] = {
    "squat": ("depth", 0.2),
    "step": ("ahead", 0.3),
    "walk": ("distance", 0.8),
    "trot": ("distance", 1.5),
}
"""The size of a starter task, and how much of L it is where it is not said."""
SPREAD = 0.3
"""By how much of itself the size of a starter task varies, either way [1]."""
HEIGHT, DISTANCE = Sized(0.05, "m"), Sized(0.2, "m")
TIME_LIMIT = 600.0  # of a solve [s]; generous, so that a loaded machine does not decide


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """What became of one variation."""

    robot: str
    scenario: str
    index: int
    seed: int
    drawn: str
    status: str
    advice: str
    iterations: int
    seconds: float
    failed: tuple[str, ...]  # properties of the audit

    @property
    def passed(self) -> bool:
        """Return whether it was solved and passed the audit."""
        return self.status in ("optimal", "acceptable") and not self.failed


def vary(robot_name: str, name: str, index: int, seed: int) -> tuple[Robot, Scenario, str]:
    """Return robot and scenario of a variation, and what was drawn.

    Args:
        robot_name: of a bundled robot.
        name: of the task.
        index: of the variation.
        seed: of all of them.
    """
    if robot_name == "ironcub":
        rng = np.random.default_rng([seed, sorted(scenarios.SCENARIOS).index(name), index])
    else:
        rng = np.random.default_rng([seed, *robot_name.encode(), *name.encode(), index])
    height, distance, friction, mass = (float(rng.uniform(*ends)) for ends in ((-1, 1), (-1, 1), (0.25, 0.6), (-1, 1)))
    robot = _heavier(robot_name, 1.0 + 0.03 * mass)
    turns = rng.uniform(-0.05, 0.05, size=len(robot.joint_names))
    limits, home = robot.joint_limits, robot.home
    posture = np.clip(home.joint_positions + turns, limits.lower, limits.upper)
    robot = replace(robot, home=replace(home, joint_positions=posture))
    if is_starter(name, robot_name) or name == SIDE_STEP:
        friction = robot.friction * (0.75 + 0.5 * (friction - 0.25) / 0.35)
        task, size = _starter(robot, name, height)
        return robot, replace(task, friction=friction), f"{size}, friction {friction:.2f}, mass {1 + 0.03 * mass:.3f}"
    height, distance = HEIGHT.of(robot.units) * height, DISTANCE.of(robot.units) * distance
    task, far = _moved(replace(mt.tasks.find(name, robot), friction=friction), height, distance)
    return robot, task, f"height {height:+.3f} m, friction {friction:.2f}, mass {1 + 0.03 * mass:.3f}{far}"


def _starter(robot: Robot, name: str, share: float) -> tuple[Scenario, str]:
    """Return a starter task whose size is changed by a share of `SPREAD`, and the size in words."""
    factor = 1.0 + SPREAD * share
    if name in ("hover", SIDE_STEP):
        usual = mt.tasks.hover(robot)
        begin, end = np.array(usual.initial_com_shift), np.array(usual.final_com_shift)
        x, y, z = factor * (end - begin)
        by = (x, y, z) if name == "hover" else (y, x, z)
        return mt.tasks.hover(robot, by=by), f"by {factor * np.linalg.norm(end - begin):.3f} m"
    if name == "jump":
        height = factor * ((mt.tasks.jump(robot).mid_height_min or 0.0) - robot.home_com[2])
        return mt.tasks.jump(robot, height=height), f"height {height:.3f} m"
    what, usual_share = SIZES[name]
    size = usual_share * factor * robot.standing_height
    return mt.tasks.TASKS[name](robot, **{what: size}), f"{what} {size:.3f} m"


def _moved(scenario: Scenario, height: float, distance: float) -> tuple[Scenario, str]:
    """Return a bundled scenario with its target elsewhere, and the distance in words.

    Args:
        scenario: the task.
        height: how much higher the target is [m].
        distance: how much farther, where there is a way to go [m].
    """
    if not scenario.jets:
        height = -abs(height)  # the jump is as high as the motors can
    if scenario.mid_height_min is not None:
        return replace(scenario, mid_height_min=scenario.mid_height_min + height), ""
    target = "initial_com" if scenario.start is mt.Start.HOVER else "final_com"
    x, y, z = getattr(scenario, target)
    scenario = replace(scenario, **{target: (x, y, z + height)})
    x, y, z = scenario.end_com
    if isinstance(scenario.surface, Stairs):
        step = replace(scenario.surface, edges=(scenario.surface.edges[0] + 0.5 * distance,))
        scenario = replace(
            scenario, walls=tuple(replace(wall, offset=wall.offset + 0.5 * distance) for wall in scenario.walls)
        )
        moved = replace(scenario, surface=step, final_com=(x + 0.5 * math.copysign(distance, x * distance), y, z))
        return moved, f", distance {0.5 * distance:+.3f} m"
    if x:
        return replace(
            scenario, final_com=(x + math.copysign(distance, x * distance), y, z)
        ), f", distance {distance:+.3f} m"
    return scenario, ""


def _heavier(name: str, factor: float) -> Robot:
    """Return a bundled robot with every mass and inertia multiplied."""
    folder = bundled_robots()[name]
    tree = etree.parse(mt.load_robot(folder).urdf)
    for element in (*tree.iter("mass"), *tree.iter("inertia")):
        for key, value in element.attrib.items():
            element.set(key, repr(float(value) * factor))
    text = (folder / ROBOT_FILE).read_text(encoding="utf-8")
    with tempfile.TemporaryDirectory() as copy:
        tree.write(Path(copy) / "heavier.urdf")
        heavier = re.sub(r'(?m)^urdf = ".*"$', 'urdf = "heavier.urdf"', text)
        (Path(copy) / ROBOT_FILE).write_text(heavier, encoding="utf-8")
        return mt.load_robot(Path(copy))


def run(drawn: tuple[str, str, int, int]) -> Outcome:
    """Solve and audit one variation."""
    robot_name, name, index, seed = drawn
    words, iterations, seconds, failed = "", 0, 0.0, tuple[str, ...]()
    try:
        robot, scenario, words = vary(robot_name, name, index, seed)
        problem = mt.build(robot, scenario)
        solution = mt.solve(problem, mt.Ipopt(time_limit=TIME_LIMIT))
        status, advice = solution.status.value, solution.status.advice
        iterations, seconds = solution.iterations, solution.solve_time
        report = mt.audit(problem.robot, solution.trajectory)
        failed = tuple(finding.name for finding in report.findings if not finding.holds)
    except mt.MultimodalError as error:
        status, advice = type(error).__name__, str(error)
    return Outcome(
        robot=robot_name,
        scenario=name,
        index=index,
        seed=seed,
        drawn=words,
        status=status,
        advice=advice,
        iterations=iterations,
        seconds=seconds,
        failed=failed,
    )


def known(lines: Path | None) -> list[Outcome]:
    """Return the outcomes that a file of lines has."""
    if lines is None or not lines.exists():
        return []
    tables = map(json.loads, lines.read_text(encoding="utf-8").splitlines())
    return [Outcome(**{**table, "failed": tuple(table["failed"])}) for table in tables]


def markdown(outcomes: Sequence[Outcome]) -> str:
    """Return the table, and how many of each robot are solved and true."""
    lines = ["| robot | task | solved and true | iterations, median | greatest |", "|--|--|--|--|--|"]
    groups = dict[tuple[str, str], list[Outcome]]()
    for outcome in outcomes:
        groups.setdefault((outcome.robot, outcome.scenario), []).append(outcome)
    for (robot, name), own in groups.items():
        counts = [outcome.iterations for outcome in own]
        passed = sum(outcome.passed for outcome in own)
        lines.append(f"| {robot} | {name} | {passed} of {len(own)} | {np.median(counts):.0f} | {max(counts)} |")
    lines.append("")
    for robot in dict.fromkeys(outcome.robot for outcome in outcomes):
        own = [outcome for outcome in outcomes if outcome.robot == robot]
        passed = sum(outcome.passed for outcome in own)
        lines.append(f"- {robot}: {passed} of {len(own)}, {100 * passed / len(own):.0f} %")
    return "\n".join(lines)


def main() -> None:
    """Run all variations and print what became of them."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("tasks", nargs="*", help="names of tasks; by default all that each robot has")
    parser.add_argument("--robot", nargs="+", default=["ironcub"], choices=sorted(TASKS))
    parser.add_argument("--variations", type=int, default=10)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument(
        "--lines", type=Path, metavar="FILE", help="append one JSON line each; go on from what is there"
    )
    parser.add_argument("--into", type=Path, metavar="PAGE", help="also set the table between the marks of a page")
    options = parser.parse_args()
    console, outcomes = Console(), known(options.lines)
    there = {(one.robot, one.scenario, one.index, one.seed) for one in outcomes}
    draws = [
        (robot, name, index, options.seed)
        for index in range(options.variations)
        for robot in options.robot
        for name in TASKS[robot]
        if not options.tasks or name in options.tasks
    ]
    with multiprocessing.get_context("spawn").Pool(options.workers, maxtasksperchild=10) as pool:
        for outcome in pool.imap_unordered(run, [draw for draw in draws if draw not in there]):
            outcomes.append(outcome)
            if options.lines is not None:
                with options.lines.open("a", encoding="utf-8") as file:
                    file.write(json.dumps(asdict(outcome)) + "\n")
            verdict = "passes" if outcome.passed else f"fails: {', '.join(outcome.failed) or outcome.advice}"
            console.print(
                f"{outcome.robot} {outcome.scenario} {outcome.index}: {outcome.drawn}: {outcome.status}, "
                f"{outcome.iterations} iterations, {outcome.seconds:.0f} s, {verdict}",
                soft_wrap=True,
            )
    named = {(robot, name, options.seed) for robot in options.robot for name in options.tasks or TASKS[robot]}
    mine = [one for one in outcomes if (one.robot, one.scenario, one.seed) in named]
    text = markdown(sorted(mine, key=lambda one: (options.robot.index(one.robot), tasks_order(one), one.index)))
    print(text)
    if options.into is not None:
        put(options.into, "robustness", text)


def tasks_order(outcome: Outcome) -> int:
    """Return where the task of an outcome stands among those of its robot."""
    return TASKS[outcome.robot].index(outcome.scenario)


if __name__ == "__main__":
    main()

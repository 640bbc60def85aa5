"""How well the bundled scenarios bear variation: target, distance, friction, mass and start posture, drawn with a seed.

    python benchmarks/robustness.py [SCENARIO ...] [--variations 10] [--seed 1] [--workers 2]

Every variation changes all of them at once: the target's height by up to ±0.05 m (the jump, which is as high as the
motors can, by down to −0.05 m); the distance, where there is one, by up to ±0.2 m (the step and the place on it by
±0.1 m); the friction within 0.25 to 0.6; every mass and inertia by up to ±3 %; every joint of the posture that the
robot stands near by up to ±0.05 rad, within its range. Each is solved from the plain start guess with default options,
and audited. One line each, then a table.
"""

from __future__ import annotations

import argparse
import multiprocessing
import shutil
import tempfile
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from lxml import etree
from rich.console import Console
from rich.table import Table

import multimodal_to as mt
from multimodal_to import scenarios
from multimodal_to.models.robot import Robot, bundled_robots
from multimodal_to.models.terrain import Stairs
from multimodal_to.scenarios.scenario import Scenario

TIME_LIMIT = 600.0  # of a solve [s]; generous, so that a loaded machine does not decide


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """What became of one variation."""

    scenario: str
    index: int
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


def vary(name: str, index: int, seed: int) -> tuple[Robot, Scenario, str]:
    """Return robot and scenario of a variation, and what was drawn."""
    rng = np.random.default_rng([seed, sorted(scenarios.SCENARIOS).index(name), index])
    height, distance = rng.uniform(-0.05, 0.05), rng.uniform(-0.2, 0.2)
    friction, mass, turns = rng.uniform(0.25, 0.6), rng.uniform(0.97, 1.03), rng.uniform(-0.05, 0.05, size=23)
    robot = _heavier(mass)
    limits, home = robot.joint_limits, robot.home
    posture = np.clip(home.joint_positions + turns, limits.lower, limits.upper)
    robot = replace(robot, home=replace(home, joint_positions=posture))
    scenario = replace(scenarios.find(name), friction=friction)
    if not scenario.jets:
        height = -abs(height)  # the jump is as high as the motors can
    drawn = f"height {height:+.3f} m, friction {friction:.2f}, mass {mass:.3f}"
    if scenario.mid_height_min is not None:
        return robot, replace(scenario, mid_height_min=scenario.mid_height_min + height), drawn
    target = "initial_com" if scenario.start is mt.Start.HOVER else "final_com"
    x, y, z = getattr(scenario, target)
    scenario = replace(scenario, **{target: (x, y, z + height)})
    x, y, z = scenario.final_com
    if isinstance(scenario.surface, Stairs):
        step = replace(scenario.surface, edges=(scenario.surface.edges[0] + 0.5 * distance,))
        scenario = replace(scenario, surface=step, final_com=(x - 0.5 * distance, y, z))
        drawn += f", distance {0.5 * distance:+.3f} m"
    elif x:
        scenario = replace(scenario, final_com=(x - distance, y, z))
        drawn += f", distance {distance:+.3f} m"
    return robot, scenario, drawn


def _heavier(factor: float) -> Robot:
    """Return the iRonCub with every mass and inertia multiplied."""
    with tempfile.TemporaryDirectory() as folder:
        copy = Path(folder) / "ironcub"
        shutil.copytree(bundled_robots()["ironcub"], copy)
        tree = etree.parse(copy / "ironcub.urdf")
        for element in (*tree.iter("mass"), *tree.iter("inertia")):
            for key, value in element.attrib.items():
                element.set(key, repr(float(value) * factor))
        tree.write(copy / "ironcub.urdf")
        return mt.load_robot(copy)


def run(task: tuple[str, int, int]) -> Outcome:
    """Solve and audit one variation."""
    name, index, seed = task
    robot, scenario, drawn = vary(name, index, seed)
    try:
        solution = mt.solve(mt.build(robot, scenario), mt.Ipopt(time_limit=TIME_LIMIT))
    except mt.MultimodalError as error:
        return Outcome(
            scenario=name,
            index=index,
            drawn=drawn,
            status=type(error).__name__,
            advice=str(error),
            iterations=0,
            seconds=0.0,
            failed=(),
        )
    report = mt.audit(robot if scenario.jets else robot.with_jets(()), solution.trajectory)
    return Outcome(
        scenario=name,
        index=index,
        drawn=drawn,
        status=solution.status.value,
        advice=solution.status.advice,
        iterations=solution.iterations,
        seconds=solution.solve_time,
        failed=tuple(finding.name for finding in report.findings if not finding.holds),
    )


def main() -> None:
    """Run all variations and print what became of them."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("scenarios", nargs="*", default=list(scenarios.SCENARIOS))
    parser.add_argument("--variations", type=int, default=10)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--workers", type=int, default=1)
    options = parser.parse_args()
    console, outcomes = Console(), list[Outcome]()
    tasks = [(name, index, options.seed) for name in options.scenarios for index in range(options.variations)]
    with multiprocessing.get_context("spawn").Pool(options.workers, maxtasksperchild=1) as pool:
        for outcome in pool.imap(run, tasks):
            outcomes.append(outcome)
            verdict = "passes" if outcome.passed else f"fails: {', '.join(outcome.failed) or outcome.advice}"
            console.print(
                f"{outcome.scenario} {outcome.index}: {outcome.drawn}: {outcome.status}, {outcome.iterations} "
                f"iterations, {outcome.seconds:.0f} s, {verdict}",
                soft_wrap=True,
            )
    table = Table("scenario", "solved and true", "iterations, median", "greatest")
    for name in options.scenarios:
        own = [outcome for outcome in outcomes if outcome.scenario == name]
        counts = [outcome.iterations for outcome in own]
        passed = sum(outcome.passed for outcome in own)
        table.add_row(name, f"{passed} of {len(own)}", f"{np.median(counts):.0f}", str(max(counts)))
    console.print(table)


if __name__ == "__main__":
    main()

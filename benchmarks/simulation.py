"""How far plans survive MuJoCo, undisturbed and disturbed: the tables of docs/playback.md and docs/simulation.md.

    python benchmarks/simulation.py [SCENARIO | ROBOT:TASK | TRAJECTORY.npz ...] [--trials 20] [--seed 1] [--jobs 2]
        [--controller servos | whole-body] [--gains 0] [--noise 0] [--late 0] [--keep FOLDER] [--into PAGE]

A bundled scenario, by its name, is solved first with default options; a trajectory file is played back as it is.
`solo12:trot` is a starter task of a bundled robot, or of one whose URDF `benchmarks/tasks.py` knows, of which
`robot init` makes a robot. `quadrotor:hover:by=[0,0.5,0]` is a task with another argument.

Each plan is played back once undisturbed, with torques clipped at the joints' effort limits, and then in trials that
are drawn from the seed. `--gains` adds playbacks in which only the controller's gains differ, each within ±20 %, and
`--noise` trials with noise of sensors and an estimate that drifts. `--late` adds trials whose push starts between 1 s
before the robot leaves the ground and 0.2 s after. `--keep` writes every trial to a JSON file, and `--into` puts the
table between the marks `other robots` of a page.
"""

from __future__ import annotations

import argparse
import json
import tempfile
from collections.abc import Sequence
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np
from rich.console import Console

import multimodal_to as mt
from multimodal_to import scenarios
from multimodal_to.models.loading import bundled_robots
from multimodal_to.simulation import Draws, Trial, run_trial, run_trials
from multimodal_to.simulation.trials import CONTROLLERS, Make, gains_alone
from multimodal_to.trajectory import Trajectory
from multimodal_to.trajectory.derived import flight_phases
from pages import put
from tasks import JETS, urdf_of

BEFORE, AFTER = (
    1.0,
    0.2,
)  # from when to when a late push starts, about the moment at which the robot leaves the ground [s]


def plan_of(asked: str, scratch: Path) -> tuple[str, mt.Robot, Trajectory]:
    """Return a trajectory with its robot and its title: from its file, or of a task, solved.

    Args:
        asked: as on the command line.
        scratch: folder for robots that are made.

    Raises:
        SystemExit: the task has no solution.
    """
    if asked.endswith(".npz"):
        plan = Trajectory.load(asked)
        return plan.scenario, mt.load_robot(plan.robot).with_jets(plan.jet_names), plan
    if ":" in asked:
        name, task, *settings = asked.split(":", 2)
        robot = robot_of(name, scratch)
        scenario, title = mt.tasks.find(task, robot, settings), " ".join([name, task, *settings])
    else:
        robot, scenario, title = mt.load_robot("ironcub"), scenarios.find(asked), asked
    problem = mt.build(robot, scenario)
    solution = mt.solve(problem)
    if not solution.status.solved:
        raise SystemExit(f"'{asked}' is not solved: {solution.status.value}")
    return title, problem.robot, solution.trajectory


def robot_of(name: str, scratch: Path) -> mt.Robot:
    """Return a bundled robot, or one made of a URDF.

    Args:
        name: of the robot.
        scratch: folder for robots that are made.
    """
    if name in bundled_robots():
        return mt.load_robot(name)
    if not (scratch / name).exists():
        return mt.robots.init(urdf_of(name), scratch / name, jets=JETS.get(name, ())).robot
    return mt.load_robot(scratch / name)


def ended(trial: Trial) -> str:
    """Return how a playback ended, in words."""
    return trial.end if trial.fell is None else f"falls at {trial.fell:.1f} s"


def survivors(trials: Sequence[Trial]) -> str:
    """Return how many survive, and within which errors."""
    good = [trial for trial in trials if trial.survived]
    if not good:
        return f"0 of {len(trials)}"
    com, base = (
        100 * max(trial.com_error_max for trial in good),
        np.degrees(max(trial.base_error_max for trial in good)),
    )
    return f"{len(good)} of {len(trials)}, {com:.1f} cm, {base:.1f}°"


def row(
    robot: mt.Robot, plan: Trajectory, options: argparse.Namespace, make: Make
) -> tuple[list[str], dict[str, list[Trial]]]:
    """Return a row of the table, and its trials by their kind.

    Args:
        robot: that moves.
        plan: its motion.
        options: of the command line.
        make: the controller.

    Raises:
        SystemExit: late pushes are asked of a robot that never leaves the ground.
    """
    draws = Draws(seed=options.seed)

    def drawn(count: int, how: Draws) -> list[Trial]:
        found = run_trials(robot, plan, range(count), how, make=make, jobs=options.jobs)
        return sorted(found, key=lambda trial: trial.number)

    alone = run_trial(robot, plan, None, make=make)[1]
    kinds = {"undisturbed": [alone]}
    if options.trials:
        kinds["disturbed"] = drawn(options.trials, draws)
    if options.gains:
        kinds["gains"] = [gains_alone(robot, plan, number, options.seed, make=make) for number in range(options.gains)]
    if options.noise:
        kinds["noise"] = drawn(options.noise, replace(draws, noise=True))
    if options.late:
        if not (flights := flight_phases(robot, plan)):
            raise SystemExit(f"'{plan.scenario}' never leaves the ground; expected a plan that does with --late")
        leaves = flights[0][0] - float(plan.time[0])
        kinds["late"] = drawn(options.late, replace(draws, push_starts=(leaves - BEFORE, leaves + AFTER)))
    times = [trial.control_time for trials in kinds.values() for trial in trials]
    cells = [
        f"{100 * alone.com_error_max:.1f} cm",
        f"{np.degrees(alone.base_error_max):.1f}°",
        f"{alone.torque_ratio_max:.2f}",
        f"{alone.touch_down_speed_max:.2f} m/s",
        ended(alone),
        *([survivors(kinds["disturbed"])] if options.trials else []),
        f"{1e3 * np.mean(times):.2f} ms",
        *(survivors(kinds[kind]) for kind in ("gains", "noise", "late") if kind in kinds),
    ]
    return cells, kinds


def main() -> None:
    """Print the table, a row as soon as it is known."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("plans", nargs="*", default=list(scenarios.SCENARIOS), metavar="SCENARIO|ROBOT:TASK|FILE")
    parser.add_argument("--trials", type=int, default=20, help="disturbed playbacks of each plan")
    parser.add_argument("--seed", type=int, default=1, help="from which all is drawn")
    parser.add_argument("--jobs", type=int, default=2, help="processes")
    parser.add_argument("--controller", choices=list(CONTROLLERS), default=next(iter(CONTROLLERS)))
    parser.add_argument("--gains", type=int, default=0, help="playbacks with other gains alone")
    parser.add_argument("--noise", type=int, default=0, help="trials with noise")
    parser.add_argument("--late", type=int, default=0, help="trials that are pushed as the robot leaves the ground")
    parser.add_argument("--keep", type=Path, help="folder for a JSON file of each plan")
    parser.add_argument("--into", type=Path, metavar="PAGE", help="also set the table between the marks of a page")
    options = parser.parse_args()
    make, console = CONTROLLERS[options.controller], Console(highlight=False, soft_wrap=True, markup=False)
    titles = ["plan", "CoM", "base", "torque / effort", "touch-down", "end"]
    titles += [f"{options.trials} trials"] if options.trials else []
    titles += ["command"]
    titles += [f"{options.gains} with other gains"] if options.gains else []
    titles += [f"{options.noise} with noise"] if options.noise else []
    titles += [f"{options.late} pushed late"] if options.late else []
    lines = [f"| {' | '.join(titles)} |", f"|{' -- |' * len(titles)}"]
    console.print("\n".join(lines))
    with tempfile.TemporaryDirectory() as scratch:
        for asked in options.plans:
            title, robot, plan = plan_of(asked, Path(scratch))
            cells, kinds = row(robot, plan, options, make)
            lines.append(f"| {' | '.join([title, *cells])} |")
            console.print(lines[-1])
            if options.keep is not None:
                options.keep.mkdir(parents=True, exist_ok=True)
                of_kind = {kind: [asdict(trial) for trial in trials] for kind, trials in kinds.items()}
                text = json.dumps({"plan": title, "seed": options.seed, "trials": of_kind})
                (options.keep / f"{title}.json").write_text(text, encoding="utf-8")
    if options.into:
        put(options.into, "other robots", "\n".join(lines))


if __name__ == "__main__":
    main()

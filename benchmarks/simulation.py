"""How far plans survive MuJoCo, undisturbed and disturbed: the table of docs/playback.md.

    python benchmarks/simulation.py [SCENARIO | TRAJECTORY.npz ...] [--trials 20] [--seed 1] [--jobs 2]
        [--controller servos | whole-body] [--gains 0] [--noise 0] [--keep FOLDER]

A bundled scenario, by its name, is solved first with default options; a trajectory file is played back as it is. Each
plan is played back once undisturbed, with torques clipped at the joints' effort limits, and then in trials that are
drawn from the seed. `--gains` adds playbacks in which only the controller's gains differ, each within ±20 %, and
`--noise` trials with noise of sensors and an estimate that drifts. `--keep` writes every trial to a JSON file.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path

import numpy as np
from rich.console import Console

import multimodal_to as mt
from multimodal_to import scenarios
from multimodal_to.simulation import Draws, Trial, run_trial, run_trials
from multimodal_to.simulation.trials import CONTROLLERS, Make, gains_alone
from multimodal_to.trajectory import Trajectory


def plan_of(name: str) -> Trajectory:
    """Return a trajectory from its file, or that of a bundled scenario, solved."""
    if name.endswith(".npz"):
        return Trajectory.load(name)
    scenario = scenarios.find(name)
    return mt.solve(mt.build(mt.load_robot("ironcub"), scenario)).trajectory


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


def row(plan: Trajectory, options: argparse.Namespace, make: Make) -> tuple[list[str], list[Trial]]:
    """Return a row of the table, and its trials."""
    robot = mt.load_robot(plan.robot).with_jets(plan.jet_names)
    alone = run_trial(robot, plan, None, make=make)[1]
    run = {"make": make, "jobs": options.jobs}
    trials = list(run_trials(robot, plan, range(options.trials), Draws(seed=options.seed), **run))
    cells = [
        f"{100 * alone.com_error_max:.1f} cm",
        f"{np.degrees(alone.base_error_max):.1f}°",
        f"{alone.torque_ratio_max:.2f}",
        f"{alone.touch_down_speed_max:.2f} m/s",
        ended(alone),
        survivors(trials),
        f"{1e3 * np.mean([trial.control_time for trial in [alone, *trials]]):.2f} ms",
    ]
    if options.gains:
        others = [gains_alone(robot, plan, number, options.seed, make=make) for number in range(options.gains)]
        cells.append(survivors(others))
    if options.noise:
        noisy = Draws(seed=options.seed, noise=True)
        cells.append(survivors(list(run_trials(robot, plan, range(options.noise), noisy, **run))))
    return cells, [alone, *sorted(trials, key=lambda trial: trial.number)]


def main() -> None:
    """Print the table, a row as soon as it is known."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("plans", nargs="*", default=list(scenarios.SCENARIOS), metavar="SCENARIO|FILE")
    parser.add_argument("--trials", type=int, default=20, help="disturbed playbacks of each plan")
    parser.add_argument("--seed", type=int, default=1, help="from which all is drawn")
    parser.add_argument("--jobs", type=int, default=2, help="processes")
    parser.add_argument("--controller", choices=list(CONTROLLERS), default=next(iter(CONTROLLERS)))
    parser.add_argument("--gains", type=int, default=0, help="playbacks with other gains alone")
    parser.add_argument("--noise", type=int, default=0, help="trials with noise")
    parser.add_argument("--keep", type=Path, help="folder for a JSON file of each plan")
    options = parser.parse_args()
    make, console = CONTROLLERS[options.controller], Console(highlight=False, soft_wrap=True, markup=False)
    titles = ["plan", "CoM", "base", "torque / effort", "touch-down", "end", f"{options.trials} trials", "command"]
    titles += [f"{options.gains} with other gains"] if options.gains else []
    titles += [f"{options.noise} with noise"] if options.noise else []
    console.print(f"| {' | '.join(titles)} |\n|{' -- |' * len(titles)}")
    for name in options.plans:
        plan = plan_of(name)
        title = plan.scenario if name.endswith(".npz") else Path(name).stem
        cells, trials = row(plan, options, make)
        console.print(f"| {' | '.join([title, *cells])} |")
        if options.keep is not None:
            options.keep.mkdir(parents=True, exist_ok=True)
            text = json.dumps({"plan": title, "seed": options.seed, "trials": [asdict(trial) for trial in trials]})
            (options.keep / f"{title}.json").write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()

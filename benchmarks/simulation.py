"""How far plans survive MuJoCo: the table of docs/playback.md.

    python benchmarks/simulation.py [SCENARIO | TRAJECTORY.npz ...] [--trials 0] [--seed 1]

A bundled scenario, by its name, is solved first with default options; a trajectory file is played back as it is. Each
is played back with the stabiliser and with torques clipped at the joints' effort limits. Then it is played back without
that clip, with a motion that follows its forces by one interval, and without the stabiliser. Trials repeat the first
playback with the stabiliser's gains and spreads drawn each within ±20 %, and tell how many end as a plan should and
within what errors: whether the outcome hangs by a thread.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
from rich.console import Console

import multimodal_to as mt
from multimodal_to import scenarios
from multimodal_to.simulation import Tracking, play, stabiliser, tracking
from multimodal_to.trajectory import Trajectory

GAINS = (
    "COM_STIFFNESS",
    "COM_DAMPING",
    "ATTITUDE_STIFFNESS",
    "ATTITUDE_DAMPING",
    "THRUST_SPREAD",
    "LOAD_SPREAD",
    "JOINT_SPREAD",
    "RADIUS",
)
SPREAD = 0.2
SURVIVES = ("stands", "hovers")


def plan_of(name: str) -> Trajectory:
    """Return a trajectory from its file, or that of a bundled scenario, solved."""
    if name.endswith(".npz"):
        return Trajectory.load(name)
    scenario = scenarios.find(name)
    return mt.solve(mt.build(mt.load_robot("ironcub"), scenario)).trajectory


def playback(plan: Trajectory, *, stabilise: bool = True, delay: float = 0.0, torque_limits: bool = True) -> Tracking:
    """Return what comes of a plan."""
    robot = mt.load_robot(plan.robot).with_jets(plan.jet_names)
    return tracking(play(robot, plan, stabilise=stabilise, delay=delay, torque_limits=torque_limits))


@contextmanager
def other_gains(rng: np.random.Generator) -> Iterator[None]:
    """Let the stabiliser have other numbers for a while."""
    own = {name: getattr(stabiliser, name) for name in GAINS}
    try:
        for name, value in own.items():
            setattr(stabiliser, name, value * rng.uniform(1.0 - SPREAD, 1.0 + SPREAD))
        yield
    finally:
        for name, value in own.items():
            setattr(stabiliser, name, value)


def errors(outcome: Tracking) -> tuple[str, ...]:
    """Return the columns of the table that the stabiliser's playback fills."""
    late = [abs(switch.simulated - switch.planned) for switch in outcome.switches if switch.simulated is not None]
    if outcome.end not in SURVIVES:
        return "–", "–", "–", "–", *torques(outcome), ended(outcome)
    return (
        f"{100 * outcome.com:.1f} cm",
        f"{outcome.attitude:.1f}°",
        f"{outcome.joint:.0f}°",
        f"{max(late, default=0.0):.2f} s",
        *torques(outcome),
        ended(outcome),
    )


def torques(outcome: Tracking) -> tuple[str, str]:
    """Return the largest asked torque over effort with its joint, and for how long a joint was clipped at most."""
    largest = outcome.torques[0]
    return f"{largest.over_effort:.2f} ({largest.joint})", f"{outcome.longest_beyond:.3f} s"


def ended(outcome: Tracking) -> str:
    """Return how a playback ended, in words."""
    return outcome.end if outcome.fell is None else f"falls at {outcome.fell:.1f} s"


def in_short(outcome: Tracking) -> str:
    """Return how a playback ended, with its errors where it survived."""
    survived = f", {100 * outcome.com:.1f} cm and {outcome.attitude:.1f}°" if outcome.end in SURVIVES else ""
    return ended(outcome) + survived


def main() -> None:
    """Print the table, a row as soon as it is known."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("plans", nargs="*", default=list(scenarios.SCENARIOS), metavar="SCENARIO|FILE")
    parser.add_argument("--trials", type=int, default=0, help="playbacks with other gains")
    parser.add_argument("--seed", type=int, default=1, help="of the other gains")
    options = parser.parse_args()
    console = Console(highlight=False, soft_wrap=True, markup=False)
    titles = ["plan", "knots", "CoM", "base", "joints", "switch", "torque / effort", "clipped", "end"]
    titles += ["without limits", "delay of 1", "without stabiliser"]
    titles += [f"{options.trials} with other gains"] if options.trials else []
    console.print(f"| {' | '.join(titles)} |\n|{' -- |' * len(titles)}")
    for name in options.plans:
        plan = plan_of(name)
        row = [
            plan.scenario if name.endswith(".npz") else Path(name).stem,
            f"{plan.knots} of {plan.duration / plan.knots:.2f} s",
            *errors(playback(plan)),
            in_short(playback(plan, torque_limits=False)),
            in_short(playback(plan, delay=1.0)),
            in_short(playback(plan, stabilise=False)),
        ]
        if options.trials:
            rng, outcomes = np.random.default_rng(options.seed), []
            for _ in range(options.trials):
                with other_gains(rng):
                    outcomes.append(playback(plan))
            good = [outcome for outcome in outcomes if outcome.end in SURVIVES]
            row.append(f"{len(good)} survive")
            if good:
                row[-1] += f", at most {100 * max(o.com for o in good):.1f} cm and {max(o.attitude for o in good):.1f}°"
        console.print(f"| {' | '.join(row)} |")


if __name__ == "__main__":
    main()

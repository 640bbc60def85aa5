"""`simulate`: one playback, or disturbed trials of it."""

from __future__ import annotations

import hashlib
import json
import math
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from multimodal_to.cli.common import (
    File,
    RobotOption,
    app,
    loaded,
    number_option,
    out,
    say,
    whole_number_option,
    writable,
    writable_file,
)
from multimodal_to.cli.streams import print_json
from multimodal_to.errors import InputError, OutputError
from multimodal_to.files.writing import write_text
from multimodal_to.models.robot import Robot
from multimodal_to.trajectory import Trajectory

if TYPE_CHECKING:
    from multimodal_to.simulation import Draws, Playback, Tracking, Trial


@app.command()
def simulate(
    file: File,
    output: Annotated[
        Path | None, typer.Option("--output", "-o", help="Simulated trajectory to write. [FILE-simulated.npz]")
    ] = None,
    trials: Annotated[
        int | None,
        typer.Option(parser=whole_number_option, metavar="COUNT", help="Play it back so often, each time disturbed."),
    ] = None,
    seed: Annotated[
        int, typer.Option(parser=whole_number_option, metavar="INT", help="From which the disturbances are drawn.")
    ] = 1,
    jobs: Annotated[
        int, typer.Option(parser=whole_number_option, metavar="COUNT", help="How many trials run at once.")
    ] = 2,
    push: Annotated[
        float | None,
        typer.Option(parser=number_option, metavar="NEWTON", help="Force that pushes for 0.2 s. [0.114 of the weight]"),
    ] = None,
    noise: Annotated[
        bool, typer.Option("--noise", help="Let the controller see sensors with noise and a base that drifts.")
    ] = False,
    film: Annotated[
        Path | None, typer.Option(help="Write a page that plays it beside the plan; of trials, the worst.")
    ] = None,
    torque_limits: Annotated[bool, typer.Option(help="Clip joint torques at the robot's effort limits.")] = True,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object, for programs.")] = False,
    robot: RobotOption = "",
) -> None:
    """Let a controller carry a plan out in MuJoCo, say how far it gets, and write what happened as a trajectory.

    With --trials each playback has other masses, motors, friction and delay, and a push; the worst one is written.
    Trials that were done before are not done again. Exit status 0 when the robot survives, in every trial; 1 when not.

    Example: multimodal-to simulate results/take-off/trajectory.npz --trials 20 --seed 1
    """
    target = output or file.with_stem(f"{file.stem}-simulated")
    _refuse(target, trials, jobs)
    the_robot, plan = loaded(file, robot)
    from multimodal_to.simulation import Draws, run_trial, simulated_trajectory

    writable(target.parent)
    if film is not None:
        writable_file(film, ".html")
    draws = Draws(seed=seed, push=push, noise=noise)
    if trials is None:
        playback, trial = run_trial(the_robot, plan, None, torque_limits=torque_limits)
        done = [trial]
        if not as_json:
            _say_playback(the_robot, plan, playback)
    else:
        notes = target.with_name(f"{file.stem}-trials.json")
        done = _trials(the_robot, plan, draws, trials, jobs=jobs, torque_limits=torque_limits, log=notes, quiet=as_json)
        worst = max(done, key=lambda trial: (not trial.survived, -(trial.fell or 0.0), trial.com_error_max))
        playback, _ = run_trial(the_robot, plan, worst.number, draws, torque_limits=torque_limits)
        if not as_json:
            _say_trials(done, worst)
    simulated = simulated_trajectory(playback)
    wrote = [simulated.save(target)]
    if film is not None:
        wrote.append(_film(the_robot, plan, simulated, playback.fell, film))
    if as_json:
        print_json(_as_data(plan, draws, done, disturbed=trials is not None))
    else:
        for path in wrote:
            out.print(f"wrote {path}", soft_wrap=True)
    raise typer.Exit(0 if all(trial.survived for trial in done) else 1)


def _refuse(target: Path, trials: int | None, jobs: int) -> None:
    if target.suffix.lower() != ".npz":
        raise OutputError(f"'{target}' is no .npz")
    for name, value in (("--trials", trials), ("--jobs", jobs)):
        if value is not None and value < 1:
            raise InputError(f"{name} is {value}; expected at least one")


def _film(robot: Robot, plan: Trajectory, simulated: Trajectory, fell: float | None, path: Path) -> Path:
    from multimodal_to.replay import write_html

    marks = {} if fell is None else {float(plan.time[0]) + min(fell, plan.duration): "it fell"}
    return write_html(robot, simulated, path, ghost=plan, marks=marks)


def _as_data(plan: Trajectory, draws: Draws, done: list[Trial], *, disturbed: bool) -> dict[str, Any]:
    return {
        "scenario": plan.scenario,
        "robot": plan.robot,
        "duration": plan.duration,
        "seed": draws.seed if disturbed else None,
        "survived": sum(trial.survived for trial in done),
        "trials": [asdict(trial) for trial in done],
    }


def _trials(
    robot: Robot, plan: Trajectory, draws: Draws, count: int, *, jobs: int, torque_limits: bool, log: Path, quiet: bool
) -> list[Trial]:
    """Run the trials that a file does not hold yet, and keep each there as soon as it is done."""
    from multimodal_to.simulation import Trial, run_trials

    settings = asdict(draws) | {"torque_limits": torque_limits, "plan": _fingerprint(plan)}
    done = {trial["number"]: trial for trial in _kept(log, settings) if trial["number"] < count}
    missing = [number for number in range(count) if number not in done]
    if done and not quiet:
        out.print(f"{len(done)} of {count} trials are in {log}", soft_wrap=True)
    for trial in run_trials(robot, plan, missing, draws, torque_limits=torque_limits, jobs=jobs):
        done[trial.number] = asdict(trial)
        write_text(log, json.dumps({"settings": settings, "trials": [done[key] for key in sorted(done)]}, indent=1))
        line = f"trial {trial.number:3d}: {_ended(trial)} ({len(done)} of {count})"
        say("progress", "dim", line) if quiet else out.print(line, soft_wrap=True)
    return [Trial(**done[number]) for number in sorted(done)]


def _kept(log: Path, settings: dict[str, Any]) -> list[dict[str, Any]]:
    """Return the trials of a file, if they are of the same plan and settings."""
    try:
        kept = json.loads(log.read_text(encoding="utf-8"))
        return list(kept["trials"]) if kept["settings"] == settings else []
    except (OSError, ValueError, KeyError, TypeError, RecursionError):
        return []


def _fingerprint(plan: Trajectory) -> str:
    digest = hashlib.sha256()
    for part in (plan.time, plan.base_position, plan.joint_positions, plan.contact_forces, plan.thrust):
        digest.update(part.tobytes())
    return digest.hexdigest()[:16]


def _ended(trial: Trial) -> str:
    """Return how a trial ended, with its errors where it survived."""
    if not trial.survived:
        return trial.end if trial.fell is None else f"fell at {trial.fell:.2f} s"
    return f"{trial.end}, CoM {100 * trial.com_error_max:.1f} cm, base {math.degrees(trial.base_error_max):.1f}°"


def _say_trials(done: list[Trial], worst: Trial) -> None:
    good = [trial for trial in done if trial.survived]
    out.print(f"{len(good)} of {len(done)} trials survive", soft_wrap=True)
    if good:
        com, base = max(trial.com_error_max for trial in good), max(trial.base_error_max for trial in good)
        out.print(
            f"largest errors of those: CoM {100 * com:.1f} cm, base {math.degrees(base):.1f}°; "
            f"torque {max(trial.torque_ratio_max for trial in good):.2f} of its effort limit, touch-down "
            f"{max(trial.touch_down_speed_max for trial in good):.2f} m/s",
            soft_wrap=True,
        )
    out.print(
        f"a command takes {1e3 * sum(trial.control_time for trial in done) / len(done):.2f} ms in the mean; the worst "
        f"trial is {worst.number}: {_ended(worst)}",
        soft_wrap=True,
    )


def _say_playback(robot: Robot, plan: Trajectory, playback: Playback) -> None:
    from multimodal_to import simulation

    outcome = simulation.tracking(playback)
    for note in playback.notes:
        out.print(f"note: {note}", soft_wrap=True)
    for where, states in {
        "at 100 random states": simulation.random_states(robot, 100),
        "along the plan": simulation.states_along(plan),
    }.items():
        out.print(
            f"inverse dynamics {where}: MuJoCo and RNEA differ by {simulation.disagreement(robot, states):.1e} of the "
            "largest force",
            soft_wrap=True,
        )
    _say_errors(plan, playback, outcome)
    for switch in outcome.switches:
        kind = "touch-down" if switch.touches else "lift-off"
        happened = "never" if switch.simulated is None else f"{switch.simulated - switch.planned:+.2f} s"
        out.print(f"{kind} of the {switch.foot} foot: planned at {switch.planned:.2f} s, simulated {happened}")
    when = "" if outcome.fell is None else f" at {outcome.fell:.2f} s"
    out.print(
        f"the robot {outcome.end}{when}; CoM error after the end "
        f"{100 * outcome.com_at_end:.1f} cm, base {outcome.attitude_at_end:.1f}°",
        soft_wrap=True,
    )


def _say_errors(plan: Trajectory, playback: Playback, outcome: Tracking) -> None:
    joints = f"joints {outcome.joint:.1f}° ({outcome.joint_name}), " if outcome.joint_name else ""
    slides = f"sliding joints {100 * outcome.slide:.1f} cm ({outcome.slide_name}), " if outcome.slide_name else ""
    out.print(
        f"largest errors over {plan.duration:.2f} s: CoM {100 * outcome.com:.1f} cm, base {outcome.attitude:.1f}°, "
        f"{joints}{slides}thrust {outcome.thrust:.1f} N",
        soft_wrap=True,
    )
    beyond = "clipped" if outcome.clipped else "not clipped, beyond it"
    for index, torque in enumerate(outcome.torques):
        if index == 0 or torque.beyond > 0.0:
            out.print(
                f"largest torque asked of {torque.joint}: {100 * torque.over_effort:.0f} % of its effort limit, at "
                f"{torque.when:.2f} s; {beyond} for {torque.beyond:.3f} s",
                soft_wrap=True,
            )
    out.print(
        f"largest touch-down speed {outcome.touch_down_speed:.2f} m/s; a command takes "
        f"{1e3 * playback.control_time:.2f} ms in the mean",
        soft_wrap=True,
    )

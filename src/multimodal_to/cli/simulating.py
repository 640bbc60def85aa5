"""`simulate`: one playback, or disturbed trials of it."""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from importlib.metadata import version
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
from multimodal_to.cli.completion import controllers
from multimodal_to.cli.streams import print_json
from multimodal_to.errors import InputError, OutputError, unknown
from multimodal_to.files.writing import write_text
from multimodal_to.models.robot import Robot
from multimodal_to.trajectory import QUANTITIES, Trajectory
from multimodal_to.trajectory.conditions import to_json

if TYPE_CHECKING:
    from multimodal_to.simulation import Draws, Playback, Tracking, Trial
    from multimodal_to.simulation.trials import Make


@app.command()
def simulate(
    file: File,
    output: Annotated[
        Path | None, typer.Option("--output", "-o", help="Simulated trajectory to write. [FILE-simulated.npz]")
    ] = None,
    controller: Annotated[
        str, typer.Option(metavar="NAME", help="servos or whole-body.", autocompletion=controllers)
    ] = "servos",
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
    from multimodal_to.simulation.trials import CONTROLLERS

    if controller not in CONTROLLERS:
        raise InputError(unknown("controller", controller, CONTROLLERS))
    make = CONTROLLERS[controller]
    writable(target.parent)
    if film is not None:
        writable_file(film, ".html")
    draws = Draws(seed=seed, push=push, noise=noise)
    if trials is None:
        playback, trial = run_trial(the_robot, plan, None, make=make, torque_limits=torque_limits)
        done = [trial]
        if not as_json:
            _say_playback(the_robot, plan, playback)
    else:
        settings = asdict(draws) | {"controller": controller, "torque_limits": torque_limits}
        log = _Log.of(target.with_name(f"{file.stem}-trials.json"), the_robot, plan, settings)
        done = _trials(the_robot, plan, draws, trials, make=make, jobs=jobs, log=log, quiet=as_json)
        worst = _worst(done)
        if not as_json:
            _say_trials(done, worst)
        playback, _ = run_trial(the_robot, plan, worst.number, draws, make=make, torque_limits=torque_limits)
    simulated = simulated_trajectory(playback)
    wrote = [simulated.save(target)]
    if film is not None:
        from multimodal_to.replay import mark_of_fall, write_html

        marks = mark_of_fall(plan, playback.fell)
        wrote.append(write_html(the_robot, simulated, film, ghost=plan, marks=marks))
    if as_json:
        print_json(_as_data(plan, draws, done, controller=controller, disturbed=trials is not None))
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


def _as_data(
    plan: Trajectory, draws: Draws, done: Sequence[Trial], *, controller: str, disturbed: bool
) -> dict[str, Any]:
    return {
        "scenario": plan.scenario,
        "robot": plan.robot,
        "duration": plan.duration,
        "controller": controller,
        "seed": draws.seed if disturbed else None,
        "survived": sum(trial.survived for trial in done),
        "trials": [asdict(trial) for trial in done],
    }


@dataclass(frozen=True, kw_only=True)
class _Log:
    """The file that keeps the trials of a plan; those that are drawn or carried out in another way stand apart."""

    path: Path
    settings: Mapping[str, Any]  # of these trials

    @classmethod
    def of(cls, path: Path, robot: Robot, plan: Trajectory, settings: Mapping[str, Any]) -> _Log:
        """Return the log of a plan.

        Args:
            path: of the file.
            robot: that moves.
            plan: its motion.
            settings: how trials are drawn and carried out.
        """
        from multimodal_to.simulation.model import mujoco_module

        versions = f"multimodal-to {version('multimodal-to')}, MuJoCo {mujoco_module().__version__}"
        own = {**settings, "plan": _fingerprint(robot, plan), "versions": versions}
        return cls(path=path, settings=json.loads(json.dumps(own)))  # as the file has them

    def trials(self) -> dict[int, Trial]:
        """Return the trials of these settings by their numbers."""
        return self._own(self._runs())

    def add(self, trial: Trial) -> None:
        """Keep a trial; the file is read again, since another command may have written to it."""
        kept = self._runs()
        own = self._own(kept) | {trial.number: trial}
        runs = [run for run in kept if not self._is_own(run)]
        runs.append({"settings": self.settings, "trials": [own[number] for number in sorted(own)]})
        plain = [run | {"trials": [asdict(one) for one in run["trials"]]} for run in runs]
        write_text(self.path, json.dumps({"runs": plain}, indent=1))

    def _own(self, runs: Sequence[Mapping[str, Any]]) -> dict[int, Trial]:
        return {trial.number: trial for run in runs for trial in run["trials"] if self._is_own(run)}

    def _is_own(self, run: Mapping[str, Any]) -> bool:
        return bool(run["settings"] == self.settings)

    def _runs(self) -> list[dict[str, Any]]:
        """Return what the file holds of this plan; nothing where it is none of these, and nothing of other plans."""
        from multimodal_to.simulation import Trial

        try:
            runs = json.loads(self.path.read_text(encoding="utf-8"))["runs"]
            return [
                {"settings": run["settings"], "trials": [Trial(**trial) for trial in run["trials"]]}
                for run in runs
                if run["settings"]["plan"] == self.settings["plan"]
                and run["settings"]["versions"] == self.settings["versions"]
            ]
        except (OSError, ValueError, KeyError, TypeError, RecursionError):
            return []


def _fingerprint(robot: Robot, plan: Trajectory) -> str:
    """Return what tells a plan from others: of its motion, its task, and the robot as its files have it now."""
    stated = to_json(robot), repr((robot.contacts, robot.home, robot.added_frames)), plan.rule, plan.scenario_json
    parts = [robot.urdf.read_bytes(), *(text.encode() for text in stated)]
    parts += [array.tobytes() for array in (plan.time, *(getattr(plan, name) for name in QUANTITIES))]
    digest = hashlib.sha256()
    for part in parts:
        digest.update(len(part).to_bytes(8) + part)
    return digest.hexdigest()[:16]


def _trials(
    robot: Robot,
    plan: Trajectory,
    draws: Draws,
    count: int,
    *,
    make: Make,
    jobs: int,
    log: _Log,
    quiet: bool,
) -> list[Trial]:
    """Run the trials that a log does not hold yet, and keep each there as soon as it is done."""
    from multimodal_to.simulation import run_trials

    def tell(line: str) -> None:
        say("progress", "dim", line) if quiet else out.print(line, soft_wrap=True)

    done = {number: trial for number, trial in log.trials().items() if number < count}
    missing = [number for number in range(count) if number not in done]
    if done:
        tell(f"{len(done)} of {count} trials are in {log.path}")
    if missing:
        tell(f"{len(missing)} to do, {min(jobs, len(missing))} at once; each is kept in {log.path} when it is done")
    limited = bool(log.settings["torque_limits"])
    for trial in run_trials(robot, plan, missing, draws, make=make, torque_limits=limited, jobs=jobs):
        done[trial.number] = trial
        log.add(trial)
        tell(f"trial {trial.number:3d}: {_ended(trial)} ({len(done)} of {count})")
    return [done[number] for number in sorted(done)]


def _worst(done: Sequence[Trial]) -> Trial:
    """Return the trial that fell first; where none fell one that did not survive, else that of the largest error."""
    return min(
        done,
        key=lambda trial: (trial.survived, math.inf if trial.fell is None else trial.fell, -trial.com_error_max),
    )


def _ended(trial: Trial) -> str:
    """Return how a trial ended, with its errors where it survived."""
    if not trial.survived:
        return trial.end if trial.fell is None else f"fell at {trial.fell:.2f} s"
    return f"{trial.end}, CoM {100 * trial.com_error_max:.1f} cm, base {math.degrees(trial.base_error_max):.1f}°"


def _say_trials(done: Sequence[Trial], worst: Trial) -> None:
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

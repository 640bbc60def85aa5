"""Disturbed playbacks of one plan: each is drawn from a seed, so that anyone can run it again."""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from multiprocessing.connection import Connection, wait
from multiprocessing.process import BaseProcess
from typing import Any, cast

import numpy as np

from multimodal_to.arguments import checked
from multimodal_to.errors import InputError, OutputError
from multimodal_to.models.robot import Robot
from multimodal_to.simulation.controller import Controller, drawn
from multimodal_to.simulation.disturbance import GAIN_SPREAD, Disturbance, draw
from multimodal_to.simulation.playback import Playback, play
from multimodal_to.simulation.report import tracking
from multimodal_to.simulation.servos import ServoController, ServoGains
from multimodal_to.simulation.whole_body import WholeBodyController, WholeBodyGains
from multimodal_to.trajectory import Trajectory
from multimodal_to.values import FrozenMapping

Make = Callable[[np.random.Generator | None], Controller]
"""What makes the controller of a trial: with gains drawn from the generator; without one, as they are."""


@checked
def servos(rng: np.random.Generator | None = None) -> Controller:
    """Return the `ServoController`; with a generator its gains are each drawn within ±20 %."""
    return ServoController(ServoGains() if rng is None else drawn(ServoGains(), rng, GAIN_SPREAD))


@checked
def whole_body(rng: np.random.Generator | None = None) -> Controller:
    """Return the `WholeBodyController`; with a generator its gains are each drawn within ±20 %."""
    return WholeBodyController(WholeBodyGains() if rng is None else drawn(WholeBodyGains(), rng, GAIN_SPREAD))


CONTROLLERS: Mapping[str, Make] = FrozenMapping({"servos": servos, "whole-body": whole_body})
"""The controllers of this library by name; the first one is what `play` and `simulate` use."""


@dataclass(frozen=True, kw_only=True)
class Trial:
    """What came of a playback; the errors of one that fell are those until it fell."""

    number: int  # of the trial, from 0
    survived: bool  # it stands or hovers at the end, as the plan does
    end: str  # "fell", "stands", "hovers" or "in the air"
    fell: float | None  # when [s]
    com_error_max: float  # [m]
    base_error_max: float  # [rad]
    torque_ratio_max: float  # largest torque that was asked of a motor over its effort limit [1]
    touch_down_speed_max: float  # of a contact point, downwards [m/s]; 0 where no foot came down
    control_time: float  # that a command took, in the mean [s]
    draw: Mapping[str, Any] | None  # what was changed of the robot; None: nothing


def _data(disturbance: Disturbance) -> dict[str, Any]:
    """Return a disturbance as what JSON can hold."""
    return {
        "masses": dict(disturbance.masses),
        "motor_gains": dict(disturbance.motor_gains),
        "friction": disturbance.friction,
        "delay": disturbance.delay,
        "push": None if disturbance.push is None else asdict(disturbance.push),
        "noise": None if disturbance.noise is None else asdict(disturbance.noise),
    }


@dataclass(frozen=True, kw_only=True)
class Draws:
    """How trials are drawn.

    Raises:
        InputError: a number is below zero or not finite.
    """

    seed: int = 1
    push: float | None = None  # force of the push [N]; 0.114 of the weight by default
    noise: bool = False  # sensors with noise and an estimate that drifts
    push_starts: tuple[float, float] | None = None  # from when to when a push starts [s]; by default at any time

    def __post_init__(self) -> None:
        if self.seed < 0 or not (self.push is None or 0.0 <= self.push < np.inf):
            raise InputError(f"the draws are {self}; expected a seed and a push of at least zero")
        starts = self.push_starts
        if starts is not None and not (len(starts) == 2 and -np.inf < starts[0] <= starts[1] < np.inf):
            raise InputError(f"the draws are {self}; expected push_starts as two finite numbers that do not fall")


@checked
def run_trial(
    robot: Robot,
    plan: Trajectory,
    number: int | None,
    draws: Draws | None = None,
    *,
    make: Make = servos,
    torque_limits: bool = True,
) -> tuple[Playback, Trial]:
    """Play a plan back once and return what happened and what came of it.

    Args:
        robot: that moves.
        plan: its motion.
        number: of the trial; it and the seed say how it is disturbed. None disturbs nothing.
        draws: how trials are drawn.
        make: the controller.
        torque_limits: clip the torque of each joint's motor at its effort limit.
    """
    draws, rng, disturbance = draws or Draws(), None, None
    if number is not None:
        rng = np.random.default_rng([draws.seed, number])
        starts = draws.push_starts
        disturbance = draw(robot, plan.duration, rng, push=draws.push, noise=draws.noise, push_starts=starts)
    controller = make(rng)
    playback = play(robot, plan, controller, disturbance=disturbance, torque_limits=torque_limits)
    return playback, _trial(playback, number or 0, disturbance)


def _trial(playback: Playback, number: int, disturbance: Disturbance | None) -> Trial:
    outcome = tracking(playback)
    return Trial(
        number=number,
        survived=outcome.survived,
        end=outcome.end,
        fell=outcome.fell,
        com_error_max=outcome.com,
        base_error_max=float(np.radians(outcome.attitude)),
        torque_ratio_max=outcome.torque_over_effort,
        touch_down_speed_max=outcome.touch_down_speed,
        control_time=playback.control_time,
        draw=None if disturbance is None else _data(disturbance),
    )


@checked
def run_trials(
    robot: Robot,
    plan: Trajectory,
    numbers: Sequence[int],
    draws: Draws | None = None,
    *,
    make: Make = servos,
    torque_limits: bool = True,
    jobs: int = 1,
) -> Iterator[Trial]:
    """Yield disturbed playbacks as they end.

    Args:
        robot: that moves.
        plan: its motion.
        numbers: of the trials.
        draws: how they are drawn.
        make: the controller; a function that other processes can import if there are several.
        torque_limits: clip the torque of each joint's motor at its effort limit.
        jobs: how many run at once, each in a process of its own.

    Raises:
        OutputError: a process of the trials ended before its trial did.
    """
    if jobs <= 1 or len(numbers) <= 1:
        for number in numbers:
            yield run_trial(robot, plan, number, draws, make=make, torque_limits=torque_limits)[1]
        return
    started = [_start(robot, plan, draws, make, torque_limits) for _ in range(min(jobs, len(numbers)))]
    waiting, busy = deque(numbers), set[Connection]()
    try:
        for pipe, _ in started:
            pipe.send(waiting.popleft())
            busy.add(pipe)
        while busy:
            for pipe in cast(list[Connection], wait(list(busy))):
                done = pipe.recv()
                if waiting:
                    pipe.send(waiting.popleft())
                else:
                    busy.remove(pipe)
                if isinstance(done, Exception):
                    raise done
                yield done
    except (EOFError, BrokenPipeError, ConnectionResetError) as error:
        raise OutputError(
            "a process of the trials ended before its trial did: memory may be short for so many at once, or a script "
            "lacks `if __name__ == '__main__':` around the call"
        ) from error
    finally:
        for pipe, process in started:
            process.terminate()
            process.join()
            pipe.close()


def _start(
    robot: Robot, plan: Trajectory, draws: Draws | None, make: Make, torque_limits: bool
) -> tuple[Connection, BaseProcess]:
    """Start a process that runs the trials whose numbers it is sent, and return the pipe to it.

    It does not hear Ctrl-C, from its first import on: its parent does, and it ends with that.

    Args:
        robot: that moves.
        plan: its motion.
        draws: how trials are drawn.
        make: the controller.
        torque_limits: clip the torque of each joint's motor at its effort limit.
    """
    context = multiprocessing.get_context("spawn")
    ours, theirs = context.Pipe()
    process = context.Process(target=_work, args=(theirs, robot, plan, draws, make, torque_limits), daemon=True)
    heard = signal.getsignal(signal.SIGINT)
    if threading.current_thread() is threading.main_thread() and heard is not None:
        signal.signal(signal.SIGINT, signal.SIG_IGN)  # which the process keeps
        try:
            process.start()
        finally:
            signal.signal(signal.SIGINT, heard)
    else:
        process.start()
    theirs.close()
    return ours, process


def _work(
    pipe: Connection, robot: Robot, plan: Trajectory, draws: Draws | None, make: Make, torque_limits: bool
) -> None:
    """Run trials until the parent has ended, however that did; send what came of each, or the error.

    Args:
        pipe: from which their numbers come.
        robot: that moves.
        plan: its motion.
        draws: how trials are drawn.
        make: the controller.
        torque_limits: clip the torque of each joint's motor at its effort limit.
    """
    threading.Thread(target=_end_with_the_parent, daemon=True).start()
    while True:
        number = pipe.recv()
        try:
            pipe.send(run_trial(robot, plan, number, draws, make=make, torque_limits=torque_limits)[1])
        except Exception as error:  # the parent raises it
            pipe.send(error)


def _end_with_the_parent() -> None:
    parent = multiprocessing.parent_process()
    assert parent is not None
    parent.join()
    os._exit(1)


@checked
def gains_alone(robot: Robot, plan: Trajectory, number: int, seed: int, *, make: Make = servos) -> Trial:
    """Play a plan back once with other gains of the controller, and nothing else disturbed.

    Args:
        robot: that moves.
        plan: its motion.
        number: of the playback; it and the seed say which gains.
        seed: of all of them.
        make: the controller.
    """
    playback = play(robot, plan, make(np.random.default_rng([seed, number])))
    return _trial(playback, number, None)

"""The state of a robot at an instant of a motion."""

from __future__ import annotations

from dataclasses import fields

import numpy as np

from multimodal_to.arguments import checked
from multimodal_to.errors import InputError
from multimodal_to.models.state import State
from multimodal_to.trajectory.resampling import at_times
from multimodal_to.trajectory.trajectory import Trajectory


@checked
def state_at(trajectory: Trajectory, time: float) -> State:
    """Return the state at a time of a motion [s], on its grid or between; `trajectory.time[k]` is that of knot k.

    Where velocities are in the middles of intervals, the velocity at a knot is the mean of the two that meet there.

    Raises:
        InputError: the time is not within the trajectory.
    """
    start, end = float(trajectory.time[0]), float(trajectory.time[-1])
    if not start <= time <= end:
        raise InputError(f"the time is {time:g} s; expected {start:g} to {end:g} s")
    wanted = np.array([time])
    return State(**{entry.name: at_times(trajectory, entry.name, wanted)[:, 0] for entry in fields(State)})

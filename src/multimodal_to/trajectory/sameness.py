"""Whether a motion is of the robot that it is used with."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from multimodal_to.errors import InputError, MultimodalError, listed
from multimodal_to.models.robot import Robot
from multimodal_to.trajectory.trajectory import Trajectory
from multimodal_to.values import FrozenMapping

_NAMES: Mapping[str, str] = FrozenMapping(
    {"joints": "joint_names", "contact points": "contact_names", "jets": "jet_names"}
)


def refuse_other_robot(
    trajectory: Trajectory,
    expected: Robot | Trajectory,
    *,
    what: str = "the trajectory",
    of: Sequence[str] = tuple(_NAMES),
    error: type[MultimodalError] = InputError,
) -> None:
    """Raise an error unless a trajectory is of the robot expected: the same names in the same order.

    Of two trajectories, the names of their robots have to be the same too. A robot of another name is no other robot
    where its joints, contact points and jets are called the same.

    Args:
        trajectory: the motion to judge.
        expected: the robot, or a motion of it.
        what: what the motion is called in the error.
        of: which names are compared: "joints", "contact points", "jets".
        error: what is raised.

    Raises:
        error: the trajectory is of another robot.
    """
    name = expected.name if isinstance(expected, Robot) else expected.robot
    if isinstance(expected, Trajectory) and trajectory.robot != name:
        raise error(f"{what} is for another robot: '{trajectory.robot}'; expected '{name}'")
    for label in of:
        there, here = (getattr(side, _NAMES[label]) for side in (trajectory, expected))
        if there != here:
            raise error(
                f"{what} is for another robot: its {label} are {listed(there)}; those of {name} are {listed(here)}"
            )

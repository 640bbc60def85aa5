"""Figures of one or several `Trajectory`s, which the caller shows or saves: nothing is shown here."""

# isort: off
from multimodal_to.arguments import checked
from multimodal_to.plotting import backend  # noqa: F401  # before all that imports matplotlib

# isort: on
from collections.abc import Mapping, Sequence
from typing import Protocol

from matplotlib.figure import Figure

from multimodal_to.errors import InputError, unknown
from multimodal_to.models.robot import Robot
from multimodal_to.plotting.contacts import plot_contacts
from multimodal_to.plotting.forces import plot_forces
from multimodal_to.plotting.joints import plot_joints, plot_torques
from multimodal_to.plotting.lettering import LetterWarning
from multimodal_to.plotting.margins import plot_margins
from multimodal_to.plotting.motion import plot_com, plot_momentum
from multimodal_to.plotting.style import SUFFIXES, save
from multimodal_to.trajectory import Trajectory
from multimodal_to.values import FrozenMapping

__all__ = [
    "FIGURES",
    "SUFFIXES",
    "LetterWarning",
    "plot",
    "plot_com",
    "plot_contacts",
    "plot_forces",
    "plot_joints",
    "plot_margins",
    "plot_momentum",
    "plot_torques",
    "save",
]


class _Plot(Protocol):
    def __call__(self, robot: Robot, *trajectories: Trajectory, labels: Sequence[str] | None = None) -> Figure: ...


FIGURES: Mapping[str, _Plot] = FrozenMapping(
    {
        "forces": plot_forces,
        "com": plot_com,
        "momentum": plot_momentum,
        "joints": plot_joints,
        "torques": plot_torques,
        "contacts": plot_contacts,
        "margins": plot_margins,
    }
)
"""The figures by name."""


@checked
def plot(name: str, robot: Robot, *trajectories: Trajectory, labels: Sequence[str] | None = None) -> Figure:
    """Return a figure by its name in `FIGURES`.

    Args:
        name: of the figure.
        robot: of all trajectories.
        *trajectories: to show together.
        labels: of the trajectories in the legend; by default the names of their scenarios.

    Raises:
        InputError: there is none of that name, or the trajectories are for different robots or too many.
    """
    if name not in FIGURES:
        raise InputError(unknown("figure", name, FIGURES))
    return FIGURES[name](robot, *trajectories, labels=labels)

"""Which contact points carry load when, the load of each foot, and the height of each foot."""

from __future__ import annotations

from collections.abc import Sequence

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from multimodal_to.arguments import checked
from multimodal_to.models.robot import Robot
from multimodal_to.plotting.lettering import lettered
from multimodal_to.plotting.style import (
    COLOURS,
    Run,
    draw_flight,
    draw_limits,
    draw_row,
    finish,
    legend_above,
    new_figure,
    runs_of,
)
from multimodal_to.trajectory import Trajectory
from multimodal_to.trajectory.derived import acting_times, flight_force, spans

_BAR = 0.8  # of the height that a contact point has in the timeline


@checked
def plot_contacts(robot: Robot, *trajectories: Trajectory, labels: Sequence[str] | None = None) -> Figure:
    """Plot a timeline of the contact points by foot, and each foot's vertical force [N] and least height [mm].

    A bar spans the time over which a point's forces act that are above `derived.flight_force`: `derived.acting_times`.
    Several runs stand below each other in the timeline.

    Raises:
        InputError: the trajectories are for different robots, or too many.
    """
    runs = runs_of(robot, trajectories, labels)
    rows = max(len(robot.contacts) * len(runs), 1)
    figure = new_figure(runs, "contacts", (8.0, 5.2 + 0.22 * rows))
    timeline, force, height = figure.subplots(3, 1, sharex=True, height_ratios=[0.9 + 0.22 * rows, 2.0, 2.0])
    feet = list(robot.feet)
    _draw_timeline(timeline, runs, feet)
    for number, run in enumerate(runs):
        forces, heights = (run.trajectory.per_contact(name)[:, 2] for name in ("contact_forces", "contact_positions"))
        for foot, colour in zip(feet, COLOURS, strict=False):
            members = list(run.robot.feet[foot])
            label = f"{foot} foot" if number == 0 else None
            look = {"color": colour, "linestyle": run.style}
            draw_row(force, run, forces[members].sum(axis=0), "contact_forces", label=label, **look)
            draw_row(height, run, 1e3 * heights[members].min(axis=0), "contact_positions", **look)
    draw_limits(force, {robot.weight}, "weight")
    force.set_ylabel("vertical force [N]")
    height.set_ylabel("least height [mm]")
    height.set_xlabel("time [s]")
    draw_flight((timeline, force, height), runs, labelled=force)
    finish((force, height), 2.0)
    legend_above(force)
    figure.align_ylabels()
    return lettered(figure)


def _draw_timeline(axes: Axes, runs: Sequence[Run], feet: Sequence[str]) -> None:
    names: list[str] = []
    for run in runs:
        loaded = run.trajectory.per_contact("contact_forces")[:, 2] > flight_force(run.robot)
        times = acting_times(run.trajectory)
        for contact, row in zip(run.robot.contacts, loaded, strict=True):
            colour = COLOURS[feet.index(contact.foot) % len(COLOURS)]
            bars = [(start, end - start) for start, end in spans(row, *times) if end > start]
            axes.broken_barh(bars, (len(names) - _BAR / 2, _BAR), facecolors=colour)
            names.append(contact.frame if len(runs) == 1 else f"{contact.frame}, {run.label}")
    axes.set_yticks(range(len(names)), names, fontsize="x-small")
    axes.set_ylim(len(names) - 0.4, -0.6)
    axes.set_ylabel("loaded")
    axes.grid(axis="x", alpha=0.3)

"""Throttle, thrust and contact force over time: the paper's figures."""

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
    draw_lines,
    draw_pushes,
    draw_row,
    finish,
    legend_above,
    new_figure,
    runs_of,
)
from multimodal_to.trajectory import Trajectory
from multimodal_to.trajectory.derived import vertical_thrust


@checked
def plot_forces(robot: Robot, *trajectories: Trajectory, labels: Sequence[str] | None = None) -> Figure:
    """Plot throttle [%], thrust [N] and total vertical contact force [N] over time, one panel each.

    Flight (`derived.flight_force`) is a translucent red band, a known push a purple one. Limits are dashed. Beside the
    contact force stand the weight m g and the vertical sum of the thrusts, which takes it over from the ground. Legends
    stand above the panels.

    Raises:
        InputError: the trajectories are for different robots, or too many.
    """
    runs = runs_of(robot, trajectories, labels)
    figure = new_figure(runs, "jets and contact forces", (7.5, 8.8))
    throttle, thrust, force = figure.subplots(3, 1, sharex=True)
    jets = list(dict.fromkeys(jet for run in runs for jet in run.robot.jets))
    names = max((run.trajectory.jet_names for run in runs), key=len)

    draw_lines(throttle, runs, [run.trajectory.throttle for run in runs], "throttle", names)
    draw_limits(throttle, {limit for jet in jets for limit in (jet.throttle_min, jet.throttle_max)}, "limits")
    throttle.set_ylabel("throttle [%]")
    draw_lines(thrust, runs, [run.trajectory.thrust for run in runs], "thrust", names)
    draw_limits(thrust, {jet.thrust_max for jet in jets}, "maximum")
    thrust.set_ylabel("thrust [N]")
    _draw_vertical(force, runs)
    draw_limits(force, {robot.weight}, "weight")
    force.set_ylabel("vertical force [N]")
    force.set_xlabel("time [s]")

    panels = (throttle, thrust, force)
    draw_flight(panels, runs, labelled=force)
    draw_pushes(panels, runs, labelled=force)
    finish(panels)
    for axes in panels:
        legend_above(axes)
    figure.align_ylabels()
    return lettered(figure)


def _draw_vertical(axes: Axes, runs: Sequence[Run]) -> None:
    for index, run in enumerate(runs):
        for values, of, colour, label in (
            (run.trajectory.vertical_contact_force(), "contact_forces", "black", "contact force"),
            (vertical_thrust(run.robot, run.trajectory), "thrust", COLOURS[1], "vertical thrust"),
        ):
            draw_row(axes, run, values, of, color=colour, linestyle=run.style, label=label if index == 0 else None)

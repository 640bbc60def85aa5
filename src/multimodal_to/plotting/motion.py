"""CoM and angular momentum over time, by component."""

from __future__ import annotations

from collections.abc import Sequence

from matplotlib.figure import Figure

from multimodal_to.arguments import checked
from multimodal_to.models.robot import Robot
from multimodal_to.plotting.lettering import lettered
from multimodal_to.plotting.style import (
    Run,
    draw_flight,
    draw_lines,
    draw_pushes,
    finish,
    legend_above,
    new_figure,
    runs_of,
)
from multimodal_to.trajectory import QUANTITIES, Trajectory

_SIZE = (9.5, 6.8)


@checked
def plot_com(robot: Robot, *trajectories: Trajectory, labels: Sequence[str] | None = None) -> Figure:
    """Plot position [m] and velocity [m/s] of the CoM in the world over time, a row for each of x, y and z.

    Raises:
        InputError: the trajectories are for different robots, or too many.
    """
    runs = runs_of(robot, trajectories, labels)
    columns = (("com_position", "position", 0.02), ("com_velocity", "velocity", 0.02))
    return _components(runs, "centre of mass", columns)


@checked
def plot_momentum(robot: Robot, *trajectories: Trajectory, labels: Sequence[str] | None = None) -> Figure:
    """Plot the angular momentum about the CoM [kg m²/s] and its rate [N m], world axes, a row for each of x, y and z.

    Raises:
        InputError: the trajectories are for different robots, or too many.
    """
    runs = runs_of(robot, trajectories, labels)
    columns = (("angular_momentum", "momentum", 0.02), ("angular_momentum_rate", "rate", 0.2))
    return _components(runs, "angular momentum about the centre of mass", columns)


def _components(runs: Sequence[Run], what: str, columns: Sequence[tuple[str, str, float]]) -> Figure:
    """Draw quantities of three rows (name, title, least range of the axis): one column each.

    Args:
        runs: to draw.
        what: the figure's title says.
        columns: name of the quantity in a `Trajectory`, title, and least range of the axis in its unit.
    """
    figure = new_figure(runs, what, _SIZE)
    grid = figure.subplots(3, len(columns), sharex=True, squeeze=False)
    for column, (name, title, least) in enumerate(columns):
        for row, axis in enumerate("xyz"):
            axes = grid[row, column]
            draw_lines(axes, runs, [getattr(run.trajectory, name)[row : row + 1] for run in runs], name, ())
            axes.set_ylabel(f"{title} {axis} [{QUANTITIES[name].unit}]")
            draw_flight([axes], runs, labelled=grid[0, 0])
            draw_pushes([axes], runs, labelled=grid[0, 0])
            finish([axes], least)
        grid[2, column].set_xlabel("time [s]")
    legend_above(grid[0, 0])
    figure.align_ylabels()
    return lettered(figure)

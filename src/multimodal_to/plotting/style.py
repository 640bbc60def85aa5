"""How all figures look: colours, line styles, limits, bands of flight, legends that cover no data."""

from __future__ import annotations

import os
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure, SubFigure
from matplotlib.lines import Line2D

from multimodal_to.adam.spatial import Array
from multimodal_to.arguments import checked
from multimodal_to.errors import InputError, OutputError
from multimodal_to.files.writing import whole
from multimodal_to.models.robot import Robot
from multimodal_to.trajectory import Trajectory, rules
from multimodal_to.trajectory.derived import acting_times, flight_phases, outside_forces, spans, without_acceleration
from multimodal_to.trajectory.sameness import refuse_other_robot
from multimodal_to.values import Value

SUFFIXES = (".png", ".svg", ".pdf")
"""What a figure can be saved as."""

COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9")  # told apart by colour-blind eyes too
STYLES = ("-", "--", "-.", ":")
FLIGHT: dict[str, Any] = {"facecolor": "#d62728", "alpha": 0.12, "linewidth": 0.0, "zorder": 0.5}
PUSH: dict[str, Any] = {"facecolor": "#b5179e", "alpha": 0.12, "linewidth": 0.0, "zorder": 0.5}
LIMIT: dict[str, Any] = {"color": "0.35", "linestyle": (0, (6, 4)), "linewidth": 0.8}
SMALL = "small"  # text of legends and ticks
_LEGEND_ROWS = 2
_LETTERS_PER_INCH, _SAMPLE = 10, 7  # of text of medium size, and of the line before it in a legend
_DPI = 150


@dataclass(frozen=True, kw_only=True, eq=False)
class Run(Value):
    """One trajectory in a figure: with the robot that has its jets, and the line style and name that tell it apart."""

    robot: Robot
    trajectory: Trajectory
    label: str
    style: Any


def runs_of(robot: Robot, trajectories: Sequence[Trajectory], labels: Sequence[str] | None) -> list[Run]:
    """Return the trajectories as the runs of one figure.

    Args:
        robot: of all trajectories.
        trajectories: to show together.
        labels: one for each; by default the names of their scenarios.

    Raises:
        InputError: there are none or too many, they are for different robots, or labels are not one for each.
    """
    if not 1 <= len(trajectories) <= len(STYLES):
        raise InputError(f"a figure shows 1 to {len(STYLES)} trajectories; there are {len(trajectories)}")
    for trajectory in trajectories:
        refuse_other_robot(trajectory, robot, what=f"the trajectory '{trajectory.scenario}'", of=("joints",))
    names = list(labels) if labels is not None else [trajectory.scenario for trajectory in trajectories]
    if len(names) != len(trajectories):
        raise InputError(f"there are {len(trajectories)} trajectories and {len(names)} labels; expected one for each")
    return [
        Run(robot=robot.with_jets(trajectory.jet_names), trajectory=trajectory, label=name, style=style)
        for trajectory, name, style in zip(trajectories, names, STYLES, strict=False)
    ]


def new_figure(runs: Sequence[Run], what: str, size: tuple[float, float]) -> Figure:
    """Return an empty figure with a title; several runs are told apart by line style, in a legend below.

    Args:
        runs: that it will show.
        what: it shows, for its title.
        size: width and height [inch].
    """
    figure = Figure(figsize=size, layout="constrained")
    names = list(dict.fromkeys(run.trajectory.scenario for run in runs))
    title = names[0] if len(names) == 1 else f"{len(names)} motions"  # which the legend names
    figure.suptitle(f"{title} · {runs[0].trajectory.robot}: {what}")
    if len(runs) > 1:
        handles = [Line2D([], [], color="0.2", linestyle=run.style) for run in runs]
        longest = max(len(run.label) for run in runs)
        columns = int(min(len(runs), max(1, size[0] * _LETTERS_PER_INCH // (longest + _SAMPLE))))
        figure.legend(handles, [run.label for run in runs], loc="outside lower center", ncols=columns, frameon=False)
    return figure


def draw_nothing(figure: Figure | SubFigure, why: str) -> None:
    """Say in the middle of a figure why it is empty."""
    figure.text(0.5, 0.5, why, ha="center", va="center")


def draw_row(axes: Axes, run: Run, values: Array, of: str, **look: Any) -> None:
    """Draw one row over time, at the instants of the quantity that it belongs to.

    What is constant over intervals is drawn as steps. What is before the first knot is left out.

    Args:
        axes: to draw in.
        run: whose times.
        values: of the columns, (knots + 1,).
        of: name of the quantity whose instants the columns have.
        **look: of the line, as `Axes.plot` takes it.
    """
    trajectory = run.trajectory
    if rules.held(trajectory.rule, of):
        axes.plot(trajectory.time, [values[1], *values[1:]], drawstyle="steps-pre", **look)
        return
    times = trajectory.times(of)
    within = times >= trajectory.time[0]
    axes.plot(times[within], values[within], **look)


def draw_lines(axes: Axes, runs: Sequence[Run], values: Iterable[Array], of: str, names: Iterable[str]) -> None:
    """Draw rows (rows, knots + 1) of each run: the colour tells the row, the style the run or, of one run, the row.

    Args:
        axes: to draw in.
        runs: whose times and styles.
        values: of each run, (rows, knots + 1).
        of: name of the quantity whose instants the columns have.
        names: of the rows in the legend; rows beyond them have no entry.
    """
    labels = list(names)
    for number, (run, rows) in enumerate(zip(runs, values, strict=True)):
        for index, row in enumerate(rows):
            style = run.style if len(runs) > 1 else STYLES[index % len(STYLES)] if len(rows) <= len(STYLES) else "-"
            draw_row(
                axes,
                run,
                row,
                of,
                color=COLOURS[index % len(COLOURS)],
                linestyle=style,
                label=labels[index] if number == 0 and index < len(labels) else None,
            )


def draw_limits(axes: Axes, values: Iterable[float], label: str | None) -> None:
    """Draw limits as dashed lines, with one entry in the legend.

    Args:
        axes: to draw in.
        values: of the limits, in the unit of the axes.
        label: in the legend; None for no entry.
    """
    for index, value in enumerate(sorted(values)):
        axes.axhline(value, label=label if index == 0 else None, **LIMIT)


def draw_flight(all_axes: Iterable[Axes], runs: Sequence[Run], labelled: Axes | None = None) -> None:
    """Draw a translucent red band over the flight of every run, with one entry in the legend of one of the axes.

    Args:
        all_axes: to draw in, with the time along x [s].
        runs: whose flight.
        labelled: the one of them with an entry in its legend.
    """
    phases = [phase for run in runs for phase in flight_phases(run.robot, run.trajectory)]
    look = FLIGHT | {"alpha": FLIGHT["alpha"] * min(1.0, 2.0 / len(runs))}  # bands that lie over each other add up
    for axes in all_axes:
        for index, (start, end) in enumerate(phases):
            axes.axvspan(start, end, label="flight" if axes is labelled and index == 0 else None, **look)


def draw_pushes(all_axes: Iterable[Axes], runs: Sequence[Run], labelled: Axes | None = None) -> None:
    """Draw a translucent purple band while a known push acts in any run, with one entry in the legend of one axes.

    Args:
        all_axes: to draw in, with the time along x [s].
        runs: whose pushes.
        labelled: the one of them with an entry in its legend.
    """
    bands = list[tuple[float, float]]()
    for run in runs:
        acts = [force.any(axis=0) for _, force in outside_forces(run.trajectory)]
        if acts:
            bands += spans(np.any(acts, axis=0), *acting_times(run.trajectory))
    for axes in all_axes:
        for index, (start, end) in enumerate(dict.fromkeys(bands)):
            axes.axvspan(start, end, label="known push" if axes is labelled and index == 0 else None, **PUSH)


def finish(all_axes: Iterable[Axes], least_span: float = 0.0) -> None:
    """Give axes a grid, room above and below the data, and a range of at least `least_span`."""
    for axes in all_axes:
        axes.margins(x=0.0, y=0.08)
        axes.grid(alpha=0.3)
        low, high = axes.get_ylim()
        if high - low < least_span:
            middle = (low + high) / 2.0
            axes.set_ylim(middle - least_span / 2.0, middle + least_span / 2.0)


def legend_above(axes: Axes) -> None:
    """Put the legend of axes above them, where it covers nothing."""
    entries = len(axes.get_legend_handles_labels()[1])
    if entries == 0:
        return
    columns = entries if entries <= 4 else -(-entries // _LEGEND_ROWS)
    axes.legend(
        loc="lower left", bbox_to_anchor=(0.0, 1.0), borderaxespad=0.2, ncols=columns, frameon=False, fontsize=SMALL
    )


@checked
def save(figure: Figure, path: str | os.PathLike[str]) -> Path:
    """Write a figure as PNG, SVG or PDF, by its suffix; whole or not at all.

    Raises:
        OutputError: the suffix is another one, or the folder cannot be written.
    """
    target = Path(path)
    if target.suffix.lower() not in SUFFIXES:
        raise OutputError(f"'{target}' is no .png, .svg or .pdf")
    with whole(target) as draft:
        figure.savefig(draft, dpi=_DPI)
    return target


def blank(values: Array, trajectory: Trajectory) -> Array:
    """Return values of the knots with NaN at the one whose acceleration the trajectory does not tell.

    Args:
        values: that depend on accelerations, (rows, knots + 1).
        trajectory: the motion.
    """
    known = values.copy()
    known[:, without_acceleration(trajectory)] = np.nan
    return known

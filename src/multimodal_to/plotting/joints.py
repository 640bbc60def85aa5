"""Joint positions, speeds and torques over time, against their limits."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure, SubFigure

from multimodal_to.adam.spatial import Array
from multimodal_to.arguments import checked
from multimodal_to.models.joint_units import joint_units, slides
from multimodal_to.models.robot import Robot
from multimodal_to.plotting.lettering import lettered
from multimodal_to.plotting.style import (
    SMALL,
    Run,
    blank,
    draw_flight,
    draw_limits,
    draw_lines,
    draw_nothing,
    finish,
    new_figure,
    runs_of,
)
from multimodal_to.trajectory import Trajectory
from multimodal_to.trajectory.derived import joint_torques

_COLUMNS = 6
_CELL = (2.15, 1.55)  # [inch]


@checked
def plot_joints(robot: Robot, *trajectories: Trajectory, labels: Sequence[str] | None = None) -> Figure:
    """Plot every joint's position [rad or m] over its whole range, which dashed lines end, and the speeds by group.

    The limit of the speeds is dashed where it is near enough to be seen; the title of each panel says it.

    Raises:
        InputError: the trajectories are for different robots, or too many.
    """
    runs = runs_of(robot, trajectories, labels)
    rows = _rows(robot.joint_names)
    figure = new_figure(runs, "joints", (_COLUMNS * _CELL[0], (rows + 2.1) * _CELL[1]))
    upper, lower = np.asarray(figure.subfigures(2, 1, height_ratios=[rows, 2.1]))
    limits = robot.joint_limits
    _cells(
        upper,
        runs,
        [run.trajectory.joint_positions for run in runs],
        "joint_positions",
        "position",
        "rad",
        limits.lower,
        limits.upper,
        whole_range=True,
    )
    _speeds(lower, robot, runs)
    return lettered(figure)


@checked
def plot_torques(robot: Robot, *trajectories: Trajectory, labels: Sequence[str] | None = None) -> Figure:
    """Plot every joint's torque [N m], or force [N], and, dashed, its effort limit (`derived.joint_torques`).

    The knot whose acceleration the trajectory does not tell, the first or the last, is left out.

    Raises:
        InputError: the trajectories are for different robots, or too many.
    """
    runs = runs_of(robot, trajectories, labels)
    rows = _rows(robot.joint_names)
    figure = new_figure(runs, "joint torques", (_COLUMNS * _CELL[0], (rows + 0.2) * _CELL[1]))
    effort = robot.joint_limits.effort
    values = [blank(joint_torques(run.robot, run.trajectory), run.trajectory) for run in runs]
    _cells(figure, runs, values, "joint_positions", _effort_title(robot), "N m", -effort, effort, whole_range=False)
    return lettered(figure)


def _cells(
    figure: Figure | SubFigure,
    runs: Sequence[Run],
    values: Sequence[Array],
    of: str,
    title: str,
    unit: str,
    lower: Array,
    upper: Array,
    *,
    whole_range: bool,
) -> None:
    """Draw one small panel for each joint; limits that are not finite are none.

    Args:
        figure: an empty one.
        runs: to draw.
        values: of each run, (n, knots + 1), a row for each joint.
        of: name of the quantity whose instants the columns have.
        title: of the values.
        unit: of the values of a joint that turns.
        lower: limit of each joint, in the unit of the values, (n,).
        upper: limit of each joint, in the unit of the values, (n,).
        whole_range: show the limits even where the motion stays far from them.
    """
    names, units = runs[0].robot.joint_names, joint_units(runs[0].robot, unit)
    if not names:
        draw_nothing(figure, "the robot has no joints")
        return
    grid = figure.subplots(_rows(names), _COLUMNS, sharex=True, squeeze=False)
    for index, axes in enumerate(grid.ravel()):
        if index >= len(names):
            axes.set_axis_off()
            continue
        draw_lines(axes, runs, [rows_of_run[index : index + 1] for rows_of_run in values], of, ())
        ends = [end for end in (float(lower[index]), float(upper[index])) if np.isfinite(end)]
        largest = max(float(np.nanmax(np.abs(rows_of_run[index]))) for rows_of_run in values)
        if whole_range or (ends and largest > 0.3 * ends[-1]):
            draw_limits(axes, ends, None)
        axes.set_title(_cell_title(names[index], ends, whole_range, _other_unit(units, index)), fontsize=SMALL)
        draw_flight([axes], runs)
        finish([axes], 0.0 if whole_range else 1.0)
        _tick(axes, bottom=index + _COLUMNS >= len(names))
    figure.supylabel(f"{title} [{_several(units)}]", fontsize="medium")


def _rows(names: Sequence[str]) -> int:
    """Return the rows of panels for joints, and one where there are none."""
    return max(-(-len(names) // _COLUMNS), 1)


def _cell_title(name: str, ends: Sequence[float], whole_range: bool, unit: str) -> str:
    """Return the title of a joint's panel.

    Args:
        name: of the joint.
        ends: its limits.
        whole_range: they are drawn.
        unit: of its values where the joints have several, else empty.
    """
    limit = "" if whole_range or not ends else f"±{ends[-1]:g}"
    said = " ".join(filter(None, (limit, unit)))
    return f"{name} ({said})" if said else name


def _effort_title(robot: Robot) -> str:
    return " or ".join(dict.fromkeys("force" if sliding else "torque" for sliding in slides(robot))) or "torque"


def _several(units: Sequence[str]) -> str:
    """Return the units in words, each once."""
    return " or ".join(dict.fromkeys(units))


def _other_unit(units: Sequence[str], index: int) -> str:
    """Return a joint's unit where the joints have several, else nothing."""
    return units[index] if len(set(units)) > 1 else ""


def _speeds(figure: SubFigure, robot: Robot, runs: Sequence[Run]) -> None:
    groups, units = _disjoint_groups(robot), joint_units(robot, "rad/s")
    if not groups:
        return
    panels = figure.subplots(1, len(groups), sharex=True, squeeze=False)[0]
    for axes, (name, members) in zip(panels, groups.items(), strict=True):
        rows = [robot.joint_names.index(member) for member in members]
        draw_lines(axes, runs, [run.trajectory.joint_velocities[rows] for run in runs], "joint_velocities", members)
        limit = float(robot.joint_limits.speed[rows].min())
        largest = max(float(np.abs(run.trajectory.joint_velocities[rows]).max()) for run in runs)
        if largest > 0.3 * limit:
            draw_limits(axes, (-limit, limit), None)
        said = " ".join(filter(None, (f"±{limit:g}", _other_unit(units, rows[0]))))
        axes.set_title(f"{name.replace('_', ' ')} ({said})", fontsize=SMALL)
        draw_flight([axes], runs)
        finish([axes], 0.1)
        _tick(axes, bottom=True)
        axes.legend(
            loc="upper center",
            bbox_to_anchor=(0.5, -0.24),
            ncols=2,
            frameon=False,
            fontsize="xx-small",
            handlelength=1.4,
            columnspacing=0.8,
            borderpad=0.0,
        )
    figure.supylabel(f"speed [{_several(units)}]", fontsize="medium")


def _disjoint_groups(robot: Robot) -> dict[str, tuple[str, ...]]:
    """Return the robot's first joint groups that have no joint in common, and the joints of none.

    Those of a group that slide are one of their own, since their speeds have another unit.
    """
    chosen: dict[str, tuple[str, ...]] = {}
    taken: set[str] = set()
    for name, members in robot.joint_groups.items():
        if members and not taken.intersection(members):
            chosen[name] = members
            taken.update(members)
    if rest := tuple(name for name in robot.joint_names if name not in taken):
        chosen["other joints" if chosen else "all joints"] = rest
    sliding = {name for name, slider in zip(robot.joint_names, slides(robot), strict=True) if slider}
    parts = {}
    for name, members in chosen.items():
        turning = tuple(member for member in members if member not in sliding)
        parts[name] = turning or members
        if turning and len(turning) < len(members):
            parts[f"{name}, sliding"] = tuple(member for member in members if member in sliding)
    return parts


def _tick(axes: Any, *, bottom: bool) -> None:
    axes.tick_params(labelsize="x-small", labelbottom=bottom)
    axes.locator_params(axis="x", nbins=4)
    axes.locator_params(axis="y", nbins=4)
    if bottom:
        axes.set_xlabel("time [s]", fontsize=SMALL)

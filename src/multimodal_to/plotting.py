"""Plots of a `Trajectory`: throttle, thrust and contact force over time, as a figure that the caller shows or saves."""

from __future__ import annotations

from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from multimodal_to.derived import flight_phases, vertical_thrust
from multimodal_to.models.robot import Robot
from multimodal_to.trajectory import Array, Trajectory

_SIZE = (7.5, 8.5)  # of the figure [inch]
_COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9")  # told apart by colour-blind eyes too
_STYLES = ("-", "--", "-.", ":")  # jets that do the same remain visible
_FLIGHT: dict[str, Any] = {"facecolor": "#d62728", "alpha": 0.12, "linewidth": 0.0}
_LIMIT: dict[str, Any] = {"color": "0.35", "linestyle": (0, (6, 4)), "linewidth": 0.8}
_LEGEND_ROWS = 2


def plot_forces(robot: Robot, trajectory: Trajectory) -> Figure:
    """Plot throttle [%], thrust [N] and total vertical contact force [N] over time, one panel each.

    Flight (`derived.FLIGHT_FORCE`) is a translucent red band; limits are dashed; beside the contact force stand the
    weight m g and the vertical sum of the thrusts, which takes it over from the ground. Legends stand above the panels.
    """
    figure = Figure(figsize=_SIZE, layout="constrained")
    throttle, thrust, force = figure.subplots(3, 1, sharex=True)
    figure.suptitle(f"{trajectory.scenario} · {trajectory.robot}")

    _draw_jets(throttle, trajectory, trajectory.throttle)
    _draw_limits(throttle, {limit for jet in robot.jets for limit in (jet.throttle_min, jet.throttle_max)}, "limits")
    throttle.set_ylabel("throttle [%]")

    _draw_jets(thrust, trajectory, trajectory.thrust)
    _draw_limits(thrust, {jet.thrust_max for jet in robot.jets}, "maximum")
    thrust.set_ylabel("thrust [N]")

    force.plot(trajectory.time, trajectory.vertical_contact_force(), color="black", label="contact force")
    force.plot(trajectory.time, vertical_thrust(robot, trajectory), color=_COLOURS[1], label="vertical thrust")
    _draw_limits(force, {robot.weight}, "weight")
    force.set_ylabel("vertical force [N]")
    force.set_xlabel("time [s]")

    phases = flight_phases(trajectory)
    for axes in (throttle, thrust, force):
        for start, end in phases:
            axes.axvspan(start, end, label="flight" if axes is force and start == phases[0][0] else None, **_FLIGHT)
        axes.margins(x=0.0, y=0.08)
        axes.grid(alpha=0.3)
        _legend_above(axes)
    figure.align_ylabels()
    return figure


def _draw_jets(axes: Axes, trajectory: Trajectory, values: Array) -> None:
    for index, (name, row) in enumerate(zip(trajectory.jet_names, values, strict=True)):
        colour, style = _COLOURS[index % len(_COLOURS)], _STYLES[index % len(_STYLES)]
        axes.plot(trajectory.time, row, color=colour, linestyle=style, label=name)


def _draw_limits(axes: Axes, values: set[float], label: str) -> None:
    for index, value in enumerate(sorted(values)):
        axes.axhline(value, label=label if index == 0 else None, **_LIMIT)


def _legend_above(axes: Axes) -> None:
    entries = len(axes.get_legend_handles_labels()[1])
    if entries == 0:
        return
    columns = entries if entries <= 4 else -(-entries // _LEGEND_ROWS)
    axes.legend(
        loc="lower left", bbox_to_anchor=(0.0, 1.0), borderaxespad=0.2, ncols=columns, frameon=False,
        fontsize="small",
    )  # fmt: skip

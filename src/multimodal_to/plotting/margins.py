"""How far a motion is from what it must not exceed: complementarity over time, and the audit's findings by name."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from multimodal_to.arguments import checked
from multimodal_to.auditing.audit import Audit, audit
from multimodal_to.auditing.findings import Finding
from multimodal_to.errors import InputError
from multimodal_to.models.robot import Robot
from multimodal_to.models.terrain import FlatGround
from multimodal_to.plotting.lettering import lettered
from multimodal_to.plotting.style import (
    COLOURS,
    LIMIT,
    SMALL,
    Run,
    draw_flight,
    draw_limits,
    draw_row,
    legend_above,
    new_figure,
    runs_of,
)
from multimodal_to.scenarios.data import stored
from multimodal_to.trajectory import Trajectory
from multimodal_to.trajectory.derived import contact_products

_FLOOR, _PRODUCT_FLOOR = 1e-6, 1e-8  # of what is drawn on the logarithmic axes
_FAILED = "#d62728"


@checked
def plot_margins(
    robot: Robot, *trajectories: Trajectory, labels: Sequence[str] | None = None, audits: Sequence[Audit] | None = None
) -> Figure:
    """Plot the largest height × force and slip × force over time [N m], and the audit's worst over their limits [1].

    Dashed are the scenario's bounds on the products; that on slips holds along each of two tangents, so that ‖slip‖
    may be √2 as much. Both axes are logarithmic and end at 1e-8 and 1e-6; a property that has nothing to show, as a
    penetration of less than zero, has no bar. A bar that passes 1 fails.

    Args:
        robot: of all trajectories.
        *trajectories: to show together.
        labels: of the trajectories in the legend; by default the names of their scenarios.
        audits: those to show, one for each trajectory; by default each is audited.

    Raises:
        InputError: the trajectories are for different robots, or too many.
    """
    runs = runs_of(robot, trajectories, labels)
    reports = list(audits) if audits is not None else [audit(run.robot, run.trajectory) for run in runs]
    if len(reports) != len(runs):
        raise InputError(f"there are {len(runs)} trajectories and {len(reports)} audits; expected one for each")
    count = len(_properties(reports))
    figure = new_figure(runs, "complementarity and audit", (8.0, 3.6 + count * (0.19 + 0.06 * (len(runs) - 1))))
    products, properties = figure.subplots(2, 1, height_ratios=[2.2, count * 0.19])
    _draw_products(products, runs)
    _draw_findings(properties, runs, reports)
    return lettered(figure)


def _draw_products(axes: Axes, runs: Sequence[Run]) -> None:
    for number, run in enumerate(runs):
        scenario = stored(run.trajectory)
        surface = scenario.surface if scenario else FlatGround()
        products = contact_products(run.robot, run.trajectory, surface)
        labels = ("height × normal force", "slip × normal force")
        for product, colour, label in zip(products, COLOURS, labels, strict=False):
            largest = product.max(axis=0, initial=0.0)
            draw_row(
                axes,
                run,
                np.maximum(largest, _PRODUCT_FLOOR),
                "contact_forces",
                color=colour,
                linestyle=run.style,
                label=label if number == 0 else None,
            )
    bounds = set[float]()
    for run in runs:
        if (scenario := stored(run.trajectory)) is not None:
            complementarity, sliding = scenario.contact_bounds(run.robot)
            bounds |= {complementarity, math.sqrt(2.0) * sliding}
    draw_limits(axes, bounds, "bounds")
    axes.set_yscale("log")
    axes.set_ylim(_PRODUCT_FLOOR, max(1e-3, 3.0 * axes.get_ylim()[1]))
    axes.set_ylabel("largest product [N m]")
    axes.set_xlabel("time [s]")
    axes.margins(x=0.0)
    axes.grid(alpha=0.3)
    draw_flight([axes], runs, labelled=axes)
    legend_above(axes)


def _draw_findings(axes: Axes, runs: Sequence[Run], reports: Sequence[Audit]) -> None:
    thickness, rows = 0.8 / len(runs), _properties(reports)
    highest = 1.0
    for number, report in enumerate(reports):
        own = report.findings
        shares = np.array([_share(finding) for finding in own])
        highest = max(highest, shares.max(initial=0.0))
        places = [list(rows).index(finding.name) + (number - (len(runs) - 1) / 2.0) * thickness for finding in own]
        axes.barh(
            places,
            np.maximum(shares, _FLOOR) - _FLOOR,
            left=_FLOOR,
            height=0.9 * thickness,
            color=["0.55" if finding.holds else _FAILED for finding in own],
            alpha=1.0 - 0.2 * number,
            hatch="" if number == 0 else "/" * (2 * number),
            edgecolor="white",
            linewidth=0.0,
        )
    axes.set_yticks(range(len(rows)), list(rows.values()), fontsize="x-small")
    axes.set_xscale("log")
    axes.set_xlim(_FLOOR, 10.0 * highest)
    axes.set_ylim(len(rows) - 0.4, -0.6)
    axes.axvline(1.0, **LIMIT)
    order = "; from the top in the order of the legend" if len(runs) > 1 else ""
    axes.set_xlabel(f"worst over limit; a bar that passes 1 fails{order}", fontsize=SMALL)
    axes.grid(axis="x", alpha=0.3)


def _properties(reports: Sequence[Audit]) -> dict[str, str]:
    """Return the properties that any of the audits has, with what stands beside their bars."""
    findings = {finding.name: finding for report in reports for finding in report.findings}
    units = {name: "" if finding.unit == "1" else f" {finding.unit}" for name, finding in findings.items()}
    return {name: f"{name} / {finding.limit:.3g}{units[name]}" for name, finding in findings.items()}


def _share(finding: Finding) -> float:
    """Return worst over limit; of what cannot be divided, far beyond it or nothing, as it fails or holds."""
    if finding.limit > 0.0 and np.isfinite(finding.worst):
        return finding.worst / finding.limit
    return _FLOOR if finding.holds else 1e3

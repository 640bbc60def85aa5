"""What the problem's own variables, bounds and rows say, before anything is derived of them."""

from __future__ import annotations

from collections.abc import Iterator

import casadi as cs
import numpy as np
from numpy.typing import NDArray

from multimodal_to.doctor.diagnosis import Symptom, error, warning
from multimodal_to.doctor.task import Task
from multimodal_to.errors import FormulationError, MultimodalError, listed
from multimodal_to.ocp.outline import Outline, formulate
from multimodal_to.ocp.stages import NamedStage
from multimodal_to.ocp.variables import Bounds, Layout
from multimodal_to.trajectory import QUANTITIES, labels, row_units

_INTEGRATION = "_integration"  # what the names of rows end with that tie a variable to its own rate and nothing else


def formulation(task: Task) -> Iterator[Symptom]:
    """Look for bounds that contradict each other and for variables that nothing asks for."""
    try:
        outline = formulate(task.robot, task.scenario, task.posture, task.formulation, task.initial)
    except FormulationError as cause:
        yield error("terms", str(cause), "change the term, or leave it out")
        return
    except MultimodalError as cause:
        yield error("boundary", str(cause), "let start and end lie within the ranges of scenario and robot")
        return
    yield from _crossed(task, outline)
    yield from _unseen(task, outline.layout, outline.bounds, outline.stages)


def _crossed(task: Task, outline: Outline) -> Iterator[Symptom]:
    """Name the first bound of each variable whose least value is above its greatest."""
    bounds = outline.bounds
    for name in bounds.lower:
        crossed = np.argwhere(bounds.lower[name] > bounds.upper[name] + 1e-9)
        if not crossed.size:
            continue
        row, knot = crossed[0]
        least, greatest = bounds.lower[name][row, knot], bounds.upper[name][row, knot]
        middle = name == "com_position" and knot == task.scenario.knots // 2
        terms = outline.terms_that_hold(name, int(row), int(knot))
        either = "widen the one or the other" + (f"; the term {listed(terms)} holds it there" if terms else "")
        yield error(
            "bounds",
            f"{name} ({labels(name, task.robot)[row]}) has to be at least {least:.6g} and at most {greatest:.6g} "
            f"{row_units(QUANTITIES[name], task.robot)[row]} at knot {knot}",
            "lower mid_height_min or widen com_range" if middle and not terms else either,
        )


def _unseen(task: Task, layout: Layout, bounds: Bounds, stages: list[NamedStage]) -> Iterator[Symptom]:
    """Name the variables that are free and that no row and no cost sees but their own integration.

    Args:
        task: robot and scenario.
        layout: where each variable stands in a knot.
        bounds: of the variables at every knot; one that is fixed everywhere is not free.
        stages: the parts of the problem with their rows and costs.
    """
    seen, ties = np.zeros(layout.size, dtype=bool), list[NDArray[np.int64]]()
    for named in stages:
        for columns, integration in _dependencies(named, layout.size):
            if integration:
                ties.append(columns)
            else:
                seen[columns] = True
    for columns in ties:
        if seen[columns].any():
            seen[columns] = True
    lost = []
    for name, rows in layout.rows.items():
        free = (bounds.lower[name] < bounds.upper[name]).any(axis=1)
        components = labels(name, task.robot)
        lost += [f"{name} of '{components[index]}'" for index in np.flatnonzero(~seen[rows] & free)]
    if lost:
        yield warning(
            "unseen variables",
            f"no row and no cost sees {', '.join(lost)}, beside the integration, so that nothing says what they should "
            "be",
            "give them a weight, or lock a joint by leaving it out of robot.toml",
        )


def _dependencies(named: NamedStage, size: int) -> Iterator[tuple[NDArray[np.int64], bool]]:
    """Return, for each row and cost of a stage, the variables it sees at any knot, and whether it is an integration."""
    stage = named.stage
    names = [name for name, rows in named.rows for _ in range(rows.expression.shape[0])] + [*named.cost_names]
    arguments = cs.vertcat(stage.start, stage.end)
    function = cs.Function("sees", [arguments, stage.interval], [cs.vertcat(stage.rows, stage.costs)])
    rows, columns = (np.array(part, dtype=np.int64) for part in function.jac_sparsity(0, 0).get_triplet())
    for index, name in enumerate(names):
        yield np.unique(columns[rows == index] % size), name.endswith(_INTEGRATION)

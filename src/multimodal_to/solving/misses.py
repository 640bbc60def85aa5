"""Which rows and bounds a motion misses: by family, with knot, component and amount."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from multimodal_to.adam.spatial import Array
from multimodal_to.ocp.naming import components
from multimodal_to.ocp.problem import Problem, missed
from multimodal_to.trajectory import QUANTITIES


@dataclass(frozen=True, kw_only=True)
class Miss:
    """A family of rows, or the bounds of a variable, that is not met, and where it is missed most."""

    name: str  # of the rows, or `bounds of` a variable
    knot: int  # for rows over an interval its end
    component: str  # a contact point, jet, joint or axis; empty where there is only one
    amount: float  # in `unit`
    unit: str
    scaled: float  # the amount in solver units, in which families compare
    missed: int  # how many rows of the family are missed
    rows: int  # of how many

    def __str__(self) -> str:
        where = f"knot {self.knot}" + (f", {self.component}" if self.component else "")
        unit = "" if self.unit == "1" else f" {self.unit}"
        return f"{self.name} at {where}, by {self.amount:.2g}{unit} ({self.missed} of {self.rows} rows)"


def misses(problem: Problem, x: Array, tolerance: float) -> tuple[Miss, ...]:
    """Return what x misses by more than a tolerance in solver units, one for each family, the worst first."""
    rows = missed(problem.rows_at(x), problem.row_lower, problem.row_upper)
    outside = missed(x, problem.lower, problem.upper)
    return _worst_first([*_of_rows(problem, rows, tolerance), *_of_bounds(problem, outside, tolerance)])


def misses_of_rows(problem: Problem, amounts: Array, tolerance: float) -> tuple[Miss, ...]:
    """Return the families of rows that are missed by given amounts, one for each row of g, in solver units."""
    return _worst_first(_of_rows(problem, amounts, tolerance))


def _of_rows(problem: Problem, amounts: Array, tolerance: float) -> list[Miss]:
    return [
        _miss(name, amounts[rows.index], tolerance, rows.knots, rows.components, rows.scale, rows.unit)
        for name, rows in problem.rows.items()
    ]


def _of_bounds(problem: Problem, outside: Array, tolerance: float) -> list[Miss]:
    found = []
    for name, values in problem.layout.read_horizon(outside).items():
        dimension, count = values.shape
        if dimension:
            labels = components(problem.robot, QUANTITIES[name].of, dimension)
            scale, label = float(problem.layout.scale[problem.layout.rows[name].start]), f"bounds of {name}"
            found.append(
                _miss(
                    label,
                    values.ravel(),
                    tolerance,
                    np.tile(np.arange(count), dimension),
                    np.repeat(labels, count),
                    scale,
                    problem.unit(label),
                )
            )
    interval = "bounds of interval"
    found.append(
        _miss(
            interval,
            outside[-1:],
            tolerance,
            np.zeros(1, dtype=np.int64),
            np.array([""]),
            float(problem.scale[-1]),
            problem.unit(interval),
        )
    )
    return found


def _miss(
    name: str,
    scaled: Array,
    tolerance: float,
    knots: NDArray[np.int64],
    labels: NDArray[np.str_],
    scale: float,
    unit: str,
) -> Miss:
    """Return a family's miss at its worst row; a unit of two names that of linear and of angular rows."""
    worst = int(scaled.argmax())
    label, units = str(labels[worst]), unit.split(", ")
    return Miss(
        name=name,
        knot=int(knots[worst]),
        component=label,
        amount=float(scaled[worst] * scale),
        unit=units[-1] if label.startswith("angular") else units[0],
        scaled=float(scaled[worst]),
        missed=int((scaled > tolerance).sum()),
        rows=scaled.size,
    )


def _worst_first(found: list[Miss]) -> tuple[Miss, ...]:
    return tuple(sorted((miss for miss in found if miss.missed), key=lambda miss: -miss.scaled))

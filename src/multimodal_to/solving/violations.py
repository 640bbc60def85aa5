"""Which terms and bounds a motion violates: by name, with knot, component and amount."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from multimodal_to.adam.spatial import Array
from multimodal_to.ocp.problem import Problem, RowSet, missed
from multimodal_to.trajectory import labels


@dataclass(frozen=True, kw_only=True)
class Violation:
    """A term, or the bounds of a variable, that is not met, and where it is violated most."""

    name: str  # of the term, or `bounds of` a variable
    knot: int  # for rows over an interval its end
    component: str  # a contact point, jet, joint or axis; empty where there is only one
    amount: float  # in `unit`
    unit: str
    scaled: float  # the amount in solver units, in which terms compare
    violated: int  # how many rows of the term are violated
    rows: int  # of how many

    def __str__(self) -> str:
        where = f"knot {self.knot}" + (f", {self.component}" if self.component else "")
        unit = "" if self.unit == "1" else f" {self.unit}"
        return f"{self.name} at {where}, by {self.amount:.2g}{unit} ({self.violated} of {self.rows} rows)"


def unmet(problem: Problem, x: Array, tolerance: float) -> tuple[Violation, ...]:
    """Return what x violates by more than a tolerance, one for each term or variable, the worst first.

    Args:
        problem: whose rows and bounds are meant.
        x: all variables, in solver units.
        tolerance: in solver units.
    """
    rows = missed(problem.rows_at(x), problem.row_lower, problem.row_upper)
    bounds = {name: some.missed_at(x) for name, some in problem.bound_rows.items()}
    outside = missed(x, problem.box_lower, problem.box_upper)
    return _worst_first([*_of_terms(problem, rows, bounds, tolerance), *_of_bounds(problem, outside, tolerance)])


def unmet_terms(problem: Problem, rows: Array, bounds: dict[str, Array], tolerance: float) -> tuple[Violation, ...]:
    """Return the terms that are violated by given amounts, the worst first.

    Args:
        problem: whose terms are meant.
        rows: the amount of each row of g, in solver units.
        bounds: the amounts of terms that are bounds, by name, in solver units.
        tolerance: in solver units.
    """
    return _worst_first(_of_terms(problem, rows, bounds, tolerance))


def _of_terms(problem: Problem, rows: Array, bounds: dict[str, Array], tolerance: float) -> list[Violation]:
    found = []
    for name in dict.fromkeys((*problem.rows, *bounds)):
        parts: list[tuple[RowSet, Array]] = []
        if name in problem.rows:
            parts.append((problem.rows[name], rows[problem.rows[name].index]))
        if name in bounds:
            parts.append((problem.bound_rows[name], bounds[name]))
        found.append(
            _violation(
                name,
                np.concatenate([amounts for _, amounts in parts]),
                tolerance,
                *(np.concatenate([getattr(part, field) for part, _ in parts]) for field in _FIELDS),
            )
        )
    return found


_FIELDS = ("knots", "components", "scale", "units")


def _of_bounds(problem: Problem, outside: Array, tolerance: float) -> list[Violation]:
    found = []
    for name, values in problem.layout.read_horizon(outside).items():
        dimension, count = values.shape
        if dimension:
            scale, label = problem.layout.scale[problem.layout.rows[name]], f"bounds of {name}"
            found.append(
                _violation(
                    label,
                    values.ravel(),
                    tolerance,
                    np.tile(np.arange(count), dimension),
                    np.repeat(labels(name, problem.robot), count),
                    np.repeat(scale, count),
                    np.repeat(problem.variable_units(name), count),
                )
            )
    interval = "bounds of interval"
    found.append(
        _violation(
            interval,
            outside[-1:],
            tolerance,
            np.zeros(1, dtype=np.int64),
            np.array([""]),
            problem.scale[-1:],
            np.array([problem.unit(interval)]),
        )
    )
    return found


def _violation(
    name: str,
    scaled: Array,
    tolerance: float,
    knots: NDArray[np.int64],
    components: NDArray[np.str_],
    scale: Array,
    units: NDArray[np.str_],
) -> Violation:
    """Return the violation of a term at its worst row.

    Args:
        name: of the term.
        scaled: the amount of each row, in solver units.
        tolerance: from which on a row counts as violated, in solver units.
        knots: that each row is of.
        components: what each row is called.
        scale: own unit per solver unit, of each row.
        units: of each row.
    """
    worst = int(scaled.argmax())
    return Violation(
        name=name,
        knot=int(knots[worst]),
        component=str(components[worst]),
        amount=float(scaled[worst] * scale[worst]),
        unit=str(units[worst]),
        scaled=float(scaled[worst]),
        violated=int((scaled > tolerance).sum()),
        rows=scaled.size,
    )


def _worst_first(found: list[Violation]) -> tuple[Violation, ...]:
    return tuple(sorted((some for some in found if some.violated), key=lambda some: -some.scaled))

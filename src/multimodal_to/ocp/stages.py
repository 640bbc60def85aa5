"""The stages of a problem: which named rows and costs hold at the first knot, over every interval, and at the end."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import casadi as cs
import numpy as np
from numpy.typing import NDArray

from multimodal_to.adam.spatial import SX
from multimodal_to.errors import FormulationError
from multimodal_to.models.units import size_of
from multimodal_to.ocp.formulation import Formulation
from multimodal_to.ocp.integration import Interval
from multimodal_to.ocp.knot import Knot
from multimodal_to.ocp.lifting import Lifted
from multimodal_to.ocp.parameters import Parameters
from multimodal_to.ocp.terms import Constraint, Cost, Place, Rows, Term, Where
from multimodal_to.ocp.transcription import Stage
from multimodal_to.ocp.variables import Bounds, Layout
from multimodal_to.scenarios.scenario import Start


@dataclass(frozen=True, kw_only=True, eq=False)
class NamedStage:
    """A stage with the names of its rows and costs, in their order."""

    stage: Stage
    rows: list[tuple[str, Rows]]
    knots: NDArray[np.int64]  # that the rows are of; for those over an interval its end
    cost_names: tuple[str, ...]


@dataclass(frozen=True, kw_only=True, eq=False)
class Held:
    """A row of a term that is a single variable: slope × z + constant, with z in solver units.

    It becomes a bound of that variable, which costs the solver nothing; its name stays.
    """

    term: str
    variable: str  # name of the variable
    row: int  # which of that variable's rows
    knots: NDArray[np.int64]
    component: str
    unit: str
    slope: float  # own unit per solver unit of the variable
    lower: float  # of z, in solver units
    upper: float


@dataclass(frozen=True, kw_only=True, eq=False)
class _Place:
    """What terms are given in a stage, for each place that it has."""

    name: str
    at: Mapping[Place, Knot | Interval]
    variables: SX  # that its knot rows may be bounds of
    starts: NDArray[np.int64]  # the first knot of each interval
    knots: NDArray[np.int64]  # that its knot rows are of


def _by_presence(rows: Rows, place: _Place) -> Iterator[tuple[_Place, Rows]]:
    """Split rows by the knots at which they are: each part of a place with the rows that are at all of its knots."""
    if rows.present is None:
        yield place, rows
        return
    groups = dict[bytes, list[int]]()
    for index, here in enumerate(rows.present[:, place.knots]):
        groups.setdefault(here.tobytes(), []).append(index)
    for some in groups.values():
        here = rows.present[some[0], place.knots]
        if here.any():
            yield replace(place, starts=place.starts[here], knots=place.knots[here]), rows.of(some)


def collect(
    formulation: Formulation, parameters: Parameters, layout: Layout, bounds: Bounds
) -> tuple[list[NamedStage], list[Held]]:
    """Return the stages of a problem, and the rows that became bounds of a variable instead.

    Args:
        formulation: its terms and its rule.
        parameters: what the terms may read.
        layout: of the variables of a knot.
        bounds: of every variable at every knot; they are tightened by the rows that are a single variable.

    Raises:
        FormulationError: a term does not return what it has to.
    """
    knots = parameters.scenario.knots
    z, z_next, dt = cs.SX.sym("z", layout.size), cs.SX.sym("z_next", layout.size), cs.SX.sym("dt")
    lifted = Lifted()
    start, end = (Knot(parameters.robot, **layout.read(values * layout.scale), lift=lifted) for values in (z, z_next))
    duration = dt * size_of(formulation.interval_scale, "s", parameters.robot.units)
    interval = Interval(start, end, duration, formulation.rule)
    first, every, last = np.array([0]), np.arange(knots), np.array([knots - 1])
    found = parameters.scenario.start is Start.HOVER  # the first knot's posture is found
    places = (
        _Place(
            name="first",
            at=dict.fromkeys((Where.FIRST_KNOT, Where.EVERY_KNOT) if found else (Where.FIRST_KNOT,), start),
            variables=z,
            starts=first,
            knots=first,
        ),
        _Place(
            name="first_interval",
            at={Where.FIRST_INTERVAL: interval},
            variables=z_next,
            starts=first,
            knots=first + 1,
        ),
        _Place(
            name="every",
            at={Where.LATER_KNOTS: end, Where.EVERY_KNOT: end, Where.EVERY_INTERVAL: interval},
            variables=z_next,
            starts=every,
            knots=every + 1,
        ),
        _Place(
            name="last",
            at={Where.LAST_KNOT: end, Where.LAST_INTERVAL: interval},
            variables=z_next,
            starts=last,
            knots=last + 1,
        ),
    )
    stages, held = list[NamedStage](), list[Held]()
    for place in (*places, *_chosen(formulation.terms, places[0], places[2], interval, knots)):
        parts = {place.knots.tobytes(): (place, list[tuple[str, Rows]]())}
        for name, some in _rows(formulation.constraints, place, parameters):
            for part, here in _by_presence(some, place):
                left, bound = _without_bounds(name, here, part, layout)
                held += bound
                if left.expression.shape[0]:
                    parts.setdefault(part.knots.tobytes(), (part, []))[1].append((name, left))
        charged = _charges(formulation.costs, place, parameters, duration)
        for index, (part, rows) in enumerate(parts.values()):
            costs = {} if index else charged
            if not (rows or costs):
                continue
            stages.append(
                NamedStage(
                    stage=Stage(
                        name=f"{place.name}_{index}" if index else place.name,
                        starts=part.starts,
                        start=z,
                        end=z_next,
                        interval=dt,
                        lifted_families=tuple(some.expression / cs.DM(some.scale) for _, some in rows),
                        lifted_costs=cs.vertcat(cs.SX(0, 1), *costs.values()),
                        lifted=lifted,
                    ),
                    rows=rows,
                    knots=part.knots,
                    cost_names=tuple(costs),
                )
            )
    for some_bound in held:
        _tighten(bounds, layout, some_bound)
    return stages, held


def _chosen(terms: Sequence[Term], first: _Place, later: _Place, interval: Interval, knots: int) -> Iterator[_Place]:
    """Return the places of terms that are at chosen knots: one for the first knot, and one for each set of others.

    Args:
        terms: of the formulation.
        first: the place of the first knot.
        later: the place of all others.
        interval: that ends at a later knot.
        knots: N, the number of intervals.

    Raises:
        FormulationError: a term names a knot beyond the last.
    """
    found = dict[tuple[int, ...], dict[Place, Knot | Interval]]()
    for term in terms:
        for chosen in term.places:
            if isinstance(chosen, Where):
                continue
            if max(chosen.ends) > knots:
                raise FormulationError(
                    f"the term '{term.name}' is at {chosen.value}; expected knots from 0 to {knots}, the last"
                )
            if 0 in chosen.ends:
                found.setdefault((), {})[chosen] = first.at[Where.FIRST_KNOT]
            if ends := tuple(sorted(knot for knot in chosen.ends if knot)):
                found.setdefault(ends, {})[chosen] = interval if chosen.of_intervals else interval.end
    for index, (ends, at) in enumerate(found.items(), 1):
        own = replace(first if not ends else later, name=f"chosen_{index}", at=at)
        yield replace(own, starts=np.array(ends) - 1, knots=np.array(ends)) if ends else own


def _rows(constraints: Sequence[Constraint], place: _Place, parameters: Parameters) -> list[tuple[str, Rows]]:
    """Return the rows of a place by name; a robot without jets has none of theirs."""
    found = []
    for term in constraints:
        if term.exists(parameters):
            rows = [term.rows(at, parameters) for at in _at(term, place)]
            found += [(term.name, some) for some in rows if some.expression.shape[0]]
    return found


def _charges(costs: Sequence[Cost], place: _Place, parameters: Parameters, duration: SX) -> dict[str, SX]:
    """Return the weighted costs of a place by name; those of zero weight are left out."""
    charged = {}
    for term in costs:
        if not (term.exists(parameters) and np.any(term.weights(parameters))):
            continue
        for at in _at(term, place):
            amount = term.charge(at, parameters)
            charged[term.name] = amount * duration if term.per_second else amount
    return charged


def _at(term: Constraint | Cost, place: _Place) -> list[Knot | Interval]:
    """Return what a term is given in a place, if it is there: once, even where two of its own names mean the same."""
    return [place.at[where] for where in term.places if where in place.at][:1]


def _without_bounds(name: str, rows: Rows, place: _Place, layout: Layout) -> tuple[Rows, list[Held]]:
    """Split rows into those that remain and those that are a single variable, up to a constant."""
    jacobian = cs.sparsify(cs.jacobian(rows.expression, place.variables))
    kept, held = list[int](), list[Held]()
    for index in range(rows.expression.shape[0]):
        entry, slopes = rows.expression[index], jacobian[index, :]
        single = slopes.nnz() == 1 and slopes.nonzeros()[0].is_constant()
        if not single or not cs.symvar(entry) or len(cs.symvar(entry)) > 1:
            kept.append(index)
            continue
        slope = float(slopes.nonzeros()[0])
        constant = float(cs.substitute(entry, place.variables, cs.DM.zeros(place.variables.shape[0])))
        low, high = sorted((limit - constant) / slope for limit in (rows.lower, rows.upper))
        column = slopes.sparsity().get_col()[0]
        variable = next(key for key, span in layout.rows.items() if span.start <= column < span.stop)
        held.append(
            Held(
                term=name,
                variable=variable,
                row=column - layout.rows[variable].start,
                knots=place.knots,
                component=rows.components[index],
                unit=rows.units[index],
                slope=abs(slope),
                lower=low,
                upper=high,
            )
        )
    if not held:
        return rows, held
    return rows.of(kept), held


def _tighten(bounds: Bounds, layout: Layout, held: Held) -> None:
    scale: float = layout.scale[layout.rows[held.variable].start + held.row]
    lower, upper = bounds.lower[held.variable], bounds.upper[held.variable]
    lower[held.row, held.knots] = np.maximum(lower[held.row, held.knots], held.lower * scale)
    upper[held.row, held.knots] = np.minimum(upper[held.row, held.knots], held.upper * scale)

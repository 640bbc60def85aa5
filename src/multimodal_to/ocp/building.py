"""`build`: a robot, a scenario and a formulation become a `Problem`."""

from __future__ import annotations

import copyreg
from collections.abc import Callable, Collection, Sequence
from dataclasses import replace
from typing import Any

import casadi as cs
import numpy as np
from numpy.typing import NDArray

from multimodal_to.adam.spatial import Array
from multimodal_to.arguments import checked
from multimodal_to.errors import FormulationError, listed
from multimodal_to.models.robot import Robot
from multimodal_to.models.state import State
from multimodal_to.models.units import size_of
from multimodal_to.ocp import given, rebinding
from multimodal_to.ocp.formulation import Formulation
from multimodal_to.ocp.outline import formulate, prepared
from multimodal_to.ocp.problem import EagerRows, Problem, RowSet
from multimodal_to.ocp.stages import NamedStage
from multimodal_to.ocp.transcription import Nlp, Stage, symbolic
from multimodal_to.scenarios.scenario import Scenario


@checked
def build(
    robot: Robot, scenario: Scenario, formulation: Formulation | None = None, *, initial: State | None = None
) -> Problem:
    """Return the problem of a scenario for a robot; nothing is solved but the start posture.

    Args:
        robot: whose motion it is.
        scenario: the task.
        formulation: what the problem is made of; by default `Formulation.executable()`.
        initial: the state to start in, for a scenario whose start is `Start.GIVEN`; its CoM becomes `initial_com`. By
            default it is that of the file `initial_state` of the scenario.

    Raises:
        ScenarioError: the scenario contradicts itself or does not fit the robot, or its start lacks a state.
        TrajectoryError: the file of that state is missing or broken.
        InputError: there is a state for a scenario with another start, or it is of another robot.
        FormulationError: a term does not return what it has to, or is not a number at the start guess.
    """
    formulation = formulation or Formulation.executable()
    scenario = scenario.for_robot(robot)
    initial = initial or given.measured(scenario)
    robot, standing = prepared(robot, scenario)
    given.check(robot, scenario, initial)
    scenario = rebinding.started(robot, scenario, initial)
    outline = formulate(robot, scenario, standing, formulation, initial)
    outline.refuse_crossed()
    layout = outline.layout
    stages = tuple(named.stage for named in outline.stages)

    scale = np.append(np.tile(layout.scale, scenario.knots + 1), size_of(formulation.interval_scale, "s", robot.units))
    lower, upper = rebinding.stacked(outline.bounds, layout, scenario, scale)
    box_lower, box_upper = rebinding.stacked(outline.box, layout, scenario, scale)
    row_lower, row_upper, rows = _row_bounds(outline.stages)
    if initial is not None:
        rebinding.hold_rows(row_lower, row_upper, rows, robot, initial)
    guess = rebinding.guessed(robot, scenario, initial.posture if initial else standing, layout, scale)
    problem = Problem(
        robot=robot,
        scenario=scenario,
        formulation=formulation,
        layout=layout,
        opti=_opti(stages, layout.size, scenario.knots, (lower, upper), (row_lower, row_upper)),
        nlp=Nlp(stages=stages, size=layout.size, knots=scenario.knots),
        eager=_eager(outline.stages, formulation.lazy_terms, layout.size, scenario.knots),
        lower=lower,
        upper=upper,
        box_lower=box_lower,
        box_upper=box_upper,
        row_lower=row_lower,
        row_upper=row_upper,
        rows=rows,
        bound_rows=rebinding.bound_sets(outline.held, layout),
        cost_names=tuple(name for named in outline.stages for name in named.cost_names),
        guess=np.clip(guess, lower, upper),
        parameters=outline.parameters,
        initial=initial,
        scale=scale,
    )
    _refuse_no_numbers(problem, outline.stages)
    _make_functions(problem)
    return problem


def _again(robot: Robot, scenario: Scenario, formulation: Formulation, initial: State | None) -> Problem:
    return build(robot, scenario, formulation, initial=initial)


def _built_again(problem: Problem) -> tuple[Callable[..., Problem], tuple[Any, ...]]:
    """Return how pickle makes a problem: CasADi's expressions do not travel, and what they are built from does."""
    return _again, (problem.robot, problem.scenario, problem.formulation, problem.initial)


copyreg.pickle(Problem, _built_again)


def _row_bounds(stages: Sequence[NamedStage]) -> tuple[Array, Array, dict[str, RowSet]]:
    """Return the bounds of g in solver units, and where each name's rows are."""
    low, high, sets, first = list[Array](), list[Array](), dict[str, RowSet](), 0
    for named in stages:
        height, repeats = named.stage.rows.shape[0], named.stage.repeats
        lower, upper, offset = np.zeros(height), np.zeros(height), 0
        for name, rows in named.rows:
            count = rows.expression.shape[0]
            here = slice(offset, offset + count)
            lower[here], upper[here] = rows.lower / rows.scale, rows.upper / rows.scale
            here_too = RowSet(
                index=(first + np.arange(offset, offset + count)[:, None] + height * np.arange(repeats)).ravel(),
                knots=np.tile(named.knots, count),
                components=np.repeat(np.array(rows.components, dtype=np.str_), repeats),
                units=np.repeat(np.array(rows.units, dtype=np.str_), repeats),
                scale=np.repeat(rows.scale, repeats),
            )
            sets[name] = sets[name].joined(here_too) if name in sets else here_too
            offset += count
        low.append(np.tile(lower, repeats))
        high.append(np.tile(upper, repeats))
        first += height * repeats
    return np.concatenate(low), np.concatenate(high), sets


def _eager(stages: Sequence[NamedStage], lazy: Collection[str], size: int, knots: int) -> EagerRows | None:
    """Return the rows that are not lazy, and a problem's functions with them alone; None where all rows are these.

    Args:
        stages: of the problem.
        lazy: names of the terms whose rows are lazy.
        size: number of variables of a knot.
        knots: N, the number of intervals.
    """
    kept, index, first = list[Stage](), list[NDArray[np.int64]](), 0
    for named in stages:
        stage, sizes = named.stage, [rows.expression.shape[0] for _, rows in named.rows]
        height = sum(sizes)
        eager = [name not in lazy for name, _ in named.rows]
        offsets = np.flatnonzero(np.repeat(eager, sizes))[:, None]
        index.append((first + offsets + height * np.arange(stage.repeats)).ravel(order="F"))
        first += height * stage.repeats
        if not all(eager):
            families = zip(stage.lifted_families, eager, strict=True)
            stage = replace(stage, lifted_families=tuple(rows for rows, here in families if here))
        if any(eager) or named.cost_names:
            kept.append(stage)
    rows = np.concatenate(index)
    return None if rows.size == first else EagerRows(Nlp(stages=tuple(kept), size=size, knots=knots), rows)


def _make_functions(problem: Problem) -> None:
    """Make what a solve will ask for; where the start guess misses a lazy row, it will ask for the curvature of all."""
    lazy = problem.eager is not None and not problem.misses_lazy_rows(problem.guess, 0.0)
    problem.nlp.make("cost_hessian", *(() if lazy else ("hessian",)))
    if lazy:
        assert problem.eager is not None
        problem.eager.nlp.make("rows", "jacobian", "hessian")


def _refuse_no_numbers(problem: Problem, stages: Sequence[NamedStage]) -> None:
    """Make sure that every term and its derivatives are numbers at the start guess.

    Raises:
        FormulationError: one is not.
    """
    guess, empty = problem.guess, np.zeros(0)
    values, jacobian = problem.nlp.jacobian(guess, empty)
    slopes = np.zeros(problem.row_lower.size)
    np.add.at(slopes, np.array(jacobian.sparsity().get_triplet()[0], dtype=np.int64), np.array(jacobian.nonzeros()))
    for what, numbers in (("value", np.array(values).ravel()), ("derivative", slopes)):
        for name, rows in problem.rows.items():
            if (bad := np.flatnonzero(~np.isfinite(numbers[rows.index]))).size:
                where = f"knot {rows.knots[bad[0]]}" + " ".join(("", str(rows.components[bad[0]]))).rstrip()
                raise FormulationError(
                    f"the term '{name}': its {what} at the start guess is no finite number, at {where}; expected a "
                    "function that is smooth there"
                )
    for name, value in problem.costs(guess).items():
        if not np.isfinite(value):
            raise FormulationError(
                f"the term '{name}': its value at the start guess is no finite number; expected a function that is "
                "smooth there"
            )
    if not np.isfinite(np.array(problem.nlp.gradient(guess, empty)[1])).all():
        names = [name for named in stages for name in _steep_costs(problem, named)]
        raise FormulationError(
            f"the term '{listed(names)}': its derivative at the start guess is no finite number; expected a function "
            "that is smooth there"
        )


def _steep_costs(problem: Problem, named: NamedStage) -> list[str]:
    """Return the costs of a stage that have no finite gradient at the start guess."""
    stage, x = named.stage, problem.guess
    columns = x[stage.positions(problem.layout.size, x.size - 1)]
    size = problem.layout.size
    steep = []
    for index, name in enumerate(named.cost_names):
        function = stage.cost_gradient(index).map(stage.repeats)
        gradient = function(columns[:size], columns[size : 2 * size], columns[2 * size :])
        if not np.isfinite(np.array(gradient)).all():
            steep.append(name)
    return steep


def _opti(
    stages: Sequence[Stage], size: int, knots: int, bounds: tuple[Array, Array], row_bounds: tuple[Array, Array]
) -> cs.Opti:
    """Return the `Opti` problem, which CasADi evaluates and derives itself; bounds come first.

    Args:
        stages: of the problem.
        size: number of variables of a knot.
        knots: N, the number of intervals.
        bounds: of the variables.
        row_bounds: of the rows.
    """
    opti = cs.Opti()
    x = opti.variable(bounds[0].size)
    rows, objective = symbolic(stages, x, size, knots)
    opti.subject_to(opti.bounded(bounds[0], x, bounds[1]))
    opti.subject_to(opti.bounded(row_bounds[0], rows, row_bounds[1]))
    opti.minimize(objective)
    return opti

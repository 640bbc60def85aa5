"""Lazy rows: what IPOPT leaves out until an answer without it misses it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import multimodal_to as mt


@pytest.fixture(scope="module")
def stand():
    """A short problem without jets, so that its answers come fast: the CoM goes down by 2 cm."""
    return replace(
        mt.scenarios.jump(),
        knots=10,
        mid_height_min=None,
        final_com=(0.0, 0.0, 0.55),
        interval_min=0.1,
        interval_max=0.1,
        allowances={},
    )


def force_rates(interval, parameters):
    """(f⁺ − f) / Δt."""
    return interval.rate(lambda knot: knot.contact_forces)


def limited(most, *, lazy):
    """The default formulation with contact forces that change by at most so much [N/s]."""
    rows = mt.Constraint(
        value=force_rates,
        within=mt.between(-most, most),
        unit="N/s",
        scale=500.0,
        holds=mt.Where.EVERY_INTERVAL,
        lazy=lazy,
    )
    return mt.Formulation.executable().with_terms(rows)


def solved(ironcub, stand, formulation=None, **start):
    problem = mt.build(ironcub, stand, formulation)
    iterates = []

    def keep(iterate):
        iterates.append(iterate.iteration)

    return problem, mt.solve(problem, progress=keep, **start), iterates


@pytest.fixture(scope="module")
def free(ironcub, stand):
    return solved(ironcub, stand)[1]


@pytest.fixture(scope="module")
def rate(free):
    """A limit that the free motion exceeds [N/s]."""
    return 0.5 * np.abs(free.trajectory.contact_force_rates[:, 1:]).max()


@pytest.fixture(scope="module")
def held(ironcub, stand, rate):
    return solved(ironcub, stand, limited(rate, lazy=True))


def test_a_lazy_row_that_an_answer_meets_anyway_changes_no_iterate(ironcub, stand, free, rate):
    problem, solution, _ = solved(ironcub, stand, limited(4.0 * rate, lazy=True))
    assert problem.row_lower.size > problem.eager.index.size
    assert solution.iterations == free.iterations
    assert np.array_equal(solution.trajectory.contact_forces, free.trajectory.contact_forces)
    assert solution.violations["force_rates"] == 0.0


def test_a_lazy_row_that_an_answer_misses_holds_in_the_end(ironcub, stand, free, rate, held):
    _, solution, _ = held
    _, eager, _ = solved(ironcub, stand, limited(rate, lazy=False))
    assert solution.status is eager.status is mt.Status.OPTIMAL
    assert np.abs(solution.trajectory.contact_force_rates[:, 1:]).max() < 1.0001 * rate
    assert solution.objective == pytest.approx(eager.objective, rel=1e-4)
    assert solution.objective > free.objective


def test_iterations_of_all_passes_count_on(held):
    _, solution, iterates = held
    assert sorted(set(iterates)) == list(range(solution.iterations + 1))


def test_an_answer_at_the_limit_of_a_lazy_row_is_gone_on_from_with_all_rows(held):
    problem, solution, _ = held
    x = problem.start_from(solution.trajectory)
    assert problem.misses_lazy_rows(x, -0.01)
    assert not problem.misses_lazy_rows(x, 1e-6)
    again = mt.solve(problem, start=solution.trajectory)
    assert again.status is mt.Status.OPTIMAL
    assert again.iterations < solution.iterations / 2
    assert again.objective == pytest.approx(solution.objective, rel=1e-3)


def test_the_functions_without_lazy_rows_are_those_of_the_other_rows(held):
    problem, solution, _ = held
    x, eager = problem.start_from(solution.trajectory), problem.eager
    assert np.array_equal(np.array(eager.nlp.rows(x)).ravel(), problem.rows_at(x)[eager.index])
    alone, whole = (np.array(nlp.gradient(x, [])[1]) for nlp in (eager.nlp, problem.nlp))
    assert np.array_equal(alone, whole)
    lazy = np.concatenate([problem.rows[name].index for name in problem.formulation.lazy_terms if name in problem.rows])
    assert np.array_equal(np.sort(np.concatenate([lazy, eager.index])), np.arange(problem.row_lower.size))


def test_a_problem_without_lazy_rows_has_none_to_leave_out(ironcub, stand):
    problem = mt.build(ironcub, mt.scenarios.paper("jump"), mt.Formulation.paper())
    assert problem.eager is None
    assert not problem.misses_lazy_rows(problem.guess, -np.inf)

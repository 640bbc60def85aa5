"""Lazy rows: what IPOPT leaves out while the motion is far from it."""

from __future__ import annotations

import numpy as np
import pytest

import multimodal_to as mt
from multimodal_to.solving import ipopt


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


def solved(ironcub, stand, formulation=None):
    problem = mt.build(ironcub, stand, formulation)
    return problem, mt.solve(problem)


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


@pytest.fixture
def passes(monkeypatch):
    """What IPOPT was given: each pass, and whether with all rows."""
    seen, run = [], ipopt._run

    def watched(posed, x, options, watcher):
        seen.append((watcher.which.value, posed.whole))
        return run(posed, x, options, watcher)

    monkeypatch.setattr(ipopt, "_run", watched)
    return seen


def test_a_lazy_row_that_the_rough_pass_ends_far_from_is_left_out_of_the_exact_one(ironcub, stand, free, rate, passes):
    problem, solution = solved(ironcub, stand, limited(8.0 * rate, lazy=True))
    assert passes == [("rough", True), ("exact", False)]
    assert problem.row_lower.size > problem.eager.index.size
    assert solution.objective == pytest.approx(free.objective, rel=1e-6)
    assert solution.violations["force_rates"] == 0.0


def test_where_the_answer_misses_a_row_that_was_left_out_another_pass_has_it(ironcub, stand, rate, passes, monkeypatch):
    monkeypatch.setattr(ipopt, "_NEAR", -np.inf)  # wherever the rough pass ends
    _, solution = solved(ironcub, stand, limited(rate, lazy=True))
    assert passes == [("rough", True), ("exact", False), ("exact", True)]
    assert solution.status is mt.Status.OPTIMAL
    assert np.abs(solution.trajectory.contact_force_rates[:, 1:]).max() < 1.0001 * rate


def test_a_lazy_row_that_an_answer_misses_holds_in_the_end(ironcub, stand, free, rate, held):
    _, solution = held
    _, eager = solved(ironcub, stand, limited(rate, lazy=False))
    assert solution.status is eager.status is mt.Status.OPTIMAL
    assert np.abs(solution.trajectory.contact_force_rates[:, 1:]).max() < 1.0001 * rate
    assert solution.objective == pytest.approx(eager.objective, rel=1e-4)
    assert solution.objective > free.objective


def test_an_answer_at_the_limit_of_a_lazy_row_is_gone_on_from_with_all_rows(held):
    problem, solution = held
    x = problem.start_from(solution.trajectory)
    assert problem.misses_lazy_rows(x, -0.01)
    assert not problem.misses_lazy_rows(x, 1e-6)
    again = mt.solve(problem, start=solution.trajectory)
    assert again.status is mt.Status.OPTIMAL
    assert again.iterations < solution.iterations / 2
    assert again.objective == pytest.approx(solution.objective, rel=1e-3)


def test_the_functions_without_lazy_rows_are_those_of_the_other_rows(held):
    problem, solution = held
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

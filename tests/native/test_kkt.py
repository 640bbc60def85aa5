"""The factorisation along the horizon, against dense eigenvalues and residuals."""

from __future__ import annotations

import ctypes
import threading
from collections import Counter

import numpy as np
import pytest

from multimodal_to.errors import SolverError
from multimodal_to.native import stage_solver
from multimodal_to.native.stage_solver import KktStructure, StageSolver
from stage_matrices import SINGULAR, Ma27, StageMatrix, assembled, draw, judge

MATRICES = 400
"""In every run of the tests; `benchmarks/stage_matrices.py` draws ten thousand."""
NOT_OURS = -1


@pytest.fixture(scope="session")
def library(tested):
    return ctypes.CDLL(str(tested))


@pytest.fixture
def rng():
    return np.random.default_rng(7)


def chain(rng, knots, size=3) -> StageMatrix:
    """A convex problem: x_k+1 = x_k + u_k, with bounds on sums, and a global variable in every row."""
    n = 2 * size * knots + 1
    w = np.diag(rng.uniform(0.5, 2.0, n))
    a = np.zeros((size * (knots - 1), n))
    c = np.zeros((knots, n))
    for k in range(knots):
        own = 2 * size * k + np.arange(2 * size)
        c[k, own], c[k, -1] = 1.0, 0.1
        if k:
            rows = size * (k - 1) + np.arange(size)
            a[rows, own[:size]], a[rows, own[:size] - 2 * size], a[rows, own[size:]] = 1.0, -1.0, -0.1
            a[rows, -1] = rng.standard_normal(size)
    structure = KktStructure(
        knots=knots,
        variable_knots=np.append(np.repeat(np.arange(knots), 2 * size), -1).astype(np.int32),
        inequalities=len(c),
        equalities=len(a),
    )
    return assembled(rng, structure, w, a, c, 0.0)


def factorised(library, matrix, values=None):
    """INFO(1), negative eigenvalues and a solution, by a solver of its own."""
    i, j, own = matrix.triplets
    with StageSolver(library, matrix.structure) as solver, solver.announced():
        ma27 = Ma27(library)
        assert ma27.structure(matrix.dense.shape[0], i, j) == 0
        ended, negative = ma27.factorise(own if values is None else values)
        return ended, negative, ma27.solve(np.ones(matrix.dense.shape[0]))[1] if not ended else None


def test_random_matrices_have_the_inertia_of_their_eigenvalues_and_are_solved(library):
    ends = Counter()
    for number in range(MATRICES):
        rng = np.random.default_rng([1, number])
        matrix = draw(rng)
        end, fault = judge(library, matrix, rng.standard_normal(matrix.dense.shape[0]))
        assert not fault, f"matrix {number}: {fault}"
        ends[end] += 1
    assert min(ends["right inertia"], ends["wrong inertia"], ends["singular"]) > MATRICES / 20


def test_rows_of_many_columns_are_taken_together_and_large_fronts_work(library):
    for number in range(12):
        rng = np.random.default_rng([2, number])
        matrix = draw(rng, knots=3, largest=60)
        _, fault = judge(library, matrix, rng.standard_normal(matrix.dense.shape[0]))
        assert not fault


@pytest.mark.parametrize("knots", [1, 2, 3])
def test_a_horizon_of_one_two_or_three_knots(library, knots):
    for number in range(30):
        rng = np.random.default_rng([3, knots, number])
        matrix = draw(rng, knots=knots)
        assert not judge(library, matrix, rng.standard_normal(matrix.dense.shape[0]))[1]


def test_a_thousand_knots_cost_ten_times_a_hundred(library, rng):
    operations = {}
    for knots in (100, 1000):
        matrix = chain(rng, knots, size=1)
        i, j, values = matrix.triplets
        with StageSolver(library, matrix.structure) as solver, solver.announced():
            ma27 = Ma27(library)
            assert ma27.structure(matrix.dense.shape[0], i, j) == 0
            assert ma27.factorise(values) == (0, matrix.rows)
            right_side = rng.standard_normal(matrix.dense.shape[0])
            ended, x = ma27.solve(right_side)
            assert ended == 0
            assert np.abs(matrix.dense @ x - right_side).max() < 1e-9
            counts = solver.counts
            operations[knots] = counts.operations
            assert counts.fronts == knots
    assert operations[1000] == pytest.approx(10 * operations[100], rel=0.05)


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_what_is_no_number_is_singular_and_the_next_matrix_is_as_ever(library, rng, bad):
    matrix = chain(rng, 8)
    i, j, values = matrix.triplets
    with StageSolver(library, matrix.structure) as solver, solver.announced():
        ma27 = Ma27(library)
        ma27.structure(matrix.dense.shape[0], i, j)
        expected = ma27.factorise(values), ma27.solve(np.ones(matrix.dense.shape[0]))[1]
        for place in range(0, values.size, 7):
            spoilt = values.copy()
            spoilt[place] = bad
            assert ma27.factorise(spoilt)[0] == SINGULAR
            assert ma27.solve(np.ones(matrix.dense.shape[0]))[0] == NOT_OURS
        assert ma27.factorise(values) == expected[0]
        np.testing.assert_array_equal(ma27.solve(np.ones(matrix.dense.shape[0]))[1], expected[1])


def test_a_right_side_that_is_no_number_ends_and_spoils_nothing(library, rng):
    matrix = chain(rng, 5)
    i, j, values = matrix.triplets
    with StageSolver(library, matrix.structure) as solver, solver.announced():
        ma27 = Ma27(library)
        ma27.structure(matrix.dense.shape[0], i, j)
        ma27.factorise(values)
        expected = ma27.solve(np.ones(matrix.dense.shape[0]))[1]
        assert not np.isfinite(ma27.solve(np.full(matrix.dense.shape[0], np.nan))[1]).all()
        np.testing.assert_allclose(ma27.solve(np.ones(matrix.dense.shape[0]))[1], expected, rtol=1e-9)


def test_a_matrix_of_no_size_is_a_matrix(library, rng):
    nothing = KktStructure(knots=1, variable_knots=np.zeros(0, dtype=np.int32), inequalities=0, equalities=0)
    matrix = assembled(rng, nothing, np.zeros((0, 0)), np.zeros((0, 0)), np.zeros((0, 0)), 0.0)
    assert judge(library, matrix, np.zeros(0)) == ("right inertia", "")


def test_no_rows_no_slacks_and_knots_without_variables(library, rng):
    for sizes, shared in (([0, 3, 0, 0, 2], 0), ([0, 0, 0], 2), ([4], 0)):
        knots = np.append(np.repeat(np.arange(len(sizes)), sizes), np.full(shared, -1)).astype(np.int32)
        structure = KktStructure(knots=len(sizes), variable_knots=knots, inequalities=0, equalities=0)
        none = np.zeros((0, knots.size))
        matrix = assembled(rng, structure, np.diag(rng.uniform(1, 2, knots.size)), none, none, 0.0)
        assert judge(library, matrix, rng.standard_normal(knots.size)) == ("right inertia", "")


def test_another_structure_than_was_announced_is_refused_in_a_sentence(library, rng):
    matrix = chain(rng, 4)
    i, j, _ = matrix.triplets
    size, n = matrix.dense.shape[0], matrix.structure.variable_knots.size
    slack, row = n + 1, n + matrix.structure.inequalities + matrix.structure.equalities + 1
    without_slack = (i - 1 < n) == (i - 1 < n)
    without_slack &= ~((np.minimum(i, j) == slack) & (np.maximum(i, j) == row))
    cases = [
        ("another size", size + 1, i, j),
        ("outside the KKT matrix", size, np.append(i, size + 1), np.append(j, 1)),
        ("neither of the Hessian", size, np.append(i, slack), np.append(j, 1)),
        ("has no slack", size, i[without_slack], j[without_slack]),
    ]
    for words, announced, rows, columns in cases:
        with StageSolver(library, matrix.structure) as solver, solver.announced():
            found = Ma27(library).structure(announced, rows.astype(np.int32), columns.astype(np.int32))
            assert (found, words in solver.refusal) == (NOT_OURS, True), solver.refusal


def test_knots_that_are_coupled_by_too_much_are_refused(library, rng):
    n = 2100
    structure = KktStructure(knots=1, variable_knots=np.zeros(n, dtype=np.int32), inequalities=0, equalities=0)
    with StageSolver(library, structure) as solver, solver.announced():
        ma27 = Ma27(library)
        places = np.arange(1, n + 1, dtype=np.int32)
        assert ma27.structure(n, np.append(places, places[1:]), np.append(places, np.full(n - 1, 1, np.int32))) == 0
        assert ma27.factorise(np.ones(2 * n - 1))[0] == NOT_OURS
        assert "too many unknowns" in solver.refusal


def test_a_solve_that_nobody_announced_is_refused(library, rng):
    matrix = chain(rng, 3)
    i, j, values = matrix.triplets
    assert Ma27(library).structure(matrix.dense.shape[0], i, j) == NOT_OURS
    with StageSolver(library, matrix.structure) as solver, solver.announced():
        ma27 = Ma27(library)
        assert ma27.structure(matrix.dense.shape[0], i, j) == 0
    assert ma27.factorise(values)[0] == NOT_OURS  # its solver is closed
    assert ma27.solve(np.ones(matrix.dense.shape[0]))[0] == NOT_OURS


def test_a_knot_that_there_is_not_is_refused(library, rng):
    matrix = chain(rng, 3)
    i, j, _ = matrix.triplets
    for knot in (-2, 3):
        knots = matrix.structure.variable_knots.copy()
        knots[0] = knot
        wrong = KktStructure(
            knots=3, variable_knots=knots, inequalities=matrix.structure.inequalities,
            equalities=matrix.structure.equalities,
        )  # fmt: skip
        with StageSolver(library, wrong) as solver, solver.announced():
            assert Ma27(library).structure(matrix.dense.shape[0], i, j) == NOT_OURS
            assert "of a knot that there is not" in solver.refusal


def test_knots_far_apart_that_are_coupled_only_make_it_slower(library, rng):
    matrix = chain(rng, 9)
    n = matrix.structure.variable_knots.size
    a = matrix.dense[n + matrix.structure.inequalities :][: matrix.structure.equalities, :n].copy()
    c = matrix.dense[-matrix.structure.inequalities :, :n].copy()
    a[0, n // 2], a[1, n - 2], c[0, n - 3] = 1.0, 1.0, 1.0
    coupled = assembled(rng, matrix.structure, matrix.dense[:n, :n], a, c, 0.0)
    assert judge(library, coupled, rng.standard_normal(coupled.dense.shape[0])) == ("right inertia", "")


def test_solvers_in_threads_do_not_meet(library):
    matrices = [chain(np.random.default_rng(seed), 12 + seed) for seed in range(4)]
    expected = [factorised(library, matrix) for matrix in matrices]
    faults = []

    def work(which):
        for _ in range(25):
            ended, negative, x = factorised(library, matrices[which])
            if (ended, negative) != expected[which][:2] or not np.array_equal(x, expected[which][2]):
                faults.append(which)

    threads = [threading.Thread(target=work, args=(which,)) for which in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert not faults


def test_two_threads_find_the_same_bits_as_one(library):
    for number in range(40):
        matrix = draw(np.random.default_rng([5, number]), knots=9)
        library.mt_set_threads(1)
        alone = factorised(library, matrix)
        library.mt_set_threads(2)
        try:
            together = factorised(library, matrix)
        finally:
            library.mt_set_threads(1)
        assert alone[:2] == together[:2]
        np.testing.assert_array_equal(alone[2], together[2])


def test_each_instruction_set_finds_the_same_inertia(tested, compiler, opened_anew, monkeypatch):
    for name in compiler.instruction_sets:
        monkeypatch.setenv("MULTIMODAL_TO_INSTRUCTION_SET", name)
        library = opened_anew(tested)
        for number in range(60):
            rng = np.random.default_rng([6, number])
            matrix = draw(rng)
            assert not judge(library, matrix, rng.standard_normal(matrix.dense.shape[0]))[1], (name, number)


def test_no_memory_is_an_error(library, monkeypatch):
    structure = KktStructure(knots=1, variable_knots=np.zeros(1, dtype=np.int32), inequalities=0, equalities=0)

    class Empty:
        def __getattr__(self, name):
            return getattr(library, name)

        def mt_kkt_new(self, *_):
            return None

    monkeypatch.setattr(stage_solver, "_declared", lambda _: Empty())
    with pytest.raises(SolverError, match="not enough memory"):
        StageSolver(library, structure)

"""The functions of the whole horizon say the same by tapes and by CasADi, to the last bit."""

from __future__ import annotations

import gc
import json
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import casadi as cs
import numpy as np
import pytest

import multimodal_to as mt
from multimodal_to.ocp import evaluation, tapes
from multimodal_to.ocp.evaluation import Block, Entries, Evaluation, Output
from multimodal_to.trajectory import Trajectory
from tapes import needs_library, same_bits

HOP = replace(mt.scenarios.jump(), knots=11)
FUNCTIONS = ("rows", "costs", "objective", "gradient", "jacobian", "hessian", "cost_hessian")


def slow_turns(knot, parameters):
    """erf⁻¹(ω / 100), which no tape knows."""
    return cs.erfinv(0.01 * knot.base_angular_velocity)


ODD = mt.Formulation.paper().with_terms(mt.Cost(residual=slow_turns, weight=1e2, unit="1"))


def without_library(robot, scenario, formulation=None) -> mt.Problem:
    with pytest.MonkeyPatch.context() as patch:
        for module in (evaluation, tapes):
            patch.setattr(module, "library", lambda: None)
        problem = mt.build(robot, scenario, formulation)
        for name in FUNCTIONS:  # a function is made when it is asked for first
            getattr(problem.nlp, name)
        return problem


@pytest.fixture(scope="module")
def taped(ironcub) -> mt.Problem:
    return mt.build(ironcub, HOP)


@pytest.fixture(scope="module")
def mapped(ironcub) -> mt.Problem:
    return without_library(ironcub, HOP)


def arguments(problem: mt.Problem, name: str, seed: int = 0) -> tuple[np.ndarray, ...]:
    random = np.random.default_rng(seed)
    x = problem.guess + 0.01 * random.normal(size=problem.guess.size)
    multipliers = random.normal(size=problem.row_lower.size)
    if name.endswith("hessian"):
        return x, np.zeros(0), np.array([0.3]), multipliers
    return (x,) if name in ("rows", "costs", "objective") else (x, np.zeros(0))


def values(problem: mt.Problem, name: str, seed: int = 0) -> list[np.ndarray]:
    found = getattr(problem.nlp, name)(*arguments(problem, name, seed))
    return [np.array(each.nonzeros()) for each in (found if isinstance(found, tuple) else (found,))]


def alike(found: list[np.ndarray], expected: list[np.ndarray]) -> bool:
    return all(same_bits(*each) for each in zip(found, expected, strict=True))


@needs_library
@pytest.mark.parametrize("name", FUNCTIONS)
def test_with_and_without_the_library_every_function_has_the_same_bits(taped, mapped, name):
    assert getattr(taped.nlp, name).taped
    assert not getattr(mapped.nlp, name).taped
    for index in range(getattr(taped.nlp, name).n_out()):
        assert getattr(taped.nlp, name).sparsity_out(index) == getattr(mapped.nlp, name).sparsity_out(index)
    assert alike(values(taped, name), values(mapped, name))


@pytest.mark.parametrize("problem", ["taped", "mapped"])
def test_rows_and_objective_are_those_of_the_opti_problem(problem, request):
    problem = request.getfixturevalue(problem)
    (x,) = arguments(problem, "rows")
    opti = cs.Function("opti", [problem.opti.x], [problem.opti.g[x.size :], problem.opti.f])
    rows, objective = (np.array(each).ravel() for each in opti(x))
    assert same_bits(values(problem, "rows")[0], rows)
    assert values(problem, "objective")[0] == pytest.approx(objective, rel=1e-14)
    assert values(problem, "objective")[0][0] == sum(values(problem, "costs")[0].tolist())


@needs_library
def test_a_term_with_an_operation_that_tapes_do_not_know_is_evaluated_by_casadi(ironcub):
    """Only the functions that hold the term are: the rows do not."""
    some, none = mt.build(ironcub, HOP, ODD), without_library(ironcub, HOP, ODD)
    assert some.nlp.rows.taped
    assert some.nlp.jacobian.taped
    assert not some.nlp.costs.taped
    assert not some.nlp.taped
    for name in FUNCTIONS:
        assert alike(values(some, name), values(none, name)), name


@needs_library
def test_a_solve_with_and_without_the_library_ends_in_the_same_bits_and_its_record_says_which(taped, mapped, tmp_path):
    few = mt.Ipopt(max_iterations=6, rough_iterations=3)
    ours, theirs = mt.solve(taped, few), mt.solve(mapped, few)
    assert ours.objective == theirs.objective
    assert np.array_equal(ours.trajectory.joint_positions, theirs.trajectory.joint_positions)
    assert ours.trajectory.solve_record()["taped"] is True
    assert theirs.trajectory.solve_record()["taped"] is False


def test_a_record_of_compiled_derivatives_is_still_read(mapped, tmp_path):
    few = mt.solve(mapped, mt.Ipopt(max_iterations=1))
    record = few.trajectory.solve_record()
    del record["taped"]
    old = replace(few.trajectory, solve_json=json.dumps({**record, "compiled": True}))
    assert Trajectory.load(old.save(tmp_path / "old.npz")).solve_record()["compiled"] is True


@pytest.mark.parametrize("problem", ["taped", "mapped"])
def test_several_threads_may_evaluate_at_once(problem, request):
    problem = request.getfixturevalue(problem)
    expected = {seed: values(problem, "hessian", seed) for seed in range(3)}
    with ThreadPoolExecutor(4) as pool:
        found = list(pool.map(lambda turn: (turn % 3, values(problem, "hessian", turn % 3)), range(12)))
    assert all(alike(each, expected[seed]) for seed, each in found)


def test_a_function_that_outlives_its_evaluation_says_so():
    evaluated = squares(3)
    symbol = cs.MX.sym("x", 4)
    held = cs.Function("held", [symbol], evaluated(symbol, []))
    assert np.array(held(np.ones(4))[1]).ravel().tolist() == [1.0, 2.0, 2.0, 1.0, 0.0]
    del evaluated
    gc.collect()
    with pytest.raises(RuntimeError, match="Callback object has been deleted"):
        held(np.ones(4))


def squares(repeats: int) -> Evaluation:
    """Σ over intervals of (x_k, x_k+1)², each at its two places: as their sum, in a vector and on a diagonal."""
    x = cs.SX.sym("x", 2)
    offsets = np.arange(repeats, dtype=np.int64)[None]
    block = Block(function=cs.Function("squares", [x], [x**2]), sources=(0,), offsets=offsets)
    places, nowhere = np.arange(2)[:, None] + np.arange(repeats), np.zeros((1, 1), dtype=np.int64)
    size = repeats + 2
    on_diagonal = [Entries(block=block, rows=places, columns=places)]
    in_vector = [Entries(block=block, rows=places, columns=nowhere)]
    vector = Output(name="v", shape=(size, 1), entries=in_vector, dense=True)
    diagonal = Output(name="m", shape=(size, size), entries=on_diagonal)
    return Evaluation("squares", {"x": repeats + 1, "p": 0}, [replace(vector, name="f", total=True), vector, diagonal])


@pytest.fixture(params=[pytest.param("tapes", marks=needs_library), "casadi"])
def either(request, monkeypatch) -> None:
    if request.param == "casadi":
        for module in (evaluation, tapes):
            monkeypatch.setattr(module, "library", lambda: None)


@pytest.mark.usefixtures("either")
@pytest.mark.parametrize("repeats", [1, 7, 8, 9, 1000])
def test_values_add_up_where_they_meet_and_what_nothing_reaches_is_zero(repeats):
    evaluated = squares(repeats)
    given = np.random.default_rng(repeats).normal(size=repeats + 1)
    expected = np.append(given**2, 0.0)
    expected[1:repeats] += given[1:repeats] ** 2
    f, v, m = evaluated(given, [])
    assert same_bits(np.array(v).ravel(), expected)
    assert m.nnz() == repeats + 1
    assert same_bits(np.array(m), np.diag(expected))
    assert float(f) == sum(expected.tolist())


@pytest.mark.usefixtures("either")
def test_an_evaluation_of_nothing_is_zero():
    vector = Output(name="v", shape=(3, 1), entries=[], dense=True)
    evaluated = Evaluation("nothing", {"x": 2}, [vector, replace(vector, name="m", dense=False)])
    v, m = evaluated(np.ones(2))
    assert not np.array(v).any()
    assert m.nnz() == 0

"""The structured linear solver and MUMPS find the same answers; where it cannot be had, MUMPS takes over."""

from __future__ import annotations

import threading
from dataclasses import replace

import numpy as np
import pytest

import multimodal_to as mt
from drones import HOP, drone
from multimodal_to import native
from multimodal_to.errors import SolverError
from multimodal_to.native.stage_solver import StageSolver
from multimodal_to.ocp import paper
from multimodal_to.ocp.terms import Constraint, Where, at_most
from multimodal_to.solving import linear_solvers, stages

STAGES, MUMPS = mt.Ipopt(linear_solver="stages"), mt.Ipopt(linear_solver="mumps")

if native.library() is None:
    pytest.skip(native.missing(), allow_module_level=True)


@pytest.fixture(scope="module")
def squat():
    return replace(
        mt.scenarios.take_off(),
        knots=8,
        interval_max=0.2,
        final_com=(0.0, 0.0, 0.54),
        terminal=mt.Terminal.STANDING,
        jets=False,
    )


@pytest.fixture(scope="module")
def problem(ironcub, squat):
    return mt.build(ironcub, replace(squat, margins=mt.Margins()), mt.Formulation.paper())


def both(problem):
    """Solve by both; the answers have to be the same."""
    own, other = mt.solve(problem, STAGES), mt.solve(problem, MUMPS)
    assert own.status is other.status is mt.Status.OPTIMAL
    assert own.objective == pytest.approx(other.objective, rel=1e-5)
    assert own.trajectory.solve_record()["linear_solver"] == "stages"
    assert other.trajectory.solve_record()["linear_solver"] == "mumps"
    return own, other


def test_the_papers_problem_has_the_same_answer(problem):
    own, other = both(problem)
    assert abs(own.iterations - other.iterations) <= 3


def test_leapfrog_within_margins_has_the_same_answer(ironcub, squat):
    both(mt.build(ironcub, replace(squat, knots=5)))


def test_a_body_without_joints_has_the_same_answer(tmp_path):
    both(mt.build(drone(tmp_path), HOP, mt.Formulation.paper()))


def test_terms_of_ones_own_are_part_of_the_structure(ironcub, squat):
    def all_at_once(knot, parameters):
        """Σ ṡ² of all joints."""
        return knot.joint_velocities.T @ knot.joint_velocities

    slow = Constraint(value=all_at_once, within=at_most(0.2), unit="rad²/s²", holds=Where.LATER_KNOTS)
    formulation = mt.Formulation.paper().with_terms(slow)
    both(mt.build(ironcub, replace(squat, margins=mt.Margins()), formulation))


def test_every_row_couples_neighbouring_knots_only(ironcub, squat):
    problem = mt.build(ironcub, squat)
    knots = stages.variable_knots(problem)
    row, column = (np.array(each) for each in problem.nlp.jacobian.sparsity_out(1).get_triplet())
    of_a_knot = knots[column] >= 0
    latest = np.full(problem.row_lower.size, -1)
    np.maximum.at(latest, row[of_a_knot], knots[column[of_a_knot]])
    assert (latest[row[of_a_knot]] - knots[column[of_a_knot]] <= 1).all()
    assert (knots == stages.OF_NO_KNOT).sum() == 1


def test_solves_in_threads_do_not_meet(ironcub, squat):
    scenario = replace(squat, margins=mt.Margins(), knots=5)
    heights = (0.50, 0.52, 0.54)
    problems = [
        mt.build(ironcub, replace(scenario, final_com=(0.0, 0.0, height)), mt.Formulation.paper()) for height in heights
    ]
    expected = [mt.solve(each, STAGES) for each in problems]
    found = dict[int, mt.Solution]()

    def work(index):
        found[index] = mt.solve(problems[index], STAGES)

    threads = [threading.Thread(target=work, args=(index,)) for index in range(len(problems))]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    for index, solution in enumerate(expected):
        assert found[index].iterations == solution.iterations
        assert found[index].objective == solution.objective


@pytest.fixture
def wrong_structure(monkeypatch):
    """Announce one inequality row more than there is."""
    right = stages.structure
    monkeypatch.setattr(
        stages, "structure", lambda *given: replace(right(*given), inequalities=right(*given).inequalities + 1)
    )


@pytest.mark.usefixtures("wrong_structure")
def test_where_the_structure_is_another_mumps_takes_over_and_the_record_says_so(problem):
    solution, expected = mt.solve(problem, STAGES), mt.solve(problem, MUMPS)
    assert solution.status is mt.Status.OPTIMAL
    assert solution.objective == expected.objective
    record = solution.trajectory.solve_record()
    assert record["linear_solver"] == "mumps"
    assert "another size than was announced" in record["linear_solver_refused"]


@pytest.mark.usefixtures("wrong_structure")
def test_a_relaxation_falls_back_as_well(problem):
    relaxation = mt.relax(problem, solver=STAGES)
    assert relaxation.status is mt.Status.OPTIMAL
    assert not relaxation.gives_way


def test_a_relaxation_is_solved_by_stages(problem, monkeypatch):
    taken = []
    close = StageSolver.close
    monkeypatch.setattr(StageSolver, "close", lambda solver: (taken.append(solver.counts), close(solver)))
    assert mt.relax(problem, solver=STAGES).status is mt.Status.OPTIMAL
    assert taken[0].factorisations > 5
    assert not taken[0].poor_solves


def test_an_ipopt_that_cannot_load_it_goes_on_with_mumps(problem, monkeypatch):
    class Lost(mt.Ipopt):
        def options(self, *given):
            options = super().options(*given)
            return options | ({"hsllib": "/no/such.so"} if "hsllib" in options else {})

    monkeypatch.setattr(native.library(), "_name", "/no/such.so")
    solution = mt.solve(problem, Lost())
    assert solution.status is mt.Status.OPTIMAL
    assert "did not take the native library" in solution.trajectory.solve_record()["linear_solver_refused"]


def test_auto_takes_stages_and_without_the_library_what_was_taken_before(monkeypatch):
    assert linear_solvers.choose().name == "stages"
    monkeypatch.setattr(native, "library", lambda: None)
    monkeypatch.setattr(native, "missing", lambda: "there is no native library")
    monkeypatch.setattr(linear_solvers, "_hsl_libraries", lambda: iter(()))
    assert linear_solvers.choose().name == "mumps"
    with pytest.raises(SolverError, match="'stages' cannot be used: there is no native library; 'mumps' needs nothing"):
        linear_solvers.choose("stages")


def test_the_papers_terms_are_not_named_in_the_library():
    """What is eliminated with what comes from the entries; names would tie it to one set of terms."""
    from multimodal_to.native.compiling import SOURCES

    text = "".join(file.read_text(encoding="utf-8") for file in SOURCES.glob("kkt*"))
    assert not [term.name for term in paper.CONSTRAINTS if term.name in text]

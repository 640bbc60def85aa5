"""Nothing lost: the best iterate of a solve that is stopped, fails or is killed, and going on from it."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
import time
from dataclasses import replace

import casadi as cs
import numpy as np
import pytest

import kill
import multimodal_to as mt
from multimodal_to.errors import SolverError
from multimodal_to.scenarios import files as scenario_files
from multimodal_to.solving import best, ipopt
from multimodal_to.solving.best import FEASIBLE, Best, Checkpoint
from multimodal_to.solving.ipopt import Pass
from multimodal_to.solving.solver import StartPoint
from multimodal_to.trajectory import QUANTITIES

_JUMP = mt.scenarios.paper("jump")
SCENARIO = replace(
    _JUMP,
    name="stand",
    knots=10,
    mid_height_min=None,
    final_com=(0.0, 0.0, 0.55),
    interval_min=0.1,
    interval_max=0.1,
    weights=replace(_JUMP.weights, final_posture=1e5),
)
"""A short problem without jets, so that its answers come fast: the CoM goes down by 2 cm.

The end's posture has the paper's own weight: the first pass, of few iterations, finds a feasible iterate already.
"""


@pytest.fixture(scope="module")
def problem(ironcub):
    return mt.build(ironcub, SCENARIO, mt.Formulation.paper())


@pytest.fixture
def shown(monkeypatch):
    """Every iterate that a solve shows: x, objective, iteration."""
    iterates = []
    original = Best.show

    def show(self, x, rows, objective, iteration, label):
        iterates.append((x, objective, iteration))
        original(self, x, rows, objective, iteration, label)

    monkeypatch.setattr(Best, "show", show)
    return iterates


def variables(problem, trajectory):
    """Return x of a trajectory as it is, which an iterate on the way may have a little outside its bounds."""
    values = np.vstack([getattr(trajectory, name) for name in problem.layout.rows])
    return np.append(values.ravel(order="F"), trajectory.duration / trajectory.knots) / problem.scale


def expected(problem, iterates):
    """Return the best iterate, judged from x alone."""
    violation = [problem.scaled_violation(x, problem.rows_at(x)) for x, _, _ in iterates]
    feasible = [index for index, value in enumerate(violation) if value <= FEASIBLE]
    if feasible:
        return min(feasible, key=lambda index: iterates[index][1]), True
    return int(np.argmin(violation)), False


@pytest.mark.parametrize("limit", [12, 38])
def test_a_solve_cut_short_ends_with_the_best_of_all_its_iterates(problem, shown, limit):
    cut = mt.solve(problem, mt.Ipopt(max_iterations=limit))
    index, feasible = expected(problem, shown)
    assert cut.status is mt.Status.ITERATION_LIMIT
    assert (cut.iteration, cut.feasible) == (shown[index][2], feasible)
    assert feasible == (limit == 38)
    assert np.allclose(problem.start_from(cut.trajectory), shown[index][0], atol=1e-7)
    record = cut.trajectory.solve_record()
    assert (record["status"], record["feasible"]) == ("iteration limit", feasible)
    assert bool(cut.unmet) == (not feasible)


def test_a_time_limit_ends_with_an_iterate_and_its_status(problem):
    def wait(iterate):  # the quaternions of the first iterates are not of length one, as those of a trajectory are
        if iterate.iteration == 14:
            time.sleep(2.0)

    cut = mt.solve(problem, mt.Ipopt(time_limit=2.0), wait)
    assert cut.status is mt.Status.TIME_LIMIT
    assert cut.solve_time < 5.0
    assert cut.objective == pytest.approx(sum(problem.costs(variables(problem, cut.trajectory)).values()), rel=1e-6)


def test_feasible_beats_infeasible_then_the_objective_counts(problem):
    def kept(violation, objective):
        return best.Candidate(x=problem.guess, iteration=0, label="exact", objective=objective, violation=violation)

    assert kept(0.9 * FEASIBLE, 9.0).better_than(kept(2.0 * FEASIBLE, 1.0))
    assert kept(0.9 * FEASIBLE, 1.0).better_than(kept(0.0, 2.0))
    assert not kept(3.0 * FEASIBLE, 1.0).better_than(kept(2.0 * FEASIBLE, 9.0))
    assert not kept(np.nan, 1.0).finite


@pytest.fixture
def ctrl_c():
    """Python's own handling of Ctrl-C, which is ignored where the tests run in the background."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.mark.usefixtures("ctrl_c")
def test_ctrl_c_in_a_script_ends_the_solve_and_what_it_found_is_returned(problem):
    def press(iterate):
        if iterate.iteration == 25:
            os.kill(os.getpid(), signal.SIGINT)
        return False

    stopped = mt.solve(problem, progress=press)
    assert stopped.status is mt.Status.STOPPED
    assert stopped.iterations < 30
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


@pytest.mark.usefixtures("ctrl_c")
@pytest.mark.parametrize("delay", [0.2, 0.4, 0.7])
def test_ctrl_c_within_a_factorisation_ends_the_solve_with_its_best_iterate(ironcub, delay):
    """Most of this solve's time goes to factorisations, so that is where the signal comes."""
    big = mt.build(ironcub, replace(mt.scenarios.paper("take-off"), knots=280, interval_min=0.025, interval_max=0.025))
    timer = threading.Timer(delay, os.kill, (os.getpid(), signal.SIGINT))
    timer.start()
    try:
        stopped = mt.solve(big)
    finally:
        timer.join()
    assert stopped.status is mt.Status.STOPPED
    assert np.isfinite(stopped.objective)
    assert stopped.trajectory.knots == 280


@pytest.mark.parametrize("solver", ["auto", "mumps"])
def test_rows_that_are_no_number_beyond_the_guess_leave_an_iterate_that_is(ironcub, capfd, solver):
    def inside(knot, parameters):
        """√(1e-8 − |hω|²): a number at the start guess, where nothing turns, and hardly anywhere else."""
        return cs.sqrt(1e-8 - cs.sumsqr(knot.angular_momentum))

    term = mt.Constraint(value=inside, within=mt.at_least(0.0), unit="kg m²/s", holds=mt.Where.LATER_KNOTS)
    narrow = mt.build(ironcub, SCENARIO, mt.Formulation.paper().with_terms(term))
    ended = mt.solve(narrow, mt.Ipopt(linear_solver=solver, max_iterations=40))
    assert ended.status in (mt.Status.ITERATION_LIMIT, mt.Status.FAILED)
    assert np.isfinite(ended.objective)
    assert np.isfinite(narrow.rows_at(narrow.start_from(ended.trajectory))).all()
    assert capfd.readouterr() == ("", "")


def test_a_crash_in_the_middle_loses_nothing(problem, monkeypatch):
    run = ipopt._run

    def crash(problem, x, options, watcher):
        if watcher.which is Pass.EXACT:
            raise SolverError("the linear solver is gone")
        return run(problem, x, options, watcher)

    monkeypatch.setattr(ipopt, "_run", crash)
    crashed = mt.solve(problem)
    assert (crashed.status, crashed.solver_message) == (mt.Status.FAILED, "the linear solver is gone")
    assert 0 < crashed.iteration <= 20  # of the rough pass
    assert crashed.feasible


def test_an_error_in_ones_own_progress_is_raised_and_the_checkpoint_is_there(problem, tmp_path):
    def fail(iterate):
        if iterate.iteration == 40:
            raise ValueError("mine")
        return False

    with pytest.raises(ValueError, match="mine"):
        mt.solve(problem, progress=fail, checkpoint=tmp_path / "checkpoint.npz")
    assert mt.Trajectory.load(tmp_path / "checkpoint.npz").solve_record()["feasible"]


def test_a_checkpoint_is_a_trajectory_that_says_what_it_is_and_is_gone_on_from(problem, tmp_path):
    path, files = tmp_path / "checkpoint.npz", []

    def stop(iterate):
        files.append(path.exists())
        return files[-1]

    whole = mt.solve(problem)
    mt.solve(problem, progress=stop, checkpoint=path)
    assert files.count(True) == 1  # the first feasible iterate is written at once, before which there is none
    checkpoint = mt.Trajectory.load(path)
    record = checkpoint.solve_record()
    assert (record["kind"], record["status"], record["pass"], record["feasible"]) == (
        "checkpoint",
        "running",
        "rough",
        True,
    )
    assert 0 < record["iteration"] <= 20
    assert max(record["violations"].values()) < 1e-3
    assert checkpoint.scenario == "stand"
    assert mt.audit(problem.robot, checkpoint)["CoM consistency"].holds
    resumed = mt.solve(problem, start=checkpoint)
    assert resumed.status is mt.Status.OPTIMAL
    assert resumed.iterations < whole.iterations
    assert resumed.objective == pytest.approx(whole.objective, rel=1e-3)


def test_what_was_not_feasible_goes_on_in_the_pass_that_it_was_in(problem):
    def passes(record):
        return ipopt._passes(StartPoint(x=problem.guess, record=record))

    rough = mt.solve(problem, mt.Ipopt(max_iterations=6)).trajectory.solve_record()
    assert rough["pass"] == "rough"
    assert passes(rough) == (Pass.ROUGH, Pass.EXACT)
    assert passes(rough | {"pass": "exact"}) == (Pass.EXACT,)
    assert passes(rough | {"feasible": True}) == (Pass.WARM,)
    assert passes({}) == (Pass.WARM,)
    assert passes(None) == (Pass.ROUGH, Pass.EXACT)
    older = {"phase" if key == "pass" else key: value for key, value in rough.items()}
    assert passes(older) == (Pass.ROUGH, Pass.EXACT)


def test_a_solve_that_goes_on_ends_with_nothing_worse_than_it_started_from(problem):
    answer = mt.solve(problem)
    again = mt.solve(problem, mt.Ipopt(max_iterations=1), start=answer.trajectory)
    assert again.status is mt.Status.ITERATION_LIMIT
    assert again.feasible
    assert again.objective == pytest.approx(answer.objective, rel=1e-9)


def test_checkpoints_are_written_seldom_but_the_first_feasible_one_at_once(problem, tmp_path, monkeypatch):
    answer = mt.solve(problem)
    x, path = problem.start_from(answer.trajectory), tmp_path / "checkpoint.npz"
    clock = [0.0]
    monkeypatch.setattr(best.time, "perf_counter", lambda: clock[0])
    checkpoint = Checkpoint(path, {})

    def update(iteration, violation):
        kept = best.Candidate(x=x, iteration=iteration, label="exact", objective=1.0, violation=violation)
        checkpoint.update(problem, kept, iteration)
        return mt.Trajectory.load(path).solve_record()["iteration"] if path.exists() else None

    assert update(1, 1.0) is None  # not yet five seconds
    clock[0] = 5.1
    assert update(2, 0.9) == 2
    assert update(3, 0.8) == 2
    assert update(4, 0.0) == 4
    assert update(5, 0.0) == 4
    clock[0] = 10.3
    assert update(6, 0.0) == 6


def test_a_checkpoint_that_cannot_be_written_is_a_warning_and_the_solve_goes_on(problem, tmp_path):
    with pytest.warns(UserWarning, match="goes on without a checkpoint: cannot write") as warned:
        answer = mt.solve(problem, checkpoint=tmp_path / "missing" / "checkpoint.npz")
    assert answer.status is mt.Status.OPTIMAL
    assert len(warned) == 1


def test_the_same_inputs_give_the_same_bits_in_two_processes_whatever_threads_are_asked_for(tmp_path):
    scenario_files.save(SCENARIO, tmp_path / "stand.toml")
    for threads in ("1", "2"):
        subprocess.run(
            [
                sys.executable,
                "-c",
                f"""
import multimodal_to as mt
solution = mt.solve(mt.build(mt.load_robot("ironcub"), mt.scenario_files.load({str(tmp_path / "stand.toml")!r})))
solution.trajectory.save({str(tmp_path / threads)!r} + ".npz")
""",
            ],
            check=True,
            env={**os.environ, "OMP_NUM_THREADS": threads},
        )
    one, two = (mt.Trajectory.load(tmp_path / f"{threads}.npz") for threads in "12")
    assert all(np.array_equal(getattr(one, name), getattr(two, name)) for name in ("time", *QUANTITIES))
    assert [file.solve_record()["threads"]["OMP_NUM_THREADS"] for file in (one, two)] == ["1", "2"]


@pytest.fixture(scope="module")
def task(tmp_path_factory):
    """The same as a file, for processes."""
    return str(scenario_files.save(SCENARIO, tmp_path_factory.mktemp("task") / "stand.toml"))


def test_a_killed_process_leaves_a_checkpoint_that_is_resumed_beside_it(task, tmp_path, monkeypatch):
    with monkeypatch.context() as slowly:
        slowly.setenv("MULTIMODAL_TO_NATIVE", "0")  # else the solve may end before it is killed
        assert kill.killed(tmp_path, 0.0, task)
    resumed = subprocess.run(
        [sys.executable, "-m", "multimodal_to", "solve", "--resume", tmp_path / "checkpoint.npz"],
        capture_output=True,
        text=True,
        timeout=200,
        check=False,
    )
    assert (resumed.returncode, resumed.stderr) == (0, "")
    assert "optimal: nothing to do" in resumed.stdout
    assert sorted(path.name for path in tmp_path.iterdir()) == ["forces.png", "replay.html", "trajectory.npz"]


@pytest.mark.parametrize("twice", [False, True])
def test_ctrl_c_leaves_terminal_and_files_whole(task, tmp_path, twice):
    end = kill.interrupted(tmp_path, 0.1, task, twice=twice)
    assert end.sane
    assert end.cursor_shown
    assert "\x1b[?25l" in end.screen  # it was hidden
    if twice:
        assert end.status == -signal.SIGINT
        assert end.waited < kill.AT_ONCE
    else:
        assert end.status == 1
        assert [path.name for path in tmp_path.iterdir()] == ["trajectory.npz"]
        assert mt.Trajectory.load(tmp_path / "trajectory.npz").solve_record()["status"] == "stopped"


@pytest.mark.parametrize(("violation", "status"), [(1e-6, mt.Status.ACCEPTABLE), (1e8, mt.Status.FAILED)])
def test_acceptable_is_never_called_optimal_nor_anything_that_misses_rows_acceptable(
    problem, monkeypatch, violation, status
):
    """The solver is made to stop where it finds itself acceptable, long before the optimality conditions hold."""
    loose = dict.fromkeys(("acceptable_tol", "acceptable_dual_inf_tol", "acceptable_compl_inf_tol"), 1e8)
    loose |= {"acceptable_iter": 1, "acceptable_obj_change_tol": 1e20, "acceptable_constr_viol_tol": violation}
    options = mt.Ipopt.options
    monkeypatch.setattr(mt.Ipopt, "options", lambda *arguments: options(*arguments) | loose)
    ended = mt.solve(problem)
    assert ended.solver_message == "Solved_To_Acceptable_Level"
    assert ended.status is status
    assert ended.trajectory.solve_record()["status"] == status.value


def test_only_one_word_of_the_solver_means_optimal():
    words = (
        "Solve_Succeeded",
        "Solved_To_Acceptable_Level",
        "Infeasible_Problem_Detected",
        "Search_Direction_Becomes_Too_Small",
        "Diverging_Iterates",
        "User_Requested_Stop",
        "Feasible_Point_Found",
        "Maximum_Iterations_Exceeded",
        "Restoration_Failed",
        "Error_In_Step_Computation",
        "Maximum_CpuTime_Exceeded",
        "Maximum_WallTime_Exceeded",
        "Not_Enough_Degrees_Of_Freedom",
        "Invalid_Problem_Definition",
        "Invalid_Option",
        "Invalid_Number_Detected",
        "Unrecoverable_Exception",
        "NonIpopt_Exception_Thrown",
        "Insufficient_Memory",
        "Internal_Error",
        "",
    )
    assert [word for word in words if mt.Ipopt.status(word) is mt.Status.OPTIMAL] == ["Solve_Succeeded"]
    assert [word for word in words if mt.Ipopt.status(word).solved] == [
        "Solve_Succeeded",
        "Solved_To_Acceptable_Level",
        "Feasible_Point_Found",
    ]

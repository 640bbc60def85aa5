"""Linear solvers of IPOPT are found without a risk to the process."""

from __future__ import annotations

import sys

import pytest

import multimodal_to as mt
from multimodal_to import native
from multimodal_to.errors import InputError, SolverError
from multimodal_to.solving import linear_solvers
from multimodal_to.solving.ipopt import Pass
from multimodal_to.solving.linear_solvers import LINEAR_SOLVERS, LinearSolver, choose

HERE = LinearSolver(name="mumps")


@pytest.fixture(autouse=True)
def _fresh(monkeypatch):
    """No library but those of the test, not even the native one, and no memory of trials."""
    monkeypatch.setattr(native, "library", lambda: None)
    monkeypatch.delenv(linear_solvers.HSL_VARIABLE, raising=False)
    monkeypatch.setattr(linear_solvers, "_hsl_libraries", lambda: iter(()))
    linear_solvers._trial.cache_clear()
    yield
    linear_solvers._trial.cache_clear()


@pytest.fixture
def library(tmp_path):
    path = tmp_path / "libhsl.so"
    path.write_bytes(b"no library")
    return str(path)


def children(monkeypatch, codes):
    """Let a trial run a piece of Python by the name of its solver; return the names tried."""
    tried = []

    def command(name, library):
        tried.append(name)
        return [sys.executable, "-c", codes[name]]

    monkeypatch.setattr(linear_solvers, "_command", command)
    return tried


def forbid_children(monkeypatch):
    def command(name, library):
        raise AssertionError(f"tried {name}")

    monkeypatch.setattr(linear_solvers, "_command", command)


CRASH, WORKS, FAILS = "import os; os.kill(os.getpid(), 11)", "", "raise SystemExit(1)"


def test_auto_is_mumps_and_starts_no_child_where_there_is_no_hsl(monkeypatch):
    forbid_children(monkeypatch)
    assert choose() == choose("mumps") == HERE
    assert HERE.options()["linear_solver"] == "mumps"


def test_a_trial_that_crashes_is_survived_and_said(monkeypatch):
    children(monkeypatch, {"ma97": CRASH})
    with pytest.raises(SolverError, match=r"'ma97' cannot be used, a trial of it crashed with signal 11; .*coin-hsl"):
        choose("ma97")


def test_a_trial_that_hangs_ends(monkeypatch):
    children(monkeypatch, {"spral": "import time; time.sleep(60)"})
    monkeypatch.setattr(linear_solvers, "_PATIENCE", 0.2)
    with pytest.raises(SolverError, match=r"'spral' cannot be used, a trial of it did not end within 0.2 s; .*OMP_CAN"):
        choose("spral")


def test_a_trial_that_cannot_start_is_an_error(monkeypatch):
    monkeypatch.setattr(linear_solvers, "_command", lambda name, library: ["/no/such/python"])
    with pytest.raises(SolverError, match="a trial of it did not start"):
        choose("pardiso")


def test_auto_takes_the_first_hsl_solver_that_works_and_remembers(monkeypatch, library):
    monkeypatch.setattr(linear_solvers, "_hsl_libraries", lambda: iter((library,)))
    tried = children(monkeypatch, {"ma57": CRASH, "ma97": FAILS, "ma86": WORKS})
    assert choose() == choose() == LinearSolver(name="ma86", library=library)
    assert choose().options() == {"linear_solver": "ma86", "hsllib": library}
    assert tried == ["ma57", "ma97", "ma86"]


def test_auto_falls_back_on_mumps_where_the_library_is_broken(library):
    assert choose("auto", library) == HERE  # with the real trials
    with pytest.raises(SolverError, match=r"the HSL library '.*libhsl.so' seems to lack it or to be broken"):
        choose("ma27", library)


def test_the_environment_names_the_library(monkeypatch, library):
    children(monkeypatch, {"ma57": WORKS})
    monkeypatch.setenv(linear_solvers.HSL_VARIABLE, library)
    assert choose() == LinearSolver(name="ma57", library=library)
    monkeypatch.setenv(linear_solvers.HSL_VARIABLE, "/no/such/libhsl.so")
    with pytest.raises(InputError, match=r"the HSL library '/no/such/libhsl.so' is no file"):
        choose()
    assert choose("mumps") == HERE


def test_a_library_in_a_folder_of_the_linker_is_found(monkeypatch, library):
    monkeypatch.undo()
    monkeypatch.setenv("LD_LIBRARY_PATH", f"/no/such/folder:{library.rpartition('/')[0]}")
    assert next(linear_solvers._hsl_libraries()) == library


def test_the_trial_tells_what_works_from_what_is_missing():
    assert linear_solvers._trial("mumps", "") == ""
    assert linear_solvers._trial("ma27", "/no/such/libhsl.so") == "a trial of it failed"


@pytest.mark.parametrize(("name", "near"), [("mump", "mumps"), ("ma96", "ma"), ("atuo", "auto")])
def test_an_unknown_name_is_an_error_with_the_nearest_one(name, near):
    for attempt in (choose, lambda name: mt.Ipopt(linear_solver=name)):
        with pytest.raises(InputError, match=rf"unknown linear solver '{name}'; did you mean '{near}.*ma97, pardiso"):
            attempt(name)


def test_each_solver_that_is_missing_has_advice():
    for name in LINEAR_SOLVERS[2:]:
        assert linear_solvers._advice(name, "").endswith("'mumps' needs nothing")


def test_the_chosen_solver_and_its_library_reach_ipopt(monkeypatch, library):
    children(monkeypatch, {"ma57": WORKS})
    options = mt.Ipopt(linear_solver="ma57", hsl_library=library).options(10, 1.0, Pass.EXACT)
    assert (options["linear_solver"], options["hsllib"]) == ("ma57", library)
    with pytest.raises(InputError, match="is no file"):
        mt.Ipopt(hsl_library="/no/such/libhsl.so")

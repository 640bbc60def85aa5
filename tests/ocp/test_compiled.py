"""Functions that are compiled once and found again by every problem like theirs."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from typer.testing import CliRunner

import multimodal_to as mt
from multimodal_to.cli import app
from multimodal_to.errors import OutputError, SolverError
from multimodal_to.ocp import compiled
from multimodal_to.ocp.outline import formulate, prepared

needs_compiler = pytest.mark.skipif(compiled._compiler() is None, reason="there is no C compiler")


@pytest.fixture(scope="module")
def hop() -> mt.Scenario:
    return replace(mt.scenarios.jump(), knots=4)


@pytest.fixture(scope="module")
def plain(ironcub, hop, empty_cache) -> mt.Problem:
    return mt.build(ironcub, hop)


@pytest.fixture(scope="module")
def empty_cache(tmp_path_factory):
    folder = tmp_path_factory.mktemp("cache")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv(compiled.CACHE_VARIABLE, str(folder))
        yield folder


@pytest.fixture(scope="module")
def files(ironcub, hop, empty_cache, plain):
    """Compile without optimisation, a third of the time."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(compiled, "_FLAGS", ("-O0", "-shared", "-fPIC"))
        yield mt.precompile(ironcub, hop)


@needs_compiler
def test_compiled_functions_are_found_and_say_the_same(ironcub, hop, plain, files):
    fast = mt.build(ironcub, hop)
    assert fast.nlp.compiled
    assert not plain.nlp.compiled
    random = np.random.default_rng(0)
    x = plain.guess + 0.01 * random.normal(size=plain.guess.size)
    lam = random.normal(size=plain.row_lower.size)
    for ours, theirs, arguments in (
        (fast.nlp.jacobian, plain.nlp.jacobian, (x, [])),
        (fast.nlp.gradient, plain.nlp.gradient, (x, [])),
        (fast.nlp.hessian, plain.nlp.hessian, (x, [], 1.0, lam)),
    ):
        found, expected = (_last(each(*arguments)) for each in (ours, theirs))
        assert np.allclose(found, expected, rtol=0.0, atol=1e-9 * np.abs(expected).max()), ours


def _last(outputs) -> np.ndarray:
    return np.array((outputs if isinstance(outputs, tuple) else (outputs,))[-1])


@needs_compiler
def test_a_solve_says_whether_its_functions_were_compiled_and_ends_alike(ironcub, hop, plain, files):
    few = mt.Ipopt(max_iterations=5)
    slow, fast = mt.solve(plain, few), mt.solve(mt.build(ironcub, hop), few)
    assert fast.trajectory.solve_record()["compiled"]
    assert not slow.trajectory.solve_record()["compiled"]
    assert fast.objective == pytest.approx(slow.objective, rel=1e-6)


@needs_compiler
def test_a_target_and_the_grid_may_change_but_not_a_weight(ironcub, hop, files):
    higher = replace(hop, mid_height_min=0.8, final_com=(0.0, 0.0, 0.57), knots=6)
    assert mt.build(ironcub, higher).nlp.compiled
    assert not mt.build(ironcub, replace(hop, weights=replace(hop.weights, contact_force_rates=7.0))).nlp.compiled


@needs_compiler
def test_what_is_compiled_is_not_compiled_again(ironcub, hop, files, monkeypatch):
    monkeypatch.setattr(compiled.subprocess, "run", None)  # a call would raise
    assert mt.precompile(ironcub, hop) == files


def test_the_folder_is_in_the_users_cache_unless_named(monkeypatch):
    monkeypatch.delenv(compiled.CACHE_VARIABLE, raising=False)
    assert compiled.folder().parts[-2:] == ("multimodal-to", "compiled") or "Cache" in str(compiled.folder())


@needs_compiler
def test_a_broken_file_is_not_used(ironcub, hop, files, tmp_path, monkeypatch):
    monkeypatch.setenv(compiled.CACHE_VARIABLE, str(tmp_path))
    compiled.folder().mkdir()
    for path in files:
        (compiled.folder() / path.name).write_bytes(b"no library")
    assert not mt.build(ironcub, hop).nlp.compiled


def test_without_a_compiler_there_is_an_error_and_problems_are_built_all_the_same(ironcub, hop, monkeypatch):
    monkeypatch.setattr(compiled, "_compiler", lambda: None)
    with pytest.raises(SolverError, match="no C compiler; install gcc or clang"):
        mt.precompile(ironcub, hop)
    assert not mt.build(ironcub, hop).nlp.compiled


def test_a_compiler_that_refuses_is_quoted(ironcub, hop, tmp_path, monkeypatch):
    refuser = tmp_path / "cc"
    refuser.write_text("#!/bin/sh\necho out of paper >&2\nexit 1\n")
    refuser.chmod(0o755)
    monkeypatch.setenv(compiled.CACHE_VARIABLE, str(tmp_path))
    monkeypatch.setattr(compiled, "_compiler", lambda: (str(refuser), "1"))
    with pytest.raises(SolverError, match=r"refuses the code of every_\w+: out of paper"):
        mt.precompile(ironcub, hop)
    assert not list(compiled.folder().iterdir())


def test_a_cache_that_cannot_be_written_is_named(ironcub, hop, tmp_path, monkeypatch):
    (tmp_path / "file").touch()
    monkeypatch.setenv(compiled.CACHE_VARIABLE, str(tmp_path / "file"))
    monkeypatch.setattr(compiled, "_compiler", lambda: ("cc", "1"))
    with pytest.raises(OutputError, match="cannot write to the folder"):
        mt.precompile(ironcub, hop)


@needs_compiler
def test_the_command_says_where_they_are_kept(files, empty_cache):
    ended = CliRunner().invoke(app, ["precompile", "jump"])
    assert ended.exit_code == 0
    assert f"jump: {len(files)} functions compiled in" in ended.output
    assert f"kept in {empty_cache}" in ended.output


@needs_compiler
def test_derivatives_of_own_terms_are_compiled_too(ironcub, hop, files, monkeypatch):
    """A cost of one's own is part of the functions: they are other ones, and found when they have been compiled."""

    def slow_turns(knot, parameters):
        return knot.base_angular_velocity

    own = mt.Formulation.executable().with_terms(mt.Cost(residual=slow_turns, weight=1e2, unit="rad/s"))
    assert not set(map(str, _costly(ironcub, hop, own))) & set(map(str, files))
    monkeypatch.setattr(compiled, "_FLAGS", ("-O0", "-shared", "-fPIC"))
    assert not mt.build(ironcub, hop, own).nlp.compiled
    mt.precompile(ironcub, hop, own)
    assert mt.build(ironcub, hop, own).nlp.compiled


def _costly(robot, scenario, formulation):
    """The files in which the functions that see the costs' curvature would be kept."""
    robot, standing = prepared(robot, scenario)
    stages = formulate(robot, scenario, standing, formulation).stages
    every = next(named.stage for named in stages if named.stage.repeats > 1)
    return [compiled._path(every.hessian()[0])]

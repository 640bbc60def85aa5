"""What an answer depends on beside its inputs."""

from __future__ import annotations

from multimodal_to import machine


def test_one_thread_is_used_within_and_as_many_as_before_after():
    before = machine.threads()["blas"]
    assert before is not None  # the tests run on CasADi's wheel
    with machine.one_blas_thread():
        assert machine.threads()["blas"] == 1
    assert machine.threads()["blas"] == before


def test_a_casadi_without_its_own_blas_is_said_to_be_unknown(monkeypatch):
    monkeypatch.setattr(machine, "_blas", lambda: None)
    with machine.one_blas_thread():
        assert machine.threads()["blas"] is None


def test_what_the_environment_asks_for_is_recorded(monkeypatch):
    monkeypatch.setenv("MKL_NUM_THREADS", "3")
    assert machine.threads()["MKL_NUM_THREADS"] == "3"

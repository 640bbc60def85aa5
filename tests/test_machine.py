"""What an answer depends on beside its inputs."""

from __future__ import annotations

import numpy as np
import pytest

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


@pytest.mark.skipif(machine._glibc() is None, reason="the C library is not glibc")
def test_a_large_block_that_is_taken_again_costs_no_new_pages_while_memory_is_kept():
    import resource

    def faults_of_a_second_block():
        def take():
            np.empty(8_000_000).fill(1.0)  # 64 MB, more than glibc keeps by itself

        take()
        before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
        take()
        return resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before

    outside = faults_of_a_second_block()
    with machine.memory_kept():
        assert faults_of_a_second_block() < 0.1 * outside
    assert faults_of_a_second_block() > 0.5 * outside


def test_without_glibc_nothing_happens(monkeypatch):
    monkeypatch.setattr(machine, "_glibc", lambda: None)
    with machine.memory_kept():
        pass

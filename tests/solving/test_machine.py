"""What an answer depends on beside its inputs."""

from __future__ import annotations

import subprocess
import sys

import pytest

from multimodal_to.solving import machine


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
    """In a process of its own, whose heap is small: more than glibc keeps by itself is taken and freed, twice."""
    ended = subprocess.run([sys.executable, "-c", TWICE], capture_output=True, text=True, check=True)
    outside, inside, after = map(int, ended.stdout.split())
    assert inside < 0.1 * outside
    assert after > 0.5 * outside


TWICE = """
import ctypes, resource
from multimodal_to.solving import machine

library = ctypes.CDLL(None)
library.malloc.restype, library.free.argtypes = ctypes.c_void_p, [ctypes.c_void_p]

def take(size=64_000_000):
    block = library.malloc(ctypes.c_size_t(size))
    ctypes.memset(block, 1, size)
    library.free(block)

def faults_of_the_second():
    take()
    before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
    take()
    return resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before

print(faults_of_the_second())
with machine.memory_kept():
    print(faults_of_the_second())
print(faults_of_the_second())
"""


def test_without_glibc_nothing_happens(monkeypatch):
    monkeypatch.setattr(machine, "_glibc", lambda: None)
    with machine.memory_kept():
        pass

"""The pool of threads: loops are complete whoever calls, from wherever, how often, and after a fork."""

from __future__ import annotations

import ctypes
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor

import pytest

PATIENCE = ctypes.c_double(20.0)  # [s]; passed only by a failure
SHORT = ctypes.c_double(0.05)  # [s]


@pytest.fixture
def pool(tested, opened_anew) -> ctypes.CDLL:
    opened = opened_anew(tested)
    opened.mt_test_nested.restype = ctypes.c_long
    return opened


@pytest.mark.parametrize("threads", [1, 2, 3, 8])
@pytest.mark.parametrize("count", [0, 1, 2, 7, 1000])
def test_every_turn_of_a_loop_runs_once(pool, threads, count):
    pool.mt_set_threads(threads)
    assert pool.mt_test_wrong_sums(50, count) == 0


def test_a_pool_has_one_thread_until_more_are_asked_for(pool):
    assert pool.mt_threads() == 1
    pool.mt_set_threads(-3)
    assert pool.mt_threads() == 1


@pytest.mark.parametrize("threads", [2, 3, 5])
def test_so_many_turns_run_at_once_as_there_are_threads(pool, threads):
    pool.mt_set_threads(threads)
    assert pool.mt_test_all_at_once(threads, PATIENCE)


def test_no_more_turns_run_at_once_than_there_are_threads(pool):
    for threads in (4, 2, 1):  # workers that are too many leave
        pool.mt_set_threads(threads)
        assert pool.mt_test_all_at_once(threads, PATIENCE)
        assert not pool.mt_test_all_at_once(threads + 1, SHORT)


def test_a_loop_within_a_loop_is_complete(pool):
    pool.mt_set_threads(3)
    assert pool.mt_test_nested(20, 30) == 20 * sum(i * i for i in range(30))


def test_threads_that_call_at_once_get_complete_loops(pool):
    pool.mt_set_threads(3)
    with ThreadPoolExecutor(6) as callers:
        assert list(callers.map(lambda count: pool.mt_test_wrong_sums(500, count), range(5, 45))) == [0] * 40


def test_the_number_of_threads_may_change_while_loops_run(pool):
    with ThreadPoolExecutor(2) as callers:
        running = callers.submit(pool.mt_test_wrong_sums, 5000, 40)
        while not running.done():
            for threads in (1, 4, 2):
                pool.mt_set_threads(threads)
        assert running.result() == 0


FORKS = """
import ctypes, os, sys, threading
pool = ctypes.CDLL(sys.argv[1])
pool.mt_set_threads(3)
assert pool.mt_test_all_at_once(3, ctypes.c_double(20.0))  # there are workers
stop = threading.Event()
def go_on():
    while not stop.is_set():
        assert pool.mt_test_wrong_sums(20, 40) == 0
if sys.argv[2] == "busy":
    threading.Thread(target=go_on).start()
for _ in range(20):
    child = os.fork()
    if child == 0:
        works = pool.mt_test_all_at_once(3, ctypes.c_double(20.0)) and pool.mt_test_wrong_sums(20, 40) == 0
        os._exit(0 if works else 1)
    _, status = os.waitpid(child, 0)
    if status or pool.mt_test_wrong_sums(20, 40):
        stop.set()
        sys.exit(1)
stop.set()
"""


@pytest.mark.skipif(sys.platform == "win32", reason="this system has no fork")
@pytest.mark.parametrize("other_thread", ["idle", "busy"])
def test_a_forked_process_has_a_pool_that_works(tested, other_thread):
    command = [sys.executable, "-W", "ignore", "-c", FORKS, str(tested), other_thread]
    assert subprocess.run(command, timeout=60, check=False).returncode == 0


def test_a_process_ends_while_its_workers_wait(tested):
    code = "import ctypes, sys; pool = ctypes.CDLL(sys.argv[1]); pool.mt_set_threads(4); pool.mt_test_wrong_sums(9, 9)"
    assert subprocess.run([sys.executable, "-c", code, str(tested)], timeout=20, check=False).returncode == 0

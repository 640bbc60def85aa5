"""What runs plans side by side: processes of this machine, or a Ray cluster. Both run `plan.perform`."""

from __future__ import annotations

import json
import os
import queue
import subprocess
import sys
import tempfile
import threading
import time
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any, Protocol

from multimodal_to.errors import InputError, OutputError
from multimodal_to.sweeping.plan import CRASHED, TIMED_OUT, Order, perform
from multimodal_to.sweeping.worker import READY

GRACE = 60.0
"""A plan may take so much longer than its time limit, to be built and audited, before its process is killed [s]."""
_THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
_HERE = str(Path(__file__).resolve().parents[2])  # the package may have been found in any way
_STILLBORN = 20  # so many processes may die while none becomes ready
_LAST_WORDS = 400  # characters of what a process wrote before it died


@dataclass(frozen=True, kw_only=True)
class Ended:
    """A plan that a worker has done with."""

    order: Order
    row: dict[str, Any] | None = None  # None: its process died, or took too long
    problem: str = ""  # `CRASHED` or `TIMED_OUT`, where there is no row
    message: str = ""
    lost: bool = False  # the worker died, and another one may have better luck


class Engine(Protocol):
    """Runs orders, at most so many at once as it has slots."""

    @property
    def slots(self) -> int:
        """Return how many orders it takes at once."""
        ...

    def submit(self, order: Order) -> None:
        """Begin with an order."""
        ...

    def wait(self) -> list[Ended]:
        """Return what has ended; wait until something has.

        Raises:
            OutputError: a plan or a row cannot be written.
        """
        ...

    def close(self) -> None:
        """End all that runs."""
        ...


class _Worker:
    """A process of `sweeping.worker`, and the order that it works on."""

    def __init__(self, number: int, answers: queue.Queue[tuple[int, dict[str, Any] | None]]) -> None:
        self.number = number
        self.order: Order | None = None
        self.deadline = float("inf")
        self.errors: IO[bytes] = tempfile.TemporaryFile()  # noqa: SIM115
        self.process = subprocess.Popen(
            [sys.executable, "-m", "multimodal_to.sweeping.worker"],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=self.errors,
            start_new_session=True,  # Ctrl-C of a terminal is for the driver; a solve would take it for a wish to stop
            text=True,
            encoding="utf-8",
            env={
                **dict.fromkeys(_THREADS, "1"),
                **os.environ,
                "PYTHONPATH": os.pathsep.join(filter(None, (_HERE, os.environ.get("PYTHONPATH")))),
            },
        )
        threading.Thread(target=self._listen, args=(answers,), daemon=True).start()

    def _listen(self, answers: queue.Queue[tuple[int, dict[str, Any] | None]]) -> None:
        assert self.process.stdout is not None
        for line in self.process.stdout:
            answers.put((self.number, json.loads(line)))
        answers.put((self.number, None))

    def begin(self, order: Order) -> bool:
        """Hand an order over; return whether the process is there to take it."""
        assert self.process.stdin is not None
        try:
            self.process.stdin.write(json.dumps(order.plain()) + "\n")
            self.process.stdin.flush()
        except OSError:
            return False
        self.order, self.deadline = order, time.monotonic() + order.time_limit + GRACE
        return True

    def last_words(self) -> str:
        """Return the end of what the process wrote."""
        self.errors.seek(0)
        return self.errors.read()[-_LAST_WORDS:].decode("utf-8", "replace").strip()

    def end(self) -> None:
        """Kill the process and wait until it is gone."""
        self.process.kill()
        self.process.wait()
        for stream in (self.process.stdin, self.process.stdout, self.errors):
            if stream is not None:
                try:
                    stream.close()
                except OSError:  # an order that was never taken
                    continue


class Processes:
    """Workers on this machine, each a process of its own; one that dies or hangs is replaced.

    Args:
        workers: how many.
    """

    def __init__(self, workers: int) -> None:
        if workers < 1:
            raise InputError(f"there are {workers} workers; expected one or more")
        self._workers: dict[int, _Worker] = {}
        self._answers: queue.Queue[tuple[int, dict[str, Any] | None]] = queue.Queue()
        self._slots, self._started = workers, 0
        self._stillborn = 0  # processes that died since one was ready

    @property
    def slots(self) -> int:
        """Return how many orders it takes at once."""
        return self._slots

    def submit(self, order: Order) -> None:
        """Begin with an order."""
        while True:
            idle = next((worker for worker in self._workers.values() if worker.order is None), None)
            worker = idle or self._start()
            if worker.begin(order):
                return
            self._drop(worker)

    def wait(self) -> list[Ended]:
        """Return what has ended; wait until something has.

        Raises:
            OutputError: a plan or a row cannot be written.
        """
        while True:
            soonest = min((worker.deadline for worker in self._workers.values()), default=float("inf"))
            try:
                number, answer = self._answers.get(timeout=min(max(soonest - time.monotonic(), 0.0), 1.0))
            except queue.Empty:
                if late := self._late():
                    return late
                continue
            worker = self._workers.get(number)
            if answer is not None and READY in answer:
                self._stillborn = 0
            elif worker is not None and (ended := self._ended(worker, answer)) is not None:
                return [ended]

    def close(self) -> None:
        """End all that runs."""
        for worker in tuple(self._workers.values()):
            self._drop(worker)

    def _start(self) -> _Worker:
        self._started += 1
        worker = self._workers[self._started] = _Worker(self._started, self._answers)
        return worker

    def _drop(self, worker: _Worker) -> None:
        worker.end()
        self._workers.pop(worker.number, None)

    def _ended(self, worker: _Worker, answer: dict[str, Any] | None) -> Ended | None:
        order, worker.order, worker.deadline = worker.order, None, float("inf")
        if answer is None:  # the process is gone
            status, words = worker.process.wait(), worker.last_words()
            self._drop(worker)
            self._stillborn += 1
            if self._stillborn > _STILLBORN:
                raise OutputError(f"processes for plans end before they begin: {words}")
            if order is None:
                return None
            message = f"its process ended with status {status}{': ' if words else ''}{words}"
            return Ended(order=order, problem=CRASHED, message=message, lost=True)
        if "unwritten" in answer:
            raise OutputError(str(answer["unwritten"]))
        assert order is not None
        return Ended(order=order, row=answer["row"])

    def _late(self) -> list[Ended]:
        found = []
        for worker in tuple(self._workers.values()):
            if time.monotonic() > worker.deadline and worker.order is not None:
                limit = worker.order.time_limit + GRACE
                message = f"its process was killed after {limit:g} s"
                found.append(Ended(order=worker.order, problem=TIMED_OUT, message=message))
                self._drop(worker)
        return found


class Ray:
    """Workers of a Ray cluster, with Ray's own scheduling and retries; all nodes see the sweep's folder.

    Args:
        address: of the cluster, as `ray.init` takes it; empty starts one on this machine.
        workers: at most so many plans at once; 0: as many as the cluster has processors.
    """

    def __init__(self, address: str, workers: int) -> None:
        try:
            import ray
        except ImportError as error:
            raise OutputError("the engine 'ray' needs Ray: pip install 'multimodal-to[ray]'") from error
        self._ray = ray
        if not ray.is_initialized():
            ray.init(address=address or None, log_to_driver=False, include_dashboard=False)
        self._perform = ray.remote(num_cpus=1, max_retries=3)(perform)
        self._slots = workers or max(int(ray.cluster_resources().get("CPU", 1)), 1)
        self._orders: dict[Any, tuple[Order, float]] = {}

    @property
    def slots(self) -> int:
        """Return how many orders it takes at once."""
        return self._slots

    def submit(self, order: Order) -> None:
        """Begin with an order."""
        self._orders[self._perform.remote(order)] = (order, time.monotonic() + 4.0 * (order.time_limit + GRACE))

    def wait(self) -> list[Ended]:
        """Return what has ended; wait until something has.

        Raises:
            OutputError: a plan or a row cannot be written.
        """
        while True:
            done, _ = self._ray.wait(list(self._orders), num_returns=1, timeout=1.0)
            if done:
                return [self._ended(reference) for reference in done]
            late = [reference for reference, (_, deadline) in self._orders.items() if time.monotonic() > deadline]
            if late:
                return [self._cancelled(reference) for reference in late]

    def close(self) -> None:
        """End all that runs."""
        for reference in self._orders:
            self._ray.cancel(reference, force=True)
        self._orders.clear()

    def _ended(self, reference: Any) -> Ended:
        order, _ = self._orders.pop(reference)
        try:
            return Ended(order=order, row=self._ray.get(reference))
        except self._ray.exceptions.RayTaskError as error:
            if isinstance(error.cause, OutputError):
                raise OutputError(str(error.cause)) from error
            return Ended(order=order, problem=CRASHED, message=str(error.cause))
        except self._ray.exceptions.RayError as error:  # after Ray's own retries
            return Ended(order=order, problem=CRASHED, message=str(error).splitlines()[0])

    def _cancelled(self, reference: Any) -> Ended:
        order, _ = self._orders.pop(reference)
        self._ray.cancel(reference, force=True)
        return Ended(order=order, problem=TIMED_OUT, message=f"cancelled after {4.0 * (order.time_limit + GRACE):g} s")

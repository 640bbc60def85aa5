"""`sweep`: make all plans that a sweep asks for, go on with what is left, and write the table."""

from __future__ import annotations

import heapq
import os
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from multimodal_to.arguments import checked
from multimodal_to.errors import InputError, unknown
from multimodal_to.simulation.model import mujoco_module
from multimodal_to.sweeping.design import Design, Row, read_design
from multimodal_to.sweeping.engines import Ended, Engine, Processes, Ray
from multimodal_to.sweeping.folder import Folder
from multimodal_to.sweeping.ordering import origins
from multimodal_to.sweeping.plan import Order, facts, row_of

ENGINES = ("processes", "ray")
"""What can run the plans."""
TIME_LIMIT = 600.0
"""Of a solve, where none is asked for [s]."""
ATTEMPTS = 3
"""A plan whose worker dies is tried so often; then its row says that it crashed."""


@dataclass(frozen=True, kw_only=True)
class Counts:
    """How far a sweep is."""

    total: int
    done: int  # with a row
    failed: int  # of these, without an answer, or with one that the audit does not pass
    made: int = 0  # in this run
    elapsed: float = 0.0  # of this run [s]

    @property
    def rate(self) -> float:
        """Return the plans made a second, in this run [1/s]."""
        return self.made / self.elapsed if self.elapsed > 0.0 else 0.0

    @property
    def left(self) -> float:
        """Return the time that the rest will take at this rate [s]; infinite before the first plan."""
        return (self.total - self.done) / self.rate if self.rate > 0.0 else float("inf")


@checked
def sweep(
    design: Design | str | os.PathLike[str],
    folder: str | os.PathLike[str],
    *,
    workers: int | None = None,
    engine: str = "processes",
    address: str = "",
    time_limit: float = TIME_LIMIT,
    simulate: bool = False,
    warm: bool = True,
    progress: Callable[[Counts], object] | None = None,
) -> Counts:
    """Make all plans of a sweep that are not done yet, and write the table of all.

    A plan is done when its trajectory and its row are in the folder, whole. So the sweep may end in any way, and the
    same call goes on. A plan that is refused, crashes or takes too long is a row that says so. The rows do not depend
    on the engine, nor on the number of workers.

    With `warm`, a plan starts from the answer of the plan whose inputs are nearest to its own, in an order that the
    inputs fix; where that one has no answer, from that which it started from.

    Args:
        design: the sweep, or its TOML file.
        folder: where all goes; made if missing, and gone on from if not.
        workers: how many plans at once; by default as many as there are processors, or as Ray has.
        engine: one of `ENGINES`.
        address: of a Ray cluster, as `ray.init` takes it; empty starts one on this machine.
        time_limit: of each solve [s]; its process is killed `engines.GRACE` later.
        simulate: play each answer back in MuJoCo.
        warm: start plans from the answers of their neighbours.
        progress: told how far it is, at the beginning and after every plan.

    Raises:
        InputError: the sweep is none, the folder holds another one, or there is no such engine.
        ScenarioError: a key is none of the scenario's, or a value is not what its key takes.
        OutputError: the folder cannot be written, another process works on it, or Ray or MuJoCo is not installed.
    """
    if engine not in ENGINES:
        raise InputError(unknown("engine", engine, ENGINES))
    if not time_limit > 0.0:
        raise InputError(f"the time limit is {time_limit:g} s; expected a positive number")
    asked = design if isinstance(design, Design) else read_design(design)
    if simulate:
        mujoco_module()
    kept = Folder(path=Path(folder))
    kept.begin(asked, {"simulate": simulate, "warm": warm})
    with kept.held():
        run = _Run(asked, kept, time_limit=time_limit, simulate=simulate, warm=warm, progress=progress)
        if run.left:
            runs = Processes(workers or os.cpu_count() or 1) if engine == "processes" else Ray(address, workers or 0)
            try:
                run.through(runs)
            finally:
                runs.close()
                kept.write_tables(asked)
        else:
            kept.write_tables(asked)
        return run.counts()


def counted(folder: str | os.PathLike[str]) -> tuple[Design, Counts]:
    """Return the sweep of a folder and how far it is.

    Raises:
        InputError: it is no folder of a sweep.
    """
    kept = Folder(path=Path(folder))
    design = Design.of_plain(kept.stated()["sweep"])
    rows = list(kept.rows(design.count))
    return design, Counts(total=design.count, done=len(rows), failed=sum(not _passed(row) for row in rows))


def _passed(row: dict[str, object]) -> bool:
    return bool(row.get("solved") and row.get("audit_holds") and row.get("survived") is not False)


class _Run:
    """The plans of a sweep that are left, in their order."""

    def __init__(
        self,
        design: Design,
        folder: Folder,
        *,
        time_limit: float,
        simulate: bool,
        warm: bool,
        progress: Callable[[Counts], object] | None,
    ) -> None:
        self._folder, self._progress = folder, progress
        self._time_limit, self._simulate = time_limit, simulate
        self._rows = {row.index: row for row in design.rows()}
        self._origins = origins(list(self._rows.values())) if warm else dict.fromkeys(self._rows)
        self._rank = {index: rank for rank, index in enumerate(self._origins)}
        self._solved: dict[int, bool] = {}
        self._failed, self._made, self._started = 0, 0, time.monotonic()
        for row in folder.rows(len(self._rows)):
            self._note(row)
        self._attempts: dict[int, int] = {}
        self._children: dict[int, list[int]] = {}
        self._ready: list[tuple[int, int]] = []
        for index, origin in self._origins.items():
            if index in self._solved:
                continue
            if origin is None or origin in self._solved:
                heapq.heappush(self._ready, (self._rank[index], index))
            else:
                self._children.setdefault(origin, []).append(index)

    @property
    def left(self) -> int:
        """Return how many plans are not done."""
        return len(self._rows) - len(self._solved)

    def counts(self) -> Counts:
        """Return how far the sweep is."""
        return Counts(
            total=len(self._rows),
            done=len(self._solved),
            failed=self._failed,
            made=self._made,
            elapsed=time.monotonic() - self._started,
        )

    def through(self, engine: Engine) -> None:
        """Make all plans that are left.

        Args:
            engine: that runs them.
        """
        self._tell()
        working = 0
        while self._ready or working:
            while self._ready and working < engine.slots:
                engine.submit(self._order(self._rows[heapq.heappop(self._ready)[1]]))
                working += 1
            for ended in engine.wait():
                working -= 1
                self._take(ended)

    def _order(self, row: Row) -> Order:
        origin = root = self._origins[row.index]
        while root is not None and self._origins[root] is not None:
            root = self._origins[root]
        while origin is not None and not self._solved[origin]:
            origin = self._origins[origin]
        return Order(
            row=row,
            folder=str(self._folder.path.resolve()),
            started_from=origin,
            base=self._rows[row.index if root is None else root].scenario,
            time_limit=self._time_limit,
            simulate=self._simulate,
            attempts=self._attempts.get(row.index, 0),
            facts=facts(),
        )

    def _take(self, ended: Ended) -> None:
        index, row = ended.order.row.index, ended.row
        if row is None:
            self._attempts[index] = self._attempts.get(index, 0) + 1
            row = self._folder.read_row(index)  # it may have been killed right after it wrote all
        if row is None and ended.lost and self._attempts[index] < ATTEMPTS:
            heapq.heappush(self._ready, (self._rank[index], index))
            return
        if row is None:
            row = row_of(ended.order, {"status": ended.problem, "message": ended.message}, seconds=0.0)
            self._folder.write_row(row)
        self._note(row)
        self._made += 1
        for child in self._children.pop(index, ()):
            heapq.heappush(self._ready, (self._rank[child], child))
        self._tell()

    def _note(self, row: dict[str, object]) -> None:
        self._solved[int(str(row["index"]))] = bool(row.get("solved"))
        self._failed += not _passed(row)

    def _tell(self) -> None:
        if self._progress is not None:
            self._progress(self.counts())

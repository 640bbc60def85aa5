"""Kill the workers and the driver of a sweep at random moments, and look whether a plan is lost or made twice.

python benchmarks/sweep_kills.py SWEEP.toml FOLDER [KILLS] [WORKERS]   (10 kills and 2 workers; Linux)

Each kill is a SIGKILL some time after a drawn number of plans is done: in turns of one worker, and of the driver, which
is started again. All the while every file of every plan is watched: none may change once its row is there. Exit status
0 when every plan has a row and a trajectory that loads, and nothing was written twice. A draft that a kill cut short
may be left; nothing reads it.
"""

import os
import random
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np

import multimodal_to as mt
from multimodal_to.sweeping.folder import Folder

LONGEST_DELAY = 3.0  # from the plan that a kill waits for to the kill [s]; about the time of a plan
WATCHED = 0.2  # time between two looks at the files [s]


class Watch:
    """The files of the plans of a sweep, as they were when their row was first seen."""

    def __init__(self, folder: Path, count: int) -> None:
        self._kept, self._count = Folder(path=folder), count
        self._seen: dict[Path, tuple[int, int]] = {}
        self._done: set[int] = set()
        self.twice: list[Path] = []

    @property
    def done(self) -> int:
        """Return how many plans have a row."""
        return len(self._done)

    def look(self) -> None:
        """Note the files of plans that are new, and those that are no longer as they were."""
        for path, before in self._seen.items():
            if stamp(path) != before:
                self.twice.append(path)
        for index in set(range(self._count)) - self._done:
            if self._kept.row(index).exists():
                self._done.add(index)
                for path in (self._kept.row(index), self._kept.plan(index)):
                    if path.exists():  # a plan without an answer has a row alone
                        self._seen[path] = stamp(path)


def stamp(path: Path) -> tuple[int, int]:
    """Return what tells a file from one that was written in its place: its inode and its time."""
    status = path.stat()
    return status.st_ino, status.st_mtime_ns


def workers_of(driver: int) -> list[int]:
    """Return the processes that make plans for a driver."""
    children = Path(f"/proc/{driver}/task/{driver}/children").read_text().split()
    return [int(pid) for pid in children if b"sweeping.worker" in Path(f"/proc/{pid}/cmdline").read_bytes()]


def started(file: Path, folder: Path, workers: int) -> subprocess.Popen:
    """Start the command that makes the sweep, or goes on with it."""
    command = ["sweep", str(file), "--output", str(folder), "--workers", str(workers), "--quiet"]
    return subprocess.Popen([sys.executable, "-m", "multimodal_to", *command])


def main() -> int:
    """Make a sweep with kills on the way, then count what is there."""
    file, folder = Path(sys.argv[1]), Path(sys.argv[2])
    kills, workers = (int(word) for word in (sys.argv[3:] + ["10", "2"][len(sys.argv) - 3 :])[:2])
    design, draw = mt.sweeping.read_design(file), random.Random(0)
    moments = sorted(draw.sample(range(design.count), kills))
    watch = Watch(folder, design.count)
    begun = time.perf_counter()
    driver = started(file, folder, workers)

    def wait_until(done: int, delay: float) -> None:
        since = None
        while driver.poll() is None and (since is None or time.perf_counter() < since + delay):
            time.sleep(WATCHED)
            watch.look()
            if since is None and watch.done >= done:
                since = time.perf_counter()

    for number, moment in enumerate(moments):
        wait_until(moment, draw.uniform(0.0, LONGEST_DELAY))
        victims = workers_of(driver.pid)
        if number % 2 == 0 and victims:
            os.kill(draw.choice(victims), signal.SIGKILL)
            print(f"SIGKILL to a worker, {watch.done} plans done", flush=True)
            continue
        driver.kill()
        driver.wait()
        while any(os.path.exists(f"/proc/{pid}") for pid in victims):  # they end with it
            time.sleep(WATCHED)
        print(f"SIGKILL to the driver, {watch.done} plans done", flush=True)
        driver = started(file, folder, workers)
    wait_until(design.count, float("inf"))
    seconds = time.perf_counter() - begun
    watch.look()
    return judged(folder, watch, seconds)


def judged(folder: Path, watch: Watch, seconds: float) -> int:
    """Print what a sweep left, and return the exit status.

    Args:
        folder: of the sweep.
        watch: over its files.
        seconds: that it took [s].
    """
    kept = Folder(path=folder)
    design = mt.sweeping.read_design(sys.argv[1])
    rows = list(kept.rows(design.count))
    passed = [row for row in rows if row["solved"] and row["audit_holds"]]
    for row in rows:
        if row.get("plan"):
            mt.Trajectory.load(folder / row["plan"])
    expected = {kept.row(row["index"]) for row in rows} | {kept.plan(row["index"]) for row in rows if row.get("plan")}
    found = {path for name in ("rows", "plans") for path in (folder / name).rglob("*") if path.is_file()}
    print(f"{len(rows)} of {design.count} plans have a row, {len(passed)} are solved and pass the audit")
    print(f"written twice: {len(watch.twice)} files; left over: {len(found - expected)} files")
    print(f"plans begun again after a worker was lost: {sum(row['attempts'] > 0 for row in rows)}")
    work, iterations = ([row[name] for row in passed] for name in ("cpu_seconds", "iterations"))
    print(f"processor time of a plan {np.mean(work):.2f} s, median of iterations {np.median(iterations):.0f}")
    print(f"{seconds / 60.0:.0f} min in all")
    for row in rows:
        if row not in passed:
            print(f"{row['index']}: {row['status']}, {row.get('audit_worst')}, {row.get('message')}")
    return 0 if len(rows) == design.count and not watch.twice and found >= expected else 1


if __name__ == "__main__":
    sys.exit(main())

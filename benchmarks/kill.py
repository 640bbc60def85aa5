"""Kill solves at random moments and look at what is left: SIGKILL, and Ctrl-C once and twice in a terminal.

python benchmarks/kill.py [KILLS] [INTERRUPTS]   (10 and 6; each a solve of a take-off with 20 knots)

Every process is one of the command line in a pseudo-terminal of its own. Exit status 0 when nothing was lost.
"""

import fcntl
import os
import pty
import random
import subprocess
import sys
import tempfile
import termios
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import multimodal_to as mt

TASK = ("take-off", "--set", "knots=20", "--set", "interval_min=0.175", "--set", "interval_max=0.35")
CTRL_C = b"\x03"
AT_ONCE = 1.0  # greatest time from the second Ctrl-C to the end [s]


@dataclass(frozen=True, kw_only=True)
class End:
    """How a process in a terminal ended."""

    status: int  # as Popen has it: minus the signal that ended it
    screen: str  # all that it wrote
    sane: bool  # the terminal's settings are as they were before
    waited: float  # from the last signal to the end [s]

    @property
    def cursor_shown(self) -> bool:
        """Return whether the last that was said of the cursor is that it is shown."""
        return self.screen.rfind("\x1b[?25h") >= self.screen.rfind("\x1b[?25l")


class Terminal:
    """A solve of the command line as a person sees it."""

    def __init__(self, folder: Path, *task: str) -> None:
        self._screen, self._keyboard = b"", -1
        self._keyboard, terminal = pty.openpty()
        self._terminal, self._before = terminal, termios.tcgetattr(terminal)
        self.process = subprocess.Popen(
            [sys.executable, "-m", "multimodal_to", "solve", *(task or TASK), "--output", folder],
            stdin=terminal,
            stdout=terminal,
            stderr=terminal,
            preexec_fn=_own_terminal,
        )
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()
        self._signalled = time.perf_counter()

    def wait_for(self, condition: Callable[[], bool], timeout: float = 120.0) -> None:
        """Wait until something holds, or the process has ended."""
        end = time.perf_counter() + timeout
        while not condition() and self.process.poll() is None:
            if time.perf_counter() > end:
                raise TimeoutError(f"nothing after {timeout} s; the screen says {self._screen[-300:]!r}")
            time.sleep(0.01)

    def says(self, text: str) -> bool:
        """Return whether a text has been on the screen."""
        return text.encode() in self._screen

    def kill(self) -> None:
        """Send SIGKILL."""
        self.process.kill()
        self._signalled = time.perf_counter()

    def press_ctrl_c(self) -> None:
        """Type Ctrl-C."""
        os.write(self._keyboard, CTRL_C)
        self._signalled = time.perf_counter()

    def end(self) -> End:
        """Wait for the end of the process."""
        status = self.process.wait(timeout=120)
        waited = time.perf_counter() - self._signalled
        sane = termios.tcgetattr(self._terminal) == self._before
        os.close(self._terminal)
        self._reader.join()
        os.close(self._keyboard)
        return End(status=status, screen=self._screen.decode(errors="replace"), sane=sane, waited=waited)

    def _read(self) -> None:
        try:
            while data := os.read(self._keyboard, 65536):
                self._screen += data
        except OSError:  # the other end is closed
            pass


def _own_terminal() -> None:
    """Make the terminal that stdin is the one whose Ctrl-C this process gets."""
    os.setsid()
    fcntl.ioctl(0, termios.TIOCSCTTY, 0)


def kept(folder: Path) -> dict | None:
    """Return the record of the checkpoint, or of the trajectory once that has replaced it; None where neither is."""
    for name in ("checkpoint.npz", "trajectory.npz"):
        if (folder / name).is_file():
            return mt.Trajectory.load(folder / name).solve_record()
    return None


def feasible(folder: Path) -> bool:
    """Return whether a feasible iterate is in a file."""
    try:
        record = kept(folder)
    except mt.MultimodalError:  # between looking and loading the trajectory replaced it
        return False
    return record is not None and record["feasible"]


def killed(folder: Path, delay: float, *task: str) -> bool:
    """Kill a solve some time after its first feasible iterate was written; return whether what is left loads."""
    terminal = Terminal(folder, *task)
    terminal.wait_for(lambda: feasible(folder))
    time.sleep(delay)
    terminal.kill()
    terminal.end()
    record = kept(folder)
    assert record is not None
    return record["feasible"] and mt.audit(*_loaded(folder)).scenario is not None


def _loaded(folder: Path) -> tuple[mt.Robot, mt.Trajectory]:
    file = folder / "checkpoint.npz"
    trajectory = mt.Trajectory.load(file if file.is_file() else folder / "trajectory.npz")
    return mt.load_robot(trajectory.robot).with_jets(trajectory.jet_names), trajectory


def interrupted(folder: Path, delay: float, *task: str, twice: bool) -> End:
    """Press Ctrl-C some time after the first iteration, once or twice."""
    terminal = Terminal(folder, *task)
    terminal.wait_for(lambda: terminal.says("iteration"))
    time.sleep(delay)
    terminal.press_ctrl_c()
    if twice:
        terminal.wait_for(lambda: terminal.says("Ctrl-C again"))
        terminal.press_ctrl_c()
    return terminal.end()


def main() -> int:
    """Time one solve, then kill others at moments drawn from it."""
    kills, interrupts = (int(word) for word in (sys.argv[1:] + ["10", "6"][len(sys.argv) - 1 :])[:2])
    draw, good = random.Random(0), True
    with tempfile.TemporaryDirectory() as scratch:
        whole = Path(scratch) / "whole"
        terminal = Terminal(whole)
        terminal.wait_for(lambda: terminal.says("iteration"))
        started = time.perf_counter()
        terminal.wait_for(lambda: feasible(whole))
        found = time.perf_counter()
        terminal.wait_for(lambda: (whole / "trajectory.npz").is_file())
        solved = time.perf_counter()
        terminal.end()
        print(f"undisturbed: first feasible after {found - started:.1f} s, solved after {solved - started:.1f} s")
        for index in range(kills):
            delay, folder = draw.uniform(0.0, solved - found), Path(scratch) / f"killed-{index}"
            whole_file = killed(folder, delay)
            files = " ".join(sorted(path.name for path in folder.iterdir()))
            print(f"SIGKILL {delay:4.1f} s after it: {'loads, feasible' if whole_file else 'LOST'}; left: {files}")
            good &= whole_file
        for index in range(interrupts):
            twice, delay = index % 2 == 1, draw.uniform(0.0, solved - started)
            folder = Path(scratch) / f"interrupted-{index}"
            end = interrupted(folder, delay, twice=twice)
            record = kept(folder)
            sane = end.sane and end.cursor_shown
            print(
                f"Ctrl-C {'twice' if twice else 'once '} after {delay:4.1f} s: status {end.status}, ended "
                f"{end.waited:.1f} s later, terminal {'sane' if sane else 'NOT SANE'}, "
                f"left: {'nothing' if record is None else record['kind'] + ', ' + record['status']}"
            )
            good &= sane and (end.waited < AT_ONCE if twice else record is not None)
    print("nothing was lost" if good else "something was lost")
    return 0 if good else 1


if __name__ == "__main__":
    sys.exit(main())

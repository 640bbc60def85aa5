"""Programs that this process starts end with it, however it ends."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from drones import drone
from multimodal_to import children
from synthetic import take_off

pytestmark = pytest.mark.skipif(os.name != "posix", reason="signals are POSIX's")
SIGNALS = pytest.mark.parametrize(
    "number", [signal.SIGTERM, signal.SIGHUP, signal.SIGKILL], ids=lambda number: number.name
)
STARTS_ONE = """
import sys, time
from multimodal_to import children
children.start([sys.executable, "-c", sys.argv[1]])
print("started", flush=True)
time.sleep(60)
"""
SAYS_WHO_IT_IS = """
import os, subprocess, sys, time
below = subprocess.Popen([sys.executable, "-c", "import time; time.sleep(60)"])
open({path!r}, "w").write(f"{{os.getpid()}} {{below.pid}}")
time.sleep(60)
"""


def waits_for(condition: Callable[[], bool], patience: float = 20.0) -> bool:
    end = time.monotonic() + patience
    while not condition():
        if time.monotonic() > end:
            return False
        time.sleep(0.05)
    return True


def runs(process: int) -> bool:
    """Whether a process is there and is no zombie that nobody waits for."""
    try:
        return Path(f"/proc/{process}/stat").read_text(encoding="utf-8").rpartition(")")[2].split()[0] != "Z"
    except FileNotFoundError:
        return False


@SIGNALS
def test_a_child_and_what_it_started_end_with_the_process_that_is_killed(tmp_path, number):
    note = tmp_path / "pids"
    parent = subprocess.Popen(
        [sys.executable, "-c", STARTS_ONE, SAYS_WHO_IT_IS.format(path=str(note))], stdout=subprocess.DEVNULL
    )
    assert waits_for(lambda: note.exists() and len(note.read_text(encoding="utf-8").split()) == 2)
    parent.send_signal(number)
    assert parent.wait() == -number
    for process in map(int, note.read_text(encoding="utf-8").split()):
        assert waits_for(lambda process=process: not runs(process))


def test_a_child_that_is_ended_is_gone_and_one_that_ends_says_how(tmp_path):
    note = tmp_path / "pids"
    process = children.start([sys.executable, "-c", SAYS_WHO_IT_IS.format(path=str(note))])
    assert waits_for(lambda: note.exists() and len(note.read_text(encoding="utf-8").split()) == 2)
    children.end(process)
    for process in map(int, note.read_text(encoding="utf-8").split()):  # a signal that is sent takes a moment to act
        assert waits_for(lambda process=process: not runs(process))
    assert children.run([sys.executable, "-c", "raise SystemExit(3)"], timeout=60.0) == 3
    killed = "import os, signal; os.kill(os.getpid(), signal.SIGSEGV)"
    assert children.run([sys.executable, "-c", killed], timeout=60.0) == -signal.SIGSEGV
    with pytest.raises(subprocess.TimeoutExpired):
        children.run([sys.executable, "-c", "import time; time.sleep(60)"], timeout=0.2)
    with pytest.raises(OSError, match="no such program"):
        children.start(["/no/such/program"])


@SIGNALS
def test_a_live_replay_leaves_no_server_behind(tmp_path, number):
    file = take_off(drone(tmp_path)).save(tmp_path / "motion.npz")
    command = [sys.executable, "-m", "multimodal_to", "replay", str(file), "--robot", str(tmp_path)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, env={**os.environ, "BROWSER": "true"}) as parent:
        assert b"replaying at" in parent.stdout.readline()
        servers = [
            int(entry.name)
            for entry in Path("/proc").iterdir()
            if entry.name.isdigit() and parent_of(parent_of(int(entry.name))) == parent.pid
        ]
        assert servers
        parent.send_signal(number)
    for server in servers:
        assert waits_for(lambda server=server: not runs(server))


def parent_of(process: int) -> int:
    try:
        return int(Path(f"/proc/{process}/stat").read_text(encoding="utf-8").rpartition(")")[2].split()[1])
    except (FileNotFoundError, ProcessLookupError):
        return 0

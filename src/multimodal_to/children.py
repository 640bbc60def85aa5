"""Programs that run beside this process and end with it, however it ends: also when it is killed.

A guard, a Python of a few lines, starts the program and reads its own standard input, which nobody writes to. The input
closes with this process, and the guard then ends the program and what that has started.
"""

from __future__ import annotations

import atexit
import errno
import os
import shutil
import subprocess
import sys
from collections.abc import Mapping, Sequence
from contextlib import suppress

_GRACE = 5.0  # how long a program may take to end before it is killed [s]

_GUARD = f"""
import os, signal, subprocess, sys, threading

def end_with_the_parent():
    sys.stdin.buffer.read()
    if os.name == "posix":
        os.killpg(0, signal.SIGTERM)
    else:
        child.terminate()
    try:
        child.wait({_GRACE})
    except subprocess.TimeoutExpired:
        child.kill()
    if os.name == "posix":
        os.killpg(0, signal.SIGKILL)
    os._exit(1)

for name in ("SIGINT", "SIGTERM", "SIGHUP"):
    if hasattr(signal, name):
        signal.signal(getattr(signal, name), lambda *_: None)
try:
    child = subprocess.Popen(sys.argv[1:], stdin=subprocess.DEVNULL)
except OSError as error:
    os._exit(127)
threading.Thread(target=end_with_the_parent, daemon=True).start()
code = child.wait()
os._exit(code if code >= 0 else 128 - code)
"""
_running: list[subprocess.Popen[bytes]] = []


def start(
    command: Sequence[str], *, reads: bool = False, env: Mapping[str, str] | None = None
) -> subprocess.Popen[bytes]:
    """Start a program that ends with this process; `end` ends it before.

    Args:
        command: the program and its arguments.
        reads: whether its standard output is read from `process.stdout`; else it is dropped.
        env: its environment, by default this process's own.

    Raises:
        OSError: it cannot be started.
    """
    if shutil.which(command[0]) is None:
        raise FileNotFoundError(errno.ENOENT, "there is no such program", command[0])
    process = subprocess.Popen(
        [sys.executable, "-I", "-S", "-c", _GUARD, *command],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE if reads else subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        env=env,
        start_new_session=True,
    )
    _running.append(process)
    return process


def end(process: subprocess.Popen[bytes]) -> None:
    """End a program of `start`, if it has not ended by itself, and wait until it is gone."""
    assert process.stdin is not None
    with suppress(OSError):  # it has gone already
        process.stdin.close()
    try:
        process.wait(2 * _GRACE)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()
    if process.stdout is not None:
        process.stdout.close()
    if process in _running:
        _running.remove(process)


def run(command: Sequence[str], *, timeout: float) -> int:
    """Run a program whose output is dropped, and return its exit status; that of one that crashed is −(its signal).

    Args:
        command: the program and its arguments.
        timeout: how long it may take [s].

    Raises:
        OSError: it cannot be started.
        subprocess.TimeoutExpired: it took longer, and was ended.
    """
    process = start(command)
    try:
        code = process.wait(timeout)
    finally:
        end(process)
    return 128 - code if os.name == "posix" and code > 128 else code


@atexit.register
def _end_all() -> None:
    for process in tuple(_running):
        end(process)

"""Ctrl-C ends a command at once with one line, whatever it is doing."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time

import pytest

from multimodal_to import ending

pytestmark = pytest.mark.skipif(os.name != "posix", reason="signals are POSIX's")
STARTED = """
import sys
sys.argv[0] = "/usr/bin/multimodal-to"  # as the script that an installer writes
print("up", flush=True)
from multimodal_to.cli import main
main()
"""
GREEDY = """
import os, signal
try:
    os.kill(os.getpid(), signal.SIGINT)
    for _ in range(1000): pass
except BaseException:
    swallowed = True
"""


@pytest.mark.parametrize("delay", [0.05, 0.3, 0.6, 1.0])
def test_a_command_that_starts_ends_with_one_line_and_130(delay, tmp_path):
    command = [sys.executable, "-c", STARTED, "solve", "take-off", "--output", str(tmp_path / "out")]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as process:
        assert process.stdout.readline() == b"up\n"
        time.sleep(delay)
        process.send_signal(signal.SIGINT)
        process.send_signal(signal.SIGINT)
        out, error = process.communicate(timeout=60)
    assert (process.returncode, error) == (ending.INTERRUPTED, b"interrupted\n")
    assert out == b""


def test_an_import_that_swallows_everything_does_not_swallow_ctrl_c(tmp_path):
    (tmp_path / "greedy.py").write_text(GREEDY, encoding="utf-8")
    script = "from multimodal_to import ending\nwith ending.handled():\n    import greedy\nprint('went on')"
    ended = subprocess.run(
        [sys.executable, "-c", script],
        capture_output=True,
        check=False,
        cwd=tmp_path,
        timeout=60,
        env={**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, (str(tmp_path), os.environ.get("PYTHONPATH"))))},
    )
    assert (ended.returncode, ended.stdout, ended.stderr) == (130, b"", b"interrupted\n")


def test_a_program_that_imports_the_library_keeps_its_own_handling():
    script = "import signal, multimodal_to; print(signal.getsignal(signal.SIGINT) is signal.default_int_handler)"
    ended = subprocess.run([sys.executable, "-c", script], capture_output=True, check=True, timeout=60)
    assert ended.stdout.strip() == b"True"


def test_a_file_that_is_half_written_goes_with_ctrl_c(tmp_path):
    script = """
import os, signal, sys
from multimodal_to import ending
from multimodal_to.files.writing import scratch, whole
with ending.handled(), scratch(sys.argv[1]) as folder, whole(f"{sys.argv[1]}/result.txt") as draft:
    draft.write_text("half")
    (folder / "more.txt").write_text("more")
    os.kill(os.getpid(), signal.SIGINT)
    while True:
        pass
"""
    ended = subprocess.run([sys.executable, "-c", script, str(tmp_path)], capture_output=True, check=False, timeout=60)
    assert (ended.returncode, ended.stdout, ended.stderr) == (130, b"", b"interrupted\n")
    assert list(tmp_path.iterdir()) == []


def test_compiled_code_does_not_swallow_ctrl_c():
    script = """
import os, signal, threading
import casadi as cs
from multimodal_to import ending
with ending.handled():
    threading.Timer(0.3, lambda: os.kill(os.getpid(), signal.SIGINT)).start()
    for _ in range(200_000):
        cs.DM(3, 3).__array__()
print("went on")
"""
    ended = subprocess.run([sys.executable, "-c", script], capture_output=True, check=False, timeout=60)
    assert (ended.returncode, ended.stdout, ended.stderr) == (130, b"", b"interrupted\n")

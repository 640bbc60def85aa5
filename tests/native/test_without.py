"""Everything works without the native library; one line says that it is not there."""

from __future__ import annotations

import subprocess
import sys

from commands import run_process
from multimodal_to.trajectory import Trajectory

SQUAT = (
    *("--set", "knots=6", "--set", "interval_max=0.2", "--set", "final_com_height=0.54"),
    *("--set", "terminal=standing", "--set", "jets=false"),
)


def test_a_solve_without_the_library_finds_its_answer_and_says_so_once(tmp_path):
    solved = run_process(
        *("solve", "take-off", *SQUAT, "--paper", "--no-pictures", "--output", tmp_path), MULTIMODAL_TO_NATIVE="0"
    )
    assert solved.returncode == 0, solved.stderr
    said = solved.stdout + solved.stderr
    assert said.count("native library") == 1
    assert "warning: the solve takes longer, as MULTIMODAL_TO_NATIVE=0 leaves the native library unused\n" in said
    record = Trajectory.load(tmp_path / "trajectory.npz").solve_record()
    assert (record["status"], record["linear_solver"], record["native"]) == ("optimal", "mumps", "")


def test_a_solve_with_the_library_says_nothing_of_it_and_notes_its_instruction_set(tmp_path, compiler):
    solved = run_process("solve", "take-off", *SQUAT, "--max-iterations", 1, "--no-pictures", "--output", tmp_path)
    assert "native library" not in solved.stdout + solved.stderr
    record = Trajectory.load(tmp_path / "trajectory.npz").solve_record()
    assert record["native"] in compiler.instruction_sets


def test_the_library_itself_says_nothing(tmp_path):
    code = "import multimodal_to.native as native; native.library(); native.missing()"
    ended = subprocess.run(
        [sys.executable, "-W", "error", "-c", code],
        env={"MULTIMODAL_TO_NATIVE": str(tmp_path / "none.so"), "PYTHONPATH": ":".join(sys.path)},
        check=True,
        capture_output=True,
    )
    assert ended.stdout + ended.stderr == b""

from __future__ import annotations

from commands import run
from places import EXAMPLES


def test_a_dry_run_says_how_many_plans_there_are_and_the_first_five():
    result = run("sweep", EXAMPLES / "sweep.toml", "--dry-run")
    lines = result.stdout.splitlines()
    assert lines[0] == "8 plans"
    assert len(lines) == 2 + 5
    assert lines[2].split() == ["0", "take-off", "ironcub", "0.75", "0.97"]


def test_a_sweep_of_one_task_that_is_refused_says_so_in_table_page_and_status(tmp_path):
    file, folder = tmp_path / "s.toml", tmp_path / "s"
    file.write_text('scenario = "take-off"\n[grid]\n"robot.link.tail.mass" = [1.1]\n', encoding="utf-8")
    result = run("sweep", file, "--output", folder, "--workers", "1")
    assert result.returncode == 1
    assert result.stdout.splitlines()[0].startswith("1 of 1 plans, 1 failed")
    status = run("sweep", "status", folder)
    assert status.stdout.splitlines()[1].startswith("0: refused: unknown link 'tail'")
    page = (folder / "report.html").read_text(encoding="utf-8")
    assert "<td>refused</td><td>1</td><td>100.0 %</td>" in page
    assert "unknown link" in page
    assert "http" not in page


def test_what_is_no_sweep_is_refused_in_a_sentence(tmp_path):
    for arguments, said in (
        (("sweep", "status", tmp_path), "is no folder of a sweep"),
        (("sweep", "status"), "expected the folder of a sweep"),
        (("sweep", EXAMPLES / "sweep.toml"), "expected the folder of the sweep: --output DIR"),
        (("sweep", EXAMPLES / "sweep.toml", "-o", tmp_path, "--engine", "slurm"), "unknown engine 'slurm'"),
    ):
        result = run(*arguments)
        assert result.returncode == 2
        assert said in " ".join(result.stderr.split())

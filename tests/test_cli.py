"""Every command, with good and bad input, as a person runs it."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest

from multimodal_to import scenario_files, scenarios
from multimodal_to.models.terrain import Plane
from multimodal_to.ocp.scenario_data import stored
from multimodal_to.trajectory import Trajectory
from synthetic import take_off as synthetic_take_off


def run(*arguments, cwd=None):
    return subprocess.run(
        [sys.executable, "-m", "multimodal_to", *map(str, arguments)],
        capture_output=True, text=True, cwd=cwd, timeout=300, check=False, env={**os.environ, "COLUMNS": "200"},
    )  # fmt: skip


@pytest.fixture(scope="module")
def file(ironcub, tmp_path_factory):
    return synthetic_take_off(ironcub).save(tmp_path_factory.mktemp("cli") / "trajectory.npz")


@pytest.fixture(scope="module")
def stopped(tmp_path_factory):
    """A solve that is given three iterations: too few for an answer."""
    folder = tmp_path_factory.mktemp("stopped") / "new" / "folder"
    return folder, run("solve", "take-off", "--output", folder, "--max-iterations", 3)


def test_list_shows_the_scenarios_with_their_numbers():
    result = run("list")
    assert result.returncode == 0
    assert re.search(r"^take-off +Vertical take-off from standing to hover", result.stdout, re.MULTILINE)
    assert (
        "70 knots, 3.5 to 7 s, CoM from 0 0 0.57 m (standing) to 0 0 0.7 m (hover), jets on, ground: flat"
        in result.stdout
    )


def test_a_scenario_is_shown_as_toml_changed_and_read_back(tmp_path):
    shown = run("show", "take-off", "--set", "name=higher", "--set", "final_com_height=0.8")
    assert shown.returncode == 0
    (tmp_path / "higher.toml").write_text(shown.stdout)
    again = run("show", tmp_path / "higher.toml", "--set", "name=take-off", "--set", "final_com_height=0.7")
    assert again.stdout == run("show", "take-off").stdout


def test_a_changed_scenario_is_solved_and_kept_in_the_file(tmp_path):
    (tmp_path / "my_task.toml").write_text(
        'based_on = "take-off"\nknots = 5\n[surface]\nkind = "plane"\nslope = 0.05\n'
    )
    result = run("solve", "my_task.toml", "--set", "final_com_height=0.6", "--max-iterations", 2, cwd=tmp_path)
    assert "5 knots" in result.stdout
    file = tmp_path / "results" / "my_task" / "trajectory.npz"
    kept = stored(Trajectory.load(file))
    assert kept == replace(scenarios.take_off(), name="my_task", knots=5, surface=Plane(slope=0.05),
                           final_com=(0.0, 0.0, 0.6))  # fmt: skip
    assert run("show", file).stdout == scenario_files.to_toml(kept)


@pytest.mark.parametrize(
    "command",
    [
        (),
        ("solve",),
        ("reproduce",),
        ("plot",),
        ("replay",),
        ("audit",),
        ("simulate",),
        ("list",),
        ("show",),
        ("robot",),
        ("robot", "info"),
    ],
)
def test_help_is_short(command):
    result = run(*command, "--help")
    assert result.returncode == 0
    assert len(result.stdout.splitlines()) < 40


def test_robot_info_shows_the_tree_and_what_looks_wrong():
    result = run("robot", "info", "ironcub")
    assert result.returncode == 0
    assert "23 moving joints" in result.stdout
    assert "44.742 kg" in result.stdout
    assert "joint 'l_elbow' has the effort limit 50000, which looks like a placeholder" in result.stdout


def test_version_is_printed():
    assert run("--version").stdout.startswith("multimodal-to ")


def test_a_solve_writes_trajectory_plot_and_replay_even_without_an_answer(stopped):
    folder, result = stopped
    assert result.returncode == 1
    assert result.stderr == ""
    assert "iteration limit: allow more iterations" in result.stdout
    assert sorted(path.name for path in folder.iterdir()) == ["forces.png", "replay.html", "trajectory.npz"]
    assert Trajectory.load(folder / "trajectory.npz").scenario == "take-off"


def test_progress_names_iteration_objective_violation_and_time(stopped):
    assert "iteration    0   objective" in stopped[1].stdout
    assert "largest violation" in stopped[1].stdout


def test_quiet_prints_nothing(tmp_path):
    result = run("solve", "take-off", "--output", tmp_path, "--max-iterations", 1, "--quiet")
    assert (result.stdout, result.stderr) == ("", "")


def test_plot_and_replay_read_a_saved_file(file, tmp_path):
    assert run("plot", file, "--output", tmp_path / "forces.svg").returncode == 0
    assert (tmp_path / "forces.svg").read_text(encoding="utf-8").startswith("<?xml")
    assert run("replay", file, "--html", tmp_path / "page.html").returncode == 0
    assert (tmp_path / "page.html").stat().st_size > 800_000  # the viewer is inside
    assert run("replay", file, "--with", file, "--html", tmp_path / "both.html").returncode == 0
    assert "faint, and its line" in (tmp_path / "both.html").read_text(encoding="utf-8")
    refused = run("replay", file, "--with", file, "--snapshots", tmp_path / "stills.png")
    assert (refused.returncode, refused.stdout) == (2, "")
    assert "--snapshots shows one trajectory" in refused.stderr


def test_all_figures_of_two_files_are_plotted_under_names_of_their_own(file, tmp_path):
    other = tmp_path / "again.npz"
    other.write_bytes(file.read_bytes())
    result = run("plot", file, other, "--figure", "all", "--output", tmp_path / "both.png")
    assert result.returncode == 0
    names = sorted(path.stem.removeprefix("both-") for path in tmp_path.glob("*.png"))
    assert names == ["com", "contacts", "forces", "joints", "margins", "momentum", "torques"]


def test_report_and_export_read_a_saved_file(file, tmp_path):
    assert run("report", file, "--output", tmp_path / "report.html", "--no-meshes").returncode == 0
    assert (tmp_path / "report.html").stat().st_size > 1_000_000
    for kind, name in (("csv", "t.csv"), ("mat", "t.mat"), ("mujoco", "m.npz"), ("pinocchio", "p.npz")):
        assert run("export", file, "--to", kind, "--output", tmp_path / name).returncode == 0
        assert (tmp_path / name).stat().st_size > 5_000


def test_audit_says_what_fails_and_leaves_with_one(file):
    result = run("audit", file)  # a drawn motion, not a true one
    assert result.returncode == 1
    assert "FAILS" in result.stdout


def test_audit_speaks_json_to_programs_and_says_when_no_scenario_is_known(file, stopped):
    result = run("audit", file, "--json")
    report = json.loads(result.stdout)
    assert result.returncode == 1
    assert (report["holds"], report["scenario"]) == (False, None)
    finding = next(entry for entry in report["findings"] if entry["name"] == "force balance")
    assert set(finding) == {"name", "worst", "unit", "knot", "body", "limit", "holds"}
    assert "the file keeps no scenario" in run("audit", file).stdout
    solved = json.loads(run("audit", stopped[0] / "trajectory.npz", "--json").stdout)
    assert solved["scenario"] == "take-off"
    assert {"start: CoM", "end: CoM"} <= {entry["name"] for entry in solved["findings"]}


def test_bare_arrays_are_audited_once_their_robot_is_named(file, tmp_path):
    with np.load(file) as archive:
        arrays = {name: archive[name] for name in archive.files if name not in ("format_version", "contact_positions")}
    np.savez(tmp_path / "bare.npz", **arrays)
    assert "has no format_version" in run("audit", tmp_path / "bare.npz").stderr
    result = run("audit", tmp_path / "bare.npz", "--robot", "ironcub")
    assert result.returncode == 1
    assert re.search(r"contact point consistency +0\.0e\+00 ", result.stdout)


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (("solve", "takeoff"), "unknown scenario 'takeoff'; did you mean 'take-off'? Available: take-off"),
        (
            ("solve", "take-off", "--set", "final_height=1"),
            "unknown key 'final_height'; did you mean 'final_com_height'?",
        ),
        (("solve", "take-off", "--set", "knots=few"), "'knots' is 'few'; expected a whole number"),
        (("reproduce", "takeoff"), "unknown scenario 'takeoff'; did you mean 'take-off'?"),
        (("reproduce", "jump", "--published", "none"), "no .npz of a published trajectory in 'none'"),
        (("solve", "none.toml"), "cannot read 'none.toml'"),
        (("solve", "take-off", "--robot", "ironcup"), "unknown robot 'ironcup'; did you mean 'ironcub'?"),
        (("solve", "take-off", "--max-iterations", "0"), "max_iterations is 0; expected a positive number"),
        (("plot", "none.npz"), "no trajectory file 'none.npz'"),
        (("plot", "none.npz", "--figure", "force"), "unknown figure 'force'; did you mean 'forces'?"),
        (("replay", "none.npz", "--gif", "film.mp4"), "no trajectory file"),
        (("replay", "none.npz"), "no trajectory file 'none.npz'"),
        (("report", "none.npz"), "no trajectory file 'none.npz'"),
        (("export", "none.npz", "--to", "matlab"), "unknown export 'matlab'; did you mean 'mat'?"),
        (("audit", "none.npz"), "no trajectory file 'none.npz'"),
        (("robot", "info", "none.urdf"), "unknown robot 'none.urdf'"),
        (("robot", "info", __file__), "is not valid XML"),
    ],
)
def test_bad_input_ends_in_one_sentence_and_two(tmp_path, arguments, sentence):
    result = run(*arguments, cwd=tmp_path)
    assert result.returncode == 2
    assert result.stderr.count("\n") == 1
    assert sentence in result.stderr
    assert list(tmp_path.rglob("*.npz")) == []


def test_a_folder_that_cannot_be_written_is_found_before_the_solve(tmp_path):
    blocked = tmp_path / "file"
    blocked.write_text("in the way")
    result = run("solve", "take-off", "--output", blocked / "results")
    assert result.returncode == 2
    assert "cannot write to the folder" in result.stderr
    assert result.stdout == ""


def test_a_picture_of_an_unknown_kind_is_refused(file, tmp_path):
    result = run("plot", file, "--output", tmp_path / "forces.bmp")
    assert result.returncode == 2
    assert "is no .png, .svg or .pdf" in result.stderr


def test_a_simulation_says_how_far_the_plan_got_and_writes_what_happened(file, tmp_path):
    pytest.importorskip("mujoco")
    result = run("simulate", file, "--output", tmp_path / "new" / "simulated.npz")
    assert result.returncode == 1  # a motion made by hand, not by dynamics
    assert "inverse dynamics at 100 random states: MuJoCo and RNEA differ by" in result.stdout
    assert "the robot fell at" in result.stdout
    assert Trajectory.load(tmp_path / "new" / "simulated.npz").scenario == "take-off & hover in MuJoCo"


def test_a_simulation_is_written_only_to_a_trajectory_file(file, tmp_path):
    result = run("simulate", file, "--output", tmp_path / "simulated.html")
    assert (result.returncode, result.stderr) == (2, f"error: '{tmp_path / 'simulated.html'}' is no .npz\n")
    result = run("simulate", tmp_path / "none.npz")
    assert result.returncode == 2
    assert "no trajectory file" in result.stderr

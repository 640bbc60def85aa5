"""Every command, with good and bad input, as a person runs it.

Most run in this process. Those whose claim is of a process, or of its imports, run in one of their own.
"""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from commands import run, run_process
from multimodal_to import scenario_files, scenarios
from multimodal_to.cli.expectation import TYPICAL_ITERATIONS
from multimodal_to.cli.showing import _labels
from multimodal_to.cli.simulating import _fingerprint, _Log, _worst
from multimodal_to.models.terrain import Plane
from multimodal_to.scenarios.data import stored, to_json
from multimodal_to.simulation import Trial
from multimodal_to.trajectory import Trajectory
from multimodal_to.trajectory.derived import largest_torques
from synthetic import take_off as synthetic_take_off


@pytest.fixture(scope="module")
def file(ironcub, tmp_path_factory):
    return synthetic_take_off(ironcub).save(tmp_path_factory.mktemp("cli") / "trajectory.npz")


@pytest.fixture(scope="module")
def stopped(tmp_path_factory, once):
    """A solve that is given three iterations: too few for an answer."""

    def made():
        folder = tmp_path_factory.mktemp("stopped") / "new" / "folder"
        return folder, run_process("solve", "take-off", "--output", folder, "--max-iterations", 3)

    return once("stopped", made)


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


def test_the_torques_of_a_trajectory_are_shown_with_their_limits(ironcub, file):
    shown = run("show", file, "--torques")
    assert shown.returncode == 0
    head, *rows = shown.stdout.splitlines()
    assert re.split(r"  +", head.strip()) == ["joint", "largest torque [N m]", "at [s]", "effort [N m]", "share"]
    assert {row.split()[0] for row in rows} == set(ironcub.joint_names)
    worst = largest_torques(ironcub, Trajectory.load(file))[0]
    assert rows[0].split()[:2] == [worst.joint, f"{worst.torque:.1f}"]
    assert {row.split()[3] for row in rows} == {"20", "37", "55.5", "60"}


def test_torques_of_a_scenario_are_refused():
    result = run("show", "take-off", "--torques")
    assert result.returncode == 2
    assert "--torques goes with a trajectory file; 'take-off' is no .npz" in result.stderr


def test_a_changed_scenario_is_solved_and_kept_in_the_file(tmp_path):
    (tmp_path / "my_task.toml").write_text(
        'based_on = "take-off"\nknots = 5\ninterval_max = 1.0\n[surface]\nkind = "plane"\nslope = 0.05\n'
    )
    few = ("--max-iterations", 2, "--no-pictures")
    result = run("solve", "my_task.toml", "--set", "final_com_height=0.6", *few, cwd=tmp_path)
    assert "5 knots" in result.stdout
    file = tmp_path / "results" / "my_task" / "trajectory.npz"
    kept = stored(Trajectory.load(file))
    assert kept == replace(
        scenarios.take_off(),
        name="my_task",
        knots=5,
        interval_max=1.0,
        surface=Plane(slope=0.05),
        final_com=(0.0, 0.0, 0.6),
    )
    assert run("show", file).stdout == scenario_files.to_toml(kept)


COMMANDS = (
    "list",
    "show",
    "doctor",
    "solve",
    "reproduce",
    "sweep",
    "plot",
    "replay",
    "report",
    "export",
    "audit",
    "simulate",
    "robot info",
)


def test_help_lists_every_command():
    names = re.findall(r"^  ([a-z]+)  ", run("--help").stdout, re.MULTILINE)
    assert names == list(dict.fromkeys(command.split()[0] for command in COMMANDS))


@pytest.mark.parametrize("command", ["", *COMMANDS, "robot"])
def test_help_is_short_and_each_command_has_an_example(command):
    result = run(*command.split(), "--help", columns=80)
    assert result.returncode == 0
    assert len(result.stdout.splitlines()) < 40
    if command in COMMANDS:
        assert f"Example: multimodal-to {command}" in " ".join(result.stdout.split())


def completions(line, folder):
    """What the shell offers for the last word of a line."""
    words = line.split(" ")
    asked = {"_MULTIMODAL_TO_COMPLETE": "complete_bash", "COMP_WORDS": line, "COMP_CWORD": str(len(words) - 1)}
    result = run(cwd=folder, **asked)
    assert result.stderr == ""
    return result.stdout.split()


@pytest.mark.parametrize(
    ("line", "offered"),
    [
        ("multimodal-to re", ["reproduce", "replay", "report"]),
        ("multimodal-to solve ta", ["take-off", "take-off-and-landing"]),
        ("multimodal-to solve m", ["mine.toml"]),
        ("multimodal-to doctor s", ["step-up", "squat", "step"]),
        ("multimodal-to show j", ["jump", "jump.npz"]),
        ("multimodal-to solve jump --linear-solver m", ["mumps", "ma27", "ma57", "ma77", "ma86", "ma97"]),
        ("multimodal-to reproduce take-off st", ["step-up"]),
        ("multimodal-to plot a.npz --figure m", ["momentum", "margins"]),
        ("multimodal-to export a.npz --to m", ["mat", "mujoco", "motion"]),
        ("multimodal-to robot info i", ["ironcub", "ironcub-mk3"]),
        ("multimodal-to audit a.npz --robot r", ["robots/"]),
    ],
)
def test_the_shell_completes_names_and_files(line, offered, tmp_path):
    for name in ("mine.toml", "mine.npy", "jump.npz"):
        (tmp_path / name).touch()
    (tmp_path / "robots").mkdir()
    assert completions(line, tmp_path) == offered


def test_robot_info_shows_the_tree_and_what_looks_wrong():
    result = run("robot", "info", "ironcub")
    assert result.returncode == 0
    assert "23 moving joints" in result.stdout
    assert "44.742 kg" in result.stdout
    assert "joint 'l_elbow' has the effort limit 50000, which looks like a placeholder" in result.stdout


def test_version_is_printed():
    assert run_process("--version").stdout.startswith("multimodal-to ")


def test_a_solve_writes_trajectory_plot_and_replay_even_without_an_answer(stopped):
    folder, result = stopped
    assert result.returncode == 1
    assert result.stderr == ""
    assert "iteration limit: allow more iterations" in result.stdout
    assert re.search(
        r"^the trajectory is the best iterate, of iteration \d+: not feasible$", result.stdout, re.MULTILINE
    )
    assert re.search(
        r"^not met: \w+ at knot \d+, [\w +-]+, by \S+ \S+ \(\d+ of \d+ rows\)$", result.stdout, re.MULTILINE
    )
    assert sorted(path.name for path in folder.iterdir()) == ["forces.png", "replay.html", "trajectory.npz"]
    assert Trajectory.load(folder / "trajectory.npz").scenario == "take-off"


def test_a_task_that_contradicts_itself_is_explained_by_what_has_to_give_way(tmp_path):
    jump = replace(scenarios.jump(), knots=10, interval_min=0.1, interval_max=0.1, mid_height_min=None, allowances={})
    scenario_files.save(replace(jump, final_com=(0.0, 0.0, 0.70)), tmp_path / "too_high.toml")  # for these legs
    options = ("--force", "--explain", "--max-iterations", 200, "--no-pictures")
    result = run("solve", "too_high.toml", *options, cwd=tmp_path)
    assert result.returncode == 1
    assert "explain: gives way: end: CoM at knot 10, z, by 0.1 m (1 of 3 rows)" in result.stdout
    assert "seldom the cause; `solve --explain`" in result.stdout
    assert re.search(r"^the doctor said: .*reach", result.stdout, re.MULTILINE)


def test_an_unfinished_solve_goes_on_with_its_own_values_alone(stopped):
    unfinished = stopped[0] / "trajectory.npz"
    for arguments in (("jump",), ("take-off", "--set", "knots=20"), ("--set", "final_com_height=0.8")):
        result = run("solve", *arguments, "--resume", unfinished)
        assert (result.returncode, result.stdout) == (2, "")
        assert "is of 'take-off' with other values than asked for; --resume goes on with its own" in result.stderr
    result = run("solve", "--resume", unfinished, "--warm-start", unfinished)
    assert (result.returncode, result.stdout) == (2, "")
    assert "--resume and --warm-start both say what to start from" in result.stderr


def test_a_bare_motion_is_nothing_to_go_on_with(file):
    result = run("solve", "--resume", file)
    assert (result.returncode, result.stdout) == (2, "")
    assert "keeps no scenario to go on with; name one and start from it by --warm-start" in result.stderr


def test_progress_names_iteration_objective_violation_and_time(stopped):
    known = TYPICAL_ITERATIONS["take-off"]
    assert f"take-off took {known} iterations, by which the time left is guessed" in stopped[1].stdout
    assert "time left not known yet   iteration    0   objective" in stopped[1].stdout
    assert "largest violation" in stopped[1].stdout


def test_quiet_prints_nothing(tmp_path):
    few = ("--set", "knots=5", "--set", "interval_max=1.0", "--max-iterations", 1)
    result = run_process("solve", "take-off", *few, "--output", tmp_path, "--quiet")
    assert len(list(tmp_path.iterdir())) == 3
    assert (result.stdout, result.stderr) == ("", "")


def test_a_solve_without_pictures_writes_the_trajectory_alone_and_says_what_factorised(tmp_path):
    few = ("--set", "knots=5", "--set", "interval_max=1.0", "--max-iterations", 1)
    result = run("solve", "take-off", *few, "--linear-solver", "mumps", "--no-pictures", "--output", tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["trajectory.npz"]
    assert re.search(r", built in .* s, linear solver mumps$", result.stdout, re.MULTILINE)
    assert Trajectory.load(tmp_path / "trajectory.npz").solve_record()["linear_solver"] == "mumps"


def test_plot_and_replay_read_a_saved_file(file, tmp_path):
    assert run("plot", file, "--output", tmp_path / "forces.svg").returncode == 0
    assert (tmp_path / "forces.svg").read_text(encoding="utf-8").startswith("<?xml")
    assert run("replay", file, "--html", tmp_path / "page.html").returncode == 0
    assert (tmp_path / "page.html").stat().st_size > 800_000  # the viewer is inside
    assert run("replay", file, "--with", file, "--no-meshes", "--html", tmp_path / "both.html").returncode == 0
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


def test_files_of_one_scenario_are_told_apart_by_what_differs_in_their_paths():
    jump, hover = SimpleNamespace(scenario="jump"), SimpleNamespace(scenario="hover")
    files = [Path(f"results/today/{name}/trajectory.npz") for name in ("a", "b", "hover")]
    assert _labels(files, [jump, jump, hover]) == ["a/trajectory.npz", "b/trajectory.npz", "hover"]
    assert _labels(files[:1] * 2, [jump, jump]) == [str(files[0])] * 2


def test_export_reads_a_saved_file(file, tmp_path):
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
        (("show", "takeoff"), "unknown scenario 'takeoff'; did you mean 'take-off'?"),
        (("show", "none.npz"), "no trajectory file 'none.npz'"),
        (("reproduce", "takeoff"), "unknown scenario 'takeoff'; did you mean 'take-off'?"),
        (("reproduce", "jump", "--published", "none"), "no .npz of a published trajectory in 'none'"),
        (("solve",), "nothing to solve; expected the NAME of a scenario, or --resume FILE"),
        (("solve", "--resume", "none.npz"), "no trajectory file 'none.npz'"),
        (("solve", "none.toml"), "cannot read 'none.toml'"),
        (("solve", "take-off", "--robot", "ironcup"), "unknown robot 'ironcup'; did you mean 'ironcub'?"),
        (("solve", "take-off", "--max-iterations", "0"), "max_iterations is 0; expected a positive number"),
        (("solve", "jump", "--linear-solver", "ma96"), "unknown linear solver 'ma96'; did you mean 'ma"),
        (("solve", "jump", "--linear-solver", "pardisomkl"), "the linear solver 'pardisomkl' cannot be used"),
        (("plot", "none.npz"), "no trajectory file 'none.npz'"),
        (("plot", "none.npz", "--figure", "force"), "unknown figure 'force'; did you mean 'forces'?"),
        (("replay", "none.npz", "--gif", "film.mp4"), "no trajectory file"),
        (("replay", "none.npz"), "no trajectory file 'none.npz'"),
        (("report", "none.npz"), "no trajectory file 'none.npz'"),
        (
            ("solve", "landing", "--set", 'allowances={"slip under loads" = 1.0}'),
            "unknown property to allow more of 'slip under loads'; did you mean 'slip under load'?",
        ),
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


@pytest.mark.parametrize("arguments", [("list", "jump"), ("solve", "jump", "--fast"), ("export", "jump.npz"), ("fly",)])
def test_what_no_command_takes_ends_in_usage_and_two(arguments):
    result = run(*arguments)
    assert (result.returncode, result.stdout) == (2, "")
    assert result.stderr.startswith("Usage: ")


def test_colour_is_for_terminals_only(file):
    assert "\x1b" not in run("audit", file).stdout
    assert "\x1b[1;31mFAILS" in run_process("audit", file, FORCE_COLOR="1", TERM="xterm-256color").stdout


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
    result = run_process("simulate", file, "--output", tmp_path / "new" / "simulated.npz")
    assert result.returncode == 1  # a motion made by hand, not by dynamics
    assert "inverse dynamics at 100 random states: MuJoCo and RNEA differ by" in result.stdout
    assert "the robot fell at" in result.stdout
    assert re.search(r"largest torque asked of \w+: \d+ % of its effort limit, at .* s; clipped for", result.stdout)
    assert Trajectory.load(tmp_path / "new" / "simulated.npz").scenario == "take-off & hover in MuJoCo"


def test_a_simulation_without_torque_limits_says_that_it_did_not_clip(file, tmp_path):
    result = run("simulate", file, "--no-torque-limits", "--output", tmp_path / "simulated.npz")
    assert result.returncode == 1
    assert "; not clipped, beyond it for" in result.stdout


def test_a_simulation_is_written_only_to_a_trajectory_file(file, tmp_path):
    result = run("simulate", file, "--output", tmp_path / "simulated.html")
    assert (result.returncode, result.stderr) == (2, f"error: '{tmp_path / 'simulated.html'}' is no .npz\n")
    result = run("simulate", tmp_path / "none.npz")
    assert result.returncode == 2
    assert "no trajectory file" in result.stderr


def test_a_simulation_as_json_has_a_list_of_trials(file, tmp_path):
    pytest.importorskip("mujoco")
    result = run("simulate", file, "--json", "--output", tmp_path / "one.npz")
    found = json.loads(result.stdout)
    assert found["seed"] is None
    assert found["controller"] == "servos"
    assert [trial["draw"] for trial in found["trials"]] == [None]
    assert {"survived", "com_error_max", "base_error_max", "torque_ratio_max", "touch_down_speed_max"} < set(
        found["trials"][0]
    )


def test_trials_of_other_seeds_are_kept_apart_and_those_of_another_plan_are_forgotten(ironcub, file, tmp_path):
    pytest.importorskip("mujoco")
    plan = Trajectory.load(file)
    trial = Trial(
        number=0,
        survived=False,
        end="fell",
        fell=1.0,
        com_error_max=0.1,
        base_error_max=0.2,
        torque_ratio_max=0.3,
        touch_down_speed_max=0.4,
        control_time=1e-3,
        draw={"friction": 1.1},
    )
    higher = replace(plan, base_position=plan.base_position + 0.1)
    log = tmp_path / "trials.json"
    first, second = (_Log.of(log, ironcub, plan, {"seed": seed}) for seed in (1, 2))
    other = _Log.of(log, ironcub, higher, {"seed": 1})
    first.add(replace(trial, number=3))
    second.add(trial)
    first.add(trial)
    assert first.trials() == {0: trial, 3: replace(trial, number=3)}
    assert second.trials() == {0: trial}
    assert other.trials() == {}
    other.add(trial)
    assert first.trials() == {}
    log.write_text('{"runs": [{"settings": ')
    assert other.trials() == {}


def test_trials_of_a_robot_that_was_changed_are_others(ironcub, file):
    plan = Trajectory.load(file)
    efforts = replace(ironcub.joint_limits, effort=0.9 * ironcub.joint_limits.effort)
    weaker = replace(ironcub, joint_limits=efforts)
    assert _fingerprint(ironcub, plan) == _fingerprint(ironcub, plan)
    assert _fingerprint(weaker, plan) != _fingerprint(ironcub, plan)


def test_the_worst_trial_fell_first_or_else_left_the_plan_farthest():
    def trial(number, fell, error, *, survived=False):
        return SimpleNamespace(number=number, survived=survived, fell=fell, com_error_max=error)

    steady = [trial(0, None, 0.1, survived=True), trial(1, None, 0.2, survived=True)]
    assert _worst(steady).number == 1
    assert _worst([*steady, trial(2, None, 0.3)]).number == 2
    assert _worst([*steady, trial(2, None, 0.3), trial(3, 2.0, 0.1), trial(4, 1.0, 0.1)]).number == 4


def test_an_unknown_controller_is_refused_with_those_that_exist(file, tmp_path):
    result = run("simulate", file, "--controller", "servo", "--output", tmp_path / "none.npz")
    assert result.returncode == 2
    assert "unknown controller 'servo'; did you mean 'servos'? Available: servos, whole-body" in result.stderr


def test_trials_that_were_done_are_not_done_again(file, tmp_path):
    pytest.importorskip("mujoco")
    arguments = ("simulate", file, "--seed", "3", "--jobs", "1", "--output", tmp_path / "worst.npz")
    first = run(*arguments, "--trials", "1")
    assert "0 of 1 trials survive" in first.stdout
    again = run(*arguments, "--trials", "2", "--json")
    found = json.loads(again.stdout)
    assert [trial["number"] for trial in found["trials"]] == [0, 1]
    assert "trial   0" not in again.stderr
    assert "trial   1" in again.stderr
    assert again.returncode == 1


@pytest.fixture(scope="module")
def with_own_terms(ironcub, tmp_path_factory):
    """A file of a problem with terms that the command line does not have."""
    record = json.dumps(
        {"formulation": {"rule": "backward Euler", "own_terms": ["slow_turns"], "left_out": ["posture"]}}
    )
    text = to_json(scenarios.take_off())
    motion = replace(synthetic_take_off(ironcub), solve_json=record, scenario_json=text)
    return motion.save(tmp_path_factory.mktemp("own") / "trajectory.npz")


OWN_TERMS = "terms of its own: slow_turns; left out: posture"


def test_a_solve_with_own_terms_is_gone_on_from_in_its_script_only(with_own_terms):
    result = run("solve", "--resume", with_own_terms)
    assert result.returncode == 2
    assert f"a problem that this command does not have ({OWN_TERMS}); go on from it in the script" in result.stderr


def test_audit_and_show_name_the_terms_that_they_do_not_have(with_own_terms):
    assert f"the problem had {OWN_TERMS}; the audit does not judge these" in run("audit", with_own_terms).stdout
    assert json.loads(run("audit", with_own_terms, "--json").stdout)["formulation"] == OWN_TERMS
    assert run("show", with_own_terms).stdout.startswith(f"# the problem had {OWN_TERMS}; a scenario does not hold")


def test_a_solve_says_its_rule_and_is_gone_on_from_by_it(tmp_path):
    short = ("--set", "knots=20", "--set", "interval_min=0.35", "--set", "interval_max=0.35", "--no-pictures")
    few = ("--max-iterations", 2, "--no-pictures")
    for switch, rule in (((), "leapfrog"), (("--paper",), "backward Euler")):
        folder = tmp_path / rule
        assert run("solve", "landing", *short, *switch, *few[:2], "--output", folder).returncode == 1
        file = folder / "trajectory.npz"
        assert Trajectory.load(file).rule == rule
        assert run("solve", "--resume", file, *few).returncode == 1
        assert Trajectory.load(file).rule == rule
    refused = run("solve", "--resume", tmp_path / "leapfrog" / "trajectory.npz", "--paper")
    assert refused.returncode == 2
    assert "is integrated by leapfrog, and --resume goes on with its own rule; --warm-start starts" in refused.stderr


def test_the_papers_problem_is_solved_with_the_papers_scenario(tmp_path):
    few = ("--max-iterations", 1, "--no-pictures", "--output", tmp_path)
    assert run("solve", "jump", "--paper", *few).returncode == 1
    kept = stored(Trajectory.load(tmp_path / "trajectory.npz"))
    assert kept == scenarios.paper("jump")
    assert (kept.margins, kept.mid_height_min) == (scenarios.Margins.none(), 0.75)
    assert run("solve", "--resume", tmp_path / "trajectory.npz", *few[:3]).returncode == 1

"""Runs beside the paper's figures; what the command solves here in place of the take-off is a squat."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from typer.testing import CliRunner

import multimodal_to as mt
from multimodal_to.cli import app, solving
from multimodal_to.errors import TrajectoryError
from multimodal_to.plotting import FIGURES
from multimodal_to.reporting import report, reproduce
from multimodal_to.reporting.comparison import AUDITS, SOLVES, markdown, table
from multimodal_to.reporting.published import PUBLISHED
from multimodal_to.reporting.reproduce import Run, read_published
from multimodal_to.scenarios.data import stored
from multimodal_to.trajectory import QUANTITIES
from multimodal_to.trajectory.importing import COMPUTED
from synthetic import take_off as synthetic_take_off


@pytest.fixture(scope="module")
def run(ironcub, take_off) -> Run:
    report = mt.audit(ironcub, take_off.trajectory)
    return Run(
        name="take-off",
        robot=ironcub,
        trajectory=take_off.trajectory,
        report=report,
        steps=0,
        executable=True,
        solution=take_off,
        whole_time=99.0,
    )


@pytest.fixture(scope="module")
def bare(ironcub, tmp_path_factory):
    """A folder with the arrays of a motion, as the paper's data can be had."""
    trajectory, folder = synthetic_take_off(ironcub), tmp_path_factory.mktemp("published")
    arrays = {name: getattr(trajectory, name) for name in QUANTITIES if name not in COMPUTED}
    np.savez(folder / "take_off.npz", total_time=trajectory.duration, **arrays)
    return folder


def as_in_paper(run):
    """The run as if it had been that of the paper's problem."""
    return replace(run, executable=False)


def cells(results, label):
    return next(dict(zip(results.titles, row, strict=True)) for row in results.rows if row[0] == label)


def test_the_papers_figures_stand_below_the_run_of_the_papers_problem(run):
    results = table([run, as_in_paper(run)], SOLVES)
    assert [row[0] for row in results.rows] == ["take-off", "take-off, the paper's problem", "take-off, paper"]
    assert [row[0] for row in table([run], SOLVES).rows] == ["take-off"]
    ours, paper = cells(results, "take-off"), cells(results, "take-off, paper")
    assert (ours["status"], ours["iterations"], ours["in all [s]"]) == ("optimal", str(run.solution.iterations), "99.0")
    assert (ours["steps"], ours["thrust / weight"]) == ("0", "1.00")
    assert (paper["status"], paper["iterations"], paper["in the solver [s]"]) == ("acceptable", "2976", "689")
    assert (paper["steps"], paper["in all [s]"]) == ("–", "–")


def test_the_verdict_is_the_audits_and_names_the_allowances_it_used(ironcub, run):
    held = cells(table([run], AUDITS), "take-off")
    assert held["verdict"] == f"all {len(run.report.findings)} hold"
    pushed = replace(run.trajectory, thrust=run.trajectory.thrust * 1.001)
    scenario = mt.scenarios.take_off()
    failed = mt.audit(ironcub, pushed, scenario)
    assert failed.allowances_used == ()
    verdict = cells(table([replace(run, report=failed)], AUDITS), "take-off")["verdict"]
    broken = [finding.name for finding in failed.findings if not finding.holds]
    assert verdict == f"{len(broken)} of {len(failed.findings)} fail"
    allowed = mt.audit(ironcub, pushed, replace(scenario, allowances=dict.fromkeys(broken, 1e3) | {"penetration": 1.0}))
    verdict = cells(table([replace(run, report=allowed)], AUDITS), "take-off")["verdict"]
    assert allowed.holds
    assert allowed.allowances_used == tuple(broken)  # not the one that was not needed
    assert verdict.startswith(f"all {len(failed.findings)} hold, allowed {broken[0]} 1000 ")


def test_published_files_are_audited_as_rows_of_the_same_tables(ironcub, run, bare):
    (published,) = read_published(ironcub, bare)
    assert not published.holds
    results = table([run, as_in_paper(run), published], AUDITS)
    labels = ["take-off", "take-off, the paper's problem", "take-off, paper", "take-off, published file"]
    assert [row[0] for row in results.rows] == labels
    assert "fail" in cells(results, "take-off, published file")["verdict"]
    assert table([published], AUDITS).rows[0][0] == "take-off, published file"


def test_a_folder_without_published_files_is_refused(ironcub, tmp_path):
    with pytest.raises(TrajectoryError, match=r"no \.npz"):
        read_published(ironcub, tmp_path)


def test_every_published_figure_is_of_a_bundled_scenario():
    assert {published.scenario for published in PUBLISHED} <= set(mt.scenarios.SCENARIOS)


def test_a_row_of_which_nothing_is_known_is_left_out(run):
    jump = as_in_paper(replace(run, name="jump"))  # of the paper's jump only the solver's figures are known
    assert [row[0] for row in table([jump], SOLVES).rows] == ["jump, the paper's problem", "jump, paper"]
    assert [row[0] for row in table([jump], AUDITS).rows] == ["jump, the paper's problem"]


def test_the_markdown_has_rows_of_equal_length(run):
    lines = [line for line in markdown([as_in_paper(run)]).splitlines() if line.startswith("|")]
    assert len(lines) == 2 * (2 + 2)
    assert {line.count("|") for line in lines} == {len(SOLVES) + 2}
    assert len(SOLVES) == len(AUDITS)


def test_the_command_solves_writes_and_leaves_with_zero_when_all_holds(ironcub, tmp_path, monkeypatch, bare):
    short = replace(
        mt.scenarios.take_off(),
        knots=6,
        interval_min=0.2,
        interval_max=0.2,
        final_com=(0.0, 0.0, 0.54),
        terminal=mt.Terminal.STANDING,
        jets=False,
    )
    monkeypatch.setattr(solving, "find", {"take-off": short}.__getitem__)
    plain = replace(short, margins=mt.scenarios.Margins.none())
    monkeypatch.setattr(solving, "as_in_paper", {"take-off": plain}.__getitem__)
    for module in (report, reproduce):  # two of the figures, which test_report.py has all of
        monkeypatch.setattr(module, "FIGURES", {name: FIGURES[name] for name in ("forces", "com")})
    arguments = ["reproduce", "take-off", "--output", str(tmp_path), "--published", str(bare)]
    result = CliRunner().invoke(app, arguments, env={"COLUMNS": "200"})
    assert result.exit_code == 0, result.output
    names = {path.name for path in tmp_path.glob("take-off/*")}
    assert names == {"trajectory.npz", "report.html", "forces.png", "com.png"}
    written = (tmp_path / "table.md").read_text(encoding="utf-8")
    assert {path.name for path in tmp_path.glob("take-off-paper/*")} == names
    assert "| take-off | optimal |" in written
    assert "| take-off, the paper's problem | optimal |" in written
    assert "| take-off, paper | acceptable | 2976 | 689 |" in written
    assert "| take-off, published file | – |" in written
    assert f"wrote {tmp_path / 'table.md'}" in result.output.replace("\n", "")
    trajectory = mt.Trajectory.load(tmp_path / "take-off" / "trajectory.npz")
    assert mt.audit(ironcub.with_jets(trajectory.jet_names), trajectory).holds
    assert trajectory.rule == "leapfrog"
    paper = mt.Trajectory.load(tmp_path / "take-off-paper" / "trajectory.npz")
    assert (paper.rule, stored(paper)) == ("backward Euler", plain)

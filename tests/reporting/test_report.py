from __future__ import annotations

import re
from dataclasses import replace

import pytest

from commands import run_process
from multimodal_to import scenarios
from multimodal_to.auditing.audit import audit
from multimodal_to.plotting import FIGURES
from multimodal_to.replay.browser import find_browser, open_browser
from multimodal_to.reporting import report
from multimodal_to.reporting.report import write_report
from multimodal_to.scenarios.data import to_json
from multimodal_to.solving.record import Kind
from multimodal_to.solving.record import to_json as record_json
from synthetic import take_off


@pytest.fixture(scope="module")
def trajectory(ironcub):
    return replace(take_off(ironcub), scenario_json=to_json(scenarios.take_off()))


@pytest.fixture(scope="module")
def page(trajectory, tmp_path_factory, once):
    """The report as the command writes it of a saved file."""
    folder = tmp_path_factory.mktemp("report")

    def made():
        file = trajectory.save(folder / "trajectory.npz")
        ended = run_process("report", file, "--output", folder / "made.html", "--no-meshes")
        assert (ended.returncode, ended.stderr) == (0, "")
        return (folder / "made.html").read_text(encoding="utf-8")

    path = folder / "report.html"
    path.write_text(once("report", made), encoding="utf-8")
    return path


@pytest.fixture
def one_figure(monkeypatch):
    """Reports have one figure, for tests that look at the rest."""
    monkeypatch.setattr(report, "FIGURES", {"com": FIGURES["com"]})


def test_the_report_says_what_the_audit_says(page, ironcub, trajectory):
    text, judged = page.read_text(encoding="utf-8"), audit(ironcub, trajectory)
    failed = [finding.name for finding in judged.findings if not finding.holds]
    assert 300_000 < page.stat().st_size < 1_000_000  # the viewer is inside, and all is packed; meshes add 1.5 MB
    assert f"{len(failed)} of {len(judged.findings)} properties fail" in text
    assert text.count('<td class="fails">') == len(failed)
    assert text.count("<figure") == len(FIGURES)
    assert "44.74 kg" in text
    assert 'terminal = "hover"' in text


@pytest.mark.usefixtures("one_figure")
def test_the_report_says_how_it_was_solved(ironcub, trajectory, tmp_path):
    record = record_json(
        kind=Kind.ANSWER,
        status="optimal",
        message="Solve_Succeeded",
        iterations=94,
        solve_time=34.25,
        objective=2.7e6,
        costs={"thrust": 1.5e6, "com_velocity": 1.2e6},
        violations={"friction": 2e-9, "sliding": float("nan")},
        versions={"casadi": "9.9.9"},
        threads={"blas": 1, "cores": None},
        linear_solver="mumps",
    )
    solved = replace(trajectory, solve_json=record)
    text = write_report(ironcub, solved, tmp_path / "r.html", meshes=False).read_text(encoding="utf-8")
    assert "<th>solver</th><td>optimal · Solve_Succeeded, 34.2 s</td>" in text
    rows = dict(re.findall(r"<tr><th>([^<]+)</th><td>([^<]+)</td></tr>", text.split("<h2>Solve</h2>")[1]))
    assert rows == {
        "status": "optimal · Solve_Succeeded",
        "iterations": "94",
        "time in the solver": "34.2 s",
        "objective": "2.7e+06",
        "largest costs": "thrust 1.5e+06, com_velocity 1.2e+06",
        "largest violation": "2.0e-09 (friction)",
        "linear solver": "mumps",
        "threads": "blas 1",
        "solved with": "casadi 9.9.9",
    }


@pytest.mark.usefixtures("one_figure")
def test_a_file_without_a_scenario_has_a_report_too(ironcub, tmp_path):
    path = write_report(ironcub, take_off(ironcub), tmp_path / "report.html", meshes=False)
    text = path.read_text(encoding="utf-8")
    assert "The file keeps no scenario" in text
    assert "The file does not say how it was solved" in text
    assert "<th>solver</th><td>not known</td>" in text
    assert "<h1>take-off &amp; hover · ironcub</h1>" in text
    assert not re.search(r'(src|href)="(?!data:)', text.split("<script>")[0])


@pytest.mark.skipif(find_browser() is None, reason="no Chromium or Chrome is installed")
def test_the_report_plays_without_a_network_and_prints_a_picture_of_the_robot(page):
    with open_browser((1000, 800)) as browser:
        browser.open(page)
        images = "[...document.querySelectorAll('figure img')]"
        unpacked = f"while ({images}.some(image => !image.src)) {{ await new Promise(go => setTimeout(go, 20)); }}"
        shown = f"(await Promise.all({images}.map(image => image.decode()))).length"
        decoded = f"(async () => {{ {unpacked} return {shown}; }})()"
        assert browser.evaluate(decoded) == len(FIGURES)
        browser.evaluate("replay.show(1.5)")
        assert browser.evaluate("Number(document.querySelector('.time').value)") == 1.5
        width = browser.evaluate("replay.viewer.renderer.domElement.width")
        height = browser.evaluate("document.querySelector('.motion').clientHeight")
        assert width > 600
        assert height == 600
        browser.call("Page.printToPDF")
        assert browser.evaluate("document.querySelector('.picture').getAttribute('src').length") > 10_000
        assert browser.errors == []
        fetched = [address for address in browser.requests if not address.startswith(("data:", "blob:"))]
        assert [address.partition(":")[0] for address in fetched] == ["file"]

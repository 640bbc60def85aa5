from __future__ import annotations

import re
from dataclasses import replace

import pytest

from multimodal_to import scenarios
from multimodal_to.audit import audit
from multimodal_to.ocp.scenario_data import to_json
from multimodal_to.plotting import FIGURES
from multimodal_to.replay.browser import find_browser, open_browser
from multimodal_to.report import write_report
from synthetic import take_off


@pytest.fixture(scope="module")
def trajectory(ironcub):
    return replace(take_off(ironcub), scenario_json=to_json(scenarios.take_off()))


@pytest.fixture(scope="module")
def page(ironcub, trajectory, tmp_path_factory):
    return write_report(ironcub, trajectory, tmp_path_factory.mktemp("report") / "report.html", meshes=False)


def test_the_report_says_what_the_audit_says(page, ironcub, trajectory):
    text, report = page.read_text(encoding="utf-8"), audit(ironcub, trajectory)
    failed = [finding.name for finding in report.findings if not finding.holds]
    assert f"{len(failed)} of {len(report.findings)} properties fail" in text
    assert text.count('<td class="fails">') == len(failed)
    assert text.count("<figure") == len(FIGURES)
    assert "44.74 kg" in text
    assert 'terminal = "hover"' in text


def test_a_file_without_a_scenario_has_a_report_too(ironcub, tmp_path):
    path = write_report(ironcub, take_off(ironcub), tmp_path / "report.html", meshes=False)
    text = path.read_text(encoding="utf-8")
    assert "The file keeps no scenario" in text
    assert "<h1>take-off &amp; hover · ironcub</h1>" in text
    assert not re.search(r'(src|href)="(?!data:)', text.split("<script>")[0])


@pytest.mark.skipif(find_browser() is None, reason="no Chromium or Chrome is installed")
def test_the_report_plays_without_a_network_and_prints_a_picture_of_the_robot(page):
    with open_browser((1000, 800)) as browser:
        browser.open(page)
        images = "[...document.querySelectorAll('figure img')]"
        decoded = f"Promise.all({images}.map(image => image.decode())).then(all => all.length)"
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
        assert [address.partition(":")[0] for address in browser.requests if not address.startswith("data:")] == [
            "file"
        ]

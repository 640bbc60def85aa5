"""The guess of how long a solve may still take."""

from __future__ import annotations

import io
import re
from dataclasses import replace
from pathlib import Path

import pytest
from rich.console import Console

from multimodal_to import scenarios
from multimodal_to.cli.expectation import TYPICAL_ITERATIONS, Expectation, Rest, expect
from multimodal_to.cli.progress import Progress
from multimodal_to.solving import Iterate

README = Path(__file__).parents[2] / "README.md"


def test_what_is_expected_of_the_bundled_scenarios_is_about_what_they_took():
    rows = re.findall(r"^\| ([\w-]+) \| optimal \| (\d+) \|", README.read_text(encoding="utf-8"), re.MULTILINE)
    took = {name: int(iterations) for name, iterations in rows}
    assert set(took) == set(TYPICAL_ITERATIONS) == set(scenarios.SCENARIOS)
    for name, iterations in took.items():
        assert TYPICAL_ITERATIONS[name] == pytest.approx(iterations, rel=0.5)


def test_a_scenario_of_ones_own_is_expected_to_be_like_the_slowest_of_its_kind():
    mine = replace(scenarios.landing(), name="mine", final_com=(0.0, 0.1, 0.57))
    assert expect(mine) == Expectation(iterations=TYPICAL_ITERATIONS["step-up"], like="step-up")
    assert expect(replace(scenarios.walk_to_fly(), name="mine")).like == "walk-to-fly"
    assert expect(replace(scenarios.landing(), name="mine", jets=False)) is None


def test_the_time_left_goes_by_the_pace_of_the_last_iterations():
    rest = Rest(Expectation(iterations=40, like="x"))
    answers = [rest.after(iteration, 0.1 * iteration) for iteration in range(20)]
    assert answers[0] == "time left not known yet"
    assert answers[19] == "perhaps 2 s left"
    for iteration in range(20, 33):
        slower = rest.after(iteration, 2.0 + 0.5 * (iteration - 20))
    assert slower == "perhaps 4 s left"
    assert rest.after(40, 12.0) == "longer than x"


def test_the_progress_line_says_the_time_left_where_something_is_expected():
    def line(expectation):
        text = io.StringIO()
        progress = Progress(Console(file=text, width=200), expectation)
        progress(Iterate(iteration=0, objective=1.0, worst="rows", violation=2.0, unit="m", elapsed=0.0))
        return text.getvalue()

    assert "time left not known yet   iteration    0" in line(Expectation(iterations=40, like="x"))
    assert "left" not in line(None)

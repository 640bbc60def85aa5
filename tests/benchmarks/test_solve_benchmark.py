"""The benchmark of solves in benchmarks/, on a few knots."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

import multimodal_to as mt
import solve
from multimodal_to.scenarios.files import to_toml
from pages import put

PAGE = Path(__file__).parents[2] / "docs" / "performance.md"


@pytest.fixture(scope="module")
def squat(tmp_path_factory) -> str:
    """A file with a scenario that is solved fast: the CoM goes down while the robot stands."""
    scenario = replace(
        mt.scenarios.jump(),
        name="squat",
        knots=6,
        mid_height_min=None,
        final_com=(0.0, 0.0, 0.54),
        interval_min=0.1,
        interval_max=0.2,
        allowances={},
    )
    file = tmp_path_factory.mktemp("benchmark") / "squat.toml"
    file.write_text(to_toml(scenario), encoding="utf-8")
    return str(file)


@pytest.fixture(scope="module")
def figures(squat) -> solve.Figures:
    return solve.library(squat)


def test_the_first_and_the_warm_solve_end_in_answers(figures):
    assert figures["status"] == figures["warm status"] == "optimal"
    assert 0 < figures["warm iterations"] < figures["iterations"]
    assert figures["warm objective"] != figures["objective"]  # the target is another one


def test_the_parts_of_an_iteration_add_up_to_its_time(figures):
    parts = [figures[f"iteration, {kind} [ms]"] for kind in (*solve.KINDS, "linear algebra and rest")]
    assert all(part > 0 for part in parts)
    assert sum(parts) == pytest.approx(figures["iteration, whole [ms]"])
    assert figures["iteration, whole [ms]"] * figures["iterations"] < 1.5e3 * figures["first solve [s]"]


def test_the_target_that_is_higher_is_the_one_the_scenario_asks_for():
    jump, take_off = mt.scenarios.jump(), mt.scenarios.take_off()
    assert solve.higher(jump) == replace(jump, mid_height_min=jump.mid_height_min + 0.02)
    assert solve.higher(take_off).final_com[2] == pytest.approx(take_off.final_com[2] + 0.02)


def test_a_median_of_numbers_is_one_and_words_are_all_kept():
    runs = [{"time": time, "status": status} for time, status in ((3.0, "optimal"), (1.0, "failed"), (2.0, "optimal"))]
    assert solve.medians(runs) == {"time": 2.0, "status": "optimal, failed"}


def test_the_table_goes_between_the_marks_of_the_page(tmp_path):
    copy = tmp_path / "page.md"
    copy.write_text(PAGE.read_text(encoding="utf-8"), encoding="utf-8")
    text = solve.table(["a", "b"], [{"iterations": 94.0, "build [s]": 0.12345}, {"iterations": 7.0}])
    assert text == "|  | a | b |\n| -- | -- | -- |\n| iterations | 94 | 7 |\n| build [s] | 0.123 | – |\n"
    for _ in range(2):  # the second time it takes the place of the first
        put(copy, "solve", text)
    written = copy.read_text(encoding="utf-8")
    assert written.count("| iterations | 94 | 7 |") == 1
    assert written.startswith("# Performance")
    assert "## What it is compared with" in written
    (tmp_path / "other.md").write_text("no marks", encoding="utf-8")
    with pytest.raises(SystemExit, match="lacks the marks"):
        put(tmp_path / "other.md", "solve", text)


def test_another_grid_lasts_as_long():
    scenario = mt.scenarios.take_off()
    finer = solve.on_grid(scenario, 280)
    assert finer.knots == 280
    for name in ("interval_min", "interval_max"):
        assert finer.knots * getattr(finer, name) == pytest.approx(scenario.knots * getattr(scenario, name))


def test_growth_times_the_iterations_of_a_grid(monkeypatch):
    monkeypatch.setattr(solve, "GROWTH_ITERATIONS", 22)
    figures = solve.growth("3")
    assert figures["iteration, whole [ms]"] > figures["iteration, Hessian [ms]"] > 0
    assert figures["peak memory [MB]"] > 50

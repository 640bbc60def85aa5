"""The code on the pages of the documentation does what the pages say."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PAGES = [ROOT / "docs/get-started.md", *sorted((ROOT / "docs/tutorials").glob("*.md"))]
FENCE = re.compile(r'^```(\w+)(?: title="([^"\n]+)")?\n(.*?)^```$', re.MULTILINE | re.DOTALL)


def blocks(page: Path) -> list[tuple[str, str, str]]:
    """Language, title and text of a page's fences; one with a title is a file of that name."""
    return FENCE.findall(page.read_text(encoding="utf-8"))


def write_files(page: Path, folder: Path) -> None:
    for _, title, text in blocks(page):
        if title:
            target = folder / title
            target.parent.mkdir(parents=True, exist_ok=True)
            target.write_text(text, encoding="utf-8")


@pytest.mark.parametrize("page", PAGES, ids=[page.stem for page in PAGES])
def test_the_code_of_a_page_runs_from_top_to_bottom(page, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    write_files(page, tmp_path)
    code = [text for language, title, text in blocks(page) if language == "python" and not title]
    assert code or page.stem == "own-cost"
    exec(compile("\n".join(code), str(page), "exec"), {"__name__": page.stem})


@pytest.mark.skipif(shutil.which("git") is None, reason="the page applies its patch with git")
def test_the_patch_of_the_cost_page_adds_the_cost(tmp_path):
    write_files(ROOT / "docs/tutorials/own-cost.md", tmp_path)
    shutil.copytree(ROOT / "src", tmp_path / "src", ignore=shutil.ignore_patterns("__pycache__"))
    (tmp_path / "robots").symlink_to(ROOT / "robots")
    subprocess.run(["git", "apply", "slow_turns.patch"], cwd=tmp_path, check=True)
    environment = os.environ | {"PYTHONPATH": str(tmp_path / "src")}
    result = subprocess.run(
        [sys.executable, "slow_turns.py"], cwd=tmp_path, env=environment, capture_output=True, text=True, check=False
    )
    assert result.returncode == 0, result.stderr
    (plain, as_it_was, *not_charged), (charged, slower, _, cost) = (line.split() for line in result.stdout.splitlines())
    assert plain == charged == "optimal"
    assert not_charged[1:] == ["not", "charged"]
    assert float(slower) < float(as_it_was)
    assert float(cost) > 0


@pytest.mark.parametrize("page", sorted(ROOT.glob("docs/**/*.md")), ids=lambda page: page.stem)
def test_every_page_is_in_the_navigation(page):
    assert f": {page.relative_to(ROOT / 'docs').as_posix()}\n" in (ROOT / "mkdocs.yml").read_text(encoding="utf-8")

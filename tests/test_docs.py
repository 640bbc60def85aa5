"""The code on the pages of the documentation does what the pages say."""

from __future__ import annotations

import re
import sys
import tomllib
from dataclasses import fields, replace
from pathlib import Path

import pytest

import multimodal_to as mt
from multimodal_to.adam.urdf import LARGEST_URDF
from multimodal_to.auditing import PROPERTIES
from multimodal_to.files.reading import LARGEST_TOML
from multimodal_to.models.joint_units import either
from multimodal_to.models.terrain import SURFACES
from multimodal_to.ocp import keyframes
from multimodal_to.replay.meshes import LARGEST_MESH
from multimodal_to.trajectory import ENTRIES, FORMATS, QUANTITIES, archive
from test_layering import FLOORS

ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(ROOT / "docs"))  # the tables of the reference pages are made there
import references  # noqa: E402

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
    assert code
    exec(compile("\n".join(code), str(page), "exec", dont_inherit=True), {"__name__": page.stem})


@pytest.mark.parametrize("page", sorted(ROOT.glob("docs/**/*.md")), ids=lambda page: page.stem)
def test_every_page_is_in_the_navigation(page):
    assert f": {page.relative_to(ROOT / 'docs').as_posix()}\n" in (ROOT / "mkdocs.yml").read_text(encoding="utf-8")


# ------------------------------------------------------------------------------------------ references from the code


def filled(page: str) -> str:
    return references.fill((ROOT / "docs" / page).read_text(encoding="utf-8"))


def test_every_quantity_entry_and_version_of_the_file_is_on_its_page():
    text = filled("reference/trajectory.md")
    for name, quantity in QUANTITIES.items():
        row = next(line for line in text.splitlines() if line.startswith(f"| `{name}` |"))
        unit = either(quantity.unit) if quantity.of == "joint" else quantity.unit
        assert f"| {unit} |" in row
    assert all(f"| `{name}` |" in text for name in ENTRIES)
    assert all(f"\n| {version} | " in text for version in FORMATS)
    assert f"versions {min(FORMATS)} to {max(FORMATS)}" in filled("files.md")


def test_every_key_of_the_record_of_a_solve_is_on_its_page(take_off):
    text = filled("reference/trajectory.md")
    assert [key for key in take_off.trajectory.solve_record() if f"`{key}`" not in text] == []


def test_every_property_of_the_audit_is_on_its_page_with_the_limit_that_judges(ironcub, take_off):
    text = filled("reference/audit.md")
    for finding in mt.audit(ironcub, take_off.trajectory).findings:
        row = next(line for line in text.splitlines() if line.startswith(f"| `{finding.name}` |"))
        entry = PROPERTIES[finding.name]
        asked = 0.0 if entry.margin is None else getattr(mt.scenarios.take_off().margins, entry.margin)
        stated = f"{finding.limit / entry.of.size(ironcub) - asked:g} {entry.counted_in}".removesuffix(" 1")
        assert (f" `margins.{entry.margin}` + {stated}" if asked else f" {stated}") in row
        assert entry.reason in row
    assert all(f"| `{name}` |" in text for name in PROPERTIES)


def test_every_limit_of_a_file_is_the_one_that_its_reader_has():
    text = filled("files.md")
    for size in (archive.LARGEST_ARCHIVE, archive.LARGEST_CONTENT, LARGEST_TOML, LARGEST_URDF, LARGEST_MESH):
        assert f"{size / 1e6:.0f} MB" in text


def test_every_room_is_in_the_picture_and_in_the_table():
    text = filled("built.md")
    for room in set().union(*FLOORS) - {"__init__", "__main__"}:
        assert f">{room}</text>" in text
        assert f"| `{room}` | " in text


def test_a_table_that_does_not_exist_is_an_error():
    with pytest.raises(KeyError):
        references.fill("<!-- from the code: nothing -->")


def test_the_result_tables_of_readme_and_of_their_page_agree():
    def between_marks(page: str) -> str:
        return (ROOT / page).read_text(encoding="utf-8").split("results: begin -->\n")[1].split("<!-- results: end")[0]

    assert between_marks("docs/results.md").startswith(between_marks("README.md"))


@pytest.mark.parametrize("page", ["README.md", "CONTRIBUTING.md"])
def test_every_file_that_a_page_of_the_project_links_to_exists(page):
    links = re.findall(r"\]\(([^)#:]+)(?:#[^)]*)?\)", (ROOT / page).read_text(encoding="utf-8"))
    assert [link for link in links if not (ROOT / link).exists()] == []


def test_the_files_that_the_pages_name_exist():
    """Of code spans such as `ocp/terms.py`, which stand for files under src/multimodal_to/ or the project's folder."""
    missing = []
    for page in [*ROOT.glob("docs/**/*.md"), ROOT / "README.md", ROOT / "CONTRIBUTING.md"]:
        for name in re.findall(r"`((?:[\w-]+/)+[\w-]+\.(?:py|md|toml|ipynb))`", page.read_text(encoding="utf-8")):
            places = (ROOT, ROOT / "src/multimodal_to", ROOT / "docs")
            if not any((place / name).exists() for place in places) and not name.startswith(("hopper/", "results/")):
                missing.append(f"{page.name}: {name}")
    assert missing == []


def test_every_term_of_the_paper_is_on_its_page_with_its_formula():
    text = filled("reference/terms.md")
    for term in mt.Formulation.paper().terms:
        row = next(line for line in text.splitlines() if line.startswith(f"| `{term.name}` |"))
        assert term.formula.split("\n")[0].removesuffix(".").replace("|", r"\|") in row
        assert all(place.value in row for place in term.places)


def test_every_field_of_a_scenario_is_on_its_page():
    text = filled("reference/scenario.md")
    prefixes = {
        "": mt.Scenario,
        "weights.": mt.Weights,
        "keyframes[].": mt.Keyframe,
        "keyframes[].frames.<name>.": mt.FrameTarget,
        "keyframes[].momentum.": mt.Momentum,
    }
    names = [prefix + entry.name for prefix, kind in prefixes.items() for entry in fields(kind)]
    assert [name for name in names if f"| `{name}` | " not in text] == []
    assert f"one of {', '.join(SURFACES)}" in text


def test_every_residual_of_a_keyframe_is_on_its_page_with_its_formula():
    text = filled("reference/scenario.md")
    known = [one for name, one in vars(keyframes).items() if name.startswith("off_")]
    assert len(known) == 9
    for function in known:
        assert function.__doc__.split("\n")[0].rstrip(".") in text


def test_every_key_of_the_bundled_robots_file_is_on_its_page():
    text = filled("reference/robot.md")

    with (ROOT / "robots/ironcub/robot.toml").open("rb") as stream:
        written = tomllib.load(stream)
    tables = {
        "": written,
        "home.": written["home"],
        "contact.": written["contact"],
        "joints.<name>.": next(iter(written["joints"].values())),
        "jet[].": written["jet"][0],
        "jet_models.<name>.": next(iter(written["jet_models"].values())),
    }
    names = [prefix + key for prefix, some in tables.items() for key in some]
    assert [name for name in names if f"| `{name}` | " not in text] == []


# ------------------------------------------------------------------------------------------ it does not converge


def test_the_page_on_convergence_quotes_the_doctor_and_knows_every_status_and_term(ironcub):
    text = (ROOT / "docs/not-converging.md").read_text(encoding="utf-8")
    diagnosis = mt.doctor(ironcub, replace(mt.scenarios.take_off(), knots=30))
    assert f"```text\nerror: {diagnosis.findings[0]}\n```" in text
    rows = [line for line in text.splitlines() if line.startswith("| `")]
    assert [status.value for status in mt.Status if not any(f"`{status.value}`" in row for row in rows)] == []
    terms = {term.name for term in mt.Formulation.paper().terms}
    quoted = re.findall(r"(?:not met|gives way): (\w+) at knot", text)
    assert quoted
    assert set(quoted) <= terms

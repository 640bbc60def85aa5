"""Files of others are data only, within limits; ours appear whole or not at all."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest

from multimodal_to import scenario_files, scenarios
from multimodal_to.errors import LONGEST, ModelError, MultimodalError, OutputError, listed, shown, unknown
from multimodal_to.files.reading import LARGEST_TOML, parse_toml, read_bytes, read_toml
from multimodal_to.files.writing import whole, write_text
from multimodal_to.models.loading import bundled_robots
from multimodal_to.replay.dress import read_dress
from synthetic import take_off as synthetic_take_off


def test_an_error_is_one_line_that_no_terminal_obeys_and_no_screen_overflows():
    assert str(MultimodalError("a\nb\x1b[2J ẋ → λ")) == "a\\nb\\x1b[2J ẋ → λ"
    assert len(str(MultimodalError("x" * 10**6))) <= LONGEST + 3


def test_values_and_names_are_short_in_errors():
    assert shown({"a": [1, 2.5, "x"]}) == "{'a': [1, 2.5, 'x']}"
    assert len(shown([["x" * 10**5] * 10**4])) < 1000
    assert shown(1 << 40000) == "a number of thousands of digits"
    assert listed([]) == "none"
    assert len(unknown("key", "a" * 10**5, [f"{index:0100}" for index in range(10**4)])) < 10**4


@pytest.mark.parametrize(
    "text",
    ["a=" + "[" * 10**5, "a=" + "{a=" * 10**5, "a." * 10**5 + "a=1", "'a' . " * 50 + "a=1", "a=" + "9" * 5000],
    ids=["lists", "tables", "key", "quoted key", "digits"],
)
def test_toml_beyond_what_python_holds_is_a_value_error(text):
    with pytest.raises(ValueError, match=r"nested too deep|32 parts|digits"):
        parse_toml(text)


def test_only_regular_files_within_the_limit_are_read(tmp_path):
    (tmp_path / "full").write_bytes(b"x" * 100)
    assert read_bytes(tmp_path / "full", 100, ModelError) == b"x" * 100
    for path, says in (
        (tmp_path / "full", "larger than 9.9e-05 MB"),
        (tmp_path, "it is a folder"),
        (Path("/dev/zero"), "no regular file"),
        (tmp_path / "none", "No such file"),
        (tmp_path / ("x" * 5000), "name too long"),
        ("a\0b", "null"),
    ):
        with pytest.raises(ModelError, match=says):
            read_bytes(path, 99, ModelError)
    (tmp_path / "big.toml").write_text("#" * (LARGEST_TOML + 1))
    with pytest.raises(ModelError, match="larger than 1 MB"):
        read_toml(tmp_path / "big.toml", ModelError)


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ('package = "icub-models"', "package = 3", "'package' is 3; expected a text"),
        ('root = "root_link"', "", "the dress lacks 'root'"),
        ("kept = [", "kpt = []\nkept = [", "unknown key 'kpt'; did you mean 'kept'?"),
        ("[[garment]]", "[[garment]]\ncolour = 1", "unknown key 'garment[0].colour'"),
        ("[[garment]]", "[[garment]]\nrgba = [1, 0, nan, 1]", "'garment[0].rgba[2]' is nan; expected a finite number"),
    ],
)
def test_a_broken_dress_says_what_is_wrong(tmp_path, old, new, says):
    shutil.copy(bundled_robots()["ironcub"] / "dress.toml", tmp_path)
    path = tmp_path / "dress.toml"
    text = path.read_text(encoding="utf-8")
    assert old in text
    path.write_text(text.replace(old, new, 1), encoding="utf-8")
    with pytest.raises(ModelError) as error:
        read_dress(tmp_path)
    assert says in str(error.value)
    assert str(path) in str(error.value)


def test_what_a_dress_says_of_its_makers_formats_nothing(tmp_path):
    text = (bundled_robots()["ironcub"] / "dress.toml").read_text(encoding="utf-8")
    (tmp_path / "dress.toml").write_text(text.replace("{version}", "{version} {version.__class__:>99999999999}"))
    dress = read_dress(tmp_path)
    assert dress is not None
    assert "{version.__class__:>99999999999}" in dress.attribution


def test_a_file_that_is_not_finished_leaves_the_old_one_and_nothing_else(ironcub, tmp_path, monkeypatch):
    trajectory, scenario = synthetic_take_off(ironcub), scenarios.take_off()
    saves = {
        "motion.npz": lambda path: trajectory.save(path),
        "task.toml": lambda path: scenario_files.save(scenario, path),
        "table.md": lambda path: write_text(path, "text"),
    }
    before = {name: save(tmp_path / name).read_bytes() for name, save in saves.items()}

    def interrupted(target, *arguments, **others):
        (target.write if hasattr(target, "write") else target.write_bytes)(b"half")
        raise KeyboardInterrupt

    monkeypatch.setattr(np, "savez_compressed", interrupted)
    monkeypatch.setattr(Path, "write_text", interrupted)
    for name, save in saves.items():
        with pytest.raises(KeyboardInterrupt):
            save(tmp_path / name)
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == before


def test_what_cannot_be_written_is_named(tmp_path):
    for path, says in (
        (tmp_path / "none" / "a.txt", "No such file"),
        (tmp_path, "directory"),
        (tmp_path / ("x" * 5000), "name too long"),
        (tmp_path / "a\0b", "null"),
    ):
        with pytest.raises(OutputError, match=says), whole(path) as draft:
            draft.write_text("")
    assert list(tmp_path.iterdir()) == []

"""The list of a scenario's keys is complete, says something of each, and each of them is read."""

from __future__ import annotations

import re
from dataclasses import replace

import pytest

from multimodal_to import scenarios
from multimodal_to.errors import ScenarioError
from multimodal_to.models.terrain import SURFACES, FlatGround, HeightField, Plane, Stairs
from multimodal_to.scenarios.data import from_dict, to_dict
from multimodal_to.scenarios.files import load
from multimodal_to.scenarios.keys import scenario_keys

KEYS = scenario_keys()
NAMES = {key.name for key in KEYS}
SURFACE = {
    "flat": FlatGround(height=0.1),
    "plane": Plane(slope=0.1),
    "stairs": Stairs(edges=(0.5,), heights=(0.0, 0.1)),
    "height-field": HeightField.sampled(lambda x, y: 0.0, x_range=(0.0, 1.0), y_range=(0.0, 1.0), spacing=0.5),
}


def number(key):
    return "number" in key.kind and not key.kind.startswith("one of")


def test_every_key_says_what_it_means_and_every_number_its_unit():
    for key in KEYS:
        assert key.meaning, key
        assert bool(key.unit) == number(key), key
        assert key.default, key


def test_a_key_stands_once_for_each_place_where_it_may_stand():
    assert len({(key.name, key.where) for key in KEYS}) == len(KEYS)


def written(table, prefix=""):
    for key, value in table.items():
        yield prefix + key
        if isinstance(value, dict) and key not in ("joint_velocities", "allowances"):
            yield from written(value, f"{prefix}{key}.")


@pytest.mark.parametrize("kind", SURFACES)
@pytest.mark.parametrize("name", scenarios.SCENARIOS)
def test_every_key_that_a_complete_file_holds_is_in_the_list(name, kind):
    full = replace(scenarios.find(name), friction=0.4, mid_height_min=0.6, surface=SURFACE[kind])
    names = set(written(to_dict(full)))
    assert {"weights.thrust", "surface.kind", "mid_height_min", "friction"} <= names
    assert names <= NAMES
    of_this_kind = {key.name for key in KEYS if key.where == f"surface.kind = {kind}"}
    assert of_this_kind == {name for name in names if name.startswith("surface.")} - {"surface.kind"}


@pytest.mark.parametrize("key", KEYS, ids=lambda key: f"{key.name} {key.where}".strip())
def test_every_key_of_the_list_is_read(key, tmp_path):
    """A wrong value is refused by the key's own name."""
    wrong = '"x"' if number(key) else "3"
    kind = key.where.removeprefix("surface.kind = ")
    base = 'based_on = "take-off"\n' if key.name != "based_on" else ""
    kind_too = f'surface.kind = "{kind}"\n' if kind else ""
    path, name = tmp_path / "task.toml", key.name.replace("<name>", "some")
    table, _, here = name.rpartition("[].")  # of one of several tables
    head = f"[[{table}]]\n" + "knot = 3\n" * (table == "keyframes" and here not in ("when", "knot")) if table else ""
    path.write_text(f"{base}{kind_too}{head}{here} = {wrong}\n", encoding="utf-8")
    named = re.escape(name.replace("[]", "[0]"))
    said = rf"task.toml: ('{named}'|'{table}.0.': {here}|{named}) is '?(x|3)'?; expected"
    with pytest.raises(ScenarioError, match=said):
        load(path)


REQUIRED = [key for key in KEYS if key.default == "required" and not key.where]
OF_TASKS = [key for key in REQUIRED if "." not in key.name]


@pytest.mark.parametrize("key", OF_TASKS)
def test_a_required_key_is_missed(key):
    table = to_dict(scenarios.take_off())
    del table[key.name]
    with pytest.raises(ScenarioError, match=f"the scenario lacks '{key.name}'"):
        from_dict(table)


def test_all_other_keys_may_be_left_out():
    required = {key.name for key in REQUIRED} | {"initial_com", "final_com", "terminal"}  # keyframes may say these
    table = {name: value for name, value in to_dict(scenarios.take_off()).items() if name in required}
    assert from_dict({**table, "name": "bare", "weights": {}}).knots == scenarios.take_off().knots


def test_defaults_are_those_of_the_reader():
    defaults = {key.name: key.default for key in KEYS if not key.where}
    assert (defaults["com_range"], defaults["base_speed_max"]) == ("none", "none")
    assert (defaults["jets"], defaults["surface"], defaults["friction_cone"]) == ("true", "flat", "pyramid")
    assert (defaults["knots"], defaults["name"], defaults["friction"]) == ("required", "the file's own name", "none")

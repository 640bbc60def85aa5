"""The list of the keys of `robot.toml` is complete, says something of each, and each of them is read."""

from __future__ import annotations

import re
import tomllib

import pytest
import tomli_w

from multimodal_to.errors import ModelError
from multimodal_to.models.loading import bundled_robots, load_robot
from multimodal_to.models.robot_keys import robot_keys

KEYS = robot_keys()
FULL = tomllib.loads((bundled_robots()["ironcub"] / "robot.toml").read_text(encoding="utf-8"))
"""The iRonCub's file, and beside it what only other robots need."""
FULL["frames"] = {"nose": {"link": "head", "position": [0.0, 0.1, 0.0], "rpy": [0.0, 0.5, 0.0]}}
FULL["jet"][0] |= {"thrust_axis": [0.0, 0.0, -1.0], "drag": 0.0}
for name in ("P160", "P220"):
    FULL["jet_models"][name]["kind"] = "second-order"
FULL["jet_models"] |= {
    "fan": {"kind": "first-order", "gain": 2.0, "time_constant": 0.1},
    "rotor": {"kind": "static", "gain": 1.0, "curvature": 0.01},
}
ANY = {"joints": "torso_roll", "jet_models": "P220", "frames": "nose"}
OF_KIND = {"first-order": "fan", "static": "rotor"}


def any_name(key):
    """The name of the joint, frame or jet model that a key is tried with."""
    kind = key.where.rpartition(" = ")[2]
    return OF_KIND.get(kind, ANY.get(key.name.split(".")[0], ""))


def placed(key, table):
    """The table that holds a key, and the key's own name there: of one joint, jet model or jet where there are many."""
    *parents, last = re.sub(r"\[\]", "", key.name).split(".")
    for parent in parents:
        place = table[any_name(key) if parent == "<name>" else parent]
        table = place[0] if isinstance(place, list) else place
    return table, last


def spelled(key):
    """A key's name in an error."""
    return key.name.replace("<name>", any_name(key)).replace("[]", "[0]")


@pytest.fixture
def load_changed(tmp_path):
    def load(table):
        (tmp_path / "ironcub.urdf").write_bytes((bundled_robots()["ironcub"] / "ironcub.urdf").read_bytes())
        (tmp_path / "robot.toml").write_text(tomli_w.dumps(table), encoding="utf-8")
        return load_robot(tmp_path)

    return load


def copy():
    return tomllib.loads(tomli_w.dumps(FULL))


def number(key):
    return "number" in key.kind


def test_every_key_says_what_it_means_and_every_number_its_unit():
    for key in KEYS:
        assert key.meaning, key
        assert bool(key.unit) == number(key), key
        assert key.default, key
    assert len({(key.name, key.where) for key in KEYS}) == len(KEYS)


def leaves(table, prefix=""):
    for name, value in table.items():
        key = f"{prefix}{name}"
        yield key
        if key in ("joint_groups", "contact.feet"):
            continue
        if key in ("joints", "jet_models", "frames"):
            for entry in value.values():
                yield from leaves(entry, f"{key}.<name>.")
        elif isinstance(value, dict):
            yield from leaves(value, f"{key}.")
        elif isinstance(value, list) and value and isinstance(value[0], dict):
            for entry in value:
                yield from leaves(entry, f"{key}[].")


def test_the_list_is_what_the_bundled_file_holds():
    assert set(leaves(FULL)) == {key.name for key in KEYS}


@pytest.mark.parametrize("key", KEYS, ids=lambda key: key.name)
def test_every_key_of_the_list_is_read(key, load_changed):
    """A wrong value is refused by the key's own name."""
    table = copy()
    place, last = placed(key, table)
    place[last] = "x" if number(key) else 3
    with pytest.raises(ModelError, match=rf"'{re.escape(spelled(key))}' is '?(x|3)'?; expected"):
        load_changed(table)


@pytest.mark.parametrize("key", KEYS, ids=lambda key: key.name)
def test_a_key_is_missed_where_it_is_required_and_only_there(key, load_changed):
    table = copy()
    place, last = placed(key, table)
    del place[last]
    if key.default == "required":
        with pytest.raises(ModelError, match=rf"the robot lacks '{re.escape(spelled(key))}'"):
            load_changed(table)
    elif key.name == "joints":  # which the groups name
        with pytest.raises(ModelError, match="joint group 'torso': unknown joint 'torso_pitch'"):
            load_changed(table)
    elif key.name == "jet_models":
        with pytest.raises(ModelError, match="unknown jet model 'P160'"):
            load_changed(table)
    elif key.name in ("capsule", "jet"):  # whose capsules the table `collision` names
        with pytest.raises(ModelError, match=r"'collision.hold_apart': unknown capsule"):
            load_changed(table)
    else:
        assert load_changed(table).name == "ironcub"


def test_a_robot_without_capsules_and_plumes_has_none(load_changed):
    table = copy()
    del table["capsule"], table["collision"]
    for jet in table["jet"]:
        del jet["plume_length"], jet["plume_radius"]
    robot = load_changed(table)
    assert robot.capsules == robot.capsule_pairs == robot.near_capsule_pairs == ()


@pytest.mark.parametrize(("left_out", "length", "radius"), [("plume_length", None, 0.05), ("plume_radius", 0.5, 0.05)])
def test_what_a_plume_does_not_state_follows_from_the_other_and_from_the_size_of_the_robot(
    load_changed, left_out, length, radius
):
    table = copy()
    del table["jet"][0][left_out]
    robot = load_changed(table)
    plume = robot.jets[0].plume
    assert plume.end[2] + plume.radius == pytest.approx(length or robot.standing_height)
    assert plume.radius == pytest.approx(radius)

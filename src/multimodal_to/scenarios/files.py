"""Scenarios as TOML files that a person writes, and changes of single values.

A file holds the fields of a `Scenario` by name, with tables `[weights]` and `[surface]`; with `based_on = "take-off"`
only what differs from that bundled scenario. What `replace` lists is not changed but written anew.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import tomli_w

from multimodal_to.arguments import checked
from multimodal_to.errors import MultimodalError, ScenarioError, shortened, shown, unknown
from multimodal_to.files.numbers import number
from multimodal_to.files.reading import parse_toml, read_toml
from multimodal_to.files.writing import write_text
from multimodal_to.models.loading import bundled_robots
from multimodal_to.models.terrain import FlatGround
from multimodal_to.scenarios.bundled import find
from multimodal_to.scenarios.data import from_dict, to_dict
from multimodal_to.scenarios.margins import Margins
from multimodal_to.scenarios.scenario import Scenario
from multimodal_to.scenarios.weights import Weights
from multimodal_to.values import FrozenMapping


@checked
def load(path: str | os.PathLike[str]) -> Scenario:
    """Return the scenario of a TOML file; without a `name`, the file's own is taken.

    Raises:
        ScenarioError: the file is missing or broken, a key is unknown or missing, or a value is wrong.
    """
    source = Path(path)
    table = read_toml(source, ScenarioError)
    try:
        return _beside(_scenario(table, source.stem), source.parent)
    except MultimodalError as error:
        raise ScenarioError(f"{source}: {error}") from error


def _scenario(table: dict[str, Any], name: str) -> Scenario:
    table = {"name": name, **table}
    parent, emptied = table.pop("based_on", None), table.pop("replace", [])
    if parent is not None and not isinstance(parent, str):
        raise ScenarioError(f"'based_on' is {shown(parent)}; expected the name of a bundled scenario")
    if not isinstance(emptied, list) or not all(isinstance(key, str) for key in emptied):
        raise ScenarioError(
            f"'replace' is {shown(emptied)}; expected a list of keys, as [\"weights.joint_velocities\"]"
        )
    if parent is None:
        if emptied:
            raise ScenarioError("'replace' empties what a bundled scenario says; expected 'based_on' beside it")
        return from_dict(table)
    base = find(parent)
    for key in emptied:
        if key not in EMPTIED:
            raise ScenarioError(unknown("key of 'replace'", key, EMPTIED))
        outer, _, inner = key.partition(".")
        value = replace(getattr(base, outer), **{inner: EMPTIED[key]()}) if inner else EMPTIED[key]()
        base = replace(base, **{outer: value})
    return from_dict(table, base)


EMPTIED: Mapping[str, Callable[[], Any]] = FrozenMapping(
    {
        "weights": Weights,
        "weights.joint_velocities": dict,
        "margins": Margins,
        "surface": FlatGround,
        "allowances": dict,
    }
)
"""What a file can write anew with `replace`, and what stands there before it does."""


def _beside(scenario: Scenario, folder: Path) -> Scenario:
    """Return a scenario with the paths that its file says as they are from here.

    Args:
        scenario: as its file says it.
        folder: of that file.
    """
    paths: dict[str, Any] = {}
    if scenario.robot is not None and scenario.robot not in bundled_robots():
        paths["robot"] = os.path.abspath(folder / scenario.robot)
    if scenario.initial_state is not None:
        paths["initial_state"] = os.path.abspath(folder / scenario.initial_state)
    return replace(scenario, **paths) if paths else scenario


@checked
def to_toml(scenario: Scenario) -> str:
    """Return a scenario, complete, as the text of a file that `load` reads."""
    return tomli_w.dumps(to_dict(scenario))


@checked
def save(scenario: Scenario, path: str | os.PathLike[str]) -> Path:
    """Write a scenario, complete, as a file that `load` reads; it appears whole or not at all.

    Raises:
        OutputError: the folder does not exist or cannot be written.
        ScenarioError: its surface is of a class that no file can name.
    """
    return write_text(path, to_toml(scenario))


@checked
def change(scenario: Scenario, settings: Iterable[str]) -> Scenario:
    """Return a scenario with values changed by texts such as `final_com_height=0.8` or `weights.thrust=3`.

    A value is written as in TOML; a text needs no quotes.

    Raises:
        ScenarioError: a text is no `key=value`, names an unknown key, or has a wrong value.
    """
    return changed(scenario, dict(map(parted, settings)))


@checked
def changed(scenario: Scenario, values: Mapping[str, Any]) -> Scenario:
    """Return a scenario with values changed by dotted keys, as `{"weights.thrust": 3.0}`.

    Raises:
        ScenarioError: a key is unknown, a value is wrong, or one key gives a table that another gives an entry of.
    """
    table: dict[str, Any] = {}
    for key, value in values.items():
        *parents, last = key.split(".")
        place = table
        for parent in parents:
            place = place.setdefault(parent, {})
            if not isinstance(place, dict):
                raise ScenarioError(f"'{shortened(key, 100)}': another change gives '{parent}' as a whole")
        place[last] = value
    return from_dict(table, scenario)


@checked
def parted(setting: str) -> tuple[str, Any]:
    """Return key and value of a text such as `final_com_height=0.8`; the value is as TOML has it.

    Raises:
        ScenarioError: it is no `key=value`.
    """
    key, equals, text = (part.strip() for part in setting.partition("="))
    if not (key and equals and text):
        raise ScenarioError(f"'{shortened(setting, 100)}' is no change of a scenario; expected key=value")
    return key, _value(text)


def _value(text: str) -> Any:
    try:
        table = parse_toml(f"value = {text}")
        if len(table) == 1:  # no line break, and another key behind it
            return table["value"]
    except ValueError:
        pass
    try:
        return number(text)  # as a person writes it, .5 or 1.
    except ValueError:
        return text

"""A `Scenario` as plain data, dictionaries, lists, numbers and texts, and back: what TOML and JSON can hold.

Its keys are the fields of `Scenario`, as `files.records` reads and writes them.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from multimodal_to.errors import ScenarioError, shown
from multimodal_to.files.records import Records
from multimodal_to.models.terrain import SURFACES, FlatGround, Surface
from multimodal_to.scenarios.keyframes import HOME
from multimodal_to.scenarios.margins import Margins
from multimodal_to.scenarios.scenario import Scenario, Vector3
from multimodal_to.trajectory import Trajectory

HEIGHTS = {"initial_com_height": "initial_com", "final_com_height": "final_com"}
"""Keys for the z of a CoM alone, where there is one to start from."""

_CLASS = "class"
"""Key for the name of a surface's class where that is all that a file says of it."""


class OwnSurfaceError(ScenarioError):
    """The ground of a motion is of a class that its file cannot hold."""


RECORDS = Records(what="the scenario", error=ScenarioError, unions={Surface: SURFACES})


def to_dict(scenario: Scenario) -> dict[str, Any]:
    """Return a scenario as plain data.

    Raises:
        ScenarioError: its surface is of a class that no file can name.
    """
    if type(scenario.surface) not in SURFACES.values():
        kinds = ", ".join(kind.__name__ for kind in SURFACES.values())
        raise ScenarioError(
            f"a {type(scenario.surface).__name__} cannot be written down as the surface of a scenario; expected one of "
            f"{kinds}"
        )
    table: dict[str, Any] = RECORDS.plain(scenario)
    return table


def from_dict(table: Mapping[str, Any], base: Scenario | None = None) -> Scenario:
    """Return the scenario of plain data, or `base` with what the data change.

    Raises:
        ScenarioError: a key is unknown or missing, or a value is not what its key takes.
    """
    if isinstance(table, Mapping):
        table = dict(table)
        for com in HEIGHTS.values():  # one way to say it replaces the other
            ways = com in table, f"{com}_shift" in table
            if base is not None and any(ways):
                changed: dict[str, Any] = {com: getattr(base, com) if ways[0] else HOME, f"{com}_shift": None}
                base = replace(base, **changed)
        for key, com in HEIGHTS.items():
            if key in table:
                table[com] = _raised(table.pop(key), key, table.get(com, getattr(base, com, None)), com)
    return RECORDS.read(Scenario, table, base, also=HEIGHTS)


def _raised(height: Any, key: str, position: Any, com: str) -> Vector3:
    """Return a CoM at another height [m].

    Args:
        height: what the file has for z [m].
        key: what the file calls it.
        position: the CoM whose height it changes [m], as a file has it; None where there is none.
        com: what that CoM is called.
    """
    if position is None or isinstance(position, str):
        lacks = "which the scenario lacks" if position is None else f"which is '{position}'"
        raise ScenarioError(f"'{key}' changes '{com}', {lacks}; expected '{com}' with three numbers")
    x, y, _ = RECORDS.value(Vector3, position, com)
    z: float = RECORDS.value(float, height, key)
    return x, y, z


def to_json(scenario: Scenario) -> str:
    """Return a scenario as the JSON text of its plain data.

    Raises:
        ScenarioError: its surface is of a class that no file can name.
    """
    return json.dumps(to_dict(scenario), ensure_ascii=False)


def kept(scenario: Scenario) -> str:
    """Return the text that a trajectory keeps of its scenario; of a surface of one's own class it is the class's name.

    Such a scenario is not read again: `stored` refuses it.
    """
    if type(scenario.surface) in SURFACES.values():
        return to_json(scenario)
    table = to_dict(replace(scenario, surface=FlatGround()))
    return json.dumps({**table, "surface": {_CLASS: type(scenario.surface).__name__}}, ensure_ascii=False)


def stored(trajectory: Trajectory) -> Scenario | None:
    """Return the scenario that a trajectory was solved from, if it keeps one.

    A margin that the file does not state was not asked for: files of before the margins have none.

    Raises:
        OwnSurfaceError: the ground is of a class of one's own.
        ScenarioError: what it keeps is no scenario of this release.
    """
    if not trajectory.scenario_json:
        return None
    try:
        table = json.loads(trajectory.scenario_json)
        surface = table.get("surface") if isinstance(table, dict) else None
        if isinstance(surface, dict) and _CLASS in surface:
            raise OwnSurfaceError(
                f"the ground of '{trajectory.scenario}' is {shown(surface[_CLASS])}, a class of its author's own that "
                "no file holds; in Python, `audit` takes it with the scenario"
            )
        return from_dict(_with_margins(table))
    except OwnSurfaceError:
        raise
    except (ValueError, RecursionError, ScenarioError) as error:
        raise ScenarioError(f"the scenario kept with '{trajectory.scenario}' cannot be read: {error}") from error


def _with_margins(table: Any) -> Any:
    """Return the plain data of a stored scenario with a zero for every margin that they lack."""
    if not isinstance(table, dict) or not isinstance(table.get("margins", {}), dict):
        return table  # which is refused where it is read
    return {**table, "margins": {**RECORDS.plain(Margins.none()), **table.get("margins", {})}}

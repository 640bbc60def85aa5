"""A `Scenario` as plain data, dictionaries, lists, numbers and texts, and back: what TOML and JSON can hold.

Keys are the names of the fields, dotted where they are nested (`weights.thrust`); enumerations are their values; a
surface is a table with its `kind`. What has no value is left out.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import MISSING, fields, is_dataclass
from enum import Enum
from types import UnionType
from typing import Any, get_args, get_origin, get_type_hints

from multimodal_to.errors import InputError, ScenarioError, shown, unknown
from multimodal_to.files.reading import is_number
from multimodal_to.models.terrain import SURFACES, Surface
from multimodal_to.scenarios.scenario import Scenario
from multimodal_to.trajectory import Trajectory

HEIGHTS = {"initial_com_height": "initial_com", "final_com_height": "final_com"}
"""Keys for the z of a CoM alone, where there is one to start from."""


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
    table: dict[str, Any] = _plain(scenario)
    return table


def from_dict(table: Mapping[str, Any], base: Scenario | None = None) -> Scenario:
    """Return the scenario of plain data, or `base` with what the data change.

    Raises:
        ScenarioError: a key is unknown or missing, or a value is not what its key takes.
    """
    if not isinstance(table, Mapping):
        raise _wrong("the scenario", table, "a table")
    table = dict(table)
    for key, com in HEIGHTS.items():
        if key in table:
            if com not in table and base is None:
                raise ScenarioError(f"'{key}' changes '{com}', which the scenario lacks")
            where = _read(get_type_hints(Scenario)[com], table[com] if com in table else getattr(base, com), com, None)
            table[com] = [*where[:2], _number(table.pop(key), key)]
    scenario: Scenario = _record(Scenario, table, "", base)
    return scenario


def to_json(scenario: Scenario) -> str:
    """Return a scenario as the JSON text of its plain data."""
    return json.dumps(to_dict(scenario), ensure_ascii=False)


def stored(trajectory: Trajectory) -> Scenario | None:
    """Return the scenario that a trajectory was solved from, if it keeps one.

    Raises:
        ScenarioError: what it keeps is no scenario of this release.
    """
    if not trajectory.scenario_json:
        return None
    try:
        return from_dict(json.loads(trajectory.scenario_json))
    except (ValueError, RecursionError, ScenarioError) as error:
        raise ScenarioError(f"the scenario kept with '{trajectory.scenario}' cannot be read: {error}") from error


def _plain(value: Any) -> Any:
    if isinstance(value, Enum):
        return value.value
    if is_dataclass(value):
        kinds: dict[object, str] = {kind: name for name, kind in SURFACES.items()}
        entries = {"kind": kinds.get(type(value))} | {entry.name: getattr(value, entry.name) for entry in fields(value)}
        return {name: _plain(entry) for name, entry in entries.items() if entry is not None}
    if isinstance(value, Mapping):
        return {key: _plain(entry) for key, entry in value.items()}
    if isinstance(value, tuple):
        return [_plain(entry) for entry in value]
    return value


def _record(kind: Any, table: Any, where: str, base: Any) -> Any:
    """Return a frozen dataclass made of a table; what the table lacks is the base's or the field's default."""
    if not isinstance(table, Mapping):
        raise _wrong(where, table, "a table")
    prefix, hints = f"{where}." if where else "", get_type_hints(kind)
    known = [*hints, *(HEIGHTS if kind is Scenario else ())]
    for key in table:
        if key not in known:
            raise ScenarioError(unknown("key", prefix + key, [prefix + name for name in known]))
    values: dict[str, Any] = {entry.name: getattr(base, entry.name) for entry in fields(kind)} if base else {}
    for key, value in table.items():
        values[key] = _read(hints[key], value, prefix + key, values.get(key))
    needed = [entry.name for entry in fields(kind) if entry.default is MISSING and entry.default_factory is MISSING]
    if missing := [f"'{prefix}{name}'" for name in needed if name not in values]:
        raise ScenarioError(f"the scenario lacks {', '.join(missing)}")
    return kind(**values)


def _surface(table: Any, where: str, base: Surface | None) -> Surface:
    """Return the surface of a table with its kind; of the base's kind, it keeps what the table lacks."""
    table = {"kind": table} if isinstance(table, str) else table
    if not isinstance(table, Mapping):
        raise _wrong(where, table, "a table with a kind")
    names = {kind: name for name, kind in SURFACES.items()}
    own = names.get(type(base))  # type: ignore[arg-type]
    name = table.get("kind", own)
    if not isinstance(name, str) or name not in SURFACES:
        raise _wrong(f"{where}.kind", name, f"one of {', '.join(SURFACES)}")
    rest = {key: value for key, value in table.items() if key != "kind"}
    try:
        surface: Surface = _record(SURFACES[name], rest, where, base if name == own else None)
    except InputError as error:
        raise ScenarioError(f"'{where}': {error}") from error
    return surface


def _read(kind: Any, value: Any, key: str, base: Any) -> Any:
    """Return a value as a field's type has it."""
    if isinstance(kind, UnionType):  # of a type and None
        kind = next(member for member in get_args(kind) if member is not type(None))
    if kind is Surface:
        return _surface(value, key, base)
    if is_dataclass(kind):
        return _record(kind, value, key, base)
    if get_origin(kind) is tuple:
        return _tuple(get_args(kind), value, key)
    if get_origin(kind) is Mapping:
        if not isinstance(value, Mapping):
            raise _wrong(key, value, "a table")
        entries = {name: _read(get_args(kind)[1], entry, f"{key}.{name}", None) for name, entry in value.items()}
        return {**(base or {}), **entries}
    if isinstance(kind, type) and issubclass(kind, Enum):
        members = {member.value: member for member in kind}
        if not isinstance(value, str) or value not in members:
            raise _wrong(key, value, f"one of {', '.join(members)}")
        return members[value]
    return _scalar(kind, value, key)


def _tuple(members: tuple[Any, ...], value: Any, key: str) -> tuple[Any, ...]:
    if not isinstance(value, list | tuple):
        raise _wrong(key, value, "a list")
    kinds = [members[0]] * len(value) if members[-1] is Ellipsis else list(members)
    if len(value) != len(kinds):
        raise _wrong(key, value, f"a list of {len(kinds)}")
    return tuple(
        _read(kind, entry, f"{key}[{index}]", None)
        for index, (kind, entry) in enumerate(zip(kinds, value, strict=True))
    )


def _scalar(kind: Any, value: Any, key: str) -> Any:
    if kind is float:
        return _number(value, key)
    expected = {int: "a whole number", bool: "true or false", str: "a text"}[kind]
    if not isinstance(value, kind) or (kind is int and isinstance(value, bool)):
        raise _wrong(key, value, expected)
    return value


def _number(value: Any, key: str) -> float:
    if not is_number(value):
        raise _wrong(key, value, "a finite number")
    return float(value)


def _wrong(key: str, value: Any, expected: str) -> ScenarioError:
    return ScenarioError(f"'{key}' is {shown(value)}; expected {expected}")

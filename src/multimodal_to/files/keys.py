"""The keys that a file may have, as data, from the dataclass that it is read into.

What a key means, and its unit in square brackets, stand in the text below its field.
"""

from __future__ import annotations

import ast
import inspect
import re
import textwrap
from collections.abc import Iterator, Mapping
from dataclasses import MISSING, Field, dataclass, fields, is_dataclass
from enum import Enum
from itertools import pairwise
from typing import Any, Literal, get_args, get_origin, get_type_hints

from multimodal_to.errors import InputError
from multimodal_to.files.records import Unions, members_of

_UNIT = re.compile(r"\s*\[([^\]]*)\]")
_COUNTS = {2: "two", 3: "three", 4: "four"}


@dataclass(frozen=True, kw_only=True)
class Key:
    """A key of a file."""

    name: str
    """With dots where tables are nested; `<name>` stands for a name that the file chooses, `[]` for each of several."""
    kind: str
    """What its value is, such as "number", "three numbers" or "one of hover, standing, free"."""
    unit: str
    """Of its numbers; empty where it has none to have."""
    default: str
    """What holds where the file lacks it; "required" where it may not."""
    meaning: str
    """What it says, in words."""
    where: str = ""
    """Where it may stand, if not everywhere, such as "surface.kind = plane"."""


def keys_of(record: type, unions: Unions) -> tuple[Key, ...]:
    """Return every key of a file that is read into a frozen dataclass, tables before what they hold.

    Args:
        record: the dataclass of the whole file.
        unions: the classes that may stand for a type, as `Records` takes them.

    Raises:
        InputError: a field has no text below it.
    """
    return tuple(_keys(record, "", "", unions))


def _keys(record: type, prefix: str, where: str, unions: Unions) -> Iterator[Key]:
    hints, texts = get_type_hints(record), field_texts(record)
    for entry in fields(record):
        if entry.name not in texts:
            raise InputError(
                f"the field '{entry.name}' of {record.__name__} has no text below it that says its meaning"
            )
        name = prefix + entry.name
        types = members_of(hints[entry.name])
        kind = types[0]
        unit = ", ".join(_UNIT.findall(texts[entry.name]))
        default, meaning = _default(entry, kind, unions), _UNIT.sub("", texts[entry.name]).rstrip(".")
        said = " or ".join(_kind(one, unions) for one in types)
        yield Key(name=name, kind=said, unit=unit, default=default, meaning=meaning, where=where)
        if kind in unions:
            kinds = ", ".join(unions[kind])
            yield Key(name=f"{name}.kind", kind=f"one of {kinds}", unit="", default=default, meaning="Which one it is")
        yield from _within(kind, name, where, unions)


def _within(kind: Any, name: str, where: str, unions: Unions) -> Iterator[Key]:
    """Return the keys of the tables that a key holds.

    Args:
        kind: the type of the key's value.
        name: of the key.
        where: where the key may stand.
        unions: the classes that may stand for a type.
    """
    if kind in unions:
        for own, record in unions[kind].items():
            yield from _keys(record, f"{name}.", f"{name}.kind = {own}", unions)
    elif is_dataclass(kind):
        yield from _keys(kind, f"{name}.", where, unions)  # type: ignore[arg-type]
    elif get_origin(kind) is tuple and is_dataclass(get_args(kind)[0]):
        yield from _keys(get_args(kind)[0], f"{name}[].", where, unions)
    elif get_origin(kind) is Mapping:
        inner = get_args(kind)[1]
        if inner in unions:
            kinds = tuple(unions[inner])
            yield Key(
                name=f"{name}.<name>.kind",
                kind=f"one of {', '.join(kinds)}",
                unit="",
                default=kinds[0],
                meaning="Which one it is",
            )
        yield from _within(inner, f"{name}.<name>", where, unions)


def field_texts(record: type) -> dict[str, str]:
    """Return the text below each field of a class, as one line; of a base class too."""
    found: dict[str, str] = {}
    for part in reversed(record.__mro__):
        if is_dataclass(part):
            body = ast.parse(textwrap.dedent(inspect.getsource(part))).body[0].body  # type: ignore[attr-defined]
            for before, after in pairwise(body):
                if isinstance(before, ast.AnnAssign) and isinstance(after, ast.Expr):
                    text = ast.literal_eval(after.value)
                    found[ast.unparse(before.target)] = " ".join(text.split())
    return found


def _kind(kind: Any, unions: Unions) -> str:
    """Return what a value of a type is, in words."""
    if kind in unions:
        return "table with a kind, or the kind alone"
    if is_dataclass(kind):
        return "table"
    if get_origin(kind) is tuple:
        members = get_args(kind)
        inner = _kind(members[0], unions)
        several = f"{inner}s"
        if inner.startswith("list"):
            several = inner.replace("list of", "lists of")
        elif inner.startswith(tuple(_COUNTS.values())):
            several = f"lists of {inner}"
        return f"list of {several}" if members[-1] is Ellipsis else f"{_COUNTS[len(members)]} {several}"
    if get_origin(kind) is Mapping:
        return f"table of names, each with a {_kind(get_args(kind)[1], unions)}"
    if get_origin(kind) is Literal:
        return f"one of {', '.join(get_args(kind))}"
    if issubclass(kind, Enum):
        return f"one of {', '.join(member.value for member in kind)}"
    return {float: "number", int: "whole number", bool: "true or false", str: "text"}[kind]


def _default(entry: Field[Any], kind: Any, unions: Unions) -> str:
    value = entry.default if entry.default_factory is MISSING else entry.default_factory()
    if value is MISSING:
        return "required"
    if kind in unions:
        return next(name for name, record in unions[kind].items() if type(value) is record)
    return _written(value)


def _written(value: Any) -> str:
    """Return a default as a file would have it; "none" where there is none."""
    if isinstance(value, Enum):
        return str(value.value)
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, tuple) and value:
        return f"[{', '.join(map(_written, value))}]"
    if value is None or is_dataclass(value) or isinstance(value, Mapping | tuple):
        return "none"
    return f"{value:g}" if isinstance(value, int | float) else str(value)

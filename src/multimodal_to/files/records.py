"""Tables of a file as frozen dataclasses, and back: the fields are the only list of keys there is.

Keys are the names of the fields, dotted where they are nested (`weights.thrust`); enumerations are their values; what
is one of several classes is a table with its `kind`. What has no value is left out.

This is written by hand although libraries do the like. With cattrs the numbers, lists, tables, enumerations, kinds,
partial tables and the sentences of errors would each still be a hook of ours, of about the same length together.
msgspec takes unknown keys of a dataclass for good, and its errors keep back the value and the key of a mapping.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import MISSING, Field, dataclass, field, fields, is_dataclass
from enum import Enum
from types import UnionType
from typing import Any, Literal, TypeVar, Union, get_args, get_origin, get_type_hints

from multimodal_to.errors import InputError, MultimodalError, shown, unknown
from multimodal_to.files.reading import is_number

Record = TypeVar("Record")
Unions = Mapping[Any, Mapping[str, type]]
"""The classes that may stand for a type, by their `kind`; none of them is the type of a field on its own."""

_NAMED = 20
"""So many faults are named at once."""


@dataclass(frozen=True, kw_only=True)
class Records:
    """Reads records of one sort of file; an error names every key that is wrong and what was expected."""

    what: str  # what lacks a key in an error, such as "the scenario"
    error: type[MultimodalError]
    unions: Unions = field(default_factory=dict)

    def read(self, record: type[Record], table: Any, base: Record | None = None, *, also: Iterable[str] = ()) -> Record:
        """Return a record made of a table; what the table lacks is the base's, or the field's default.

        Args:
            record: a frozen dataclass.
            table: as `files.reading.read_toml` returns it.
            base: what the table changes.
            also: further keys that the file may have, which the caller has taken out; an unknown one may mean them.

        Raises:
            MultimodalError: a key is unknown or missing, or a value is not what its key takes; of the class `error`.
        """
        if not isinstance(table, Mapping):
            raise self._wrong(self.what, table, "a table")
        made: Record = self._record(record, table, "", base, also)
        return made

    def plain(self, value: Any) -> Any:
        """Return a record as dictionaries, lists, numbers and texts, as TOML and JSON hold them."""
        if isinstance(value, Enum):
            return value.value
        if is_dataclass(value):
            return self._plain_record(value, all_of_it=True)
        if isinstance(value, Mapping):
            return {key: self._plain_entry(entry) for key, entry in value.items()}
        if isinstance(value, tuple):
            return [self._plain_entry(entry) for entry in value]
        return value

    def _plain_record(self, value: Any, *, all_of_it: bool) -> dict[str, Any]:
        kinds = {kind: name for union in self.unions.values() for name, kind in union.items()}
        entries = {"kind": kinds.get(type(value))} | {
            item.name: getattr(value, item.name)
            for item in fields(value)
            if all_of_it or getattr(value, item.name) != _default_of(item)
        }
        return {name: self.plain(entry) for name, entry in entries.items() if entry is not None}

    def _plain_entry(self, value: Any) -> Any:
        """Return a member of a list or of a table; a record there says only what differs from its defaults."""
        return self._plain_record(value, all_of_it=False) if is_dataclass(value) else self.plain(value)

    def _record(self, kind: Any, table: Any, where: str, base: Any, also: Iterable[str] = ()) -> Any:
        if not isinstance(table, Mapping):
            raise self._wrong(where, table, "a table")
        prefix, hints = f"{where}." if where else "", get_type_hints(kind)
        strange = [key for key in table if key not in hints][:_NAMED]
        faults = [unknown("key", prefix + key, [prefix + name for name in (*hints, *also)]) for key in strange]
        values: dict[str, Any] = {entry.name: getattr(base, entry.name) for entry in fields(kind)} if base else {}
        for key in (key for key in table if key in hints):
            with self._noted(faults):
                values[key] = self.value(hints[key], table[key], prefix + key, values.get(key))
        needed = [entry.name for entry in fields(kind) if entry.default is MISSING and entry.default_factory is MISSING]
        if missing := [f"'{prefix}{name}'" for name in needed if name not in values and name not in table]:
            faults.append(f"{self.what} lacks {', '.join(missing)}")
        self._refuse(faults)
        try:
            return kind(**values)
        except InputError as error:
            raise self.error(f"'{where}': {error}" if where else str(error)) from error

    def _one_of(self, kinds: Mapping[str, type], table: Any, where: str, base: Any) -> Any:
        """Return the record of a table with its kind; of the base's kind, it keeps what the table lacks.

        Args:
            kinds: the classes by their kind.
            table: as the file has it; a text is a kind alone.
            where: what errors call it.
            base: the record that the table changes, if any.
        """
        table = {"kind": table} if isinstance(table, str) else table
        if not isinstance(table, Mapping):
            raise self._wrong(where, table, "a table with a kind")
        own = next((name for name, kind in kinds.items() if kind is type(base)), None)
        name = table.get("kind", own)
        if not isinstance(name, str) or name not in kinds:
            raise self._wrong(f"{where}.kind", name, f"one of {', '.join(kinds)}")
        rest = {key: value for key, value in table.items() if key != "kind"}
        return self._record(kinds[name], rest, where, base if name == own else None)

    def value(self, kind: Any, value: Any, key: str, base: Any = None) -> Any:
        """Return a value as a field's type has it.

        Args:
            kind: the type: a number, text, enumeration, tuple, mapping, dataclass, or one of the unions.
            value: as the file has it.
            key: what errors call it.
            base: the value that a table changes, if any.
        """
        kinds = members_of(kind)
        kind = next((some for some in kinds if _takes(some, value)), None) if len(kinds) > 1 else kinds[0]
        if kind is None:
            raise self._wrong(key, value, " or ".join(_said(some) for some in kinds))
        if kind in self.unions:
            return self._one_of(self.unions[kind], value, key, base)
        if is_dataclass(kind):
            return self._record(kind, value, key, base)
        if get_origin(kind) is tuple:
            alone = isinstance(value, str) and get_args(kind) == (str, Ellipsis)
            return self._tuple(get_args(kind), [value] if alone else value, key)
        if get_origin(kind) is Mapping:
            if not isinstance(value, Mapping):
                raise self._wrong(key, value, "a table")
            inner, made = get_args(kind)[1], dict(base or {})
            faults: list[str] = []
            for name, entry in value.items():
                with self._noted(faults):
                    made[name] = self.value(inner, entry, f"{key}.{name}", None)
            self._refuse(faults)
            return made
        if get_origin(kind) is Literal or issubclass(kind, Enum):
            members = {word: word for word in get_args(kind)} or {member.value: member for member in kind}
            if not isinstance(value, str) or value not in members:
                raise self._wrong(key, value, " or ".join(_said(some) for some in kinds))
            return members[value]
        return self._scalar(kind, value, key)

    def _tuple(self, members: tuple[Any, ...], value: Any, key: str) -> tuple[Any, ...]:
        if not isinstance(value, list | tuple):
            raise self._wrong(key, value, "a list")
        kinds = [members[0]] * len(value) if members[-1] is Ellipsis else list(members)
        if len(value) != len(kinds):
            raise self._wrong(key, value, f"a list of {len(kinds)}")
        faults: list[str] = []
        made = []
        for index, (kind, entry) in enumerate(zip(kinds, value, strict=True)):
            with self._noted(faults):
                made.append(self.value(kind, entry, f"{key}[{index}]", None))
        self._refuse(faults)
        return tuple(made)

    def _scalar(self, kind: Any, value: Any, key: str) -> Any:
        if kind is float:
            if not is_number(value):
                raise self._wrong(key, value, "a finite number")
            return float(value)
        expected = {int: "a whole number", bool: "true or false", str: "a text"}[kind]
        if not isinstance(value, kind) or (kind is int and isinstance(value, bool)):
            raise self._wrong(key, value, expected)
        return value

    @contextmanager
    def _noted(self, faults: list[str]) -> Iterator[None]:
        """Take an error down, so that the next key is read as well: one run names all that is wrong."""
        try:
            yield
        except self.error as error:
            faults.append(str(error))
            if len(faults) > _NAMED:
                self._refuse(faults)

    def _refuse(self, faults: list[str]) -> None:
        if faults:
            raise self.error("; ".join(faults))

    def _wrong(self, key: str, value: Any, expected: str) -> MultimodalError:
        return self.error(f"'{key}' is {shown(value)}; expected {expected}")


def _default_of(entry: Field[Any]) -> Any:
    return entry.default if entry.default_factory is MISSING else entry.default_factory()


def members_of(kind: Any) -> tuple[Any, ...]:
    """Return the types that a field's value may have, but for None."""
    if get_origin(kind) in (Union, UnionType):
        return tuple(member for member in get_args(kind) if member is not type(None))
    return (kind,)


def _said(kind: Any) -> str:
    """Return what a member of a type is in a file."""
    if get_origin(kind) is Literal:
        return f"one of {', '.join(get_args(kind))}"
    if isinstance(kind, type) and issubclass(kind, Enum):
        return f"one of {', '.join(member.value for member in kind)}"
    return _WORDS[get_origin(kind) or kind]


_WORDS = {tuple: "a list", Mapping: "a table", str: "a text", float: "a finite number"}
"""What the members of a type with several are in a file."""


def _takes(kind: Any, value: Any) -> bool:
    """Return whether a value of a file is meant to be of one of a field's several types."""
    form = get_origin(kind) or kind
    given = {list: tuple, tuple: tuple, str: str, int: float, float: float}.get(type(value))
    return form is given or (form is Literal and given is str) or (form is Mapping and isinstance(value, Mapping))

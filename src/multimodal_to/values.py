"""What all values of the library have in common: they travel to other processes, copy, compare and hash by content."""

from __future__ import annotations

import copy
from collections.abc import Hashable, Iterator, Mapping
from dataclasses import fields, is_dataclass
from typing import Any, Self, TypeVar

import casadi as cs
import numpy as np

Key = TypeVar("Key")
Of = TypeVar("Of")


class FrozenMapping(Mapping[Key, Of]):
    """A mapping that does not change: it equals any mapping of the same items, hashes, and can be pickled.

    >>> FrozenMapping({"a": 1}) == {"a": 1}, FrozenMapping({"a": 1})["a"]
    (True, 1)
    """

    __slots__ = ("_items",)

    _items: dict[Key, Of]

    def __init__(self, items: Mapping[Key, Of]) -> None:
        object.__setattr__(self, "_items", dict(items))

    def __getitem__(self, key: Key) -> Of:
        return self._items[key]

    def __iter__(self) -> Iterator[Key]:
        return iter(self._items)

    def __len__(self) -> int:
        return len(self._items)

    def __hash__(self) -> int:
        return hash(content(self))

    def __setattr__(self, name: str, value: object) -> None:
        raise AttributeError(f"cannot set '{name}': the mapping does not change")

    def __reduce__(self) -> tuple[type[FrozenMapping[Key, Of]], tuple[dict[Key, Of]]]:
        return type(self), (dict(self),)

    def __repr__(self) -> str:
        return repr(dict(self))


_SYMBOLIC = "casadi"
"""Where a pickled value keeps its expressions."""


class Value:
    """Base of frozen dataclasses that hold arrays or CasADi's matrices: they equal and hash by content.

    Arrays of their fields are copied and cannot be written to. What is kept beside the fields, such as cached
    properties, does not travel. Make the dataclass with `eq=False`, and call `super().__post_init__()` first.
    """

    def __post_init__(self) -> None:
        self.__setstate__(self._held())

    def __eq__(self, other: object) -> bool:
        if self is other:
            return True
        return type(self) is type(other) and content(self) == content(other)

    def __hash__(self) -> int:
        return hash(content(self))

    def __copy__(self) -> Self:
        return self

    def __deepcopy__(self, memo: dict[int, Any]) -> Self:
        other = memo[id(self)] = object.__new__(type(self))
        other.__setstate__({name: copy.deepcopy(value, memo) for name, value in self._held().items()})
        return other

    def _held(self) -> dict[str, Any]:
        return {entry.name: getattr(self, entry.name) for entry in fields(self)}  # type: ignore[arg-type]

    def __getstate__(self) -> dict[str, Any]:
        held = self._held()
        symbolic = [name for name, value in held.items() if isinstance(value, cs.SX)]
        if symbolic:  # all in one text, so that symbols that they share stay shared
            text = cs.StringSerializer()
            for name in symbolic:
                text.pack(held.pop(name))
            held[_SYMBOLIC] = symbolic, text.encode()
        return held

    def __setstate__(self, state: Mapping[str, Any]) -> None:
        if _SYMBOLIC in state:
            names, text = state[_SYMBOLIC]
            reader = cs.StringDeserializer(text)
            state = {key: value for key, value in state.items() if key != _SYMBOLIC}
            state.update({name: reader.unpack() for name in names})
        for name, value in state.items():
            object.__setattr__(self, name, _read_only(value) if isinstance(value, np.ndarray) else value)


def _read_only(array: np.ndarray) -> np.ndarray:
    if array.flags.writeable:
        array = array.copy()
        array.flags.writeable = False
    return array


def content(value: Any) -> Hashable:
    """Return what a value holds in a form that compares and hashes, such that equal contents have equal forms.

    Arrays compare by shape and numbers, mappings and sets without order, dataclasses field by field, CasADi's symbols
    by who they are, and all else as it compares itself.
    """
    if isinstance(value, np.ndarray | cs.DM):
        array = np.asarray(value)
        if array.dtype.kind in "biuf":
            return "array", array.shape, (array.astype(float) + 0.0).tobytes()  # −0 is 0
        return "array", array.shape, tuple(map(content, array.ravel().tolist()))
    if isinstance(value, cs.SX):
        return "SX", value.shape, tuple(value.sparsity().row()), tuple(one.element_hash() for one in value.nonzeros())
    if isinstance(value, Mapping):
        return "mapping", frozenset((key, content(of)) for key, of in value.items())
    if isinstance(value, list | tuple):
        return "sequence", tuple(map(content, value))
    if isinstance(value, set | frozenset):
        return "set", frozenset(map(content, value))
    if is_dataclass(value) and not isinstance(value, type):
        return type(value), tuple(content(getattr(value, entry.name)) for entry in fields(value) if entry.compare)
    return value  # type: ignore[no-any-return]

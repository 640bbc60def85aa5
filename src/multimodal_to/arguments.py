"""Arguments and fields are checked against their annotations, so that a wrong one is refused in one sentence."""

from __future__ import annotations

import inspect
import math
import os
import types
from collections.abc import Callable, Hashable, Iterable, Mapping, Sequence
from dataclasses import fields
from enum import Enum
from functools import cache, wraps
from numbers import Integral, Real
from typing import Any, Literal, TypeVar, Union, cast, get_args, get_origin, get_type_hints

import numpy as np
from numpy.typing import NDArray

from multimodal_to.errors import InputError, MultimodalError, shown

Function = TypeVar("Function", bound=Callable[..., Any])
_WORDS: Mapping[object, str] = {
    float: "a number",
    int: "a whole number",
    bool: "True or False",
    str: "a text",
    bytes: "bytes",
    type(None): "None",
    np.ndarray: "a NumPy array",
}


def checked(function: Function) -> Function:
    """Return the function with its arguments checked against its annotations.

    Raises (the function):
        InputError: an argument is not what its annotation says.
    """
    signature = inspect.signature(function)
    said = function.__qualname__.split(".")[-2 if function.__name__ == "__init__" else -1]
    names = tuple(signature.parameters)
    simple = all(one.kind is inspect.Parameter.POSITIONAL_OR_KEYWORD for one in signature.parameters.values())

    @wraps(function)
    def checking(*given: Any, **named: Any) -> Any:
        hints = _hints(function)
        if simple and not named and len(given) == len(names):  # as `bind` does, in a tenth of its time
            arguments = dict(zip(names, given, strict=True))
        else:
            arguments = signature.bind(*given, **named).arguments
        for name, value in arguments.items():
            kind = signature.parameters[name].kind
            values = value if kind is inspect.Parameter.VAR_POSITIONAL else (value,)
            for one in values:
                check(f"{said}: '{name}'", one, hints.get(name, Any))
        return function(*given, **named)

    return cast(Function, checking)


def check_fields(
    value: Any,
    error: type[MultimodalError] = InputError,
    what: str = "",
    but: tuple[str, ...] = (),
    *,
    finite: bool = False,
) -> None:
    """Check the fields of a dataclass against their annotations.

    Args:
        value: of the dataclass.
        error: what is raised.
        what: the fields are called, with a blank behind; by default only their names stand there.
        but: fields that the dataclass checks itself, in words of its own.
        finite: refuse numbers that are not.
    """
    hints = _hints(cast(Hashable, type(value)))
    for entry in (entry for entry in fields(value) if entry.name not in but):
        held = getattr(value, entry.name)
        check(f"{what}{entry.name}", held, hints.get(entry.name, Any), error)
        if finite and isinstance(held, Real) and not np.isfinite(float(held)):
            raise error(f"{what}{entry.name} is {shown(held)}; expected a finite number")


def check(what: str, value: object, annotation: Any, error: type[MultimodalError] = InputError) -> None:
    """Refuse a value that is not what an annotation says.

    Args:
        what: the value is called.
        value: that is checked.
        annotation: as `typing.get_type_hints` returns it; what it does not know is taken as right.
        error: what is raised.

    Raises:
        MultimodalError: of the kind of `error`; the value is something else.
    """
    if not _fits(value, annotation):
        raise error(f"{what} is {shown(value)}; expected {_said(annotation)}")


def vector(
    what: str, value: object, size: int | None, error: type[MultimodalError] = InputError, *, finite: bool = True
) -> NDArray[np.float64]:
    """Return numbers as an array of one axis, or refuse what is none.

    Args:
        what: the value is called.
        value: an array or a sequence of numbers.
        size: how many numbers are expected; None takes any.
        error: what is raised.
        finite: refuse what is not; NaN is refused either way.

    Raises:
        MultimodalError: of the kind of `error`; the value is something else.
    """
    if not (isinstance(value, np.ndarray) and value.dtype.kind in "iuf"):
        check(what, value, Sequence[float], error)
    array = np.asarray(value, dtype=np.float64)
    expected = array.shape if size is None else (size,)
    if array.ndim != 1 or array.shape != expected:
        raise error(f"{what} has the shape {array.shape}; expected ({'n' if size is None else size},)")
    if np.isnan(array).any() or (finite and not np.isfinite(array).all()):
        raise error(f"{what} is {shown(array.tolist())}; expected {'finite ' * finite}numbers")
    return array


def refuse_negative(what: str, number: float, error: type[MultimodalError] = InputError) -> None:
    """Refuse a number that is below zero, not finite, or none.

    Args:
        what: the number is called.
        number: that is looked at.
        error: what is raised.

    Raises:
        MultimodalError: of the kind of `error`; it is one of these.
    """
    if not 0.0 <= number < math.inf:
        raise error(f"{what} is {shown(number)}; expected a number of at least zero")


@cache
def _hints(annotated: Hashable) -> dict[str, Any]:
    try:
        return get_type_hints(cast(Any, annotated))
    except (NameError, TypeError):  # a name that only type checkers know
        return {}


@cache
def _parts(annotation: Hashable) -> tuple[Any, tuple[Any, ...]]:
    return get_origin(annotation), get_args(annotation)


def _fits(value: object, annotation: Any) -> bool:
    origin, inner = _parts(annotation)
    if origin is Literal:
        return isinstance(value, str) and value in inner
    if origin in (Union, types.UnionType):
        return any(_fits(value, one) for one in inner)
    if annotation in (float, int, bool):
        if isinstance(value, bool | np.bool_):
            return annotation is bool
        return isinstance(value, {float: Real, int: Integral, bool: bool}[annotation])
    if origin is Callable or annotation is Callable:
        return callable(value)
    kind = origin or annotation
    if kind is Any or not isinstance(kind, type):
        return True
    return _fits_class(value, kind, inner)


def _fits_class(value: object, kind: type, inner: tuple[Any, ...]) -> bool:
    if getattr(kind, "_is_protocol", False) and not issubclass(kind, Mapping | Sequence | Iterable | os.PathLike):
        if not kind.__module__.startswith("multimodal_to"):  # as NumPy's, for all that it makes an array of
            return True
        return all(getattr(value, name, None) is not None for name in _members(kind))
    if issubclass(kind, Mapping):
        of_key, of_value = inner if len(inner) == 2 else (Any, Any)
        return isinstance(value, Mapping) and all(_fits(k, of_key) and _fits(v, of_value) for k, v in value.items())
    if kind is tuple or kind in (Sequence, Iterable):
        return _fits_sequence(value, kind, inner)
    if issubclass(kind, np.ndarray):
        return isinstance(value, np.ndarray)
    return isinstance(value, kind)


def _fits_sequence(value: object, kind: type, inner: tuple[Any, ...]) -> bool:
    if isinstance(value, str | bytes | Mapping):
        return False
    if not isinstance(value, Sequence | np.ndarray):
        return kind is Iterable and _iterates(value)
    if isinstance(value, np.ndarray) and value.ndim == 0:
        return False
    if kind is tuple and inner and inner[-1] is not Ellipsis:  # of how many, its class says itself, with their units
        inner = inner[:1] if len(set(inner)) == 1 else ()
    return not inner or all(_fits(one, inner[0]) for one in value)


def _iterates(value: object) -> bool:
    try:
        iter(cast(Any, value))
    except TypeError:  # also of CasADi's matrices, which say that they are iterable and then refuse
        return False
    return True


def _members(protocol: type) -> list[str]:
    return [name for name in vars(protocol) if not name.startswith("_") or name == "__call__"]


def _said(annotation: Any) -> str:
    origin, inner = _parts(annotation)
    if origin is Literal:
        return f"one of {', '.join(inner)}"
    if origin in (Union, types.UnionType):
        if any(get_origin(one) is os.PathLike for one in inner):
            return "a path"
        return " or ".join(dict.fromkeys(_said(one) for one in inner if one is not type(None)))
    if origin is Callable or annotation is Callable:
        return "a function"
    kind = origin or annotation
    if isinstance(kind, type) and issubclass(kind, Mapping):
        return "a mapping" + (f" from {_many(inner[0])} to {_many(inner[1])}" if len(inner) == 2 else "")
    if kind in (tuple, Sequence, Iterable):
        return f"a sequence of {_many(inner[0])}" if inner else "a sequence"
    if isinstance(kind, type) and issubclass(kind, Enum):
        return f"one of {', '.join(member.name for member in kind)}"
    name = str(getattr(kind, "__name__", kind))
    return _WORDS.get(kind) or f"{'an' if name[0] in 'AEIOU' else 'a'} {name}"


def _many(annotation: Any) -> str:
    words = {float: "numbers", int: "whole numbers", str: "texts"}
    return words.get(annotation) or getattr(annotation, "__name__", "") or "values"

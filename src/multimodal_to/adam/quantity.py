"""How one method becomes a quantity: a call with checked arguments, and a `casadi.Function` that is built once.

A quantity is written once. Its method's body is its expression, and the line below it names its function's result:

    @quantity
    def jacobian(self, frame: str, base_transform: Any, joint_positions: Any) -> Any:
        \"\"\"Return J, (6, 6 + n): the frame's velocity is J ν.\"\"\"
        ...

    jacobian_fun = of_frame(jacobian, "J")

The body runs once for each function, on symbols. `jacobian(...)` checks its arguments and calls the function, and
`jacobian_fun(frame)` returns it. Both have the types, signatures and docstrings that a method written by hand has, so
type checkers, editors, `help` and the API page see them. Arguments have the same names everywhere: `ARGUMENTS`.
"""

from __future__ import annotations

import hashlib
import inspect
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import wraps
from typing import Any, Protocol, TypeVar, cast

import casadi as cs
import numpy as np

from multimodal_to.adam.library import Library
from multimodal_to.arguments import check
from multimodal_to.errors import InputError, ModelError, shown
from multimodal_to.values import FrozenMapping


@dataclass(frozen=True)
class Argument:
    """An argument of a quantity: its symbol in functions, its shape (None for n, the number of joints), its meaning."""

    symbol: str
    shape: tuple[int | None, int]
    meaning: str


ARGUMENTS: Mapping[str, Argument] = FrozenMapping(
    {
        "base_transform": Argument("H", (4, 4), "w_H_base, world-from-base, (4, 4) [1, m]."),
        "joint_positions": Argument("s", (None, 1), "s, (n, 1) [rad or m], in the order of `joint_names`."),
        "base_velocity": Argument("v_b", (6, 1), "v_b, (6, 1) [m/s, rad/s], linear part first."),
        "joint_velocities": Argument("s_dot", (None, 1), "ṡ, (n, 1) [rad/s or m/s]."),
        "base_acceleration": Argument("v_b_dot", (6, 1), "The derivative of the six numbers v_b [m/s², rad/s²]."),
        "joint_accelerations": Argument("s_ddot", (None, 1), "s̈, (n, 1) [rad/s² or m/s²]."),
        "joint_torques": Argument("tau", (None, 1), "τ, (n, 1) [N m or N]."),
    }
)
"""The arguments of all quantities, by name; v_b and its derivative are in the chosen representation."""

_OTHERS = {
    "frame": "Name of a frame: any link of the URDF.",
    "external_wrenches": "By frame name, the (force, moment) that the world applies there; see `rnea`.",
}

_PLAIN = re.compile(r"[A-Za-z0-9]+(?:_[A-Za-z0-9]+)*(?<!_x[0-9a-f]{16})")
"""Names that are ones in CasADi and in C as they are, and that end as no mark does."""

Formula = TypeVar("Formula", bound=Callable[..., Any])


class StateFunction(Protocol):
    """Returns the `casadi.Function` of a quantity of the whole robot; it is built on first use and kept."""

    def __call__(self) -> cs.Function:
        """Return the quantity's function."""


class FrameFunction(Protocol):
    """Returns the `casadi.Function` of a frame's quantity; it is built on first use and kept."""

    def __call__(self, frame: str) -> cs.Function:
        """Return the quantity's function for `frame`, the name of any link."""


class WrenchFunction(Protocol):
    """Returns the `casadi.Function` of a quantity under external wrenches; it is built on first use and kept."""

    def __call__(self, frames: Sequence[str] = ()) -> cs.Function:
        """Return the quantity's function; it takes one more argument, a wrench, for each of `frames`.

        Wrenches on a frame that is given several times add up.
        """


def quantity(formula: Formula) -> Formula:
    """Return the method that checks its arguments and evaluates what `formula` writes down.

    Raises (the method):
        InputError: an argument has another shape than `ARGUMENTS` says, or holds a NaN or an infinity; or CasADi does
            not take the library's `f_opts`.
        ModelError: there is no such frame, or the result is no finite number.
    """
    signature, name = inspect.signature(formula), formula.__name__

    @wraps(formula)
    def evaluated(self: Any, *given: Any, **named: Any) -> Any:
        try:
            arguments = signature.bind(self, *given, **named).arguments
        except TypeError as error:
            raise TypeError(f"{name}: {error}") from None
        check(f"{name}: 'external_wrenches'", arguments.get("external_wrenches"), Mapping[str, Any] | None)
        wrenches = dict(arguments.get("external_wrenches") or {})
        key = [arguments["frame"]] if "frame" in arguments else [tuple(wrenches)] if wrenches else []
        function = getattr(self, f"{name}_fun")(*key)
        values = [value for argument, value in arguments.items() if argument in ARGUMENTS]
        each = [_checked(function, i, value) for i, value in enumerate([*values, *wrenches.values()])]
        if any(isinstance(value, cs.SX) for value in each) and any(isinstance(value, cs.MX) for value in each):
            raise InputError(f"{function.name()}: some arguments are SX and some MX; expected one kind of symbols")
        result = function(*each)
        if isinstance(result, cs.DM) and not result.is_regular():
            raise ModelError(
                f"{name}: the result is no finite number; in this posture something moves without moving any mass, or "
                "the arguments are too large"
            )
        return result

    meanings = {**_OTHERS, **{argument: of.meaning for argument, of in ARGUMENTS.items()}}
    lines = [f"    {argument}: {meanings[argument]}" for argument in signature.parameters if argument in meanings]
    evaluated.__doc__ = "\n".join([inspect.getdoc(formula) or "", "", "Args:", *lines])
    return cast(Formula, evaluated)


def of_state(method: Callable[..., Any], output: str) -> StateFunction:
    """Return what makes the function of a quantity of the whole robot, with its result named `output`."""

    def function(self: Library) -> cs.Function:
        return _function(self, method, output)

    return cast(StateFunction, _described(function, method, output))


def of_frame(method: Callable[..., Any], output: str) -> FrameFunction:
    """Return what makes the function of a frame's quantity, with its result named `output`."""
    formula = inspect.unwrap(method)

    def function(self: Library, frame: str) -> cs.Function:
        check(f"{formula.__name__}: 'frame'", frame, str)
        return _function(self, method, output, frame=frame)

    return cast(FrameFunction, _described(function, method, output))


def of_wrenches(method: Callable[..., Any], output: str) -> WrenchFunction:
    """Return what makes the function of a quantity under external wrenches, with its result named `output`."""
    formula = inspect.unwrap(method)

    def function(self: Library, frames: Sequence[str] = ()) -> cs.Function:
        check(f"{formula.__name__}: 'frames'", frames, Sequence[str])
        return _function(self, method, output, pushed=tuple(frames))

    return cast(WrenchFunction, _described(function, method, output))


def _function(
    library: Library, method: Callable[..., Any], output: str, *, frame: str | None = None, pushed: Sequence[str] = ()
) -> cs.Function:
    """Return the function of a quantity, of the frame `frame`, with wrenches on the frames `pushed`."""
    formula, frames = inspect.unwrap(method), tuple(pushed) if frame is None else (frame,)
    for name in frames:
        library.tree.frame(name)

    def make() -> cs.Function:
        used = [ARGUMENTS[name] for name in inspect.signature(formula).parameters if name in ARGUMENTS]
        n = len(library.tree.joints)
        symbols = [cs.SX.sym(of.symbol, n if of.shape[0] is None else of.shape[0], of.shape[1]) for of in used]
        wrenches = [cs.SX.sym(f"w_{index}", 6, 1) for index, _ in enumerate(pushed)]
        first = [] if frame is None else [frame]
        last = [_summed(pushed, wrenches)] if pushed else []
        expression = cs.cse(formula(library, *first, *symbols, *last))
        labels = [*(of.symbol for of in used), *(f"w_{index}" for index, _ in enumerate(pushed))]
        name = _function_name(library, formula.__name__, frames)
        try:
            return cs.Function(name, [*symbols, *wrenches], [expression], labels, [output], library.f_opts)
        except (RuntimeError, NotImplementedError) as error:
            if not library.f_opts:
                raise
            why = str(error).splitlines()[1:2]
            raise InputError(f"{name}: CasADi takes no f_opts = {library.f_opts}: {''.join(why)}") from error

    return library._kept((formula.__name__, *frames), make)


def _summed(frames: Sequence[str], wrenches: Sequence[cs.SX]) -> dict[str, cs.SX]:
    """Return the wrench on each frame: the sum of its own where it is given several times."""
    total: dict[str, cs.SX] = {}
    for frame, wrench in zip(frames, wrenches, strict=True):
        total[frame] = total[frame] + wrench if frame in total else wrench
    return total


def _function_name(library: Library, name: str, frames: tuple[str, ...]) -> str:
    """Return what the function of a quantity is called: `jacobian_l_sole`, a name in C that no other function has.

    Names that say the same only by their look get a mark of their own: `l-sole` is none in C and would be `l_sole`,
    `left foot` and the two frames `left` and `foot` would meet, and so would `jacobian_dot` of `foot` and `jacobian` of
    `dot_foot`. So does what is made after gravity or the representation have changed.

    Args:
        library: that it is of.
        name: of the quantity.
        frames: that it is about.
    """
    plain = "_".join((name, *frames))
    quantities = (attribute.removesuffix("_fun") for attribute in dir(type(library)) if attribute.endswith("_fun"))
    meant = max((other for other in quantities if f"{plain}_".startswith(f"{other}_")), key=len)
    if meant == name and len(frames) < 2 and not library._changed and _PLAIN.fullmatch(plain):
        return plain
    key = repr((name, frames, library._changed)).encode("utf-8", errors="surrogatepass")
    readable = re.sub(r"[^A-Za-z0-9]+", "_", plain).strip("_")
    return f"{readable}_x{hashlib.sha256(key).hexdigest()[:16]}"


def _described(function: Callable[..., cs.Function], method: Callable[..., Any], output: str) -> Any:
    """Give a function the name and the docstring that belong beside `method`."""
    formula = inspect.unwrap(method)
    inputs = [ARGUMENTS[name].symbol for name in inspect.signature(formula).parameters if name in ARGUMENTS]
    function.__name__ = f"{formula.__name__}_fun"
    function.__qualname__, function.__module__ = f"{formula.__qualname__}_fun", formula.__module__
    function.__doc__ = (
        f"Return the `casadi.Function` ({', '.join(inputs)}) → {output} behind `{formula.__name__}`, built once.\n\n"
        f"{inspect.getdoc(formula)}"
    )
    return function


def _assembled(argument: Any) -> Any:
    """Return one CasADi matrix for a list, a list of rows or an array that holds CasADi's own; else the argument."""
    if isinstance(argument, np.ndarray) and argument.dtype == object:
        argument = argument.tolist()
    if not isinstance(argument, list | tuple):
        return argument
    rows = [cs.horzcat(*row) if _holds_casadi(row) else row for row in argument]
    return cs.vertcat(*rows) if any(isinstance(row, cs.SX | cs.MX | cs.DM) for row in rows) else argument


def _holds_casadi(row: Any) -> bool:
    return isinstance(row, list | tuple) and any(isinstance(one, cs.SX | cs.MX | cs.DM) for one in row)


def _checked(function: cs.Function, index: int, argument: Any) -> Any:
    """Return an argument of a function in a form that CasADi takes; refuse a wrong shape, a NaN and an infinity."""
    expected, name = tuple(function.size_in(index)), function.name_in(index)
    try:
        argument = _assembled(argument)
    except (NotImplementedError, RuntimeError) as error:
        raise InputError(f"{function.name()}: '{name}' mixes SX and MX, or rows of other lengths") from error
    symbolic = isinstance(argument, cs.SX | cs.MX)
    try:
        real = symbolic or isinstance(argument, cs.DM) or not np.iscomplexobj(argument)
        value = (
            argument if symbolic or isinstance(argument, cs.DM) else np.asarray(argument, dtype=float if real else None)
        )
    except (TypeError, ValueError) as error:
        raise InputError(f"{function.name()}: '{name}' is {shown(argument)}; expected numbers, {expected}") from error
    if not real:
        raise InputError(f"{function.name()}: '{name}' holds complex numbers; expected real ones")
    if tuple(value.shape) not in (expected, expected[:1] if expected[1] == 1 else expected):
        raise InputError(f"{function.name()}: '{name}' has shape {tuple(value.shape)}; expected {expected}")
    if not symbolic and not np.isfinite(np.asarray(value)).all():
        raise InputError(f"{function.name()}: '{name}' holds values that are not finite")
    return value

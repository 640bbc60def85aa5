"""`Constraint` and `Cost`: a term of a problem is one plain function and what the solver needs to know of it.

A function of a knot takes `(knot, parameters)`, a function of an interval takes `(interval, parameters)`; both return
a column of CasADi expressions, (m, 1), and neither knows where on the horizon it is.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from enum import Enum
from typing import Any

import casadi as cs
import numpy as np
from numpy.typing import NDArray

from multimodal_to.adam.spatial import SX, Array
from multimodal_to.arguments import check_fields, checked
from multimodal_to.errors import FormulationError, MultimodalError, listed, said, shown
from multimodal_to.models.joint_units import either, joint_units
from multimodal_to.models.units import ONE, OwnSize, Sized, size_of, sized
from multimodal_to.ocp.integration import Interval
from multimodal_to.ocp.knot import Knot
from multimodal_to.ocp.parameters import Parameters
from multimodal_to.trajectory.quantities import row_labels

KnotFunction = Callable[[Knot, Parameters], SX]
IntervalFunction = Callable[[Interval, Parameters], SX]
Limit = float | Sized | Callable[[Parameters], float]
"""A number, one that grows and shrinks with the robot, or a function of the parameters."""
Labels = tuple[str, ...] | Callable[[Parameters], tuple[str, ...]]
"""The names of a term's rows, or a function of the parameters where the robot says how many there are."""


Present = Callable[[Parameters], NDArray[np.bool_]]
"""Which rows of a term there are at which knot, (rows, N + 1); of intervals, column k is of the one that ends at k."""


Units = str | tuple[str, ...] | Callable[[Parameters], tuple[str, ...]]
"""The unit of a term's rows, of each of them, or a function of the parameters where the robot says which they have."""


@dataclass(frozen=True)
class _Each:
    """The labels of rows that are repeated for each "joint", "contact" or "jet"."""

    of: str
    axes: tuple[str, ...]

    def __call__(self, parameters: Parameters) -> tuple[str, ...]:
        return row_labels(parameters.robot, self.of, self.axes)


def each(of: str, *axes: str) -> Labels:
    """Return the labels of rows that are repeated for each "joint", "contact" or "jet"."""
    return _Each(of, axes or ("",))


@dataclass(frozen=True)
class JointUnits:
    """The units of rows that are joints: of a joint that turns the one given, of one that slides its counterpart."""

    turning: str  # one of `joint_units.SLIDING`

    def __call__(self, parameters: Parameters) -> tuple[str, ...]:
        """Return the unit of each joint."""
        return joint_units(parameters.robot, self.turning)

    def __str__(self) -> str:
        """Return both units in words."""
        return either(self.turning)


@dataclass(frozen=True)
class EngineUnits:
    """The units of rows that are jets: by the order of a jet's engine."""

    none: str  # of one without a lag
    first: str  # of one of order one
    second: str  # of one of order two
    lagging: bool = False  # rows are only of jets whose engines lag

    def __call__(self, parameters: Parameters) -> tuple[str, ...]:
        """Return the unit of each jet."""
        orders = [jet.model.order for jet in parameters.robot.jets]
        return tuple((self.none, self.first, self.second)[order] for order in orders if order or not self.lagging)

    def __str__(self) -> str:
        """Return the unit of a turbine's row."""
        return self.second


class Where(Enum):
    """Where on the horizon a term holds or is charged."""

    FIRST_KNOT = "first knot"
    LATER_KNOTS = "every knot but the first"
    EVERY_KNOT = "every knot"
    """The first one only where the motion starts in a hover: else the start gives the whole posture."""
    LAST_KNOT = "last knot"
    EVERY_INTERVAL = "every interval"
    LAST_INTERVAL = "last interval"
    FIRST_INTERVAL = "first interval"

    @property
    def of_intervals(self) -> bool:
        """Return whether a term there is a function of an interval."""
        return self in (Where.EVERY_INTERVAL, Where.LAST_INTERVAL, Where.FIRST_INTERVAL)


@dataclass(frozen=True)
class Knots:
    """Chosen knots, as a place of a term that is a function of a knot: `Knots((35,))`; 0 is the first.

    Raises:
        FormulationError: there is none, one stands twice, or one is negative.
    """

    knots: tuple[int, ...]

    def __post_init__(self) -> None:
        _keep_numbers(self, "knots", 0)

    @property
    def of_intervals(self) -> bool:
        """Return that a term there is a function of a knot."""
        return False

    @property
    def value(self) -> str:
        """Return the place in words."""
        return f"knot {listed(map(str, self.knots))}"

    @property
    def ends(self) -> tuple[int, ...]:
        """Return the knots."""
        return self.knots


@dataclass(frozen=True)
class Intervals:
    """Chosen intervals, as a place of a term that is a function of an interval, by the knots at which they end.

    Raises:
        FormulationError: there is none, one stands twice, or one ends before knot 1.
    """

    ends: tuple[int, ...]

    def __post_init__(self) -> None:
        _keep_numbers(self, "ends", 1)

    @property
    def of_intervals(self) -> bool:
        """Return that a term there is a function of an interval."""
        return True

    @property
    def value(self) -> str:
        """Return the place in words."""
        return f"interval that ends at knot {listed(map(str, self.ends))}"


Place = Where | Knots | Intervals
"""Where a term holds or is charged."""


def _keep_numbers(place: Knots | Intervals, name: str, least: int) -> None:
    """Keep the chosen knots as a tuple of whole numbers.

    Args:
        place: whose they are.
        name: of its field.
        least: which of them is the least that exists.

    Raises:
        FormulationError: they are not that.
    """
    numbers = getattr(place, name)
    check_fields(place, FormulationError, f"{type(place).__name__}: ")
    if not len(numbers) or len(set(numbers)) < len(numbers) or min(numbers) < least:
        what = f"{type(place).__name__} is of {shown(tuple(numbers))}"
        raise FormulationError(f"{what}; expected different whole numbers of at least {least}")
    object.__setattr__(place, name, tuple(map(int, numbers)))


@dataclass(frozen=True)
class Within:
    """The set that a constraint keeps its rows in: lower ≤ row ≤ upper."""

    lower: Limit
    upper: Limit

    def __post_init__(self) -> None:
        check_fields(self, FormulationError, "the set's ")

    def limits(self, parameters: Parameters) -> tuple[float, float]:
        """Return the two numbers."""
        units = parameters.robot.units
        lower, upper = (
            limit(parameters) if callable(limit) else sized(limit, units) for limit in (self.lower, self.upper)
        )
        return float(lower), float(upper)


@checked
def equal(value: Limit = 0.0) -> Within:
    """Return the set of one value."""
    return Within(value, value)


@checked
def at_least(value: Limit) -> Within:
    """Return the set of what is no smaller than a value."""
    return Within(value, math.inf)


@checked
def at_most(value: Limit) -> Within:
    """Return the set of what is no greater than a value."""
    return Within(-math.inf, value)


@checked
def between(lower: Limit, upper: Limit) -> Within:
    """Return the set of what lies between two values."""
    return Within(lower, upper)


@dataclass(frozen=True, kw_only=True, eq=False)
class Rows:
    """The rows of a constraint at one place: lower ≤ expression ≤ upper, and how to speak of them."""

    expression: SX  # (m, 1)
    lower: float
    upper: float
    units: tuple[str, ...]  # of each row
    scale: Array  # of each row: the size that the solver sees as one, (m,)
    components: tuple[str, ...]  # the name of each row among them
    present: NDArray[np.bool_] | None = None  # at which knots each row is, (m, N + 1); None: at all of its place

    def of(self, kept: Sequence[int]) -> Rows:
        """Return some of the rows, in this order."""
        return replace(
            self,
            expression=cs.vertcat(cs.SX(0, 1), *(self.expression[index] for index in kept)),
            scale=self.scale[list(kept)],
            units=tuple(self.units[index] for index in kept),
            components=tuple(self.components[index] for index in kept),
            present=None if self.present is None else self.present[list(kept)],
        )


@dataclass(frozen=True, kw_only=True)
class Constraint:
    """Rows of a function that have to lie in a set.

    Args:
        value: what has to lie in the set: a function of a knot, or of an interval where `holds` says so.
        within: the set: `equal()`, `at_least(...)`, `at_most(...)` or `between(...)`.
        unit: of the rows, such as `"m"`, `"N m"` or `"1"`; a tuple or a function of the parameters gives each its own.
        name: in every report; by default the function's.
        holds: one place, or several.
        scale: the size that the solver takes for one [unit]: as it is, or an `OwnSize`; by default what for the iRonCub
            is one SI unit.
        labels: names of the rows, as `("x", "y", "z")`; by default their numbers.
        when: for which problems the constraint exists; by default for all.
        rigid: `relax` does not let the rows give way unless it is told to.
        present: which of its rows exist at which of the knots where it holds; by default all.
        lazy: `Ipopt` leaves the rows out while the motion is far from their limits: for rows that seldom hold with
            equality, and that make every step cost much more.

    Raises:
        FormulationError: something of this is not what it should be.
    """

    value: KnotFunction | IntervalFunction
    within: Within
    unit: Units
    name: str = ""
    holds: Place | tuple[Place, ...] = Where.EVERY_KNOT
    scale: float | OwnSize = ONE
    labels: Labels = ()
    when: Callable[[Parameters], bool] | None = None
    rigid: bool = False
    present: Present | None = None
    lazy: bool = False

    def __post_init__(self) -> None:
        _complete(self, self.value, "holds")
        if not isinstance(self.within, Within):
            raise _wrong(self.name, f"'within' is {shown(self.within)}", "equal(), at_least(), at_most() or between()")

    @property
    def formula(self) -> str:
        """Return what the function says of itself."""
        return (self.value.__doc__ or "").strip()

    @property
    def places(self) -> tuple[Place, ...]:
        """Return where the constraint holds."""
        return self.holds if isinstance(self.holds, tuple) else (self.holds,)

    def exists(self, parameters: Parameters) -> bool:
        """Return whether the problem has the constraint, as `when` says."""
        return self.when is None or bool(_asked(self.name, "condition", self.when, parameters))

    def rows(self, at: Knot | Interval, parameters: Parameters) -> Rows:
        """Return the rows at a knot or over an interval.

        Raises:
            FormulationError: the function fails, or what it returns is not (m, 1), or a limit is no number.
        """
        expression = _evaluated(self.name, self.value, at, parameters)
        count = int(expression.shape[0])
        lower, upper = _asked(self.name, "set", self.within.limits, parameters)
        if not lower <= upper:
            raise _wrong(self.name, f"the set is {lower:g} to {upper:g}", "numbers that do not fall")
        labels = _asked(self.name, "list of labels", self.labels, parameters) if callable(self.labels) else self.labels
        if not labels:
            labels = tuple(str(index) for index in range(1, count + 1)) if count > 1 else ("",) * count
        units = _asked(self.name, "list of units", self.unit, parameters) if callable(self.unit) else self.unit
        units = (units,) * count if isinstance(units, str) else units
        for kind, given in (("labels", labels), ("units", units)):
            if len(given) != count:
                raise _wrong(self.name, f"there are {len(given)} {kind} for {count} rows", "one for each row")
        return Rows(
            expression=expression,
            lower=lower,
            upper=upper,
            units=units,
            scale=np.array([size_of(self.scale, unit, parameters.robot.units) for unit in units]),
            components=tuple(labels),
            present=None if self.present is None else self._present(count, parameters),
        )

    def _present(self, count: int, parameters: Parameters) -> NDArray[np.bool_]:
        """Return which rows there are at which knots, (count, N + 1)."""
        assert self.present is not None
        present = np.asarray(_asked(self.name, "presence", self.present, parameters))
        shape = count, parameters.scenario.knots + 1
        if present.dtype != np.bool_ or present.shape != shape:
            raise _wrong(
                self.name,
                f"'present' returns {present.dtype} of shape {present.shape}",
                f"True or False for each row at each knot, {shape}",
            )
        return present


@dataclass(frozen=True, kw_only=True)
class Cost:
    """Weight × |residual|², charged at knots or over intervals, per second or once.

    Args:
        residual: what should be small: a function of a knot, or of an interval where `charged` says so.
        weight: a number of at least zero, or a function of the parameters that returns one number, or one for each row;
            a weight of zero leaves the cost out.
        unit: of the residual, such as `"rad/s"`; a tuple or a function of the parameters gives each row its own.
        name: in every report; by default the function's.
        charged: one place, or several.
        per_second: whether each charge is multiplied by Δt, so that the sum is an integral over time.
        scale: the size of the residual that `doctor` weighs it by [unit]: as it is, or an `OwnSize`.
        when: for which problems the cost exists; by default for all.

    Raises:
        FormulationError: something of this is not what it should be.
    """

    residual: KnotFunction | IntervalFunction
    weight: float | Callable[[Parameters], float | Array]
    unit: Units
    name: str = ""
    charged: Place | tuple[Place, ...] = Where.LATER_KNOTS
    per_second: bool = True
    scale: float | OwnSize = ONE
    when: Callable[[Parameters], bool] | None = None

    def __post_init__(self) -> None:
        _complete(self, self.residual, "charged")
        if not (callable(self.weight) or (isinstance(self.weight, int | float) and 0 <= self.weight < math.inf)):
            raise _wrong(self.name, f"the weight is {shown(self.weight)}", "a number of at least zero, or a function")

    @property
    def formula(self) -> str:
        """Return what the function says of itself."""
        return (self.residual.__doc__ or "").strip()

    @property
    def places(self) -> tuple[Place, ...]:
        """Return where the cost is charged."""
        return self.charged if isinstance(self.charged, tuple) else (self.charged,)

    def exists(self, parameters: Parameters) -> bool:
        """Return whether the problem has the cost, as `when` says."""
        return self.when is None or bool(_asked(self.name, "condition", self.when, parameters))

    def units(self, parameters: Parameters) -> tuple[str, ...]:
        """Return the unit of each row of the residual, or the one of all."""
        units = _asked(self.name, "list of units", self.unit, parameters) if callable(self.unit) else self.unit
        return (units,) if isinstance(units, str) else tuple(units)

    def weights(self, parameters: Parameters) -> float | Array:
        """Return the weight: one number, or one for each row of the residual.

        Raises:
            FormulationError: it is no number of at least zero.
        """
        weight = _asked(self.name, "weight", self.weight, parameters) if callable(self.weight) else self.weight
        try:
            numbers = np.asarray(weight, dtype=float)
        except (TypeError, ValueError) as error:
            raise _wrong(self.name, f"the weight is {shown(weight)}", "numbers of at least zero") from error
        if not (np.isfinite(numbers).all() and (numbers >= 0).all()):
            raise _wrong(self.name, f"the weight is {shown(weight)}", "numbers of at least zero")
        return numbers if numbers.ndim else float(numbers)

    def charge(self, at: Knot | Interval, parameters: Parameters) -> SX:
        """Return weight × |residual|² at a knot or over an interval, (1, 1), without Δt.

        Raises:
            FormulationError: the function fails, or what it returns is not (m, 1), or has not one row for each weight.
        """
        residual = _evaluated(self.name, self.residual, at, parameters)
        weight = self.weights(parameters)
        if not isinstance(weight, float) and weight.shape != (residual.shape[0],):
            raise _wrong(
                self.name, f"there are weights of shape {weight.shape} for {residual.shape[0]} rows", "one for each row"
            )
        return cs.dot(cs.DM(weight) * residual, residual)


Term = Constraint | Cost


def _complete(term: Constraint | Cost, function: Any, place: str) -> None:
    """Give a term its function's name where it has none, and check what every term has.

    Raises:
        FormulationError: something is not what it should be.
    """
    check_fields(
        term,
        FormulationError,
        f"the term {shown(term.name)}: ",
        ("value", "residual", "within", "holds", "charged"),
    )
    for key in ("unit", "labels", place):
        if isinstance(value := getattr(term, key, None), list):
            object.__setattr__(term, key, tuple(value))
    name = term.name or getattr(function, "__name__", "")
    if not callable(function):
        raise _wrong(term.name, f"what it asks for is {shown(function)}", "a function")
    plain = isinstance(name, str) and name.isprintable() and name.strip() and "<" not in name  # no <lambda>
    if not plain or len(name) > _LONGEST:
        raise _wrong(name, "no report can call it that", f"name=... of at most {_LONGEST} printable characters")
    object.__setattr__(term, "name", name)
    places = term.places
    if not places or not all(isinstance(entry, Place) for entry in places) or len(set(places)) < len(places):
        raise _wrong(name, f"'{place}' is {shown(getattr(term, place))}", "different members of Where, or Knots")
    if len({entry.of_intervals for entry in places}) > 1:
        raise _wrong(name, f"'{place}' names knots and intervals", "only knots, or only intervals")
    size = term.scale.value if isinstance(term.scale, OwnSize) else term.scale
    if not (isinstance(size, int | float) and 0 < size < math.inf):
        raise _wrong(name, f"the scale is {shown(term.scale)}", "a positive number")
    given = () if callable(term.unit) else (term.unit,) if isinstance(term.unit, str) else term.unit
    for unit in given:
        if not isinstance(unit, str) or not _UNIT.fullmatch(unit):
            raise _wrong(name, f"the unit is {shown(unit)}", f"one made of {listed(_SYMBOLS)}, as 'm/s²' or 'N m'")


def _asked(name: str, what: str, function: Callable[[Parameters], Any], parameters: Parameters) -> Any:
    """Return what a term's function of the parameters says; a failure names the term and what was asked."""
    try:
        return function(parameters)
    except MultimodalError:
        raise
    except Exception as error:  # a user's own function may fail in any way; its own words say how
        raise FormulationError(f"the term '{name}': its {what} fails: {type(error).__name__}: {said(error)}") from error


def _evaluated(name: str, function: Callable[..., SX], at: Knot | Interval, parameters: Parameters) -> SX:
    """Return what a term's function says, as an SX column."""
    try:
        value = function(at, parameters)
    except MultimodalError as error:
        raise FormulationError(f"the term '{name}': {error}") from error
    except Exception as error:  # a user's own function may fail in any way; its own words say how
        raise FormulationError(f"the term '{name}' fails: {type(error).__name__}: {said(error)}") from error
    try:
        column = cs.SX(value)
    except Exception as error:  # CasADi has no type of its own for this
        raise _wrong(name, f"the function returns {shown(value)}", "a CasADi column, (m, 1)") from error
    if column.shape[1] != 1:
        raise _wrong(name, f"the function returns the shape {tuple(column.shape)}", "a column, (m, 1)")
    return column


def _wrong(name: object, found: str, expected: str) -> FormulationError:
    return FormulationError(f"the term {shown(name)}: {found}; expected {expected}")


_LONGEST = 60
"""Characters of a term's name, which stands in tables and progress lines."""
_SYMBOLS = ("m", "s", "kg", "N", "rad", "J", "W", "1", "%")
_POWERS = "(?:m|s|kg|N|rad|J|W)[²³⁴]?"
_UNIT = re.compile(f"(?:1|%|{_POWERS}(?: {_POWERS})*)(?:/{_POWERS}(?: {_POWERS})*)?")

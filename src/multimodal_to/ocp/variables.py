"""What is optimised: the decision variables of one knot, their layout, scales and bounds."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from multimodal_to.adam.spatial import Array
from multimodal_to.arguments import check_fields, checked
from multimodal_to.errors import FormulationError, ScenarioError, unknown
from multimodal_to.models.joint_units import either
from multimodal_to.models.robot import Robot
from multimodal_to.models.units import ONE, OwnSize, size_of
from multimodal_to.scenarios.scenario import Scenario
from multimodal_to.trajectory import QUANTITIES, row_units
from multimodal_to.values import Value


@dataclass(frozen=True)
class Variable:
    """A decision variable of every knot: a quantity of the trajectory, and the size that the solver sees as one.

    An `OwnSize` grows and shrinks with the robot; without one it is what for the iRonCub is one SI unit.

    Raises:
        FormulationError: there is no such quantity, or the scale is no positive number.
    """

    name: str  # one of `QUANTITIES`, which has its rows and its unit
    scale: float | OwnSize = ONE  # [unit of the quantity]

    def __post_init__(self) -> None:
        check_fields(self, FormulationError)
        if self.name not in QUANTITIES:
            raise FormulationError(unknown("variable", self.name, QUANTITIES))
        scale = self.scale.value if isinstance(self.scale, OwnSize) else self.scale
        if not 0 < scale < math.inf:
            raise FormulationError(f"the scale of '{self.name}' is {scale}; expected a positive number")

    @checked
    def scales(self, robot: Robot) -> list[float]:
        """Return the scale of each row of the variable, for a robot [own unit]."""
        return [size_of(self.scale, unit, robot.units) for unit in row_units(QUANTITIES[self.name], robot)]


VARIABLES = (
    Variable("com_position"),
    Variable("com_velocity"),
    Variable("angular_momentum"),
    Variable("base_position"),
    Variable("base_quaternion_xyzw"),
    Variable("base_linear_velocity"),
    Variable("base_angular_velocity"),
    Variable("joint_positions"),
    Variable("joint_velocities"),
    Variable("contact_positions"),
    Variable("contact_forces", OwnSize(50.0, of_a_point=True)),
    Variable("thrust", OwnSize(100.0)),
    Variable("thrust_rate", OwnSize(50.0)),
    Variable("throttle", 50.0),
)
"""The paper's decision variables of a knot, in their order.

ẍ, ḣω, ḟ and T̈ are no variables: an integration rule makes them differences of these.
"""
INTERVAL_SCALE = OwnSize(0.1)
"""What the solver sees as one of Δt [s]."""


@dataclass(frozen=True, eq=False)
class Layout(Value):
    """Where each decision variable stands among those of one knot."""

    rows: dict[str, slice]
    scale: Array  # (size,)

    @classmethod
    def of(cls, robot: Robot, variables: Sequence[Variable] = VARIABLES) -> Layout:
        """Return the layout of variables for a robot."""
        rows, scale = {}, list[float]()
        for variable in variables:
            own = variable.scales(robot)
            rows[variable.name] = slice(len(scale), len(scale) + len(own))
            scale += own
        return cls(rows, np.array(scale))

    @property
    def size(self) -> int:
        """Return the number of decision variables of one knot."""
        return int(self.scale.size)

    def read(self, values: Any) -> dict[str, Any]:
        """Return the variables by name from a (size, ...) array or CasADi column in their own units."""
        return {name: values[rows] for name, rows in self.rows.items()}

    def read_horizon(self, x: Array) -> dict[str, Array]:
        """Return the variables by name, (dim, N + 1) each, from all of them: the knots one after the other, and Δt."""
        return self.read(x[:-1].reshape(self.size, -1, order="F"))


@dataclass(frozen=True)
class Bounds:
    """Lower and upper bounds of every variable at every knot, in their own units: (dim, N + 1) each by name."""

    lower: dict[str, Array]
    upper: dict[str, Array]

    def copy(self) -> Bounds:
        """Return bounds that can change on their own."""
        return Bounds(*({name: side[name].copy() for name in side} for side in (self.lower, self.upper)))

    def fix(
        self, name: str, knot: int, value: Array | float, within: float = 0.0, rows: Sequence[int] | None = None
    ) -> None:
        """Hold a variable at a value at one knot.

        Args:
            name: of the variable.
            knot: which knot.
            value: in the variable's unit, (dim,) or one number for all of its rows.
            within: how far from the value it may be, in the same unit.
            rows: which of its rows are held; by default all.

        Raises:
            ScenarioError: its range does not allow that value.
        """
        some = slice(None) if rows is None else list(rows)
        low, high = self.lower[name][some, knot], self.upper[name][some, knot]
        target = np.broadcast_to(np.asarray(value, dtype=float), low.shape)
        if bad := np.flatnonzero((target < low - 1e-9) | (target > high + 1e-9)).tolist():
            quantity = QUANTITIES[name]
            unit = either(quantity.unit) if quantity.of == "joint" else quantity.unit
            raise ScenarioError(
                f"{name}[{bad[0]}] has to be {target[bad[0]]:.6g} at knot {knot}, outside its range "
                f"{low[bad[0]]:.6g} to {high[bad[0]]:.6g} {unit}"
            )
        self.lower[name][some, knot] = np.clip(target - within, low, high)
        self.upper[name][some, knot] = np.clip(target + within, low, high)


def ranges(robot: Robot, scenario: Scenario, layout: Layout) -> Bounds:
    """Return the box constraints that hold at every knot: limits of the robot, and of the scenario (eq. 28, 29).

    A quaternion has no box: its norm is what its integration keeps, and at ±1 some headings would start on a bound.

    Args:
        robot: whose limits hold.
        scenario: whose limits hold.
        layout: of the variables of a knot.
    """
    limits, jets, count = robot.joint_limits, robot.jets, scenario.knots + 1
    speed, turning = scenario.base_speeds(robot)
    reach = np.array(scenario.com_box(robot))
    box: dict[str, tuple[Any, Any]] = {
        "com_position": (-reach, reach),
        "base_linear_velocity": (-speed, speed),
        "base_angular_velocity": (-turning, turning),
        "joint_positions": (limits.lower, limits.upper),
        "joint_velocities": (-limits.speed, limits.speed),
        "thrust": (0.0, np.array([jet.thrust_max for jet in jets])),
        "throttle": (np.array([jet.throttle_min for jet in jets]), np.array([jet.throttle_max for jet in jets])),
    }
    lower, upper = {}, {}
    for name, rows in layout.rows.items():
        low, high = box.get(name, (-np.inf, np.inf))
        shape = (rows.stop - rows.start, count)
        lower[name] = np.array(np.broadcast_to(np.reshape(low, (-1, 1)), shape), dtype=float)
        upper[name] = np.array(np.broadcast_to(np.reshape(high, (-1, 1)), shape), dtype=float)
    return Bounds(lower, upper)

"""The quantities of a motion: what each array holds, in which unit and frame, and how its rows are called."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

from multimodal_to.arguments import checked
from multimodal_to.errors import InputError, unknown
from multimodal_to.models.joint_units import joint_units
from multimodal_to.models.robot import Robot
from multimodal_to.values import FrozenMapping

SCALAR = ("",)
XYZ = ("x", "y", "z")
XYZW = (*XYZ, "w")
TWIST = tuple(f"{part} {axis}" for part in ("linear", "angular") for axis in XYZ)
"""The rows of a twist, a wrench or a momentum: linear part first."""


class Bodies(Protocol):
    """What has joints, contact points and jets with names: a `Robot`, or a `Trajectory`."""

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Return the joints in the order of s."""
        ...

    @property
    def contact_names(self) -> tuple[str, ...]:
        """Return the contact points in their order."""
        ...

    @property
    def jet_names(self) -> tuple[str, ...]:
        """Return the jets in their order."""
        ...


@dataclass(frozen=True, kw_only=True)
class Quantity:
    """What one array of a trajectory holds: its rows for each body, which bodies, unit, frame and meaning."""

    axes: tuple[str, ...]  # of each body's rows; one empty text where a body has one row
    of: str  # "robot", "joint", "contact" or "jet": what the rows are repeated for
    unit: str  # of a joint's row that of a joint that turns; `row_units` has that of each
    frame: str = ""  # whose axes the rows are along; empty where they have no direction in space
    meaning: str

    @property
    def rows(self) -> int:
        """Return the number of rows for each body."""
        return len(self.axes)


def _vector(of: str, unit: str, meaning: str) -> Quantity:
    return Quantity(axes=XYZ, of=of, unit=unit, frame="world", meaning=meaning)


def _scalar(of: str, unit: str, meaning: str) -> Quantity:
    return Quantity(axes=SCALAR, of=of, unit=unit, meaning=meaning)


QUANTITIES: Mapping[str, Quantity] = FrozenMapping(
    {
        "com_position": _vector("robot", "m", "x, position of the CoM"),
        "com_velocity": _vector("robot", "m/s", "ẋ, velocity of the CoM"),
        "com_acceleration": _vector("robot", "m/s²", "ẍ, acceleration of the CoM"),
        "angular_momentum": _vector("robot", "kg m²/s", "hω, angular momentum about the CoM"),
        "angular_momentum_rate": _vector("robot", "N m", "ḣω, rate of the angular momentum about the CoM"),
        "base_position": _vector("robot", "m", "p, position of the base's origin"),
        "base_quaternion_xyzw": Quantity(
            axes=XYZW,
            of="robot",
            unit="1",
            frame="world",
            meaning="ρ, orientation of the base: world-from-base rotation, x y z w",
        ),
        "base_linear_velocity": _vector("robot", "m/s", "ṗ, velocity of the base's origin"),
        "base_angular_velocity": _vector("robot", "rad/s", "ω, angular velocity of the base"),
        "joint_positions": _scalar("joint", "rad", "s, positions of the joints"),
        "joint_velocities": _scalar("joint", "rad/s", "ṡ, velocities of the joints"),
        "contact_positions": _vector("contact", "m", "p_i, positions of the contact points"),
        "contact_forces": _vector("contact", "N", "f_i, force of the ground on the robot at each contact point"),
        "contact_force_rates": _vector("contact", "N/s", "ḟ_i, rate of that force"),
        "thrust": _scalar("jet", "N", "T, thrust along −z of the jet's frame"),
        "thrust_rate": _scalar("jet", "N/s", "Ṫ, rate of the thrust"),
        "thrust_acceleration": _scalar("jet", "N/s²", "T̈, second derivative of the thrust"),
        "throttle": _scalar("jet", "%", "u, throttle"),
    }
)
"""The arrays of a `Trajectory` by name; each is (rows × bodies, knots + 1)."""


@checked
def labels(name: str, bodies: Bodies, *, separator: str = " ") -> tuple[str, ...]:
    """Return what the rows of a quantity are called, such as `l_knee`, `l_sole_1 z`, `left arm`, or `x` of the CoM.

    Args:
        name: one of `QUANTITIES`.
        bodies: a robot or a trajectory.
        separator: what stands between a body and an axis.

    Raises:
        InputError: there is no such quantity.
    """
    if name not in QUANTITIES:
        raise InputError(unknown("quantity", name, QUANTITIES))
    return row_labels(bodies, QUANTITIES[name].of, QUANTITIES[name].axes, separator=separator)


@checked
def row_units(quantity: Quantity, robot: Robot, count: int | None = None) -> tuple[str, ...]:
    """Return the unit of each row of a quantity: that of a joint goes by whether it turns or slides.

    Args:
        quantity: of `QUANTITIES`, or one that follows from them.
        robot: whose rows they are.
        count: of the rows, where the motion has fewer of them than the robot.
    """
    if quantity.of == "joint":
        return tuple(unit for unit in joint_units(robot, quantity.unit) for _ in quantity.axes)
    bodies = {"robot": 1, "contact": len(robot.contacts), "jet": len(robot.jets)}
    return (quantity.unit,) * (quantity.rows * bodies[quantity.of] if count is None else count)


@checked
def row_labels(bodies: Bodies, of: str, axes: Sequence[str], *, separator: str = " ") -> tuple[str, ...]:
    """Return what rows are called that are repeated for each body: body and axis, as far as they have a name.

    Args:
        bodies: a robot or a trajectory.
        of: "robot", "joint", "contact" or "jet".
        axes: of each body's rows; an empty text for a row that needs none.
        separator: what stands between a body and an axis.

    Raises:
        InputError: there are no such bodies.
    """
    known = {
        "robot": ("",),
        "joint": bodies.joint_names,
        "contact": bodies.contact_names,
        "jet": bodies.jet_names,
    }
    if of not in known:
        raise InputError(unknown("kind of body", of, known))
    return tuple(separator.join(filter(None, (body, axis))) for body in known[of] for axis in axes)

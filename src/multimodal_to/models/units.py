"""The own units of a robot, and numbers that grow and shrink with it.

Two robots of one shape move alike, whatever their size, when lengths are in L, forces in m g and times in √(L/g)
(W. Froude, 1874). A number that is right for one robot is so for the other when it is written in these units.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass, replace

from multimodal_to.arguments import check_fields
from multimodal_to.errors import InputError, shown

EARTH = 9.80665
"""Standard gravity [m/s²], the unit of accelerations where a robot is weightless."""


@dataclass(frozen=True, kw_only=True)
class Units:
    """Units of mass, length and acceleration of a robot; all others follow.

    Raises:
        InputError: one is no positive number.
    """

    mass: float
    """m, of the whole robot [kg]."""
    length: float
    """L, height of the CoM above the contact points at home [m]."""
    gravity: float
    """g, or `EARTH` for a robot that is weightless [m/s²]."""
    contact_points: int = 8
    """n, how many contact points share the weight, each of them m g / n [1]."""

    def __post_init__(self) -> None:
        check_fields(self)
        if self.contact_points < 1:
            raise InputError(f"contact_points is {self.contact_points}; expected at least one")
        for name, value in (("mass", self.mass), ("length", self.length), ("gravity", self.gravity)):
            if not 0 < value < math.inf:
                raise InputError(f"{name} is {value}; expected a positive number")

    @property
    def of_a_point(self) -> Units:
        """Return the units of one contact point: its share of the mass, so that m g is what it bears."""
        return replace(self, mass=self.mass / self.contact_points, contact_points=1)

    @property
    def frequency(self) -> float:
        """Return √(g / L) [1/s]."""
        return math.sqrt(self.gravity / self.length)

    @property
    def force(self) -> float:
        """Return m g [N]."""
        return self.mass * self.gravity

    @property
    def moment(self) -> float:
        """Return m g L [N m]."""
        return self.force * self.length

    def of(self, unit: str) -> float:
        """Return the robot's own unit for an SI unit, in that unit: `of("N")` is m g, `of("s")` is √(L/g).

        Angles, shares and percent have no unit of the robot's: for these it is one.

        Args:
            unit: made of m, s, kg, N, J, W, rad, 1 and %, as "kg m²/s".

        Raises:
            InputError: it is no such unit.
        """
        time, force = math.sqrt(self.length / self.gravity), self.force
        own = {
            "m": self.length,
            "s": time,
            "kg": self.mass,
            "N": force,
            "J": force * self.length,
            "W": force * self.length / time,
            "rad": 1.0,
            "1": 1.0,
            "%": 1.0,
        }
        above, _, below = unit.partition("/")
        size = 1.0
        for text, sign in ((above, 1), (below, -1)):
            for symbol in text.split():
                found = _SYMBOL.fullmatch(symbol)
                if not found or found[1] not in own:
                    raise InputError(f"{shown(unit)} is no unit; expected one made of {', '.join(own)}, as 'kg m²/s'")
                size *= own[found[1]] ** (sign * _POWERS[found[2]])
        return size


_POWERS = {"": 1, "²": 2, "³": 3, "⁴": 4}
_SYMBOL = re.compile("([A-Za-z1%]+)([²³⁴]?)")

_AS_WRITTEN = 1e-3
"""How far a robot may be from the `REFERENCE` for numbers to be as they are written [1]: last digits change none."""

REFERENCE = Units(mass=44.74, length=0.5765, gravity=9.807)
"""The size of robot that a `Sized` number is written for: the iRonCub's."""


@dataclass(frozen=True)
class Sized:
    """A number that grows and shrinks with the robot: a size that is right for a robot of the `REFERENCE` units.

    Raises:
        InputError: the unit is none.
    """

    value: float  # for a robot of the reference size [unit]
    unit: str
    of_a_point: bool = False  # it goes by what one contact point bears, and not by the whole robot

    def __post_init__(self) -> None:
        check_fields(self)
        REFERENCE.of(self.unit)

    def of(self, units: Units) -> float:
        """Return the number for a robot [unit]; one of the reference size, to a thousandth, has it as it is written."""
        own, written = (one.of_a_point if self.of_a_point else one for one in (units, REFERENCE))
        ratio = own.of(self.unit) / written.of(self.unit)
        return self.value * ratio if abs(ratio - 1.0) > _AS_WRITTEN else float(self.value)


@dataclass(frozen=True)
class OwnSize:
    """A size that grows and shrinks with the robot, in whatever unit the thing has that it is the size of."""

    value: float  # for a robot of the reference size [unit of the thing]
    of_a_point: bool = False  # it goes by what one contact point bears, and not by the whole robot

    def of(self, unit: str, units: Units) -> float:
        """Return the size for a robot, of a thing in a unit [that unit]."""
        return Sized(self.value, unit, self.of_a_point).of(units)


ONE = OwnSize(1.0)
"""What for a robot of the reference size is one SI unit."""
ONE_OF_A_POINT = OwnSize(1.0, of_a_point=True)
"""The same of what goes by the load of a contact point."""


def sized(number: float | Sized, units: Units) -> float:
    """Return a number as it is, and one that is `Sized` for a robot."""
    return number.of(units) if isinstance(number, Sized) else float(number)


def size_of(scale: float | OwnSize, unit: str, units: Units) -> float:
    """Return a size as it is, and an `OwnSize` for a robot.

    Args:
        scale: the size.
        unit: of the thing that it is the size of.
        units: the robot's own.
    """
    return scale.of(unit, units) if isinstance(scale, OwnSize) else float(scale)

"""Engines: how the thrust of a jet follows its throttle, by a law of order two, one or none.

The law of order two is that of a model jet turbine: G. L'Erario et al., "Modeling, identification and control of model
jet engines for jet powered robotics", RA-L 2020, equation (8) of L'Erario et al. 2022. The others are for rotors and
fans.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from multimodal_to.adam.spatial import SX
from multimodal_to.arguments import check_fields
from multimodal_to.errors import InputError, ModelError
from multimodal_to.models.capsule import Capsule


class Engine(ABC):
    """How the thrust T [N] of a jet follows its throttle u [%].

    Its state is (T, Ṫ) where `order` is two, T where it is one, and nothing where it is none: then T follows u at once.
    """

    order: ClassVar[int]

    @abstractmethod
    def slopes(self, thrust: SX, thrust_rate: SX, throttle: SX) -> tuple[SX, SX]:
        """Return how fast the state changes: Ṫ [N/s] and T̈ [N/s²]; zero for what is no part of it.

        Args:
            thrust: T [N].
            thrust_rate: Ṫ [N/s].
            throttle: u [%].
        """

    @abstractmethod
    def imbalance(self, thrust: SX, throttle: SX) -> SX:
        """Return what is zero where a throttle holds a thrust: T̈ [N/s²], Ṫ [N/s] or what is missing of T [N], by order.

        Args:
            thrust: T [N].
            throttle: u [%].
        """

    @abstractmethod
    def steady_throttle(self, thrust: float) -> float:
        """Return the throttle [%] that holds a thrust [N].

        Raises:
            InputError: no throttle does.
        """

    @abstractmethod
    def throttle_for(self, thrust: float, thrust_rate: float, slope: float, most: float) -> float:
        """Return the throttle [%] for a slope of the last of the state, T̈ or Ṫ, or for the thrust itself, by order.

        Args:
            thrust: T [N].
            thrust_rate: Ṫ [N/s].
            slope: that is wanted [N/s², N/s or N].
            most: greatest throttle [%], returned where none gives the slope.
        """


@dataclass(frozen=True, kw_only=True)
class JetModel(Engine):
    """Identified coefficients of T̈ = f(T, Ṫ) + g(T, Ṫ) (u + B_UU u²); T in N, time in s, throttle u in %.

    f = K_T T + K_TT T² + K_D Ṫ + K_DD Ṫ² + K_TD T Ṫ + c and g = B_U + B_T T + B_D Ṫ.
    """

    order: ClassVar[int] = 2

    K_T: float
    """Coefficient of T in T̈ [1/s²]."""
    K_TT: float
    """Coefficient of T² in T̈ [1/(N s²)]."""
    K_D: float
    """Coefficient of Ṫ in T̈ [1/s]."""
    K_DD: float
    """Coefficient of Ṫ² in T̈ [1/N]."""
    K_TD: float
    """Coefficient of T Ṫ in T̈ [1/(N s)]."""
    B_U: float
    """Coefficient of the input in T̈ [N/(% s²)]."""
    B_T: float
    """Coefficient of T × the input in T̈ [1/(% s²)]."""
    B_D: float
    """Coefficient of Ṫ × the input in T̈ [1/(% s)]."""
    B_UU: float
    """Coefficient of u² in the input u + B_UU u² [1/%]."""
    c: float
    """Constant part of T̈ [N/s²]."""

    def __post_init__(self) -> None:
        check_fields(self, ModelError, "the jet model's ", finite=True)

    def acceleration(self, thrust: SX, thrust_rate: SX, throttle: SX) -> SX:
        """Return T̈ [N/s²].

        Args:
            thrust: T [N].
            thrust_rate: Ṫ [N/s].
            throttle: u [%].
        """
        drift = (
            self.K_T * thrust
            + self.K_TT * thrust**2
            + self.K_D * thrust_rate
            + self.K_DD * thrust_rate**2
            + self.K_TD * thrust * thrust_rate
            + self.c
        )
        gain = self.B_U + self.B_T * thrust + self.B_D * thrust_rate
        return drift + gain * (throttle + self.B_UU * throttle**2)

    def slopes(self, thrust: SX, thrust_rate: SX, throttle: SX) -> tuple[SX, SX]:
        """Return Ṫ [N/s] and T̈ [N/s²].

        Args:
            thrust: T [N].
            thrust_rate: Ṫ [N/s].
            throttle: u [%].
        """
        return thrust_rate, self.acceleration(thrust, thrust_rate, throttle)

    def imbalance(self, thrust: SX, throttle: SX) -> SX:
        """Return T̈ [N/s²] where Ṫ = 0."""
        return self.acceleration(thrust, 0.0, throttle)

    def throttle_for(self, thrust: float, thrust_rate: float, slope: float, most: float) -> float:
        """Return the throttle [%] with u + B_UU u² = (T̈ − f) / g.

        Args:
            thrust: T [N].
            thrust_rate: Ṫ [N/s].
            slope: T̈ that is wanted [N/s²].
            most: greatest throttle [%], returned where none gives the slope.
        """
        gain = self.B_U + self.B_T * thrust + self.B_D * thrust_rate
        wanted = (slope - float(self.acceleration(thrust, thrust_rate, 0.0))) / gain
        root = 1.0 + 4.0 * self.B_UU * wanted
        return most if root < 0.0 else float(2.0 * wanted / (1.0 + root**0.5))

    def steady_throttle(self, thrust: float) -> float:
        """Return the throttle [%] that holds a thrust [N]: T̈ = Ṫ = 0.

        Raises:
            InputError: no throttle does.
        """
        drift = float(self.acceleration(thrust, 0.0, 0.0))
        gain = self.B_U + self.B_T * thrust
        roots = np.roots([gain * self.B_UU, gain, drift])
        real = [float(root.real) for root in roots if abs(root.imag) < 1e-9]
        if not real:
            raise InputError(f"no throttle holds a thrust of {thrust} N")
        return min(real, key=abs)


@dataclass(frozen=True, kw_only=True)
class FirstOrder(Engine):
    """A lag: τ Ṫ = k u − T, as a rotor behind its motor or a ducted fan has it."""

    order: ClassVar[int] = 1

    gain: float
    """k: the steady thrust for each percent of throttle [N/%]."""
    time_constant: float
    """τ: the thrust comes this close to its end by a factor of e [s]."""

    def __post_init__(self) -> None:
        _positive("gain", self.gain)
        _positive("time_constant", self.time_constant)

    def slopes(self, thrust: SX, thrust_rate: SX, throttle: SX) -> tuple[SX, SX]:
        """Return Ṫ = (k u − T) / τ [N/s], and zero.

        Args:
            thrust: T [N].
            thrust_rate: of no effect.
            throttle: u [%].
        """
        rate = (self.gain * throttle - thrust) / self.time_constant
        return rate, 0.0 * rate

    def imbalance(self, thrust: SX, throttle: SX) -> SX:
        """Return Ṫ = (k u − T) / τ [N/s]."""
        return (self.gain * throttle - thrust) / self.time_constant

    def steady_throttle(self, thrust: float) -> float:
        """Return the throttle T / k [%]."""
        return thrust / self.gain

    def throttle_for(self, thrust: float, thrust_rate: float, slope: float, most: float) -> float:
        """Return the throttle (T + τ Ṫ) / k [%].

        Args:
            thrust: T [N].
            thrust_rate: of no effect.
            slope: Ṫ that is wanted [N/s].
            most: of no effect.
        """
        return (thrust + self.time_constant * slope) / self.gain


@dataclass(frozen=True, kw_only=True)
class StaticMap(Engine):
    """Thrust at once: T = k u + k₂ u², where an engine is much faster than the motion."""

    order: ClassVar[int] = 0

    gain: float
    """k: the thrust for each percent of throttle [N/%]."""
    curvature: float = 0.0
    """k₂: the thrust for each square of a percent [N/%²]."""

    def __post_init__(self) -> None:
        for name, value in (("gain", self.gain), ("curvature", self.curvature)):
            if value < 0:
                raise InputError(f"{name} is {value}; expected zero or more")
        if not self.gain + self.curvature > 0:
            raise InputError("gain and curvature are zero; expected one of them above 0")

    def thrust(self, throttle: SX) -> SX:
        """Return T = k u + k₂ u² [N]."""
        return self.gain * throttle + self.curvature * throttle**2

    def slopes(self, thrust: SX, thrust_rate: SX, throttle: SX) -> tuple[SX, SX]:
        """Return zeros: there is no state.

        Args:
            thrust: of no effect.
            thrust_rate: of no effect.
            throttle: of no effect.
        """
        return 0.0 * thrust, 0.0 * thrust

    def imbalance(self, thrust: SX, throttle: SX) -> SX:
        """Return k u + k₂ u² − T [N]."""
        return self.thrust(throttle) - thrust

    def steady_throttle(self, thrust: float) -> float:
        """Return the throttle that gives a thrust [%]; that of −T is its negative."""
        size = abs(thrust)
        root = (self.gain**2 + 4.0 * self.curvature * size) ** 0.5
        return float(np.copysign(2.0 * size / (self.gain + root) if size else 0.0, thrust))

    def throttle_for(self, thrust: float, thrust_rate: float, slope: float, most: float) -> float:
        """Return the throttle that gives a thrust [%].

        Args:
            thrust: of no effect.
            thrust_rate: of no effect.
            slope: T that is wanted [N].
            most: of no effect.
        """
        return self.steady_throttle(slope)


ENGINES: Mapping[str, type[Engine]] = {"second-order": JetModel, "first-order": FirstOrder, "static": StaticMap}
"""The engines by the `kind` that a `robot.toml` calls them; the first is meant where it says none."""


def _positive(name: str, number: float) -> None:
    if not number > 0:
        raise InputError(f"{name} is {number}; expected a positive number")


@dataclass(frozen=True, kw_only=True)
class Jet:
    """An engine on the robot: a force T along −z of `frame`, at its origin, and a moment about the same axis."""

    name: str
    frame: str
    model: Engine
    thrust_max: float  # [N]
    throttle_min: float  # [%]
    throttle_max: float  # [%]
    plume: Capsule | None = None  # its exhaust, along +z of `frame`
    drag: float = 0.0  # moment on the robot about the direction of the thrust, right-handed, for each newton of it [m]

    def __post_init__(self) -> None:
        check_fields(self, ModelError, "the jet's ", finite=True)

"""Thrust dynamics of a model jet turbine.

Source: G. L'Erario et al., "Modeling, identification and control of model jet engines for jet powered robotics",
RA-L 2020, equation (8) of L'Erario et al. 2022.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from multimodal_to.adam.spatial import SX
from multimodal_to.arguments import check_fields
from multimodal_to.errors import InputError, ModelError
from multimodal_to.models.capsule import Capsule


@dataclass(frozen=True, kw_only=True)
class JetModel:
    """Identified coefficients of T̈ = f(T, Ṫ) + g(T, Ṫ) (u + B_UU u²); T in N, time in s, throttle u in %.

    f = K_T T + K_TT T² + K_D Ṫ + K_DD Ṫ² + K_TD T Ṫ + c and g = B_U + B_T T + B_D Ṫ.
    """

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
class Jet:
    """A turbine on the robot: a pure force of size T along −z of `frame`, at its origin."""

    name: str
    frame: str
    model: JetModel
    thrust_max: float  # [N]
    throttle_min: float  # [%]
    throttle_max: float  # [%]
    plume: Capsule | None = None  # its exhaust, along +z of `frame`

    def __post_init__(self) -> None:
        check_fields(self, ModelError, "the jet's ", finite=True)

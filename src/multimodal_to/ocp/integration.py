"""Integration rules: what acts over an interval, of quantities that are known at its two ends (eq. 24 to 27)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

from multimodal_to.adam import quaternion
from multimodal_to.adam.spatial import SX
from multimodal_to.ocp.knot import Knot
from multimodal_to.trajectory.trajectory import PAPER_RULE


class IntegrationRule(Protocol):
    """A one-step rule: y⁺ = y + φ Δt, where the rule says what the rate φ is."""

    @property
    def name(self) -> str:
        """Return what the record of a solve calls it."""
        ...

    def over(self, quantity: Callable[[Knot], SX], start: Knot, end: Knot) -> SX:
        """Return φ: what a quantity of knots is over the interval between two of them.

        Args:
            quantity: a function of a knot, such as its CoM velocity, or the rate of the thrust that its throttle makes.
            start: the interval's first knot.
            end: the interval's second knot.
        """
        ...


@dataclass(frozen=True)
class BackwardEuler:
    """φ is the rate at the interval's end: y⁺ = y + ẏ⁺ Δt. It is the paper's rule, of order one."""

    name: str = PAPER_RULE

    def over(self, quantity: Callable[[Knot], SX], start: Knot, end: Knot) -> SX:
        """Return the quantity at the interval's end.

        Args:
            quantity: a function of a knot.
            start: the interval's first knot.
            end: the interval's second knot.
        """
        return quantity(end)


BACKWARD_EULER = BackwardEuler()


@dataclass(frozen=True)
class Interval:
    """Two knots in sequence, the time between them, and the rule that ties them."""

    start: Knot
    end: Knot
    duration: SX  # Δt [s], (1, 1)
    rule: IntegrationRule

    def over(self, quantity: Callable[[Knot], SX]) -> SX:
        """Return what a quantity of knots is over the interval, by its rule."""
        return self.rule.over(quantity, self.start, self.end)

    def gap(self, quantity: Callable[[Knot], SX], rate: Callable[[Knot], SX]) -> SX:
        """Return y⁺ − y − φ Δt, which is zero where the interval closes.

        Args:
            quantity: y as a function of a knot, (m, 1).
            rate: ẏ as a function of a knot, (m, 1).
        """
        return quantity(self.end) - quantity(self.start) - self.over(rate) * self.duration

    def rotation_gap(self, orientation: Callable[[Knot], SX], angular_velocity: Callable[[Knot], SX]) -> SX:
        """Return ρ⁺ − Exp(ω Δt) ∘ ρ, (4, 1), which is zero where the interval closes (eq. 25b).

        Args:
            orientation: ρ as a function of a knot, a quaternion x y z w, (4, 1).
            angular_velocity: ω as a function of a knot, world axes [rad/s], (3, 1).
        """
        turn = quaternion.exp(self.over(angular_velocity) * self.duration)
        return orientation(self.end) - quaternion.product(turn, orientation(self.start))

    def rate(self, quantity: Callable[[Knot], SX]) -> SX:
        """Return (y⁺ − y) / Δt, the mean rate of a quantity of knots."""
        return (quantity(self.end) - quantity(self.start)) / self.duration

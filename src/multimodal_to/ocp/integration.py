"""Integration rules: how the knots of an interval are tied, as a value of the formulation."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Protocol

from multimodal_to.adam import quaternion
from multimodal_to.adam.spatial import SX
from multimodal_to.ocp.knot import Knot
from multimodal_to.trajectory import rules
from multimodal_to.values import Value

KnotQuantity = Callable[[Knot], SX]
"""A quantity as a function of a knot, (m, 1)."""


class IntegrationRule(Protocol):
    """Says what acts between two knots. Positions y follow y⁺ = y + v Δt, velocities v follow v⁺ = v + a Δt."""

    @property
    def name(self) -> str:
        """Return what a trajectory calls it."""
        ...

    def over(self, quantity: KnotQuantity, start: Knot, end: Knot) -> SX:
        """Return what a velocity, which moves positions, is over the interval.

        Args:
            quantity: as a function of a knot.
            start: the interval's first knot.
            end: the interval's second knot.
        """
        ...

    def at_accelerations(self, start: Knot, end: Knot) -> Knot:
        """Return what acts between the velocities of two knots: configuration, forces and throttles that change them.

        Args:
            start: the knot whose velocities are changed.
            end: the knot whose velocities come out.
        """
        ...

    def at_velocities(self, end: Knot, duration: SX) -> Knot:
        """Return the configuration at the instant of the velocities that a knot holds.

        Args:
            end: the knot that holds the velocities.
            duration: Δt of the interval that ends there [s].
        """
        ...


@dataclass(frozen=True)
class BackwardEuler:
    """Everything is at the interval's end: y⁺ = y + v⁺ Δt, v⁺ = v + a⁺ Δt. The paper's rule, of order one."""

    name: str = rules.BACKWARD_EULER

    def over(self, quantity: KnotQuantity, start: Knot, end: Knot) -> SX:
        """Return the quantity at the interval's end.

        Args:
            quantity: as a function of a knot.
            start: the interval's first knot.
            end: the interval's second knot.
        """
        return quantity(end)

    def at_accelerations(self, start: Knot, end: Knot) -> Knot:
        """Return the interval's end.

        Args:
            start: the interval's first knot.
            end: the interval's second knot.
        """
        return end

    def at_velocities(self, end: Knot, duration: SX) -> Knot:
        """Return the knot itself."""
        return end


BACKWARD_EULER = BackwardEuler()


@dataclass(frozen=True)
class Leapfrog:
    """Velocities are in the middles of intervals; all else is at the knots.

    y_k+1 = y_k + v_k+½ Δt and v_k+½ = v_k−½ + a_k Δt, with a_k of the configuration, forces and throttles of knot k and
    the mean of its two velocities. The method of Störmer and Verlet, of order two; a foot that stands has no velocity
    that could ring. A knot holds the velocities of the interval that ends there.
    """

    name: str = rules.LEAPFROG

    def over(self, quantity: KnotQuantity, start: Knot, end: Knot) -> SX:
        """Return the velocity of the interval, which its end holds.

        Args:
            quantity: as a function of a knot.
            start: the interval's first knot.
            end: the interval's second knot.
        """
        return quantity(end)

    def at_accelerations(self, start: Knot, end: Knot) -> Knot:
        """Return the interval's start, where two intervals meet, with the mean of their velocities.

        Args:
            start: the knot at which the intervals meet, which holds the first one's velocities.
            end: the knot that holds the second one's.
        """
        means = {name: 0.5 * (getattr(start, name) + getattr(end, name)) for name in rules.VELOCITIES}
        return replace(start, **means)

    def at_velocities(self, end: Knot, duration: SX) -> Knot:
        """Return the configuration in the middle of the interval: half a step back from its end.

        Args:
            end: the interval's second knot.
            duration: Δt [s].
        """
        half = 0.5 * duration
        turn = quaternion.exp(-half * end.base_angular_velocity)
        return replace(
            end,
            com_position=end.com_position - half * end.com_velocity,
            base_position=end.base_position - half * end.base_linear_velocity,
            base_quaternion_xyzw=end.lift(quaternion.product(turn, end.base_quaternion_xyzw)),
            joint_positions=end.lift(end.joint_positions - half * end.joint_velocities),
        )


LEAPFROG = Leapfrog()


@dataclass(frozen=True, eq=False)
class Interval(Value):
    """Two knots in sequence, the time between them, and the rule that ties them."""

    start: Knot
    end: Knot
    duration: SX  # Δt [s], (1, 1)
    rule: IntegrationRule

    @cached_property
    def at_velocities(self) -> Knot:
        """Return the configuration at the instant of the velocities that the interval's end holds."""
        return self.rule.at_velocities(self.end, self.duration)

    @cached_property
    def at_accelerations(self) -> Knot:
        """Return the knot where velocities change, with the velocities that it has at that instant."""
        return self.rule.at_accelerations(self.start, self.end)

    def over(self, quantity: KnotQuantity) -> SX:
        """Return what a velocity of knots is over the interval."""
        return self.rule.over(quantity, self.start, self.end)

    def mean(self, quantity: KnotQuantity) -> SX:
        """Return the mean over the interval of what follows the throttles of knots, which act as the rule says."""
        after = rules.acts_after(self.rule.name)
        return after * quantity(self.start) + (1.0 - after) * quantity(self.end) if after else quantity(self.end)

    def gap(self, quantity: KnotQuantity, rate: KnotQuantity) -> SX:
        """Return y⁺ − y − v Δt of something like a position, which is zero where the interval closes.

        Args:
            quantity: y as a function of a knot, (m, 1).
            rate: v as a function of a knot, (m, 1).
        """
        return quantity(self.end) - quantity(self.start) - self.over(rate) * self.duration

    def velocity_gap(self, quantity: KnotQuantity, rate: KnotQuantity) -> SX:
        """Return v⁺ − v − a Δt of something like a velocity, which is zero where its change is explained.

        Args:
            quantity: v as a function of a knot, (m, 1).
            rate: a as a function of a knot, (m, 1).
        """
        return quantity(self.end) - quantity(self.start) - rate(self.at_accelerations) * self.duration

    def rotation_gap(self, orientation: KnotQuantity, angular_velocity: KnotQuantity) -> SX:
        """Return ρ⁺ − Exp(ω Δt) ∘ ρ, (4, 1), which is zero where the interval closes (eq. 25b).

        Args:
            orientation: ρ as a function of a knot, a quaternion x y z w, (4, 1).
            angular_velocity: ω as a function of a knot, world axes [rad/s], (3, 1).
        """
        turn = quaternion.exp(self.over(angular_velocity) * self.duration)
        return orientation(self.end) - quaternion.product(turn, orientation(self.start))

    def rate(self, quantity: KnotQuantity) -> SX:
        """Return (y⁺ − y) / Δt, the mean rate of a quantity of knots."""
        return (quantity(self.end) - quantity(self.start)) / self.duration

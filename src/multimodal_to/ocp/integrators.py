"""Backward Euler: what an interval's end has to be, given its start and the rates at its end (eq. 24 to 27)."""

from __future__ import annotations

from multimodal_to.adam import quaternion
from multimodal_to.adam.spatial import SX


def gap(start: SX, end: SX, rate_at_end: SX, dt: SX) -> SX:
    """Return end − start − rate Δt, zero when the interval closes."""
    return end - start - rate_at_end * dt


def rotation_gap(start: SX, end: SX, angular_velocity_at_end: SX, dt: SX) -> SX:
    """Return ρ⁺ − Exp(ω⁺ Δt) ∘ ρ, (4, 1), quaternions x y z w and ω in world axes (eq. 25b)."""
    return end - quaternion.product(quaternion.exp(angular_velocity_at_end * dt), start)

"""Rate of change of the centroidal momentum under contact forces and thrusts (eq. 13 of L'Erario et al. 2022)."""

from __future__ import annotations

from collections.abc import Iterable

import casadi as cs

from multimodal_to.adam.spatial import SX


def momentum_rate(mass: float, gravity: SX, com: SX, forces: Iterable[tuple[SX, SX]]) -> tuple[SX, SX]:
    """Return m ẍ = m g + Σ f [N] and ḣω = Σ (p − x) × f [N m], (3, 1) each, about the CoM in world axes.

    Args:
        mass: of the robot [kg].
        gravity: acceleration of free fall [m/s²], (3, 1).
        com: x, position of the CoM [m], (3, 1).
        forces: pairs of a point [m] and the force that acts there [N], (3, 1) each.
    """
    linear, angular = mass * gravity, cs.SX.zeros(3)
    for point, force in forces:
        linear = linear + force
        angular = angular + cs.cross(point - com, force)
    return linear, angular


def thrust_force(rotation: SX, thrust: SX) -> SX:
    """Return the force of a jet [N], (3, 1): R (0, 0, −T), along −z of its frame (eq. 5)."""
    return -rotation[:, 2] * thrust


def drag_moment(rotation: SX, thrust: SX, drag: float) -> SX:
    """Return the moment of a rotor's drag on the robot [N m], (3, 1): R (0, 0, −κ T), along the thrust.

    Args:
        rotation: of the jet's frame, (3, 3).
        thrust: T [N].
        drag: κ [m].
    """
    return -rotation[:, 2] * (drag * thrust)

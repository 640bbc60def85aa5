"""Contact of a point with a surface: friction, and the relaxed complementarity of force with height and with sliding.

Equation numbers are those of L'Erario et al. 2022. Points [m], forces on the robot [N] and displacements [m] are
(3, 1) in the world.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

import casadi as cs

from multimodal_to.adam.spatial import SX
from multimodal_to.arguments import check_fields
from multimodal_to.errors import ModelError
from multimodal_to.models.terrain import Surface


@dataclass(frozen=True, kw_only=True)
class ContactPoint:
    """A point of the robot that may touch the ground: the origin of `frame`, a corner of `foot`."""

    frame: str
    foot: str

    def __post_init__(self) -> None:
        check_fields(self, ModelError, "the contact point's ")


class FrictionCone(Enum):
    """Which forces a contact point can bear without slipping, with the coefficient μ."""

    PYRAMID = "pyramid"
    """|t·f| ≤ μ n·f for each of the two tangents: four-sided, circumscribed about the cone (eq. 12)."""
    SECOND_ORDER = "second-order"
    """‖t·f‖ ≤ μ n·f: Coulomb's round cone."""


DESCENT_RATE = 1.2
"""κ: how much faster a point may come down the higher it is above where it touches the ground [√(g / L)]."""


def normal_force(surface: Surface, point: SX, force: SX) -> SX:
    """Return n(p)ᵀ f [N].

    Args:
        surface: the ground.
        point: where the force acts [m], (3, 1), world.
        force: on the robot [N], (3, 1), world.
    """
    return cs.dot(surface.normal(point), force)


def friction_pyramid(surface: Surface, point: SX, force: SX, friction: float, force_size: float = 1.0) -> SX:
    """Return the four distances to the faces of the pyramid [N], (4, 1), none negative inside: μ n·f ∓ t·f (eq. 12).

    All of them together also make the normal force non-negative.

    Args:
        surface: the ground.
        point: where the force acts [m], (3, 1), world.
        force: on the robot [N], (3, 1), world.
        friction: μ [1].
        force_size: of a contact force [N]; the pyramid does not need it.
    """
    along = surface.tangents(point).T @ force
    reach = friction * normal_force(surface, point, force)
    return cs.vertcat(reach - along, reach + along)


def friction_cone(surface: Surface, point: SX, force: SX, friction: float, force_size: float = 1.0) -> SX:
    """Return n·f and ((μ n·f)² − ‖t·f‖²) / F [N], (2, 1), none negative inside the second-order cone.

    Polynomial in the force, so smooth at f = 0 as well, where the norm itself is not; the first row chooses between the
    two cones of the second.

    Args:
        surface: the ground.
        point: where the force acts [m], (3, 1), world.
        force: on the robot [N], (3, 1), world.
        friction: μ [1].
        force_size: F, the size of a contact force [N], so that the row of squares is in N and of that size.
    """
    along, normal = surface.tangents(point).T @ force, normal_force(surface, point, force)
    return cs.vertcat(normal, ((friction * normal) ** 2 - cs.sumsqr(along)) / force_size)


FRICTION = {FrictionCone.PYRAMID: friction_pyramid, FrictionCone.SECOND_ORDER: friction_cone}
"""The rows of each kind of cone."""
FACES = {FrictionCone.PYRAMID: ("+x", "+y", "-x", "-y"), FrictionCone.SECOND_ORDER: ("normal", "cone")}
"""What the rows of each kind are called: the pyramid's by the way along the ground in which the force is too large."""


def complementarity(surface: Surface, point: SX, force: SX) -> SX:
    """Return d(p) n(p)ᵀ f [N m]: zero when no force acts on a point in the air (eq. 10).

    Args:
        surface: the ground.
        point: where the force acts [m], (3, 1), world.
        force: on the robot [N], (3, 1), world.
    """
    return surface.distance(point) * normal_force(surface, point, force)


def sliding(surface: Surface, point: SX, force: SX, displacement: SX) -> SX:
    """Return t(p)ᵀ Δp n(p)ᵀ f [N m], (2, 1): zero when a loaded point stays where it is (eq. 11).

    Args:
        surface: the ground.
        point: where the force acts [m], (3, 1), world.
        force: on the robot [N], (3, 1), world.
        displacement: Δp, how far the point moved over the interval [m], (3, 1), world.
    """
    return surface.tangents(point).T @ displacement * normal_force(surface, point, force)

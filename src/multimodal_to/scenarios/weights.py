"""`Weights`: how the qualities of a motion are weighed against each other."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields

from multimodal_to.arguments import check_fields, refuse_negative
from multimodal_to.errors import ScenarioError
from multimodal_to.values import FrozenMapping


@dataclass(frozen=True, kw_only=True)
class Weights:
    """Weight of each cost; a weight of zero adds nothing to the problem.

    Running costs are weight × squared 2-norm × Δt at the end of every interval; `initial_posture` and `final_*` are
    weight × squared 2-norm at that knot, without Δt. The objective has no unit; in the units of running weights the
    1/s that Δt asks for is left out.
    """

    com_velocity: float = 0.0
    """Weight of ẋ, the velocity of the CoM [1/(m/s)²]."""
    com_acceleration: float = 0.0
    """Weight of ẍ, the acceleration of the CoM [1/(m/s²)²]."""
    angular_momentum: float = 0.0
    """Weight of hω, about the CoM [1/(kg m²/s)²]."""
    angular_momentum_rate: float = 0.0
    """Weight of ḣω [1/(N m)²]."""
    base_acceleration: float = 0.0
    """Weight of v̇, of the base's twist [1/(m/s²)², 1/(rad/s²)²]."""
    joint_velocities: Mapping[str, float] = field(default_factory=dict)
    """Weights of ṡ by joint group of the robot [1/(rad/s)² or 1/(m/s)²]."""
    posture: float = 0.0
    """Weight of s − s̄, away from the standing posture [1/rad² or 1/m²]."""
    base_orientation: float = 0.0
    """Weight of the base away from home, as a quaternion's vector part [1]."""
    contact_forces: float = 0.0
    """Weight of f [1/N²]."""
    contact_force_rates: float = 0.0
    """Weight of ḟ [1/(N/s)²]."""
    thrust: float = 0.0
    """Weight of T [1/N²]."""
    thrust_rate: float = 0.0
    """Weight of Ṫ [1/(N/s)²]."""
    throttle: float = 0.0
    """Weight of u [1/%²]."""
    throttle_rate: float = 0.0
    """Weight of u̇ [1/(%/s)²]."""
    joint_accelerations: float = 0.0
    """Weight of s̈ [1/(rad/s²)² or 1/(m/s²)²]."""
    foot_tilt: float = 0.0
    """Weight of soles that are not level with the ground: heights of their points, over the standing height L [1]."""
    skimming: float = 0.0
    """Weight of contact points that move along the ground close to it, over √(g L) [1]."""
    initial_posture: float = 0.0
    """Weight of s − s̄ at the first knot, where it is found [1/rad² or 1/m²]."""
    final_posture: float = 0.0
    """Weight of s − the standing posture, at the last knot [1/rad² or 1/m²]."""
    final_com_velocity: float = 0.0
    """Weight of ẋ at the last knot [1/(m/s)²]."""
    final_com_acceleration: float = 0.0
    """Weight of ẍ at the last knot [1/(m/s²)²]."""
    final_angular_momentum: float = 0.0
    """Weight of hω at the last knot [1/(kg m²/s)²]."""
    final_angular_momentum_rate: float = 0.0
    """Weight of ḣω at the last knot [1/(N m)²]."""

    def __post_init__(self) -> None:
        check_fields(self, ScenarioError, "weight ")
        for entry in fields(self):
            value = getattr(self, entry.name)
            for number in value.values() if isinstance(value, Mapping) else (value,):
                refuse_negative(f"weight '{entry.name}'", number, ScenarioError)
        object.__setattr__(self, "joint_velocities", FrozenMapping(self.joint_velocities))

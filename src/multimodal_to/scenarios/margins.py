"""`Margins`: how far a plan stays away from the edge of what the robot can do."""

from __future__ import annotations

from dataclasses import dataclass, fields

from multimodal_to.arguments import check_fields, refuse_negative
from multimodal_to.errors import ScenarioError


@dataclass(frozen=True, kw_only=True)
class Margins:
    """How far a plan stays away from the edge of what the robot can do; a margin of zero asks for nothing.

    Speeds are in the robot's own unit √(g L), with L the height of its CoM above its contact points at home.
    """

    torque: float = 0.9
    """Greatest torque of a joint, as a share of its effort limit [1]."""
    friction: float = 0.85
    """Share of the friction that a plan may use [1]."""
    pressure: float = 0.75
    """Size of the sole that a foot's centre of pressure stays in, as a share of the whole sole [1]."""
    touch_down_speed: float = 0.04
    """Greatest speed at which a contact point comes to the ground [√(g L)]."""
    distance: float = 0.01
    """Least distance between links of the robot that are not neighbours [L]."""

    def __post_init__(self) -> None:
        check_fields(self, ScenarioError, "margin ")
        for entry in fields(self):
            refuse_negative(f"margin '{entry.name}'", getattr(self, entry.name), ScenarioError)

    @classmethod
    def none(cls) -> Margins:
        """Return margins that ask for nothing."""
        return cls(**{entry.name: 0.0 for entry in fields(cls)})

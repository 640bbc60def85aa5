"""Contacts that a task gives: which feet stand and which are in the air, over which share of the horizon.

What is given is not searched for: a solve with given contacts has no complementarity there, and is easier.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

from multimodal_to.arguments import check_fields
from multimodal_to.errors import ScenarioError, shown
from multimodal_to.trajectory.instants import Instant, check_stretch


class ContactState(Enum):
    """What is given of a contact point."""

    ON = "on"
    """It stands on the ground and stays where it is."""
    OFF = "off"
    """It bears no force; it may touch the ground."""
    FREE = "free"
    """Nothing: when and where it touches the ground is found."""


@dataclass(frozen=True, kw_only=True)
class ContactStretch:
    """What is given of some contact points over a stretch of the horizon.

    Raises:
        ScenarioError: the stretch has no length, or a number is no share of the horizon, or no clearance.
    """

    of: tuple[str, ...]
    """Feet, or single contact points, by name; a name alone is a list of one."""
    state: ContactState
    """What is given."""
    begin: Instant = 0.0
    """When the stretch begins: a share of the horizon, "start" or "end" [1]."""
    end: Instant = 1.0
    """When the stretch ends, likewise [1]."""
    clearance: float = 0.0
    """Least height above the ground in the middle of a stretch that is off [m]."""

    def __post_init__(self) -> None:
        if isinstance(self.of, str):
            object.__setattr__(self, "of", (self.of,))
        check_fields(self, ScenarioError, "contacts: ")
        object.__setattr__(self, "of", tuple(self.of))
        if not self.of:
            raise ScenarioError("contacts: 'of' is empty; expected the name of a foot or of a contact point")
        check_stretch(self.begin, self.end, "contacts", ScenarioError)
        if not 0.0 <= self.clearance < float("inf"):
            raise ScenarioError(f"contacts: clearance is {shown(self.clearance)}; expected at least zero [m]")
        if self.clearance and self.state is not ContactState.OFF:
            raise ScenarioError(f"contacts: a clearance asks for a foot that is off, and it is '{self.state.value}'")

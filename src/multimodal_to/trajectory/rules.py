"""At which instant each quantity of a trajectory is, by the integration rule of the motion."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from multimodal_to.adam.spatial import Array
from multimodal_to.values import FrozenMapping

BACKWARD_EULER = "backward Euler"
LEAPFROG = "leapfrog"
STAGGERED = "staggered"
"""A rule that this release only reads: as leapfrog, but contact forces and throttles are constant over intervals."""
SAMPLED = "sampled"
"""Not a rule: every quantity of a column is at the time of its knot, as `resample` returns them."""

VELOCITIES = (
    "com_velocity",
    "angular_momentum",
    "base_linear_velocity",
    "base_angular_velocity",
    "joint_velocities",
    "thrust_rate",
)
"""What is in the middle of an interval under leapfrog; column k is of the interval that ends at knot k."""
HELD = ("contact_forces", "throttle")
"""What is constant over an interval under the staggered rule."""
ACCELERATIONS = ("com_acceleration", "angular_momentum_rate", "thrust_acceleration")
"""The differences between two intervals: column k is of knot k − 1, where the two meet."""

_BETWEEN = {**dict.fromkeys(VELOCITIES, 0.5), **dict.fromkeys(ACCELERATIONS, 1.0)}
INSTANTS: Mapping[str, Mapping[str, float]] = FrozenMapping(
    {
        BACKWARD_EULER: FrozenMapping({}),
        LEAPFROG: FrozenMapping({**_BETWEEN, "contact_force_rates": 0.5}),
        STAGGERED: FrozenMapping({**_BETWEEN, "contact_force_rates": 1.0, **dict.fromkeys(HELD, 0.5)}),
        SAMPLED: FrozenMapping({}),
    }
)
"""How far before knot k the quantities of column k are, in intervals; those that are not named are at the knot."""


def all_at_knots(rule: str) -> bool:
    """Return whether every quantity of a column is at its knot."""
    return not INSTANTS.get(rule)


def acts_after(rule: str) -> float:
    """Return until how far after its knot a contact force or a throttle acts, in intervals.

    It acts for one interval. Under leapfrog its knot is in the middle of that; else the knot is the end.
    """
    return 0.5 if rule == LEAPFROG else 0.0


def held(rule: str, name: str) -> bool:
    """Return whether a quantity is constant over the interval that ends at its knot."""
    return bool(instant(rule, name)) and name in HELD


def instant(rule: str, name: str) -> float:
    """Return how far before its knot a quantity is, in intervals; zero for a rule that this release does not know."""
    return INSTANTS.get(rule, INSTANTS[BACKWARD_EULER]).get(name, 0.0)


def instants(grid: Array, rule: str, name: str) -> Array:
    """Return at which times the columns of a quantity are [s], (knots + 1,).

    Before the first knot is an interval as long as the first one.

    Args:
        grid: times of the knots [s], (knots + 1,).
        rule: name of the integration rule.
        name: of the quantity.
    """
    return np.asarray(grid - instant(rule, name) * np.diff(grid, prepend=2 * grid[0] - grid[1]))

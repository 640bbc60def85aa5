"""A bundled scenario for a robot of another size than the iRonCub, for which its numbers are written."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from multimodal_to.models.robot import Robot
from multimodal_to.models.terrain import Stairs
from multimodal_to.models.units import Sized
from multimodal_to.scenarios.regions import Wall
from multimodal_to.scenarios.scenario import Scenario, Vector3
from multimodal_to.tasks.given import looks
from multimodal_to.values import FrozenMapping

_RUNNING: Mapping[str, str] = FrozenMapping(
    {
        "com_velocity": "m/s",
        "com_acceleration": "m/s²",
        "angular_momentum": "kg m²/s",
        "angular_momentum_rate": "N m",
        "posture": "rad",
        "base_orientation": "1",
        "contact_forces": "N",
        "contact_force_rates": "N/s",
        "thrust": "N",
        "throttle": "1",
        "throttle_rate": "1/s",
        "joint_accelerations": "rad/s²",
        "foot_tilt": "1",
        "skimming": "1",
    }
)
"""The running weights of the bundled scenarios, and the unit of what each weighs."""
_SKIMMING = 2e8
"""The least weight of feet that move along the ground close to it, with jets: carried by them, bent legs glide.

Where steps are guessed it is the scenario's own: with this one the iRonCub-Mk3 stands until it flies.
"""

_BEYOND, _LANDED = 0.08, 0.4
"""How far beyond the edge of a step feet stand [L], and from which share of the horizon on [1].

Nearer to it the heels of the iRonCub-Mk3, whose soles are longer, slip off in MuJoCo.
"""


def sized(scenario: Scenario, robot: Robot) -> Scenario:
    """Return a bundled scenario in the units m, L and √(L/g) of a robot (W. Froude, 1874), ahead of it.

    Lengths and times, the weights, and ε_t are those of the iRonCub times the ratio of the robots' units. With jets,
    feet that glide have at least the weight `_SKIMMING`, but for a walk. On a step the feet stand `_BEYOND` its edge.

    Args:
        scenario: one of `scenarios.SCENARIOS`.
        robot: that shall do it.
    """

    def by(unit: str) -> float:
        return Sized(1.0, unit).of(robot.units)

    length, time, ahead = by("m"), by("s"), -looks(robot)  # the iRonCub looks towards −x

    def there(com: Any) -> Vector3:
        x, y, z = com
        return ahead * length * x, ahead * length * y, length * z

    least = _SKIMMING if scenario.jets and not scenario.guess_steps else 0.0
    weights = replace(scenario.weights, skimming=max(scenario.weights.skimming, least))
    speeds = {group: weight / (by("rad/s") ** 2 * time) for group, weight in weights.joint_velocities.items()}
    running = {name: getattr(weights, name) / (by(unit) ** 2 * time) for name, unit in _RUNNING.items()}
    changed: dict[str, Any] = {
        "initial_com": there(scenario.initial_com),
        "final_com": there(scenario.final_com),
        "interval_min": time * scenario.interval_min,
        "interval_max": time * scenario.interval_max,
        "weights": replace(weights, joint_velocities=speeds, **running),
    }
    if scenario.mid_height_min is not None:
        changed["mid_height_min"] = length * scenario.mid_height_min
    if scenario.sliding_max is not None:
        changed["sliding_max"] = Sized(scenario.sliding_max, "N m", of_a_point=True).of(robot.units)
    if isinstance(stairs := scenario.surface, Stairs):
        x, y = stairs.direction
        changed["surface"] = steps = Stairs(
            edges=tuple(length * edge for edge in stairs.edges),
            heights=tuple(length * height for height in stairs.heights),
            direction=(ahead * x, ahead * y),
            width=length * stairs.width,
        )
        top = steps.edges[-1] + 0.5 * steps.width + _BEYOND * robot.standing_height
        wall = Wall(normal=(*steps.direction, 0.0), offset=top, of=robot.contact_names, begin=_LANDED)
        changed["walls"] = (*scenario.walls, wall)
    return replace(scenario, **changed)

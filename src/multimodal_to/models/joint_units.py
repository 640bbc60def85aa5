"""Units by joint: what turns is in rad and N m, what slides in m and N."""

from __future__ import annotations

from collections.abc import Mapping

from multimodal_to.models.robot import Robot
from multimodal_to.values import FrozenMapping

SLIDING: Mapping[str, str] = FrozenMapping({"rad": "m", "rad/s": "m/s", "rad/s²": "m/s²", "N m": "N"})
"""The unit of a prismatic joint's value, by that of a revolute joint's."""


def slides(robot: Robot) -> tuple[bool, ...]:
    """Return whether each joint is a prismatic one, in the order of s."""
    return tuple(joint.kind == "prismatic" for joint in robot.kindyn.tree.joints)


def joint_units(robot: Robot, unit: str) -> tuple[str, ...]:
    """Return the unit of a value of each joint, in the order of s.

    Args:
        robot: whose joints.
        unit: of a revolute joint's value, one of `SLIDING`.
    """
    return tuple(SLIDING[unit] if sliding else unit for sliding in slides(robot))


def either(unit: str) -> str:
    """Return both units of a value of joints in words, as "rad or m"."""
    return f"{unit} or {SLIDING[unit]}"


def described(sliding: Mapping[str, bool], unit: str) -> str:
    """Return the unit of a value of joints in words: `rad`, `m`, or `rad, of mast m`.

    Args:
        sliding: whether each joint slides, by name.
        unit: of a joint that turns, one of `SLIDING`.
    """
    names = [name for name, slider in sliding.items() if slider]
    if not names:
        return unit
    return SLIDING[unit] if len(names) == len(sliding) else f"{unit}, of {', '.join(names)} {SLIDING[unit]}"

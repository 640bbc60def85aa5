"""Names for the components of stacked quantities: joints, contact points, jets and axes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import MappingProxyType

from multimodal_to.models.robot import Robot

_AXES: Mapping[int, tuple[str, ...]] = MappingProxyType(
    {
        3: ("x", "y", "z"),
        4: ("x", "y", "z", "w"),
        6: ("linear x", "linear y", "linear z", "angular x", "angular y", "angular z"),
    }
)


def components(robot: Robot, of: str, count: int) -> tuple[str, ...]:
    """Return the names of `count` rows that are repeated for each "joint", "contact" or "jet", or once for the "robot".

    Such as `l_knee`, or `l_sole_1 z` where there are three rows for each.
    """
    bodies = _bodies(robot, of)
    each = count // len(bodies) if bodies else 0
    return labels(robot, of, _AXES.get(each, ("",) * each))


def labels(robot: Robot, of: str, axes: Sequence[str]) -> tuple[str, ...]:
    """Return the names of rows that are repeated for each body: its name and each of `axes`, as `l_sole_1 z`.

    Args:
        robot: whose joints, contact points and jets are meant.
        of: "joint", "contact" or "jet", or "robot" for rows that are there once.
        axes: names of the rows of one body; an empty one where it has a single row.
    """
    return tuple(" ".join(filter(None, (body, axis))) for body in _bodies(robot, of) for axis in axes)


def _bodies(robot: Robot, of: str) -> tuple[str, ...]:
    return {"robot": ("",), "joint": robot.joint_names, "contact": robot.contact_names, "jet": robot.jet_names}[of]

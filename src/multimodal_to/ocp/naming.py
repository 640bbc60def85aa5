"""Names for the components of stacked quantities: joints, contact points, jets and axes."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

from multimodal_to.models.robot import Robot
from multimodal_to.trajectory.quantities import TWIST, XYZ, XYZW, row_labels

_AXES: Mapping[int, tuple[str, ...]] = MappingProxyType({3: XYZ, 4: XYZW, 6: TWIST})


def components(robot: Robot, of: str, count: int) -> tuple[str, ...]:
    """Return the names of `count` rows that are repeated for each "joint", "contact" or "jet", or once for the "robot".

    Such as `l_knee`, or `l_sole_1 z` where there are three rows for each.
    """
    bodies = len(row_labels(robot, of, ("",)))
    each = count // bodies if bodies else 0
    return row_labels(robot, of, _AXES.get(each, ("",) * each))

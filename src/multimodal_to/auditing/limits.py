"""Whether a motion keeps the limits that its scenario narrows over stretches."""

from __future__ import annotations

import numpy as np

from multimodal_to.auditing.findings import Motion, Worst, worst_of
from multimodal_to.auditing.property import Judged, Property
from multimodal_to.scenarios.limits import limited
from multimodal_to.scenarios.scenario import Scenario

_QUANTITIES = {
    "limits: base speed": "base_linear_velocity",
    "limits: turning speed": "base_angular_velocity",
    "limits: joint speed": "joint_velocities",
    "limits: thrust": "thrust",
}


def _property(name: str, unit: str, meaning: str, limit: float = 1e-6, *, of_joints: bool = False) -> Property:
    return Property(
        name=name,
        unit=unit,
        limit=limit,
        reason="`limits` of the scenario: a bound, which the solver holds; the limit is for rounding",
        meaning=meaning,
        judged=Judged.WITH_LIMITS,
        of_joints=of_joints,
    )


LIMITS = (
    _property("limits: base speed", "m/s", "how far the base's velocity is above what a stretch allows, by axis"),
    _property("limits: turning speed", "rad/s", "the same of the base's angular velocity"),
    _property("limits: joint speed", "rad/s", "the same of a joint's speed", of_joints=True),
    _property("limits: thrust", "N", "the same of a jet's thrust", 1e-4),
)


def limit_findings(motion: Motion, scenario: Scenario) -> list[Worst]:
    """Compare a motion with the limits over stretches of its scenario; without any there is nothing to judge."""
    if not scenario.limits:
        return []
    trajectory = motion.trajectory
    held = limited(scenario.limits, motion.robot.with_jets(trajectory.jet_names), trajectory.knots)
    findings = list[Worst]()
    for name, quantity in _QUANTITIES.items():
        here = [one for one in held if one.quantity == quantity]
        beyond = np.full((len(here), trajectory.time.size), -np.inf)
        for row, one in enumerate(here):
            at = list(one.knots)
            beyond[row, at] = np.abs(getattr(trajectory, quantity)[one.row, at]) - one.most
        findings.append(worst_of(name, beyond, tuple(one.what for one in here)))
    return findings

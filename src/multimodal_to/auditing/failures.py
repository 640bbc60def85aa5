"""Whether jets that a scenario lets fail push no more than they can."""

from __future__ import annotations

import numpy as np

from multimodal_to.auditing.findings import Motion, Worst, worst_of
from multimodal_to.auditing.property import Judged, Property
from multimodal_to.scenarios.failures import failing_knots
from multimodal_to.scenarios.scenario import Scenario

FAILURES = (
    Property(
        name="failed jet: thrust",
        unit="N",
        limit=1e-4,
        reason="zero is asked for: a bound, which the solver holds; the limit is for rounding",
        meaning="largest thrust of a jet that never lights",
        judged=Judged.WITH_FAILURES,
    ),
    Property(
        name="failed jet: throttle",
        unit="%",
        limit=1e-4,
        reason="the least throttle is asked for: a bound, which the solver holds; the limit is for rounding",
        meaning="how far the throttle of a jet is above its least, from the knot on at which it fails",
        judged=Judged.WITH_FAILURES,
    ),
)


def failure_findings(motion: Motion, scenario: Scenario) -> list[Worst]:
    """Compare thrusts and throttles with what jets that have failed leave; without any there is nothing to judge."""
    if not scenario.failures:
        return []
    robot, trajectory = motion.robot, motion.trajectory
    thrust, throttle = np.zeros_like(trajectory.thrust), np.zeros_like(trajectory.throttle)
    for row, knot in failing_knots(scenario.failures, robot.jet_names, trajectory.knots).items():
        if knot:
            throttle[row, knot:] = trajectory.throttle[row, knot:] - robot.jets[row].throttle_min
        else:
            thrust[row] = np.abs(trajectory.thrust[row])
    return [
        worst_of("failed jet: thrust", thrust, robot.jet_names),
        worst_of("failed jet: throttle", throttle, robot.jet_names),
    ]

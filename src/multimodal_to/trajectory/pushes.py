"""Forces from outside that a plan knows of, and that its motion is true under.

A trajectory keeps them with its task.
"""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from multimodal_to.adam.spatial import Array
from multimodal_to.arguments import check_fields, checked
from multimodal_to.errors import MultimodalError, ScenarioError, TrajectoryError, shown
from multimodal_to.files.records import Records
from multimodal_to.trajectory import rules
from multimodal_to.trajectory.instants import Instant, check_stretch, knot_at
from multimodal_to.trajectory.trajectory import Trajectory

Vector3 = tuple[float, float, float]


@dataclass(frozen=True, kw_only=True)
class KnownPush:
    """A constant force on a link or frame over a stretch of the horizon, which the plan counts on.

    Raises:
        ScenarioError: a number is not finite, or the stretch has no length.
    """

    of: str
    """The link or frame, at whose origin the force acts."""
    force: Vector3
    """The force on the robot, in world axes [N]."""
    begin: Instant = 0.0
    """When it begins: a share of the horizon, "start" or "end" [1]."""
    end: Instant = 1.0
    """When it ends, likewise [1]."""

    def __post_init__(self) -> None:
        check_fields(self, ScenarioError, "pushes: ")
        if len(self.force) != 3 or not all(map(math.isfinite, self.force)):
            raise ScenarioError(f"pushes: force is {shown(self.force)}; expected three finite numbers [N]")
        object.__setattr__(self, "force", tuple(map(float, self.force)))
        check_stretch(self.begin, self.end, "pushes", ScenarioError)

    @checked
    def knots(self, knots: int, rule: str) -> range:
        """Return at which knots the force acts, like a contact force, so that it acts over the whole stretch.

        Under leapfrog a force of a knot acts half an interval before and after it, and the stretch is half an interval
        early. By backward Euler it acts over the interval that ends at its knot.

        Args:
            knots: N, the number of intervals.
            rule: name of the integration rule.
        """
        first, last = knot_at(self.begin, knots), knot_at(self.end, knots)
        return range(first, last) if rules.acts_after(rule) else range(first + 1, last + 1)


def acting(pushes: Sequence[KnownPush], knots: int, rule: str) -> dict[tuple[int, ...], list[int]]:
    """Return the knots at which each set of pushes acts; knots without any are left out.

    Args:
        pushes: of a scenario.
        knots: N, the number of intervals.
        rule: name of the integration rule.
    """
    found = dict[tuple[int, ...], list[int]]()
    for knot in range(knots + 1):
        if some := tuple(index for index, push in enumerate(pushes) if knot in push.knots(knots, rule)):
            found.setdefault(some, []).append(knot)
    return found


@checked
def known_pushes(trajectory: Trajectory) -> tuple[KnownPush, ...]:
    """Return the pushes that a trajectory was planned under, as the task that it keeps says them.

    Raises:
        TrajectoryError: what it keeps is not what a scenario writes.
    """
    if not trajectory.scenario_json:
        return ()
    try:
        task = json.loads(trajectory.scenario_json)
        listed = task.get("pushes", []) if isinstance(task, dict) else []
        return tuple(_RECORDS.value(tuple[KnownPush, ...], listed, "pushes"))
    except (ValueError, RecursionError, MultimodalError) as error:
        raise TrajectoryError(f"the pushes kept with '{trajectory.scenario}' cannot be read: {error}") from error


_RECORDS = Records(what="the push", error=TrajectoryError)


@checked
def push_forces(pushes: Sequence[KnownPush], trajectory: Trajectory) -> Array:
    """Return the force of each push at every knot [N], (pushes, knots + 1, 3), world axes."""
    forces = np.zeros((len(pushes), trajectory.time.size, 3))
    for row, push in enumerate(pushes):
        forces[row, list(push.knots(trajectory.knots, trajectory.rule))] = push.force
    return forces

"""How far a motion stays away from the edge of what a robot can do: feet, touch-downs, swings and throttles."""

from __future__ import annotations

import numpy as np

from multimodal_to.adam.spatial import Array
from multimodal_to.auditing.findings import Motion, Worst, worst_of
from multimodal_to.auditing.property import Judged, Of, Property
from multimodal_to.models.contact import DESCENT_RATE
from multimodal_to.models.robot import Robot
from multimodal_to.models.sole import PRESSURE_SLACK, Sole, soles
from multimodal_to.models.terrain import FlatGround
from multimodal_to.scenarios.margins import Margins
from multimodal_to.scenarios.scenario import Scenario
from multimodal_to.trajectory import rules
from multimodal_to.trajectory.derived import loaded_force, surface_frames

GLIDE_HEIGHT = 0.01
"""Below this height over a whole interval a contact point is near the ground [L]."""
GLIDE_DISTANCE = 0.04
"""Greatest way along the ground of a contact point while it is near it and carries no load [L]."""
THROTTLE_RATE = 200.0
"""Greatest rate of a throttle [%/s]."""

MARGINS = (
    Property(
        name="centre of pressure",
        unit="1",
        limit=1e-4,
        margin="pressure",
        unasked=1.0,
        reason="one is on an edge; a ten-thousandth for what a feasible motion may miss its row by",
        meaning="size of the smallest sole, shrunk about its middle, that holds a foot's centre of pressure, as a "
        f"share of the whole; a moment of {PRESSURE_SLACK:g} m g L about an edge is let go, so that a foot with hardly "
        "any load counts as zero",
        judged=Judged.WITH_SOLES,
    ),
    Property(
        name="touch-down speed",
        unit="m/s",
        limit=1e-4,
        of=Of.SPEED,
        margin="touch_down_speed",
        reason="a ten-thousandth for what a feasible motion may miss its row by",
        meaning="fall of a contact point's height over an interval / Δt, less what its height above the ground at the "
        f"interval's end allows: {DESCENT_RATE:g} √(g/L) × height",
        judged=Judged.WITH_TOUCH_DOWN,
    ),
    Property(
        name="gliding distance",
        unit="m",
        limit=GLIDE_DISTANCE,
        of=Of.HEIGHT,
        reason="chosen, for the iRonCub 2.3 cm: feet that are lifted and set down go at most two thirds of it, feet "
        "that skate several times as far",
        meaning="way along the ground of a contact point that carries no load, over intervals in sequence in which it "
        f"is less than {GLIDE_HEIGHT:g} L off the ground: a foot that swings has to be lifted",
        judged=Judged.WITH_MARGINS,
    ),
    Property(
        name="throttle rate",
        unit="%/s",
        limit=THROTTLE_RATE,
        reason="chosen: from zero to full in 0.5 s. The identified turbines have a time constant of 0.7 s, so that "
        "they follow nothing that is much faster",
        meaning="|Δu| / Δt of a jet over an interval",
        judged=Judged.WITH_MARGINS,
    ),
)


def margin_findings(motion: Motion, scenario: Scenario | None) -> list[Worst]:
    """Return the worst of each margin that is judged.

    Args:
        motion: that is judged.
        scenario: with the ground and the margins; without one the ground is flat, and only soles are judged.
    """
    robot, steps = motion.robot, np.diff(motion.trajectory.time)
    surface = scenario.surface if scenario else FlatGround()
    heights, normals, tangents = surface_frames(surface, motion.points)
    normal = np.einsum("ckx,ckx->ck", normals, motion.contact_forces)
    findings = []
    if feet := soles(robot):
        shares = np.array([pressure_shares(robot, sole, normal[list(sole.members)]) for sole in feet])
        findings.append(worst_of("centre of pressure", shares, tuple(sole.foot for sole in feet)))
    margins = scenario.margins if scenario else Margins.none()
    if margins.touch_down_speed > 0.0:
        falls = -np.diff(heights, axis=1) / steps - DESCENT_RATE * robot.units.frequency * heights[:, 1:]
        findings.append(worst_of("touch-down speed", falls, robot.contact_names, first=1))
    if margins != Margins.none():
        moves = np.einsum("ckxt,ckx->ckt", tangents[:, 1:], np.diff(motion.points, axis=1))
        low = np.maximum(heights[:, :-1], heights[:, 1:]) < GLIDE_HEIGHT * robot.standing_height
        glides = np.logical_and(low, ~_loaded(motion, normal))
        ways = _sums_of_runs(np.where(glides, np.linalg.norm(moves, axis=2), 0.0), glides)
        rates = np.abs(np.diff(motion.trajectory.throttle, axis=1)) / steps
        findings.append(worst_of("gliding distance", ways, robot.contact_names, first=1))
        findings.append(worst_of("throttle rate", rates, robot.jet_names, first=1))
    return findings


def pressure_shares(robot: Robot, sole: Sole, normal: Array) -> Array:
    """Return the size of the smallest sole, shrunk about its middle, that holds a foot's centre of pressure (knots,).

    As a share s of the whole sole: max over its edges of (m − slack) / (a Σ n), with the moment m of the normal forces
    n about the sole's middle towards the edge, and the way a from the middle to the edge. The slack is `PRESSURE_SLACK`
    m g L; it makes s zero for a foot with hardly any load. A plan that keeps the margin `pressure` has no greater s.

    Args:
        robot: whose weight and size the slack is a share of.
        sole: of the foot.
        normal: normal forces of the sole's contact points [N], (members, columns).
    """
    inwards, from_edges = sole.leverage(0.0), sole.leverage(1.0)
    ways = (from_edges - inwards)[:, :1]  # from the middle to each edge; the same for every contact point
    slack, load = PRESSURE_SLACK * robot.weight * robot.standing_height, normal.sum(axis=0)
    outwards = -inwards @ normal - slack
    with np.errstate(divide="ignore", invalid="ignore"):
        shares = np.where(load > 0.0, outwards / (ways * load), 0.0)
    return np.asarray(np.maximum(shares, 0.0).max(axis=0))


def _sums_of_runs(values: Array, within: np.ndarray) -> Array:
    """Return for each column the sum of the values since the last column that is not within, (rows, columns).

    Args:
        values: zero where a column is not within, (rows, columns).
        within: which columns count, (rows, columns).
    """
    sums = np.cumsum(values, axis=1)
    return np.asarray(sums - np.maximum.accumulate(np.where(within, 0.0, sums), axis=1))


def _loaded(motion: Motion, normal: Array) -> np.ndarray:
    """Return over which intervals a contact point carries load, (contacts, knots).

    Args:
        motion: whose rule says over which intervals a force acts.
        normal: normal forces of its contact points [N], (contacts, knots + 1).
    """
    loaded = normal > loaded_force(motion.robot)
    if rules.acts_after(motion.trajectory.rule):  # the force of an interval's start acts over its first half
        return np.asarray(loaded[:, :-1] | loaded[:, 1:])
    return loaded[:, 1:]

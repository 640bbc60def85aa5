"""The terms of contacts that a scenario gives, and where those of contacts that are found are left out.

A force that is given to be zero is a bound, and so is the height of a point that is given to stand on flat ground.
"""

from __future__ import annotations

from dataclasses import replace

import casadi as cs
import numpy as np

from multimodal_to.adam.spatial import SX
from multimodal_to.models.contact import FACES
from multimodal_to.models.sole import soles
from multimodal_to.models.stiff_legs import CREEP, on_stiff_legs, supports
from multimodal_to.models.units import Sized
from multimodal_to.ocp import constraints
from multimodal_to.ocp.guess import contact_positions
from multimodal_to.ocp.integration import Interval
from multimodal_to.ocp.knot import Knot
from multimodal_to.ocp.parameters import Parameters
from multimodal_to.ocp.schedule import Flags
from multimodal_to.ocp.terms import Constraint, Where, at_least, between, each, equal
from multimodal_to.scenarios.scenario import Start
from multimodal_to.trajectory.quantities import XYZ

ON_GROUND = Sized(1e-5, "m")
"""Largest height of a contact point that stands: a sole has more corners than a plane needs."""
_MIDDLE = Sized(0.5 * ON_GROUND.value, ON_GROUND.unit)
"""Height of the points that hold a sole, so that its other corners are in the middle of their range."""
_BACK = Sized(-CREEP.value, CREEP.unit)
_PLANE = 3
"""Points that hold a plane."""

# -------------------------------------------------------------------- which rows there are


def not_held(parameters: Parameters) -> Flags:
    """Return at which knots the height of a point is not given, nor follows from those that stand since the start."""
    known, since_start = held(parameters), _since_start(parameters)
    for members, here in _bodies(parameters, parameters.contacts.stands):
        if len(supports(parameters.robot, members)) == _PLANE:
            known[members] |= here & since_start[members].all(axis=0)
    return ~known


def held(parameters: Parameters) -> Flags:
    """Return at which knots the height of a point is given: of each body that stands, of as many as hold it.

    Three points that are not on one line hold a sole. The heights of its others follow from theirs.
    """
    flags = np.zeros_like(parameters.contacts.stands)
    for members, here in _bodies(parameters, parameters.contacts.stands):
        flags[supports(parameters.robot, members)] |= here
    return flags


def _bodies(parameters: Parameters, flags: Flags) -> list[tuple[list[int], Flags]]:
    """Return every set of points of one body that is flagged at some knots, and at which knots it is that set.

    Args:
        parameters: with the robot.
        flags: of each point at each knot, (contacts, N + 1).
    """
    robot, found = parameters.robot, list[tuple[list[int], Flags]]()
    bodies = [robot.kindyn.tree.frame(name).body for name in robot.contact_names]
    for body in dict.fromkeys(bodies):
        members = np.flatnonzero([other == body for other in bodies])
        for some in np.unique(flags[members], axis=1).T:
            if some.any():
                found.append((members[some].tolist(), (flags[members] == some[:, None]).all(axis=0)))
    return found


def _since_start(parameters: Parameters) -> Flags:
    """Return at which knots a point has the height that it started with: it has stood ever since."""
    stands = np.logical_and.accumulate(parameters.contacts.stands, axis=1)
    return np.asarray(stands & (parameters.scenario.start is Start.STANDING))


def _held_since_start(parameters: Parameters) -> Flags:
    return held(parameters) & _since_start(parameters)


def _held_anew(parameters: Parameters) -> Flags:
    """Return at which knots the height of a point is given that has come down, or starts elsewhere than standing."""
    return held(parameters) & ~_held_since_start(parameters)


def not_on(parameters: Parameters) -> Flags:
    """Return over which intervals a point is not given to be on."""
    return ~parameters.contacts.on


def loaded_faces(parameters: Parameters) -> Flags:
    """Return at which knots a point may bear a force, for each face of its cone."""
    faces = len(FACES[parameters.scenario.friction_cone])
    return np.repeat(~parameters.contacts.unloaded, faces, axis=0)


def loaded_edges(parameters: Parameters) -> Flags:
    """Return at which knots a sole may bear a force, for each of its edges."""
    loaded = ~parameters.contacts.unloaded
    rows = [loaded[list(sole.members)].any(axis=0) for sole in soles(parameters.robot) for _ in sole.edges]
    return np.array(rows, dtype=bool).reshape(-1, loaded.shape[1])


def found_at_knot(parameters: Parameters) -> Flags:
    """Return at which knots neither height nor force is given to be zero."""
    schedule = parameters.contacts
    return ~(schedule.unloaded | schedule.stands)


def found_before(parameters: Parameters) -> Flags:
    """Return over which intervals neither the height at the start nor the force at the end is given to be zero."""
    schedule = parameters.contacts
    return ~(schedule.unloaded | _at_start(schedule.stands))


def found_after(parameters: Parameters) -> Flags:
    """Return over which intervals neither the height at the end nor the force at the start is given to be zero."""
    schedule = parameters.contacts
    return ~(_at_start(schedule.unloaded) | schedule.stands)


def slides_before(parameters: Parameters) -> Flags:
    """Return over which intervals neither the slip nor the force at the end is given to be zero, twice for each."""
    schedule = parameters.contacts
    return np.repeat(~(schedule.unloaded | schedule.on), 2, axis=0)


def slides_after(parameters: Parameters) -> Flags:
    """Return over which intervals neither the slip nor the force at the start is given to be zero, twice for each."""
    schedule = parameters.contacts
    return np.repeat(~(_at_start(schedule.unloaded) | schedule.on), 2, axis=0)


def _at_start(flags: Flags) -> Flags:
    """Return flags of knots, (contacts, N + 1), of the knot before."""
    return np.hstack([flags[:, :1], flags[:, :-1]])


# -------------------------------------------------------------------- what is given


def rise(knot: Knot, parameters: Parameters) -> SX:
    """d(p_i) less the height at the start: rigid legs cannot give way to another one."""
    start = contact_positions(parameters.robot, parameters.standing).reshape(-1, 3)
    heights = [parameters.surface.distance(cs.SX(point)) for point in start]
    return constraints.heights(knot, parameters) - cs.evalf(cs.vertcat(cs.SX(0, 1), *heights))


def clearance(knot: Knot, parameters: Parameters) -> SX:
    """d(p_i) less the clearance that is asked for."""
    rows = [parameters.surface.distance(knot.points[point]) - least for point, least in _clearances(parameters)]
    return cs.vertcat(cs.SX(0, 1), *rows)


def _clearances(parameters: Parameters) -> list[tuple[int, float]]:
    """Return the contact points with each clearance [m] that is asked of them."""
    asked = parameters.contacts.clearance
    return [
        (int(point), float(least)) for point in range(len(asked)) for least in np.unique(asked[point][asked[point] > 0])
    ]


def _asked_clearance(parameters: Parameters) -> Flags:
    asked = parameters.contacts.clearance
    rows = [asked[point] == least for point, least in _clearances(parameters)]
    return np.array(rows, dtype=bool).reshape(-1, asked.shape[1])


def _clearance_labels(parameters: Parameters) -> tuple[str, ...]:
    names = parameters.robot.contact_names
    return tuple(f"{names[point]} {least:g} m" for point, least in _clearances(parameters))


def _unloaded(parameters: Parameters) -> Flags:
    return np.repeat(parameters.contacts.unloaded, 3, axis=0)


def in_place(interval: Interval, parameters: Parameters) -> SX:
    """How far each body that stands moves along the ground over the interval, and how far it turns about the vertical.

    For the points of a body, with their mean p̄: the mean of t·(p_i⁺ − p_i) and, of two points or more,
    n·Σ (p_i − p̄) × (p_i⁺ − p_i) / √Σ |p_i − p̄|².
    """
    return _moves(interval, parameters, stiff=False)


def nearly_in_place(interval: Interval, parameters: Parameters) -> SX:
    """As far as `in_place` says, of bodies on stiff legs: `models.stiff_legs`."""
    return _moves(interval, parameters, stiff=True)


def _standing(parameters: Parameters, *, stiff: bool) -> list[tuple[list[int], Flags]]:
    """Return every set of points of one body that is given to be on, on stiff legs or on others, and over what."""
    on_stiff = on_stiff_legs(parameters.robot)
    bodies = _bodies(parameters, parameters.contacts.on)
    return [(members, here) for members, here in bodies if on_stiff[members[0]] == stiff]


def _moves(interval: Interval, parameters: Parameters, *, stiff: bool) -> SX:
    rows = list[SX]()
    for members, _ in _standing(parameters, stiff=stiff):
        before = [interval.start.points[index] for index in members]
        after = [interval.end.points[index] for index in members]
        moves = [one - other for one, other in zip(after, before, strict=True)]
        tangents = [parameters.surface.tangents(point) for point in after]
        rows.append(sum(part.T @ move for part, move in zip(tangents, moves, strict=True)) / len(members))
        if len(members) > 1:
            normal, middle = parameters.surface.normal(after[0]), sum(before) / len(members)
            arms = [point - middle for point in before]
            turn = sum(cs.cross(arm, move) for arm, move in zip(arms, moves, strict=True))
            rows.append(cs.dot(normal, turn) / _spread(parameters, members))
    return cs.vertcat(cs.SX(0, 1), *rows)


def _spread(parameters: Parameters, members: list[int]) -> float:
    """Return √Σ |p_i − p̄|² of some points of a body [m]."""
    frames = [parameters.robot.kindyn.tree.frame(parameters.robot.contact_names[index]) for index in members]
    places = np.array([np.array(cs.DM(frame.translation)).ravel() for frame in frames])
    return float(np.linalg.norm(places - places.mean(axis=0)))


def _in_place(parameters: Parameters) -> Flags:
    return _over(parameters, stiff=False)


def _nearly_in_place(parameters: Parameters) -> Flags:
    return _over(parameters, stiff=True)


def _over(parameters: Parameters, *, stiff: bool) -> Flags:
    rows = [here for members, here in _standing(parameters, stiff=stiff) for _ in range(3 if len(members) > 1 else 2)]
    return np.array(rows, dtype=bool).reshape(-1, parameters.scenario.knots + 1)


def _in_place_labels(parameters: Parameters) -> tuple[str, ...]:
    return _ways(parameters, stiff=False)


def _nearly_in_place_labels(parameters: Parameters) -> tuple[str, ...]:
    return _ways(parameters, stiff=True)


def _ways(parameters: Parameters, *, stiff: bool) -> tuple[str, ...]:
    names, labels = parameters.robot.contact_names, list[str]()
    for members, _ in _standing(parameters, stiff=stiff):
        body = ", ".join(names[index] for index in members)
        labels += [f"{body} {axis}" for axis in (("x", "y", "turn") if len(members) > 1 else ("x", "y"))]
    return tuple(labels)


def _gives(parameters: Parameters) -> bool:
    return bool(parameters.scenario.contacts or parameters.scenario.gait)


GIVEN_OFF = Constraint(
    name="given_off",
    value=constraints.contact_forces,
    within=equal(),
    unit="N",
    holds=(Where.FIRST_KNOT, Where.LATER_KNOTS),
    scale=constraints.LOAD,
    labels=each("contact", *XYZ),
    when=_gives,
    present=_unloaded,
)
GIVEN_ON = Constraint(
    name="given_on",
    value=constraints.heights,
    within=equal(_MIDDLE),
    unit="m",
    labels=each("contact"),
    when=_gives,
    rigid=True,
    present=_held_anew,
)
GIVEN_ON_SINCE_START = replace(
    GIVEN_ON, name="given_on_since_start", value=rise, within=equal(), present=_held_since_start
)
GIVEN_IN_PLACE = Constraint(
    name="given_in_place",
    value=in_place,
    within=equal(),
    unit="m",
    holds=Where.EVERY_INTERVAL,
    labels=_in_place_labels,
    when=_gives,
    present=_in_place,
)
GIVEN_NEARLY_IN_PLACE = replace(
    GIVEN_IN_PLACE,
    name="given_nearly_in_place",
    value=nearly_in_place,
    within=between(_BACK, CREEP),
    labels=_nearly_in_place_labels,
    present=_nearly_in_place,
)
CLEARANCE = Constraint(
    value=clearance,
    within=at_least(0.0),
    unit="m",
    labels=_clearance_labels,
    when=_gives,
    present=_asked_clearance,
)
CONSTRAINTS = (GIVEN_OFF, GIVEN_ON, GIVEN_ON_SINCE_START, GIVEN_IN_PLACE, GIVEN_NEARLY_IN_PLACE, CLEARANCE)
"""What contacts that a scenario gives ask for; without any there are none of their rows."""

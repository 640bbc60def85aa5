"""The terms of contacts that a scenario gives, and where those of contacts that are found are left out.

A force that is given to be zero is a bound, and so is the height of a point that is given to stand on flat ground.
"""

from __future__ import annotations

import casadi as cs
import numpy as np

from multimodal_to.adam.spatial import SX
from multimodal_to.models.contact import FACES
from multimodal_to.models.sole import soles
from multimodal_to.ocp import constraints
from multimodal_to.ocp.knot import Knot
from multimodal_to.ocp.parameters import Parameters
from multimodal_to.ocp.schedule import Flags
from multimodal_to.ocp.terms import Constraint, Where, at_least, between, equal
from multimodal_to.trajectory.quantities import XYZ, row_labels

ON_GROUND = 1e-5
"""Largest height of a contact point that stands [m]: a sole has more corners than a plane needs."""
IN_PLACE = 1e-5
"""How far a contact point that is given to stand may move along each tangent over an interval [m], for that reason."""

# -------------------------------------------------------------------- which rows there are


def not_standing(parameters: Parameters) -> Flags:
    """Return at which knots a point is not given to stand."""
    return ~parameters.contacts.stands


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


def _standing(parameters: Parameters) -> Flags:
    return parameters.contacts.stands


def _in_place(parameters: Parameters) -> Flags:
    return np.repeat(parameters.contacts.on, 2, axis=0)


def _names(parameters: Parameters) -> tuple[str, ...]:
    return row_labels(parameters.robot, "contact", ("",))


def _along_ground(parameters: Parameters) -> tuple[str, ...]:
    return row_labels(parameters.robot, "contact", ("x", "y"))


def _by_axis(parameters: Parameters) -> tuple[str, ...]:
    return row_labels(parameters.robot, "contact", XYZ)


def _gives(parameters: Parameters) -> bool:
    return bool(parameters.scenario.contacts or parameters.scenario.gait)


GIVEN_OFF = Constraint(
    name="given_off",
    value=constraints.contact_forces,
    within=equal(),
    unit="N",
    holds=(Where.FIRST_KNOT, Where.LATER_KNOTS),
    scale=50.0,
    labels=_by_axis,
    when=_gives,
    present=_unloaded,
)
GIVEN_ON = Constraint(
    name="given_on",
    value=constraints.heights,
    within=between(0.0, ON_GROUND),
    unit="m",
    labels=_names,
    when=_gives,
    rigid=True,
    present=_standing,
)
GIVEN_IN_PLACE = Constraint(
    name="given_in_place",
    value=constraints.slips,
    within=between(-IN_PLACE, IN_PLACE),
    unit="m",
    holds=Where.EVERY_INTERVAL,
    labels=_along_ground,
    when=_gives,
    present=_in_place,
)
CLEARANCE = Constraint(
    value=clearance,
    within=at_least(0.0),
    unit="m",
    labels=_clearance_labels,
    when=_gives,
    present=_asked_clearance,
)
CONSTRAINTS = (GIVEN_OFF, GIVEN_ON, GIVEN_IN_PLACE, CLEARANCE)
"""What contacts that a scenario gives ask for; without any there are none of their rows."""

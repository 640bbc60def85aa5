"""Whether there is a posture with all that a keyframe asks for at once: kinds of it may contradict each other."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import casadi as cs
import numpy as np

from multimodal_to.adam import centroidal, quaternion
from multimodal_to.adam.spatial import SX
from multimodal_to.doctor.balance import knot_of
from multimodal_to.doctor.diagnosis import Symptom, error, warning
from multimodal_to.doctor.task import Task
from multimodal_to.errors import apart, listed
from multimodal_to.models.robot import Robot
from multimodal_to.models.units import Sized
from multimodal_to.ocp import keyframes, paper
from multimodal_to.ocp.knot import Knot
from multimodal_to.ocp.terms import Constraint, Knots
from multimodal_to.ocp.waypoints import com as com_path
from multimodal_to.scenarios.keyframes import AXES, Keyframe, Placed, attitude_at, by_axis

_MISSED = Sized(1e-3, "m")
"""What a search brings no nearer than this is out of reach; of angles it is as many rad."""
_TURN_MAX = 0.5
"""How far the base may turn about each axis where a keyframe leaves its attitude open [rad]."""
_BALANCE = 2e-2
"""Share of the weight that thrusts may leave over in a hover: its attitude has a tolerance."""


def postures(task: Task) -> Iterator[Symptom]:
    """Look for a posture with all that each keyframe asks for, where it asks for more than one kind of thing."""
    for one in task.held_in_order:
        certain = [*_too_long(task.robot, one), *_base_off_com(task.robot, one)]
        yield from certain[:1]
        sought = _asks_for_several(one.keyframe) and not (one.keyframe.hover and not task.lifts)
        if certain or not sought or (task.stands_at_start and not one.knot):
            continue
        if missed := _missed(task, one):
            yield warning(
                one.label,
                f"no posture was found with all that is asked for at once: {missed}",
                "ask for less at once, or allow tolerances",
            )


# -------------------------------------------------------------------- what is certain


def _too_long(robot: Robot, one: Placed) -> Iterator[Symptom]:
    """Compare how far frames have to be from the CoM with how long the robot is."""
    com = by_axis(None if isinstance(one.keyframe.com, str) else one.keyframe.com)
    for name, target in one.keyframe.frames.items():
        position = by_axis(target.position)
        both = [axis for axis in AXES if axis in position and axis in com]
        away = float(np.linalg.norm([position[axis] - com[axis] for axis in both]))
        longest = extent(robot, name) + target.position_tolerance * np.sqrt(3.0)
        if away > longest:
            yield error(
                one.label,
                f"{name} has to be {apart(away, longest)} m from the CoM, and the robot is at most "
                f"{longest:.3g} m long from there",
                "ask for a nearer point, or for another CoM",
            )


def _base_off_com(robot: Robot, one: Placed) -> Iterator[Symptom]:
    """Compare how far the base's origin has to be from the CoM with how far the robot reaches from it."""
    com = by_axis(None if isinstance(one.keyframe.com, str) else one.keyframe.com)
    base = by_axis(one.keyframe.base_position)
    away = float(np.linalg.norm([base[axis] - com[axis] for axis in AXES if axis in base and axis in com]))
    longest = max(_along(robot, name) for name in robot.kindyn.tree.frames)
    if away > longest:
        yield error(
            one.label,
            f"the base has to be {apart(away, longest)} m from the CoM, and the robot reaches {longest:.3g} m from it",
            "ask for another base_position, or for another CoM",
        )


def extent(robot: Robot, frame: str) -> float:
    """Return a distance from a frame beyond which the CoM cannot be [m]: down to the base, and up to the farthest."""
    return _along(robot, frame) + max(_along(robot, name) for name in robot.kindyn.tree.frames)


def _along(robot: Robot, frame: str) -> float:
    """Return a distance from the base's origin beyond which a frame cannot be [m]."""
    tree = robot.kindyn.tree
    slides = {joint.name: max(abs(joint.lower), abs(joint.upper)) for joint in tree.joints if joint.kind == "prismatic"}
    place = tree.frames[frame]
    steps = [
        float(cs.norm_2(tree.bodies[index].translation)) + slides.get(tree.bodies[index].joint or "", 0.0)
        for index in tree.path(place.body)
    ]
    return sum(steps) + float(cs.norm_2(place.translation))


# -------------------------------------------------------------------- what a search says


def _asks_for_several(keyframe: Keyframe) -> bool:
    """Return whether a keyframe asks for what other checks do not look at together; of frames, for any."""
    com = not isinstance(keyframe.com, str) and bool(keyframe.com or keyframe.com_min or keyframe.com_max)
    turned = keyframe.yaw is not None or keyframe.base_orientation is not None
    kinds = [com, bool(keyframe.base_position), turned, bool(keyframe.joints)]
    return bool(keyframe.frames) or sum(kinds) > 1 or ((keyframe.standing or keyframe.hover) and any(kinds[1:]))


@dataclass(frozen=True, kw_only=True, eq=False)
class _Asked:
    """Rows that a posture should keep within limits."""

    what: str
    rows: SX
    lower: float
    upper: float
    components: tuple[str, ...]
    units: tuple[str, ...]


def _missed(task: Task, one: Placed) -> str:
    """Return in words what the posture that misses least misses most; nothing where it misses nothing.

    Base, joints and, in a hover, thrusts are free within their ranges. The search is a local one, solved by IPOPT, for
    the least sum of squared misses.

    Args:
        task: robot and scenario.
        one: the keyframe.
    """
    robot, limits, keyframe = task.robot, task.robot.joint_limits, one.keyframe
    position, tilt, s = cs.SX.sym("p", 3), cs.SX.sym("tilt", 3), cs.SX.sym("s", len(robot.joint_names))
    thrust = cs.SX.sym("T", len(robot.jets) if keyframe.hover else 0)
    asked = _asked(task, one, _knot(task, one, (position, tilt, s, thrust)))
    rows = cs.vertcat(*(some.rows for some in asked))
    off = cs.SX.sym("off", rows.shape[0])
    turn, home = np.full(3, _TURN_MAX), robot.home
    if keyframe.hover or (keyframe.base_orientation is not None and not keyframe.orientation_tolerance):
        turn = np.zeros(3)
    most = np.array([task.greatest("thrust", row, held)[one.knot] for row, held in enumerate(task.thrusts_held)])
    most = most[: thrust.shape[0]]
    problem = {
        "x": cs.vertcat(position, tilt, s, thrust, off),
        "f": 1e4 * cs.sumsqr(off) + 1e-3 * (cs.sumsqr(s - home.joint_positions) + cs.sumsqr(tilt)),
        "g": rows - off,
    }
    options = {"print_time": False, "ipopt": {"print_level": 0, "sb": "yes", "max_iter": 200, "tol": 1e-8}}
    solver = cs.nlpsol("together", "ipopt", problem, options)
    there = home.base_position + com_path(task.scenario)[:, one.knot] - robot.com_at(home)
    free = np.full(rows.shape[0], np.inf)
    share = most * min(robot.weight / max(float(most.sum()), 1e-9), 1.0)
    answer = solver(
        x0=np.concatenate([there, np.zeros(3), home.joint_positions, share, np.zeros(rows.shape[0])]),
        lbx=np.concatenate([np.full(3, -np.inf), -turn, limits.lower, np.zeros(most.size), -free]),
        ubx=np.concatenate([np.full(3, np.inf), turn, limits.upper, most, free]),
        lbg=np.concatenate([np.full(some.rows.shape[0], some.lower) for some in asked]),
        ubg=np.concatenate([np.full(some.rows.shape[0], some.upper) for some in asked]),
    )
    if not solver.stats()["success"]:
        return ""
    misses, said, first = np.abs(np.array(answer["x"]).ravel()[-rows.shape[0] :]), list[str](), 0
    for some in asked:
        mine = misses[first : (first := first + some.rows.shape[0])]
        worst = int(mine.argmax())
        if mine[worst] > _allowed(task, some):
            label = " ".join((some.what, some.components[worst])).rstrip()
            said.append(f"{label} stays {mine[worst]:.3g} {some.units[worst]} off")
    return listed(said) if said else ""


def _allowed(task: Task, some: _Asked) -> float:
    return _BALANCE if some.what == "balance" else _MISSED.of(task.robot.units)


def _knot(task: Task, one: Placed, free: tuple[SX, SX, SX, SX]) -> Knot:
    """Return a knot at rest, without contact forces, with base, joints and thrusts as symbols.

    Args:
        task: robot and scenario.
        one: the keyframe, which says about which attitude the base turns.
        free: position of the base, how far it turns, joints and thrusts.
    """
    position, tilt, s, thrust = free
    robot = task.robot
    thrusts = thrust if thrust.shape[0] else cs.SX.zeros(len(robot.jets))
    attitude = quaternion.product(quaternion.exp(tilt), cs.DM(attitude_at(robot, [one], one.knot)))
    posed = replace(
        knot_of(task, robot.home, cs.SX.zeros(3 * len(robot.contacts)), thrusts),
        base_position=position,
        base_quaternion_xyzw=attitude,
        joint_positions=s,
    )
    return replace(
        posed,
        com_position=centroidal.com_position(robot.kindyn.tree, posed.base, s),
        contact_positions=cs.vertcat(*(posed.pose(name).translation for name in robot.contact_names)),
    )


def _asked(task: Task, one: Placed, knot: Knot) -> list[_Asked]:
    """Return the rows of what a keyframe asks of a posture: those of its terms, feet on the ground, balance in the air.

    Args:
        task: robot and scenario.
        one: the keyframe.
        knot: a posture.
    """
    terms = keyframes.terms(task.robot, task.scenario, task.formulation.rule.name)
    held = [
        term
        for term in terms
        if isinstance(term, Constraint)
        and isinstance(term.holds, Knots)
        and term.name.startswith(f"{one.label}: ")
        and not term.name.endswith("momentum")
    ]
    if one.keyframe.standing and one.knot == task.scenario.knots:
        held.append(replace(paper.STANDING_HEIGHT, name="feet on the ground", present=None))
    found = list[_Asked]()
    for term in held:
        rows = term.rows(knot, task.parameters)
        found.append(
            _Asked(
                what=term.name.removeprefix(f"{one.label}: "),
                rows=rows.expression,
                lower=rows.lower,
                upper=rows.upper,
                components=rows.components,
                units=rows.units,
            )
        )
    if one.keyframe.hover:
        found.append(_balance(task, knot))
    return found


def _balance(task: Task, knot: Knot) -> _Asked:
    """Return the forces that are left over in the air, as shares of the weight, and moments of that at its height."""
    weight, height = task.robot.weight, task.robot.standing_height
    shares = cs.DM([1.0 / weight] * 3 + [1.0 / (weight * height)] * 3)
    rows = replace(paper.STATIC_EQUILIBRIUM, name="balance").rows(knot, task.parameters)
    units = ("m g",) * 3 + ("m g L",) * 3
    return _Asked(
        what="balance", rows=shares * rows.expression, lower=0.0, upper=0.0, components=rows.components, units=units
    )

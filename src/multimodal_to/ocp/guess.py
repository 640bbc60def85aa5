"""Where the solver starts: a standing posture by inverse kinematics, held along a straight line of the CoM."""

from __future__ import annotations

from collections.abc import Sequence

import casadi as cs
import numpy as np

from multimodal_to.adam import centroidal, quaternion
from multimodal_to.adam.kinematics import Pose, forward_kinematics
from multimodal_to.adam.spatial import Array
from multimodal_to.arguments import checked
from multimodal_to.errors import ScenarioError
from multimodal_to.models.attitude import signed_like
from multimodal_to.models.robot import Posture, Robot
from multimodal_to.models.terrain import Surface, heights_below
from multimodal_to.models.units import ONE, Sized
from multimodal_to.ocp import waypoints
from multimodal_to.ocp.flights import flights, interval, thrown
from multimodal_to.ocp.gait import GROUNDED, footfalls, steps
from multimodal_to.ocp.schedule import Schedule
from multimodal_to.ocp.variables import Layout
from multimodal_to.scenarios.failures import failing_knots
from multimodal_to.scenarios.scenario import Scenario, Start, Terminal, Vector3

_CONTACT_TOLERANCE = Sized(1e-6, "m")
"""A sole counts as on the ground below this height: more corners than a plane needs make it overdetermined."""
PLACES_WEIGHT = 30.0
"""How much feet that are elsewhere than at home count, in squares of L, beside squares of joints' ways [rad²]."""
_TILT_MAX = 0.6
"""How far the base may turn from home about each axis to stand on a slope [rad]."""

_ALONG_GROUND = np.array([[1.0], [1.0], [0.0]])
"""What takes the vertical part from positions side by side [1], (3, 1)."""
IN_THE_AIR = Sized(1e-3, "m")
"""A contact point that is higher than this bears no force."""
LANDED = 0.3
"""Share of the horizon in which a motion from the air to the ground comes down [1]."""


@checked
def standing_posture(robot: Robot, surface: Surface, com: Vector3) -> Posture:
    """Return the posture nearest to home with every contact point on the ground and the CoM at `com` [m].

    Near home are the joints and, seen from the CoM, the places of the feet: a robot that sinks keeps them there.

    The base keeps its home orientation; only where no posture stands so, on a slope that the ankles cannot follow, does
    it tilt, as little as the joints' way from home makes worth it. Least squares, solved by IPOPT.

    Args:
        robot: that stands.
        surface: the ground.
        com: where the CoM has to be, in the world [m].

    Raises:
        ScenarioError: no posture within the joint limits does that.
    """
    for tilt in (0.0, _TILT_MAX):
        posture = _nearest_posture(robot, surface, np.array(com), tilt)
        if posture is not None:
            return posture
    raise ScenarioError(
        f"no posture of {robot.name} within its joint limits stands on the ground with its CoM at {com} m; "
        "choose another CoM to stand with"
    )


def _nearest_posture(robot: Robot, surface: Surface, com: Array, tilt_max: float) -> Posture | None:
    """Return the standing posture with the base turned from home by at most `tilt_max` [rad] about each axis, if any.

    Variables: position of the base, its rotation vector from home in world axes, joints. The search is a local one, and
    the feet's places may lead it astray; where they do, it starts again from a posture that leaves them out.
    """
    tree, home, limits, count = robot.kindyn.tree, robot.home, robot.joint_limits, len(robot.joint_names)
    length = ONE.of("m", robot.units)  # what the solver takes for one
    scaled_position, tilt, joints = cs.SX.sym("p", 3), cs.SX.sym("tilt", 3), cs.SX.sym("s", count)
    position = length * scaled_position
    weight = cs.SX.sym("weight")
    orientation = quaternion.product(quaternion.exp(tilt), cs.DM(home.base_quaternion_xyzw))
    base = Pose(quaternion.rotation_matrix(orientation), position)
    points = [forward_kinematics(tree, tree.frame(name), base, joints).translation for name in robot.contact_names]
    heights = [surface.distance(point) for point in points]
    at_home = robot.com_at(home)
    places = contact_positions(robot, home).reshape(-1, 3) - at_home
    moved = cs.vertcat(
        *((point - com - place)[:2] / robot.standing_height for point, place in zip(points, places, strict=True))
    )
    problem = {
        "x": cs.vertcat(scaled_position, tilt, joints),
        "p": weight,
        "f": cs.sumsqr(joints - home.joint_positions) + cs.sumsqr(tilt) + weight * cs.sumsqr(moved),
        "g": cs.vertcat(centroidal.com_position(tree, base, joints), *heights) / length,
    }
    options = {"print_time": False, "ipopt": {"print_level": 0, "sb": "yes", "max_iter": 200, "tol": 1e-9}}
    solver = cs.nlpsol("standing_posture", "ipopt", problem, options)

    def searched(start: Array, places_weight: float) -> Array | None:
        result = solver(
            x0=start,
            p=places_weight,
            lbx=np.concatenate([np.full(3, -np.inf), np.full(3, -tilt_max), limits.lower]),
            ubx=np.concatenate([np.full(3, np.inf), np.full(3, tilt_max), limits.upper]),
            lbg=np.concatenate([com, np.zeros(len(heights))]) / length,
            ubg=np.concatenate([com, np.full(len(heights), _CONTACT_TOLERANCE.of(robot.units))]) / length,
        )
        return np.array(result["x"]).ravel() if solver.stats()["success"] else None

    lifted = np.concatenate([(home.base_position + com - at_home) / length, np.zeros(3), home.joint_positions])
    values = searched(lifted, PLACES_WEIGHT)
    if values is None:
        values = searched(lifted, 0.0)
        if values is None:
            return None
        nearer = searched(values, PLACES_WEIGHT)
        values = values if nearer is None else nearer
    turned = cs.Function("turned", [tilt], [orientation])(values[3:6])
    return Posture(
        base_position=length * values[:3],
        base_quaternion_xyzw=np.array(turned).ravel(),
        joint_positions=np.clip(values[6:], limits.lower, limits.upper),
    )


def contact_positions(robot: Robot, posture: Posture) -> Array:
    """Return the contact points of a posture in the world [m], (3 contacts,)."""
    points = [
        np.array(robot.kindyn.forward_kinematics(name, posture.base_transform, posture.joint_positions))[:3, 3]
        for name in robot.contact_names
    ]
    return np.concatenate(points) if points else np.zeros(0)


def start_guess(robot: Robot, scenario: Scenario, standing: Posture, layout: Layout) -> Array:
    """Return the start guess of every knot, (layout size, N + 1), in the variables' own units.

    The standing posture moves with the CoM on straight lines from start to end, by way of what keyframes ask for, and
    turns and bends as they ask. The contact points go along in x and y, or step `guess_steps` times; they follow the
    ground, or fly along with a robot that starts in the air. Contact forces carry the weight, unless thrusts do
    (`_weight_flown`); none acts at a point in the air. A motion from the air to the ground comes down in the first
    `LANDED` of its knots, which leaves the turbines time to slow down. Where contacts are given, feet that are off
    swing, and the others bear the weight. A robot without jets is thrown where all its feet are off, or where it has to
    be high at mid-horizon. Everything else is zero.

    Args:
        robot: with the jets that the scenario uses.
        scenario: the task.
        standing: the posture that moves along.
        layout: of the variables of a knot.
    """
    knots = scenario.knots + 1
    start = np.array(scenario.start_com)
    schedule = Schedule.of(robot, scenario)
    travelled = _travelled(robot, scenario, schedule)
    guess = np.zeros((layout.size, knots))
    view = layout.read(guess)
    view["com_position"][:] = start[:, None] + travelled
    away = view["com_position"] - robot.com_at(standing)[:, None]  # of the posture from where it stands
    view["base_position"][:] = standing.base_position[:, None] + away
    upright = robot.upright.base_quaternion_xyzw
    view["base_quaternion_xyzw"][:] = signed_like(standing.base_quaternion_xyzw, upright)[:, None]
    view["joint_positions"][:] = standing.joint_positions[:, None]

    flown = _weight_flown(robot, scenario, schedule)
    _set_jets(robot, scenario, view, flown)
    feet = [contact.foot for contact in robot.contacts]
    if schedule.given.any():
        moved, shares = footfalls(robot, schedule, travelled)
    else:
        moved, shares = (
            steps(feet, robot.gait, scenario, travelled) if scenario.guess_steps else _glide(feet, travelled)
        )
    in_air = flights(robot, scenario, schedule, float(view["com_position"][2, scenario.knots // 2]))
    rise, speed = thrown(robot, scenario, in_air)
    moved[:, 2] = np.maximum(moved[:, 2], rise)
    shares = shares * (rise <= 0.0)
    moved = moved + away[:, :1] * _ALONG_GROUND
    stands = contact_positions(robot, standing).reshape(-1, 3, 1)
    points = stands + moved
    points[:, 2] += _ground(scenario, points) - _ground(scenario, stands)
    if scenario.start is not Start.STANDING or _lifts_off_whole(robot, scenario):
        points[:, 2] = np.maximum(points[:, 2], (stands + away)[:, 2])  # the feet fly along
    along = np.gradient(travelled, interval(scenario), axis=1) * (rise > 0.0)
    for name in ("com_position", "base_position"):
        view[name][2] += rise
    for name in ("com_velocity", "base_linear_velocity"):
        view[name][:] += along
        view[name][2] += speed
    if scenario.keyframes:
        points = waypoints.pose(robot, scenario, view, points)
        shares = shares * (points[:, 2] - _ground(scenario, points) < IN_THE_AIR.of(robot.units))
    view["contact_positions"][:] = points.reshape(-1, knots)
    view["contact_forces"][2::3] = robot.weight * (1.0 - flown) * shares
    return guess


def _lands(scenario: Scenario) -> bool:
    """Return whether a motion goes from the air to the ground."""
    return scenario.start is not Start.STANDING and scenario.terminal is Terminal.STANDING


def _travelled(robot: Robot, scenario: Scenario, schedule: Schedule) -> Array:
    """Return how far the CoM is from its start at every knot [m], (3, N + 1), by way of the keyframes."""
    start = np.array(scenario.start_com)
    if not scenario.keyframes_between():
        return np.asarray((np.array(scenario.end_com) - start)[:, None] * _progress(robot, scenario, schedule))
    return np.asarray(waypoints.com(scenario, early=LANDED if _lands(scenario) else 1.0) - start[:, None])


def _progress(robot: Robot, scenario: Scenario, schedule: Schedule) -> Array:
    """Return which share of the way is behind the robot at every knot, (N + 1,); one that lands is there early.

    A robot that lifts off whole stays where it is until its thrusts carry it, after `GROUNDED` of the horizon.
    Where contacts are given, the robot goes on while a point of it is off.
    """
    share = np.linspace(0.0, 1.0, scenario.knots + 1)
    if (off := schedule.off.any(axis=0)).any():
        return np.asarray(np.cumsum(off) / off.sum())
    if _lifts_off_whole(robot, scenario):
        return np.maximum(share - GROUNDED, 0.0) / (1.0 - GROUNDED)
    return np.minimum(share / LANDED, 1.0) if _lands(scenario) else share


def _lifts_off_whole(robot: Robot, scenario: Scenario) -> bool:
    """Return whether a motion leaves the ground for the air with feet that no joint moves, so that they go along."""
    if scenario.start is not Start.STANDING or scenario.terminal is not Terminal.HOVER:
        return False
    if not robot.contacts or scenario.keyframes_between():
        return False
    return all(robot.kindyn.tree.frame(name).body == 0 for name in robot.contact_names)


def _weight_flown(robot: Robot, scenario: Scenario, schedule: Schedule) -> Array:
    """Return the share of the weight that the thrusts carry at every knot, (N + 1,).

    All of it for a motion that starts in the air, until it has landed; from there on they hand it over. On a walk into
    the air they take it over. Between keyframes that hover or stand it changes evenly. Otherwise the feet carry it.
    Where all feet are given to be off, the thrusts do.
    """
    if not robot.jets:
        return np.zeros(scenario.knots + 1)
    return np.where(schedule.in_air, 1.0, _usually_flown(robot, scenario))


def _usually_flown(robot: Robot, scenario: Scenario) -> Array:
    share = np.linspace(0.0, 1.0, scenario.knots + 1)
    if any(one.keyframe.hover or one.keyframe.standing for one in scenario.keyframes_between()):
        return waypoints.flown(scenario)
    if scenario.start is not Start.STANDING:
        return np.minimum((1.0 - share) / (1.0 - LANDED), 1.0) if _lands(scenario) else np.ones_like(share)
    if _lifts_off_whole(robot, scenario):
        return np.minimum(share / GROUNDED, 1.0)
    return share if scenario.terminal is Terminal.HOVER and scenario.guess_steps else np.zeros_like(share)


def _ground(scenario: Scenario, points: Array) -> Array:
    """Return the height of the ground below points (count, 3, knots), (count, knots)."""
    count, _, knots = points.shape
    return heights_below(scenario.surface, points.transpose(1, 0, 2).reshape(3, -1)).reshape(count, knots)


def _set_jets(robot: Robot, scenario: Scenario, view: dict[str, Array], flown: Array) -> None:
    """Let all jets that have not failed push alike, as much as their limits allow."""
    works = np.ones((len(robot.jets), scenario.knots + 1))
    for row, knot in failing_knots(scenario.failures, robot.jet_names, scenario.knots).items():
        works[row, knot:] = 0.0
    shares = works / np.maximum(works.sum(axis=0), 1.0)
    for index, jet in enumerate(robot.jets):
        thrust = np.minimum(flown * robot.weight * shares[index], jet.thrust_max)
        throttle = [jet.model.steady_throttle(value) for value in thrust]
        view["thrust"][index] = thrust
        view["thrust_rate"][index, 1:] = np.diff(thrust) / interval(scenario)
        view["throttle"][index] = np.clip(throttle, jet.throttle_min, jet.throttle_max)


def _glide(feet: Sequence[str], travelled: Array) -> tuple[Array, Array]:
    """Return how far each contact point has moved along the ground, (contacts, 3, N + 1), and its share of the load."""
    count = len(feet)
    return np.tile(travelled * _ALONG_GROUND, (count, 1, 1)), np.full((count, travelled.shape[1]), 1.0 / max(count, 1))

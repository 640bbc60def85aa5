"""Where the solver starts: a standing posture by inverse kinematics, held along a straight line of the CoM."""

from __future__ import annotations

import casadi as cs
import numpy as np
from numpy.typing import NDArray

from multimodal_to.adam import centroidal, quaternion
from multimodal_to.adam.kinematics import Pose, forward_kinematics
from multimodal_to.errors import ScenarioError
from multimodal_to.models.robot import Posture, Robot
from multimodal_to.models.terrain import Surface
from multimodal_to.ocp.scenario import Scenario, Vector3
from multimodal_to.ocp.variables import Layout

Array = NDArray[np.float64]

_CONTACT_TOLERANCE = 1e-6
"""A sole counts as on the ground below this height [m]: more corners than a plane needs make it overdetermined."""
_TILT_MAX = 0.6
"""How far the base may turn from home about each axis to stand on a slope [rad]."""


def standing_posture(robot: Robot, surface: Surface, com: Vector3) -> Posture:
    """Return the posture nearest to home with every contact point on the ground and the CoM at `com` [m].

    The base keeps its home orientation; only where no posture stands so, on a slope that the ankles cannot follow, does
    it tilt, as little as the joints' way from home makes worth it. Least squares, solved by IPOPT.

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

    Variables: position of the base, its rotation vector from home in world axes, joints.
    """
    tree, home, limits, count = robot.kindyn.tree, robot.home, robot.joint_limits, len(robot.joint_names)
    position, tilt, joints = cs.SX.sym("p", 3), cs.SX.sym("tilt", 3), cs.SX.sym("s", count)
    orientation = quaternion.product(quaternion.exp(tilt), cs.DM(home.base_quaternion_xyzw))
    base = Pose(quaternion.rotation_matrix(orientation), position)
    heights = [
        surface.distance(forward_kinematics(tree, tree.frame(name), base, joints).translation)
        for name in robot.contact_names
    ]
    problem = {
        "x": cs.vertcat(position, tilt, joints),
        "f": cs.sumsqr(joints - home.joint_positions) + cs.sumsqr(tilt),
        "g": cs.vertcat(centroidal.com_position(tree, base, joints), *heights),
    }
    options = {"print_time": False, "ipopt": {"print_level": 0, "sb": "yes", "max_iter": 200, "tol": 1e-9}}
    solver = cs.nlpsol("standing_posture", "ipopt", problem, options)
    result = solver(
        x0=np.concatenate([home.base_position, np.zeros(3), home.joint_positions]),
        lbx=np.concatenate([np.full(3, -np.inf), np.full(3, -tilt_max), limits.lower]),
        ubx=np.concatenate([np.full(3, np.inf), np.full(3, tilt_max), limits.upper]),
        lbg=np.concatenate([com, np.zeros(len(heights))]),
        ubg=np.concatenate([com, np.full(len(heights), _CONTACT_TOLERANCE)]),
    )
    if not solver.stats()["success"]:
        return None
    values = np.array(result["x"]).ravel()
    turned = cs.Function("turned", [tilt], [orientation])(values[3:6])
    return Posture(
        base_position=values[:3],
        base_quaternion_xyzw=np.array(turned).ravel(),
        joint_positions=np.clip(values[6:], limits.lower, limits.upper),
    )


def contact_positions(robot: Robot, posture: Posture) -> Array:
    """Return the contact points of a posture in the world [m], (3 contacts,)."""
    transform = base_transform(posture)
    points = [
        np.array(robot.kindyn.forward_kinematics(name, transform, posture.joint_positions))[:3, 3]
        for name in robot.contact_names
    ]
    return np.concatenate(points) if points else np.zeros(0)


def base_transform(posture: Posture) -> Array:
    """Return w_H_base of a posture, (4, 4)."""
    transform = np.eye(4)
    transform[:3, :3] = np.array(quaternion.rotation_matrix(cs.DM(posture.base_quaternion_xyzw)))
    transform[:3, 3] = posture.base_position
    return transform


def straight_line(robot: Robot, scenario: Scenario, standing: Posture) -> Array:
    """Return the start guess of every knot, (layout size, N + 1), in the variables' own units.

    The standing posture moves with the CoM on the straight line from start to end (contact points in x and y only),
    every jet at `guess_thrust`, vertical contact forces at `guess_contact_load`, everything else at zero.
    """
    layout = Layout.of(robot)
    knots = scenario.knots + 1
    start, end = np.array(scenario.initial_com), np.array(scenario.final_com)
    travelled = (end - start)[:, None] * np.linspace(0.0, 1.0, knots)
    along_ground = travelled * np.array([[1.0], [1.0], [0.0]])
    guess = np.zeros((layout.size, knots))
    view = layout.read(guess)
    view["com_position"][:] = start[:, None] + travelled
    view["base_position"][:] = standing.base_position[:, None] + travelled
    view["base_quaternion_xyzw"][:] = standing.base_quaternion_xyzw[:, None]
    view["joint_positions"][:] = standing.joint_positions[:, None]
    points = contact_positions(robot, standing)[:, None]
    view["contact_positions"][:] = points + np.tile(along_ground, (len(robot.contacts), 1))
    thrust = np.minimum(scenario.guess_thrust, [jet.thrust_max for jet in robot.jets])
    view["thrust"][:] = thrust[:, None]
    view["contact_forces"][2::3] = scenario.guess_contact_load * robot.weight / len(robot.contacts)
    return guess

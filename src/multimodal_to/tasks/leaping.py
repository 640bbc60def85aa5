"""How high the motors of a robot can throw it, by their torques and by their speeds."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache

import casadi as cs
import numpy as np

from multimodal_to.adam.spatial import Array
from multimodal_to.models.robot import Robot
from multimodal_to.scenarios.margins import Margins

STROKE, DEPTHS = 0.2, 4
"""How far the CoM is lowered before a jump [L], and at how many depths the push is looked at."""
LOWER = 2
"""At which of these depths the legs are at lift-off: arms and trunk that go up lift the CoM to where home has it."""
STRONGEST = 3.0
"""A push is counted up to this [m g]: legs that are almost straight could bear more, for a moment."""
_SLOW, _ASIDE = 1e-6, 0.1
"""Less than this is no speed [m/s], and how much of the way up a way aside or a turn may be [1]."""
_STEPS, _LONGEST, _DONE, _DAMPING, _OFF = 50, 0.2, 1e-7, 1e-8, 1e-3  # of the search for a crouch; _OFF in L


@lru_cache(maxsize=16)
def leap_height(robot: Robot) -> float:
    """Return about how high the motors can throw the CoM above home, with the feet on the ground until then [m].

    It is the lesser of two heights, each by linear programs in crouches, with the feet in place and the trunk upright:

    - Speed: v²/(2 g). v is the greatest speed of the CoM straight up with J_i ν = 0 for each contact point,
      A_G ν = (0, 0, m v, 0, 0, 0) and |ṡ| ≤ ṡ_max. A_G is the centroidal momentum matrix (D. E. Orin, A. Goswami,
      S.-H. Lee, "Centroidal dynamics of a humanoid robot", Autonomous Robots 2013). The posture is half of `STROKE`
      lower than home, or as low as the legs can be: in solved jumps arms that go up lift the CoM by about as much.
    - Work: ∫ (λ − 1) dz from a crouch up to home, from the depth of at most `STROKE` L that gives most. λ(z) is the
      greatest push in units of m g: λ G = (0, τ) + Σ J_iᵀ f_i with the torques and the friction that plans may use.
      G is the gravity term. So every link is taken to speed up alike, by (λ − 1) g.

    Both are estimates: a motion may lean, or swing its arms, and get some more out of the same motors.

    Args:
        robot: with feet, joints and gravity.
    """
    looked_at, home = _functions(robot), np.asarray(robot.home.joint_positions)
    gravity, height = robot.weight / robot.mass, robot.standing_height
    depth, fastest = STROKE * height / DEPTHS, _fastest(robot, looked_at, home)
    joints, pushes, by_work = home, [_strongest(robot, looked_at, home)], 0.0
    for step in range(1, DEPTHS + 1):
        found = _lowered(robot, looked_at, joints, step * depth)
        if found is None:
            break
        joints = found
        fastest = _fastest(robot, looked_at, joints) if step <= LOWER else fastest
        pushes.append(_strongest(robot, looked_at, joints))
        by_work = max(by_work, depth * (sum(pushes) - 0.5 * (pushes[0] + pushes[-1]) - step))
    return min(fastest**2 / (2.0 * gravity), by_work)


_Looked = Callable[[Array], tuple[Array, ...]]


def _functions(robot: Robot) -> _Looked:
    """Return a function of s: places of the contact points from the CoM and their slopes, J of all, A_G and G."""
    base, joints, kindyn = cs.SX(robot.home.base_transform), cs.SX.sym("s", len(robot.joint_names)), robot.kindyn
    com = kindyn.CoM_position(base, joints)
    arms = cs.vertcat(*(kindyn.forward_kinematics(name, base, joints)[:3, 3] - com for name in robot.contact_names))
    jacobian = cs.vertcat(*(kindyn.jacobian(name, base, joints)[:3, :] for name in robot.contact_names))
    momentum, weight = kindyn.centroidal_momentum_matrix(base, joints), kindyn.gravity_term(base, joints)
    function = cs.Function("posture", [joints], [arms, cs.jacobian(arms, joints), jacobian, momentum, weight])
    return lambda values: tuple(np.array(part) for part in function(values))


def _lowered(robot: Robot, looked_at: _Looked, start: Array, depth: float) -> Array | None:
    """Return a posture with the CoM lower than at home above feet that stay where they are, near another one.

    None is returned where the legs do not get there. The trunk stays upright.

    Args:
        robot: that crouches.
        looked_at: what is known of a posture.
        start: s to start from, (n,).
        depth: how much lower the CoM is than at home [m].
    """
    limits, joints, height = robot.joint_limits, start.copy(), robot.standing_height
    wanted = looked_at(np.asarray(robot.home.joint_positions))[0].ravel() + np.tile(
        [0.0, 0.0, depth], len(robot.contacts)
    )
    for _ in range(_STEPS):
        arms, slopes, *_ = looked_at(joints)
        left = (wanted - arms.ravel()) / height
        slopes = slopes / height
        step = np.linalg.solve(slopes.T @ slopes + _DAMPING * np.eye(joints.size), slopes.T @ left)
        joints = np.clip(joints + np.clip(step, -_LONGEST, _LONGEST), limits.lower, limits.upper)
        if np.abs(step).max() < _DONE:
            break
    return joints if np.abs(wanted - looked_at(joints)[0].ravel()).max() < _OFF * height else None


def _fastest(robot: Robot, looked_at: _Looked, joints: Array) -> float:
    """Return how fast the CoM can go straight up while the feet stand [m/s].

    Legs with too few joints may not let it go straight up without any turn or way aside. There both may be a tenth of
    the way up, of the angular momentum by L.

    Args:
        robot: whose joints have greatest speeds.
        looked_at: what is known of a posture.
        joints: s, (n,).
    """
    _, _, jacobian, momentum, _ = looked_at(joints)
    upward = np.zeros((len(jacobian) + 6, 1))
    upward[len(jacobian) + 2] = -robot.mass
    rows = np.hstack([np.vstack([jacobian, momentum]), upward])
    most = np.concatenate([np.full(6, np.inf), robot.joint_limits.speed, [np.inf]])
    exactly = np.zeros(len(rows))
    if (straight := _most(rows, exactly, exactly, -most, most)) > _SLOW:
        return straight
    aside = np.delete(np.arange(len(rows)), len(jacobian) + 2)[len(jacobian) :]
    share = _ASIDE * robot.mass * np.array([[1.0], [1.0], *[[robot.standing_height]] * 3])
    below, above = (np.hstack([rows[aside, :-1], sign * share]) for sign in (-1.0, 1.0))
    held = np.delete(rows, aside, axis=0)
    lower = np.concatenate([np.zeros(len(held)), np.full(len(aside), -np.inf), np.zeros(len(aside))])
    upper = np.concatenate([np.zeros(len(held) + len(aside)), np.full(len(aside), np.inf)])
    return _most(np.vstack([held, below, above]), lower, upper, -most, most)


def _strongest(robot: Robot, looked_at: _Looked, joints: Array) -> float:
    """Return how strongly the robot can push itself up, at most `STRONGEST` [m g].

    Args:
        robot: whose joints have greatest torques.
        looked_at: what is known of a posture.
        joints: s, (n,).
    """
    _, _, jacobian, _, weight = looked_at(joints)
    count, points, margins = joints.size, len(robot.contacts), Margins()
    slope = margins.friction * robot.friction
    pyramid = np.array([[1.0, 0.0, slope], [-1.0, 0.0, slope], [0.0, 1.0, slope], [0.0, -1.0, slope]])
    balance = np.hstack([-np.eye(6 + count)[:, 6:], -jacobian.T, weight])  # of τ, f and λ
    cones = np.hstack([np.zeros((4 * points, count)), np.kron(np.eye(points), pyramid), np.zeros((4 * points, 1))])
    lower = np.zeros(6 + count + 4 * points)
    upper = np.concatenate([np.zeros(6 + count), np.full(4 * points, np.inf)])
    torques = margins.torque * robot.joint_limits.effort
    most = np.concatenate([torques, np.full(3 * points, np.inf), [STRONGEST]])
    least = np.concatenate([-torques, np.tile([-np.inf, -np.inf, 0.0], points), [0.0]])
    return _most(np.vstack([balance, cones]), lower, upper, least, most)


def _most(rows: Array, lower: Array, upper: Array, least: Array, most: Array) -> float:
    """Return the greatest last variable of a linear program.

    Args:
        rows: matrix, (rows, variables).
        lower: least value of each row.
        upper: greatest value of each row.
        least: of each variable.
        most: of each variable.
    """
    variables = rows.shape[1]
    programme = cs.conic(
        "most",
        "highs",
        {"h": cs.Sparsity(variables, variables), "a": cs.DM(rows).sparsity()},
        {"highs": {"output_flag": False}},
    )
    answer = programme(g=-np.eye(variables)[-1], a=cs.DM(rows), lba=lower, uba=upper, lbx=least, ubx=most)
    return float(answer["x"][-1])

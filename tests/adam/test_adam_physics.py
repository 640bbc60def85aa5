"""Laws of mechanics on random trees, and of rotations, near the identity and near half a turn too."""

from __future__ import annotations

from functools import cache

import casadi as cs
import numpy as np
import pytest

from adam_robots import BODY, INERTIAL, MIXED, State, random_rotation, random_states, skew
from multimodal_to.adam import KinDynComputations, Representations, quaternion
from multimodal_to.adam.urdf import read_urdf
from random_trees import random_urdf

TREES = [(5, 0), (8, 1), (12, 2), (20, 3), (30, 4), (12, 5, 0.4), (24, 6, 0.6)]  # bodies, seed, share of mimic joints
REPRESENTATIONS = [MIXED, BODY, INERTIAL]
RTOL = 1e-9

trees = pytest.mark.parametrize("tree", TREES, ids=lambda tree: f"{tree[0]}-bodies" + "-mimics" * len(tree[2:]))
representations = pytest.mark.parametrize("representation", REPRESENTATIONS, ids=["mixed", "body", "inertial"])


@cache
def robot(tree: tuple, representation: Representations = MIXED) -> KinDynComputations:
    return KinDynComputations(random_urdf(*tree), representation=representation)


def states(kindyn: KinDynComputations, count: int = 3) -> list[State]:
    """Return random states, one of them with the base turned by 1e-7 rad and one by almost half a turn."""
    found = random_states(kindyn.NDoF, count, seed=5)
    for state, angle in zip(found[1:], (1e-7, np.pi - 1e-7), strict=False):
        state.H[:3, :3] = quaternion.rotation_matrix(quaternion.exp(cs.DM(angle * np.array([0.6, 0.0, -0.8]))))
    return found


def moved(state: State, dt: float, representation: Representations) -> State:
    """Return the state after `dt` at constant ν, exact to the order of `dt`⁴ for the base."""
    R, p, v = state.H[:3, :3], state.H[:3, 3], state.v
    if representation is MIXED:
        p_new, omega = p + v[:3] * dt, v[3:]
    elif representation is INERTIAL:
        omega = v[3:]
        p_new = _screw(v, dt) @ np.append(p, 1)
        p_new = p_new[:3]
    else:
        omega = R @ v[3:]
        p_new = p + R @ _screw(v, dt)[:3, 3]
    H = np.eye(4)
    H[:3, :3], H[:3, 3] = _exp(omega * dt) @ R, p_new
    return State(H=H, s=state.s + dt * state.s_dot, v=v, s_dot=state.s_dot, v_dot=state.v_dot, s_ddot=state.s_ddot)


def _exp(phi: np.ndarray) -> np.ndarray:
    return np.array(quaternion.rotation_matrix(quaternion.exp(cs.DM(phi))))


def _screw(v: np.ndarray, dt: float) -> np.ndarray:
    """Return exp of the twist times dt, (4, 4), by its series."""
    matrix = np.zeros((4, 4))
    matrix[:3, :3], matrix[:3, 3] = skew(v[3:]) * dt, v[:3] * dt
    term, total = np.eye(4), np.eye(4)
    for order in range(1, 8):
        term = term @ matrix / order
        total = total + term
    return total


def derivative(value, state: State, representation: Representations, dt: float = 1e-3) -> np.ndarray:
    """Return d/dt along constant ν by central differences of fourth order."""
    at = [np.array(value(moved(state, step * dt, representation))) for step in (-2, -1, 1, 2)]
    return (at[0] - 8 * at[1] + 8 * at[2] - at[3]) / (12 * dt)


def close(actual, expected, rtol: float = RTOL) -> None:
    expected = np.array(expected)
    actual = np.array(actual).reshape(expected.shape)
    scale = max(1e-3, float(np.abs(expected).max(initial=0.0)))
    assert np.abs(actual - expected).max(initial=0.0) <= rtol * scale


# ---------------------------------------------------------------- bodies one by one, from their own URDF


def bodies(tree: tuple, state: State) -> list[tuple[float, np.ndarray, np.ndarray, np.ndarray, np.ndarray]]:
    """Return mass, CoM, inertia about it, velocity and angular velocity of every link in world axes."""
    kindyn, links = robot(tree), read_urdf(random_urdf(*tree))[0]
    found = []
    for link in links:
        H = np.array(kindyn.forward_kinematics(link.name, *state.pose))
        twist = np.array(kindyn.jacobian(link.name, *state.pose)).dot(state.nu)
        R, omega = H[:3, :3], twist[3:]
        arm = R @ link.com
        found.append((link.mass, H[:3, 3] + arm, R @ link.inertia @ R.T, twist[:3] + np.cross(omega, arm), omega))
    return found


@trees
def test_kinetic_energy_is_that_of_all_links_and_of_the_mass_matrix(tree) -> None:
    kindyn = robot(tree)
    for state in states(kindyn):
        expected = sum(m * v @ v / 2 + w @ J @ w / 2 for m, _, J, v, w in bodies(tree, state))
        close(kindyn.kinetic_energy(*state.motion), expected)
        close(state.nu @ np.array(kindyn.mass_matrix(*state.pose)) @ state.nu / 2, expected)


@trees
def test_momentum_is_that_of_all_links_and_of_its_matrix(tree) -> None:
    kindyn = robot(tree)
    for state in states(kindyn):
        links = bodies(tree, state)
        com = sum(m * c for m, c, *_ in links) / kindyn.get_total_mass()
        linear = sum(m * v for m, _, _, v, _ in links)
        angular = sum(J @ w + m * np.cross(c - com, v) for m, c, J, v, w in links)
        expected = np.concatenate([linear, angular])
        close(kindyn.CoM_position(*state.pose), com)
        close(kindyn.CoM_velocity(*state.motion), linear / kindyn.get_total_mass())
        close(kindyn.centroidal_momentum(*state.motion), expected)
        close(np.array(kindyn.centroidal_momentum_matrix(*state.pose)) @ state.nu, expected)
        close(kindyn.potential_energy(*state.pose), -kindyn.get_total_mass() * kindyn.gravity @ com)


# ---------------------------------------------------------------- derivatives along the motion


@trees
@representations
def test_a_jacobian_times_nu_is_the_derivative_of_the_pose(tree, representation) -> None:
    kindyn, frame = robot(tree, representation), f"link{tree[0] - 1}"
    for state in states(kindyn):
        H = np.array(kindyn.forward_kinematics(frame, *state.pose))
        rate = derivative(lambda at: kindyn.forward_kinematics(frame, *at.pose), state, representation)
        turning = rate[:3, :3] @ H[:3, :3].T
        p_dot, omega = rate[:3, 3], np.array([turning[2, 1], turning[0, 2], turning[1, 0]])
        if representation is BODY:
            p_dot, omega = H[:3, :3].T @ p_dot, H[:3, :3].T @ omega
        elif representation is INERTIAL:
            p_dot = p_dot - np.cross(omega, H[:3, 3])
        twist = np.array(kindyn.jacobian(frame, *state.pose)) @ state.nu
        close(twist, np.concatenate([p_dot, omega]), rtol=1e-8)


@trees
@representations
def test_rates_of_matrices_are_their_derivatives(tree, representation) -> None:
    kindyn, frame = robot(tree, representation), f"link{tree[0] - 1}"
    for state in states(kindyn):
        J_dot = derivative(lambda at: kindyn.jacobian(frame, *at.pose), state, representation)
        close(kindyn.jacobian_dot(frame, *state.motion), J_dot, rtol=1e-8)
        close(kindyn.jacobian_dot_nu(frame, *state.motion), J_dot @ state.nu, rtol=1e-7)
        bias = derivative(lambda at: kindyn.centroidal_momentum(*at.motion), state, representation)
        close(kindyn.centroidal_momentum_bias(*state.motion), bias.ravel(), rtol=1e-7)
        velocity = derivative(lambda at: kindyn.CoM_position(*at.pose), state, representation)
        close(kindyn.CoM_velocity(*state.motion), velocity.ravel(), rtol=1e-8)
        close(np.array(kindyn.CoM_jacobian(*state.pose)) @ state.nu, velocity.ravel(), rtol=1e-8)


@trees
@representations
def test_the_mass_matrix_changes_as_the_coriolis_matrix_says(tree, representation) -> None:
    kindyn = robot(tree, representation)
    for state in states(kindyn):
        C = np.array(kindyn.coriolis_matrix(*state.motion))
        close(C @ state.nu, np.array(kindyn.coriolis_term(*state.motion)).ravel())
        M_dot = derivative(lambda at: kindyn.mass_matrix(*at.pose), state, representation)
        close(M_dot, C + C.T, rtol=1e-8)


@trees
@representations
def test_energy_changes_by_the_power_of_the_forces(tree, representation) -> None:
    """d/dt (T + V) = ν·τ: along constant ν by differences, and ν·M ν̇ for the rest."""
    kindyn = robot(tree, representation)
    for state in states(kindyn):
        tau = np.array(kindyn.rnea(*state.motion, state.v_dot, state.s_ddot)).ravel()
        along = derivative(
            lambda at: kindyn.kinetic_energy(*at.motion) + kindyn.potential_energy(*at.pose), state, representation
        )
        changing = state.nu @ np.array(kindyn.mass_matrix(*state.pose)) @ state.nu_dot
        close(tau @ state.nu, float(along.item()) + changing, rtol=1e-7)


# ---------------------------------------------------------------- the equation of motion


@trees
@representations
def test_the_derivative_of_rnea_by_acceleration_is_the_mass_matrix(tree, representation) -> None:
    kindyn = robot(tree, representation)
    for state in states(kindyn, 2):
        v_dot, s_ddot = cs.SX.sym("a", 6), cs.SX.sym("b", kindyn.NDoF)
        tau = kindyn.rnea(*state.motion, v_dot, s_ddot)
        M = cs.evalf(cs.jacobian(tau, cs.vertcat(v_dot, s_ddot)))
        close(M, kindyn.mass_matrix(*state.pose))
        bias = np.array(kindyn.rnea(*state.motion, np.zeros(6), np.zeros(kindyn.NDoF)))
        close(bias, kindyn.bias_force(*state.motion))
        close(bias, np.array(kindyn.coriolis_term(*state.motion)) + np.array(kindyn.gravity_term(*state.pose)))


@trees
@representations
def test_forward_dynamics_undoes_inverse_dynamics(tree, representation) -> None:
    kindyn = robot(tree, representation)
    wrench = {f"link{tree[0] - 1}": np.arange(6.0)}
    for state in states(kindyn):
        tau = np.array(kindyn.rnea(*state.motion, state.v_dot, state.s_ddot, wrench)).ravel()
        nu_dot = kindyn.aba(*state.motion, tau[6:], {**wrench, "link0": tau[:6]})
        close(nu_dot, state.nu_dot, rtol=1e-8)


# ---------------------------------------------------------------- rotations

ANGLES = [0.0, 1e-12, 1e-7, 1e-4, 1e-3, 0.5, 2.0, np.pi - 1e-3, np.pi - 1e-7]


@pytest.mark.parametrize("angle", ANGLES)
def test_log_undoes_exp(angle: float) -> None:
    rng = np.random.default_rng(6)
    for _ in range(5):
        axis = rng.normal(size=3)
        phi = angle * axis / np.linalg.norm(axis)
        rho = quaternion.exp(cs.DM(phi))
        assert abs(float(cs.norm_2(rho)) - 1) < 1e-14
        close(quaternion.log(rho), phi, rtol=1e-12)
        close(quaternion.log(-rho), phi, rtol=1e-12)


@pytest.mark.parametrize("angle", ANGLES)
def test_exp_turns_as_the_matrix_exponential_does(angle: float) -> None:
    axis = np.array([0.48, -0.6, 0.64])
    S = skew(axis)
    expected = np.eye(3) + np.sin(angle) * S + 2 * np.sin(angle / 2) ** 2 * S @ S
    close(_exp(angle * axis), expected, rtol=1e-14)


@pytest.mark.parametrize("angle", [0.0, 1e-9, 1e-7, 1e-4, 2e-4, 1.0, np.pi - 1e-7])
def test_exp_and_log_are_smooth(angle: float) -> None:
    """The derivative of Exp is that of its half-angle form, and the one of Log its inverse, also through zero."""
    phi = cs.SX.sym("phi", 3)
    rho = quaternion.exp(phi)
    value = cs.DM(angle * np.array([0.6, 0.8, 0.0]))
    through = cs.Function("f", [phi], [cs.jacobian(quaternion.log(rho), phi)])(value)
    close(through, np.eye(3), rtol=1e-7)


def test_product_of_quaternions_is_product_of_rotations() -> None:
    rng = np.random.default_rng(7)
    for _ in range(5):
        left, right = (cs.DM(q / np.linalg.norm(q)) for q in rng.normal(size=(2, 4)))
        both = quaternion.rotation_matrix(left) @ quaternion.rotation_matrix(right)
        close(quaternion.rotation_matrix(quaternion.product(left, right)), both, rtol=1e-14)
        close(quaternion.product(left, quaternion.conjugate(left)), [0, 0, 0, 1], rtol=1e-14)
        close(np.array(both) @ np.array(both).T, np.eye(3), rtol=1e-14)
    close(random_rotation(rng) @ np.zeros(3), np.zeros(3))

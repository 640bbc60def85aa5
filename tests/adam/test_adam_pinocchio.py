"""Every quantity against Pinocchio in all three representations, on the iRonCub and robots of example-robot-data."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

from adam_robots import BODY, INERTIAL, IRONCUB, MIXED, Example, Peer, State, ironcub_joints, random_states, skew
from multimodal_to.adam import KinDynComputations, Representations

TOLERANCE = 1e-9  # of the largest entry
FRAMES = 3  # of each robot
ROBOTS = [
    # humanoids
    Example("alexander_description/urdf/alexander_v1.lowerBodyOnly.urdf"),
    Example("talos_data/robots/talos_reduced.urdf"),
    Example("icub_description/robots/icub_reduced.urdf"),
    # legs
    Example("anymal_b_simple_description/robots/anymal.urdf"),
    Example("solo_description/robots/solo12.urdf"),
    Example("go2_description/urdf/go2.urdf"),
    Example("bolt_description/robots/bolt.urdf"),
    # arms and a hand
    Example("ur_description/urdf/ur5_robot.urdf"),
    Example("xarm_description/urdf/xarm7.urdf"),
    Example("kinova_description/robots/kinova.urdf"),
    Example("allegro_hand_description/urdf/allegro_right_hand.urdf"),
    Example("double_pendulum_description/urdf/double_pendulum_continuous.urdf"),
    # prismatic joints: a finger with its mimic, the same with it locked, and a lifting torso
    Example("panda_description/urdf/panda.urdf"),
    Example("panda_description/urdf/panda.urdf", locked=("panda_finger_joint2",)),
    Example("tiago_description/robots/tiago_no_hand.urdf"),
    # drones
    Example("hextilt_description/urdf/hextilt_flying_arm_5.urdf"),
    Example("hector_description/robots/quadrotor_base.urdf"),
]
REFERENCES = {BODY: pin.LOCAL, MIXED: pin.LOCAL_WORLD_ALIGNED, INERTIAL: pin.WORLD}
NAMES = {BODY: "body-fixed", MIXED: "mixed", INERTIAL: "inertial-fixed"}


def drift(state: State, X: np.ndarray, representation: Representations) -> tuple[np.ndarray, np.ndarray]:
    """Return Ẋ, and Ẋ ν, of the matrix that maps ν to Pinocchio's v."""
    v = X @ state.nu
    rate = np.zeros_like(X)
    if representation is MIXED:
        rate[:6, :6] = np.kron(np.eye(2), -skew(v[3:6])) @ X[:6, :6]
    elif representation is INERTIAL:
        crossed = np.block([[skew(v[3:6]), skew(v[:3])], [np.zeros((3, 3)), skew(v[3:6])]])
        rate[:6, :6] = -crossed @ X[:6, :6]
    return rate, rate @ state.nu


def frame_errors(kindyn: KinDynComputations, peer: Peer, state: State, frame: str) -> dict[str, tuple]:
    """Return ours and Pinocchio's of everything about one frame, after `computeAllTerms` and its kin have run."""
    model, data, representation = peer.model, peer.data, kindyn.representation
    index, reference = model.getFrameId(frame), REFERENCES[representation]
    X = peer.into(state, representation)
    rate, bias = drift(state, X, representation)
    pin.forwardKinematics(model, data, peer.q(state), X @ state.nu, bias)
    pin.updateFramePlacements(model, data)
    J = pin.getFrameJacobian(model, data, index, reference)
    J_dot = pin.getFrameJacobianTimeVariation(model, data, index, reference)
    acceleration = pin.getFrameClassicalAcceleration if representation is MIXED else pin.getFrameAcceleration
    found = {
        "forward_kinematics": (kindyn.forward_kinematics(frame, *state.pose), data.oMf[index].homogeneous),
        "jacobian": (kindyn.jacobian(frame, *state.pose), J @ X),
        "jacobian_dot": (kindyn.jacobian_dot(frame, *state.motion), J_dot @ X + J @ rate),
        "jacobian_dot_nu": (
            kindyn.jacobian_dot_nu(frame, *state.motion),
            acceleration(model, data, index, reference).vector,
        ),
    }
    if representation is BODY:
        found["relative_jacobian"] = (kindyn.relative_jacobian(frame, state.s), (J @ X)[:, 6:])
    return found


def whole_body(kindyn: KinDynComputations, peer: Peer, state: State) -> dict[str, tuple]:
    model, data, representation = peer.model, peer.data, kindyn.representation
    X, q = peer.into(state, representation), peer.q(state)
    rate, bias = drift(state, X, representation)
    v, a = X @ state.nu, X @ state.nu_dot + bias
    R = state.H[:3, :3]
    axes = np.kron(np.eye(2), R.T) if representation is BODY else np.eye(6)  # of the momenta
    turning = np.kron(np.eye(2), skew(state.v[3:])) if representation is BODY else np.zeros((6, 6))

    h_dot = pin.computeCentroidalMomentumTimeVariation(model, data, q, v, bias).vector
    h = data.hg.vector.copy()
    pin.computeAllTerms(model, data, q, v)
    M = np.triu(data.M) + np.triu(data.M, 1).T
    C = pin.computeCoriolisMatrix(model, data, q, v)
    pin.centerOfMass(model, data, q, v)
    force = X.T @ pin.rnea(model, data, q, v, a)
    still, gravity = pin.rnea(model, data, q, v, bias), pin.computeGeneralizedGravity(model, data, q)
    return forward_dynamics(kindyn, peer, state) | {
        "CoM_position": (kindyn.CoM_position(*state.pose), data.com[0]),
        "CoM_velocity": (kindyn.CoM_velocity(*state.motion), data.vcom[0]),
        "CoM_jacobian": (kindyn.CoM_jacobian(*state.pose), pin.jacobianCenterOfMass(model, data, q) @ X),
        "centroidal_momentum": (kindyn.centroidal_momentum(*state.motion), axes @ h),
        "centroidal_momentum_matrix": (
            kindyn.centroidal_momentum_matrix(*state.pose),
            axes @ pin.ccrba(model, data, q, v) @ X,
        ),
        "centroidal_momentum_bias": (
            kindyn.centroidal_momentum_bias(*state.motion),
            axes @ h_dot - turning @ axes @ h,
        ),
        "mass_matrix": (kindyn.mass_matrix(*state.pose), X.T @ M @ X),
        "bias_force": (kindyn.bias_force(*state.motion), X.T @ still),
        "gravity_term": (kindyn.gravity_term(*state.pose), X.T @ gravity),
        "coriolis_term": (kindyn.coriolis_term(*state.motion), X.T @ (still - gravity)),
        "coriolis_matrix": (
            np.array(kindyn.coriolis_matrix(*state.motion)) @ state.nu,
            X.T @ (C @ X + M @ rate) @ state.nu,
        ),
        "rnea": (kindyn.rnea(*state.motion, state.v_dot, state.s_ddot), force),
        "kinetic_energy": (kindyn.kinetic_energy(*state.motion), pin.computeKineticEnergy(model, data, q, v)),
        "potential_energy": (kindyn.potential_energy(*state.pose), pin.computePotentialEnergy(model, data, q)),
    }


def forward_dynamics(kindyn: KinDynComputations, peer: Peer, state: State) -> dict[str, tuple]:
    """Return ours and Pinocchio's; with mimic joints, Xᵀ M X ν̇ = f − Xᵀ (h + M Ẋ ν), and nothing without masses."""
    model, data, X, q = peer.model, peer.data, peer.into(state, kindyn.representation), peer.q(state)
    _, bias = drift(state, X, kindyn.representation)
    push = 10 * state.nu_dot  # any forces will do
    if peer.tree.followers:
        M = np.triu(pin.crba(model, data, q))
        M = X.T @ (M + np.triu(M, 1).T) @ X
        if np.linalg.eigvalsh(M)[0] <= 0:
            return {}
        pushed = np.linalg.solve(M, push - X.T @ pin.rnea(model, data, q, X @ state.nu, bias))
    else:
        back = np.linalg.inv(X)
        pushed = back @ (pin.aba(model, data, q, X @ state.nu, back.T @ push) - bias)
    return {"aba": (kindyn.aba(*state.motion, push[6:], {kindyn.tree.base: push[:6]}), pushed)}


def largest_errors(
    kindyn: KinDynComputations, peer: Peer, states: list[State], least: float = 1e-3
) -> dict[str, float]:
    """Return the largest error of each quantity, as a share of its largest entry or of `least`."""
    frames = kindyn.frame_names[:: max(1, (len(kindyn.frame_names) - 1) // (FRAMES - 1))]
    errors: dict[str, float] = {}
    for state in states:
        found = [whole_body(kindyn, peer, state), *(frame_errors(kindyn, peer, state, frame) for frame in frames)]
        for name, (ours, theirs) in ((name, pair) for part in found for name, pair in part.items()):
            theirs = np.asarray(theirs, dtype=float)
            if theirs.size:
                scale = max(float(np.abs(theirs).max()), least)
                difference = np.abs(np.array(ours).reshape(theirs.shape) - theirs).max() / scale
                errors[name] = max(errors.get(name, 0.0), float(difference))
    return errors


@pytest.mark.parametrize("representation", REFERENCES, ids=NAMES.get)
def test_every_quantity_of_the_ironcub_is_pinocchios(representation: Representations) -> None:
    kindyn = KinDynComputations(IRONCUB / "ironcub.urdf", ironcub_joints(), representation=representation)
    peer = Peer(IRONCUB / "ironcub.urdf", kindyn.tree)
    errors = largest_errors(kindyn, peer, random_states(kindyn.NDoF, 50, seed=1))
    assert len(errors) >= 19
    assert {name: error for name, error in errors.items() if not error < TOLERANCE} == {}


@pytest.mark.parametrize("representation", REFERENCES, ids=NAMES.get)
@pytest.mark.parametrize("robot", ROBOTS, ids=lambda robot: robot.urdf.stem)
def test_every_quantity_of_every_robot_is_pinocchios(robot: Example, representation: Representations) -> None:
    kindyn = robot.kindyn(representation)
    peer = Peer(robot.urdf, kindyn.tree)
    errors = largest_errors(kindyn, peer, random_states(kindyn.NDoF, 20, seed=2))
    assert {name: error for name, error in errors.items() if not error < TOLERANCE} == {}


def test_external_wrenches_act_as_their_jacobians_say() -> None:
    for representation in REFERENCES:
        kindyn = Example("tiago_description/robots/tiago_no_hand.urdf").kindyn(representation)
        frames = kindyn.frame_names[3], kindyn.frame_names[-1]
        for state in random_states(kindyn.NDoF, 3, seed=3):
            wrenches = {frame: np.random.default_rng(4).normal(size=6) for frame in frames}
            motion = (*state.motion, state.v_dot, state.s_ddot)
            expected = np.array(kindyn.rnea(*motion)) - sum(
                np.array(kindyn.jacobian(frame, *state.pose)).T @ wrench[:, None] for frame, wrench in wrenches.items()
            )
            np.testing.assert_allclose(kindyn.rnea(*motion, wrenches), expected, rtol=1e-9, atol=1e-9)


def test_the_robots_are_as_many_and_as_different_as_promised() -> None:
    assert len(ROBOTS) >= 15
    prismatic = [robot for robot in ROBOTS if any(body.prismatic for body in robot.kindyn().tree.bodies)]
    assert len(prismatic) >= 2

"""Rigid-body dynamics by two programs that share no code: MuJoCo's inverse dynamics against this library's RNEA."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from multimodal_to.adam import quaternion
from multimodal_to.adam.spatial import Array
from multimodal_to.arguments import checked
from multimodal_to.errors import InputError
from multimodal_to.models.robot import Robot
from multimodal_to.simulation.model import SimulationModel, build_model, mujoco_module
from multimodal_to.trajectory import Trajectory


@dataclass(frozen=True, kw_only=True, eq=False)
class States:
    """States with accelerations, one a column: what inverse dynamics takes. Base velocities are in world axes."""

    positions: Array  # p of the base [m], (3, count)
    quaternions_xyzw: Array  # (4, count)
    joints: Array  # s [rad or m], (n, count)
    velocities: Array  # ν = (ṗ, ω, ṡ), (6 + n, count)
    accelerations: Array  # ν̇, (6 + n, count)


@checked
def random_states(robot: Robot, count: int, seed: int = 0) -> States:
    """Return states all over the robot's range of joints, turned any way, with velocities and accelerations of 1.

    Args:
        robot: whose range of joints.
        count: how many.
        seed: of the random numbers; the same seed gives the same states.

    Raises:
        InputError: there is to be no state, or the seed is negative.
    """
    if count < 1 or seed < 0:
        raise InputError(f"{count} states of seed {seed}; expected at least one state and no negative seed")
    rng = np.random.default_rng(seed)
    limits, size = robot.joint_limits, 6 + len(robot.joint_names)
    turns = rng.normal(size=(4, count))
    return States(
        positions=rng.normal(size=(3, count)),
        quaternions_xyzw=turns / np.linalg.norm(turns, axis=0),
        joints=rng.uniform(limits.lower[:, None], limits.upper[:, None], (size - 6, count)),
        velocities=rng.normal(size=(size, count)),
        accelerations=rng.normal(size=(size, count)),
    )


@checked
def states_along(trajectory: Trajectory) -> States:
    """Return the states of a trajectory's knots but the first, with backward differences as accelerations."""
    velocities = np.vstack(
        [trajectory.base_linear_velocity, trajectory.base_angular_velocity, trajectory.joint_velocities]
    )
    return States(
        positions=trajectory.base_position[:, 1:],
        quaternions_xyzw=trajectory.base_quaternion_xyzw[:, 1:],
        joints=trajectory.joint_positions[:, 1:],
        velocities=velocities[:, 1:],
        accelerations=np.diff(velocities, axis=1) / np.diff(trajectory.time),
    )


@checked
def by_mujoco(simulation: SimulationModel, states: States) -> Array:
    """Return M ν̇ + C ν + g of each state, (6 + n, count): the wrench on the base in world axes, then the joints."""
    mujoco = mujoco_module()
    data = mujoco.MjData(simulation.model)
    forces = np.zeros_like(states.velocities)
    for column in range(forces.shape[1]):
        velocity, acceleration = states.velocities[:, column], states.accelerations[:, column]
        simulation.set_state(
            data,
            states.positions[:, column],
            states.quaternions_xyzw[:, column],
            states.joints[:, column],
            velocity[:6],
            velocity[6:],
        )
        mujoco.mj_kinematics(simulation.model, data)
        turn = data.xmat[1].reshape(3, 3)  # of the base, which is the first body after the world
        data.qacc[:3], data.qacc[3:6] = acceleration[:3], turn.T @ acceleration[3:6]
        data.qacc[6:] = (simulation.coupling @ acceleration[6:])[6:]
        mujoco.mj_inverse(simulation.model, data)
        force = data.qfrc_inverse
        forces[:, column] = np.concatenate([force[:3], turn @ force[3:6], simulation.coupling.T @ force])
    return forces


@checked
def by_rnea(robot: Robot, states: States) -> Array:
    """Return the same as `by_mujoco` by this library."""
    rho = states.quaternions_xyzw / np.linalg.norm(states.quaternions_xyzw, axis=0)
    poses = []
    for position, turn in zip(states.positions.T, rho.T, strict=True):
        pose = np.eye(4)
        pose[:3, :3], pose[:3, 3] = np.array(quaternion.rotation_matrix(turn)), position
        poses.append(pose)
    velocity, acceleration = states.velocities, states.accelerations
    function = robot.kindyn.rnea_fun().map(rho.shape[1])
    return np.array(
        function(np.hstack(poses), states.joints, velocity[:6], velocity[6:], acceleration[:6], acceleration[6:])
    )


@checked
def disagreement(robot: Robot, states: States) -> float:
    """Return the largest difference between the two, as a share of the largest force of its state."""
    ours, theirs = by_rnea(robot, states), by_mujoco(build_model(robot), states)
    return float((np.abs(theirs - ours).max(axis=0) / np.abs(ours).max(axis=0)).max())

"""What follows from a trajectory and its robot: poses of frames, carried weight, phases of flight, other times."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass, replace
from typing import Any

import casadi as cs
import numpy as np

from multimodal_to.adam import quaternion
from multimodal_to.adam.spatial import Array, homogeneous
from multimodal_to.models.robot import Robot
from multimodal_to.models.terrain import Surface, frame_function
from multimodal_to.trajectory import rules
from multimodal_to.trajectory.quantities import QUANTITIES
from multimodal_to.trajectory.resampling import resample
from multimodal_to.trajectory.trajectory import Trajectory

FLIGHT_FORCE = 1.0
"""Below this total vertical contact force the robot counts as flying [N]."""
LOADED = 5.0
"""A contact point carries load above this normal force [N]."""
STEP_LIFT = 0.01
"""A foot has stepped when all of it was at least this far off the ground [m] ..."""
STEP_LENGTH = 0.05
"""... and it came down at least this far from where it stood [m]."""


@dataclass(frozen=True, kw_only=True)
class Footstep:
    """A foot that stood, was lifted and stands elsewhere."""

    foot: str
    lift_off: float  # the last time with load [s]
    touch_down: float  # the first time with load again [s]
    length: float  # along the ground, of the middle of the contact points [m]
    lift: float  # greatest height of the lowest contact point [m]


def base_poses(trajectory: Trajectory) -> Array:
    """Return w_H_base at every knot, (knots + 1, 4, 4); quaternions are normalised first."""
    position, rho = cs.MX.sym("p", 3), cs.MX.sym("rho", 4)
    pose = homogeneous(quaternion.rotation_matrix(rho / cs.norm_2(rho)), position)
    function = cs.Function("base_pose", [position, rho], [pose]).map(trajectory.time.size)
    return _stacked(function(trajectory.base_position, trajectory.base_quaternion_xyzw))


def frame_poses(robot: Robot, trajectory: Trajectory, frame: str) -> Array:
    """Return w_H_frame, the world pose of a link or frame at every knot, (knots + 1, 4, 4).

    Args:
        robot: the robot of the trajectory.
        trajectory: its base and joints are used.
        frame: the name of a link or frame of the URDF.
    """
    function = robot.kindyn.forward_kinematics_fun(frame).map(trajectory.time.size)
    side_by_side = np.hstack(list(base_poses(trajectory)))
    return _stacked(function(side_by_side, trajectory.joint_positions))


def _stacked(side_by_side: cs.DM) -> Array:
    """Return matrices of four rows that stand side by side as (count, 4, 4)."""
    return np.array(side_by_side).reshape(4, -1, 4).transpose(1, 0, 2)


def contact_points(robot: Robot, trajectory: Trajectory) -> Array:
    """Return the contact points by forward kinematics [m], (contacts, knots + 1, 3)."""
    return np.array([frame_poses(robot, trajectory, name)[:, :3, 3] for name in trajectory.contact_names])


def surface_frames(surface: Surface, points: Array) -> tuple[Array, Array, Array]:
    """Return d (...), n (..., 3) and t (..., 3, 2) of a surface at points (..., 3)."""
    shape, count = points.shape[:-1], math.prod(points.shape[:-1])
    d, n, t = (np.array(part) for part in frame_function(surface).map(count)(points.reshape(count, 3).T))
    return d.reshape(shape), n.T.reshape(*shape, 3), t.reshape(3, count, 2).transpose(1, 0, 2).reshape(*shape, 3, 2)


def contact_products(robot: Robot, trajectory: Trajectory, surface: Surface) -> tuple[Array, Array]:
    """Return what complementarity bounds [N m], (contacts, knots + 1) each: height and slip, times the normal force.

    The slip is that over the interval that ends at the knot, ‖tᵀ Δp‖.

    Args:
        robot: the robot of the trajectory; its contact points come from forward kinematics.
        trajectory: the motion.
        surface: the ground.
    """
    points = contact_points(robot, trajectory)
    heights, normals, tangents = surface_frames(surface, points)
    normal = np.einsum("ckx,cxk->ck", normals, trajectory.per_contact("contact_forces"))
    moves = np.diff(points, axis=1, prepend=points[:, :1])
    return heights * normal, np.linalg.norm(np.einsum("ckxt,ckx->ckt", tangents, moves), axis=2) * normal


def thrust_forces(robot: Robot, trajectory: Trajectory) -> tuple[Array, Array]:
    """Return where each jet pushes [m] and with what force [N], (jets, knots + 1, 3) each, world axes."""
    poses = [frame_poses(robot, trajectory, jet.frame) for jet in robot.jets]
    points = np.array([pose[:, :3, 3] for pose in poses]).reshape(-1, trajectory.time.size, 3)
    axes = np.array([pose[:, :3, 2] for pose in poses]).reshape(points.shape)
    return points, -trajectory.thrust[:, :, None] * axes


def vertical_thrust(robot: Robot, trajectory: Trajectory) -> Array:
    """Return the world-vertical sum of the thrusts [N], (knots + 1,)."""
    return np.asarray(thrust_forces(robot, trajectory)[1][:, :, 2].sum(axis=0))


def flying(trajectory: Trajectory) -> np.ndarray:
    """Return at which knots the total vertical contact force is below `FLIGHT_FORCE`, (knots + 1,)."""
    return trajectory.vertical_contact_force() < FLIGHT_FORCE


def footsteps(robot: Robot, trajectory: Trajectory, surface: Surface) -> list[Footstep]:
    """Return the steps in the order in which they start.

    A foot stands while one of its contact points carries more than `LOADED`. What is in between is a step if the foot's
    lowest point was at least `STEP_LIFT` high and its middle came down at least `STEP_LENGTH` away.

    Args:
        robot: says which contact points make a foot.
        trajectory: the motion.
        surface: the ground, from which lifts are measured.
    """
    points = contact_points(robot, trajectory)
    heights, normals, _ = surface_frames(surface, points)
    loaded = np.einsum("ckx,cxk->ck", normals, trajectory.per_contact("contact_forces")) > LOADED
    steps = []
    for foot in dict.fromkeys(contact.foot for contact in robot.contacts):
        members = [index for index, contact in enumerate(robot.contacts) if contact.foot == foot]
        lowest, middle = heights[members].min(axis=0), points[members].mean(axis=0)[:, :2]
        stands = np.flatnonzero(loaded[members].any(axis=0))
        for before, after in itertools.pairwise(stands):
            length = float(np.linalg.norm(middle[after] - middle[before]))
            lift = float(lowest[before : after + 1].max())
            if length >= STEP_LENGTH and lift >= STEP_LIFT:
                start, end = float(trajectory.time[before]), float(trajectory.time[after])
                steps.append(Footstep(foot=foot, lift_off=start, touch_down=end, length=length, lift=lift))
    return sorted(steps, key=lambda step: step.lift_off)


def flight_phases(trajectory: Trajectory) -> list[tuple[float, float]]:
    """Return start and end [s] of each run of knots in flight."""
    edges = np.concatenate(([False], flying(trajectory), [False]))
    starts, ends = np.flatnonzero(~edges[:-1] & edges[1:]), np.flatnonzero(edges[:-1] & ~edges[1:]) - 1
    return [(float(trajectory.time[i]), float(trajectory.time[j])) for i, j in zip(starts, ends, strict=True)]


def at_knots(trajectory: Trajectory, name: str) -> Array:
    """Return a quantity at the instants of the knots, (rows, knots + 1).

    Under a staggered rule two intervals meet at a knot, and it is the mean of theirs; an acceleration is that between
    them. After the last knot there is no interval: there it is that of the last one, and an acceleration is zero.
    """
    values: Array = getattr(trajectory, name)
    before = rules.instant(trajectory.rule, name)
    if not before:
        return values
    if before < 1.0:
        return 0.5 * (values + np.hstack([values[:, 1:], values[:, -1:]]))
    return np.hstack([values[:, 1:], np.zeros_like(values[:, -1:])])


def sampled(trajectory: Trajectory) -> Trajectory:
    """Return the trajectory with every quantity at the instant of its knot, as `at_knots` has it."""
    if rules.all_at_knots(trajectory.rule):
        return trajectory
    arrays: dict[str, Any] = {name: at_knots(trajectory, name) for name in QUANTITIES}
    return replace(trajectory, rule=rules.SAMPLED, **arrays)


def accelerations_at_knots(trajectory: Trajectory, name: str) -> Array:
    """Return the rate of a velocity or a momentum at the instants of the knots, (rows, knots + 1).

    Differences of columns, divided by Δt: backward ones where all is at the knots, with zero at the first; forward ones
    where velocities are in the middles of intervals, with zero at the last.
    """
    values: Array = getattr(trajectory, name)
    rates = np.diff(values, axis=1) / np.diff(trajectory.time)
    nothing = np.zeros_like(values[:, :1])
    return np.hstack([rates, nothing] if rules.instant(trajectory.rule, name) else [nothing, rates])


def at_velocities(trajectory: Trajectory) -> Trajectory:
    """Return the trajectory with the configurations at the instants of its velocities."""
    if not rules.instant(trajectory.rule, "joint_velocities"):
        return trajectory
    times = trajectory.time - 0.5 * np.diff(trajectory.time, prepend=trajectory.time[0])
    middle = resample(replace(trajectory, rule=rules.SAMPLED), times)
    names = ("com_position", "base_position", "base_quaternion_xyzw", "joint_positions")
    return replace(trajectory, **{name: getattr(middle, name) for name in names})


def generalised_forces(robot: Robot, trajectory: Trajectory) -> Array:
    """Return what the motion asks of base and joints under all contact forces and thrusts, (6 + n, knots + 1).

    τ = M ν̇ + C ν + g − Σ Jᵀ f by RNEA: the wrench left for the base [N, N m], which is zero on a true motion, then the
    joint torques [N m]. All is at the instants of the knots: `at_knots`, `accelerations_at_knots`.
    """
    count = trajectory.time.size
    names = ("base_linear_velocity", "base_angular_velocity", "joint_velocities")
    velocities = np.vstack([at_knots(trajectory, name) for name in names])
    accelerations = np.vstack([accelerations_at_knots(trajectory, name) for name in names])
    frames = (*trajectory.contact_names, *(jet.frame for jet in robot.jets))
    thrusts = thrust_forces(robot, trajectory)[1].transpose(0, 2, 1)
    contacts = at_knots(trajectory, "contact_forces").reshape(len(trajectory.contact_names), 3, count)
    return np.array(
        robot.kindyn.rnea_fun(frames).map(count)(
            np.hstack(list(base_poses(trajectory))),
            trajectory.joint_positions,
            velocities[:6],
            velocities[6:],
            accelerations[:6],
            accelerations[6:],
            *(np.vstack([force, np.zeros((3, count))]) for force in (*contacts, *thrusts)),
        )
    )

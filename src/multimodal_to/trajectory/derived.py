"""What follows from a trajectory and its robot: poses of frames, carried weight, phases of flight, other times."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import casadi as cs
import numpy as np

from multimodal_to.adam import quaternion
from multimodal_to.adam.spatial import Array, homogeneous
from multimodal_to.arguments import checked
from multimodal_to.errors import InputError, unknown
from multimodal_to.models.robot import Robot
from multimodal_to.models.terrain import Surface, frame_function
from multimodal_to.trajectory import rules
from multimodal_to.trajectory.conditions import under_conditions
from multimodal_to.trajectory.pushes import known_pushes, push_forces
from multimodal_to.trajectory.quantities import QUANTITIES, SCALAR, Quantity, row_units
from multimodal_to.trajectory.resampling import resample
from multimodal_to.trajectory.trajectory import Trajectory

FLIGHT_SHARE = 0.0025
"""Below this total vertical contact force the robot counts as flying, as a share of its weight [1]."""
LOADED_SHARE = 0.09
"""A contact point carries load above this normal force, as a share of the weight over the contact points [1]."""
LIFT_SHARE = 0.0175
"""A foot has stepped when all of it was at least this far off the ground, as a share of the standing height [1] ..."""
LENGTH_SHARE = 0.087
"""... and it came down at least this far from where it stood, as a share of the standing height [1]."""

JOINT_TORQUES = Quantity(
    axes=SCALAR, of="joint", unit="N m", meaning="τ, torques of the joints' motors, by inverse dynamics"
)
"""What `joint_torques` returns. A trajectory does not keep it; it follows from the motion and the robot."""


@dataclass(frozen=True, kw_only=True)
class Footstep:
    """A foot that stood, was lifted and stands elsewhere."""

    foot: str
    lift_off: float  # the last time with load [s]
    touch_down: float  # the first time with load again [s]
    length: float  # along the ground, of the middle of the contact points [m]
    lift: float  # greatest height of the lowest contact point [m]


@checked
def flight_force(robot: Robot) -> float:
    """Return below which total vertical contact force the robot counts as flying [N]: `FLIGHT_SHARE` of its weight."""
    return FLIGHT_SHARE * robot.weight


@checked
def loaded_force(robot: Robot) -> float:
    """Return above which normal force a contact point carries load [N]: `LOADED_SHARE` of its share of the weight."""
    return LOADED_SHARE * robot.weight / max(len(robot.contacts), 1)


@checked
def step_lift(robot: Robot) -> float:
    """Return how far off the ground a foot has to be to have stepped [m]: `LIFT_SHARE` of the standing height."""
    return LIFT_SHARE * robot.standing_height


@checked
def step_length(robot: Robot) -> float:
    """Return how far from where it stood a foot has to come down to have stepped [m]: `LENGTH_SHARE` of the height."""
    return LENGTH_SHARE * robot.standing_height


@dataclass(frozen=True, kw_only=True)
class LargestTorque:
    """The largest torque that a motion asks of a joint's motor, either way."""

    joint: str
    torque: float  # [`unit`]
    when: float  # [s]
    effort: float  # the joint's limit in the same unit; inf where none is known
    unit: str  # "N m", or "N" of a prismatic joint

    @property
    def over_effort(self) -> float:
        """Return the share of the effort limit; zero where there is none."""
        return self.torque / self.effort


@checked
def base_poses(trajectory: Trajectory) -> Array:
    """Return w_H_base at every knot, (knots + 1, 4, 4); quaternions are normalised first."""
    position, rho = cs.MX.sym("p", 3), cs.MX.sym("rho", 4)
    pose = homogeneous(quaternion.rotation_matrix(rho / cs.norm_2(rho)), position)
    function = cs.Function("base_pose", [position, rho], [pose]).map(trajectory.time.size)
    return _stacked(function(trajectory.base_position, trajectory.base_quaternion_xyzw))


@checked
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


@checked
def contact_points(robot: Robot, trajectory: Trajectory) -> Array:
    """Return the contact points by forward kinematics [m], (contacts, knots + 1, 3)."""
    points = [frame_poses(robot, trajectory, name)[:, :3, 3] for name in trajectory.contact_names]
    return np.array(points).reshape(-1, trajectory.time.size, 3)


@checked
def surface_frames(surface: Surface, points: Array) -> tuple[Array, Array, Array]:
    """Return d (...), n (..., 3) and t (..., 3, 2) of a surface at points (..., 3)."""
    shape, count = points.shape[:-1], math.prod(points.shape[:-1])
    if not count:  # which CasADi does not map over
        return np.zeros(shape), np.zeros((*shape, 3)), np.zeros((*shape, 3, 2))
    d, n, t = (np.array(part) for part in frame_function(surface).map(count)(points.reshape(count, 3).T))
    return d.reshape(shape), n.T.reshape(*shape, 3), t.reshape(3, count, 2).transpose(1, 0, 2).reshape(*shape, 3, 2)


@checked
def acting_times(trajectory: Trajectory) -> tuple[Array, Array]:
    """Return from when to when the contact forces and throttles of each column act [s], (knots + 1,) each.

    Under leapfrog from half an interval before the knot to half an interval after it, else over the interval that ends
    there. Nothing acts before the first knot and after the last.
    """
    time, after = trajectory.time, rules.acts_after(trajectory.rule)
    before = np.diff(time, prepend=time[0])
    return time - (1.0 - after) * before, time + after * np.append(before[1:], 0.0)


@checked
def greatest_while_acting(values: Array, rule: str, *, of_intervals: bool = False) -> Array:
    """Return the greatest value of the knots, or of the intervals, that the contact force of each column reaches.

    A force of an interval has both of its ends. A force of leapfrog has the knots k − 1, k and k + 1 and the intervals
    between them, since a point that carries it has to stand when it begins and until it ends. A force of backward Euler
    has its knot and the interval that ends there.

    Args:
        values: of the knots, or of the intervals that end there, (..., knots + 1).
        rule: name of the integration rule.
        of_intervals: the values are those of intervals.
    """
    found, after = values, rules.acts_after(rule) > 0.0
    if not of_intervals and (after or rules.held(rule, "contact_forces")):
        found = np.maximum(found, np.concatenate([values[..., :1], values[..., :-1]], axis=-1))
    if after:
        found = np.maximum(found, np.concatenate([values[..., 1:], values[..., -1:]], axis=-1))
    return np.asarray(found)


@checked
def contact_products(robot: Robot, trajectory: Trajectory, surface: Surface) -> tuple[Array, Array]:
    """Return what complementarity bounds [N m], (contacts, knots + 1) each: height and slip, times the normal force.

    The slip is ‖tᵀ Δp‖ over an interval. Height and slip are the greatest ones of the knots and intervals that the
    force reaches: `greatest_while_acting`.

    Args:
        robot: the robot of the trajectory; its contact points come from forward kinematics.
        trajectory: the motion.
        surface: the ground.
    """
    points = contact_points(robot, trajectory)
    heights, normals, tangents = surface_frames(surface, points)
    normal = np.einsum("ckx,cxk->ck", normals, trajectory.per_contact("contact_forces"))
    moves = np.diff(points, axis=1, prepend=points[:, :1])
    slips = np.linalg.norm(np.einsum("ckxt,ckx->ckt", tangents, moves), axis=2)
    heights = greatest_while_acting(heights, trajectory.rule)
    return heights * normal, greatest_while_acting(slips, trajectory.rule, of_intervals=True) * normal


@checked
def thrust_forces(robot: Robot, trajectory: Trajectory) -> tuple[Array, Array]:
    """Return where each jet pushes [m] and with what force [N], (jets, knots + 1, 3) each, world axes."""
    jets = robot.with_jets(trajectory.jet_names).jets
    poses = [frame_poses(robot, trajectory, jet.frame) for jet in jets]
    points = np.array([pose[:, :3, 3] for pose in poses]).reshape(-1, trajectory.time.size, 3)
    axes = np.array([pose[:, :3, 2] for pose in poses]).reshape(points.shape)
    return points, -trajectory.thrust[:, :, None] * axes


@checked
def vertical_thrust(robot: Robot, trajectory: Trajectory) -> Array:
    """Return the world-vertical sum of the thrusts [N], (knots + 1,)."""
    return np.asarray(thrust_forces(robot, trajectory)[1][:, :, 2].sum(axis=0))


@checked
def flying(robot: Robot, trajectory: Trajectory) -> np.ndarray:
    """Return in which columns the total vertical contact force is below `flight_force`, (knots + 1,).

    A column is of a knot, or of the interval that ends there, as the trajectory's rule has it.

    Args:
        robot: whose weight is the measure.
        trajectory: the motion.
    """
    return trajectory.vertical_contact_force() < flight_force(robot)


@checked
def footsteps(robot: Robot, trajectory: Trajectory, surface: Surface) -> list[Footstep]:
    """Return the steps in the order in which they start.

    A foot stands while one of its contact points carries more than `loaded_force`. What is in between is a step if the
    foot's lowest point was at least `step_lift` high and its middle came down at least `step_length` away. It lifts off
    when its last force ends and touches down when the next one begins; under backward Euler, at the knots of these.

    Args:
        robot: says which contact points make a foot.
        trajectory: the motion.
        surface: the ground, from which lifts are measured.
    """
    points = contact_points(robot, trajectory)
    heights, normals, _ = surface_frames(surface, points)
    normal = np.einsum("ckx,cxk->ck", normals, trajectory.per_contact("contact_forces"))
    loaded = normal > loaded_force(robot)
    steps, least_length, least_lift = [], step_length(robot), step_lift(robot)
    begins, ends = _bounds_of_columns(trajectory)
    for foot, own in robot.feet.items():
        members = list(own)
        lowest, middle = heights[members].min(axis=0), points[members].mean(axis=0)[:, :2]
        stands = np.flatnonzero(loaded[members].any(axis=0))
        for before, after in itertools.pairwise(stands):
            length = float(np.linalg.norm(middle[after] - middle[before]))
            lift = float(lowest[before : after + 1].max())
            if length >= least_length and lift >= least_lift:
                up, down = float(ends[before]), float(begins[after])
                steps.append(Footstep(foot=foot, lift_off=up, touch_down=down, length=length, lift=lift))
    return sorted(steps, key=lambda step: step.lift_off)


@checked
def flight_phases(robot: Robot, trajectory: Trajectory) -> list[tuple[float, float]]:
    """Return start and end [s] of each run of columns in flight.

    It is the time over which their contact forces would act, `acting_times`; under backward Euler it is that from knot
    to knot.

    Args:
        robot: whose weight is the measure, `flight_force`.
        trajectory: the motion.
    """
    phases = spans(flying(robot, trajectory), *_bounds_of_columns(trajectory))
    if rules.held(trajectory.rule, "contact_forces"):
        return [(start, end) for start, end in phases if end > start]  # no interval ends at the first knot
    return phases


def _bounds_of_columns(trajectory: Trajectory) -> tuple[Array, Array]:
    """Return `acting_times`, but the knots themselves where every quantity is at its knot."""
    if rules.all_at_knots(trajectory.rule):
        return trajectory.time, trajectory.time
    return acting_times(trajectory)


@checked
def spans(chosen: np.ndarray, begins: Array, ends: Array) -> list[tuple[float, float]]:
    """Return start and end [s] of each run of chosen columns.

    Args:
        chosen: which columns are, (knots + 1,).
        begins: when each column begins [s], (knots + 1,).
        ends: when each column ends [s], (knots + 1,).
    """
    edges = np.concatenate(([False], chosen, [False]))
    first, last = np.flatnonzero(~edges[:-1] & edges[1:]), np.flatnonzero(edges[:-1] & ~edges[1:]) - 1
    return [(float(begins[i]), float(ends[j])) for i, j in zip(first, last, strict=True)]


@checked
def at_knots(trajectory: Trajectory, name: str) -> Array:
    """Return a quantity at the instants of the knots, (rows, knots + 1).

    Where a quantity is in the middles of intervals, two of these meet at a knot, and it is the mean of theirs; an
    acceleration is that between them. After the last knot there is no interval: there it is that of the last one, and
    an acceleration is zero.

    Raises:
        InputError: there is no such quantity.
    """
    if name not in QUANTITIES:
        raise InputError(unknown("quantity", name, QUANTITIES))
    values: Array = getattr(trajectory, name)
    before = rules.instant(trajectory.rule, name)
    if not before:
        return values
    if before < 1.0:
        return 0.5 * (values + np.hstack([values[:, 1:], values[:, -1:]]))
    return np.hstack([values[:, 1:], np.zeros_like(values[:, -1:])])


@checked
def sampled(trajectory: Trajectory) -> Trajectory:
    """Return the trajectory with every quantity at the instant of its knot, as `at_knots` has it."""
    if rules.all_at_knots(trajectory.rule):
        return trajectory
    arrays: dict[str, Any] = {name: at_knots(trajectory, name) for name in QUANTITIES}
    return replace(trajectory, rule=rules.SAMPLED, **arrays)


@checked
def accelerations_at_knots(trajectory: Trajectory, name: str) -> Array:
    """Return the rate of a velocity or a momentum at the instants of the knots, (rows, knots + 1).

    Differences of columns, divided by Δt: backward ones where all is at the knots, with zero at the first; forward ones
    where velocities are in the middles of intervals, with zero at the last.
    """
    values: Array = getattr(trajectory, name)
    rates = np.diff(values, axis=1) / np.diff(trajectory.time)
    nothing = np.zeros_like(values[:, :1])
    return np.hstack([rates, nothing] if rules.instant(trajectory.rule, name) else [nothing, rates])


@checked
def at_velocities(trajectory: Trajectory) -> Trajectory:
    """Return the trajectory with the configurations at the instants of its velocities."""
    if not rules.instant(trajectory.rule, "joint_velocities"):
        return trajectory
    times = trajectory.time - 0.5 * np.diff(trajectory.time, prepend=trajectory.time[0])
    middle = resample(replace(trajectory, rule=rules.SAMPLED), times)
    names = ("com_position", "base_position", "base_quaternion_xyzw", "joint_positions")
    return replace(trajectory, **{name: getattr(middle, name) for name in names})


@checked
def outside_forces(trajectory: Trajectory) -> list[tuple[str, Array]]:
    """Return the known pushes of the task that a trajectory keeps: the frame and its force [N], (3, knots + 1)."""
    known = known_pushes(trajectory)
    return [(push.of, force.T) for push, force in zip(known, push_forces(known, trajectory), strict=True)]


@checked
def generalised_forces(
    robot: Robot, trajectory: Trajectory, pushed: Sequence[tuple[str, Array]] | None = None
) -> Array:
    """Return what the motion asks of base and joints under all forces that act on it, (6 + n, knots + 1).

    τ = M ν̇ + C ν + g − Σ Jᵀ f by RNEA: the wrench left for the base [N, N m], which is zero on a true motion, then the
    joint torques [N m]. All is at the instants of the knots: `at_knots`, `accelerations_at_knots`.

    Where velocities are in the middles of intervals, the velocity jumps at a knot, from ν⁻ to ν⁺. Each holds for half
    of the time from middle to middle. So the velocity products there are the mean of those of both, not those of the
    mean velocity ν̄. C ν is a quadratic form c(ν), so this is ½ (c(ν⁻) + c(ν⁺)) = c(ν̄) + c(½ (ν⁺ − ν⁻)). It is what
    the momentum's rows say. With c(ν̄) alone the wrench left for the base is several times larger.

    Args:
        robot: the robot of the trajectory.
        trajectory: the motion.
        pushed: forces from outside beside contacts and jets: the frame and the force in world axes [N],
            (3, knots + 1); by default the known pushes of the task that the trajectory keeps.
    """
    pushed = outside_forces(trajectory) if pushed is None else pushed
    robot = under_conditions(robot.with_jets(trajectory.jet_names), trajectory)
    count = trajectory.time.size
    names = ("base_linear_velocity", "base_angular_velocity", "joint_velocities")
    velocities = np.vstack([at_knots(trajectory, name) for name in names])
    accelerations = np.vstack([accelerations_at_knots(trajectory, name) for name in names])
    frames = (*trajectory.contact_names, *(jet.frame for jet in robot.jets), *(frame for frame, _ in pushed))
    thrusts = thrust_forces(robot, trajectory)[1].transpose(0, 2, 1)
    contacts = at_knots(trajectory, "contact_forces").reshape(len(trajectory.contact_names), 3, count)
    asked = np.array(
        robot.kindyn.rnea_fun(frames).map(count)(
            np.hstack(list(base_poses(trajectory))),
            trajectory.joint_positions,
            velocities[:6],
            velocities[6:],
            accelerations[:6],
            accelerations[6:],
            *(np.vstack([force, np.zeros((3, count))]) for force in contacts),
            *(np.vstack([force, jet.drag * force]) for jet, force in zip(robot.jets, thrusts, strict=True)),
            *(np.vstack([force, np.zeros((3, count))]) for _, force in pushed),
        )
    )
    if not rules.instant(trajectory.rule, "joint_velocities"):
        return asked
    half = 0.5 * accelerations * np.diff(trajectory.time, append=trajectory.time[-1])  # ½ (ν⁺ − ν⁻)
    return asked + _velocity_products(robot, trajectory, half)


def _velocity_products(robot: Robot, trajectory: Trajectory, velocities: Array) -> Array:
    """Return c(ν) = C ν, Coriolis and centrifugal terms of other velocities at the knots, (6 + n, knots + 1)."""
    count, nothing = trajectory.time.size, np.zeros_like(velocities)
    poses, function = np.hstack(list(base_poses(trajectory))), robot.kindyn.rnea_fun(()).map(count)
    moving, still = (
        np.array(function(poses, trajectory.joint_positions, some[:6], some[6:], nothing[:6], nothing[6:]))
        for some in (velocities, nothing)
    )
    return np.asarray(moving - still)


@checked
def joint_torques(robot: Robot, trajectory: Trajectory) -> Array:
    """Return the torques of the joints' motors by inverse dynamics [N m], forces [N] of prismatic ones, (n, knots + 1).

    They are the last n rows of `generalised_forces`, at the instants of the knots. At one knot they have no meaning,
    since the trajectory does not tell its acceleration: `without_acceleration`.
    """
    return generalised_forces(robot, trajectory)[6:]


@checked
def without_acceleration(trajectory: Trajectory) -> int:
    """Return the index of the knot whose acceleration the trajectory does not tell: the first, 0, or the last, −1.

    Backward Euler tells accelerations of intervals' ends; leapfrog, of knots where two intervals meet.
    """
    return -1 if rules.instant(trajectory.rule, "joint_velocities") else 0


@checked
def largest_torques(robot: Robot, trajectory: Trajectory) -> tuple[LargestTorque, ...]:
    """Return the largest torque of every joint along a motion; the first one is the nearest to its effort limit.

    Args:
        robot: the robot of the trajectory.
        trajectory: the motion.
    """
    known = np.delete(np.arange(trajectory.time.size), without_acceleration(trajectory))
    torques, times = np.abs(joint_torques(robot, trajectory)[:, known]), trajectory.time[known]
    found = [
        LargestTorque(
            joint=name, torque=float(row.max()), when=float(times[row.argmax()]), effort=float(effort), unit=unit
        )
        for name, row, effort, unit in zip(
            robot.joint_names, torques, robot.joint_limits.effort, row_units(JOINT_TORQUES, robot), strict=True
        )
    ]
    return tuple(sorted(found, key=lambda one: (-one.over_effort, -one.torque)))

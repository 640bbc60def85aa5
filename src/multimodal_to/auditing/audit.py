"""`audit`: whether a trajectory is physically true, from its arrays alone and by code that shares no solver row.

Everything is recomputed in numpy from the saved quantities; only rigid-body quantities come from `robot.kindyn`, and
CoM and angular momentum from its mass-matrix side (J_CMM), not from the recursion that the optimiser uses.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from multimodal_to.adam.spatial import Array
from multimodal_to.arguments import checked
from multimodal_to.auditing.contacts import contact_findings
from multimodal_to.auditing.failures import failure_findings
from multimodal_to.auditing.findings import Finding, Motion, Worst, largest, worst_of
from multimodal_to.auditing.integrator import integrator_findings
from multimodal_to.auditing.limits import limit_findings
from multimodal_to.auditing.margins import margin_findings
from multimodal_to.auditing.properties import GAPS, PROPERTIES, check_allowances
from multimodal_to.auditing.regions import region_findings
from multimodal_to.auditing.self_collision import link_findings
from multimodal_to.auditing.task import task_findings
from multimodal_to.auditing.thrust import thrust_findings
from multimodal_to.errors import InputError, unknown
from multimodal_to.models.contact import FrictionCone
from multimodal_to.models.jet import Engine, FirstOrder
from multimodal_to.models.robot import Robot
from multimodal_to.models.terrain import FlatGround
from multimodal_to.scenarios.data import stored
from multimodal_to.scenarios.scenario import Scenario
from multimodal_to.trajectory import Trajectory, rules
from multimodal_to.trajectory.conditions import under_conditions
from multimodal_to.trajectory.derived import (
    at_knots,
    at_velocities,
    base_poses,
    flight_phases,
    generalised_forces,
    greatest_while_acting,
    loaded_force,
    surface_frames,
    without_acceleration,
)
from multimodal_to.trajectory.sameness import refuse_other_robot

KINEMATIC = (
    "CoM consistency",
    "momentum consistency",
    "contact point consistency",
    "quaternion norm",
    "penetration",
    "joint range",
    "joint speed",
    "link distance",
)
"""The properties that need no force, thrust or throttle: what can be said of a motion from anywhere."""


@dataclass(frozen=True, kw_only=True)
class Audit:
    """The findings by property, and figures that describe the motion."""

    findings: tuple[Finding, ...]
    scenario: Scenario | None  # None: what was asked is not known, so start, end and ranges of the task are not judged
    duration: float  # [s]
    airborne: float  # longest phase of flight [s]
    final_thrust_over_weight: float  # vertical, at the last knot [1]
    allowances_used: tuple[str, ...]  # properties that hold only because the scenario allows them more

    @property
    def holds(self) -> bool:
        """Return whether every property holds."""
        return all(finding.holds for finding in self.findings)

    @checked
    def __getitem__(self, name: str) -> Finding:
        """Return a finding by its property's name.

        Raises:
            InputError: the audit did not judge a property of that name.
        """
        by_name = {finding.name: finding for finding in self.findings}
        if name not in by_name:
            raise InputError(unknown("property of the audit", name, by_name))
        return by_name[name]


@checked
def audit(robot: Robot, trajectory: Trajectory, scenario: Scenario | None = None, *, kinematic: bool = False) -> Audit:
    """Check a trajectory against the physics of its robot.

    Gravity and the robot's friction are those that the trajectory keeps; where it keeps none, the robot's.

    Args:
        robot: the robot that the trajectory is for.
        trajectory: as loaded from its file.
        scenario: what was asked, with its terrain and friction; by default the one that the trajectory keeps. If it
            keeps none, the ground is taken as flat at height zero, with the robot's own friction as a pyramid.
        kinematic: judge only what needs no force: `KINEMATIC`, for motions that are no plans.

    Raises:
        InputError: the trajectory is for another robot, or the scenario allows more of a property that is not judged.
    """
    refuse_other_robot(trajectory, robot)
    robot = under_conditions(robot, trajectory)
    scenario = scenario or stored(trajectory)
    scenario = None if scenario is None else scenario.for_robot(robot)
    phases = flight_phases(robot, trajectory)
    motion = Motion.of(robot, trajectory, scenario.pushes if scenario else ())
    worst = _of_postures(motion, scenario) if kinematic else _of_all(motion, scenario)
    findings = _findings(worst, motion, scenario)
    return Audit(
        findings=findings,
        scenario=scenario,
        duration=trajectory.duration,
        airborne=max((end - start for start, end in phases), default=0.0),
        final_thrust_over_weight=float(motion.thrusts[:, -1, 2].sum() / robot.weight),
        allowances_used=tuple(entry.name for entry in findings if entry.holds and not _within(entry, motion, scenario)),
    )


def _of_all(motion: Motion, scenario: Scenario | None) -> tuple[Worst, ...]:
    robot, trajectory = motion.robot, motion.trajectory
    return (
        *_kinematics(motion),
        *_dynamics(motion),
        *_torques(motion),
        *_integration(motion),
        *_jets(robot, trajectory),
        *_contacts(motion, scenario),
        *_limits(robot, trajectory),
        *thrust_findings(robot, trajectory),
        *integrator_findings(motion),
        *link_findings(robot, trajectory),
        *margin_findings(motion, scenario),
        *(task_findings(motion, scenario) if scenario else ()),
        *(contact_findings(motion, scenario) if scenario else ()),
        *(failure_findings(motion, scenario) if scenario else ()),
        *(region_findings(motion, scenario) if scenario else ()),
        *(limit_findings(motion, scenario) if scenario else ()),
    )


def _of_postures(motion: Motion, scenario: Scenario | None) -> tuple[Worst, ...]:
    """Return the worst values of `KINEMATIC`: whether postures and velocities agree, and keep off ground and limits."""
    robot, trajectory = motion.robot, motion.trajectory
    judged = (
        *_kinematics(motion),
        *_contacts(motion, scenario),
        *_limits(robot, trajectory),
        *link_findings(robot, trajectory),
    )
    return tuple(entry for entry in judged if entry.name in KINEMATIC)


def _findings(worst: Sequence[Worst], motion: Motion, scenario: Scenario | None) -> tuple[Finding, ...]:
    """Return the worst values with their limits.

    Args:
        worst: one for each property, in order.
        motion: whose robot and integration rule a limit may depend on.
        scenario: whose margins set a limit, and whose allowances may widen one.

    Raises:
        InputError: the scenario allows more of a property that is not judged.
    """
    if scenario:
        check_allowances(motion.robot, scenario)
    allowances = scenario.allowances if scenario else {}
    return tuple(
        Finding(
            name=entry.name,
            worst=entry.worst,
            unit=PROPERTIES[entry.name].unit_for(motion.robot, entry.body),
            knot=entry.knot,
            body=entry.body,
            limit=max(_limit(entry.name, motion, scenario), allowances.get(entry.name, 0.0)),
        )
        for entry in worst
    )


def _within(finding: Finding, motion: Motion, scenario: Scenario | None) -> bool:
    """Return whether a finding holds without an allowance.

    Args:
        finding: with the widened limit.
        motion: that the own limit may depend on.
        scenario: that the own limit may depend on.
    """
    return finding.worst <= _limit(finding.name, motion, scenario)


def _limit(name: str, motion: Motion, scenario: Scenario | None) -> float:
    """Return a property's own limit.

    Args:
        name: of the property.
        motion: with the robot and the integration rule.
        scenario: that the limit may depend on.
    """
    return PROPERTIES[name].limit_for(motion.robot, scenario, motion.trajectory.rule)


def _kinematics(motion: Motion) -> list[Worst]:
    robot, trajectory, count = motion.robot, motion.trajectory, motion.trajectory.time.size
    side_by_side = np.hstack(list(motion.base))
    com = np.array(robot.kindyn.CoM_position_fun().map(count)(side_by_side, trajectory.joint_positions))
    moving = at_velocities(trajectory)
    matrices = np.array(
        robot.kindyn.centroidal_momentum_matrix_fun().map(count)(
            np.hstack(list(base_poses(moving))), moving.joint_positions
        )
    ).reshape(6, count, -1)
    velocities = np.vstack(
        [trajectory.base_linear_velocity, trajectory.base_angular_velocity, trajectory.joint_velocities]
    )
    momentum = np.einsum("rkc,ck->rk", matrices, velocities)
    # In the middle of an interval the CoM G of the configuration is not quite the middle x of the CoM's way, by Δt².
    # The file's momentum is about x, of velocities relative to the base: h = h_G + (G − x) × (l − m ṗ).
    middle = np.array(
        robot.kindyn.CoM_position_fun().map(count)(np.hstack(list(base_poses(moving))), moving.joint_positions)
    )
    relative = momentum[:3] - robot.mass * trajectory.base_linear_velocity
    about = momentum[3:] + np.cross(middle - moving.com_position, relative, axis=0)
    points = motion.points.transpose(0, 2, 1).reshape(-1, count)
    norms = np.linalg.norm(trajectory.base_quaternion_xyzw, axis=0)
    by_contact = np.abs(points - trajectory.contact_positions).reshape(len(robot.contacts), 3, count).max(axis=1)
    return [
        worst_of("CoM consistency", largest(com - trajectory.com_position)),
        worst_of("momentum consistency", largest(about - trajectory.angular_momentum)),
        worst_of("contact point consistency", by_contact, robot.contact_names),
        worst_of("quaternion norm", np.abs(norms - 1)),
    ]


def _dynamics(motion: Motion) -> list[Worst]:
    """Newton and Euler for the whole robot at the instants of the knots."""
    robot, trajectory = motion.robot, motion.trajectory
    contacts = (
        at_knots(trajectory, "contact_forces").reshape(len(robot.contacts), 3, trajectory.time.size).transpose(0, 2, 1)
    )
    acting = np.concatenate([contacts, motion.thrusts, motion.pushes])
    points = np.concatenate([motion.points, motion.thrust_points, motion.push_points])
    linear = acting.sum(axis=0) + robot.mass * robot.gravity - robot.mass * at_knots(trajectory, "com_acceleration").T
    moments = np.cross(points - trajectory.com_position.T, acting).sum(axis=0) + motion.drag_moments.sum(axis=0)
    turning = moments.T - at_knots(trajectory, "angular_momentum_rate")
    return [
        worst_of("force balance", _followed(largest(linear.T), trajectory)),
        worst_of("moment balance", _followed(largest(turning), trajectory)),
    ]


def _followed(values: Array, trajectory: Trajectory) -> Array:
    """Return the values at knots at which an acceleration is known, along the last axis.

    Where velocities are in the middles of intervals, none follows the last knot. Whether a motion rests there is what
    its task asks.
    """
    return values[..., :-1] if without_acceleration(trajectory) else values


def _torques(motion: Motion) -> list[Worst]:
    """RNEA along the motion under all contact forces and thrusts: joint torques, and what is left for the base."""
    robot = motion.robot
    pushed = list(zip(motion.pushed_frames, motion.pushes.transpose(0, 2, 1), strict=True))
    generalised = _followed(generalised_forces(robot, motion.trajectory, pushed), motion.trajectory)
    beyond = np.abs(generalised[6:]) - robot.joint_limits.effort[:, None]
    return [
        worst_of("torque beyond effort", beyond, robot.joint_names),
        worst_of("unexplained base force", largest(generalised[:3])),
        worst_of("unexplained base moment", largest(generalised[3:6])),
    ]


def _integration(motion: Motion) -> list[Worst]:
    """Compare what a quantity gains over an interval with the rate that the interval's end holds, times Δt."""
    trajectory, steps = motion.trajectory, np.diff(motion.trajectory.time)
    findings = []
    for name, rate, *_ in GAPS:
        gaps = np.diff(getattr(trajectory, name), axis=1) - getattr(trajectory, rate)[:, 1:] * steps
        joints = motion.robot.joint_names if name == "joint_positions" else ()
        findings.append(worst_of(f"gap of {name}", np.abs(gaps) if joints else largest(gaps), joints, first=1))
    rotations = motion.base[:, :3, :3]
    turned = rotations[1:] @ rotations[:-1].transpose(0, 2, 1)
    gaps = turned - _rodrigues(trajectory.base_angular_velocity[:, 1:].T * steps[:, None])
    findings.append(worst_of("gap of base orientation", np.abs(gaps).max(axis=(1, 2)), first=1))
    return findings


def _rodrigues(vectors: Array) -> Array:
    """Return the rotation matrices of rotation vectors [rad], (count, 3) → (count, 3, 3)."""
    angles = np.linalg.norm(vectors, axis=1)[:, None, None]
    x, y, z = vectors.T
    zero = np.zeros_like(x)
    skews = np.array([[zero, -z, y], [z, zero, -x], [-y, x, zero]]).transpose(2, 0, 1)
    first = np.sinc(angles / np.pi)
    second = 0.5 * np.sinc(angles / (2 * np.pi)) ** 2
    return np.asarray(np.eye(3) + first * skews + second * skews @ skews)


def _jets(robot: Robot, trajectory: Trajectory) -> list[Worst]:
    """How far thrusts are from the laws of their engines: T̈ of those of order two; of others, see `_lags`."""
    rate, throttle = at_knots(trajectory, "thrust_rate"), at_knots(trajectory, "throttle")
    accelerations = np.array(
        [jet.model.slopes(trajectory.thrust[row], rate[row], throttle[row])[1] for row, jet in enumerate(robot.jets)]
    ).reshape(len(robot.jets), trajectory.time.size)
    residuals = _followed(np.abs(accelerations - at_knots(trajectory, "thrust_acceleration")), trajectory)
    for row, jet in enumerate(robot.jets):
        if jet.model.order < 2:
            residuals[row, :] = 0.0
            residuals[row, : trajectory.knots] = _lags(jet.model, trajectory, row)
    return [worst_of("thrust dynamics", residuals, robot.jet_names)]


def _lags(engine: Engine, trajectory: Trajectory, row: int) -> Array:
    """Return how far a thrust is from its engine's law over each interval, as a T̈ [N/s²], (knots,).

    For an engine of order one it is Ṫ less (k u − T) / τ over τ; for one of order none, T less that of the throttle at
    the interval's end, over Δt².

    Args:
        engine: of order one or none.
        trajectory: the motion.
        row: of the jet.
    """
    missing = engine.imbalance(trajectory.thrust[row], trajectory.throttle[row])
    if isinstance(engine, FirstOrder):
        share = rules.acts_after(trajectory.rule)
        wanted = share * missing[:-1] + (1.0 - share) * missing[1:]
        return np.asarray(np.abs(trajectory.thrust_rate[row, 1:] - wanted) / engine.time_constant)
    return np.asarray(np.abs(missing[1:]) / np.diff(trajectory.time) ** 2)


def _contacts(motion: Motion, scenario: Scenario | None) -> list[Worst]:
    surface = scenario.surface if scenario else FlatGround()
    friction = (scenario.friction if scenario else None) or motion.robot.friction
    cone = scenario.friction_cone if scenario else FrictionCone.PYRAMID
    points, forces = motion.points, motion.contact_forces
    heights, normals, tangents = surface_frames(surface, points)
    normal = np.einsum("ckx,ckx->ck", normals, forces)
    along = np.einsum("ckxt,ckx->ckt", tangents, forces)
    reached = np.abs(along).max(axis=2) if cone is FrictionCone.PYRAMID else np.linalg.norm(along, axis=2)
    moves = np.diff(points, axis=1, prepend=points[:, :1])
    slips = np.linalg.norm(np.einsum("ckxt,ckx->ckt", tangents, moves), axis=2)
    names = motion.robot.contact_names
    rule = motion.trajectory.rule
    raised = greatest_while_acting(heights, rule)
    slips = greatest_while_acting(slips, rule, of_intervals=True)
    return [
        worst_of("penetration", -heights, names),
        worst_of("pulling normal force", -normal, names),
        worst_of("friction beyond cone", reached - friction * normal, names),
        worst_of("normal force × height", normal * raised, names),
        worst_of("slip under load", np.where(normal > loaded_force(motion.robot), slips, 0.0), names),
    ]


def _limits(robot: Robot, trajectory: Trajectory) -> list[Worst]:
    """How far quantities are beyond their limits; zero or less is within them."""
    limits, jets = robot.joint_limits, robot.jets
    joints, speeds = trajectory.joint_positions, np.abs(trajectory.joint_velocities)
    beyond = np.maximum(joints - limits.upper[:, None], limits.lower[:, None] - joints)
    thrust_max = np.array([jet.thrust_max for jet in jets]).reshape(-1, 1)
    lowest = np.array([jet.throttle_min for jet in jets]).reshape(-1, 1)
    highest = np.array([jet.throttle_max for jet in jets]).reshape(-1, 1)
    thrust, throttle = trajectory.thrust, trajectory.throttle
    return [
        worst_of("joint range", beyond, robot.joint_names),
        worst_of("joint speed", speeds - limits.speed[:, None], robot.joint_names),
        worst_of("thrust range", np.maximum(thrust - thrust_max, -thrust), robot.jet_names),
        worst_of("throttle range", np.maximum(throttle - highest, lowest - throttle), robot.jet_names),
    ]

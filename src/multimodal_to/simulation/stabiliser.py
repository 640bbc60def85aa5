"""A small stabiliser: what thrusts, loaded contact points and joints add to the plan to bring its momentum back.

Wanted is a change of the momentum's rate, with starred the plan and I the robot's inertia about its CoM, in base axes:

    Δl̇ = m (K_x (x* − x) + D_x (ẋ* − ẋ)),   Δḣω = R* I R*ᵀ K_R Log(R* Rᵀ) + D_h (hω* − hω).

Each of three stages takes what the one before leaves, by least squares: z minimises ‖W (A z − Δ)‖² + ‖z / σ‖².

1. Thrusts, which are slow. A jet whose throttle is at its end keeps the thrust that it has. They get only what the feet
   do not carry: σ = σ_T (1 − F / (m g))², with F the planned vertical force on the feet that stand. Else a small error
   that a stance keeps for seconds would spool up a turbine, which then throws the robot over.
2. Forces at the contact points that the plan loads, of feet that stand; they stay inside the friction pyramid.
3. Joints between base and jets, which turn and shift the thrusts. They count the less the more the feet carry.

In flight Δ is about the CoM, and R* leans towards the wanted horizontal force, as a quadrotor's does. While a foot
stands, stages 1 and 3 look only at the moment about the planned centre of pressure: about it the ground cannot help.
Of that they get what a stance as wide as the planned one leaves, B Δ of `_unborne`. Two feet side by side bear a moment
that rolls the robot: thrusts that fight them only shift the load to one foot, and are out of trim when it leaves.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from multimodal_to.adam.spatial import Array
from multimodal_to.models.robot import Robot
from multimodal_to.simulation.model import SimulationModel, mujoco_module
from multimodal_to.simulation.reference import Reference
from multimodal_to.simulation.units import Units
from multimodal_to.trajectory.derived import flight_force

# Weights of the horizontal forces, the vertical one [1/(m g)], and the moments [1/(m g L)].
THRUST_WEIGHTS = np.array([130.0, 130.0, 440.0, 1250.0, 1250.0, 1250.0])
FORCE_WEIGHTS = np.array([440.0, 440.0, 440.0, 1250.0, 1250.0, 1250.0])
JOINT_WEIGHTS = np.array([440.0, 440.0, 130.0, 1250.0, 1250.0, 1250.0])
JOINT_MAX = 0.3  # how far a joint leaves the plan [rad]
_MOMENTS = np.array([0.0, 0.0, 0.0, 1.0, 1.0, 1.0])


@dataclass(frozen=True, kw_only=True)
class BalanceGains:
    """The numbers of the stabiliser, in the robot's own units: m, g and L, the height of its CoM at home."""

    com_stiffness: float = 1.5  # K_x [g/L]; below 1 it does not hold an inverted pendulum
    com_damping: float = 1.6  # D_x [√(g/L)]
    attitude_stiffness: float = 0.94  # K_R [g/L]
    attitude_damping: float = 1.94  # D_h [√(g/L)]
    radius: float = 0.173  # r: a stance bears half of a moment about an axis from which its points stand so far [L]
    thrust_spread: float = 0.0456  # σ_T: of a thrust in flight [m g]
    load_spread: float = 0.5  # σ of a contact force, as a share of the planned load of its point [1]
    joint_spread: float = 0.1  # σ of a joint in flight [rad]
    lean_max: float = 0.05  # how far the base leans to move aside in flight [rad]


@dataclass(frozen=True, kw_only=True, eq=False)
class Correction:
    """What is added to the plan."""

    thrust: Array  # ΔT [N], (jets,)
    contact_forces: Array  # Δf in world axes [N], (contacts, 3)
    joints: Array  # Δs [rad], (n,)

    @classmethod
    def none(cls, robot: Robot) -> Correction:
        """Return what adds nothing."""
        return cls(
            thrust=np.zeros(len(robot.jets)),
            contact_forces=np.zeros((len(robot.contacts), 3)),
            joints=np.zeros(len(robot.joint_names)),
        )


@dataclass(frozen=True, kw_only=True, eq=False)
class Turbines:
    """The jets as they are: thrusts [N], and whose throttle can go no farther; (jets,) each."""

    thrust: Array
    at_most: NDArray[np.bool_]
    at_least: NDArray[np.bool_]


@dataclass(frozen=True, kw_only=True, eq=False)
class Balance:
    """What the stabiliser knows of the robot."""

    gains: BalanceGains
    units: Units
    inertia: Array  # I about the CoM in the base's axes [kg m²], (3, 3)
    friction: float  # Coulomb's μ [1]

    def weights(self, own: Array) -> Array:
        """Return weights of forces [1/N] and moments [1/(N m)] from those in the robot's own units, (6,)."""
        return own / np.repeat([self.units.force, self.units.moment], 3)


def correct(
    simulation: SimulationModel,
    data: Any,
    plan: Reference,
    step: int,
    turbines: Turbines,
    balance: Balance,
) -> Correction:
    """Return what to add to step `step` of the plan in the state of `data`.

    Args:
        simulation: the model, and where its numbers stand.
        data: MuJoCo's `MjData` of the state, with subtree velocities known.
        plan: on the grid of the simulation.
        step: row of the plan.
        turbines: the jets as they are.
        balance: gains, and what else is known of the robot.
    """
    robot, gains = simulation.robot, balance.gains
    com, points = data.subtree_com[1], data.geom_xpos[simulation.points]
    loads = np.maximum(plan.contact_forces[step][:, 2], 0.0)
    feet = np.array([contact.foot for contact in robot.contacts], dtype=np.str_)
    same_foot = feet[:, None] == feet
    touches = same_foot @ np.isin(simulation.points, data.contact.geom)
    standing = np.flatnonzero((same_foot @ loads > flight_force(robot)) & touches)  # loaded by the plan
    stands, load = bool(standing.size), float(loads[standing].sum())
    free = max(0.0, 1.0 - load / balance.units.force)
    wanted = _wanted(simulation, data, plan, step, balance, free)

    origin = loads[standing] @ points[standing] / load if stands else com
    rows = _MOMENTS if stands else np.ones(6)
    whole = _about(origin, com, wanted)
    asked = whole.copy()
    if stands:
        radius = gains.radius * balance.units.length
        asked[3:] = _unborne(points[standing] - origin, loads[standing] / load, radius) @ whole[3:]
    spread, weights = gains.thrust_spread * balance.units.force * free**2, balance.weights(THRUST_WEIGHTS * rows)
    thrust, missing = _thrusts(simulation, data, asked, origin, turbines, plan.thrust[step], spread, weights)

    forces = np.zeros((len(robot.contacts), 3))
    if stands:
        lacking = _about(com, origin, missing + whole - asked)
        forces[standing] = _contact_forces(
            plan.contact_forces[step][standing], points[standing] - com, lacking, balance
        )
    joints = np.zeros(len(robot.joint_names))
    if robot.jets and free > 0.0:
        effect = effect_of_joints(simulation, data, origin, turbines.thrust, stands=stands)
        joints = _ridge(effect, missing, np.full(joints.size, free * gains.joint_spread), balance.weights(JOINT_WEIGHTS * rows))
    return Correction(thrust=thrust, contact_forces=forces, joints=np.clip(joints, -JOINT_MAX, JOINT_MAX))


def rotation_vector(rotation: Array) -> Array:
    """Return Log R [rad], (3,)."""
    mujoco = mujoco_module()
    quaternion, vector = np.zeros(4), np.zeros(3)
    mujoco.mju_mat2Quat(quaternion, rotation.ravel())
    mujoco.mju_quat2Vel(vector, quaternion, 1.0)
    return vector


def _wanted(
    simulation: SimulationModel, data: Any, plan: Reference, step: int, balance: Balance, free: float
) -> Array:
    """Return Δl̇ [N] and Δḣω [N m] about the CoM, (6,).

    Args:
        simulation: the model, and where its numbers stand.
        data: MuJoCo's `MjData` of it.
        plan: on the grid of the simulation.
        step: row of the plan.
        balance: gains, and what else is known of the robot.
        free: share of the weight that the ground does not carry, from 0 to 1.
    """
    robot, gains, units = simulation.robot, balance.gains, balance.units
    rate = units.frequency
    away, slow = plan.com[step] - data.subtree_com[1], plan.com_velocity[step] - data.subtree_linvel[1]
    linear = robot.mass * (gains.com_stiffness * rate**2 * away + gains.com_damping * rate * slow)
    carried = float(np.clip(plan.thrust[step] @ _axes(simulation, data)[:, 2] / units.force, 0.0, 1.0))
    lean = free * carried * np.cross([0.0, 0.0, 1.0], linear) / units.force
    lean *= min(1.0, gains.lean_max / max(float(np.linalg.norm(lean)), 1e-9))
    turn = lean + rotation_vector(plan.rotation[step] @ data.xmat[1].reshape(3, 3).T)  # both small
    spin = plan.angular_momentum[step] - data.subtree_angmom[1]
    world = plan.rotation[step] @ balance.inertia @ plan.rotation[step].T
    angular = gains.attitude_stiffness * rate**2 * world @ turn + gains.attitude_damping * rate * spin
    return np.concatenate([linear, angular])


def _about(origin: Array, before: Array, wrench: Array) -> Array:
    """Return a wrench about `origin` that is given about `before`, (6,).

    Args:
        origin: of the moment that is returned, in the world [m], (3,).
        before: origin of the moment that is given, in the world [m], (3,).
        wrench: force [N] and moment [N m] in world axes, (6,).
    """
    return np.concatenate([wrench[:3], wrench[3:] + _skew(before - origin) @ wrench[:3]])


def _unborne(arms: Array, shares: Array, radius: float) -> Array:
    """Return B = r² (C + r² 1)⁻¹, (3, 3): which part of a moment a stance leaves to others.

    C = Σ share_i (a_i × e_j) · (a_i × e_k) is how far loaded points stand from each axis through their middle [m²].

    Args:
        arms: a, from there to the points [m], (points, 3).
        shares: of the load that each carries [1], (points,).
        radius: r [m].
    """
    spread = sum(share * _skew(arm).T @ _skew(arm) for arm, share in zip(arms * [1.0, 1.0, 0.0], shares, strict=True))
    return np.asarray(radius**2 * np.linalg.inv(spread + radius**2 * np.eye(3)))


def _axes(simulation: SimulationModel, data: Any) -> Array:
    """Return where each thrust points, (jets, 3): −z of the jet's frame."""
    return np.asarray(-data.site_xmat[simulation.jets].reshape(-1, 3, 3)[:, :, 2])


def _thrusts(
    simulation: SimulationModel,
    data: Any,
    wanted: Array,
    origin: Array,
    turbines: Turbines,
    planned: Array,
    spread: float,
    weights: Array,
) -> tuple[Array, Array]:
    """Return ΔT, and what the thrusts as they are leave of the wanted wrench about `origin`.

    Args:
        simulation: the model, and where its numbers stand.
        data: MuJoCo's `MjData` of it.
        wanted: change of force [N] and moment [N m] about `origin`, world axes, (6,).
        origin: in the world [m], (3,).
        turbines: the jets as they are.
        planned: thrusts of the plan [N], (jets,).
        spread: σ of each thrust [N].
        weights: W, of forces [1/N] and moments [1/(N m)], (6,).
    """
    axes = _axes(simulation, data)
    wrenches = np.vstack([axes.T, np.cross(data.site_xpos[simulation.jets] - origin, axes).T])
    off, spreads = turbines.thrust - planned, np.full(len(axes), spread)
    change = _ridge(wrenches, wanted, spreads, weights)
    stuck = (turbines.at_most & (change > off)) | (turbines.at_least & (change < off))
    if stuck.any():
        others = _ridge(wrenches * ~stuck, wanted - wrenches @ (off * stuck), spreads, weights)
        change = np.where(stuck, change, others)
    return change, wanted - wrenches @ off


def _contact_forces(planned: Array, arms: Array, wanted: Array, balance: Balance) -> Array:
    """Return Δf of contact points with planned forces and arms from the CoM, (points, 3).

    Args:
        planned: forces of the plan in world axes [N], (points, 3).
        arms: from the CoM to the points, world axes [m], (points, 3).
        wanted: change of force [N] and moment [N m] about the CoM, world axes, (6,).
        balance: gains, and what else is known of the robot.
    """
    friction = balance.friction
    wrenches = np.hstack([np.vstack([np.eye(3), _skew(arm)]) for arm in arms])
    spread = (balance.gains.load_spread * planned[:, 2:] * [friction, friction, 1.0]).ravel()
    total = planned + _ridge(wrenches, wanted, spread, balance.weights(FORCE_WEIGHTS)).reshape(-1, 3)
    total[:, 2] = np.maximum(total[:, 2], 0.0)
    reach = friction * total[:, 2:]
    total[:, :2] = np.clip(total[:, :2], -reach, reach)
    return np.asarray(total - planned)


def effect_of_joints(simulation: SimulationModel, data: Any, origin: Array, thrust: Array, *, stands: bool) -> Array:
    """Return ∂w/∂s, (6, n): how joints above the base move the wrench of the thrusts, and the weight where it stands.

    With thrust f at p: ∂f = ω × f, and the moment (p − o) × f changes with all three; o is the CoM in flight.

    Args:
        simulation: the model, and where its numbers stand.
        data: MuJoCo's `MjData` of it.
        origin: o, of the moments, in the world [m], (3,).
        thrust: of each jet [N], (jets,).
        stands: a foot carries load, so that the weight has a moment about `origin`.
    """
    mujoco, model = mujoco_module(), simulation.model
    linear, angular, of_com = (np.zeros((3, model.nv)) for _ in range(3))
    mujoco.mj_jacSubtreeCom(model, data, of_com, 1)
    effect, moves = np.zeros((6, model.nv)), np.zeros(model.nv, dtype=bool)
    for site, force in zip(simulation.jets, _axes(simulation, data) * thrust[:, None], strict=True):
        mujoco.mj_jacSite(model, data, linear, angular, site)
        turned = -_skew(force) @ angular
        effect[:3] += turned
        effect[3:] += _skew(data.site_xpos[site] - origin) @ turned - _skew(force) @ (linear - (not stands) * of_com)
        moves |= angular.any(axis=0)
    if stands:
        effect[3:] -= _skew(simulation.robot.mass * simulation.robot.gravity) @ of_com
    return np.asarray((effect * moves) @ simulation.coupling)


def _ridge(matrix: Array, target: Array, spread: Array, weights: Array) -> Array:
    """Return z of least ‖W (A z − b)‖² + ‖z / σ‖², by the (6, 6) system of its dual.

    Args:
        matrix: A, (6, k).
        target: b, (6,).
        spread: σ, in the units of z, (k,).
        weights: diagonal of W, (6,).
    """
    scaled = weights[:, None] * matrix * spread
    return np.asarray(spread * (scaled.T @ np.linalg.solve(scaled @ scaled.T + np.eye(6), weights * target)))


def _skew(vector: Array) -> Array:
    x, y, z = vector
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])

"""A small stabiliser for feet that stand: what contact forces add to the plan to bring its momentum back.

Wanted is a change of the momentum's rate, with starred the plan and I the robot's inertia about its CoM, in base axes:

    Δl̇ = m (K_x (x* + δ − x) + D_x (ẋ* − ẋ)),   Δḣω = R* I R*ᵀ K_R Log(R* Rᵀ) + D_h (hω* − hω),

less what the thrusts add that are not as planned. The plan is followed where the feet stand, δ beside itself: see
`look_ahead`. Two stages share it out by least squares: z minimises ‖W (A z − Δ)‖² + ‖z / σ‖².

1. Forces at the contact points that the plan loads, of feet that touch; they stay inside the friction pyramid.
2. Joints between base and jets, which turn and shift the thrusts and lean the upper body. They see the moment about the
   planned centre of pressure, about which the ground cannot help, and of it what a stance as wide as the planned one
   leaves: B Δ of `_unborne`. They count the less the more the feet carry.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from multimodal_to.adam.spatial import Array
from multimodal_to.models.units import Units
from multimodal_to.simulation.model import SimulationModel, mujoco_module
from multimodal_to.simulation.reference import Reference
from multimodal_to.trajectory.derived import flight_force

FORCE_WEIGHT, MOMENT_WEIGHT = 440.0, 1250.0  # W, of forces [1/(m g)] and of moments [1/(m g L)]
JOINT_MAX = 0.3  # how far a joint leaves the plan [rad or m]


@dataclass(frozen=True, kw_only=True)
class BalanceGains:
    """The numbers of the stabiliser, in the robot's own units: m, g and L, the height of its CoM at home."""

    com_stiffness: float = 1.5  # K_x [g/L]; below 1 it does not hold an inverted pendulum
    com_damping: float = 1.35  # D_x [√(g/L)]; at 1.9 a stiff robot chatters on its feet
    attitude_stiffness: float = 0.94  # K_R [g/L]
    attitude_damping: float = 1.94  # D_h [√(g/L)]
    load_spread: float = 0.5  # σ of a contact force, as a share of the planned load of its point [1]
    joint_spread: float = 0.1  # σ of a joint between base and jets, where the feet carry nothing [rad or m]
    radius: float = 0.173  # r: a stance bears half of a moment about an axis from which its points stand so far [L]


@dataclass(frozen=True, kw_only=True, eq=False)
class Balance:
    """What the stabiliser knows of the robot."""

    gains: BalanceGains
    units: Units
    inertia: Array  # I about the CoM in the base's axes [kg m²], (3, 3)
    friction: float  # Coulomb's μ [1]


@dataclass(frozen=True, kw_only=True, eq=False)
class Correction:
    """What is added to the plan."""

    contact_forces: Array  # Δf in world axes [N], (contacts, 3)
    joints: Array  # Δs [rad or m], (n,)


def correct(
    simulation: SimulationModel, data: Any, plan: Reference, step: int, thrust: Array, balance: Balance, footing: Array
) -> Correction:
    """Return what to add to row `step` of the plan in the state of `data`; nothing where no foot stands.

    Args:
        simulation: the model, and where its numbers stand.
        data: MuJoCo's `MjData` of the state, with subtree velocities known.
        plan: with rows.
        step: row of the plan.
        thrust: of each jet as it is [N], (jets,).
        balance: gains, and what else is known of the robot.
        footing: by how much the feet stand beside the plan [m], (3,).
    """
    robot, forces = simulation.robot, np.zeros((len(simulation.robot.contacts), 3))
    joints = np.zeros(len(robot.joint_names))
    com, points = data.subtree_com[1], data.geom_xpos[simulation.points]
    loads = np.maximum(plan.contact_forces[step][:, 2], 0.0)
    feet = np.array([contact.foot for contact in robot.contacts], dtype=np.str_)
    same_foot = feet[:, None] == feet
    touches = same_foot @ touching(simulation, data)
    standing = np.flatnonzero((same_foot @ loads > flight_force(robot)) & touches)  # loaded by the plan
    if not standing.size:
        return Correction(contact_forces=forces, joints=joints)
    axes = -data.site_xmat[simulation.jets].reshape(-1, 3, 3)[:, :, 2]
    wrenches = np.hstack([axes, np.cross(data.site_xpos[simulation.jets] - com, axes)])
    lacking = _wanted(simulation, data, plan, step, balance, footing) - (thrust - plan.thrust[step]) @ wrenches
    forces[standing] = _shared_out(plan.contact_forces[step][standing], points[standing] - com, lacking, balance)
    load = float(loads[standing].sum())
    free = max(0.0, 1.0 - load / balance.units.force)
    if robot.jets and free > 0.0:
        shares = loads[standing] / load
        origin = shares @ points[standing]
        moment = lacking[3:] + np.cross(com - origin, lacking[:3])
        moment = _unborne(points[standing] - origin, shares, balance.gains.radius * balance.units.length) @ moment
        effect = effect_of_joints(simulation, data, origin, thrust, stands=True)[3:]
        spread = np.full(joints.size, free * balance.gains.joint_spread)
        joints = _ridge(effect, moment, spread, np.full(3, MOMENT_WEIGHT / balance.units.moment))
    return Correction(contact_forces=forces, joints=np.clip(joints, -JOINT_MAX, JOINT_MAX))


def effect_of_joints(simulation: SimulationModel, data: Any, origin: Array, thrust: Array, *, stands: bool) -> Array:
    """Return ∂w/∂s, (6, n): how joints move the wrench of the thrusts, and of the weight, while the base stays.

    With a thrust f at p: ∂f = ω × f, and the moment (p − o) × f changes with all three; o is the CoM in flight. Joints
    that turn no jet have no effect here.

    Args:
        simulation: the model, and where its numbers stand.
        data: MuJoCo's `MjData` of the state.
        origin: o, of the moments, in the world [m], (3,).
        thrust: of each jet [N], (jets,).
        stands: a foot carries load, so that the weight has a moment about `origin`, which stays where it is.
    """
    mujoco, model = mujoco_module(), simulation.model
    linear, angular, of_com = (np.zeros((3, model.nv)) for _ in range(3))
    mujoco.mj_jacSubtreeCom(model, data, of_com, 1)
    effect, moves = np.zeros((6, model.nv)), np.zeros(model.nv, dtype=bool)
    axes = -data.site_xmat[simulation.jets].reshape(-1, 3, 3)[:, :, 2]
    for jet, site, force in zip(simulation.robot.jets, simulation.jets, axes * thrust[:, None], strict=True):
        mujoco.mj_jacSite(model, data, linear, angular, site)
        turned = -skew(force) @ angular
        effect[:3] += turned
        effect[3:] += skew(data.site_xpos[site] - origin) @ turned - skew(force) @ (linear - (not stands) * of_com)
        effect[3:] += jet.drag * turned
        moves |= angular.any(axis=0)
    if stands:
        effect[3:] -= skew(simulation.robot.mass * simulation.robot.gravity) @ of_com
    return np.asarray((effect * moves) @ simulation.coupling)


def _unborne(arms: Array, shares: Array, radius: float) -> Array:
    """Return B = r² (C + r² 1)⁻¹, (3, 3): which part of a moment a stance leaves to others.

    C = Σ share_i (a_i × e_j) · (a_i × e_k) is how far loaded points stand from each axis through their middle [m²].

    Args:
        arms: a, from there to the points [m], (points, 3).
        shares: of the load that each carries [1], (points,).
        radius: r [m].
    """
    spread = sum(share * skew(arm).T @ skew(arm) for arm, share in zip(arms * [1.0, 1.0, 0.0], shares, strict=True))
    return np.asarray(radius**2 * np.linalg.inv(spread + radius**2 * np.eye(3)))


def touching(simulation: SimulationModel, data: Any) -> NDArray[np.bool_]:
    """Return which contact points touch the ground in the state of MuJoCo's `MjData` of a model, (contacts,)."""
    return np.isin(simulation.points, data.contact.geom)


def rotation_vector(rotation: Array) -> Array:
    """Return Log R [rad], (3,)."""
    mujoco = mujoco_module()
    quaternion, vector = np.zeros(4), np.zeros(3)
    mujoco.mju_mat2Quat(quaternion, rotation.ravel())
    mujoco.mju_quat2Vel(vector, quaternion, 1.0)
    return vector


def _wanted(
    simulation: SimulationModel, data: Any, plan: Reference, step: int, balance: Balance, footing: Array
) -> Array:
    """Return Δl̇ [N] and Δḣω [N m] about the CoM, (6,).

    Args:
        simulation: the model, and where its numbers stand.
        data: MuJoCo's `MjData` of it.
        plan: with rows.
        step: row of the plan.
        balance: gains, and what else is known of the robot.
        footing: by how much the feet stand beside the plan [m], (3,).
    """
    gains, rate = balance.gains, balance.units.frequency
    away, slow = plan.com[step] + footing - data.subtree_com[1], plan.com_velocity[step] - data.subtree_linvel[1]
    linear = simulation.robot.mass * (gains.com_stiffness * rate**2 * away + gains.com_damping * rate * slow)
    turn = rotation_vector(plan.rotation[step] @ data.xmat[1].reshape(3, 3).T)
    spin = plan.angular_momentum[step] - data.subtree_angmom[1]
    world = plan.rotation[step] @ balance.inertia @ plan.rotation[step].T
    angular = gains.attitude_stiffness * rate**2 * world @ turn + gains.attitude_damping * rate * spin
    return np.concatenate([linear, angular])


def _shared_out(planned: Array, arms: Array, wanted: Array, balance: Balance) -> Array:
    """Return Δf of contact points with planned forces and arms from the CoM, (points, 3).

    Args:
        planned: forces of the plan in world axes [N], (points, 3).
        arms: from the CoM to the points, world axes [m], (points, 3).
        wanted: change of force [N] and moment [N m] about the CoM, world axes, (6,).
        balance: gains, and what else is known of the robot.
    """
    friction = balance.friction
    wrenches = np.hstack([np.vstack([np.eye(3), skew(arm)]) for arm in arms])
    spread = (balance.gains.load_spread * planned[:, 2:] * [friction, friction, 1.0]).ravel()
    weights = np.repeat([FORCE_WEIGHT / balance.units.force, MOMENT_WEIGHT / balance.units.moment], 3)
    total = planned + _ridge(wrenches, wanted, spread, weights).reshape(-1, 3)
    total[:, 2] = np.maximum(total[:, 2], 0.0)
    reach = friction * total[:, 2:]
    total[:, :2] = np.clip(total[:, :2], -reach, reach)
    return np.asarray(total - planned)


def _ridge(matrix: Array, target: Array, spread: Array, weights: Array) -> Array:
    """Return z of least ‖W (A z − b)‖² + ‖z / σ‖², by the system of its dual, as large as b.

    Args:
        matrix: A, (m, k).
        target: b, (m,).
        spread: σ, in the units of z, (k,).
        weights: diagonal of W, (m,).
    """
    scaled = weights[:, None] * matrix * spread
    return np.asarray(spread * (scaled.T @ np.linalg.solve(scaled @ scaled.T + np.eye(len(target)), weights * target)))


def skew(vector: Array) -> Array:
    """Return S with S w = vector × w, (3, 3)."""
    x, y, z = vector
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])

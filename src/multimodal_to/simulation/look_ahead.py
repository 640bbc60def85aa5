"""A feedback that looks along the plan: what thrusts, contact forces and joints do about an error, now and later.

Turbines are slow: half a second before a foot leaves the ground, thrusts have to be on the way to what the flight
needs. So the gains come from a linear-quadratic problem along the whole plan, solved backwards once, when a plan is
taken over. With the errors ξ = (x, ẋ, θ, hω, ∫x, ∫θ, T, Ṫ) of CoM, attitude, angular momentum and thrusts,

    m ẍ = Σ a_i T_i + θ × f_T + F            a_i where jet i pushes, f_T the planned sum of the thrusts
    I θ̇ = hω
    ḣω = Σ (r_i × a_i) T_i + θ × m_T + F_c × x + M      r_i from the CoM, m_T their moment, F_c the contact force
    T̈ = ∂T̈/∂T T + ∂T̈/∂Ṫ Ṫ + ∂T̈/∂u u

each input has a spread, which is what it may do without much cost: the throttle u; forces at the contact points, as far
as the plan loads them, whose sum is F and M; and the joints between base and jets, which turn and shift the thrusts as
far as the feet do not carry. Where no jet can be turned, the base leans to move aside: θ × f_T.

The plan is followed where the feet stand. A foot that came down beside its place, or slipped, stays where it is; a CoM
that is held above the planned place is then no longer above the foot. So x counts from the plan moved by δ, with

    δ̇ = (β δ_f − δ) / τ,

δ_f how far the feet stand beside the plan and β = min(1, load / load_full). In flight δ goes to zero.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from multimodal_to.adam.spatial import Array
from multimodal_to.models.jet import Jet, JetModel
from multimodal_to.models.state import State
from multimodal_to.models.units import Sized
from multimodal_to.simulation.controller import Belief
from multimodal_to.simulation.feet import PlannedFeet
from multimodal_to.simulation.known import Known
from multimodal_to.simulation.model import mujoco_module
from multimodal_to.simulation.reference import Reference
from multimodal_to.simulation.stabiliser import JOINT_MAX, effect_of_joints, rotation_vector, skew

GRID = 0.02  # between two rows of the gains [s]
SETTLING = 4.0  # how long the end is held for the gains there [s]
TURBINE = 0.5  # how long a turbine takes, roughly [s]
FLYING = 0.4  # joints help only while the feet carry less than this [m g]
FORGETTING = Sized(1.0, "s")  # time constant with which sums of errors go while a foot stands
FOOTING_LOAD = 0.3  # feet that carry this much or more say where the plan is followed [m g]
FOOTING_LAG = Sized(0.1, "s")  # τ while a foot stands
FOOTING_FADE = Sized(0.5, "s")  # τ in flight


@dataclass(frozen=True, kw_only=True)
class LookAhead:
    """How large errors and inputs may be; all of them count alike when they are so large."""

    place: float = 0.05  # of the CoM, level [L]
    height: float = 0.03  # of the CoM, along z [L]
    velocity: float = 0.1  # [√(g L)]
    tilt: float = 0.04  # [rad]
    spin: float = 0.02  # of the angular momentum [m L √(g L)]
    place_sum: float = 0.4  # of the CoM over time, in flight [L √(L/g)]
    tilt_sum: float = 1.0  # over time, in flight [√(L/g)]
    thrust: float = 0.2  # of a jet, where the feet carry nothing now and soon [m g]
    throttle: float = 0.5  # of its range [1]
    load: float = 0.5  # of a contact force, as a share of the planned load of its point [1]
    joint: float = 0.05  # of a joint between base and jets [rad]


@dataclass(frozen=True, kw_only=True, eq=False)
class _Gains:
    """What is done about ξ along a plan, SI units, world axes; a row for each of some of its rows."""

    throttle: Array  # of u [%], (rows, jets, 18 + 2 jets)
    joints: Array  # of s [rad or m], (rows, n, 18 + 2 jets)
    turning: Array  # I⁻¹ ∂hω/∂ṡ: how joints turn against the whole, (rows, 3, n)


@dataclass(frozen=True, kw_only=True, eq=False)
class Advice:
    """What the feedback sees and what it adds to the plan."""

    errors: Array  # ξ, SI units, (18 + 2 jets,)
    footing: Array  # δ: the plan is followed so far beside itself, level [m], (3,)
    throttle: Array  # [%], (jets,)
    joints: Array  # [rad or m], (n,)


class Feedback:
    """Gains along a plan, and the sums of the errors in flight.

    There are two sets of gains: for feet that stand as planned, and for a robot that no foot carries, whatever the plan
    says: one that lands late still has to fly.

    Args:
        belief: robot and ground; its state is lost.
        plan: with rows a `period` apart.
        period: [s].
        how: how large errors and inputs may be.
        known: which jets fail, and when: nothing is asked of them from then on.
    """

    def __init__(self, belief: Belief, plan: Reference, period: float, how: LookAhead, known: Known) -> None:
        self._belief, self._plan, self._period, self._known = belief, plan, period, known
        self._every = max(round(GRID / period), 1)
        self._standing = self._gains(how, stands=True)
        self._flying = self._gains(how, stands=False) if belief.simulation.robot.jets else self._standing
        self._forgetting = FORGETTING.of(belief.simulation.robot.units)
        self._sums, self._footing = np.zeros(6), np.zeros(3)
        self.feet = PlannedFeet.along(belief, plan, period)

    def advise(self, state: State, step: int) -> Advice:
        """Return what is added to a row of the plan.

        The attitude in ξ is that of the whole robot, whose angular velocity is I⁻¹ hω: the base's, and what the joints
        have turned against it.

        Args:
            state: as it was measured, which `belief` has taken over.
            step: row of the plan.
        """
        data, plan = self._belief.data, self._plan
        stands = bool(data.ncon)
        gains = self._standing if stands else self._flying
        row = min(round(step / self._every), len(gains.turning) - 1)
        self._follow_feet(step)
        place = data.subtree_com[1] - plan.com[step] - self._footing
        turn = rotation_vector(self._belief.rotation @ plan.rotation[step].T)
        turn = turn + gains.turning[row] @ (state.joint_positions - plan.joints[step])
        rate = -self._sums / self._forgetting if stands else np.concatenate([place, turn])
        self._sums = self._sums + self._period * rate
        errors = np.concatenate(
            [
                place,
                data.subtree_linvel[1] - plan.com_velocity[step],
                turn,
                data.subtree_angmom[1] - plan.angular_momentum[step],
                self._sums,
                state.thrust - plan.thrust[step],
                state.thrust_rate - plan.thrust_rate[step],
            ]
        )
        joints = np.clip(gains.joints[row] @ errors, -JOINT_MAX, JOINT_MAX)
        return Advice(errors=errors, footing=self._footing, throttle=gains.throttle[row] @ errors, joints=joints)

    def _follow_feet(self, step: int) -> None:
        """Let δ go on by a period."""
        units = self._belief.simulation.robot.units
        beside, load = self.feet.beside(self._belief, step)
        lag = FOOTING_LAG if load > 0.0 else FOOTING_FADE
        target = min(load / (FOOTING_LOAD * units.force), 1.0) * beside
        self._footing = self._footing + (target - self._footing) * self._period / lag.of(units)

    def _gains(self, how: LookAhead, *, stands: bool) -> _Gains:
        belief, plan, robot = self._belief, self._plan, self._belief.simulation.robot
        jets, units = len(robot.jets), robot.units
        ahead = round(TURBINE / self._period)
        systems = [
            _System.at(belief, plan, row, ahead, how, stands=stands, works=self._known.works(row * self._period))
            for row in range(0, len(plan.com), self._every)
        ]
        turning = np.array([system.turning for system in systems])
        if not jets:
            none = np.zeros((len(systems), 0, 18))
            return _Gains(throttle=none, joints=np.zeros((len(systems), turning.shape[2], 18)), turning=turning)
        rate, length, spin = units.frequency, units.length, units.moment / units.frequency
        unit = np.repeat([length, length * rate, 1.0, spin, length / rate, 1.0 / rate], 3)
        unit = np.concatenate([unit, np.full(jets, units.force), np.full(jets, units.force * rate)])
        sizes = [how.place, how.place, how.height]
        sizes += [size for size in (how.velocity, how.tilt, how.spin, how.place_sum, how.tilt_sum) for _ in range(3)]
        value, found = np.diag(np.concatenate([1.0 / np.array(sizes) ** 2, np.zeros(2 * jets)])), list[Array]()
        weights = []
        for system in systems:
            of_thrust = np.full(jets, (how.thrust * max(system.free**2, 1e-3)) ** -2)
            weights.append(
                np.diag(np.concatenate([1.0 / np.array(sizes) ** 2, of_thrust, np.zeros(jets)])) * GRID * rate
            )
        for _ in range(round(SETTLING / GRID)):
            value, _ = _backward(systems[-1], value, weights[-1], unit, rate)
        for system, weight in zip(reversed(systems), reversed(weights), strict=True):
            value, gain = _backward(system, value, weight, unit, rate)
            found.append(system.spreads @ gain)
        done = np.array(found[::-1])
        return _Gains(throttle=done[:, :jets], joints=done[:, jets + 6 :], turning=turning)


@dataclass(frozen=True, kw_only=True, eq=False)
class _System:
    """ξ̇ = A ξ + B η with inputs η of spread one, SI units; S η is what they stand for."""

    errors: Array  # A
    inputs: Array  # B
    spreads: Array  # S, (jets + 6 + n, inputs)
    turning: Array  # I⁻¹ ∂hω/∂ṡ, (3, n)
    free: float  # share of the weight that the feet do not carry, now or soon [1]

    @classmethod
    def at(
        cls,
        belief: Belief,
        plan: Reference,
        row: int,
        ahead: int,
        how: LookAhead,
        *,
        stands: bool,
        works: NDArray[np.bool_],
    ) -> _System:
        simulation, data = belief.simulation, belief.data
        robot = simulation.robot
        jets, count = len(robot.jets), len(robot.joint_names)
        belief.put_plan(plan, row)
        mujoco_module().mj_fwdPosition(simulation.model, data)
        com = data.subtree_com[1].copy()
        axes = -data.site_xmat[simulation.jets].reshape(-1, 3, 3)[:, :, 2]
        arms = data.site_xpos[simulation.jets] - com
        thrusts = axes * plan.thrust[row][:, None]
        drags = np.array([jet.drag for jet in robot.jets]).reshape(-1, 1)
        moments = np.cross(arms, thrusts) + drags * thrusts
        points, forces = data.geom_xpos[simulation.points] - com, plan.contact_forces[row] * stands
        load = np.maximum(forces[:, 2], 0.0)
        units = robot.units
        soon = plan.contact_forces[row : row + ahead, :, 2].sum(axis=1).min(initial=units.force)
        free = float(np.clip(1.0 - soon / units.force, 0.0, 1.0)) if stands else 1.0

        own, spin = _inertia(belief, com)
        counter = np.linalg.solve(own, spin)
        size = 18 + 2 * jets
        errors = np.zeros((size, size))
        errors[0:3, 3:6] = np.eye(3)
        errors[3:6, 6:9] = -skew(thrusts.sum(axis=0)) / units.mass
        errors[6:9, 9:12] = np.linalg.inv(own)
        errors[9:12, 0:3] = skew(forces.sum(axis=0))
        errors[9:12, 6:9] = -skew(moments.sum(axis=0))
        errors[12:15, 0:3] = errors[15:18, 6:9] = np.eye(3)
        errors[3:6, 18 : 18 + jets] = axes.T / units.mass
        errors[9:12, 18 : 18 + jets] = (np.cross(arms, axes) + drags * axes).T
        errors[18 : 18 + jets, 18 + jets :] = np.eye(jets)
        spreads = np.zeros((jets + 6 + count, jets + 6 + count))
        effect = np.zeros((size, jets + 6 + count))
        for index, jet in enumerate(robot.jets):
            of_thrust, of_rate, of_throttle = _slopes(
                jet, *(getattr(plan, name)[row, index] for name in ("thrust", "thrust_rate", "throttle"))
            )
            errors[18 + jets + index, 18 + index] = of_thrust
            errors[18 + jets + index, 18 + jets + index] = of_rate
            effect[18 + jets + index, index] = of_throttle
            spreads[index, index] = how.throttle * (jet.throttle_max - jet.throttle_min) * works[index]
        of_point = (
            np.hstack([np.vstack([np.eye(3), skew(point)]) for point in points]) if len(points) else np.zeros((6, 0))
        )
        spread = (how.load * load[:, None] * np.array([belief.friction, belief.friction, 1.0])).ravel()
        spreads[jets : jets + 6, jets : jets + 6] = _root((of_point * spread**2) @ of_point.T)
        effect[3:6, jets : jets + 3] = np.eye(3) / units.mass
        effect[9:12, jets + 3 : jets + 6] = np.eye(3)
        flying = max(0.0, 1.0 - load.sum() / (FLYING * units.force))
        if jets and flying > 0.0:
            of_joints = effect_of_joints(simulation, data, com, plan.thrust[row], stands=False)
            turning = -np.vstack([skew(thrusts.sum(axis=0)), skew(moments.sum(axis=0))])
            of_joints = of_joints - (turning @ counter) * of_joints.any(axis=0)
            effect[3:6, jets + 6 :], effect[9:12, jets + 6 :] = of_joints[:3] / units.mass, of_joints[3:]
            spreads[jets + 6 :, jets + 6 :] = how.joint * flying * np.eye(count)
        return cls(errors=errors, inputs=effect @ spreads, spreads=spreads, turning=np.asarray(counter), free=free)


def _backward(system: _System, value: Array, weight: Array, scale: Array, rate: float) -> tuple[Array, Array]:
    """Return the cost-to-go a step of the grid before, in scaled errors, and the gains there, of errors in SI units."""
    size = len(scale)
    errors = system.errors * scale / scale[:, None] * GRID
    inputs = system.inputs / scale[:, None] * GRID
    step = np.eye(size) + errors + errors @ errors / 2.0
    moved = inputs + errors @ inputs / 2.0
    cost = np.eye(inputs.shape[1]) * (GRID * rate)
    gain = -np.linalg.solve(cost + moved.T @ value @ moved, moved.T @ value @ step)
    closed = step + moved @ gain
    value = weight + gain.T @ cost @ gain + closed.T @ value @ closed
    return (value + value.T) / 2.0, gain / scale


def _inertia(belief: Belief, com: Array) -> tuple[Array, Array]:
    """Return the robot's inertia about its CoM as it stands [kg m²], and ∂hω/∂ṡ; world axes, (3, 3) and (3, n)."""
    mass, arm, turn = belief.mass_matrix(), skew(com - belief.data.xpos[1]), belief.rotation
    inertia = turn @ mass[3:6, 3:6] @ turn.T + belief.simulation.robot.mass * arm @ arm
    return inertia, turn @ mass[3:6, 6:] - arm @ mass[:3, 6:]


def _slopes(jet: Jet, thrust: float, rate: float, throttle: float) -> tuple[float, float, float]:
    """Return ∂T̈/∂T, ∂T̈/∂Ṫ and ∂T̈/∂u; an engine of lower order gets lags of a step of the grid in their place.

    Args:
        jet: with its engine.
        thrust: T [N].
        rate: Ṫ [N/s].
        throttle: u [%].
    """
    engine = jet.model
    if isinstance(engine, JetModel):
        effective = throttle + engine.B_UU * throttle**2
        gain = engine.B_U + engine.B_T * thrust + engine.B_D * rate
        return (
            engine.K_T + 2 * engine.K_TT * thrust + engine.K_TD * rate + engine.B_T * effective,
            engine.K_D + 2 * engine.K_DD * rate + engine.K_TD * thrust + engine.B_D * effective,
            gain * (1 + 2 * engine.B_UU * throttle),
        )
    held = (engine.imbalance(thrust, throttle + 1.0) - engine.imbalance(thrust, throttle - 1.0)) / 2.0
    if engine.order == 1:  # T̈ = ((k u − T) / τ − Ṫ) / ε
        lag = engine.imbalance(thrust + 1.0, throttle) - engine.imbalance(thrust, throttle)
        return float(lag) / GRID, -1.0 / GRID, float(held) / GRID
    return -1.0 / GRID**2, -2.0 / GRID, float(held) / GRID**2  # (T(u) − T) / ε² − 2 Ṫ / ε


def _root(matrix: Array) -> Array:
    values, vectors = np.linalg.eigh(matrix)
    return np.asarray((vectors * np.sqrt(np.maximum(values, 0.0))) @ vectors.T)

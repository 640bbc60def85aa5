"""The whole-body controller: a quadratic program, 500 times a second, for accelerations and contact forces.

With ν̇ the accelerations of base and joints, f the forces at the contact points and T the thrusts as they are,

    min Σ_i w_i ‖A_i ν̇ − a_i‖² + w_f ‖f − f*‖²   subject to   the base's rows of M ν̇ + h = Jᵀ f + J_Tᵀ T,
    f within the friction cones, and the joints' rows, which are the torques, within the effort limits.

The tasks i are the momentum's rate, the base's attitude, the feet and the posture; each a_i is that of the plan and a
feedback. Forces are allowed at all points of a foot that the plan loads and that is near the ground, and not only where
it touches: else a foot that comes down on its heel stays there.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import ModuleType
from typing import Any

import numpy as np

from multimodal_to.adam.spatial import Array
from multimodal_to.errors import OutputError
from multimodal_to.models.robot import Robot
from multimodal_to.models.state import State
from multimodal_to.models.terrain import FlatGround, Surface, frame_function
from multimodal_to.scenarios.data import stored
from multimodal_to.simulation.controller import Belief, Command, Servos, row_of
from multimodal_to.simulation.look_ahead import GRID, Feedback, LookAhead
from multimodal_to.simulation.model import mujoco_module
from multimodal_to.simulation.reference import Reference, reference
from multimodal_to.simulation.servos import inertia
from multimodal_to.simulation.stabiliser import (
    Balance,
    BalanceGains,
    Correction,
    Turbines,
    correct,
    rotation_vector,
)
from multimodal_to.simulation.turbines import around
from multimodal_to.simulation.units import Units
from multimodal_to.trajectory import Trajectory
from multimodal_to.trajectory.derived import loaded_force

PERIOD = 2e-3  # between two commands [s]


@dataclass(frozen=True, kw_only=True)
class WholeBodyGains(BalanceGains):
    """The numbers of the whole-body controller, in the robot's own units: m, g and L, the height of its CoM at home."""

    com: float = 1.2  # level CoM [g/L]
    com_rate: float = 2.2  # [√(g/L)]
    height: float = 3.5  # CoM along gravity [g/L]
    height_rate: float = 3.7  # [√(g/L)]
    spin_rate: float = 2.0  # angular momentum [√(g/L)]
    base: float = 4.7  # attitude of the base [g/L]
    base_rate: float = 4.4  # [√(g/L)]
    foot: float = 17.6  # of a foot that swings [g/L]
    foot_rate: float = 8.5  # [√(g/L)]
    stance_rate: float = 9.7  # of a foot that stands [√(g/L)]
    joint: float = 53.0  # [g/L]
    joint_rate: float = 14.6  # [√(g/L)]
    stiffness: float = 1.2  # K of each joint's servo [m g L/rad]
    damping: float = 0.16  # D of each joint's servo [m g L √(L/g)/rad]


@dataclass(frozen=True, kw_only=True)
class Weights:
    """How much each task counts, for an error of the robot's own units: g for accelerations, g/L for turning ones."""

    com: float = 1.0
    spin: float = 33.0  # of the angular momentum's rate [m g L]
    base: float = 6.0
    base_in_flight: float = 0.006
    stance: float = 30.0
    foot: float = 2.0
    legs: float = 0.09
    others: float = 0.3
    flying: float = 0.9  # joints in flight
    force: float = 0.2  # of contact forces away from the plan's [m g]
    torque: float = 0.004  # [m g L]


def solver_module() -> ModuleType:
    """Return the package `piqp`.

    Raises:
        OutputError: it is not installed.
    """
    try:
        import piqp
    except ImportError as error:
        raise OutputError("the whole-body controller needs piqp: pip install 'multimodal-to[sim]'") from error
    return piqp  # type: ignore[no-any-return]


@dataclass(frozen=True, kw_only=True, eq=False)
class _Feet:
    """The feet of a plan at its rows: where the middles of their contact points are, and how they turn and move."""

    middle: Array  # [m], (feet, steps, 3)
    rotation: Array  # of the link, (feet, steps, 3, 3)
    velocity: Array  # of middle and link [m/s, rad/s], (feet, steps, 6)
    acceleration: Array  # [m/s², rad/s²], (feet, steps, 6)
    load: Array  # normal force that is planned [N], (feet, steps)


class WholeBodyController:
    """A quadratic program for accelerations and contact forces, on top of joint servos.

    Args:
        gains: its feedback.
        weights: how much each task counts.
    """

    near = 0.0035  # a planned foot may push while its lowest point is nearer to the ground than this [L]; 2 mm
    mode = "plan"
    leak = 5.0
    sides = 8
    early = 0.25
    how = LookAhead()
    total = False
    ff = "force"
    ideal = True

    def __init__(self, gains: WholeBodyGains | None = None, weights: Weights | None = None) -> None:
        self._gains, self._weights = gains or WholeBodyGains(), weights or Weights()
        self._since = 0.0
        self._belief: Belief | None = None

    @property
    def period(self) -> float:
        """Return the time between two commands [s]."""
        return PERIOD

    def reset(self, robot: Robot, plan: Trajectory, since: float) -> None:
        """Follow a plan from now on.

        Args:
            robot: that moves.
            plan: its motion.
            since: when the plan's first knot is or was, since the simulation's start [s].
        """
        first = self._belief is None
        self._robot, self._since, self._units = robot, since, Units.of(robot)
        self._belief = Belief(robot, plan)
        self._simulation, self._data = self._belief.simulation, self._belief.data
        self._model = self._simulation.model
        scenario = stored(plan)
        self._surface = FlatGround() if scenario is None else scenario.surface
        self._plan = reference(robot, plan, np.arange(0.0, plan.duration + 2 * PERIOD, PERIOD))
        self._members = [np.array(members) for members in robot.feet.values()]
        self._bodies = [int(self._model.geom_bodyid[self._simulation.points[own[0]]]) for own in self._members]
        self._feet = self._planned_feet()
        self._limits = np.where(np.isfinite(robot.joint_limits.effort), robot.joint_limits.effort, np.inf)
        self._balance = Balance(
            gains=self._gains, units=self._units, inertia=inertia(robot), friction=self._belief.friction
        )
        self._fb = Feedback.along(self._belief, self._plan, PERIOD, self.how)
        count = len(robot.joint_names)
        legs = np.zeros(count, dtype=bool)
        jp, jr = np.zeros((3, self._model.nv)), np.zeros((3, self._model.nv))
        for body in self._bodies:
            mujoco_module().mj_jac(self._model, self._data, jp, jr, np.ones(3), body)
            legs |= ((np.abs(jp).sum(0) + np.abs(jr).sum(0)) @ np.abs(self._simulation.coupling)) > 1e-9
        self._legs = legs
        u = self._units
        self._K = np.full(count, self._gains.stiffness * u.moment)
        self._D = np.full(count, self._gains.damping * u.moment / u.frequency)
        mu = 0.97 * self._belief.friction
        k = (np.arange(self.sides) + 0.5) * 2 * np.pi / self.sides
        self._cone = np.column_stack([np.cos(k), np.sin(k), np.full(self.sides, -mu * np.cos(np.pi / self.sides))])
        if first:
            self._shift, self._throttle = np.zeros(count), plan.throttle[:, 0].copy()
            self._touched = np.full(len(self._members), -1.0)
            self._own: tuple[Array, Array] | None = None
            self._last = None
            self.failures = 0
            self.solve_time = 0.0

    def _planned_feet(self) -> _Feet:
        mujoco, data, plan, sim = mujoco_module(), self._data, self._plan, self._simulation
        steps, feet = len(plan.com), len(self._members)
        middle, rotation = np.zeros((feet, steps, 3)), np.zeros((feet, steps, 3, 3))
        self._contact_arms = np.zeros((steps, len(sim.points), 3))
        quaternion = np.zeros(4)
        for i in range(steps):
            mujoco.mju_mat2Quat(quaternion, plan.rotation[i].ravel())
            sim.set_state(
                data, plan.base_position[i], quaternion[[1, 2, 3, 0]], plan.joints[i], np.zeros(6), np.zeros(plan.joints.shape[1])
            )
            mujoco.mj_kinematics(self._model, data)
            self._contact_arms[i] = data.geom_xpos[sim.points] - plan.com[i]
            for j, own in enumerate(self._members):
                middle[j, i] = data.geom_xpos[sim.points[own]].mean(axis=0)
                rotation[j, i] = data.xmat[self._bodies[j]].reshape(3, 3)
        velocity = np.zeros((feet, steps, 6))
        velocity[:, :, :3] = np.gradient(middle, PERIOD, axis=1)
        turn = rotation[:, 1:] @ rotation[:, :-1].transpose(0, 1, 3, 2)
        velocity[:, 1:, 3:] = np.stack(
            [turn[..., 2, 1] - turn[..., 1, 2], turn[..., 0, 2] - turn[..., 2, 0], turn[..., 1, 0] - turn[..., 0, 1]],
            axis=-1,
        ) / (2 * PERIOD)
        acceleration = np.gradient(velocity, PERIOD, axis=1)
        load = np.array([plan.contact_forces[:, own, 2].sum(axis=1) for own in self._members])
        return _Feet(middle=middle, rotation=rotation, velocity=velocity, acceleration=acceleration, load=load)

    def command(self, state: State, time: float) -> Command:
        """Return what the robot shall do.

        Args:
            state: as it was measured.
            time: since the simulation's start [s].
        """
        assert self._belief is not None
        self._belief.put(state)
        step = row_of(time - self._since, PERIOD, self._plan)
        plan = self._plan
        R, data = self._belief.rotation, self._data
        xi = np.concatenate([
            data.subtree_com[1] - plan.com[step], data.subtree_linvel[1] - plan.com_velocity[step],
            rotation_vector(R @ plan.rotation[step].T) + self._fb.turning[min(round(step * PERIOD / GRID), len(self._fb.throttle) - 1)] @ (state.joint_positions - plan.joints[step]), data.subtree_angmom[1] - plan.angular_momentum[step],
            state.thrust - plan.thrust[step], state.thrust_rate - plan.thrust_rate[step]])
        k = min(round(step * PERIOD / GRID), len(self._fb.throttle) - 1)
        du, dw, ds = self._fb.throttle[k] @ xi, self._fb.wrench[k] @ xi, self._fb.joints[k] @ xi
        self._throttle = around(self._robot.jets, plan, step, state.thrust, state.thrust_rate, du)
        self._shift = self._shift + (np.clip(ds, -0.3, 0.3) - self._shift) * PERIOD / 0.03
        self._dw, self._xi = dw, xi
        torques, accelerations = self._solve(state, step, time)
        if self.mode == "torque":
            return Command(torques=torques, throttle=self._throttle)
        if self.mode == "plan":
            servos = Servos(positions=plan.joints[step] + self._shift, velocities=plan.joint_velocities[step], stiffness=self._K, damping=self._D)
        else:
            place, speed = self._own or (state.joint_positions, state.joint_velocities)
            keep = self.leak * PERIOD
            speed = speed + PERIOD * accelerations + keep * (state.joint_velocities - speed)
            place = place + PERIOD * speed + keep * (state.joint_positions - place)
            self._own = place, speed
            servos = Servos(positions=place, velocities=speed, stiffness=self._K, damping=self._D)
        return Command(torques=torques, throttle=self._throttle, servos=servos)

    def _heights(self, points: Array) -> Array:
        if isinstance(self._surface, FlatGround):
            return points[:, 2] - self._surface.height
        return np.array(frame_function(self._surface).map(len(points))(points.T)[0]).ravel()

    def _solve(self, state: State, step: int, time: float) -> tuple[Array, Array]:
        mujoco, model, data, plan = mujoco_module(), self._model, self._data, self._plan
        sim, g, w, u = self._simulation, self._gains, self._weights, self._units
        G = self._belief.of_joints
        nv, n = model.nv, len(self._robot.joint_names)
        N = 6 + n
        M = np.zeros((nv, nv))
        mujoco.mj_fullM(model, data, M)
        M = G.T @ M @ G
        h = G.T @ data.qfrc_bias
        v = data.qvel
        R, com = self._belief.rotation, data.subtree_com[1]
        rate, mass, grav = u.frequency, u.mass, self._robot.gravity
        jp, jr = np.zeros((3, nv)), np.zeros((3, nv))
        Fj = np.zeros(nv)
        for i, site in enumerate(sim.jets):
            mujoco.mj_jacSite(model, data, jp, None, site)
            Fj -= state.thrust[i] * (data.site_xmat[site].reshape(3, 3)[:, 2] @ jp)
        Fj = G.T @ Fj
        points = data.geom_xpos[sim.points]
        low = self._heights(points)
        near = self.near * u.length
        A, a, W = [], [], []
        Jc: list[Array] = []
        active: list[int] = []
        swings = []
        horizon = min(step + int(self.early / PERIOD), len(plan.com) - 1)
        feet = self._feet
        for j, own in enumerate(self._members):
            touch = bool((low[own] < 0.2 * near).any())
            if touch:
                self._touched[j] = time
            loaded = feet.load[j, step] > 0.01 * u.force
            soon = bool((feet.load[j, step : horizon + 1] > 0.01 * u.force).any())
            mid = points[own].mean(axis=0)
            body = self._bodies[j]
            mujoco.mj_jac(model, data, jp, jr, mid, body)
            J = np.vstack([jp, jr])
            vf = J @ v
            mujoco.mj_jacDot(model, data, jp, jr, mid, body)
            Jdv = np.concatenate([jp @ v, jr @ v])
            J = J @ G
            tilt = rotation_vector(feet.rotation[j, step] @ data.xmat[body].reshape(3, 3).T)
            close = low[own].min() < near or (self._touched[j] >= 0 and time - self._touched[j] < 0.02)
            if (loaded or (soon and feet.velocity[j, step, 2] <= 0.02)) and close:
                acc = -g.stance_rate * rate * vf
                acc[3:5] += 0.25 * (g.stance_rate * rate) ** 2 * tilt[:2]
                A.append(J)
                a.append(acc - Jdv)
                W.append(np.repeat([w.stance / u.gravity**2, w.stance / rate**4], 3))
                for c in own:
                    r = points[c] - mid
                    S = np.array([[0, r[2], -r[1]], [-r[2], 0, r[0]], [r[1], -r[0], 0]])
                    Jc.append(J[:3] + S @ J[3:])
                    active.append(int(c))
            else:
                e = np.concatenate([feet.middle[j, step] - mid, tilt])
                acc = feet.acceleration[j, step] + g.foot * rate**2 * e + g.foot_rate * rate * (feet.velocity[j, step] - vf)
                if loaded:  # it is late: down
                    acc[2] = g.foot_rate * rate * (-0.0126 * u.length * rate - vf[2])
                swings.append((J, acc - Jdv, soon))
        for J, acc, soon in swings:
            A.append(J)
            a.append(acc)
            ww = w.foot if active else (0.025 * w.foot if soon else 0.0)
            W.append(np.repeat([ww / u.gravity**2, ww / rate**4], 3))
        load = float(feet.load[:, step].sum())
        free = max(0.0, 1.0 - load / u.force) if active else 1.0
        r = com - data.xpos[1]
        S = np.array([[0, -r[2], r[1]], [r[2], 0, -r[0]], [-r[1], r[0], 0]])
        f = plan.contact_forces[step]
        axes = -data.site_xmat[sim.jets].reshape(-1, 3, 3)[:, :, 2]
        fT = axes * state.thrust[:, None]
        mT = np.cross(data.site_xpos[sim.jets] - com, fT).sum(0)
        arms = self._contact_arms[step]
        if self.total:
            force = f.sum(0) + fT.sum(0) + mass * grav + self._dw[:3]
            moment = np.cross(arms, f).sum(0) + np.cross(f.sum(0), self._xi[:3]) + mT + self._dw[3:]
        else:
            kx = np.array([g.com, g.com, g.height]) * rate**2
            dx = np.array([g.com_rate, g.com_rate, g.height_rate]) * rate
            if self.ff == "force":
                force = f.sum(0) + fT.sum(0) + mass * grav
                moment = np.cross(arms, f).sum(0) + mT
                if self.ideal:
                    aT = axes * plan.thrust[step][:, None]
                    force = force - fT.sum(0) + aT.sum(0)
                    moment = moment - mT + np.cross(data.site_xpos[sim.jets] - com, aT).sum(0)
            else:
                force = mass * plan.com_acceleration[step]
                moment = plan.angular_momentum_rate[step]
            force = force - mass * (kx * self._xi[:3] + dx * self._xi[3:6])
            moment = moment - g.spin_rate * rate * self._xi[9:12]
        A.append(M[:3] / mass)
        a.append((force - h[:3] - mass * grav) / mass)
        W.append(np.full(3, w.com / u.gravity**2))
        A.append(R @ M[3:6] - S @ M[:3])
        a.append(moment - (R @ h[3:6] - S @ h[:3]) )
        W.append(np.full(3, w.spin / u.moment**2))
        AR = np.zeros((3, N))
        AR[:, 3:6] = R
        turn = rotation_vector(plan.rotation[step] @ R.T)
        A.append(AR)
        a.append(plan.base_acceleration[step, 3:] + g.base * rate**2 * turn + g.base_rate * rate * (plan.base_velocity[step, 3:] - R @ v[3:6]))
        W.append(np.full(3, (w.base if active else w.base_in_flight) / rate**4))
        As = np.zeros((n, N))
        As[:, 6:] = np.eye(n)
        A.append(As)
        a.append(plan.joint_accelerations[step] + g.joint * rate**2 * (plan.joints[step] + self._shift - state.joint_positions) + g.joint_rate * rate * (plan.joint_velocities[step] - state.joint_velocities))
        W.append((np.where(self._legs, w.legs, w.others) if active else np.full(n, w.flying)) / rate**4)
        self.dbg = (A, a, W)
        A_, a_, W_ = np.vstack(A), np.concatenate(a), np.concatenate(W)
        nf = 3 * len(active)
        size = N + nf
        H, q = np.zeros((size, size)), np.zeros(size)
        WA = W_[:, None] * A_
        H[:N, :N] = A_.T @ WA
        q[:N] = -a_ @ WA
        ff = w.force / u.force**2
        H[range(N, size), range(N, size)] += ff
        q[N:] = -ff * plan.contact_forces[step][active].ravel()
        J = np.vstack(Jc) if Jc else np.zeros((0, N))
        T = np.hstack([M[6:], -J.T[6:]])
        t0 = h[6:] - Fj[6:]
        wt = w.torque / u.moment**2
        H += wt * T.T @ T
        q += wt * t0 @ T
        H[range(N), range(N)] += 1e-6
        Aeq = np.hstack([M[:6], -J.T[:6]])
        beq = Fj[:6] - h[:6]
        K = len(self._cone)
        limited = np.isfinite(self._limits)
        rows = np.zeros((K * len(active) + int(limited.sum()), size))
        for i in range(len(active)):
            rows[K * i : K * i + K, N + 3 * i : N + 3 * i + 3] = self._cone
        rows[K * len(active) :] = T[limited]
        lower = np.concatenate([np.full(K * len(active), -np.inf), (-self._limits - t0)[limited]])
        upper = np.concatenate([np.zeros(K * len(active)), (self._limits - t0)[limited]])
        import time as clock
        started = clock.process_time()
        x = self._quadratic(H, q, Aeq, beq, rows, lower, upper)
        self.solve_time += clock.process_time() - started
        if x is None:
            self.failures += 1
            tau = np.clip(t0, -self._limits, self._limits)
            return tau, plan.joint_accelerations[step]
        tau = np.clip(T @ x + t0, -self._limits, self._limits)
        return tau, x[6:N]

    def _quadratic(self, H, q, A, b, rows, lower, upper):
        piqp = solver_module()
        solver = piqp.DenseSolver()
        s = solver.settings
        s.verbose = False
        s.compute_timings = False
        s.eps_abs = 1e-5
        s.eps_rel = 1e-5
        s.max_iter = 60
        u, N = self._units, 6 + len(self._robot.joint_names)
        D = np.concatenate([np.full(3, u.gravity), np.full(N - 3, u.frequency**2), np.full(len(q) - N, u.force)])
        E = np.repeat([u.force, u.moment], 3)
        F = np.full(len(rows), u.force)
        F[len(rows) - int(np.isfinite(self._limits).sum()) :] = u.moment
        solver.setup(
            np.asfortranarray(D[:, None] * H * D), D * q, np.asfortranarray(A * D / E[:, None]), b / E,
            np.asfortranarray(rows * D / F[:, None]), lower / F, upper / F)
        status = solver.solve()
        self.iters = getattr(self, "iters", 0) + solver.result.info.iter
        if status != piqp.PIQP_SOLVED:
            self.status = status
            if status != piqp.PIQP_MAX_ITER_REACHED:
                return None
        return D * solver.result.x

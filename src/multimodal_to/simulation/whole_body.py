"""The whole-body controller: a quadratic program, 500 times a second, for accelerations and contact forces.

With ν̇ the accelerations of base and joints, f the forces at the contact points and T the thrusts as they are,

    min Σ_i w_i ‖A_i ν̇ − a_i‖² + w_f ‖f − f*‖²   subject to   M ν̇ + h = Jᵀ f + J_Tᵀ T + τ,

with f within the friction cones and the torques τ, which act on the joints alone, within the effort limits. The tasks i
are the momentum's rate, the base's attitude, the feet and the posture; each a_i is that of the plan and a feedback.
Pushes that the plan knows of stand beside the thrusts.

Forces are allowed at all points of a foot that the plan loads and that is near the ground, and not only where it
touches: else a foot that comes down on its heel stays there. Throttles come from `look_ahead`, and with them what the
joints between base and jets add to their posture.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from types import ModuleType

import numpy as np
from numpy.typing import NDArray

from multimodal_to.adam.spatial import Array
from multimodal_to.arguments import checked
from multimodal_to.errors import OutputError
from multimodal_to.models.robot import Robot
from multimodal_to.models.state import State
from multimodal_to.models.terrain import FlatGround, Surface, frame_function
from multimodal_to.models.units import Sized, Units
from multimodal_to.scenarios.data import stored
from multimodal_to.simulation.controller import Belief, Command, Servos, row_of, servo
from multimodal_to.simulation.feet import PlannedFeet
from multimodal_to.simulation.known import Known
from multimodal_to.simulation.look_ahead import Advice, Feedback, LookAhead
from multimodal_to.simulation.model import mujoco_module
from multimodal_to.simulation.reference import Reference, reference
from multimodal_to.simulation.stabiliser import rotation_vector, skew
from multimodal_to.simulation.turbines import around
from multimodal_to.trajectory import Trajectory

PERIOD = 2e-3  # between two commands [s]
NEAR = 3.5e-3
"""A foot that the plan loads may push while it is nearer to the ground than this [L]: 2 mm of the iRonCub."""
STUCK = Sized(0.02, "s")  # how long a foot counts as near after it was so
SOON = Sized(0.25, "s")  # how long before it is loaded a foot that is near counts as standing
LOADED = 0.01  # a foot with more planned load than this stands [m g]
DOWN = 0.0126  # how fast a foot goes on down that should stand already [√(g L)]
SIDES = 8  # of the pyramid within a friction cone
FAN = np.stack([trig(2.0 * np.pi * (np.arange(SIDES) + 0.5) / SIDES) for trig in (np.cos, np.sin)], axis=1)
"""Where the sides of the pyramid point, along the two tangents of the ground, (sides, 2)."""
FRICTION_SHARE = 0.97  # of the friction coefficient that is used [1]
ACCURACY, ITERATIONS = 1e-5, 60  # of the program's solution, in the robot's own units [1]
JOINT_LAG = 0.03  # with which joints take over the wish of the look-ahead [s]


@dataclass(frozen=True, kw_only=True)
class WholeBodyGains:
    """The feedback of the whole-body controller, in the robot's own units: m, g and L, its CoM's height at home."""

    com: float = 0.95  # level CoM [g/L]
    com_rate: float = 1.95  # [√(g/L)]
    height: float = 3.5  # CoM along gravity [g/L]
    height_rate: float = 3.7  # [√(g/L)]
    spin_rate: float = 1.2  # angular momentum [√(g/L)]
    base: float = 1.15  # attitude of the base [g/L]
    base_rate: float = 1.87  # [√(g/L)]
    foot: float = 17.6  # of a foot that swings [g/L]
    foot_rate: float = 8.5  # [√(g/L)]
    stance_rate: float = 3.7  # of a foot that stands [√(g/L)]
    joint: float = 53.0  # posture [g/L]
    joint_rate: float = 14.6  # [√(g/L)]
    stiffness: float = 0.35  # K of each joint's servo [m g L/rad]
    damping: float = 0.052  # D of each joint's servo [m g L √(L/g)/rad]
    look_ahead: LookAhead = field(default_factory=LookAhead)


@dataclass(frozen=True, kw_only=True)
class Weights:
    """How much the square of an error of the robot's own units counts: g, g/L, m g or m g L."""

    com: float = 7.1
    spin: float = 26.0  # of the angular momentum's rate
    base: float = 4.5
    base_in_flight: float = 0.006
    stance: float = 147.0  # of feet that stand
    foot: float = 4.3  # of feet that swing
    foot_soon: float = 0.1  # in flight, of a foot that comes down soon
    legs: float = 0.0013  # posture of the joints that carry feet, while one stands
    others: float = 0.75  # posture of the other joints
    flying: float = 0.9  # posture in flight
    force: float = 0.31  # of contact forces away from the plan's
    torque: float = 0.004


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
class _Task:
    """w ‖A ν̇ − a‖², a weight for each row."""

    matrix: Array  # A, (rows, 6 + n)
    wanted: Array  # a, (rows,)
    weight: Array  # w, (rows,)


@dataclass(frozen=True, kw_only=True, eq=False)
class _Contacts:
    """The points that may push."""

    points: list[int]  # of the robot's contact points
    jacobian: Array  # (3 points, 6 + n)
    cones: Array  # rows of what is at most zero, (rows, 3 points)


class _Ground:
    """d, n and t of the ground at the contact points, through buffers: to convert arrays would take most of the time.

    Args:
        surface: of the ground.
        count: of the contact points.
    """

    def __init__(self, surface: Surface, count: int) -> None:
        self._points = np.zeros((count, 3))
        self.heights = np.zeros(count)  # d [m]
        self.normals = np.zeros((count, 3))  # n
        self.tangents = np.zeros((count, 2, 3))  # t
        self._buffer, self._evaluate = frame_function(surface).map(count).buffer()
        self._buffer.set_arg(0, self._points.data)
        for index, array in enumerate((self.heights, self.normals, self.tangents)):
            self._buffer.set_res(index, array.data)

    def look(self, points: Array) -> None:
        """Find what lies below points in the world [m], (points, 3)."""
        self._points[:] = points
        self._evaluate()


class WholeBodyController:
    """A quadratic program for accelerations and contact forces, on top of soft joint servos.

    Args:
        gains: its feedback.
        weights: how much each task counts.
    """

    @checked
    def __init__(self, gains: WholeBodyGains | None = None, weights: Weights | None = None) -> None:
        self._gains, self._weights = gains or WholeBodyGains(), weights or Weights()
        self._since = 0.0
        self._robot: Robot | None = None
        self._belief: Belief
        self._plan: Reference
        self._feet: PlannedFeet
        self._feedback: Feedback
        self._known: Known
        self._units: Units
        self._ground: _Ground | None
        self._slope: float
        self._loaded: NDArray[np.bool_]
        self._soon: NDArray[np.bool_]
        self._legs: NDArray[np.bool_]
        self._servo: tuple[Array, Array]
        self._shift: Array
        self._near: Array
        self._torques: Array

    @property
    def period(self) -> float:
        """Return the time between two commands [s]."""
        return PERIOD

    @checked
    def reset(self, robot: Robot, plan: Trajectory, since: float) -> None:
        """Follow a plan from now on; what the joints have been shifted by stays.

        Args:
            robot: that moves.
            plan: its motion.
            since: when the plan's first knot is or was, since the simulation's start [s].
        """
        first, self._robot, self._since = self._robot is None, robot, since
        self._units, self._belief = robot.units, Belief.of(robot, plan, None if first else self._belief)
        self._plan = reference(robot, plan, np.arange(0.0, plan.duration + 2 * PERIOD, PERIOD))
        self._known = Known.of(robot, plan)
        self._feedback = Feedback(self._belief, self._plan, PERIOD, self._gains.look_ahead, self._known)
        self._feet = self._feedback.feet
        scenario = stored(plan)
        surface = FlatGround() if scenario is None else scenario.surface
        self._ground = _Ground(surface, len(robot.contacts)) if robot.contacts else None
        self._slope = FRICTION_SHARE * self._belief.friction * np.cos(np.pi / SIDES)
        self._loaded, self._soon = self._when_loaded()
        self._legs = self._joints_of_feet()
        count, units = len(robot.joint_names), self._units
        self._servo = servo(units, count, self._gains.stiffness, self._gains.damping)
        if first:
            self._shift, self._torques = np.zeros(count), np.zeros(count)
            self._near = np.full(len(robot.feet), -np.inf)  # when each foot was near the ground last [s]

    def _when_loaded(self) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
        """Return when the plan loads each foot, and when it does soon, (feet, steps) each."""
        loaded = self._feet.load > LOADED * self._units.force
        steps = np.arange(loaded.shape[1])
        before = np.cumsum(np.pad(loaded, ((0, 0), (1, 0))), axis=1)
        ends = np.minimum(steps + round(SOON.of(self._units) / PERIOD) + 1, steps.size)
        return loaded, before[:, ends] > before[:, steps]

    def _joints_of_feet(self) -> NDArray[np.bool_]:
        """Return which joints are between the base and a foot, (n,)."""
        simulation, found = self._belief.simulation, np.zeros(self._belief.of_joints.shape[1] - 6, dtype=bool)
        self._belief.put_plan(self._plan, 0)
        mujoco_module().mj_fwdPosition(simulation.model, self._belief.data)
        for own, body in zip(self._feet.members, self._feet.bodies, strict=True):
            middle = self._belief.data.geom_xpos[simulation.points[own]].mean(axis=0)
            found |= np.abs(self._jacobian(middle, body)[:, 6:]).max(axis=0) > 1e-9
        return found

    @checked
    def command(self, state: State, time: float) -> Command:
        """Return what the robot shall do.

        Args:
            state: as it was measured.
            time: since the simulation's start [s].
        """
        assert self._robot is not None
        self._belief.put(state)
        plan, step = self._plan, row_of(time - self._since, PERIOD, self._plan)
        advice = self._feedback.advise(state, step)
        self._shift = self._shift + (advice.joints - self._shift) * PERIOD / JOINT_LAG
        self._torques = self._solve(state, step, time, advice)
        servos = Servos(
            positions=plan.joints[step] + self._shift,
            velocities=plan.joint_velocities[step],
            stiffness=self._servo[0],
            damping=self._servo[1],
        )
        return Command(
            torques=self._torques, throttle=around(self._robot.jets, plan, step, advice.throttle), servos=servos
        )

    def _solve(self, state: State, step: int, time: float, advice: Advice) -> Array:
        """Return the torques of the joints [N m or N], (n,).

        Args:
            state: as it was measured.
            step: row of the plan.
            time: since the simulation's start [s].
            advice: what the feedback along the plan sees.
        """
        mass, bias = self._belief.mass_matrix(), self._belief.of_joints.T @ self._belief.data.qfrc_bias
        feet, contacts = self._feet_and_contacts(step, time, advice.footing)
        stands = bool(contacts.points)
        tasks = [
            *feet,
            *self._momentum(mass, bias, step, advice.errors),
            self._attitude(step, stands),
            self._posture(state, step, stands),
        ]
        pushed = self._known.generalised(self._belief.simulation, self._belief.data, time - self._since)
        outside = self._of_thrusts(state) + pushed @ self._belief.of_joints
        return self._least(tasks, contacts, mass, bias - outside, step)

    def _jacobian(self, point: Array, body: int) -> Array:
        """Return that of a body's point and its turning, in (ṗ, ω in the base's axes, ṡ), (6, 6 + n)."""
        model = self._belief.simulation.model
        both = np.zeros((6, model.nv))
        mujoco_module().mj_jac(model, self._belief.data, both[:3], both[3:], point, body)
        return np.asarray(both @ self._belief.of_joints)

    def _of_thrusts(self, state: State) -> Array:
        """Return J_Tᵀ T, (6 + n,)."""
        return np.asarray(self._belief.of_thrusts(state.thrust) @ self._belief.of_joints)

    def _feet_and_contacts(self, step: int, time: float, footing: Array) -> tuple[list[_Task], _Contacts]:
        """Return the tasks of the feet and which points may push.

        Args:
            step: row of the plan.
            time: since the simulation's start [s].
            footing: by how much the plan is followed beside itself [m], (3,).
        """
        simulation, data, feet, units = self._belief.simulation, self._belief.data, self._feet, self._units
        standing, swinging = list[_Task](), list[tuple[Array, Array, bool]]()
        points, jacobians, cones = list[int](), list[Array](), list[Array]()
        if self._ground is None:
            return [], self._contacts(points, jacobians, cones)
        positions = data.geom_xpos[simulation.points]
        ground = self._ground
        ground.look(positions)
        for foot, (own, body) in enumerate(zip(feet.members, feet.bodies, strict=True)):
            loaded, soon = bool(self._loaded[foot, step]), bool(self._soon[foot, step])
            lowest = float(ground.heights[own].min())
            if lowest < 0.2 * NEAR * units.length:
                self._near[foot] = time
            close = lowest < NEAR * units.length or time - self._near[foot] < STUCK.of(units)
            middle = positions[own].mean(axis=0)
            jacobian, moving, turn = self._motion(foot, step, middle, body)
            speed, drift = moving
            if close and (loaded or (soon and feet.velocity[foot, step, 2] < DOWN * units.length * units.frequency)):
                standing.append(self._standing(jacobian, speed, drift, turn, sole=len(own) > 2))
                points.extend(own.tolist())
                of_points = jacobian[:3] - _skews(positions[own] - middle) @ jacobian[3:]
                jacobians.append(of_points.reshape(3 * len(own), -1))
                cones.append(FAN @ ground.tangents[own] - self._slope * ground.normals[own, None])
            else:
                error = np.concatenate([feet.middle[foot, step] + footing - middle, turn])
                swinging.append((jacobian, self._swing(foot, step, error, speed, late=loaded) - drift, soon))
        weights = self._weights
        for jacobian, wanted, soon in swinging:
            weight = weights.foot if points else weights.foot_soon * soon
            standing.append(_Task(matrix=jacobian, wanted=wanted, weight=self._weight(weight)))
        return standing, self._contacts(points, jacobians, cones)

    def _motion(self, foot: int, step: int, middle: Array, body: int) -> tuple[Array, tuple[Array, Array], Array]:
        """Return a foot's Jacobian, its velocity and J̇ ν, and how far it is turned from the plan [rad].

        Args:
            foot: its number.
            step: row of the plan.
            middle: of its contact points [m], (3,).
            body: MuJoCo's number of it.
        """
        model, data = self._belief.simulation.model, self._belief.data
        rate = np.zeros((6, model.nv))
        mujoco_module().mj_jacDot(model, data, rate[:3], rate[3:], middle, body)
        turn = rotation_vector(self._feet.rotation[foot, step] @ data.xmat[body].reshape(3, 3).T)
        both = np.zeros((6, model.nv))
        mujoco_module().mj_jac(model, data, both[:3], both[3:], middle, body)
        return both @ self._belief.of_joints, (both @ data.qvel, rate @ data.qvel), turn

    def _weight(self, weight: float) -> Array:
        """Return a weight of linear and turning accelerations, (6,), from that in the robot's own units."""
        return weight * np.repeat([self._units.gravity**-2, self._units.frequency**-4], 3)

    def _standing(self, jacobian: Array, speed: Array, drift: Array, turn: Array, *, sole: bool) -> _Task:
        """Return the task of a foot that stands: it comes to rest; a sole is level where the plan has it so.

        Args:
            jacobian: of the foot.
            speed: its velocity [m/s, rad/s], (6,).
            drift: J̇ ν, (6,).
            turn: how far it is turned from the plan [rad], (3,).
            sole: it has three points or more; a foot of fewer may turn on the ground.
        """
        rate = self._gains.stance_rate * self._units.frequency
        wanted = -rate * speed
        wanted[3:5] += 0.25 * rate**2 * turn[:2]
        rows = slice(6 if sole else 3)
        return _Task(
            matrix=jacobian[rows], wanted=(wanted - drift)[rows], weight=self._weight(self._weights.stance)[rows]
        )

    def _swing(self, foot: int, step: int, error: Array, speed: Array, *, late: bool) -> Array:
        """Return the acceleration of a foot in the air [m/s², rad/s²], (6,).

        Args:
            foot: its number.
            step: row of the plan.
            error: from where it is to the plan [m, rad], (6,).
            speed: its velocity [m/s, rad/s], (6,).
            late: it should stand already.
        """
        gains, units, feet = self._gains, self._units, self._feet
        damping = gains.foot_rate * units.frequency
        wanted = feet.acceleration[foot, step] + gains.foot * units.frequency**2 * error
        wanted = wanted + damping * (feet.velocity[foot, step] - speed)
        if late:
            wanted[2] = damping * (-DOWN * units.length * units.frequency - speed[2])
        return np.asarray(wanted)

    def _contacts(self, points: list[int], jacobians: list[Array], cones: list[Array]) -> _Contacts:
        """Return the points that may push.

        Args:
            points: their numbers.
            jacobians: of the points of each foot, (3 points, 6 + n) each.
            cones: rows C of C f ≤ 0 of the points of each foot, (points, sides, 3) each.
        """
        count, columns = len(points), self._belief.of_joints.shape[1]
        rows = np.zeros((count, SIDES, count, 3))
        if count:
            rows[range(count), :, range(count)] = np.concatenate(cones)
        return _Contacts(
            points=points,
            jacobian=np.concatenate([np.zeros((0, columns)), *jacobians]),
            cones=rows.reshape(SIDES * count, 3 * count),
        )

    def _momentum(self, mass: Array, bias: Array, step: int, errors: Array) -> tuple[_Task, _Task]:
        """Return the tasks of the momentum's rates.

        Args:
            mass: M.
            bias: h.
            step: row of the plan.
            errors: of CoM, its velocity, the attitude and the angular momentum.
        """
        gains, units, plan, data = self._gains, self._units, self._plan, self._belief.data
        turn, arm, rate = self._belief.rotation, skew(data.subtree_com[1] - data.xpos[1]), units.frequency
        gravity = self._belief.simulation.robot.gravity
        stiffness = np.array([gains.com, gains.com, gains.height]) * rate**2
        damping = np.array([gains.com_rate, gains.com_rate, gains.height_rate]) * rate
        linear = plan.com_acceleration[step] - stiffness * errors[:3] - damping * errors[3:6]
        angular = plan.angular_momentum_rate[step] - gains.spin_rate * rate * errors[9:12]
        return (
            _Task(
                matrix=mass[:3] / units.mass,
                wanted=linear - bias[:3] / units.mass - gravity,
                weight=np.full(3, self._weights.com / units.gravity**2),
            ),
            _Task(
                matrix=turn @ mass[3:6] - arm @ mass[:3],
                wanted=angular - (turn @ bias[3:6] - arm @ bias[:3]),
                weight=np.full(3, self._weights.spin / units.moment**2),
            ),
        )

    def _attitude(self, step: int, stands: bool) -> _Task:
        """Return the task of the base's attitude."""
        gains, plan, rate, turn = self._gains, self._plan, self._units.frequency, self._belief.rotation
        matrix = np.zeros((3, self._belief.of_joints.shape[1]))
        matrix[:, 3:6] = turn
        away = rotation_vector(plan.rotation[step] @ turn.T)
        slow = plan.base_velocity[step, 3:] - turn @ self._belief.data.qvel[3:6]
        wanted = plan.base_acceleration[step, 3:] + gains.base * rate**2 * away + gains.base_rate * rate * slow
        weight = self._weights.base if stands else self._weights.base_in_flight
        return _Task(matrix=matrix, wanted=wanted, weight=np.full(3, weight / rate**4))

    def _posture(self, state: State, step: int, stands: bool) -> _Task:
        """Return the task of the joints.

        Args:
            state: as it was measured.
            step: row of the plan.
            stands: a foot stands.
        """
        gains, plan, rate, weights = self._gains, self._plan, self._units.frequency, self._weights
        count = self._shift.size
        away = plan.joints[step] + self._shift - state.joint_positions
        slow = plan.joint_velocities[step] - state.joint_velocities
        wanted = plan.joint_accelerations[step] + gains.joint * rate**2 * away + gains.joint_rate * rate * slow
        weight = np.where(self._legs, weights.legs, weights.others) if stands else np.full(count, weights.flying)
        return _Task(matrix=np.eye(count, count + 6, 6), wanted=wanted, weight=weight / rate**4)

    def _least(self, tasks: list[_Task], contacts: _Contacts, mass: Array, bias: Array, step: int) -> Array:
        """Return the torques of the program's solution [N m or N], (n,).

        Its unknowns are ν̇ and f in the robot's own units, so that all are about as large.

        Args:
            tasks: what is wanted of ν̇.
            contacts: the points that may push.
            mass: M.
            bias: h − J_Tᵀ T, and less what pushes do.
            step: row of the plan.
        """
        units, size = self._units, len(mass)
        count, pairs = 3 * len(contacts.points), len(contacts.cones)
        scale = np.repeat([units.gravity, units.frequency**2, units.force], [3, size - 3, count])
        matrix = np.concatenate([task.matrix for task in tasks]) * scale[:size]
        weighted = np.concatenate([task.weight for task in tasks])[:, None] * matrix
        wanted = np.concatenate([task.wanted for task in tasks])
        equations = np.hstack([mass, -contacts.jacobian.T]) * scale
        torques, offset, limits = equations[6:] / units.moment, bias[6:] / units.moment, self._limits() / units.moment
        hessian = self._weights.torque * torques.T @ torques
        gradient = self._weights.torque * offset @ torques
        hessian[:size, :size] += matrix.T @ weighted
        gradient[:size] -= wanted @ weighted
        of_force = self._weights.force
        hessian[range(size + count), range(size + count)] += np.repeat([1e-6, of_force], [size, count])
        gradient[size:] -= of_force * self._plan.contact_forces[step][contacts.points].ravel() / units.force
        share = np.repeat([units.force, units.moment], 3)
        limited = np.isfinite(limits)
        rows = np.zeros((pairs + int(limited.sum()), size + count))
        rows[:pairs, size:], rows[pairs:] = contacts.cones, torques[limited]
        lower = np.concatenate([np.full(pairs, -np.inf), (-limits - offset)[limited]])
        upper = np.concatenate([np.zeros(pairs), (limits - offset)[limited]])
        found = _quadratic(hessian, gradient, equations[:6] / share[:, None], -bias[:6] / share, rows, lower, upper)
        if found is None:  # no forces hold it; the servos do what they can
            return np.asarray(np.clip(self._torques, -self._limits(), self._limits()))
        return np.asarray(np.clip((torques @ found + offset) * units.moment, -self._limits(), self._limits()))

    def _limits(self) -> Array:
        assert self._robot is not None
        return np.asarray(self._robot.joint_limits.effort)


def _skews(vectors: Array) -> Array:
    """Return `skew` of each of some vectors, (vectors, 3, 3)."""
    (x, y, z), zero = vectors.T, np.zeros(len(vectors))
    return np.array([[zero, -z, y], [z, zero, -x], [-y, x, zero]]).transpose(2, 0, 1)


def _quadratic(
    hessian: Array, gradient: Array, equal: Array, to: Array, rows: Array, lower: Array, upper: Array
) -> Array | None:
    """Return x of least ½ xᵀ H x + gᵀ x with A x = b and l ≤ C x ≤ u; None where there is none.

    Args:
        hessian: H.
        gradient: g.
        equal: A.
        to: b.
        rows: C.
        lower: l.
        upper: u.
    """
    piqp = solver_module()
    solver = piqp.DenseSolver()
    solver.settings.verbose = False
    solver.settings.eps_abs = solver.settings.eps_rel = ACCURACY
    solver.settings.max_iter = ITERATIONS
    bounds = (np.asfortranarray(rows), lower, upper) if len(rows) else (None, None, None)
    solver.setup(np.asfortranarray(hessian), gradient, np.asfortranarray(equal), to, *bounds)
    status = solver.solve()
    if status not in (piqp.PIQP_SOLVED, piqp.PIQP_MAX_ITER_REACHED):
        return None
    return np.array(solver.result.x)

"""The plan's controls through an accurate integrator: how far the robot that they move is from the plan.

The robot is a floating base whose joints follow the file. Its state is y = (x, ẋ, hω, ρ, T, Ṫ):

m ẍ = m g + Σ f_i + Σ f_j,  ḣω = Σ (p_i − x) × f_i + Σ r_j × f_j,  ω = R I⁻¹ (Rᵀ hω − A ṡ),  T̈ by the turbine's model.

Contact forces f_i and throttles are constant over an interval, and are those that its end holds. Under leapfrog they
are constant from half an interval before their knot to half an interval after it. Each f_i acts in the world where the
file has its point p_i. Thrusts f_j turn with the base: r_j and their directions are those of the frames on the base
that is integrated. I and A are the angular part of J_CMM in base axes, at the file's joints. Between the
knots joints and points follow a cubic spline, whose error is small beside that of any rule here.

No motion like this is stable without a controller. So the state starts again from the file at every knot, and runs for
`STRETCH` √(L/g), in which an inverted pendulum of length L gains a factor of e².
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import casadi as cs
import numpy as np
from numpy.typing import NDArray

from multimodal_to.adam.spatial import Array
from multimodal_to.auditing.findings import Motion, Worst, worst_of
from multimodal_to.models.attitude import continuous
from multimodal_to.models.jet import FirstOrder, StaticMap
from multimodal_to.models.robot import Robot
from multimodal_to.models.units import Sized
from multimodal_to.trajectory import Trajectory, rules

Indices = NDArray[np.intp]
STRETCH = 2.0
"""For how long the integrator runs from a knot, in √(L/g): 0.48 s for the iRonCub."""
_LARGEST_STEP = Sized(0.05, "s")  # of the integrator; its own error is then below 1e-5 m and 1e-4 rad
_X, _V, _H, _RHO, _THRUSTS = slice(0, 3), slice(3, 6), slice(6, 9), slice(9, 13), 13
"""Where the parts of a state are; T and Ṫ of all jets follow from `_THRUSTS` on."""


def integrator_findings(motion: Motion) -> list[Worst]:
    """Compare a motion with that of its controls, over a stretch from every knot, and its CoM over the horizon."""
    controls = Controls.of(motion)
    time, knots = motion.trajectory.time, motion.trajectory.knots
    stretch = STRETCH * natural_time(motion.robot)
    com, base = np.zeros(knots + 1), np.zeros(knots + 1)
    starts, count = np.arange(knots), 0
    state = controls.starts[:-1]
    while starts.size:  # those whose stretch is not over, nor the horizon
        state = controls.advanced(state, starts + count)
        count += 1
        ends = starts + count
        off_com, off_base = controls.distances(state, ends)
        np.maximum.at(com, ends, off_com)
        np.maximum.at(base, ends, off_base)
        following = np.minimum(ends + 1, knots)
        middle = 0.5 * (time[ends] + time[following])  # a stretch ends at the knot that is nearest to its length
        going = (ends < knots) & (middle - time[starts] < stretch)
        starts, state = starts[going], state[going]
    with np.errstate(all="ignore"):
        gaps = np.linalg.norm(controls.com_under_given_thrusts() - motion.trajectory.com_position.T, axis=1)
    return [
        worst_of("CoM off integrator, stretch", com),
        worst_of("base off integrator, stretch", base),
        worst_of("CoM off integrator, horizon", np.nan_to_num(gaps, nan=np.inf)),
    ]


def natural_time(robot: Robot) -> float:
    """Return √(L/g) [s], the time in which an inverted pendulum of the robot's standing height falls by a factor of e.

    Without gravity it is that under the Earth's.
    """
    return robot.units.of("s")


@dataclass(frozen=True, kw_only=True, eq=False)
class Controls:
    """What a file prescribes, at the instants that the integrator visits: `steps` an interval, and their middles.

    Instants count from the first knot, 2 × `steps` an interval. Vectors are in world axes unless said.
    """

    robot: Robot
    trajectory: Trajectory
    steps: int  # of the integrator, an interval
    points: Array  # p_i, the contact points and what is pushed [m], (instants, contacts + pushes, 3)
    forces: Array  # f_i there [N], (knots + 1, contacts + pushes, 3)
    jets: Array  # r_j, the jets from the CoM, base axes [m], (instants, jets, 3)
    directions: Array  # of the thrusts, base axes [1], (instants, jets, 3)
    drags: Array  # moment of each rotor for each newton of its thrust [m], (jets,)
    inertia_inverse: Array  # I⁻¹ about the CoM, base axes [1/(kg m²)], (instants, 3, 3)
    joint_momentum: Array  # A ṡ, of the joints' motion alone, base axes [kg m²/s], (instants, 3)

    @classmethod
    def of(cls, motion: Motion, steps: int = 0) -> Controls:
        """Return the controls of a motion.

        Args:
            motion: that holds them.
            steps: of the integrator, an interval; by default what `_LARGEST_STEP` asks for. One more where the
                controls change in the middle of an interval and the number is odd.
        """
        robot, trajectory, kindyn = motion.robot, motion.trajectory, motion.robot.kindyn
        lags = [jet.model.time_constant for jet in robot.jets if isinstance(jet.model, FirstOrder)]
        longest = min([_LARGEST_STEP.of(robot.units), *lags])
        steps = steps or max(1, int(np.ceil(np.diff(trajectory.time).max() / longest - 1e-9)))
        steps += steps % 2 if rules.acts_after(trajectory.rule) else 0
        instants = _instants(trajectory.time, 2 * steps)
        count, jets = instants.size, len(robot.jets)
        joints, velocities = spline(trajectory.time, trajectory.joint_positions.T, instants)
        points, _ = spline(
            trajectory.time,
            np.concatenate([motion.points, motion.push_points]).transpose(1, 0, 2).reshape(trajectory.time.size, -1),
            instants,
        )
        base = np.tile(np.eye(4), (1, count))
        com = np.array(kindyn.CoM_position_fun().map(count)(base, joints.T)).T
        frames = np.array([kindyn.forward_kinematics_fun(jet.frame).map(count)(base, joints.T) for jet in robot.jets])
        poses = frames.reshape(jets, 4, count, 4).transpose(2, 0, 1, 3)
        matrices = np.array(kindyn.centroidal_momentum_matrix_fun().map(count)(base, joints.T))
        angular = matrices.reshape(6, count, -1).transpose(1, 0, 2)[:, 3:]
        return cls(
            robot=robot,
            trajectory=trajectory,
            steps=steps,
            points=points.reshape(count, -1, 3),
            forces=np.concatenate([motion.contact_forces, motion.pushes]).transpose(1, 0, 2),
            jets=poses[:, :, :3, 3] - com[:, None],
            directions=-poses[:, :, :3, 2],
            drags=np.array([jet.drag for jet in robot.jets]),
            inertia_inverse=np.linalg.pinv(angular[:, :, 3:6], hermitian=True),
            joint_momentum=np.einsum("kij,kj->ki", angular[:, :, 6:], velocities),
        )

    @cached_property
    def starts(self) -> Array:
        """Return the file's states at the knots, (knots + 1, 13 + 2 jets).

        Where the file has a velocity in the middle of an interval, that of the knot is v + ½ Δt a under what acts from
        there to the knot.
        """
        plan, jets = self.trajectory, len(self.robot.jets)
        names = ("com_position", "com_velocity", "angular_momentum", "base_quaternion_xyzw", "thrust", "thrust_rate")
        states = np.vstack([getattr(plan, name) for name in names]).T
        states[:, _RHO] = continuous(states[:, _RHO].T).T
        knots = np.arange(plan.time.size)
        with np.errstate(all="ignore"):
            slopes = self.slope(states, 2 * self.steps * knots, knots)
        durations = np.diff(plan.time, prepend=2 * plan.time[0] - plan.time[1])
        shares = np.zeros(states.shape[1])
        shares[_V] = shares[_H] = rules.instant(plan.rule, "com_velocity")
        shares[_THRUSTS + jets :] = rules.instant(plan.rule, "thrust_rate")
        return np.asarray(states + np.where(shares, shares * durations[:, None] * slopes, 0.0))

    @cached_property
    def columns(self) -> Indices:
        """Return which column acts in each step of an interval, from that of the interval's start on, (steps,)."""
        shares = (np.arange(self.steps) + 0.5) / self.steps
        return np.asarray(shares > rules.acts_after(self.trajectory.rule), dtype=np.intp)

    def slope(self, states: Array, instants: Indices, columns: Indices) -> Array:
        """Return ẏ of many states at once, (states, 13 + 2 jets).

        Args:
            states: y, (states, 13 + 2 jets).
            instants: at which each is, (states,).
            columns: of the file with the contact forces and throttles that act on each, (states,).
        """
        robot, plan, jets = self.robot, self.trajectory, len(self.robot.jets)
        thrust, rate = states[:, _THRUSTS : _THRUSTS + jets].copy(), states[:, _THRUSTS + jets :]
        for row, jet in enumerate(robot.jets):
            if isinstance(jet.model, StaticMap):
                thrust[:, row] = jet.model.thrust(plan.throttle[row, columns])
        rotation = rotations(states[:, _RHO])
        contacts = self.forces[columns]
        thrusts = thrust[:, :, None] * np.einsum("sij,scj->sci", rotation, self.directions[instants])
        arms = np.einsum("sij,scj->sci", rotation, self.jets[instants])
        acceleration = robot.gravity + (contacts.sum(axis=1) + thrusts.sum(axis=1)) / robot.mass
        moment = np.cross(self.points[instants] - states[:, None, _X], contacts).sum(axis=1)
        moment = moment + (np.cross(arms, thrusts) + self.drags[:, None] * thrusts).sum(axis=1)
        within = np.einsum("sji,sj->si", rotation, states[:, _H]) - self.joint_momentum[instants]
        turn = np.einsum("sij,sj->si", self.inertia_inverse[instants], within)
        omega = np.einsum("sij,sj->si", rotation, turn)
        vector, scalar = states[:, 9:12], states[:, 12:13]
        turning = 0.5 * np.hstack([scalar * omega + np.cross(omega, vector), -(omega * vector).sum(1, keepdims=True)])
        spooling, slope = np.zeros_like(thrust), np.zeros_like(thrust)
        for row, jet in enumerate(robot.jets):
            slopes = jet.model.slopes(thrust[:, row], rate[:, row], plan.throttle[row, columns])
            slope[:, row], spooling[:, row] = slopes
        return np.hstack([states[:, _V], acceleration, moment, turning, slope, spooling])

    def advanced(self, states: Array, intervals: Indices) -> Array:
        """Return states after an interval each, by the method of Runge and Kutta of order four.

        What runs away becomes infinite or no number, without a warning.

        Args:
            states: at the starts of the intervals, (states, 13 + 2 jets).
            intervals: which interval each goes through, (states,).
        """
        step = (np.diff(self.trajectory.time)[intervals] / self.steps)[:, None]
        with np.errstate(all="ignore"):
            for index in range(self.steps):
                first, columns = 2 * (intervals * self.steps + index), intervals + self.columns[index]
                k1 = self.slope(states, first, columns)
                k2 = self.slope(states + 0.5 * step * k1, first + 1, columns)
                k3 = self.slope(states + 0.5 * step * k2, first + 1, columns)
                k4 = self.slope(states + step * k3, first + 2, columns)
                states = states + step / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
        return states

    def distances(self, states: Array, knots: Indices) -> tuple[Array, Array]:
        """Return how far states are from the file: of the CoM [m] and of the base's attitude [rad], (states,) each.

        Args:
            states: y, (states, 13 + 2 jets).
            knots: at which each is, (states,).
        """
        with np.errstate(all="ignore"):
            com = np.linalg.norm(states[:, _X] - self.trajectory.com_position[:, knots].T, axis=1)
            base = angles(states[:, _RHO], self.trajectory.base_quaternion_xyzw[:, knots].T)
        return np.nan_to_num(com, nan=np.inf), np.nan_to_num(base, nan=np.inf)

    def com_under_given_thrusts(self) -> Array:
        """Return the CoM at the knots by m ẍ = m g + Σ f_i + Σ f_j from the first knot on [m], (knots + 1, 3).

        Thrusts and the base's attitude are the file's, by a cubic spline. So nothing feeds back, and what is left is
        the error of the rule for the CoM. It is a sum by Simpson's rule.
        """
        plan, robot = self.trajectory, self.robot
        instants = _instants(plan.time, 2 * self.steps)
        thrust, _ = spline(plan.time, plan.thrust.T, instants)
        quaternions, _ = spline(plan.time, plan.base_quaternion_xyzw.T, instants)
        thrusts = np.einsum("kij,kcj,kc->ki", rotations(quaternions), self.directions, thrust)
        columns = (np.arange(plan.knots)[:, None] + self.columns).ravel()
        contacts = self.forces.sum(axis=1)[columns]
        step = (np.repeat(np.diff(plan.time), self.steps) / self.steps)[:, None]
        starts, middles, ends = (
            robot.gravity + (contacts + part) / robot.mass for part in (thrusts[:-2:2], thrusts[1::2], thrusts[2::2])
        )
        velocity = np.vstack([self.starts[:1, _V], step / 6.0 * (starts + 4.0 * middles + ends)]).cumsum(axis=0)
        gains = step * velocity[:-1] + step**2 / 6.0 * (starts + 2.0 * middles)
        return np.vstack([self.starts[:1, _X], gains]).cumsum(axis=0)[:: self.steps]


def rotations(quaternions: Array) -> Array:
    """Return world-from-base of quaternions x y z w of any length, (count, 4) → (count, 3, 3)."""
    x, y, z, w = (quaternions / np.linalg.norm(quaternions, axis=1, keepdims=True)).T
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    return np.array(rows).transpose(2, 0, 1)


def angles(first: Array, second: Array) -> Array:
    """Return the angles between attitudes [rad], (count,); quaternions x y z w of any length, (count, 4) each."""
    first, second = (some / np.linalg.norm(some, axis=1, keepdims=True) for some in (first, second))
    second = second * np.where((first * second).sum(axis=1, keepdims=True) < 0.0, -1.0, 1.0)
    return np.asarray(4.0 * np.arctan2(np.linalg.norm(first - second, axis=1), np.linalg.norm(first + second, axis=1)))


def spline(time: Array, values: Array, at: Array) -> tuple[Array, Array]:
    """Return a cubic spline through values and its slope at other times, (count, m) each.

    Its third derivative does not jump at the second knot and the last but one (not-a-knot). With fewer than four knots
    it has no curvature at its ends.

    Args:
        time: of the knots, increasing [s], (knots + 1,).
        values: at the knots, (knots + 1, m).
        at: where it is asked for, within the knots [s], (count,).
    """
    last, h = time.size - 1, np.diff(time)
    slopes, right = np.diff(values, axis=0) / h[:, None], np.zeros_like(values)
    right[1:-1] = 6.0 * np.diff(slopes, axis=0)
    inner = np.arange(1, last)
    rows, columns = np.repeat(inner, 3), (inner[:, None] + [-1, 0, 1]).ravel()
    entries = np.column_stack([h[:-1], 2.0 * (h[:-1] + h[1:]), h[1:]]).ravel()
    if last >= 3:
        ends = [h[1], -h[0] - h[1], h[0], h[-1], -h[-1] - h[-2], h[-2]]
        around = [0, 1, 2, last - 2, last - 1, last]
        rows, columns = np.append(rows, [0, 0, 0, last, last, last]), np.append(columns, around)
    else:
        ends = [1.0, 1.0]
        rows, columns = np.append(rows, [0, last]), np.append(columns, [0, last])
    matrix = cs.DM.triplet(list(rows), list(columns), cs.DM(np.append(entries, ends)), last + 1, last + 1)
    second = np.array(cs.solve(matrix, cs.DM(right), "qr")).reshape(values.shape)  # the second derivatives at the knots
    cell = np.clip(np.searchsorted(time, at, side="right") - 1, 0, last - 1)
    width, past, left = h[cell, None], (at - time[cell])[:, None], (time[cell + 1] - at)[:, None]
    start, end = second[cell], second[cell + 1]
    lower, upper = values[cell] / width - start * width / 6.0, values[cell + 1] / width - end * width / 6.0
    there = (start * left**3 + end * past**3) / (6.0 * width) + lower * left + upper * past
    return there, (end * past**2 - start * left**2) / (2.0 * width) + upper - lower


def _instants(time: Array, parts: int) -> Array:
    """Return the knots' times and those that divide each interval into equal parts [s], (parts × intervals + 1,)."""
    shares = np.arange(parts) / parts
    return np.append((time[:-1, None] + np.diff(time)[:, None] * shares).ravel(), time[-1])

"""A plan played back in MuJoCo by a controller.

A joint's motor gives the torque of the command and what its servo adds, clipped at the joint's effort limit. Turbines
are integrated from their own dynamics under the throttle of the command. Commands act after a delay, servos at once.
Pushes that the plan knows of push the robot, and its jets fail when the plan has them fail.
"""

from __future__ import annotations

import time as clock
from collections import deque
from dataclasses import dataclass

import numpy as np

from multimodal_to.adam.spatial import Array
from multimodal_to.arguments import checked
from multimodal_to.errors import TrajectoryError
from multimodal_to.models.jet import FirstOrder, Jet, StaticMap
from multimodal_to.models.robot import Robot
from multimodal_to.models.state import State
from multimodal_to.simulation.controller import Command, Controller, Servos
from multimodal_to.simulation.disturbance import Disturbance
from multimodal_to.simulation.known import Known
from multimodal_to.simulation.model import TIME_STEP, SimulationModel, mujoco_module
from multimodal_to.simulation.noise import Estimate
from multimodal_to.simulation.reference import Reference, reference
from multimodal_to.simulation.servos import ServoController
from multimodal_to.simulation.stabiliser import rotation_vector
from multimodal_to.simulation.stage import stage
from multimodal_to.trajectory import Trajectory
from multimodal_to.trajectory.conditions import under_conditions
from multimodal_to.trajectory.sameness import refuse_other_robot
from multimodal_to.values import Value

HOLD = 1.0  # how long the end of the plan is held [s]
FALL_TILT = 45.0
"""A base turned away from the plan by more than this has fallen [°]."""
FALL_DEPTH = 0.43
"""A CoM lower than the plan by more than this has fallen [L]."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Playback(Value):
    """What a simulation did: a row for each of its steps, in world axes. A robot that has fallen stays as it is."""

    robot: Robot
    plan: Trajectory
    reference: Reference
    time: Array  # since the start [s], (steps,)
    com: Array  # [m], (steps, 3)
    qpos: Array  # base position, quaternion w x y z, joints in the robot's order, (steps, 7 + n)
    qvel: Array  # ṗ and ω of the base in world axes, ṡ, (steps, 6 + n)
    contact_forces: Array  # on the robot [N], (steps, contacts, 3)
    thrust: Array  # [N], (steps, jets)
    thrust_rate: Array  # [N/s], (steps, jets)
    throttle: Array  # [%], (steps, jets)
    torques: Array  # that the joints' motors give at a step's start, after the clip [N m or N], (steps, n)
    asked_torques: Array  # that the controller asks of them, before the clip [N m or N], (steps, n)
    points: Array  # the contact points [m], (steps, contacts, 3)
    torque_limits: bool  # the clip was at the joints' effort limits; else there was none
    notes: tuple[str, ...]  # where MuJoCo's model differs from the URDF, a sentence each
    fell: float | None  # when [s]
    control_time: float  # that the controller took for a command, in the mean [s]


@checked
def play(
    robot: Robot,
    plan: Trajectory,
    controller: Controller | None = None,
    *,
    disturbance: Disturbance | None = None,
    torque_limits: bool = True,
) -> Playback:
    """Play a plan back on the ground and with the friction of the scenario that it keeps.

    Args:
        robot: that moves.
        plan: its motion, with the scenario that it was solved for where it keeps one.
        controller: what carries it out; by default the `ServoController`.
        disturbance: how the simulated robot differs from that of the plan; by default it does not.
        torque_limits: clip the torque of each joint's motor at its effort limit.

    Raises:
        OutputError: MuJoCo is not installed.
        TrajectoryError: the plan is not one of this robot with these jets.
    """
    refuse_other_robot(plan, robot, what="the plan", error=TrajectoryError)
    robot = under_conditions(robot, plan)
    player = Player(robot, plan, controller or ServoController(), disturbance, torque_limits=torque_limits)
    steps = round((plan.duration + HOLD) / TIME_STEP) + 1
    player.run(reference(robot, plan, TIME_STEP * np.arange(steps, dtype=np.float64)))
    return player.playback()


class Player:
    """A simulation that runs, with everything that changes as it does.

    Args:
        robot: that moves.
        plan: at whose first knot it starts.
        controller: what carries it out.
        disturbance: how the simulated robot differs from that of the plan; by default it does not.
        torque_limits: clip the torque of each joint's motor at its effort limit.
    """

    def __init__(
        self,
        robot: Robot,
        plan: Trajectory,
        controller: Controller,
        disturbance: Disturbance | None = None,
        *,
        torque_limits: bool = True,
    ) -> None:
        self._mujoco = mujoco_module()
        self._simulation: SimulationModel
        self._simulation, _ = stage(robot, plan, torque_limits=torque_limits)
        self._disturbance = disturbance or Disturbance()
        self._disturbance.apply(self._simulation)
        self._plan, self._robot, self._torque_limits = plan, robot, torque_limits
        self._data = self._mujoco.MjData(self._simulation.model)
        self._rows = list[dict[str, Array]]()
        self._reference: Reference
        self._known: Known
        self._since = 0.0
        self._followed = list[Reference]()
        self._down: float | None = None
        self._thrust, self._rate = plan.thrust[:, 0].copy(), plan.thrust_rate[:, 0].copy()
        self._throttle = plan.throttle[:, 0].copy()
        self._motors = self._disturbance.of_motors(robot)
        self._set: Servos | None = None
        self._rest = np.zeros((3, len(robot.joint_names)))  # control, stiffness and damping of the motors
        self._every = max(round(controller.period / TIME_STEP), 1)
        self._late = round(self._disturbance.delay / TIME_STEP)
        self._coming = deque[tuple[int, Command]]()
        self._took, self._commands = 0.0, 0
        noise = self._disturbance.noise
        self._estimate = None if noise is None else Estimate(noise, self._every * TIME_STEP)
        velocity = np.concatenate([plan.base_linear_velocity[:, 0], plan.base_angular_velocity[:, 0]])
        self._simulation.set_state(
            self._data,
            plan.base_position[:, 0],
            plan.base_quaternion_xyzw[:, 0],
            plan.joint_positions[:, 0],
            velocity,
            plan.joint_velocities[:, 0],
        )
        self._controller = controller
        self.follow(plan, 0.0)

    @property
    def steps(self) -> int:
        """Return how many steps have been done."""
        return len(self._rows)

    @property
    def time(self) -> float:
        """Return how much time has been simulated [s]."""
        return TIME_STEP * self.steps

    @property
    def fell(self) -> float | None:
        """Return when the robot fell [s], if it did."""
        return self._down

    def follow(self, plan: Trajectory, since: float) -> None:
        """Let the controller follow a plan from now on, whose first knot is or was at a time since the start [s]."""
        self._known, self._since = Known.of(self._robot, plan), since
        self._controller.reset(self._robot, plan, since)

    def run(self, wanted: Reference) -> None:
        """Go on for as many steps as a reference has rows; a robot that has fallen stays as it is.

        Args:
            wanted: what the plan wants in each of the next steps.
        """
        data, model = self._data, self._simulation.model
        self._reference = wanted
        self._followed.append(wanted)
        push = self._disturbance.push
        for step in range(wanted.com.shape[0]):
            if self._down is not None:
                self._rows.append(self._rows[-1])
                continue
            self._mujoco.mj_step1(model, data)
            data.xfrc_applied[:] = 0.0
            data.xfrc_applied[1, :3] = 0.0 if push is None else push.at(self.time)
            self._known.push(self._simulation, data, self.time - self._since)
            row = self._state()
            if self.steps % self._every == 0:
                self._decide(row)
            row |= self._control()
            self._mujoco.mj_step2(model, data)
            row |= {"contact_forces": self._contact_forces(), "torques": self._torques()}
            self._rows.append(row)
            if self._is_down(step):
                self._down = TIME_STEP * (self.steps - 1)

    def playback(self) -> Playback:
        """Return what the simulation has done so far."""
        return Playback(
            robot=self._robot,
            plan=self._plan,
            reference=Reference.joined(self._followed),
            time=TIME_STEP * np.arange(self.steps, dtype=np.float64),
            fell=self._down,
            torque_limits=self._torque_limits,
            notes=self._simulation.notes,
            control_time=self._took / max(self._commands, 1),
            **{name: np.array([row[name] for row in self._rows]) for name in self._rows[0]},
        )

    def state(self) -> State:
        """Return the state of the robot now."""
        return _as_state(self._state())

    def _state(self) -> dict[str, Array]:
        data, simulation = self._data, self._simulation
        nine = np.zeros(9)
        self._mujoco.mju_quat2Mat(nine, data.qpos[3:7])
        turn = nine.reshape(3, 3)
        return {
            "com": data.subtree_com[1].copy(),
            "qpos": np.concatenate([data.qpos[:7], data.qpos[simulation.joint_positions]]),
            "qvel": np.concatenate([data.qvel[:3], turn @ data.qvel[3:6], data.qvel[simulation.joint_velocities]]),
            "points": data.geom_xpos[simulation.points].copy(),
            "thrust": self._thrust.copy(),
            "thrust_rate": self._rate.copy(),
        }

    def _is_down(self, step: int) -> bool:
        wanted, data = self._reference, self._data
        tilt = np.linalg.norm(rotation_vector(wanted.rotation[step] @ data.xmat[1].reshape(3, 3).T))
        depth = FALL_DEPTH * self._robot.standing_height
        return bool(np.degrees(tilt) > FALL_TILT or wanted.com[step, 2] - data.subtree_com[1, 2] > depth)

    def _decide(self, row: dict[str, Array]) -> None:
        """Let the controller look at the state; its command waits until the delay is over."""
        state = _as_state(row)
        if self._estimate is not None:
            state = self._estimate(state, bool(self._data.ncon))
        started = clock.process_time()
        command = self._controller.command(state, self.time)
        self._took, self._commands = self._took + clock.process_time() - started, self._commands + 1
        self._coming.append((self.steps + self._late, command))

    def _control(self) -> dict[str, Array]:
        """Set motors and thrusts of this step; return throttles and asked torques."""
        data, simulation = self._data, self._simulation
        while self._coming and (self._coming[0][0] <= self.steps or not self.steps):  # the first one acts at once
            self._obey(self._coming.popleft()[1])
        self._turn_turbines()
        control, stiffness, damping = self._rest
        data.ctrl[: control.size], data.ctrl[control.size :] = control, self._thrust
        asked = control - stiffness * data.qpos[simulation.joint_positions]
        asked -= damping * data.qvel[simulation.joint_velocities]
        return {"throttle": self._throttle.copy(), "asked_torques": asked}

    def _obey(self, command: Command) -> None:
        """Let motors and turbines do what a command says."""
        servos, gains = command.servos, self._motors
        control = np.asarray(command.torques, dtype=float)
        if servos is not None:
            control = control + servos.stiffness * servos.positions + servos.damping * servos.velocities
            self._rest[1:] = gains * servos.stiffness, gains * servos.damping
        else:
            self._rest[1:] = 0.0
        self._rest[0] = gains * control
        self._simulation.set_servos(self._rest[1], self._rest[2])
        for index, jet in enumerate(self._robot.jets):
            self._throttle[index] = min(max(float(command.throttle[index]), jet.throttle_min), jet.throttle_max)

    def _turn_turbines(self) -> None:
        """Integrate the thrusts over a step; one that has failed gets no more fuel than it must, or never lit."""
        works = self._known.works(self.time - self._since)
        for index, jet in enumerate(self._robot.jets):
            if not works[index]:
                self._throttle[index] = jet.throttle_min
            if self._known.unlit[index]:
                self._thrust[index], self._rate[index] = 0.0, 0.0
                continue
            state = float(self._thrust[index]), float(self._rate[index])
            self._rate[index], thrust = _spooled(jet, state, float(self._throttle[index]))
            self._thrust[index] = max(thrust, 0.0)

    def _torques(self) -> Array:
        """Return what MuJoCo let the joints' motors give, (n,): what was asked, within their limits."""
        return np.array(self._data.actuator_force[: self._motors.size])

    def _contact_forces(self) -> Array:
        """Return the force of the ground on each contact point, (contacts, 3)."""
        contact, points = self._data.contact, self._simulation.points
        forces, first = np.zeros((points.size, 3)), contact.efc_address
        acts = first >= 0
        if acts.any():  # a cone's rows are the normal force and the two along the ground
            local = self._data.efc_force[first[acts, None] + np.arange(3)]
            world = np.einsum("ci,cix->cx", local, contact.frame[acts].reshape(-1, 3, 3))  # on the second geom
            of_points = contact.geom[acts, :, None] == points  # (acting, 2, contacts)
            signs = of_points[:, 1].astype(float) - of_points[:, 0]
            forces = signs.T @ world
        return forces


def _spooled(jet: Jet, state: tuple[float, float], throttle: float) -> tuple[float, float]:
    """Return Ṫ [N/s] and T [N] after a step of the simulation.

    Args:
        jet: with its engine.
        state: T [N] and Ṫ [N/s] before it.
        throttle: u [%].
    """
    engine, (thrust, rate) = jet.model, state
    if isinstance(engine, StaticMap):
        after = float(engine.thrust(throttle))
        return (after - thrust) / TIME_STEP, after
    if isinstance(engine, FirstOrder):
        gained = float(-engine.imbalance(thrust, throttle)) * engine.time_constant
        gained *= float(np.expm1(-TIME_STEP / engine.time_constant))
        return gained / TIME_STEP, thrust + gained
    rate += TIME_STEP * float(engine.slopes(thrust, rate, throttle)[1])
    return rate, thrust + TIME_STEP * rate


def _as_state(row: dict[str, Array]) -> State:
    return State(
        base_position=row["qpos"][:3],
        base_quaternion_xyzw=row["qpos"][[4, 5, 6, 3]],
        joint_positions=row["qpos"][7:],
        base_linear_velocity=row["qvel"][:3],
        base_angular_velocity=row["qvel"][3:6],
        joint_velocities=row["qvel"][6:],
        thrust=row["thrust"],
        thrust_rate=row["thrust_rate"],
    )

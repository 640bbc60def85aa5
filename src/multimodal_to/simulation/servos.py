"""The simple controller: joint servos with the planned torques, turbines around the planned thrust, a stabiliser."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from multimodal_to.adam.spatial import Array
from multimodal_to.arguments import checked
from multimodal_to.models.robot import Robot
from multimodal_to.models.state import State
from multimodal_to.simulation.controller import Belief, Command, Servos, row_of, servo
from multimodal_to.simulation.known import Known
from multimodal_to.simulation.look_ahead import Feedback, LookAhead
from multimodal_to.simulation.model import mujoco_module
from multimodal_to.simulation.reference import Reference, reference
from multimodal_to.simulation.stabiliser import Balance, BalanceGains, correct
from multimodal_to.simulation.turbines import around
from multimodal_to.trajectory import Trajectory

JOINT_LAG = 0.03  # with which joints take over the stabiliser's wish [s]
PERIOD = 2e-3  # between two commands [s]


@dataclass(frozen=True, kw_only=True)
class ServoGains(BalanceGains):
    """The numbers of the simple controller, in the robot's own units: m, g and L, the height of its CoM at home."""

    stiffness: float = 1.2  # K of each joint's servo [m g L/rad]
    damping: float = 0.16  # D of each joint's servo [m g L √(L/g)/rad]
    look_ahead: LookAhead = field(default_factory=LookAhead)


class ServoController:
    """Servos hold the joints where the plan has them; the stabiliser adds what brings the momentum back.

    Args:
        gains: its numbers.
        stabilise: let feedback correct thrusts, contact forces and joints; else turbines get the planned throttle.
    """

    @checked
    def __init__(self, gains: ServoGains | None = None, *, stabilise: bool = True) -> None:
        self._gains, self._stabilise = gains or ServoGains(), stabilise
        self._since = 0.0
        self._belief: Belief | None = None
        self._robot: Robot
        self._plan: Reference
        self._shift: Array
        self._servo: tuple[Array, Array]
        self._balance: Balance
        self._feedback: Feedback

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
        first = self._belief is None
        self._belief = Belief.of(robot, plan, self._belief)
        self._robot, self._since = robot, since
        self._plan = reference(robot, plan, np.arange(0.0, plan.duration + 2 * PERIOD, PERIOD))
        units, gains = robot.units, self._gains
        self._balance = Balance(gains=gains, units=units, inertia=inertia(robot), friction=self._belief.friction)
        self._feedback = Feedback(self._belief, self._plan, PERIOD, gains.look_ahead, Known.of(robot, plan))
        count = len(robot.joint_names)
        self._servo = servo(units, count, gains.stiffness, gains.damping)
        if first:
            self._shift = np.zeros(count)

    @checked
    def command(self, state: State, time: float) -> Command:
        """Return what the robot shall do.

        Args:
            state: as it was measured.
            time: since the simulation's start [s].
        """
        assert self._belief is not None
        self._belief.put(state)
        plan, step = self._plan, row_of(time - self._since, PERIOD, self._plan)
        torques, throttle = plan.torques[step], plan.throttle[step]
        if self._stabilise:
            advice = self._feedback.advise(state, step)
            throttle = around(self._robot.jets, plan, step, advice.throttle)
            simulation, data = self._belief.simulation, self._belief.data
            correction = correct(simulation, data, plan, step, state.thrust, self._balance, advice.footing)
            joints = advice.joints + correction.joints
            self._shift = self._shift + (joints - self._shift) * PERIOD / JOINT_LAG
            torques = torques - self._borne_by_joints(state, step, correction.contact_forces)
        servos = Servos(
            positions=plan.joints[step] + self._shift,
            velocities=plan.joint_velocities[step],
            stiffness=self._servo[0],
            damping=self._servo[1],
        )
        return Command(torques=torques, throttle=throttle, servos=servos)

    def _borne_by_joints(self, state: State, step: int, forces: Array) -> Array:
        """Return Jᵀ f of the thrusts' difference from the plan and of the forces that are asked of the ground.

        Args:
            state: with the thrusts as they are.
            step: row of the plan.
            forces: that are asked of the ground beside the plan's [N], (contacts, 3).
        """
        assert self._belief is not None
        mujoco, data, simulation = mujoco_module(), self._belief.data, self._belief.simulation
        total = self._belief.of_thrusts(state.thrust - self._plan.thrust[step])
        jacobian = np.zeros((3, simulation.model.nv))
        for index, force in enumerate(forces):
            if force.any():
                mujoco.mj_jacGeom(simulation.model, data, jacobian, None, simulation.points[index])
                total += jacobian.T @ force
        return np.asarray(simulation.coupling.T @ total)


@checked
def inertia(robot: Robot) -> Array:
    """Return the robot's inertia about its CoM at home, in the axes of its base [kg m²], (3, 3)."""
    pose, joints = np.eye(4), robot.home.joint_positions
    mass = np.array(robot.kindyn.mass_matrix(pose, joints))
    x, y, z = np.array(robot.kindyn.CoM_position(pose, joints)).ravel()
    arm = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.asarray(mass[3:6, 3:6] + robot.mass * arm @ arm)

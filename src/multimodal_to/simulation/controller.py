"""What carries out a plan: the interface of a controller, and the model that it keeps for itself.

A controller sees a `State`, measured or exact, and the time. It answers with a `Command`. It knows nothing of the
simulation: neither which masses the simulated robot has, nor where it touches, nor what pushes it.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, is_dataclass, replace
from typing import Any, Protocol, TypeVar

import numpy as np

from multimodal_to.adam.spatial import Array
from multimodal_to.arguments import checked
from multimodal_to.models.robot import Robot
from multimodal_to.models.state import State
from multimodal_to.models.units import Units
from multimodal_to.simulation.model import SimulationModel, mujoco_module
from multimodal_to.simulation.reference import Reference
from multimodal_to.simulation.stage import stage
from multimodal_to.trajectory import Trajectory


@dataclass(frozen=True, kw_only=True, eq=False)
class Servos:
    """What the joints' drives add by themselves, without delay: K (s* − s) + D (ṡ* − ṡ); (n,) each."""

    positions: Array  # s* [rad or m]
    velocities: Array  # ṡ* [rad/s or m/s]
    stiffness: Array  # K [N m/rad or N/m]
    damping: Array  # D [N m s/rad or N s/m]


@dataclass(frozen=True, kw_only=True, eq=False)
class Command:
    """What a controller asks of the robot until its next command."""

    torques: Array  # of the joints' motors [N m or N], (n,)
    throttle: Array  # u of the jets [%], (jets,)
    servos: Servos | None = None  # what the drives add to the torques; nothing by default


class Controller(Protocol):
    """What carries out a plan. Whatever has these three members is one."""

    @property
    def period(self) -> float:
        """Return the time between two commands [s]; the simulation takes the nearest whole number of its steps."""

    def reset(self, robot: Robot, plan: Trajectory, since: float) -> None:
        """Follow a plan from now on.

        Args:
            robot: that moves.
            plan: its motion; the scenario that it keeps says what the ground is like.
            since: when the plan's first knot is or was, since the simulation's start [s].
        """

    def command(self, state: State, time: float) -> Command:
        """Return what the robot shall do.

        Args:
            state: as it was measured, vectors in world axes.
            time: since the simulation's start [s].
        """


class Belief:
    """The robot and its ground as the plan has them, in the state that was measured.

    Args:
        robot: that moves.
        plan: its motion, with the scenario that it keeps.
    """

    @checked
    def __init__(self, robot: Robot, plan: Trajectory) -> None:
        self.simulation: SimulationModel
        self.simulation, self.friction = stage(robot, plan)
        self._scenario = plan.scenario_json
        self._mujoco = mujoco_module()
        self.data: Any = self._mujoco.MjData(self.simulation.model)
        self._of_joints = np.zeros((self.simulation.model.nv, 6 + len(robot.joint_names)))
        self._of_joints[:6, :6] = np.eye(6)
        self._of_joints[:, 6:] = self.simulation.coupling

    @classmethod
    def of(cls, robot: Robot, plan: Trajectory, before: Belief | None) -> Belief:
        """Return a belief, by default a new one.

        Args:
            robot: that moves.
            plan: its motion.
            before: what is returned if it is of the same robot and scenario; to build one takes a while.
        """
        if before is not None and before.simulation.robot is robot and before._scenario == plan.scenario_json:
            return before
        return cls(robot, plan)

    @property
    def of_joints(self) -> Array:
        """Return G: MuJoCo's velocities are G (ṗ, ω in the base's axes, ṡ), (nv, 6 + n)."""
        return self._of_joints

    @property
    def rotation(self) -> Array:
        """Return that of the base, world from base, (3, 3)."""
        return np.asarray(self.data.xmat[1].reshape(3, 3))

    def put(self, state: State) -> None:
        """Take a state over: positions, mass matrix, contacts, velocities and the forces of inertia and weight."""
        velocity = np.concatenate([state.base_linear_velocity, state.base_angular_velocity])
        self.simulation.set_state(
            self.data,
            state.base_position,
            state.base_quaternion_xyzw,
            state.joint_positions,
            velocity,
            state.joint_velocities,
        )
        model, data = self.simulation.model, self.data
        self._mujoco.mj_fwdPosition(model, data)
        self._mujoco.mj_fwdVelocity(model, data)
        self._mujoco.mj_subtreeVel(model, data)

    def put_plan(self, plan: Reference, step: int) -> None:
        """Take base and joints of a row of a plan over, at rest; nothing else is computed."""
        quaternion = np.zeros(4)
        self._mujoco.mju_mat2Quat(quaternion, plan.rotation[step].ravel())
        rest = np.zeros(plan.joints.shape[1])
        place = plan.base_position[step], quaternion[[1, 2, 3, 0]], plan.joints[step]
        self.simulation.set_state(self.data, *place, np.zeros(6), rest)

    def of_thrusts(self, thrust: Array) -> Array:
        """Return J_Tᵀ T of thrusts and of the drag of their rotors, in MuJoCo's velocities, (nv,).

        Args:
            thrust: T of each jet [N], (jets,).
        """
        model, data = self.simulation.model, self.data
        jacobian, turning, total = np.zeros((3, model.nv)), np.zeros((3, model.nv)), np.zeros(model.nv)
        for site, jet, size in zip(self.simulation.jets, self.simulation.robot.jets, thrust, strict=True):
            self._mujoco.mj_jacSite(model, data, jacobian, turning, site)
            axis = -data.site_xmat[site].reshape(3, 3)[:, 2]
            total += (jacobian + jet.drag * turning).T @ axis * size
        return total

    def mass_matrix(self) -> Array:
        """Return M in (ṗ, ω in the base's axes, ṡ), (6 + n, 6 + n)."""
        full = np.zeros((self.simulation.model.nv,) * 2)
        self._mujoco.mj_fullM(self.simulation.model, self.data, full)
        return np.asarray(self._of_joints.T @ full @ self._of_joints)


Gains = TypeVar("Gains")


def drawn(gains: Gains, rng: np.random.Generator, spread: float) -> Gains:
    """Return gains whose numbers are each drawn within ± `spread` of what they were, as a share.

    Args:
        gains: a dataclass of numbers, and of other such dataclasses.
        rng: that draws.
        spread: as a share [1].
    """
    changes: dict[str, Any] = {}
    for entry in fields(gains):  # type: ignore[arg-type]
        value = getattr(gains, entry.name)
        other = is_dataclass(value)
        changes[entry.name] = drawn(value, rng, spread) if other else value * float(rng.uniform(1 - spread, 1 + spread))
    return replace(gains, **changes)  # type: ignore[type-var]


@checked
def row_of(time: float, period: float, plan: Reference) -> int:
    """Return the row of a reference that holds at a time; the first before it begins, the last after its end.

    Args:
        time: since the plan's first knot [s].
        period: between two rows [s].
        plan: the reference.
    """
    return min(max(round(time / period), 0), len(plan.com) - 1)


@checked
def servo(units: Units, count: int, stiffness: float, damping: float) -> tuple[Array, Array]:
    """Return K [N m/rad] and D [N m s/rad] of joints' servos, (count,) each.

    Args:
        units: the robot's own.
        count: of joints.
        stiffness: K [m g L/rad].
        damping: D [m g L √(L/g)/rad].
    """
    return np.full(count, stiffness * units.moment), np.full(count, damping * units.moment / units.frequency)

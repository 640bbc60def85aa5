"""A plan played back in MuJoCo: joint servos with the planned torques, turbines at the planned throttle, a stabiliser.

A joint's motor gives the sum of its servo's torque and the planned one, clipped at the joint's effort limit.

Turbines are integrated from their own dynamics. On top of the planned throttle comes what brings the thrust to the plan
plus the stabiliser's ΔT: T̈ = T̈* + K_T (T* + ΔT − T) + D_T (Ṫ* − Ṫ), solved for u and kept within its range.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from multimodal_to.adam.spatial import Array
from multimodal_to.arguments import checked
from multimodal_to.errors import InputError, TrajectoryError
from multimodal_to.models.jet import FirstOrder, Jet, StaticMap
from multimodal_to.models.robot import Robot
from multimodal_to.models.state import State
from multimodal_to.models.terrain import FlatGround
from multimodal_to.scenarios.data import stored
from multimodal_to.simulation.model import DAMPING, STIFFNESS, TIME_STEP, SimulationModel, build_model, mujoco_module
from multimodal_to.simulation.reference import Reference, reference
from multimodal_to.simulation.stabiliser import Correction, Turbines, correct, rotation_vector
from multimodal_to.trajectory import Trajectory
from multimodal_to.trajectory.conditions import under_conditions
from multimodal_to.trajectory.sameness import refuse_other_robot
from multimodal_to.values import Value

HOLD = 1.0  # how long the end of the plan is held [s]
PERIOD = 4  # steps of the simulation between two decisions of the stabiliser [1]
THRUST_STIFFNESS, THRUST_DAMPING = 25.0, 10.0  # K_T [1/s²], D_T [1/s]
JOINT_LAG = 0.03  # with which joints take over the stabiliser's wish [s]
FALL_TILT = 45.0
"""A base turned away from the plan by more than this has fallen [°]."""
FALL_DEPTH = 0.25
"""A CoM lower than the plan by more than this has fallen [m]."""
REACH = 2.0  # how far ground that is no plane goes beyond the way of the CoM [m]


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
    torque_limits: bool  # the clip was at the joints' effort limits; else there was none
    notes: tuple[str, ...]  # where MuJoCo's model differs from the URDF, a sentence each
    fell: float | None  # when [s]


@checked
def play(
    robot: Robot, plan: Trajectory, *, stabilise: bool = True, delay: float = 0.0, torque_limits: bool = True
) -> Playback:
    """Play a plan back on the ground and with the friction of the scenario that it keeps.

    Without `stabilise` only the joints' servos close a loop, and turbines get the planned throttle. The motion follows
    thrusts, contact forces and torques by `delay` intervals of the plan, as `reference` says.

    Args:
        robot: that moves.
        plan: its motion, with the scenario that it was solved for where it keeps one.
        stabilise: let the stabiliser correct thrusts, contact forces and joints.
        delay: of the motion after its forces, from 0 to 1 intervals of the plan.
        torque_limits: clip the torque of each joint's motor at its effort limit.

    Raises:
        OutputError: MuJoCo is not installed.
        InputError: the delay is not from 0 to 1.
        TrajectoryError: the plan is not one of this robot with these jets.
    """
    if not 0.0 <= delay <= 1.0:
        raise InputError(f"the delay is {delay:g} intervals; expected 0 to 1")
    refuse_other_robot(plan, robot, what="the plan", error=TrajectoryError)
    robot = under_conditions(robot, plan)
    simulation, friction = stage(robot, plan, torque_limits)
    steps = round((plan.duration + HOLD) / TIME_STEP) + 1
    player = Player(simulation, plan, friction, stabilise=stabilise, torque_limits=torque_limits)
    player.run(reference(robot, plan, TIME_STEP * np.arange(steps, dtype=np.float64), delay))
    return player.playback()


@checked
def stage(robot: Robot, plan: Trajectory, torque_limits: bool) -> tuple[SimulationModel, float]:
    """Return a robot on the ground of the scenario that a plan keeps, and its friction [1].

    Args:
        robot: that moves.
        plan: its motion.
        torque_limits: clip the torque of each joint's motor at its effort limit.
    """
    scenario = stored(plan)
    friction = robot.friction if scenario is None or scenario.friction is None else scenario.friction
    low, high = (getattr(plan.com_position[:2], end)(axis=1) for end in ("min", "max"))
    simulation = build_model(
        robot,
        FlatGround() if scenario is None else scenario.surface,
        friction,
        middle=(low + high) / 2.0,
        reach=float((high - low).max()) / 2.0 + REACH,
        torque_limits=torque_limits,
    )
    return simulation, friction


class Player:
    """A simulation that runs, with everything that changes as it does.

    Args:
        simulation: the robot on its ground.
        plan: at whose first knot it starts.
        friction: Coulomb's μ [1].
        stabilise: let the stabiliser correct thrusts, contact forces and joints.
        torque_limits: whether the simulation clips torques.
    """

    def __init__(
        self,
        simulation: SimulationModel,
        plan: Trajectory,
        friction: float,
        *,
        stabilise: bool = True,
        torque_limits: bool = True,
    ) -> None:
        self._mujoco = mujoco_module()
        self._simulation, self._plan, self._robot = simulation, plan, simulation.robot
        self._friction, self._stabilise, self._torque_limits = friction, stabilise, torque_limits
        self._data = self._mujoco.MjData(simulation.model)
        self._rows = list[dict[str, Array]]()
        self._reference: Reference
        self._followed = list[Reference]()
        self._down: float | None = None
        self._inertia = _inertia(self._robot)
        self._thrust, self._rate = plan.thrust[:, 0].copy(), plan.thrust_rate[:, 0].copy()
        self._throttle, self._shift = plan.throttle[:, 0].copy(), np.zeros(len(self._robot.joint_names))
        self._correction, self._borne = Correction.none(self._robot), np.zeros(len(self._robot.joint_names))

        velocity = np.concatenate([plan.base_linear_velocity[:, 0], plan.base_angular_velocity[:, 0]])
        self._simulation.set_state(
            self._data,
            plan.base_position[:, 0],
            plan.base_quaternion_xyzw[:, 0],
            plan.joint_positions[:, 0],
            velocity,
            plan.joint_velocities[:, 0],
        )

    @property
    def steps(self) -> int:
        """Return how many steps have been done."""
        return len(self._rows)

    @property
    def fell(self) -> float | None:
        """Return when the robot fell [s], if it did."""
        return self._down

    def run(self, wanted: Reference, force: Array | None = None) -> None:
        """Follow a reference for as many steps as it has rows; a robot that has fallen stays as it is.

        Args:
            wanted: a row for each of the next steps.
            force: on the base link at its CoM, in world axes, for each of these steps [N], (steps, 3).
        """
        data, model = self._data, self._simulation.model
        self._reference = wanted
        self._followed.append(wanted)
        for step in range(wanted.com.shape[0]):
            if self._down is not None:
                self._rows.append(self._rows[-1])
                continue
            data.xfrc_applied[1, :3] = 0.0 if force is None else force[step]
            self._mujoco.mj_step1(model, data)
            row = self._state()
            if self._stabilise and self.steps % PERIOD == 0:
                self._decide(step)
            row |= self._control(step)
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
            **{name: np.array([row[name] for row in self._rows]) for name in self._rows[0]},
        )

    def state(self) -> State:
        """Return the state of the robot now."""
        now = self._state()
        return State(
            base_position=now["qpos"][:3],
            base_quaternion_xyzw=now["qpos"][[4, 5, 6, 3]],
            joint_positions=now["qpos"][7:],
            base_linear_velocity=now["qvel"][:3],
            base_angular_velocity=now["qvel"][3:6],
            joint_velocities=now["qvel"][6:],
            thrust=now["thrust"],
            thrust_rate=now["thrust_rate"],
        )

    def _state(self) -> dict[str, Array]:
        data, simulation = self._data, self._simulation
        nine = np.zeros(9)
        self._mujoco.mju_quat2Mat(nine, data.qpos[3:7])
        turn = nine.reshape(3, 3)
        return {
            "com": data.subtree_com[1].copy(),
            "qpos": np.concatenate([data.qpos[:7], data.qpos[simulation.joint_positions]]),
            "qvel": np.concatenate([data.qvel[:3], turn @ data.qvel[3:6], data.qvel[simulation.joint_velocities]]),
            "thrust": self._thrust.copy(),
            "thrust_rate": self._rate.copy(),
        }

    def _is_down(self, step: int) -> bool:
        wanted, data = self._reference, self._data
        tilt = np.linalg.norm(rotation_vector(wanted.rotation[step] @ data.xmat[1].reshape(3, 3).T))
        return bool(np.degrees(tilt) > FALL_TILT or wanted.com[step, 2] - data.subtree_com[1, 2] > FALL_DEPTH)

    def _decide(self, step: int) -> None:
        """Let the stabiliser look at the state."""
        turbines = Turbines(
            thrust=self._thrust,
            at_most=self._throttle >= np.array([jet.throttle_max for jet in self._robot.jets]),
            at_least=self._throttle <= np.array([jet.throttle_min for jet in self._robot.jets]),
        )
        self._mujoco.mj_subtreeVel(self._simulation.model, self._data)
        self._correction = correct(
            self._simulation, self._data, self._reference, step, turbines, self._inertia, self._friction
        )
        self._borne = self._borne_by_joints(step)

    def _control(self, step: int) -> dict[str, Array]:
        """Set the servos' targets and the thrusts of this step; return throttles and asked torques."""
        data, plan = self._data, self._reference
        self._turn_turbines(step, self._correction.thrust)
        self._shift += (self._correction.joints - self._shift) * TIME_STEP / JOINT_LAG
        torques = plan.torques[step] - self._borne
        count = self._shift.size
        target = plan.joints[step] + self._shift
        data.ctrl[:count] = target + (torques + DAMPING * plan.joint_velocities[step]) / STIFFNESS
        data.ctrl[count:] = self._thrust
        servos = STIFFNESS * (data.ctrl[:count] - data.qpos[self._simulation.joint_positions])
        servos -= DAMPING * data.qvel[self._simulation.joint_velocities]
        return {"throttle": self._throttle.copy(), "asked_torques": servos}

    def _turn_turbines(self, step: int, change: Array) -> None:
        """Set the throttles and integrate the thrusts over a step."""
        plan = self._reference
        for index, jet in enumerate(self._robot.jets):
            state = float(self._thrust[index]), float(self._rate[index])
            planned = float(plan.thrust[step, index]), float(plan.thrust_rate[step, index])
            throttle = float(plan.throttle[step, index])
            if self._stabilise:
                wish = min(max(planned[0] + float(change[index]), 0.0), jet.thrust_max)
                throttle = _throttle(jet, state, planned, throttle, wish)
            self._throttle[index] = throttle
            self._rate[index], thrust = _spooled(jet, state, throttle)
            self._thrust[index] = max(thrust, 0.0)

    def _borne_by_joints(self, step: int) -> Array:
        """Return Jᵀ f of the thrusts' difference from the plan and of the forces that are asked of the ground."""
        data, simulation, plan = self._data, self._simulation, self._reference
        jacobian, total = np.zeros((3, simulation.model.nv)), np.zeros(simulation.model.nv)
        for index, site in enumerate(simulation.jets):
            self._mujoco.mj_jacSite(simulation.model, data, jacobian, None, site)
            axis = -data.site_xmat[site].reshape(3, 3)[:, 2]
            total += jacobian.T @ axis * (self._thrust[index] - plan.thrust[step, index])
        for index, force in enumerate(self._correction.contact_forces):
            if force.any():
                self._mujoco.mj_jacGeom(simulation.model, data, jacobian, None, simulation.points[index])
                total += jacobian.T @ force
        return np.asarray(simulation.coupling.T @ total)

    def _torques(self) -> Array:
        """Return what MuJoCo let the joints' motors give, (n,): what was asked, within their limits."""
        return np.array(self._data.actuator_force[: self._shift.size])

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


def _throttle(
    jet: Jet, state: tuple[float, float], planned: tuple[float, float], throttle: float, wish: float
) -> float:
    """Return the throttle within its range that brings a thrust to the one wished for.

    Args:
        jet: with its engine and range.
        state: T [N] and Ṫ [N/s].
        planned: T [N] and Ṫ [N/s] of the plan.
        throttle: of the plan [%].
        wish: T that is wanted [N].
    """
    engine = jet.model
    slope = wish
    if engine.order == 1:
        slope = planned[1] + THRUST_STIFFNESS / THRUST_DAMPING * (wish - state[0])
    elif engine.order == 2:
        slope = float(engine.slopes(*planned, throttle)[1])
        slope += THRUST_STIFFNESS * (wish - state[0]) + THRUST_DAMPING * (planned[1] - state[1])
    return float(min(max(engine.throttle_for(*state, slope, jet.throttle_max), jet.throttle_min), jet.throttle_max))


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


def _inertia(robot: Robot) -> Array:
    """Return the robot's inertia about its CoM at home, in the axes of its base [kg m²], (3, 3)."""
    pose, joints = np.eye(4), robot.home.joint_positions
    mass = np.array(robot.kindyn.mass_matrix(pose, joints))
    x, y, z = np.array(robot.kindyn.CoM_position(pose, joints)).ravel()
    arm = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.asarray(mass[3:6, 3:6] + robot.mass * arm @ arm)

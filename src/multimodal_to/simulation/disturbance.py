"""What a trial changes of the simulated robot, and that a controller does not know."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from multimodal_to.adam.urdf import read_urdf
from multimodal_to.arguments import check_fields, checked, vector
from multimodal_to.errors import InputError
from multimodal_to.models.robot import Robot
from multimodal_to.scenarios.scenario import Vector3
from multimodal_to.simulation.model import SimulationModel, body_name, mujoco_module
from multimodal_to.simulation.noise import Noise
from multimodal_to.values import FrozenMapping

MASS_SPREAD, GAIN_SPREAD, FRICTION_SPREAD = 0.05, 0.2, 0.2  # each is drawn within ± this share [1]
DELAY = (2e-3, 10e-3)  # of a command, from and to [s]
PUSH = 0.114  # by default [m g]; 50 N on the iRonCub
PUSH_TIME = 0.2  # [s]


@dataclass(frozen=True, kw_only=True)
class Push:
    """A constant force on the base link, at its CoM.

    Raises:
        InputError: it lasts for no time, or a number is not finite.
    """

    force: Vector3  # in world axes [N]
    start: float  # since the simulation's start [s]
    duration: float  # [s]

    def __post_init__(self) -> None:
        check_fields(self, what="the push's ")
        vector("the push's force", self.force, 3)
        if not (np.isfinite([*self.force, self.start, self.duration]).all() and self.duration > 0.0):
            raise InputError(f"the push is {self}; expected finite numbers and a duration above zero")

    @checked
    def at(self, time: float) -> Vector3:
        """Return its force at a time since the simulation's start [N]."""
        acts = self.start - 1e-9 <= time < self.start + self.duration - 1e-9
        return self.force if acts else (0.0, 0.0, 0.0)


@dataclass(frozen=True, kw_only=True)
class Disturbance:
    """How the simulated robot differs from that of the plan; by default it does not.

    Raises:
        InputError: a factor or the delay is not a finite number, or is below zero.
    """

    masses: Mapping[str, float] = field(default_factory=lambda: FrozenMapping({}))
    """By which a link's mass and inertia are multiplied, by its name; 1 for the others [1]."""
    motor_gains: Mapping[str, float] = field(default_factory=lambda: FrozenMapping({}))
    """By which all that is asked of a joint's motor is multiplied, torque and servo, by its name [1]."""
    friction: float = 1.0  # by which Coulomb's μ is multiplied [1]
    delay: float = 0.0  # of commands; the joints' servos have none [s]
    push: Push | None = None
    noise: Noise | None = None  # of what the controller sees

    def __post_init__(self) -> None:
        numbers = [*self.masses.values(), *self.motor_gains.values(), self.friction, self.delay]
        if not (np.isfinite(numbers).all() and min(numbers) >= 0.0):
            raise InputError(f"the disturbance is {self}; expected finite numbers of at least zero")

    @checked
    def apply(self, simulation: SimulationModel) -> None:
        """Change masses and friction of a model; the rest is for who simulates it."""
        model: Any = simulation.model
        for link, factor in self.masses.items():
            body = model.body(body_name(simulation.robot, link)).id
            model.body_mass[body] *= factor
            model.body_inertia[body] *= factor
        model.geom_friction[:, 0] *= self.friction
        mujoco = mujoco_module()
        mujoco.mj_setConst(model, mujoco.MjData(model))

    @checked
    def of_motors(self, robot: Robot) -> np.ndarray:
        """Return by which each motor's torque is multiplied, (n,)."""
        return np.array([self.motor_gains.get(name, 1.0) for name in robot.joint_names])


@checked
def draw(
    robot: Robot,
    duration: float,
    rng: np.random.Generator,
    *,
    push: float | None = None,
    noise: bool = False,
    push_starts: tuple[float, float] | None = None,
) -> Disturbance:
    """Return a disturbance at random: masses ±5 %, motor gains and friction ±20 %, a delay of 2 to 10 ms, a push.

    The push is level, in any direction, for 0.2 s that by default end before the plan does.

    Args:
        robot: that is disturbed.
        duration: of its plan [s].
        rng: that draws.
        push: its force [N]; 0.114 of the weight by default.
        noise: let the controller see sensors with noise and an estimate that drifts.
        push_starts: from when to when the push starts [s]; by default at any time of the plan.
    """
    links, _ = read_urdf(robot.urdf)
    masses = {link.name: float(rng.uniform(1 - MASS_SPREAD, 1 + MASS_SPREAD)) for link in links if link.mass > 0.0}
    gains = {name: float(rng.uniform(1 - GAIN_SPREAD, 1 + GAIN_SPREAD)) for name in robot.joint_names}
    friction = float(rng.uniform(1 - FRICTION_SPREAD, 1 + FRICTION_SPREAD))
    delay = float(rng.uniform(*DELAY))
    start = float(rng.uniform(*(push_starts or (0.0, max(duration - PUSH_TIME, 0.0)))))
    angle = float(rng.uniform(-np.pi, np.pi))
    strength = PUSH * robot.units.force if push is None else push
    force = (strength * float(np.cos(angle)), strength * float(np.sin(angle)), 0.0)
    return Disturbance(
        masses=FrozenMapping(masses),
        motor_gains=FrozenMapping(gains),
        friction=friction,
        delay=delay,
        push=Push(force=force, start=start, duration=PUSH_TIME),
        noise=Noise(seed=int(rng.integers(2**31))) if noise else None,
    )

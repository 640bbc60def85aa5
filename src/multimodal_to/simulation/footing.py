"""Legs put the feet where the robot comes down, and the plan goes with the feet that stand.

A robot that was pushed comes down somewhere else, and turned. Out of a flight, a foot that will soon be loaded goes to

    c = c* + k (1 − F / m g) d,   d = x − x* + (ẋ − ẋ*) (t + √(L/g)),

level as the plan has it, although the base is not. d is how far the capture point will be off when the foot comes down,
t the time until then, and F what the planned thrusts carry: they bring the robot back by themselves. Leg joints turn by
J⁺ of what that changes of the foot in the axes of the base. While a foot stands the others are not led: the robot takes
no step that is not planned.

Where feet stand beside their planned places, by o each, the plan for the CoM moves with them: by a, the mean of o under
the planned loads. The legs keep the feet o − a apart from the plan, so that they do not pull at each other.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from multimodal_to.adam.spatial import Array
from multimodal_to.simulation.controller import Belief
from multimodal_to.simulation.feet import PlannedFeet
from multimodal_to.simulation.model import mujoco_module
from multimodal_to.simulation.reference import Reference
from multimodal_to.simulation.stabiliser import rotation_vector, touching

SOON = 0.3  # how long before it is loaded a foot is led to its place [s]
LOADED = 0.01  # a foot with more planned load than this is to stand [m g]
FURTHEST = 0.25  # that a foot comes down off the plan [L]
SETTLING = 0.1  # after it has come down a foot is where it stands [s]
TURN_MAX = 0.5  # how far a leg's joint leaves the plan [rad or m]
SOFT = 0.03  # of the legs' pseudo-inverse, against straight knees [1]
SWING_LAG = 0.03  # with which the legs take over what is wanted of a foot in the air [s]
STANCE_LAG = 0.1  # and of a foot on the ground [s]


@dataclass(frozen=True, kw_only=True, eq=False)
class Step:
    """What feet that are not where the plan has them change."""

    place: Array  # a, by which the plan for the CoM moves, world axes [m], (3,)
    joints: Array  # Δs of the legs [rad or m], (n,)


class Footing:
    """Where feet come down, and where they stand.

    Args:
        belief: robot and ground; its state is lost.
        plan: with rows a `period` apart.
        period: [s].
        placement: k.
    """

    def __init__(self, belief: Belief, plan: Reference, period: float, placement: float) -> None:
        self._belief, self._plan, self._period, self._placement = belief, plan, period, placement
        self._units = belief.simulation.robot.units
        self._feet = PlannedFeet.along(belief, plan, period)
        loaded = self._feet.load > LOADED * self._units.force
        steps, count = loaded.shape[1], belief.of_joints.shape[1] - 6
        self._until = np.full(loaded.shape, np.inf)  # time until each foot is loaded [s]
        for row in range(steps - 1, -1, -1):
            later = self._until[:, row + 1] + period if row + 1 < steps else np.inf
            self._until[:, row] = np.where(loaded[:, row], 0.0, later)
        self._anchor, self._wanted = np.zeros(3), np.zeros((len(self._feet.members), count))
        self._down = np.full(len(loaded), np.inf)  # the row of the plan at which each foot has come down
        self._offset = np.zeros((len(loaded), 3))  # o of each foot

    def step(self, step: int) -> Step:
        """Return what the feet change of a row of the plan, in the state that `belief` has taken over."""
        feet, data, period = self._feet, self._belief.data, self._period
        touches = touching(self._belief.simulation, data)
        positions = data.geom_xpos[self._belief.simulation.points]
        places = [positions[own].mean(axis=0) for own in feet.members]
        until = self._until[:, step]
        for foot, own in enumerate(feet.members):
            touched = bool(touches[own].any())
            if until[foot] > 0.0 and not touched:
                self._down[foot] = np.inf
            elif touched and until[foot] < SOON:
                self._down[foot] = min(self._down[foot], step)
            if step - self._down[foot] < SETTLING / period:
                self._offset[foot, :2] = (places[foot] - feet.middle[foot, step])[:2]
        down = np.isfinite(self._down)
        loads = np.where(down, np.maximum(feet.load[:, step], 1e-3 * self._units.force), 0.0)
        wanted = loads @ self._offset / loads.sum() if down.any() else np.zeros(3)
        self._anchor = self._anchor + (wanted - self._anchor) * period / STANCE_LAG
        for foot, place in enumerate(places):
            lag, change = SWING_LAG, np.zeros(6)
            if down[foot]:  # also one that lost the ground: else feet that bounce walk away
                lag, change[:3] = STANCE_LAG, self._offset[foot] - self._anchor
            elif until[foot] < SOON:
                if down.any():
                    continue  # it stays where the flight has led it
                change = self._coming_down(foot, step, float(until[foot]))
            joints = self._of_joints(foot, place, change) if change.any() else 0.0
            self._wanted[foot] += (joints - self._wanted[foot]) * period / lag
        return Step(place=self._anchor, joints=np.clip(self._wanted.sum(axis=0), -TURN_MAX, TURN_MAX))

    def _coming_down(self, foot: int, step: int, until: float) -> Array:
        """Return how a foot in the air has to change against the planned joints, (6,), world axes [m, rad].

        Args:
            foot: its number.
            step: row of the plan.
            until: how long the robot flies until it comes down [s].
        """
        plan, data = self._plan, self._belief.data
        away = data.subtree_com[1] - plan.com[step]
        away = away + (data.subtree_linvel[1] - plan.com_velocity[step]) * (until + 1.0 / self._units.frequency)
        free = max(0.0, 1.0 - self._lift(step) / self._units.force)
        away = self._placement * free * away * [1.0, 1.0, 0.0]
        far, size = FURTHEST * self._units.length, float(np.linalg.norm(away))
        target = self._feet.middle[foot, step] + away * min(1.0, far / max(size, 1e-9))
        turn = self._belief.rotation @ plan.rotation[step].T
        as_planned = data.xpos[1] + turn @ (self._feet.middle[foot, step] - plan.base_position[step])
        return np.concatenate([target - as_planned, rotation_vector(turn.T)])

    def _lift(self, step: int) -> float:
        """Return how much the planned thrusts carry in a row of the plan [N]."""
        data, simulation = self._belief.data, self._belief.simulation
        axes = -data.site_xmat[simulation.jets].reshape(-1, 3, 3)[:, :, 2]
        return float(self._plan.thrust[step] @ axes @ simulation.robot.up)

    def _of_joints(self, foot: int, place: Array, change: Array) -> Array:
        """Return J⁺ of a change of a foot, (n,).

        Args:
            foot: its number.
            place: of the middle of its contact points, world axes [m], (3,).
            change: [m, rad], (6,).
        """
        model = self._belief.simulation.model
        both = np.zeros((6, model.nv))
        mujoco_module().mj_jac(model, self._belief.data, both[:3], both[3:], place, self._feet.bodies[foot])
        rows = 6 if len(self._feet.members[foot]) > 2 else 3
        scale = np.repeat([1.0 / self._units.length, 1.0], 3)[:rows]
        jacobian = scale[:, None] * (both[:rows] @ self._belief.simulation.coupling)
        system = jacobian @ jacobian.T + SOFT**2 * np.eye(rows)
        return np.asarray(jacobian.T @ np.linalg.solve(system, scale * change[:rows]))

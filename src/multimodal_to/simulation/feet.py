"""The feet of a robot along its plan."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from multimodal_to.adam.spatial import Array
from multimodal_to.simulation.controller import Belief
from multimodal_to.simulation.model import mujoco_module
from multimodal_to.simulation.reference import Reference
from multimodal_to.simulation.stabiliser import touching


@dataclass(frozen=True, kw_only=True, eq=False)
class PlannedFeet:
    """Where each foot is at the rows of a plan, how it turns and moves, in world axes, and what it carries."""

    members: tuple[NDArray[np.int64], ...]  # which contact points each foot has
    bodies: tuple[int, ...]  # MuJoCo's body of each
    middle: Array  # of its contact points [m], (feet, steps, 3)
    rotation: Array  # of its link, (feet, steps, 3, 3)
    velocity: Array  # of the middle [m/s] and of the link [rad/s], (feet, steps, 6)
    acceleration: Array  # [m/s², rad/s²], (feet, steps, 6)
    load: Array  # normal force [N], (feet, steps)

    @classmethod
    def along(cls, belief: Belief, plan: Reference, period: float) -> PlannedFeet:
        """Return the feet of a plan.

        Args:
            belief: robot and ground; its state is lost.
            plan: with rows a `period` apart.
            period: [s].
        """
        simulation, data, model = belief.simulation, belief.data, belief.simulation.model
        members = tuple(np.array(own, dtype=np.int64) for own in simulation.robot.feet.values())
        bodies = tuple(int(model.geom_bodyid[simulation.points[own[0]]]) for own in members)
        feet, steps = len(members), len(plan.com)
        middle, rotation = np.zeros((feet, steps, 3)), np.zeros((feet, steps, 3, 3))
        for step in range(steps):
            belief.put_plan(plan, step)
            mujoco_module().mj_kinematics(model, data)
            for foot, (own, body) in enumerate(zip(members, bodies, strict=True)):
                middle[foot, step] = data.geom_xpos[simulation.points[own]].mean(axis=0)
                rotation[foot, step] = data.xmat[body].reshape(3, 3)
        velocity = np.zeros((feet, steps, 6))
        velocity[:, :, :3] = np.gradient(middle, period, axis=1)
        turn = rotation[:, 1:] @ rotation[:, :-1].transpose(0, 1, 3, 2)
        axial = [
            turn[..., 2, 1] - turn[..., 1, 2],
            turn[..., 0, 2] - turn[..., 2, 0],
            turn[..., 1, 0] - turn[..., 0, 1],
        ]
        velocity[:, 1:, 3:] = np.stack(axial, axis=-1) / (2.0 * period)
        load = np.array([plan.contact_forces[:, own, 2].sum(axis=1) for own in members]).reshape(feet, steps)
        return cls(
            members=members,
            bodies=bodies,
            middle=middle,
            rotation=rotation,
            velocity=velocity,
            acceleration=np.asarray(np.gradient(velocity, period, axis=1)),
            load=load,
        )

    def beside(self, belief: Belief, step: int) -> tuple[Array, float]:
        """Return how far feet stand beside the plan, level, in the mean by planned load [m], (3,); and that load [N].

        Only feet that touch count.

        Args:
            belief: in the state as it is.
            step: row of the plan.
        """
        simulation, data = belief.simulation, belief.data
        touches, away, total = touching(simulation, data), np.zeros(3), 0.0
        for foot, own in enumerate(self.members):
            load = float(self.load[foot, step])
            if load > 0.0 and touches[own].any():
                away += load * (data.geom_xpos[simulation.points[own]].mean(axis=0) - self.middle[foot, step])
                total += load
        return away * [1.0, 1.0, 0.0] / max(total, np.finfo(float).tiny), total

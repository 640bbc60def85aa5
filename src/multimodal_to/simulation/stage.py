"""The robot on the ground of the scenario that its plan keeps."""

from __future__ import annotations

from multimodal_to.models.robot import Robot
from multimodal_to.models.terrain import FlatGround
from multimodal_to.scenarios.data import stored
from multimodal_to.simulation.model import SimulationModel, build_model
from multimodal_to.trajectory import Trajectory

REACH = 2.0  # how far ground that is no plane goes beyond the way of the CoM [m]


def stage(robot: Robot, plan: Trajectory, *, torque_limits: bool = True) -> tuple[SimulationModel, float]:
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

"""A trot of Solo12 with its contacts given: 0.3 m in four steps of two feet each."""

from __future__ import annotations

from dataclasses import replace

import multimodal_to as mt
from multimodal_to.models.robot import Robot

TROT = mt.Scenario(
    name="trot",
    title="Trot",
    knots=60,
    jets=False,
    initial_com=(0.0, 0.0, 0.2),
    final_com=(0.3, 0.0, 0.2),
    terminal=mt.Terminal.STANDING,
    interval_min=0.02,
    interval_max=0.02,
    gait=mt.GaitPlan(kind=mt.GaitKind.TROT, steps=4, clearance=0.03),
    margins=mt.Margins(touch_down_speed=0.25),
    weights=mt.Weights(
        com_velocity=5e7,
        com_acceleration=2e5,
        angular_momentum=1e8,
        angular_momentum_rate=4e7,
        joint_velocities={"legs": 6e4},
        posture=2e6,
        base_orientation=2e7,
        contact_forces=3e2,
        contact_force_rates=1e2,
    ),
)


def trot(robot: Robot, **changes: object) -> mt.Scenario:
    """Return the trot of a robot from its home on, with other values where `changes` has them."""
    x, y, z = (float(value) for value in robot.com_at(robot.home))
    return replace(TROT, **{"initial_com": (x, y, z), "final_com": (x + 0.3, y, z), **changes})

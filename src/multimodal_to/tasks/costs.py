"""The weights of every starter task, in the robot's own units: one set for all robots."""

from __future__ import annotations

from multimodal_to.models.robot import Robot
from multimodal_to.models.units import Units
from multimodal_to.scenarios.weights import Weights

ONE = 1e5
"""A weight of one: what costs it is one of the robot's own units, over one unit of time √(L/g)."""


def weights(robot: Robot, units: Units) -> Weights:
    """Return the weights of every starter task for a robot.

    What a cost is of is measured in units of m, L and g, and time in √(L/g). So two robots of one shape get one
    objective, whatever their size. Forces are measured in the load of a contact point while all stand.

    Args:
        robot: with its joints, contact points and jets.
        units: its own, or those of its flight.
    """

    def running(weight: float, unit: str, share: float = 1.0) -> float:
        return ONE * weight / (units.of("s") * (share * units.of(unit)) ** 2)

    def at_end(weight: float, unit: str) -> float:
        return ONE * weight / units.of(unit) ** 2

    load = 1.0 / max(len(robot.contacts), 1) ** 0.5  # Σ f² of all points is then that of one that bears all
    thrust = 1.0 / max(len(robot.jets), 1) ** 0.5
    return Weights(
        com_velocity=running(1.0, "m/s"),
        com_acceleration=running(1.0, "m/s²"),
        angular_momentum=running(10.0, "kg m²/s"),
        angular_momentum_rate=running(10.0, "N m"),
        joint_velocities=dict.fromkeys(_groups(robot), running(1.0, "rad/s")),
        joint_accelerations=running(0.1, "rad/s²"),
        posture=running(1.0, "rad"),
        base_orientation=running(10.0, "1"),
        contact_forces=running(0.1, "N", load),
        contact_force_rates=running(0.1, "N/s", load),
        thrust_rate=running(0.1, "N/s", thrust),
        throttle_rate=running(10.0, "1/s", 100.0 * thrust),
        foot_tilt=running(10.0, "1") if robot.joint_names else 0.0,
        skimming=running(10.0, "1"),
        initial_posture=at_end(1.0, "rad"),
        final_posture=at_end(10.0, "rad"),
    )


def _groups(robot: Robot) -> list[str]:
    """Return the largest groups of joints that share no joint, so that each joint counts once."""
    found, known = list[str](), set[str]()
    for name, joints in sorted(robot.joint_groups.items(), key=lambda entry: -len(entry[1])):
        if not known & set(joints):
            found.append(name)
            known |= set(joints)
    return found

"""A controller of one's own: joint servos at the plan's postures and the planned throttle; nothing balances."""

from pathlib import Path

import numpy as np

import multimodal_to as mt
from multimodal_to.simulation import Command, Servos, play, tracking
from multimodal_to.trajectory.resampling import resample


class Following:
    """Follows the plan blindly: what is off stays off."""

    period = 0.01  # between two commands [s]

    def reset(self, robot, plan, since):
        """Take a plan over whose first knot is at a time since the simulation's start [s]."""
        self.plan, self.since, self.one = plan, since, np.ones(len(robot.joint_names))

    def command(self, state, time):
        """Return what motors and turbines shall do; `state` is the robot as it is now."""
        now = self.plan.time[0] + np.clip(time - self.since, 0.0, self.plan.duration)
        wanted = resample(self.plan, [now, now + 1e-6])  # a trajectory has two knots at least
        place, speed = wanted.joint_positions[:, 0], wanted.joint_velocities[:, 0]
        servos = Servos(positions=place, velocities=speed, stiffness=300.0 * self.one, damping=10.0 * self.one)
        return Command(torques=0.0 * self.one, throttle=wanted.throttle[:, 0], servos=servos)


robot = mt.load_robot("ironcub")
answer = mt.solve(mt.build(robot, mt.scenarios.take_off()))
print(answer.status.value, "after", answer.iterations, "iterations")
print("physically true:", mt.audit(robot, answer.trajectory).holds)
for name, controller in (("followed blindly", Following()), ("by the library's controller", None)):
    outcome = tracking(play(robot, answer.trajectory, controller))
    print(f"{name}: the robot {outcome.end}, CoM at most {100 * outcome.com:.1f} cm off")
Path("results/own-controller").mkdir(parents=True, exist_ok=True)
answer.trajectory.save("results/own-controller/trajectory.npz")

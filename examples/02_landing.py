"""Landing: from a hover, in a posture that is found, down to standing; how fast the feet touch down."""

from pathlib import Path

import numpy as np

import multimodal_to as mt
from multimodal_to.replay import write_html
from multimodal_to.trajectory.derived import contact_points, vertical_thrust

robot = mt.load_robot("ironcub")
solution = mt.solve(mt.build(robot, mt.scenarios.landing()))
trajectory = solution.trajectory
print(solution.status.value, "after", solution.iterations, "iterations in", round(solution.solve_time, 1), "s")
print("physically true:", mt.audit(robot, trajectory).holds)

heights = contact_points(robot, trajectory)[:, :, 2]
touching = (heights[:, :-1] > 1e-3) & (heights[:, 1:] < 5e-4)  # over these intervals a contact point comes down
speeds = (heights[:, :-1] - heights[:, 1:]) / np.diff(trajectory.time)
thrust = vertical_thrust(robot, trajectory) / robot.weight
print(
    f"fastest touch-down: {speeds[touching].max():.2f} m/s | thrust: {thrust[0]:.2f} to {thrust[-1]:.2f} of the weight"
)

folder = Path("results/landing")
folder.mkdir(parents=True, exist_ok=True)
trajectory.save(folder / "trajectory.npz")
print("open", write_html(robot, trajectory, folder / "replay.html"))

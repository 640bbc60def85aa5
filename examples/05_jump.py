"""Jump with the jets off: what it asks of the legs, which is more than they have, and what the audit then allows."""

from pathlib import Path

import numpy as np

import multimodal_to as mt
from multimodal_to.plotting import plot_torques, save
from multimodal_to.trajectory.derived import generalised_forces

scenario = mt.scenarios.jump()
problem = mt.build(mt.load_robot("ironcub"), scenario)
robot = problem.robot  # without jets, as the scenario asks
solution = mt.solve(problem)
trajectory = solution.trajectory
print(solution.status.value, "after", solution.iterations, "iterations in", round(solution.solve_time, 1), "s")

report = mt.audit(robot, trajectory)
print("physically true:", report.holds, "| flight:", round(report.airborne, 2), "s")
print("apex:", round(float(trajectory.com_position[2].max()), 3), "m | only by allowance:", *report.allowances_used)

torques = np.abs(generalised_forces(robot, trajectory)[6:]).max(axis=1)
for row in np.argsort(-torques)[:4]:
    print(f"  {robot.joint_names[row]:15} {torques[row]:5.0f} N m, limit {robot.joint_limits.effort[row]:g}")

folder = Path("results/jump")
folder.mkdir(parents=True, exist_ok=True)
trajectory.save(folder / "trajectory.npz")
print("see", save(plot_torques(robot, trajectory), folder / "torques.png"))

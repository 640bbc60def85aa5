"""Jump with the jets off: how high it gets within the motors, and how near it comes to what they have."""

from pathlib import Path

import multimodal_to as mt
from multimodal_to.plotting import plot_torques, save
from multimodal_to.trajectory.derived import largest_torques

scenario = mt.scenarios.jump()
problem = mt.build(mt.load_robot("ironcub"), scenario)
robot = problem.robot  # without jets, as the scenario asks
solution = mt.solve(problem)
trajectory = solution.trajectory
print(solution.status.value, "after", solution.iterations, "iterations in", round(solution.solve_time, 1), "s")

report = mt.audit(robot, trajectory)
print("physically true:", report.holds, "| flight:", round(report.airborne, 2), "s")
print("apex:", round(float(trajectory.com_position[2].max()), 3), "m")

for one in largest_torques(robot, trajectory)[:4]:
    print(f"  {one.joint:15} {one.torque:5.0f} N m, limit {one.effort:g}")

folder = Path("results/jump")
folder.mkdir(parents=True, exist_ok=True)
trajectory.save(folder / "trajectory.npz")
print("see", save(plot_torques(robot, trajectory), folder / "torques.png"))

"""Take-off: from standing with idle jets to a hover, and what to look at afterwards."""

from pathlib import Path

import multimodal_to as mt
from multimodal_to.plotting import plot_forces
from multimodal_to.replay import write_html

robot = mt.load_robot("ironcub")
problem = mt.build(robot, mt.scenarios.take_off())
solution = mt.solve(problem)
print(solution.status.value, "after", solution.iterations, "iterations in", round(solution.solve_time, 1), "s")
print("largest violation:", *solution.largest_violation)

report = mt.audit(robot, solution.trajectory)
print("physically true:", report.holds, "| flight:", round(report.airborne, 2), "s")

folder = Path("results/take-off")
folder.mkdir(parents=True, exist_ok=True)
solution.trajectory.save(folder / "trajectory.npz")
plot_forces(robot, solution.trajectory).savefig(folder / "forces.png")
print("open", write_html(robot, solution.trajectory, folder / "replay.html"))

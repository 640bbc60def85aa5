"""Step-up: a flight onto a step. The ground is data of the scenario; then the motion goes out for another program."""

from pathlib import Path

import multimodal_to as mt
from multimodal_to.exporting.export import EXPORTS
from multimodal_to.reporting.report import write_report
from multimodal_to.trajectory.derived import contact_points

robot = mt.load_robot("ironcub")
scenario = mt.scenarios.step_up()
print(scenario.surface)
solution = mt.solve(mt.build(robot, scenario))
trajectory = solution.trajectory
print(solution.status.value, "after", solution.iterations, "iterations in", round(solution.solve_time, 1), "s")
print("physically true:", mt.audit(robot, trajectory).holds)
for name, (x, _, z) in zip(robot.contact_names, contact_points(robot, trajectory)[:, -1], strict=True):
    print(f"  {name}: x {x:.2f} m, z {z:.3f} m")

folder = Path("results/step-up")
folder.mkdir(parents=True, exist_ok=True)
trajectory.save(folder / "trajectory.npz")
suffix, write = EXPORTS["csv"]
print("wrote", write(robot, trajectory, folder / f"trajectory{suffix}"))
print("open", write_report(robot, trajectory, folder / "report.html"))

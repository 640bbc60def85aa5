"""A scenario of your own: the take-off, but higher; and the same as a TOML file."""

from dataclasses import replace
from pathlib import Path

import multimodal_to as mt

take_off = mt.scenarios.take_off()
higher = replace(
    take_off,
    name="higher",
    title="Take-off to a hover at 0.80 m",
    final_com=(0.0, 0.0, 0.80),
    weights=replace(take_off.weights, thrust=3.0, skimming=1e7),  # spool up late, and lift the feet straight
)
folder = Path("results/higher")
folder.mkdir(parents=True, exist_ok=True)
file = mt.scenario_files.save(
    higher, folder / "higher.toml"
)  # or written by hand, for `multimodal-to solve higher.toml`
print("the file says the same:", mt.scenario_files.load(file) == higher)

robot = mt.load_robot("ironcub")
solution = mt.solve(mt.build(robot, higher))
print(solution.status.value, "after", solution.iterations, "iterations in", round(solution.solve_time, 1), "s")
print("physically true:", mt.audit(robot, solution.trajectory).holds)
print("ends at", solution.trajectory.com_position[:, -1].round(3), "m")
solution.trajectory.save(folder / "trajectory.npz")

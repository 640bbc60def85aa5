"""A scenario of your own: the take-off, but higher and to a hover on one side; and the same as a TOML file."""

from dataclasses import replace
from pathlib import Path

import multimodal_to as mt

take_off = mt.scenarios.take_off()
aside = replace(
    take_off,
    name="aside",
    title="Take-off to a hover on the left",
    final_com=(0.0, 0.2, 0.80),
    weights=replace(take_off.weights, thrust=3.0),  # spool up no earlier than needed
)
folder = Path("results/aside")
folder.mkdir(parents=True, exist_ok=True)
file = mt.scenario_files.save(aside, folder / "aside.toml")  # or written by hand, for `multimodal-to solve aside.toml`
print("the file says the same:", mt.scenario_files.load(file) == aside)

robot = mt.load_robot("ironcub")
solution = mt.solve(mt.build(robot, aside))
print(solution.status.value, "after", solution.iterations, "iterations in", round(solution.solve_time, 1), "s")
print("physically true:", mt.audit(robot, solution.trajectory).holds)
print("ends at", solution.trajectory.com_position[:, -1].round(3), "m")
solution.trajectory.save(folder / "trajectory.npz")

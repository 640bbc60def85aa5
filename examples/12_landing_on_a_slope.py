"""Landing on a slope of 15°: with the hill ahead of the robot falling, and across."""

from dataclasses import replace
from math import radians, tan
from pathlib import Path

import multimodal_to as mt
from multimodal_to.replay import write_html

robot = mt.load_robot("ironcub")  # it heads towards -x
slopes = {"downhill": (1.0, 0.0), "across": (0.0, 1.0)}  # where the ground rises to
for name, direction in slopes.items():
    landing = replace(
        mt.scenarios.landing(),
        name=name,
        title=f"Landing on 15°, {name}",
        surface=mt.Plane(slope=tan(radians(15)), direction=direction),
    )
    solution = mt.solve(mt.build(robot, landing))
    print(solution.status.value, "after", solution.iterations, "iterations in", round(solution.solve_time, 1), "s")
    print(f"{name}: physically true: {mt.audit(robot, solution.trajectory).holds}")

folder = Path("results/slope")
folder.mkdir(parents=True, exist_ok=True)
solution.trajectory.save(folder / "trajectory.npz")
print("open", write_html(robot, solution.trajectory, folder / "replay.html"))

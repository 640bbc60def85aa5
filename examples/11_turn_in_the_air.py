"""A turn in the air: from a hover to a hover that heads 45° to the left, by a keyframe."""

from dataclasses import replace
from math import degrees, radians
from pathlib import Path

import multimodal_to as mt
from multimodal_to.replay import write_html

turn = replace(
    mt.scenarios.take_off(),
    name="turn",
    title="A turn by 45° in the air",
    start=mt.Start.HOVER,
    initial_com=(0.0, 0.0, 0.70),
    keyframes=(mt.Keyframe(when="end", yaw=radians(45)),),
)
robot = mt.load_robot("ironcub")
solution = mt.solve(mt.build(robot, turn))
report = mt.audit(robot, solution.trajectory)
print(solution.status.value, "after", solution.iterations, "iterations in", round(solution.solve_time, 1), "s")
print("physically true:", report.holds)
print(f"off the heading: {degrees(report['keyframes: yaw'].worst):.1e}°")

folder = Path("results/turn")
folder.mkdir(parents=True, exist_ok=True)
solution.trajectory.save(folder / "trajectory.npz")
print("open", write_html(robot, solution.trajectory, folder / "replay.html"))

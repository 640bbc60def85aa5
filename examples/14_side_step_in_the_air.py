"""A side-step from hover to hover: a task file that names its robot and says its ends by keyframes."""

from pathlib import Path

import multimodal_to as mt
from multimodal_to.replay import write_html

task = mt.scenario_files.load(Path(__file__).with_name("side_step.toml"))
robot = mt.load_robot(task.robot)
solution = mt.solve(mt.build(robot, task))
motion = solution.trajectory
print(solution.status.value, "after", solution.iterations, "iterations in", round(solution.solve_time, 1), "s")
print("physically true:", mt.audit(robot, motion).holds)
print("the CoM moved by", (motion.com_position[:, -1] - motion.com_position[:, 0]).round(3), "m")

folder = Path("results/side-step")
folder.mkdir(parents=True, exist_ok=True)
motion.save(folder / "trajectory.npz")
print("open", write_html(robot, motion, folder / "replay.html"))

"""A flight that is given: the iRonCub jumps onto a box of 10 cm, from a ballistic arc as start guess."""

from pathlib import Path

import multimodal_to as mt
from multimodal_to.replay import write_html
from multimodal_to.simulation import play, tracking
from multimodal_to.trajectory.derived import flight_phases, largest_torques

task = mt.scenario_files.load(Path(__file__).parent / "jump-onto-box.toml")
problem = mt.build(mt.load_robot("ironcub"), task)
robot, solution = problem.robot, mt.solve(problem)
trajectory = solution.trajectory
print(solution.status.value, "after", solution.iterations, "iterations in", round(solution.solve_time, 1), "s")
print("physically true:", mt.audit(robot, trajectory).holds)

for begin, end in flight_phases(robot, trajectory):
    print(f"in the air from {begin:.2f} to {end:.2f} s")
heights = trajectory.com_position[2]
print(f"CoM: crouches to {heights.min():.2f} m, rises to {heights[55:74].max():.2f} m, stands at {heights[-1]:.2f} m")
hardest = largest_torques(robot, trajectory)[0]
print(f"hardest motor: {hardest.joint}, {hardest.over_effort:.0%} of its limit")
print("MuJoCo: it", tracking(play(robot, trajectory)).end)

folder = Path("results/jump-onto-box")
folder.mkdir(parents=True, exist_ok=True)
trajectory.save(folder / "trajectory.npz")
print("open", write_html(robot, trajectory, folder / "replay.html"))

"""Contacts that are given: Solo12 trots 0.3 m, as any robot on four feet can, and what MuJoCo makes of it."""

from pathlib import Path

import multimodal_to as mt
from multimodal_to.replay import write_html
from multimodal_to.simulation import play, tracking
from multimodal_to.trajectory.derived import footsteps

folder = Path("results/trot")
folder.mkdir(parents=True, exist_ok=True)
robot = mt.load_robot("solo12")
trot = mt.tasks.trot(robot, distance=0.3)
problem = mt.build(robot, trot)
solution = mt.solve(problem)
print(solution.status.value, "after", solution.iterations, "iterations in", round(solution.solve_time, 1), "s")
print("physically true:", mt.audit(robot, solution.trajectory).holds)
for step in footsteps(robot, solution.trajectory, trot.surface):
    print(f"{step.foot} from {step.lift_off:.2f} to {step.touch_down:.2f} s: {step.length:.3f} m", end=", ")
    print(f"{step.lift:.3f} m high")

followed = tracking(play(robot, solution.trajectory))
print(f"MuJoCo: it {followed.end} and is {1000 * followed.com_at_end:.0f} mm from the plan")
solution.trajectory.save(folder / "trajectory.npz")
print("open", write_html(robot, solution.trajectory, folder / "replay.html"))

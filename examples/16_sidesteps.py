"""Steps that are given: the iRonCub walks 0.3 m to its left without jets, one foot after the other."""

from dataclasses import replace
from pathlib import Path

import multimodal_to as mt
from multimodal_to.replay import write_html
from multimodal_to.simulation import play, tracking
from multimodal_to.trajectory.derived import footsteps

robot, walk = mt.load_robot("ironcub"), mt.scenarios.walk_to_fly()
sidesteps = replace(
    walk,
    name="sidesteps",
    title="Four steps to the left",
    knots=60,
    jets=False,
    final_com=(0.0, 0.3, 0.57),
    terminal=mt.Terminal.STANDING,
    interval_min=0.1,
    interval_max=0.1,
    guess_steps=0,
    gait=mt.GaitPlan(kind=mt.GaitKind.WALK, steps=4, first="left", clearance=0.02),
)
problem = mt.build(robot, sidesteps)
solution = mt.solve(problem)
print(solution.status.value, "after", solution.iterations, "iterations in", round(solution.solve_time, 1), "s")
print("physically true:", mt.audit(problem.robot, solution.trajectory).holds)
for step in footsteps(problem.robot, solution.trajectory, sidesteps.surface):
    print(f"{step.foot} foot from {step.lift_off:.2f} to {step.touch_down:.2f} s: {step.length:.3f} m")

followed = tracking(play(problem.robot, solution.trajectory))
print(f"MuJoCo: it {followed.end} and is {1000 * followed.com_at_end:.0f} mm from the plan")
folder = Path("results/sidesteps")
folder.mkdir(parents=True, exist_ok=True)
solution.trajectory.save(folder / "trajectory.npz")
print("open", write_html(problem.robot, solution.trajectory, folder / "replay.html"))

"""Walk to fly: which foot steps when, and how much of the weight the jets carry by then."""

from pathlib import Path

import numpy as np

import multimodal_to as mt
from multimodal_to.plotting import plot_contacts, save
from multimodal_to.trajectory.derived import flight_phases, footsteps, vertical_thrust

robot = mt.load_robot("ironcub")
scenario = mt.scenarios.walk_to_fly()
solution = mt.solve(mt.build(robot, scenario))
trajectory = solution.trajectory
print(solution.status.value, "after", solution.iterations, "iterations in", round(solution.solve_time, 1), "s")
print("physically true:", mt.audit(robot, trajectory).holds)

carried = vertical_thrust(robot, trajectory) / robot.weight
for step in footsteps(robot, trajectory, scenario.surface):
    share = np.interp(step.touch_down, trajectory.time, carried)
    print(
        f"{step.lift_off:4.1f} to {step.touch_down:4.1f} s: {step.foot:5} foot, {100 * step.length:.0f} cm far, "
        f"{100 * step.lift:.1f} cm high; the jets carry {100 * share:.0f} % of the weight"
    )
for start, end in flight_phases(robot, trajectory):
    print(f"{start:4.1f} to {end:4.1f} s: in the air")

folder = Path("results/walk-to-fly")
folder.mkdir(parents=True, exist_ok=True)
trajectory.save(folder / "trajectory.npz")
print("see", save(plot_contacts(robot, trajectory), folder / "contacts.png"))

"""Take-off and landing as one problem; when the feet leave and return is found. It takes a minute or two."""

from pathlib import Path

import multimodal_to as mt
from multimodal_to.plotting import plot_com, plot_forces, save
from multimodal_to.trajectory.derived import flight_phases

robot = mt.load_robot("ironcub")
problem = mt.build(robot, mt.scenarios.take_off_and_landing())
solution = mt.solve(problem, mt.Ipopt(time_limit=1800.0), lambda iterate: print(".", end="", flush=True))
trajectory = solution.trajectory
print("\n" + solution.status.value, "after", solution.iterations, "iterations; costs by name:")
for name, cost in sorted(solution.costs.items(), key=lambda item: -item[1])[:5]:
    print(f"  {name:30} {cost:12.0f}")

print("physically true:", mt.audit(robot, trajectory).holds)
for start, end in flight_phases(robot, trajectory):
    print(f"in the air from {start:.1f} to {end:.1f} s, at most {trajectory.com_position[2].max():.2f} m high")

folder = Path("results/take-off-and-landing")
folder.mkdir(parents=True, exist_ok=True)
trajectory.save(folder / "trajectory.npz")
print("see", save(plot_forces(robot, trajectory), folder / "forces.png"))
print("see", save(plot_com(robot, trajectory), folder / "com.svg"))

"""Any robot, nothing tuned: from the URDF of ANYmal to a jump and a trot; heights and times follow from the robot."""

from pathlib import Path

import multimodal_to as mt
from multimodal_to.files.packages import package_file
from multimodal_to.replay import write_html

urdf = package_file("example-robot-data", "robots/anymal_b_simple_description/robots/anymal.urdf")
folder = Path("results/first-tasks")
robot = mt.robots.init(urdf, folder / "anymal").robot
print(f"{robot.name}: {robot.mass:.1f} kg, CoM {robot.standing_height:.2f} m above its feet: {', '.join(robot.feet)}")

for scenario in (mt.tasks.trot(robot, distance=0.5), mt.tasks.jump(robot, height=0.1)):
    solution = mt.solve(mt.build(robot, scenario))
    report = mt.audit(robot, solution.trajectory)
    print(f"{scenario.title}: {solution.status.value} after {solution.iterations} iterations")
    print("physically true:", report.holds, f"and {report.airborne:.2f} s in the air")

try:
    mt.tasks.take_off(robot)
except mt.MultimodalError as error:
    print("refused:", error)

solution.trajectory.save(folder / "trajectory.npz")
print("open", write_html(robot, solution.trajectory, folder / "replay.html"))

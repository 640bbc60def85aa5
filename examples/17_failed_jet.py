"""A take-off with a jet that never lights: what the other three do in its place, and what that costs."""

from dataclasses import replace
from pathlib import Path

import multimodal_to as mt
from multimodal_to.replay import write_html

FAILED = "left chest"
robot, take_off = mt.load_robot("ironcub"), mt.scenarios.take_off()
gentle = replace(take_off, weights=replace(take_off.weights, throttle_rate=5e1))
crippled = replace(gentle, name="failed-jet", title="Take-off", failures=(mt.JetFailure(jet=FAILED),))
answers = [mt.solve(mt.build(robot, scenario)) for scenario in (gentle, crippled)]
whole, motion = (answer.trajectory for answer in answers)
print(answers[1].status.value, "after", answers[1].iterations, "iterations for", answers[0].iterations)
print("physically true:", mt.audit(robot, motion, crippled).holds)

print(f"objective: {answers[1].objective:.3g} for {answers[0].objective:.3g} with all jets")
for name, with_all, without in zip(robot.jet_names, whole.thrust[:, -1], motion.thrust[:, -1], strict=True):
    print(f"{name}: {without:.0f} N in the hover for {with_all:.0f} N")
turned = abs(motion.joint_positions[:, -1] - whole.joint_positions[:, -1])
for index in turned.argsort()[:-4:-1]:
    print(f"{robot.joint_names[index]} hovers {57.3 * turned[index]:.0f}° elsewhere")

folder = Path("results/failed-jet")
folder.mkdir(parents=True, exist_ok=True)
motion.save(folder / "trajectory.npz")
print("open", write_html(robot, motion, folder / "replay.html"))

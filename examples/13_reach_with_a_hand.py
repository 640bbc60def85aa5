"""A reach in the air: the iRonCub hovers and brings its left hand, which is a jet, to a point and back."""

from dataclasses import replace
from pathlib import Path

import numpy as np

import multimodal_to as mt
from multimodal_to.replay import write_html

HAND, POINT = "l_arm_jet_turbine", (-0.33, -0.29, 0.92)  # 0.28 m above where the hand hangs [m]
reach = replace(
    mt.scenarios.landing(),
    name="reach",
    title="Reaching for a point with the left hand while hovering",
    initial_com=(0.0, 0.0, 0.80),
    final_com=(0.0, 0.0, 0.80),
    terminal=mt.Terminal.HOVER,
    keyframes=(mt.Keyframe(when=0.5, hover=True, frames={HAND: mt.FrameTarget(position=POINT)}),),
)
robot = mt.load_robot("ironcub")
solution = mt.solve(mt.build(robot, reach))
motion = solution.trajectory
print(solution.status.value, "after", solution.iterations, "iterations in", round(solution.solve_time, 1), "s")
print("physically true:", mt.audit(robot, motion).holds)
state = mt.state_at(motion, motion.time[motion.knots // 2])
hand = np.array(robot.kindyn.forward_kinematics(HAND, state.posture.base_transform, state.joint_positions))[:3, 3]
print(f"off the point: {1e3 * np.linalg.norm(hand - POINT):.3f} mm")

folder = Path("results/reach")
folder.mkdir(parents=True, exist_ok=True)
motion.save(folder / "trajectory.npz")
print("open", write_html(robot, motion, folder / "replay.html"))

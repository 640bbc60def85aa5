"""A hover that is pushed and planned anew again and again, in MuJoCo, beside the same push without re-planning."""

from dataclasses import replace
from pathlib import Path

import numpy as np

import multimodal_to as mt
from multimodal_to.simulation import Flight, Push

PERIOD, LONGEST = 0.1, 4.0  # between two plans, of the simulation [s]
robot = mt.load_robot("ironcub")
place = mt.scenarios.landing().initial_com
hover = replace(mt.scenarios.landing(), start=mt.Start.HOVER, terminal=mt.Terminal.HOVER, final_com=place, knots=20)
task = replace(hover, name="hover", start=mt.Start.GIVEN, interval_min=0.1, interval_max=0.1)
first = mt.solve(mt.build(robot, replace(task, start=mt.Start.HOVER)))
print(first.status.value, "after", first.iterations, "iterations")
print("physically true:", mt.audit(robot, first.trajectory).holds)

push = Push(force=(80.0, 0.0, 0.0), start=0.5, duration=0.2)
planner, solutions = mt.Planner(robot, task), []
flight, alone = (Flight(robot, first.trajectory, push=push) for _ in range(2))
planner.solve(initial=flight.state)
while flight.time < LONGEST - 1e-9:
    now, state = flight.time, flight.state
    flight.advance(PERIOD)  # the old plan, while the new one is made
    solutions.append(planner.solve(initial=state, elapsed=PERIOD))
    flight.follow(solutions[-1].trajectory, since=now)
alone.advance(LONGEST)

times = np.array([solution.solve_time for solution in solutions])
print(f"{len(times) / times.sum():.1f} plans a second, {PERIOD / times.max():.1f} times as fast as needed at worst;", end=" ")
print(f"median {np.median(times):.3f} s, worst {times.max():.3f} s, {max(s.iterations for s in solutions)} iterations")
for name, some in (("planned anew", flight), ("one plan alone", alone)):
    away = np.linalg.norm(some.playback.com - place, axis=1)
    back = some.playback.time[np.flatnonzero(away > 0.02)[-1]] - push.start
    print(f"{name}: pushed {away.max():.3f} m, within 2 cm after {back:.2f} s, fell: {some.fell}")
Path("results/receding").mkdir(parents=True, exist_ok=True)
first.trajectory.save("results/receding/trajectory.npz")

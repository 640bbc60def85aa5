"""A hover that is pushed and planned anew all the time, in MuJoCo, beside the same push with one plan alone."""

from dataclasses import replace
from pathlib import Path

import numpy as np

import multimodal_to as mt
from multimodal_to.simulation import Flight, Push

PERIOD, END, PLACE = 0.1, 2.5, np.array([0.0, 0.0, 0.7])
robot, air = mt.load_robot("ironcub"), replace(mt.scenarios.landing(), knots=20, final_com=tuple(PLACE))
hover = replace(air, terminal=mt.Terminal.HOVER, interval_min=0.1, interval_max=0.1)
first = mt.solve(mt.build(robot, hover))
print(first.status.value, "after", first.iterations, "iterations")
print("physically true:", mt.audit(robot, first.trajectory).holds)
task = replace(hover, start=mt.Start.GIVEN, terminal=mt.Terminal.FREE, interval_min=0.05, interval_max=0.05)
away = mt.Cost(name="away", residual=lambda knot, _: knot.com_position - PLACE, weight=1e6, unit="m")
terms = mt.Formulation.executable().with_terms(away)
planner, answers = mt.Planner(robot, task, terms, mt.Ipopt(max_iterations=60)), []
push = Push(force=(150.0, 0.0, 0.0), start=0.5, duration=0.2)
flight, alone = (Flight(robot, first.trajectory, push=push) for _ in range(2))
while flight.time < END:
    now, state = flight.time, flight.state
    flight.advance(PERIOD)  # on the plan before: a new one counts from `now` and is there a period later
    answers.append(planner.solve(initial=state, elapsed=PERIOD if now else 0.0))
    flight.follow(answers[-1].trajectory if answers[-1].feasible else first.trajectory, since=now)
alone.advance(flight.time)
times, steps = (np.array([getattr(some, name) for some in answers[1:]]) for name in ("solve_time", "iterations"))
print(f"{1 / times.mean():.1f} plans a second, {(times < PERIOD).mean():.0%} within {PERIOD} s;", end=" ")
print(f"median {np.median(times):.3f} s, worst {times.max():.3f} s; {np.median(steps):g} and {steps.max()} iterations")
for name, some in (("planned anew", flight), ("one plan alone", alone)):
    off = np.linalg.norm(some.playback.com - PLACE, axis=1)
    late = (off > 0.02).mean() * END
    print(f"{name}: pushed {off.max():.3f} m, beyond 2 cm for {late:.2f} s, at the end {off[-1]:.3f} m")
Path("results/hover").mkdir(parents=True, exist_ok=True)
first.trajectory.save("results/hover/trajectory.npz")

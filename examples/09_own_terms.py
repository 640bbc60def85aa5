"""Terms of your own, added to the paper's in a script: a cost, a constraint of knots and one of intervals."""

from dataclasses import replace
from pathlib import Path

import multimodal_to as mt


def slow_turns(knot, parameters):
    """ω: the base should turn slowly."""
    return knot.base_angular_velocity


def arm_height(knot, parameters):
    """z of the left arm's jet."""
    return knot.pose("l_arm_jet_turbine").translation[2]


def throttle_rate(interval, parameters):
    """(u⁺ − u) / Δt: a turbine cannot follow jumps."""
    return interval.rate(lambda knot: knot.throttle)


turns = mt.Cost(residual=slow_turns, weight=1e6, unit="rad/s")
arm = mt.Constraint(value=arm_height, within=mt.at_least(0.42), unit="m")
steady = mt.Constraint(value=throttle_rate, within=mt.between(-200, 200), unit="%/s", holds=mt.Where.EVERY_INTERVAL)
robot, task, paper = mt.load_robot("ironcub"), mt.scenarios.take_off(), mt.Formulation.paper()
problem = mt.build(robot, task, paper.with_terms(turns, arm, steady))

file = Path("results/own-terms/trajectory.npz")
file.parent.mkdir(parents=True, exist_ok=True)
mt.solve(problem, mt.Ipopt(max_iterations=30)).trajectory.save(file)  # unfinished; the next line goes on from it
solution = mt.solve(problem, start=mt.Trajectory.load(file))
print(solution.status.value, "after", solution.iterations, "more; slow_turns costs", solution.costs["slow_turns"])
print("largest violations:", {name: solution.violations[name] for name in ("arm_height", "throttle_rate")})
print("physically true:", mt.audit(robot, solution.trajectory).holds)
solution.trajectory.save(file)
too_high = paper.with_terms(replace(arm, within=mt.at_least(1.5)))
print("gives way:", mt.relax(mt.build(robot, replace(task, knots=8), too_high)).gives_way[0])

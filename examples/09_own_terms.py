"""Terms of your own, added to the usual ones in a script: a cost, a constraint of knots and one of intervals."""

from dataclasses import replace
from pathlib import Path

import multimodal_to as mt


def slow_turns(knot, parameters):
    """ω: the base should turn slowly."""
    return knot.base_angular_velocity


def arm_height(knot, parameters):
    """z of the left arm's jet."""
    return knot.pose("l_arm_jet_turbine").translation[2]


def load_rate(interval, parameters):
    """How fast the load of the left foot changes: the floor should not creak."""
    left = [index for index, point in enumerate(parameters.robot.contacts) if point.foot == "left"]
    return interval.rate(lambda knot: sum(knot.forces[index][2] for index in left))


turns = mt.Cost(residual=slow_turns, weight=1e6, unit="rad/s")
arm = mt.Constraint(value=arm_height, within=mt.at_least(0.42), unit="m")
gentle = mt.Constraint(value=load_rate, within=mt.between(-100, 100), unit="N/s", holds=mt.Where.EVERY_INTERVAL)
robot, task, usual = mt.load_robot("ironcub"), mt.scenarios.take_off(), mt.Formulation.executable()
problem = mt.build(robot, task, usual.with_terms(turns, arm, gentle))

file = Path("results/own-terms/trajectory.npz")
file.parent.mkdir(parents=True, exist_ok=True)
mt.solve(problem, mt.Ipopt(max_iterations=30)).trajectory.save(file)  # unfinished; the next line goes on from it
solution = mt.solve(problem, start=mt.Trajectory.load(file))
print(solution.status.value, "after", solution.iterations, "more; slow_turns costs", solution.costs["slow_turns"])
print("largest violations:", {name: solution.violations[name] for name in ("arm_height", "load_rate")})
print("physically true:", mt.audit(robot, solution.trajectory).holds)
solution.trajectory.save(file)
too_high = usual.with_terms(replace(arm, within=mt.at_least(1.5)))
print("gives way:", mt.relax(mt.build(robot, replace(task, knots=8), too_high)).gives_way[0])

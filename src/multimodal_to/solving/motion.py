"""From the variables of a problem to the trajectory that they are."""

from __future__ import annotations

import numpy as np

from multimodal_to.adam.spatial import Array
from multimodal_to.ocp.problem import Problem
from multimodal_to.scenarios.data import kept
from multimodal_to.trajectory import Trajectory, conditions


def motion(problem: Problem, x: Array, solve_json: str = "") -> Trajectory:
    """Return the trajectory of x: the variables in their own units, and the differences that are their rates.

    Args:
        problem: whose variables they are.
        x: all variables, in solver units.
        solve_json: how it was solved, as `solving.record` writes it.
    """
    own = x * problem.scale
    values = {name: np.array(value) for name, value in problem.layout.read_horizon(own).items()}
    dt, robot = float(own[-1]), problem.robot
    time_grid: Array = dt * np.arange(problem.scenario.knots + 1, dtype=np.float64)

    def rate(name: str) -> Array:
        difference: Array = np.diff(values[name], axis=1, prepend=values[name][:, :1]) / dt
        return difference

    return Trajectory(
        robot=robot.name,
        scenario=problem.scenario.name,
        scenario_json=kept(problem.scenario),
        solve_json=solve_json,
        robot_json=conditions.to_json(robot),
        rule=problem.formulation.rule.name,
        time=time_grid,
        joint_names=robot.joint_names,
        contact_names=robot.contact_names,
        jet_names=robot.jet_names,
        com_acceleration=rate("com_velocity"),
        angular_momentum_rate=rate("angular_momentum"),
        contact_force_rates=rate("contact_forces"),
        thrust_acceleration=rate("thrust_rate"),
        **values,
    )

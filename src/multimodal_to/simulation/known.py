"""What a plan knows of that happens to the robot from outside its control: pushes, and jets that fail.

The simulation does it to the robot, and a controller that follows the plan counts on it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from multimodal_to.adam.spatial import Array
from multimodal_to.models.robot import Robot
from multimodal_to.scenarios.data import stored
from multimodal_to.scenarios.failures import failing_knots
from multimodal_to.simulation.model import SimulationModel, body_name, mujoco_module
from multimodal_to.trajectory import Trajectory
from multimodal_to.trajectory.derived import acting_times
from multimodal_to.trajectory.pushes import known_pushes, push_forces


@dataclass(frozen=True, kw_only=True, eq=False)
class Known:
    """Pushes and failures of the task that a plan keeps, over the time since the plan's first knot."""

    pushed: tuple[str, ...]  # the link or frame that each push acts on
    forces: Array  # of each push at every knot [N], (pushes, knots + 1, 3)
    until: Array  # when what acts at each knot ends [s], (knots + 1,)
    fails: Array  # when each jet fails; infinite for those that do not [s], (jets,)
    unlit: NDArray[np.bool_]  # the jets that never light, (jets,)

    @classmethod
    def of(cls, robot: Robot, plan: Trajectory) -> Known:
        """Return what a plan knows of.

        Args:
            robot: that moves, with the jets of the plan.
            plan: its motion.
        """
        scenario, known = stored(plan), known_pushes(plan)
        begins, ends = (times - plan.time[0] for times in acting_times(plan))
        fails, unlit = np.full(len(robot.jets), np.inf), np.zeros(len(robot.jets), dtype=bool)
        failures = () if scenario is None else scenario.failures
        for row, knot in failing_knots(failures, robot.jet_names, plan.knots).items():
            fails[row], unlit[row] = begins[knot], knot == 0
        return cls(
            pushed=tuple(push.of for push in known),
            forces=push_forces(known, plan),
            until=ends,
            fails=fails,
            unlit=unlit,
        )

    def works(self, time: float) -> NDArray[np.bool_]:
        """Return which jets have not failed at a time since the plan's first knot [s], (jets,)."""
        return np.asarray(time < self.fails - 1e-9)

    def at(self, time: float) -> Array:
        """Return the pushes at a time since the plan's first knot [s]: forces in world axes [N], (pushes, 3)."""
        knot = min(int(np.searchsorted(self.until, time - 1e-9)), self.until.size - 1)
        return np.asarray(self.forces[:, knot])

    def push(self, simulation: SimulationModel, data: Any, time: float) -> None:
        """Let the pushes act on the bodies of a simulation, beside what acts on them already.

        Args:
            simulation: the model.
            data: MuJoCo's `MjData` of it, with the places of its bodies known.
            time: since the plan's first knot [s].
        """
        for name, force in zip(self.pushed, self.at(time), strict=True):
            body = simulation.model.body(body_name(simulation.robot, name)).id
            data.xfrc_applied[body, :3] += force  # MuJoCo's is at the CoM of the body
            data.xfrc_applied[body, 3:] += np.cross(data.xpos[body] - data.xipos[body], force)

    def generalised(self, simulation: SimulationModel, data: Any, time: float) -> Array:
        """Return Jᵀ f of the pushes in MuJoCo's velocities, (nv,).

        Args:
            simulation: the model.
            data: MuJoCo's `MjData` of it, with the places of its bodies known.
            time: since the plan's first knot [s].
        """
        mujoco, total = mujoco_module(), np.zeros(simulation.model.nv)
        jacobian = np.zeros((3, simulation.model.nv))
        for name, force in zip(self.pushed, self.at(time), strict=True):
            if force.any():
                body = simulation.model.body(body_name(simulation.robot, name)).id
                mujoco.mj_jac(simulation.model, data, jacobian, None, data.xpos[body], body)
                total += jacobian.T @ force
        return total

"""Solve scenarios again, audit the answers, and write down all that a person wants to look at."""

from __future__ import annotations

import os
import time
from dataclasses import dataclass
from pathlib import Path

from multimodal_to.arguments import checked
from multimodal_to.auditing.audit import Audit, audit
from multimodal_to.errors import TrajectoryError
from multimodal_to.models.robot import Robot
from multimodal_to.models.terrain import FlatGround
from multimodal_to.ocp import Formulation, build
from multimodal_to.ocp.integration import LEAPFROG
from multimodal_to.plotting import FIGURES, plot, save
from multimodal_to.reporting.report import write_report
from multimodal_to.scenarios import Scenario
from multimodal_to.solving import Ipopt, Solution, solve
from multimodal_to.solving.solution import Progress
from multimodal_to.trajectory import Trajectory
from multimodal_to.trajectory.derived import footsteps
from multimodal_to.trajectory.importing import import_arrays
from multimodal_to.values import Value


@dataclass(frozen=True, kw_only=True, eq=False)
class Run(Value):
    """A trajectory with its audit and, where it was solved here, how the solve went."""

    name: str  # of the scenario
    robot: Robot
    trajectory: Trajectory
    report: Audit
    steps: int
    executable: bool = False  # solved as a plan that the robot carries out; else it is the paper's problem
    solution: Solution | None = None  # None: the trajectory is one of others
    whole_time: float | None = None  # to build, solve and audit [s]

    @property
    def solved(self) -> bool:
        """Return whether the motion is an answer."""
        return self.solution is None or self.solution.status.solved

    @property
    def holds(self) -> bool:
        """Return whether the motion is an answer and passes the audit."""
        return self.report.holds and self.solved


@checked
def reproduce(
    robot: Robot,
    scenario: Scenario,
    solver: Ipopt | None = None,
    progress: Progress | None = None,
    formulation: Formulation | None = None,
) -> Run:
    """Solve a scenario from its plain start guess and audit the answer.

    Args:
        robot: that moves.
        scenario: to solve.
        solver: by default `Ipopt()`.
        progress: told of every iteration; it may stop the solve by returning True.
        formulation: what the problem is made of; by default `Formulation.executable()`.
    """
    formulation = formulation or Formulation.executable()
    started = time.perf_counter()
    problem = build(robot, scenario, formulation)
    solution = solve(problem, solver, progress)
    report = audit(problem.robot, solution.trajectory, scenario)
    return Run(
        name=scenario.name,
        robot=problem.robot,
        trajectory=solution.trajectory,
        report=report,
        steps=len(footsteps(problem.robot, solution.trajectory, scenario.surface)),
        executable=formulation.rule == LEAPFROG,
        solution=solution,
        whole_time=time.perf_counter() - started,
    )


@checked
def read_published(robot: Robot, folder: str | os.PathLike[str]) -> list[Run]:
    """Audit the published trajectories of a folder: every `.npz` in it, bare arrays as `import_arrays` reads them.

    Raises:
        TrajectoryError: there is no such file, or one lacks an array.
    """
    files = sorted(Path(folder).glob("*.npz"))
    if not files:
        raise TrajectoryError(f"no .npz of a published trajectory in '{folder}'")
    runs = []
    for file in files:
        trajectory = import_arrays(robot, file)
        runs.append(
            Run(
                name=trajectory.scenario,
                robot=robot,
                trajectory=trajectory,
                report=audit(robot, trajectory),
                steps=len(footsteps(robot, trajectory, FlatGround())),
            )
        )
    return runs


@checked
def write_run(run: Run, folder: str | os.PathLike[str]) -> list[Path]:
    """Write trajectory, figures and report of a run into a folder that exists; return their paths.

    Raises:
        OutputError: the folder cannot be written.
    """
    target = Path(folder)
    return [
        run.trajectory.save(target / "trajectory.npz"),
        *(save(plot(name, run.robot, run.trajectory), target / f"{name}.png") for name in FIGURES),
        write_report(run.robot, run.trajectory, target / "report.html"),
    ]

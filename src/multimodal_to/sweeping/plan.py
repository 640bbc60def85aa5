"""One plan of a sweep: solve, audit, and if asked play back. Every engine runs this, and nothing else."""

from __future__ import annotations

import json
import platform
import subprocess
import time
from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from functools import cache, lru_cache
from importlib import metadata
from pathlib import Path
from typing import Any

from multimodal_to.auditing.audit import Audit, audit
from multimodal_to.errors import LONGEST, MultimodalError, OutputError, said, shortened
from multimodal_to.files.writing import make_folder
from multimodal_to.models.loading import load_robot
from multimodal_to.models.robot import Robot
from multimodal_to.ocp import Problem, build
from multimodal_to.ocp.rebinding import rebind, same_terms
from multimodal_to.scenarios.data import from_dict, to_json
from multimodal_to.scenarios.scenario import Scenario
from multimodal_to.solving import Ipopt, solve
from multimodal_to.sweeping.design import Row
from multimodal_to.sweeping.folder import Folder
from multimodal_to.sweeping.variants import variant
from multimodal_to.trajectory import Trajectory

_BOUND = ("final_com", "mid_height_min", "interval_min", "interval_max")
"""What of a scenario is a bound of its problem alone: `ocp.rebinding`."""
_KEPT = 4  # robots and problems that a process keeps
REFUSED, CRASHED, TIMED_OUT = "refused", "crashed", "timed out"
"""What a row says of a plan that no solver ended: the task contradicts itself, its process died, it took too long."""


@dataclass(frozen=True, kw_only=True)
class Order:
    """What a worker is told."""

    row: Row
    folder: str
    started_from: int | None  # index of the plan to start from; None: the start guess
    base: Mapping[str, Any]  # scenario of the plan at the beginning of its tree, whose problem neighbours share
    time_limit: float  # of a solve [s]
    simulate: bool
    attempts: int
    facts: Mapping[str, Any]  # versions

    def plain(self) -> dict[str, Any]:
        """Return the order as what JSON can hold."""
        return asdict(self)

    @classmethod
    def of_plain(cls, table: Mapping[str, Any]) -> Order:
        """Return the order that `plain` made data of."""
        return cls(**{**table, "row": Row(**table["row"])})


def perform(order: Order) -> dict[str, Any]:
    """Make a plan, write its trajectory and then its row, and return the row.

    Whatever goes wrong with the plan is in the row.

    Args:
        order: what to do.

    Raises:
        OutputError: the trajectory, the row or the robot cannot be written; the plan is not done then.
    """
    started, worked, folder = time.perf_counter(), time.process_time(), Folder(path=Path(order.folder))
    if (done := folder.read_row(order.row.index)) is not None:  # by a worker that was lost before it could say so
        return done
    found: dict[str, Any] = {}
    plan = None
    try:
        plan, found = _made(order, folder)
    except OutputError:  # the disk is full: that says nothing of the plan
        raise
    except MultimodalError as error:
        found = {"status": REFUSED, "message": str(error)}
    except Exception as error:  # a plan that crashes is a row that says so
        found = {"status": CRASHED, "message": shortened(f"{type(error).__name__}: {said(error)}", LONGEST)}
    if plan is not None:
        file = folder.plan(order.row.index)
        make_folder(file.parent)
        plan.save(file)
        found["plan"] = str(file.relative_to(folder.path))
    found["cpu_seconds"] = time.process_time() - worked
    row = row_of(order, found, seconds=time.perf_counter() - started)
    folder.write_row(row)
    return row


def row_of(order: Order, found: Mapping[str, Any], *, seconds: float) -> dict[str, Any]:
    """Return the row of a plan.

    Args:
        order: of the plan.
        found: how it went.
        seconds: wall time of all of it [s].
    """
    row = order.row
    return {
        "index": row.index,
        "inputs": dict(row.inputs),
        "scenario": row.scenario["name"],
        "robot": row.robot,
        "seed": row.seed,
        "solved": False,
        "audit_holds": False,
        **found,
        "started_from": order.started_from,
        "attempts": order.attempts,
        "seconds": seconds,
        **order.facts,
    }


def _made(order: Order, folder: Folder) -> tuple[Trajectory, dict[str, Any]]:
    row = order.row
    source = variant(row.robot, row.robot_changes, folder.robots) if row.robot_changes else None
    scenario, robot = from_dict(row.scenario), row.robot if source is None else str(source)
    if order.started_from is None:
        problem, start = build(_robot(robot), scenario), None
    else:
        problem, start = _bound(robot, scenario, order.base), Trajectory.load(folder.plan(order.started_from))
    solution = solve(problem, Ipopt(time_limit=order.time_limit), start=start)
    report = audit(problem.robot, solution.trajectory, scenario)
    name, share = worst_of(report)
    found = {
        "status": solution.status.value,
        "solved": solution.status.solved,
        "message": solution.solver_message,
        "iterations": solution.iterations,
        "objective": solution.objective,
        "solve_seconds": solution.solve_time,
        "audit_holds": report.holds,
        "audit_worst": name,
        "audit_worst_over_limit": share,
        "robot_folder": None if source is None else str(source.relative_to(folder.path)),
    }
    if order.simulate and solution.status.solved:
        found |= _played(problem.robot, solution.trajectory)
    return solution.trajectory, found


def _played(robot: Robot, plan: Trajectory) -> dict[str, Any]:
    from multimodal_to import simulation  # MuJoCo is an extra

    try:
        followed = simulation.tracking(simulation.play(robot, plan))
    except OutputError:  # MuJoCo is not installed here
        raise
    except MultimodalError as error:  # the plan stands
        return {"survived": False, "simulated_end": str(error)}
    return {"survived": followed.survived, "simulated_end": followed.end}


@lru_cache(maxsize=_KEPT)
def _robot(robot: str) -> Robot:
    return load_robot(robot)


def _bound(robot: str, scenario: Scenario, base: Mapping[str, Any]) -> Problem:
    """Return the problem of a scenario whose start guess is not used: where it can be, a base's with other bounds.

    The base is the same for every plan of a tree, so what comes out does not depend on what the process made before.

    Args:
        robot: bundled one by name, or a folder.
        scenario: of the plan.
        base: scenario of the plan at the beginning of its tree.
    """
    first = from_dict(base)
    shared = replace(scenario, **{name: getattr(first, name) for name in _BOUND})
    if not same_terms(scenario, shared):
        return build(_robot(robot), scenario)
    return rebind(_built(robot, to_json(shared)), scenario)


@lru_cache(maxsize=_KEPT)
def _built(robot: str, scenario: str) -> Problem:
    return build(_robot(robot), from_dict(json.loads(scenario)))


def worst_of(report: Audit) -> tuple[str, float]:
    """Return the property that is nearest to its limit or farthest beyond, and its share of the limit."""
    shares = [(finding.worst / finding.limit, finding.name) for finding in report.findings if finding.limit > 0.0]
    failed = [
        (finding.worst / max(finding.limit, 1e-12), finding.name) for finding in report.findings if not finding.holds
    ]
    share, name = max(failed or shares)
    return name, float(share)


@cache
def facts() -> dict[str, Any]:
    """Return the versions that plans are made with: of the library, its commit in a checkout, CasADi and Python."""
    return {
        "version": metadata.version("multimodal-to"),
        "casadi": metadata.version("casadi"),
        "python": platform.python_version(),
        "commit": _commit(),
    }


def _commit() -> str:
    """Return the commit of the checkout that the library runs from, `-dirty` where files differ; empty for none."""
    here = Path(__file__).resolve().parents[3]
    if not (here / ".git").exists():
        return ""
    try:
        found = subprocess.run(
            ["git", "-C", str(here), "describe", "--always", "--dirty", "--exclude", "*"],
            capture_output=True,
            text=True,
            timeout=10.0,
            check=True,
        )
    except (OSError, subprocess.SubprocessError):
        return ""
    return found.stdout.strip()

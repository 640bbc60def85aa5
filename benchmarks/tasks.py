"""Any robot, nothing tuned: `robot init` on URDFs of others, then every starter task, as tables in Markdown.

    python benchmarks/tasks.py [ROBOT ...] [--task TASK ...] [--jobs N] [--keep DIR] [--into docs/tasks.md]

Needs the packages `example-robot-data` and `icub-models`. Of each robot only its URDF is given, and of a drone
the links of its engines. Seconds are processor time of the solve; iterations do not depend on the machine. `--keep`
writes the robots' folders and the motions, to look at.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from collections.abc import Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import multimodal_to as mt
from multimodal_to.files.packages import package_file
from multimodal_to.trajectory.derived import footsteps
from pages import put

BY_HAND = 0
"""Lines of configuration that were written by hand, for all robots together: there is no place for any."""
HEAD = ("robot", "task", "status", "audit", "moves", "iterations", "seconds", "lines by hand")


def _example(path: str) -> Path:
    found = package_file("example-robot-data", f"robots/{path}")
    if found is None:
        raise SystemExit(f"example-robot-data has no '{path}'")
    return found


def _icub() -> Path:
    import icub_models

    return Path(icub_models.get_model_file("iCubGazeboV2_7"))


ROTORS = tuple(f"iris__rotor_{index}" for index in range(4))
URDFS: Mapping[str, str] = {
    "solo12": "solo_description/robots/solo12.urdf",
    "solo8": "solo_description/robots/solo.urdf",
    "anymal": "anymal_b_simple_description/robots/anymal.urdf",
    "talos": "talos_data/robots/talos_reduced.urdf",
    "icub": "",
    "panda": "panda_description/urdf/panda.urdf",
    "iris": "iris_description/robots/iris.urdf",
    "go1": "go1_description/urdf/go1.urdf",
    "go2": "go2_description/urdf/go2.urdf",
    "b1": "b1_description/urdf/b1.urdf",
    "a1": "a1_description/urdf/a1.urdf",
    "laikago": "laikago_description/urdf/laikago.urdf",
    "hyq": "hyq_description/robots/hyq_no_sensors.urdf",
    "anymal-c": "anymal_c_simple_description/urdf/anymal.urdf",
    "g1": "g1_description/urdf/g1_29dof_rev_1_0.urdf",
    "romeo": "romeo_description/urdf/romeo_small.urdf",
    "bolt": "bolt_description/robots/bolt.urdf",
}
"""URDFs of example-robot-data by a robot's name; the iCub's comes with icub-models."""
JETS: Mapping[str, tuple[str, ...]] = {"iris": ROTORS}


def urdf_of(name: str) -> Path:
    """Return the URDF of a robot of `URDFS`."""
    return _example(URDFS[name]) if URDFS[name] else _icub()


@dataclass(frozen=True, kw_only=True)
class Row:
    """What came of a robot and a task."""

    cells: tuple[str, ...]
    good: bool  # solved, and true by the audit


def tried(name: str, robot: mt.Robot, task: str, keep: Path) -> Row:
    """Solve a task and judge the answer.

    Args:
        name: of the robot in the table.
        robot: as `robot init` made it.
        task: name of a starter task.
        keep: folder for the motion.

    Raises:
        MultimodalError: the robot cannot do it.
    """
    scenario = mt.tasks.TASKS[task](robot)
    problem = mt.build(robot, scenario)
    began = time.process_time()
    solution = mt.solve(problem, mt.Ipopt(max_iterations=500))
    seconds = time.process_time() - began
    motion = solution.trajectory
    motion.save(keep / f"{name}-{task}.npz")
    verdict = mt.audit(problem.robot, motion, problem.scenario)
    wrong = [finding.name for finding in verdict.findings if not finding.holds]
    moves = f"{verdict.airborne:.2f} s in the air" if verdict.airborne else "stays on its feet"
    if scenario.gait is not None:
        moves = f"{len(footsteps(problem.robot, motion, scenario.surface))} steps"
    cells = (
        name,
        task,
        solution.status.value,
        "true" if not wrong else f"not: {', '.join(wrong[:2])}",
        moves,
        str(solution.iterations),
        f"{seconds:.1f}",
        str(BY_HAND),
    )
    return Row(cells=cells, good=solution.status.solved and not wrong)


def all_of(name: str, tasks: Sequence[str], keep: Path) -> tuple[list[Row], dict[str, list[str]]]:
    """Try tasks with a robot; return what was tried, and the tasks that were refused by reason.

    Args:
        name: of the robot.
        tasks: names of starter tasks.
        keep: folder for robots and motions.
    """
    rows, reasons = list[Row](), dict[str, list[str]]()
    try:
        robot = mt.robots.init(urdf_of(name), keep / name, jets=JETS.get(name, ())).robot
    except mt.MultimodalError as error:
        return rows, {f"`robot init`: {error}": list(tasks)}
    for task in tasks:
        try:
            rows.append(tried(name, robot, task, keep))
        except mt.MultimodalError as error:
            reasons.setdefault(str(error).replace(f"'{task}'", "it"), []).append(task)
        else:
            print("| " + " | ".join(rows[-1].cells) + " |", flush=True)
    return rows, reasons


def markdown(rows: Sequence[Row], refused: Mapping[str, Mapping[str, Sequence[str]]]) -> str:
    """Return the tables, and in one sentence how many are solved and true.

    Args:
        rows: what was tried.
        refused: tasks by reason, for each robot.
    """
    good = sum(row.good for row in rows)
    lines = [f"{good} of {len(rows)} are solved and true: {100 * good / max(len(rows), 1):.0f} %.", ""]
    lines += ["| " + " | ".join(HEAD) + " |", "|--" * len(HEAD) + "|"]
    lines += ["| " + " | ".join(row.cells) + " |" for row in rows]
    lines += ["", "Refused, each with its reason:", "", "| robot | tasks | reason |", "|--|--|--|"]
    for name, reasons in refused.items():
        lines += [f"| {name} | {', '.join(tasks)} | {reason} |" for reason, tasks in reasons.items()]
    return "\n".join(lines)


def main() -> None:
    """Try, and print the tables."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("robots", nargs="*", help=f"of {', '.join(URDFS)}; default: all")
    parser.add_argument("--task", nargs="+", default=list(mt.tasks.TASKS), help=f"of {', '.join(mt.tasks.TASKS)}")
    parser.add_argument("--jobs", type=int, default=1, help="how many robots at once")
    parser.add_argument("--keep", type=Path, metavar="DIR", help="write robots and motions there")
    parser.add_argument("--into", type=Path, metavar="PAGE", help="also set the tables between the marks of a page")
    chosen = parser.parse_args()
    with tempfile.TemporaryDirectory() as scratch:
        keep = chosen.keep or Path(scratch)
        keep.mkdir(parents=True, exist_ok=True)
        names = chosen.robots or list(URDFS)
        with ProcessPoolExecutor(chosen.jobs) as pool:
            found = dict(zip(names, pool.map(partial(all_of, tasks=chosen.task, keep=keep), names), strict=True))
        rows = [row for some, _ in found.values() for row in some]
        text = markdown(rows, {name: reasons for name, (_, reasons) in found.items()})
    print(f"\n{text}")
    if chosen.into:
        put(chosen.into, "tasks", text)


if __name__ == "__main__":
    main()

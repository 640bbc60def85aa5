"""Time bundled scenarios, each run in a process of its own: a Markdown table of medians.

    python benchmarks/solve.py [SCENARIO ...] [--runs 3] [--executable] [--without-native] [--tight]
                               [--reference short|full [--reference-of NAME ...]] [--growth] [--into PAGE]

A scenario is the name of a bundled one or a TOML file. A run solves it as the command line does without pictures, in a
process of its own, and then from Python: built, solved from its plain start guess, and solved again from that answer
for a target that is 2 cm higher: the height at mid-horizon where the scenario asks for one, otherwise that of the end.
A `Planner` then plans for the two targets in turn: the last of its re-plans has settled. How an iteration's time is
split is that of the last phase, the exact one.

* `--executable` takes the default problem, of plans that the robot carries out, in place of the paper's.
* `--without-native` measures everything once more without the native library: CasADi's functions and MUMPS.
* `--tight` goes on from an answer with a hundredth of the tolerance: how far its objective is above the converged one.
* `--reference` runs `paper_reference.py` too, for the scenarios that it has or those of `--reference-of`: `full` to its
  end, which takes up to half an hour each and compares whole times; `short` for some iterations, which compares
  building and the time of an iteration.
* `--growth` iterates the take-off a fixed number of times on several grids of the same duration.

The table goes to standard output and to `--output`, and between the marks of a page with `--into docs/performance.md`.
Times are wall times; let nothing else run, and set OMP_NUM_THREADS=1 for one core.
"""

from __future__ import annotations

import argparse
import json
import multiprocessing
import os
import platform
import resource
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from pathlib import Path
from typing import Any
from unittest.mock import patch

import multimodal_to as mt
from multimodal_to.scenarios.files import load
from multimodal_to.solving.machine import versions
from pages import put

HIGHER = 0.02  # by so much the target of the warm solve [m]
RE_PLANS = 5  # of a planner, for the higher target first and last
TIGHTER = 1e-2  # what --tight multiplies the tolerance with
GRIDS = (20, 35, 70, 140, 280)  # knots of --growth
GROWTH_ITERATIONS = 40  # of --growth, half of them rough
REFERENCE = Path(__file__).with_name("paper_reference.py")
REFERENCES = ("take-off", "walk-to-fly", "jump")  # that it has
MARKS = "solve", "solve executable"  # on the page: of the paper's problem, of the default one
UNKNOWN = "–"

Figures = dict[str, Any]
KINDS = {
    "Hessian": ("nlp_hess_l",),
    "Jacobian": ("nlp_jac_g",),
    "other functions": ("nlp_f", "nlp_g", "nlp_grad_f", "nlp_grad"),
    "watching": ("callback_fun",),
}
"""Kinds of work in an iteration, as CasADi names their times; the rest is IPOPT's own and its linear algebra."""


EXECUTABLE, NATIVE = "MULTIMODAL_TO_BENCHMARK_EXECUTABLE", "MULTIMODAL_TO_NATIVE"
"""Environment variables that the processes of the runs inherit."""
WITHOUT = ("command, cold [s]", "first solve [s]", "iterations", "iteration, whole [ms]", "objective", "warm solve [s]")
"""What a table shows of the runs without the native library."""


def executable() -> bool:
    """Return whether the default problem is measured, and not the paper's."""
    return bool(os.environ.get(EXECUTABLE))


def formulation() -> mt.Formulation:
    """Return the formulation that is measured."""
    return mt.Formulation.executable() if executable() else mt.Formulation.paper()


def scenario_of(name: str) -> mt.Scenario:
    """Return a bundled scenario, or that of a TOML file."""
    if name.endswith(".toml"):
        return load(name)
    return mt.scenarios.find(name) if executable() else mt.scenarios.paper(name)


def higher(scenario: mt.Scenario) -> mt.Scenario:
    """Return the task with a target that is `HIGHER`."""
    if scenario.mid_height_min is not None:
        return replace(scenario, mid_height_min=scenario.mid_height_min + HIGHER)
    x, y, z = scenario.final_com
    return replace(scenario, final_com=(x, y, z + HIGHER))


def per_iteration(last_phase: Mapping[str, Any]) -> Figures:
    """Return the time of an iteration in the last phase and how it is split [ms], from IPOPT's statistics of it."""
    count = max(int(last_phase["iter_count"]), 1)
    split = {kind: sum(last_phase.get(f"t_wall_{part}", 0.0) for part in parts) for kind, parts in KINDS.items()}
    whole = last_phase["t_wall_total"]
    times = {"whole": whole, **split, "linear algebra and rest": whole - sum(split.values())}
    return {f"iteration, {kind} [ms]": 1e3 * spent / count for kind, spent in times.items()}


def peak_memory() -> float:
    """Return the peak memory of this process [MB]."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3  # Linux counts in kB


def command(name: str) -> Figures:
    """Run the whole command without pictures; it must end with an answer."""
    with tempfile.TemporaryDirectory() as folder:
        arguments = ["solve", name, "--quiet", "--no-pictures", "--output", folder]
        arguments += [] if executable() else ["--paper"]
        started = time.perf_counter()
        ended = subprocess.run([sys.executable, "-m", "multimodal_to", *arguments], check=False)
        spent = time.perf_counter() - started
        peak = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss / 1e3  # of the only child
        solved = ended.returncode == 0
    return {"command, cold [s]": spent, "command, peak memory [MB]": peak, "command has an answer": solved}


def library(name: str) -> Figures:
    """Build, solve and solve again from the answer, in this process."""
    robot, scenario = mt.load_robot("ironcub"), scenario_of(name)
    started = time.perf_counter()
    problem = mt.build(robot, scenario, formulation())
    built = time.perf_counter() - started
    cold = mt.solve(problem)
    peak = peak_memory()
    warm_problem = mt.build(robot, higher(scenario), formulation())
    warm = mt.solve(warm_problem, start=cold.trajectory)
    return {
        "variables": problem.lower.size,
        "rows": problem.row_lower.size,
        "build [s]": built,
        "first solve [s]": cold.solve_time,
        "iterations": cold.iterations,
        **per_iteration(cold.statistics),
        "peak memory [MB]": peak,
        "status": cold.status.value,
        **judged(problem, cold),
        "warm solve [s]": warm.solve_time,
        "warm iterations": warm.iterations,
        "warm status": warm.status.value,
        **{f"warm {key}": value for key, value in judged(warm_problem, warm).items()},
        **({} if os.environ.get(NATIVE) else settled(robot, scenario)),
    }


def settled(robot: mt.Robot, scenario: mt.Scenario) -> Figures:
    """Return the last of some re-plans, for the higher target and the target in turn."""
    planner = mt.Planner(robot, scenario, formulation())
    targets = scenario, higher(scenario)
    answers = [planner.solve()]
    for count in range(RE_PLANS):
        target = targets[count % 2 == 0]
        answers.append(planner.solve(final_com=target.final_com, mid_height_min=target.mid_height_min))
    return {
        "settled re-plan [s]": answers[-1].solve_time,
        "settled iterations": answers[-1].iterations,
        "settled objective": answers[-1].objective,
        "all re-plans feasible": all(answer.feasible for answer in answers),
    }


def judged(problem: mt.Problem, solution: mt.Solution) -> Figures:
    """Return what stands beside each time, so that nothing gets faster by a looser answer."""
    findings = mt.audit(problem.robot, solution.trajectory).findings
    failed = [finding.name for finding in findings if not finding.holds]
    return {
        "objective": solution.objective,
        "largest violation": max(solution.violations.values()),
        "audit": f"{len(failed)} of {len(findings)} fail" if failed else f"all {len(findings)} hold",
    }


def tight(name: str) -> Figures:
    """Solve, go on from the answer with a smaller tolerance, and compare the objectives."""
    problem = mt.build(mt.load_robot("ironcub"), scenario_of(name), formulation())
    default = mt.Ipopt()
    answer = mt.solve(problem, default)
    tighter = mt.solve(problem, replace(default, tolerance=TIGHTER * default.tolerance), start=answer.trajectory)
    return {
        "objective above the tighter one [%]": 100.0 * (answer.objective / tighter.objective - 1.0),
        "tighter status": tighter.status.value,
    }


def on_grid(scenario: mt.Scenario, knots: int) -> mt.Scenario:
    """Return a task with another number of knots, which last as long together."""
    ratio = scenario.knots / knots
    return replace(
        scenario, knots=knots, interval_min=ratio * scenario.interval_min, interval_max=ratio * scenario.interval_max
    )


def growth(knots: str) -> Figures:
    """Iterate the take-off on a grid of so many knots."""
    scenario = on_grid(scenario_of("take-off"), int(knots))
    started = time.perf_counter()
    problem = mt.build(mt.load_robot("ironcub"), scenario, formulation())
    built = time.perf_counter() - started
    solution = mt.solve(problem, mt.Ipopt(max_iterations=GROWTH_ITERATIONS))
    return {
        "variables": problem.lower.size,
        "build [s]": built,
        **per_iteration(solution.statistics),
        "peak memory [MB]": peak_memory(),
    }


def reference(name: str, length: str) -> Figures:
    """Run the paper's transcription, whose figures are one JSON object."""
    short = ["--short"] if length == "short" else []
    ended = subprocess.run(
        [sys.executable, str(REFERENCE), name, "--json", *short], check=True, capture_output=True, text=True
    )
    figures: Figures = json.loads(ended.stdout)[0]
    return figures


def ratios(here: Figures, paper: Figures, length: str) -> Figures:
    """Return how many times longer the paper's transcription takes."""
    compared = {
        "build": paper["build [s]"] / here["build [s]"],
        "iteration": 1e3 * paper["solver per iteration [s]"] / here["iteration, whole [ms]"],
    }
    if length == "full":
        compared |= {
            "solver": paper["solver [s]"] / here["first solve [s]"],
            "whole": paper["whole [s]"] / here["command, cold [s]"],
        }
    return {f"reference / here, {what}": f"{value:.3g}" for what, value in compared.items()}


def alone(task: Callable[[str], Figures], name: str, runs: int) -> list[Figures]:
    """Return the figures of several runs, each in a new process."""
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(max_workers=1, mp_context=context, max_tasks_per_child=1) as pool:
        return [pool.submit(task, name).result() for _ in range(runs)]


def medians(runs: Sequence[Figures]) -> Figures:
    """Return the median of every number, and of what is no number all that came out."""
    return {key: _median([figures[key] for figures in runs]) for key in runs[0]}


def _median(values: Sequence[Any]) -> float | str:
    if isinstance(values[0], (str, bool)):
        words = ["yes" if value is True else "no" if value is False else value for value in values]
        return ", ".join(dict.fromkeys(words))
    return float(statistics.median(values))


def whole(name: str, runs: int) -> Figures:
    """Return the figures of the whole command and of the library."""
    return medians(alone(command, name, runs)) | medians(alone(library, name, runs))


def measure(name: str, chosen: argparse.Namespace) -> Figures:
    """Return all that is asked for of a scenario."""
    figures = whole(name, chosen.runs)
    if chosen.without_native:
        with patch.dict(os.environ, {NATIVE: "0"}):
            plain = whole(name, chosen.runs)
        figures |= {f"without the native library: {key}": plain[key] for key in WITHOUT}
        figures["solver, times faster"] = plain["first solve [s]"] / figures["first solve [s]"]
    if chosen.tight:
        figures |= medians(alone(tight, name, 1))
    if chosen.reference and name in chosen.reference_of:
        figures |= ratios(figures, reference(name, chosen.reference), chosen.reference)
    return figures


def measure_growth(runs: int) -> list[Figures]:
    """Return the figures of each grid, with the factors to the grid before."""
    grids = [medians(alone(growth, str(knots), runs)) for knots in GRIDS]
    for before, here in zip([{}, *grids], grids, strict=False):
        for what in ("iteration, whole [ms]", "peak memory [MB]"):
            here[f"factor of {what.rpartition(' [')[0]}"] = here[what] / before[what] if before else UNKNOWN
    return grids


def table(titles: Sequence[str], columns: Sequence[Figures]) -> str:
    """Return a Markdown table with a row for each figure and a column for each case."""
    keys = list(dict.fromkeys(key for figures in columns for key in figures))
    rows = [[key, *(_cell(key, figures.get(key, UNKNOWN)) for figures in columns)] for key in keys]
    lines = [["", *titles], ["--"] * (len(titles) + 1), *rows]
    return "".join(f"| {' | '.join(cells)} |\n" for cells in lines)


def _cell(key: str, value: float | str) -> str:
    if isinstance(value, str):
        return value
    if value.is_integer():
        return f"{value:.0f}"
    return f"{value:.6g}" if key.endswith("objective") else f"{value:.3g}"


def this_machine() -> str:
    """Return what the times were taken on, as a sentence."""
    information = Path("/proc/cpuinfo")
    lines = information.read_text(encoding="utf-8").splitlines() if information.exists() else []
    models = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    known = versions()
    threads = os.environ.get("OMP_NUM_THREADS", "not set")
    return (
        f"{models[0] if models else platform.machine()}, {os.cpu_count()} cores, {platform.system()}, Python "
        f"{known['python']}, CasADi {known['casadi']}, IPOPT {known.get('ipopt', 'of unknown version')}, "
        f"OMP_NUM_THREADS {threads}."
    )


def main() -> None:
    """Measure and write the tables."""
    parser = argparse.ArgumentParser(description="Time scenarios.")
    parser.add_argument("scenario", nargs="*", help="names or TOML files; without, the paper's four")
    parser.add_argument("--runs", type=int, default=3, help="of which medians are taken")
    parser.add_argument("--executable", action="store_true", help="the default problem, not the paper's")
    parser.add_argument("--without-native", action="store_true", help="once more without the native library")
    parser.add_argument("--tight", action="store_true", help="compare with the objective of a tighter solve")
    parser.add_argument("--reference", choices=("short", "full"), help="run the paper's transcription too")
    parser.add_argument("--reference-of", nargs="+", choices=REFERENCES, default=REFERENCES, help="for these only")
    parser.add_argument("--growth", action="store_true", help="iterate the take-off on several grids")
    parser.add_argument("--output", type=Path, default=Path("results/solve.md"), help="file of the tables")
    parser.add_argument("--into", type=Path, metavar="PAGE", help="also set them between the marks of a page")
    chosen = parser.parse_args()
    if chosen.executable:
        os.environ[EXECUTABLE] = "1"
    names = chosen.scenario or ["take-off", "take-off-and-landing", "walk-to-fly", "jump"]
    titles = [scenario_of(name).name for name in names]  # a wrong name ends before anything is timed
    text = f"{this_machine()} Medians of {chosen.runs} runs.\n\n"
    text += table(titles, [measure(name, chosen) for name in names])
    if chosen.growth:
        grids = measure_growth(chosen.runs)
        text += f"\nTake-off on finer grids, {GROWTH_ITERATIONS} iterations each:\n\n"
        text += table([f"{knots} knots" for knots in GRIDS], grids)
    chosen.output.parent.mkdir(parents=True, exist_ok=True)
    chosen.output.write_text(text, encoding="utf-8")
    print(text)
    if chosen.into:
        put(chosen.into, MARKS[executable()], text)


if __name__ == "__main__":
    main()

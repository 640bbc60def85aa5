"""Time the functions that a solver calls, by tapes and by CasADi: a Markdown table of milliseconds of processor time.

    python benchmarks/derivatives.py [--knots 72] [--calls 30]

Both evaluate the same take-off at its start guess, in turns, in processes of their own with one thread each. A figure
is the smallest of all calls, as CasADi's `nlpsol` would make them; the building of the problem is the smallest of two.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import replace

import casadi as cs
import numpy as np

import multimodal_to as mt
from multimodal_to.native import instruction_set, library
from multimodal_to.ocp import evaluation

FUNCTIONS = ("objective", "rows", "gradient", "jacobian", "hessian", "cost_hessian")
PROBLEMS = ("default", "paper")
TURNS = 3


def problem_of(which: str, knots: int) -> mt.Problem:
    """Return the default take-off or the paper's."""
    scenario = mt.scenarios.take_off() if which == "default" else mt.scenarios.paper("take-off")
    formulation = mt.Formulation.executable() if which == "default" else mt.Formulation.paper()
    return mt.build(mt.load_robot("ironcub"), replace(scenario, knots=knots), formulation)


def smallest(call: Callable[[], object], calls: int) -> float:
    """Return the least processor time of some calls [ms]."""
    spent = []
    for _ in range(calls):
        started = time.process_time()
        call()
        spent.append(time.process_time() - started)
    return 1e3 * min(spent)


def prepared(function: cs.Function, x: np.ndarray) -> Callable[[], object]:
    """Return a call of a function's last output, with memory for it as a solver has it."""
    random = np.random.default_rng(0)
    sizes = [function.nnz_in(index) for index in range(function.n_in())]
    arguments = [x, *(random.normal(size=size) for size in sizes[1:])]
    buffer, evaluate = function.buffer()
    for index, argument in enumerate(arguments):
        if argument.size:
            buffer.set_arg(index, memoryview(argument))
    last = function.n_out() - 1
    result = np.zeros(function.nnz_out(last))
    buffer.set_res(last, memoryview(result))
    kept = (buffer, arguments, result)
    return lambda: (kept, evaluate())


def here(knots: int, calls: int) -> dict[str, float]:
    """Time this process, which has the native library or not."""
    evaluation.THREADS = 1
    opened = library()
    if opened is not None:
        opened.mt_set_threads(1)
    figures = {}
    for which in PROBLEMS:
        figures[f"{which}: build"] = smallest(lambda which=which: problem_of(which, knots), 2)
        problem = problem_of(which, knots)
        x = problem.guess + 0.01 * np.random.default_rng(1).normal(size=problem.guess.size)
        for name in FUNCTIONS:
            figures[f"{which}: {name.replace('_', ' ')}"] = smallest(prepared(getattr(problem.nlp, name), x), calls)
    return figures


def child(native: str, knots: int, calls: int) -> dict[str, float]:
    """Time a process that has the native library, or not where `native` is 0."""
    environment = {**os.environ, **({"MULTIMODAL_TO_NATIVE": native} if native else {})}
    command = [sys.executable, __file__, "--here", "--knots", str(knots), "--calls", str(calls)]
    return json.loads(subprocess.run(command, env=environment, check=True, capture_output=True, text=True).stdout)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description="Time the functions of a problem.")
    parser.add_argument("--knots", type=int, default=72)
    parser.add_argument("--calls", type=int, default=30)
    parser.add_argument("--here", action="store_true", help="time this process alone, as JSON")
    arguments = parser.parse_args()
    if arguments.here:
        print(json.dumps(here(arguments.knots, arguments.calls)))
        return
    turns = [[child(native, arguments.knots, arguments.calls) for native in ("0", "")] for _ in range(TURNS)]
    print(f"{arguments.knots} knots, one thread, {instruction_set() or 'no native library'}\n")
    print("|  | CasADi [ms] | tapes [ms] | ratio |\n| -- | -- | -- | -- |")
    for name in turns[0][0]:
        casadi, tapes = (min(turn[index][name] for turn in turns) for index in range(2))
        print(f"| {name} | {casadi:.3g} | {tapes:.3g} | {casadi / tapes:.3g} |")


if __name__ == "__main__":
    main()

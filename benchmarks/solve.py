"""Time a bundled scenario: building, solving, iterations and peak memory, each run in a process of its own.

python benchmarks/solve.py [SCENARIO] [RUNS]   (take-off, 3 runs; set OMP_NUM_THREADS=1 for one core)
"""

import json
import resource
import statistics
import subprocess
import sys
import time

import multimodal_to as mt


def run(name: str) -> dict[str, float | str]:
    """Return the figures of one run in this process."""
    robot = mt.load_robot("ironcub")
    started = time.perf_counter()
    problem = mt.build(robot, mt.scenarios.find(name))
    built = time.perf_counter()
    solution = mt.solve(problem)
    times = {kind: sum(value for key, value in solution.statistics.items() if key == f"t_wall_nlp_{kind}")
             for kind in ("g", "grad_f", "jac_g", "hess_l")}  # fmt: skip
    return {
        "status": solution.status.value,
        "build [s]": built - started,
        "solve [s]": solution.solve_time,
        "iterations": solution.iterations,
        "ms per iteration": 1e3 * solution.solve_time / solution.iterations,
        "functions, last solve [s]": sum(times.values()),
        "peak memory [MB]": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3,
        "objective": solution.objective,
        "largest violation": max(solution.violations.values()),
        "audit holds": float(mt.audit(problem.robot, solution.trajectory).holds),
    }


def main() -> None:
    """Run the scenario several times and print each figure's median."""
    if sys.argv[1:2] == ["--once"]:
        print(json.dumps(run(sys.argv[2])))
        return
    name, runs = (sys.argv[1:] + ["take-off", "3"][len(sys.argv) - 1 :])[:2]
    results = [
        json.loads(subprocess.run([sys.executable, __file__, "--once", name], check=True, capture_output=True).stdout)
        for _ in range(int(runs))
    ]
    print(f"{name}, median of {runs} runs")
    for key in results[0]:
        values = [result[key] for result in results]
        print(f"{key:28s}", values[0] if isinstance(values[0], str) else f"{statistics.median(values):.6g}")


if __name__ == "__main__":
    main()

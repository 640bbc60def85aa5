"""`relax`: the same rows, which may give way at a price; what gives way says what a task asks too much of."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import casadi as cs
import numpy as np
from numpy.typing import NDArray

from multimodal_to.adam.spatial import Array
from multimodal_to.errors import InputError, unknown
from multimodal_to.ocp.problem import Problem
from multimodal_to.solving import machine
from multimodal_to.solving.misses import Miss, misses_of_rows
from multimodal_to.solving.motion import motion
from multimodal_to.solving.solvers import Ipopt, Phase, Status
from multimodal_to.trajectory import Trajectory

GIVES_WAY = 1e-4
"""What a row has to give way by to be named, in solver units: 0.1 mm, 5e-3 N."""
_NEARNESS = 1e-5
"""What half the squared distance from the start costs, in solver units: little enough to move no row's price."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Relaxation:
    """What has to give way, as far as a local method can say."""

    status: Status  # of the relaxed problem
    gives_way: tuple[Miss, ...]  # families of rows, the largest amount first; none: the rows can be met
    trajectory: Trajectory  # the motion that is left
    iterations: int
    solve_time: float  # [s]


def relax(
    problem: Problem, start: Trajectory | None = None, solver: Ipopt | None = None, *, families: Sequence[str] = ()
) -> Relaxation:
    """Return which rows of a problem have to give way, and by how much, for the others and all bounds to hold.

    Minimises Σ (s⁺ + s⁻) + ½ κ |x − x₀|² subject to the bounds of x, s⁺, s⁻ ≥ 0 and the rows' bounds on
    g(x) + s⁺ − s⁻, in solver units. The sum of absolute values (l1) puts what has to give way on few rows; κ is small.

    Args:
        problem: from `build`.
        start: where an ordinary solve ended; by default the start guess.
        solver: whose limits hold, by default `Ipopt()`.
        families: names of the rows that may give way; by default all.

    Raises:
        InputError: there are no rows of a name, or the start is a motion of another robot.
    """
    solver, started = solver or Ipopt(), time.perf_counter()
    for name in families:
        if name not in problem.rows:
            raise InputError(unknown("rows", name, problem.rows))
    chosen = np.sort(np.concatenate([problem.rows[name].index for name in families or problem.rows]))
    x = problem.guess if start is None else problem.start_from(start)
    x, slacks, statistics = _run(problem, chosen, x, solver)
    amounts = np.zeros(problem.row_lower.size)
    amounts[chosen] = slacks
    return Relaxation(
        status=Ipopt.status(str(statistics["return_status"])),
        gives_way=misses_of_rows(problem, amounts, GIVES_WAY),
        trajectory=motion(problem, x),
        iterations=int(statistics["iter_count"]),
        solve_time=time.perf_counter() - started,
    )


@machine.one_blas_thread()
@machine.memory_kept()
def _run(
    problem: Problem, chosen: NDArray[np.int64], start: Array, solver: Ipopt
) -> tuple[Array, Array, dict[str, Any]]:
    """Solve the relaxed problem; return x, s⁺ + s⁻ of the chosen rows, and the solver's statistics."""
    count, elastic = start.size, chosen.size
    own = replace(solver, objective_scale=1.0, tolerance=1e-6)
    nlp, derivatives = _relaxed(problem, chosen, start)
    options = {
        "print_time": False,
        "error_on_fail": False,
        "ipopt": own.options(solver.max_iterations, solver.time_limit, Phase.EXACT),
        **derivatives,
    }
    function = cs.nlpsol("relaxed", "ipopt", nlp, options)
    at_start = problem.rows_at(start)[chosen]
    result = function(
        x0=np.concatenate(
            [
                start,
                np.maximum(problem.row_lower[chosen] - at_start, 0.0),
                np.maximum(at_start - problem.row_upper[chosen], 0.0),
            ]
        ),
        lbx=np.concatenate([problem.lower, np.zeros(2 * elastic)]),
        ubx=np.concatenate([problem.upper, np.full(2 * elastic, np.inf)]),
        lbg=problem.row_lower,
        ubg=problem.row_upper,
    )
    values = np.array(result["x"]).ravel()
    slacks = values[count : count + elastic] - values[count + elastic :]
    return values[:count], np.abs(slacks), dict(function.stats())


def _relaxed(
    problem: Problem, chosen: NDArray[np.int64], start: Array
) -> tuple[dict[str, cs.MX], dict[str, cs.Function]]:
    """Return the relaxed problem in (x, s⁺, s⁻) and its derivatives, by CasADi's names.

    The derivatives are the problem's own, with ±1 for each slack and κ on the diagonal.
    """
    count, rows, elastic = start.size, problem.row_lower.size, chosen.size
    y, p = cs.MX.sym("y", count + 2 * elastic), cs.MX.sym("p", 0)
    factor, multipliers = cs.MX.sym("lam_f"), cs.MX.sym("lam_g", rows)
    x, up, down = y[:count], y[count : count + elastic], y[count + elastic :]
    spread = cs.DM(cs.Sparsity(rows, elastic, list(range(elastic + 1)), chosen.tolist()), 1.0)
    added = cs.mtimes(spread, up - down)
    objective = cs.sum1(up) + cs.sum1(down) + 0.5 * _NEARNESS * cs.sumsqr(x - start)
    gradient = cs.vertcat(_NEARNESS * (x - start), cs.DM.ones(2 * elastic))
    g, jacobian = problem.nlp.jacobian(x, p)
    curvature = problem.nlp.hessian(x, p, 0.0, multipliers) + factor * _NEARNESS * cs.MX.eye(count)
    hessian = cs.diagcat(curvature, cs.MX(2 * elastic, 2 * elastic))
    derivatives = {
        "grad_f": cs.Function("nlp_grad_f", [y, p], [objective, gradient], ["x", "p"], ["f", "grad_f_x"]),
        "jac_g": cs.Function(
            "nlp_jac_g", [y, p], [g + added, cs.horzcat(jacobian, spread, -spread)], ["x", "p"], ["g", "jac_g_x"]
        ),
        "hess_lag": cs.Function(
            "nlp_hess_l", [y, p, factor, multipliers], [hessian], ["x", "p", "lam_f", "lam_g"], ["triu_hess_gamma_x_x"]
        ),
    }
    return {"x": y, "f": objective, "g": problem.nlp.rows(x) + added}, derivatives

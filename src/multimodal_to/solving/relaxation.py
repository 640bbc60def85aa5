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
from multimodal_to.arguments import checked
from multimodal_to.errors import InputError, unknown
from multimodal_to.native.stage_solver import KktStructure
from multimodal_to.ocp import contacts, failures, keyframes, limits, margins, paper, regions
from multimodal_to.ocp.problem import Problem
from multimodal_to.solving import linear_solvers, machine, stages
from multimodal_to.solving.ipopt import Ipopt, Pass
from multimodal_to.solving.motion import motion
from multimodal_to.solving.status import Status
from multimodal_to.solving.violations import Violation, unmet_terms
from multimodal_to.trajectory import Trajectory
from multimodal_to.values import Value

GIVES_WAY = 1e-4
"""What a row has to give way by to be named, in solver units: 0.1 mm, 5e-3 N."""
PHYSICS = 100.0
"""How much more it costs that a row of physics gives way than one of the task."""
GIVEN = 0.02
"""What it costs that a foot bears load where it is given to be off; the rest of what is asked costs 1.

A keyframe is missed once, and by little. Such feet bear the whole weight, at many knots.
"""
_NEARNESS = 1e-5
"""What half the squared distance from the start costs, in solver units: little enough to move no row's price."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Relaxation(Value):
    """What has to give way, as far as a local method can say."""

    status: Status  # of the relaxed problem
    gives_way: tuple[Violation, ...]  # terms, the largest amount first; none: all can be met
    price: float  # Σ of all amounts, weighted, in solver units
    trajectory: Trajectory  # the motion that is left
    iterations: int
    solve_time: float  # [s]


@checked
def relax(
    problem: Problem,
    start: Trajectory | None = None,
    solver: Ipopt | None = None,
    *,
    terms: Sequence[str] = (),
    physics: float = PHYSICS,
) -> Relaxation:
    """Return which terms of a problem have to give way, and by how much, for the others and all bounds to hold.

    Minimises Σ w (s⁺ + s⁻) + ½ κ |x − x₀|² subject to the bounds of x, s⁺, s⁻ ≥ 0 and the terms' bounds on
    g(x) + s⁺ − s⁻, in solver units. The sum of absolute values (l1) puts what has to give way on few rows; κ is small.
    What is asked of the motion has w = 1: keyframes, the clearance of feet that are given to be off, walls, boxes,
    jets that fail, limits over stretches, reach, margins and terms of one's own. Physics has `physics`: where that is
    large, it gives way only where no other row can. With 1 all rows are alike, and a motion that meets all of them is
    found more surely. Load of feet that are given to be off has `GIVEN`.

    Args:
        problem: from `build`.
        start: where an ordinary solve ended; by default the start guess.
        solver: whose limits hold, by default `Ipopt()`.
        terms: names of the constraints that may give way; by default all that are not `rigid`.
        physics: how much more it costs that a row of physics gives way than one of the task.

    Raises:
        InputError: there is no constraint of a name, the start is a motion of another robot, or `physics` is not at
            least 1.
    """
    if not 1.0 <= physics < np.inf:
        raise InputError(f"physics is {physics}; expected a number of at least 1")
    solver, started = solver or Ipopt(), time.perf_counter()
    known = tuple(dict.fromkeys((*problem.rows, *problem.bound_rows)))
    for name in terms:
        if name not in known:
            raise InputError(unknown("constraint", name, known))
    rigid = {term.name for term in problem.formulation.constraints if term.rigid}
    elastic = _Elastic.of(problem, terms or [name for name in known if name not in rigid], physics)
    x = problem.guess if start is None else problem.start_from(start)
    x, slacks, statistics = _run(problem, elastic, x, solver)
    amounts = np.zeros(elastic.lower.size)
    amounts[elastic.chosen] = slacks
    rows, bounds = elastic.split(amounts, problem.row_lower.size)
    return Relaxation(
        status=Ipopt.status(str(statistics["return_status"])),
        gives_way=unmet_terms(problem, rows, bounds, GIVES_WAY),
        price=float(elastic.weights @ slacks),
        trajectory=motion(problem, x),
        iterations=int(statistics["iter_count"]),
        solve_time=time.perf_counter() - started,
    )


@dataclass(frozen=True, kw_only=True, eq=False)
class _Elastic:
    """All rows of the relaxed problem: those of g, and behind them the bounds of x that may give way."""

    lower: Array  # of all rows, in solver units
    upper: Array
    chosen: NDArray[np.int64]  # the rows that may give way
    weights: Array  # of these
    bound_index: NDArray[np.int64]  # into x, of the rows behind g
    bound_terms: dict[str, slice]  # where each term stands among the rows behind g
    x_lower: Array  # of x, without the terms that may give way
    x_upper: Array

    @classmethod
    def of(cls, problem: Problem, terms: Sequence[str], physics: float = PHYSICS) -> _Elastic:
        """Return the rows of a problem of which those of some terms may give way.

        Args:
            problem: whose rows they are.
            terms: names of those that may.
            physics: what those of physics weigh.
        """
        x_lower, x_upper = problem.box_lower.copy(), problem.box_upper.copy()
        places, first = dict[str, slice](), 0
        for name, some in problem.bound_rows.items():
            if name in terms:
                places[name] = slice(first, first := first + some.index.size)
            else:
                np.maximum.at(x_lower, some.index, some.lower)
                np.minimum.at(x_upper, some.index, some.upper)
        behind = [problem.bound_rows[name] for name in places]
        count, asked = problem.row_lower.size, asked_terms(problem)
        prices = np.full(count + first, physics)
        for name in terms:
            if name in asked:
                price = GIVEN if name == contacts.GIVEN_OFF.name else 1.0
                prices[problem.rows[name].index if name in problem.rows else []] = price
                prices[count:][places.get(name, slice(0))] = price
        rows = [problem.rows[name].index for name in terms if name in problem.rows]
        chosen = np.sort(np.concatenate([*rows, count + np.arange(first)])).astype(np.int64)
        return cls(
            lower=np.concatenate([problem.row_lower, *(some.lower for some in behind)]),
            upper=np.concatenate([problem.row_upper, *(some.upper for some in behind)]),
            chosen=chosen,
            weights=prices[chosen],
            bound_index=np.concatenate([np.zeros(0, dtype=np.int64), *(some.index for some in behind)]),
            bound_terms=places,
            x_lower=x_lower,
            x_upper=x_upper,
        )

    def split(self, amounts: Array, rows: int) -> tuple[Array, dict[str, Array]]:
        """Return amounts of all rows as those of g, and those of the terms behind them by name."""
        return amounts[:rows], {name: amounts[rows:][place] for name, place in self.bound_terms.items()}


def asked_terms(problem: Problem) -> set[str]:
    """Return the names of the terms that are no physics: what the task asks for, and how far its plan keeps away."""
    keyframe_terms = keyframes.terms(problem.robot, problem.scenario, problem.formulation.rule.name)
    reach = (paper.CONTACT_REACH, paper.JET_REACH, paper.UPRIGHT_FIRST, paper.UPRIGHT_LAST)
    given = (contacts.GIVEN_OFF, contacts.CLEARANCE, regions.ROOM, limits.LIMITS, *failures.CONSTRAINTS)
    names = {term.name for term in (*keyframe_terms, *reach, *margins.CONSTRAINTS, *given)}
    return names | set(problem.formulation.own_terms)


def _structure(problem: Problem, elastic: _Elastic) -> KktStructure:
    """Return the structure of the relaxed problem's KKT matrix: s⁺ and s⁻ are of the knots of their rows."""
    row_knots = np.zeros(elastic.lower.size, dtype=np.int32)
    for rows in problem.rows.values():
        row_knots[rows.index] = rows.knots
    for name, place in elastic.bound_terms.items():
        row_knots[problem.row_lower.size :][place] = problem.bound_rows[name].knots
    slack_knots = row_knots[elastic.chosen]
    return stages.structure(
        np.concatenate([stages.variable_knots(problem), slack_knots, slack_knots]),
        np.concatenate([elastic.x_lower, np.zeros(2 * slack_knots.size)]),
        np.concatenate([elastic.x_upper, np.full(2 * slack_knots.size, np.inf)]),
        elastic.lower,
        elastic.upper,
    )


def _run(problem: Problem, elastic: _Elastic, start: Array, solver: Ipopt) -> tuple[Array, Array, dict[str, Any]]:
    """Solve the relaxed problem; return x, s⁺ + s⁻ of the chosen rows, and the solver's statistics."""
    own = replace(solver, objective_scale=1.0, tolerance=1e-6)
    options = own.options(solver.max_iterations, solver.time_limit, Pass.EXACT)
    with stages.offered(options, _structure(problem, elastic)) as structured:
        found = _minimised(problem, elastic, start, options)
        failed = stages.failure(structured, str(found[2]["return_status"]))
    return _run(problem, elastic, start, replace(solver, linear_solver=linear_solvers.MUMPS)) if failed else found


@machine.one_blas_thread()
@machine.memory_kept()
def _minimised(
    problem: Problem, elastic: _Elastic, start: Array, options: dict[str, Any]
) -> tuple[Array, Array, dict[str, Any]]:
    """Solve the relaxed problem with given options of IPOPT."""
    count, chosen = start.size, elastic.chosen
    nlp, derivatives = _relaxed(problem, elastic, start)
    settings = {
        "print_time": False,
        "no_nlp_grad": True,  # for the multipliers of parameters, of which there are none
        "calc_lam_p": False,
        "error_on_fail": False,
        "ipopt": options,
        **derivatives,
    }
    function = cs.nlpsol("relaxed", "ipopt", nlp, settings)
    at_start = np.concatenate([problem.rows_at(start), start[elastic.bound_index]])[chosen]
    lower, upper = elastic.lower[chosen], elastic.upper[chosen]
    result = function(
        x0=np.concatenate([start, np.maximum(lower - at_start, 0.0), np.maximum(at_start - upper, 0.0)]),
        lbx=np.concatenate([elastic.x_lower, np.zeros(2 * chosen.size)]),
        ubx=np.concatenate([elastic.x_upper, np.full(2 * chosen.size, np.inf)]),
        lbg=elastic.lower,
        ubg=elastic.upper,
    )
    values = np.array(result["x"]).ravel()
    slacks = values[count : count + chosen.size] - values[count + chosen.size :]
    return values[:count], np.abs(slacks), dict(function.stats())


def _relaxed(problem: Problem, elastic: _Elastic, start: Array) -> tuple[dict[str, cs.MX], dict[str, cs.Function]]:
    """Return the relaxed problem in (x, s⁺, s⁻) and its derivatives, by CasADi's names.

    The derivatives are the problem's own, with ±1 for each slack, 1 for each bound of x, and κ on the diagonal.
    """
    count, all_rows, slack_count = start.size, elastic.lower.size, elastic.chosen.size
    rows, bounds = problem.row_lower.size, elastic.bound_index
    y, p = cs.MX.sym("y", count + 2 * slack_count), cs.MX.sym("p", 0)
    factor, multipliers = cs.MX.sym("lam_f"), cs.MX.sym("lam_g", all_rows)
    x, up, down = y[:count], y[count : count + slack_count], y[count + slack_count :]
    spread = cs.DM(cs.Sparsity(all_rows, slack_count, list(range(slack_count + 1)), elastic.chosen.tolist()), 1.0)
    pick = cs.DM.triplet(list(range(bounds.size)), bounds.tolist(), cs.DM.ones(bounds.size), bounds.size, count)
    added = cs.mtimes(spread, up - down)
    weights = cs.DM(elastic.weights / elastic.weights.max(initial=1.0))  # large multipliers hide what κ holds
    objective = cs.dot(weights, up + down) + 0.5 * _NEARNESS * cs.sumsqr(x - start)
    gradient = cs.vertcat(_NEARNESS * (x - start), weights, weights)
    g, jacobian = problem.nlp.jacobian(x, p)
    whole = cs.vertcat(g, cs.mtimes(pick, x)) + added
    slopes = cs.horzcat(cs.vertcat(jacobian, pick), spread, -spread)
    curvature = problem.nlp.hessian(x, p, 0.0, multipliers[:rows]) + factor * _NEARNESS * cs.MX.eye(count)
    hessian = cs.diagcat(curvature, cs.MX(2 * slack_count, 2 * slack_count))
    derivatives = {
        "grad_f": cs.Function("nlp_grad_f", [y, p], [objective, gradient], ["x", "p"], ["f", "grad_f_x"]),
        "jac_g": cs.Function("nlp_jac_g", [y, p], [whole, slopes], ["x", "p"], ["g", "jac_g_x"]),
        "hess_lag": cs.Function(
            "nlp_hess_l", [y, p, factor, multipliers], [hessian], ["x", "p", "lam_f", "lam_g"], ["triu_hess_gamma_x_x"]
        ),
    }
    return {"x": y, "f": objective, "g": cs.vertcat(problem.nlp.rows(x), cs.mtimes(pick, x)) + added}, derivatives

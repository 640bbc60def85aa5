"""From stages to an NLP: values and exact derivatives built once per stage, mapped over the horizon, and assembled.

A `Stage` is what repeats: rows and costs as SX in (start knot, end knot, Δt). Its Jacobian and Hessian blocks are
small, and the horizon's matrices are these blocks at known places; deriving the whole graph would cost minutes.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import casadi as cs
import numpy as np
from numpy.typing import NDArray

from multimodal_to.adam.spatial import SX
from multimodal_to.ocp import compiled
from multimodal_to.ocp.lifting import Lifted

Integers = NDArray[np.int64]


THREADS = min(os.cpu_count() or 1, 4)
"""Threads that evaluate the stages; what comes out doesn't depend on their number."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Stage:
    """Rows and costs of the intervals that start at `starts`, in (z_k, z_k+1, Δt) in solver units."""

    name: str
    starts: Integers  # k of each interval
    start: SX  # z_k, (size, 1)
    end: SX  # z_k+1, (size, 1)
    interval: SX  # Δt, (1, 1)
    lifted_families: tuple[SX, ...]  # the rows by name, (m_i, 1) each, scaled; they may hold symbols of `lifted`
    lifted_costs: SX  # (c, 1), one per name, weighted; likewise
    lifted: Lifted

    @cached_property
    def _arguments(self) -> SX:
        return cs.vertcat(self.start, self.end, self.interval)

    @cached_property
    def families(self) -> tuple[SX, ...]:
        """Return the rows by name, (m_i, 1) each."""
        return tuple(
            cs.vertsplit(self.rows, [0, *np.cumsum([some.shape[0] for some in self.lifted_families]).tolist()])
        )

    @cached_property
    def rows(self) -> SX:
        """Return all rows, (m, 1)."""
        return self.lifted.expand(cs.vertcat(cs.SX(0, 1), *self.lifted_families))

    @cached_property
    def costs(self) -> SX:
        """Return the costs by name, (c, 1)."""
        return self.lifted.expand(self.lifted_costs)

    @property
    def repeats(self) -> int:
        """Return how many intervals the stage covers."""
        return int(self.starts.size)

    def positions(self, size: int, last: int) -> Integers:
        """Return where the stage's arguments stand among all variables, (arguments, repeats)."""
        local = np.arange(size)[:, None]
        return np.vstack(
            [local + size * self.starts, local + size * (self.starts + 1), np.full((1, self.repeats), last)]
        )

    def row_function(self) -> cs.Function:
        """Return (z, z⁺, Δt) → rows."""
        return self._function("rows", self.rows)

    def cost_function(self) -> cs.Function:
        """Return (z, z⁺, Δt) → costs by name."""
        return self._function("costs", self.costs)

    def jacobian(self) -> tuple[cs.Function, cs.Sparsity]:
        """Return (z, z⁺, Δt) → nonzeros of ∂rows/∂(z, z⁺, Δt), and their places.

        Each family is derived on its own: together they would share directions, at twice the operations.
        """
        blocks = [cs.jacobian(rows, self._arguments) for rows in self.families]
        return self._nonzeros("jacobian", cs.vertcat(cs.SX(0, self._arguments.shape[0]), *blocks))

    def gradient(self) -> tuple[cs.Function, cs.Sparsity]:
        """Return (z, z⁺, Δt) → nonzeros of the gradient of all costs, and their places."""
        return self._nonzeros("gradient", cs.sparsify(cs.gradient(cs.sum1(self.costs), self._arguments)))

    def cost_gradient(self, index: int) -> cs.Function:
        """Return (z, z⁺, Δt) → the whole gradient of one cost."""
        return self._function(f"cost_gradient_{index}", cs.gradient(self.costs[index], self._arguments))

    def hessian(self) -> tuple[cs.Function, cs.Sparsity]:
        """Return (z, z⁺, Δt, σ, λ) → nonzeros of the upper Hessian of σ Σ costs + λᵀ rows, and their places."""
        sigma, multipliers = cs.SX.sym("sigma"), cs.SX.sym("lambda", self.rows.shape[0])
        rows = cs.vertcat(cs.SX(0, 1), *self.lifted_families)
        lagrangian = sigma * cs.sum1(self.lifted_costs) + cs.dot(multipliers, rows)
        upper = self.lifted.hessian(lagrangian, self._arguments)
        return self._nonzeros("hessian", upper, sigma, multipliers)

    def cost_hessian(self) -> tuple[cs.Function, cs.Sparsity]:
        """Return (z, z⁺, Δt, σ) → nonzeros of the upper Hessian of σ Σ costs alone, and their places."""
        sigma = cs.SX.sym("sigma")
        upper = self.lifted.hessian(sigma * cs.sum1(self.lifted_costs), self._arguments)
        return self._nonzeros("cost_hessian", upper, sigma)

    def derivatives(self) -> tuple[cs.Function, ...]:
        """Return the functions that nothing is derived of."""
        pairs = (self.jacobian(), self.gradient(), self.hessian(), self.cost_hessian())
        return tuple(function for function, _ in pairs)

    def _nonzeros(self, kind: str, matrix: SX, *more: SX) -> tuple[cs.Function, cs.Sparsity]:
        values = cs.vertcat(*matrix.nonzeros()) if matrix.nnz() else cs.SX(0, 1)
        return self._function(kind, values, *more), matrix.sparsity()

    def _function(self, kind: str, output: SX, *more: SX) -> cs.Function:
        arguments = [self.start, self.end, self.interval, *more]
        return cs.Function(f"{self.name}_{kind}", arguments, [output])


@dataclass(frozen=True, kw_only=True, eq=False)
class Nlp:
    """Functions of all variables x = (vec Z, Δt) for CasADi's `nlpsol`, in its names and signatures."""

    rows: cs.Function  # x → g
    costs: cs.Function  # x → costs by stage and name, stacked
    objective: cs.Function  # x → f
    gradient: cs.Function  # grad_f: (x, p) → f, ∇f, with an empty p
    jacobian: cs.Function  # jac_g: (x, p) → g, ∂g/∂x
    hessian: cs.Function  # hess_lag: (x, p, λ_f, λ_g) → upper Hessian of the Lagrangian
    cost_hessian: cs.Function  # the same without the curvature of the rows

    @property
    def compiled(self) -> bool:
        """Return whether the Hessian, the costliest of them, is machine code."""
        return any(compiled.is_compiled(function) for function in self.hessian.find_functions())


def assemble(stages: Sequence[Stage], size: int, knots: int) -> Nlp:
    """Return the NLP of `knots` + 1 knots of `size` variables each, and one Δt.

    Rows are ordered by stage, then interval, then row.

    Args:
        stages: in the order of their rows.
        size: number of variables of a knot.
        knots: N, the number of intervals.
    """
    count = size * (knots + 1) + 1
    x, p = cs.MX.sym("x", count), cs.MX.sym("p", 0)
    factor, multipliers = cs.MX.sym("lam_f"), cs.MX.sym("lam_g", sum(s.rows.shape[0] * s.repeats for s in stages))
    inputs = [_gather(stage, x, size, knots) for stage in stages]

    rows, costs = [], []
    gradients, jacobians, hessians, cost_hessians = _Blocks(), _Blocks(), _Blocks(), _Blocks()
    first_row = 0
    for stage, arguments in zip(stages, inputs, strict=True):
        places = stage.positions(size, count - 1)
        height = stage.rows.shape[0]
        row_places = first_row + np.arange(height)[:, None] + height * np.arange(stage.repeats)
        own = cs.reshape(multipliers[first_row : first_row + height * stage.repeats], height, stage.repeats)
        first_row += height * stage.repeats

        rows.append(cs.vec(_mapped(stage.row_function(), stage.repeats)(*arguments)))
        costs.append(cs.sum2(_mapped(stage.cost_function(), stage.repeats)(*arguments)))
        function, pattern = stage.gradient()
        gradients.add(
            _derivative(function, stage.repeats)(*arguments), places[pattern.row()], np.zeros_like(places[:1])
        )
        function, pattern = stage.jacobian()
        row, column = pattern.get_triplet()
        jacobians.add(_derivative(function, stage.repeats)(*arguments), row_places[row], places[column])
        function, pattern = stage.hessian()
        row, column = pattern.get_triplet()
        sigmas = cs.repmat(factor, 1, stage.repeats)
        hessians.add(_derivative(function, stage.repeats)(*arguments, sigmas, own), places[row], places[column])
        function, pattern = stage.cost_hessian()
        row, column = pattern.get_triplet()
        cost_hessians.add(_derivative(function, stage.repeats)(*arguments, sigmas), places[row], places[column])

    all_rows, all_costs = cs.vertcat(*rows), cs.vertcat(*costs)
    objective = cs.sum1(all_costs)
    return Nlp(
        rows=cs.Function("rows", [x], [all_rows]),
        costs=cs.Function("costs", [x], [all_costs]),
        objective=cs.Function("objective", [x], [objective]),
        gradient=cs.Function(
            "nlp_grad_f", [x, p], [objective, cs.densify(gradients.matrix(count, 1))], ["x", "p"], ["f", "grad_f_x"]
        ),
        jacobian=cs.Function(
            "nlp_jac_g", [x, p], [all_rows, jacobians.matrix(first_row, count)], ["x", "p"], ["g", "jac_g_x"]
        ),
        hessian=_hessian(x, p, factor, multipliers, hessians.matrix(count, count)),
        cost_hessian=_hessian(x, p, factor, multipliers, cost_hessians.matrix(count, count)),
    )


def _mapped(function: cs.Function, repeats: int) -> cs.Function:
    """Return a function of `repeats` columns, evaluated by `THREADS` at once; each column is what it would be alone."""
    return function if repeats == 1 else function.map(repeats, "thread", min(THREADS, repeats))


def _derivative(function: cs.Function, repeats: int) -> cs.Function:
    """Return the same for a function that is not derived again, which may be machine code."""
    return _mapped(function if repeats == 1 else compiled.machine_code(function), repeats)


def _hessian(x: cs.MX, p: cs.MX, factor: cs.MX, multipliers: cs.MX, matrix: cs.MX) -> cs.Function:
    return cs.Function(
        "nlp_hess_l", [x, p, factor, multipliers], [matrix], ["x", "p", "lam_f", "lam_g"], ["triu_hess_gamma_x_x"]
    )


def _gather(stage: Stage, x: cs.MX, size: int, knots: int) -> tuple[cs.MX, cs.MX, cs.MX]:
    """Return the stage's arguments, one column per interval."""
    variables = cs.reshape(x[:-1], size, knots + 1)
    starts = stage.starts.tolist()
    ends = (stage.starts + 1).tolist()
    return variables[:, starts], variables[:, ends], cs.repmat(x[-1], 1, stage.repeats)


class _Blocks:
    """Nonzeros of many blocks with their places in one big matrix; places that coincide add up."""

    def __init__(self) -> None:
        self._values: list[cs.MX] = []
        self._rows: list[Integers] = []
        self._columns: list[Integers] = []

    def add(self, values: cs.MX, rows: Integers, columns: Integers) -> None:
        """Add blocks: nonzeros (nnz, repeats), with rows and columns that broadcast to that shape.

        Args:
            values: nonzeros of each block, (nnz, repeats).
            rows: where they stand, of a shape that broadcasts to that of the values.
            columns: likewise.
        """
        shape = tuple(values.shape)
        self._values.append(cs.vec(values))
        self._rows.append(np.broadcast_to(rows, shape).ravel(order="F"))
        self._columns.append(np.broadcast_to(columns, shape).ravel(order="F"))

    def matrix(self, height: int, width: int) -> cs.MX:
        """Return the (height, width) sum of all blocks."""
        keys = np.concatenate(self._columns) * height + np.concatenate(self._rows)
        places, first, index = np.unique(keys, return_index=True, return_inverse=True)
        starts = np.searchsorted(places, height * np.arange(width + 1))
        pattern = cs.Sparsity(height, width, starts.tolist(), (places % height).tolist())
        values = cs.vertcat(*self._values)
        again = np.setdiff1d(np.arange(keys.size), first, assume_unique=True)
        total = values[first.tolist()]
        if again.size:
            adder = cs.Sparsity(places.size, again.size, list(range(again.size + 1)), index[again].tolist())
            total += cs.mtimes(cs.DM(adder, np.ones(again.size)), values[again.tolist()])
        return cs.MX(pattern, total)

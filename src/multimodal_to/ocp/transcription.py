"""From stages to an NLP: values and exact derivatives built once per stage, evaluated at all intervals, and assembled.

A `Stage` is what repeats: rows and costs as SX in (start knot, end knot, Δt). Its Jacobian and Hessian blocks are
small, and the horizon's matrices are these blocks at known places; deriving the whole graph would cost minutes.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import casadi as cs
import numpy as np
from numpy.typing import NDArray

from multimodal_to.adam.spatial import SX
from multimodal_to.ocp.evaluation import Block, Entries, Evaluation, Output, mapped
from multimodal_to.ocp.lifting import Lifted

Integers = NDArray[np.int64]


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

    def block(self, function: cs.Function, size: int, last: int, first_row: int = 0) -> Block:
        """Return one of its functions at all its intervals.

        Args:
            function: of (z, z⁺, Δt), or of these, σ and λ.
            size: number of variables of a knot.
            last: place of Δt among all variables.
            first_row: place of the stage's first row among all rows.
        """
        repeats = np.arange(self.repeats)
        offsets = [size * self.starts, size * (self.starts + 1), np.full(self.repeats, last)]
        offsets += [np.zeros(self.repeats, dtype=np.int64), first_row + self.rows.shape[0] * repeats]
        count = int(function.n_in())
        return Block(function=function, sources=(0, 0, 0, 2, 3)[:count], offsets=np.array(offsets[:count]))

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

    def _nonzeros(self, kind: str, matrix: SX, *more: SX) -> tuple[cs.Function, cs.Sparsity]:
        values = cs.vertcat(*matrix.nonzeros()) if matrix.nnz() else cs.SX(0, 1)
        return self._function(kind, values, *more), matrix.sparsity()

    def _function(self, kind: str, output: SX, *more: SX) -> cs.Function:
        arguments = [self.start, self.end, self.interval, *more]
        return cs.Function(f"{self.name}_{kind}", arguments, [output])


@dataclass(frozen=True, kw_only=True, eq=False)
class Nlp:
    """Functions of all variables x = (vec Z, Δt) for CasADi's `nlpsol`, in its names and signatures.

    They are evaluated by tapes of the native library, where there is one. CasADi cannot derive them: `symbolic` can be.
    Whoever hands them to CasADi has to keep them.
    """

    rows: Evaluation  # x → g
    costs: Evaluation  # x → costs by stage and name, stacked
    objective: Evaluation  # x → f
    gradient: Evaluation  # grad_f: (x, p) → f, ∇f, with an empty p
    jacobian: Evaluation  # jac_g: (x, p) → g, ∂g/∂x
    hessian: Evaluation  # hess_lag: (x, p, λ_f, λ_g) → upper Hessian of the Lagrangian
    cost_hessian: Evaluation  # the same without the curvature of the rows

    @property
    def taped(self) -> bool:
        """Return whether all of them are evaluated by tapes."""
        every = (self.rows, self.costs, self.objective, self.gradient, self.jacobian, self.hessian, self.cost_hessian)
        return all(each.taped for each in every)


def assemble(stages: Sequence[Stage], size: int, knots: int) -> Nlp:
    """Return the NLP of `knots` + 1 knots of `size` variables each, and one Δt.

    Rows are ordered by stage, then interval, then row.

    Args:
        stages: in the order of their rows.
        size: number of variables of a knot.
        knots: N, the number of intervals.
    """
    count = size * (knots + 1) + 1
    none = np.zeros((1, 1), dtype=np.int64)
    rows, costs, gradients, jacobians, hessians, cost_hessians = (list[Entries]() for _ in range(6))
    first_row = first_cost = 0
    for stage in stages:
        places = stage.positions(size, count - 1)
        height = stage.rows.shape[0]
        row_places = first_row + np.arange(height)[:, None] + height * np.arange(stage.repeats)
        cost_places = first_cost + np.arange(stage.costs.shape[0])[:, None]
        rows.append(Entries(block=stage.block(stage.row_function(), size, count - 1), rows=row_places, columns=none))
        costs.append(Entries(block=stage.block(stage.cost_function(), size, count - 1), rows=cost_places, columns=none))
        function, pattern = stage.gradient()
        block = stage.block(function, size, count - 1)
        gradients.append(Entries(block=block, rows=places[pattern.row()], columns=none))
        function, pattern = stage.jacobian()
        row, column = pattern.get_triplet()
        block = stage.block(function, size, count - 1)
        jacobians.append(Entries(block=block, rows=row_places[row], columns=places[column]))
        function, pattern = stage.hessian()
        row, column = pattern.get_triplet()
        block = stage.block(function, size, count - 1, first_row)
        hessians.append(Entries(block=block, rows=places[row], columns=places[column]))
        function, pattern = stage.cost_hessian()
        row, column = pattern.get_triplet()
        block = stage.block(function, size, count - 1, first_row)
        cost_hessians.append(Entries(block=block, rows=places[row], columns=places[column]))
        first_row += height * stage.repeats
        first_cost += stage.costs.shape[0]

    rows, costs, gradients, jacobians, hessians, cost_hessians = (
        [some for some in each if some.block.outputs]
        for each in (rows, costs, gradients, jacobians, hessians, cost_hessians)
    )
    of_x, of_x_and_p = {"x": count}, {"x": count, "p": 0}
    of_all = {"x": count, "p": 0, "lam_f": 1, "lam_g": first_row}
    every_row = Output(name="g", shape=(first_row, 1), entries=rows, dense=True)
    every_cost = Output(name="costs", shape=(first_cost, 1), entries=costs, dense=True, in_order=True)
    objective = replace(every_cost, name="f", total=True)
    gradient = Output(name="grad_f_x", shape=(count, 1), entries=gradients, dense=True)
    jacobian = Output(name="jac_g_x", shape=(first_row, count), entries=jacobians)
    hessian, cost_hessian = (
        Output(name="triu_hess_gamma_x_x", shape=(count, count), entries=each) for each in (hessians, cost_hessians)
    )
    return Nlp(
        rows=Evaluation("rows", of_x, [every_row]),
        costs=Evaluation("costs", of_x, [every_cost]),
        objective=Evaluation("objective", of_x, [objective]),
        gradient=Evaluation("nlp_grad_f", of_x_and_p, [objective, gradient]),
        jacobian=Evaluation("nlp_jac_g", of_x_and_p, [every_row, jacobian]),
        hessian=Evaluation("nlp_hess_l", of_all, [hessian]),
        cost_hessian=Evaluation("nlp_hess_l", of_all, [cost_hessian]),
    )


def symbolic(stages: Sequence[Stage], x: cs.MX, size: int, knots: int) -> tuple[cs.MX, cs.MX]:
    """Return rows and objective at x as expressions that CasADi evaluates and derives itself.

    Args:
        stages: as for `assemble`.
        x: all variables.
        size: number of variables of a knot.
        knots: N, the number of intervals.
    """
    variables = cs.reshape(x[:-1], size, knots + 1)
    rows, costs = list[cs.MX](), list[cs.MX]()
    for stage in stages:
        starts, ends = variables[:, stage.starts.tolist()], variables[:, (stage.starts + 1).tolist()]
        arguments = starts, ends, cs.repmat(x[-1], 1, stage.repeats)
        rows.append(cs.vec(mapped(stage.row_function(), stage.repeats)(*arguments)))
        costs.append(cs.sum2(mapped(stage.cost_function(), stage.repeats)(*arguments)))
    return cs.vertcat(*rows), cs.sum1(cs.vertcat(*costs))

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

    def row_places(self, first: int) -> Integers:
        """Return where the stage's rows stand among all rows, (m, repeats); `first` is the place of the first one."""
        height = self.rows.shape[0]
        places: Integers = first + np.arange(height)[:, None] + height * np.arange(self.repeats)
        return places

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

    Rows are ordered by stage, then interval, then row. Each function is made when it is asked for first. They are
    evaluated by tapes of the native library, where there is one. CasADi cannot derive them: `symbolic` can be. Whoever
    hands them to CasADi has to keep them.
    """

    stages: tuple[Stage, ...]  # in the order of their rows
    size: int  # of a knot's variables
    knots: int  # N, the number of intervals

    @cached_property
    def rows(self) -> Evaluation:
        """Return x → g."""
        return Evaluation("rows", self._of_x, [self._every_row])

    @cached_property
    def costs(self) -> Evaluation:
        """Return x → costs by stage and name, stacked."""
        return Evaluation("costs", self._of_x, [self._every_cost])

    @cached_property
    def objective(self) -> Evaluation:
        """Return x → f."""
        return Evaluation("objective", self._of_x, [self._objective])

    @cached_property
    def gradient(self) -> Evaluation:
        """Return grad_f: (x, p) → f, ∇f, with an empty p."""
        entries = []
        for stage, places, _ in self._placed:
            function, pattern = stage.gradient()
            entries.append(Entries(block=self._block(stage, function), rows=places[pattern.row()], columns=_NONE))
        slope = Output(name="grad_f_x", shape=(self._count, 1), entries=_some(entries), dense=True)
        return Evaluation("nlp_grad_f", self._of_x | {"p": 0}, [self._objective, slope])

    @cached_property
    def jacobian(self) -> Evaluation:
        """Return jac_g: (x, p) → g, ∂g/∂x."""
        entries = []
        for stage, places, first_row in self._placed:
            function, pattern = stage.jacobian()
            row, column = pattern.get_triplet()
            block = self._block(stage, function)
            entries.append(Entries(block=block, rows=stage.row_places(first_row)[row], columns=places[column]))
        shape = (self._heights[-1], self._count)
        matrix = Output(name="jac_g_x", shape=shape, entries=_some(entries))
        return Evaluation("nlp_jac_g", self._of_x | {"p": 0}, [self._every_row, matrix])

    @cached_property
    def hessian(self) -> Evaluation:
        """Return hess_lag: (x, p, λ_f, λ_g) → upper Hessian of the Lagrangian."""
        return self._curvature([stage.hessian() for stage in self.stages])

    @cached_property
    def cost_hessian(self) -> Evaluation:
        """Return the same without the curvature of the rows."""
        return self._curvature([stage.cost_hessian() for stage in self.stages])

    def make(self, *names: str) -> None:
        """Make some of the functions now."""
        for name in names:
            getattr(self, name)

    @property
    def taped(self) -> bool:
        """Return whether all of them that were asked for so far are evaluated by tapes."""
        return all(some.taped for some in vars(self).values() if isinstance(some, Evaluation))

    @property
    def _count(self) -> int:
        return self.size * (self.knots + 1) + 1

    @property
    def _of_x(self) -> dict[str, int]:
        return {"x": self._count}

    @cached_property
    def _heights(self) -> list[int]:
        """Return where the rows of each stage begin, and how many there are in all."""
        return [0, *np.cumsum([stage.rows.shape[0] * stage.repeats for stage in self.stages]).tolist()]

    @cached_property
    def _placed(self) -> list[tuple[Stage, Integers, int]]:
        """Return each stage, where its arguments stand among all variables, and where its rows begin."""
        return [
            (stage, stage.positions(self.size, self._count - 1), first_row)
            for stage, first_row in zip(self.stages, self._heights, strict=False)
        ]

    @cached_property
    def _every_row(self) -> Output:
        entries = [
            Entries(block=self._block(stage, stage.row_function()), rows=stage.row_places(first_row), columns=_NONE)
            for stage, _, first_row in self._placed
        ]
        return Output(name="g", shape=(self._heights[-1], 1), entries=_some(entries), dense=True)

    @cached_property
    def _every_cost(self) -> Output:
        entries, first = list[Entries](), 0
        for stage in self.stages:
            places = first + np.arange(stage.costs.shape[0])[:, None]
            entries.append(Entries(block=self._block(stage, stage.cost_function()), rows=places, columns=_NONE))
            first += stage.costs.shape[0]
        return Output(name="costs", shape=(first, 1), entries=_some(entries), dense=True, in_order=True)

    @property
    def _objective(self) -> Output:
        return replace(self._every_cost, name="f", total=True)

    def _curvature(self, functions: Sequence[tuple[cs.Function, cs.Sparsity]]) -> Evaluation:
        entries = []
        for (stage, places, first_row), (function, pattern) in zip(self._placed, functions, strict=True):
            row, column = pattern.get_triplet()
            block = self._block(stage, function, first_row)
            entries.append(Entries(block=block, rows=places[row], columns=places[column]))
        matrix = Output(name="triu_hess_gamma_x_x", shape=(self._count, self._count), entries=_some(entries))
        inputs = self._of_x | {"p": 0, "lam_f": 1, "lam_g": self._heights[-1]}
        return Evaluation("nlp_hess_l", inputs, [matrix])

    def _block(self, stage: Stage, function: cs.Function, first_row: int = 0) -> Block:
        return stage.block(function, self.size, self._count - 1, first_row)


_NONE = np.zeros((1, 1), dtype=np.int64)


def _some(entries: Sequence[Entries]) -> list[Entries]:
    """Return the entries of blocks that have values."""
    return [each for each in entries if each.block.outputs]


def symbolic(stages: Sequence[Stage], x: cs.MX, size: int, knots: int) -> tuple[cs.MX, cs.MX]:
    """Return rows and objective at x as expressions that CasADi evaluates and derives itself.

    Args:
        stages: in the order of their rows.
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

"""Random KKT matrices of problems with knots in a row, and MA27's calling convention to factorise them by.

    python benchmarks/stage_matrices.py [--count 10000] [--seed 0]

Factorises that many matrices with the native library and judges each by its dense eigenvalues. Sizes, ranks and
inertias are drawn. Prints one line, and every matrix that was judged wrong; exit status 0 when there is none.
"""

from __future__ import annotations

import argparse
import ctypes
import sys
from collections import Counter
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from multimodal_to import native
from multimodal_to.native.stage_solver import KktStructure, StageSolver

SINGULAR = -5
"""INFO(1) of a matrix without a pivot."""
SMALL = 1e-11
"""An eigenvalue counts as zero below this share of the largest; above `SURE` of it, the matrix must be factorised."""
SURE = 1e-9

Floats = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True, eq=False)
class StageMatrix:
    """A KKT matrix, in the order of IPOPT's unknowns."""

    structure: KktStructure
    dense: Floats
    triplets: tuple[NDArray[np.int32], NDArray[np.int32], Floats]  # row, column and value, counted from one

    @property
    def rows(self) -> int:
        """Return the number of rows: of negative eigenvalues that the right inertia has."""
        return self.structure.inequalities + self.structure.equalities


def _knot_rows(
    rng: np.random.Generator, sizes: list[int], first: Any, shared: int, count: int, density: float
) -> Floats:
    """Return rows over the variables of one interval each, and now and then over others."""
    total = sum(sizes) + shared
    rows = np.zeros((count, total))
    for row in rows:
        knot = int(rng.integers(len(sizes)))
        columns = np.arange(first[max(knot - 1, 0)], first[knot] + sizes[knot])
        row[columns] = rng.standard_normal(columns.size) * (rng.random(columns.size) < density)
        if total and rng.random() < 0.02:
            row[int(rng.integers(total))] = 1.0  # of a knot far away
        row[total - shared :] = rng.standard_normal(shared) * (rng.random(shared) < 0.3)
    return rows


def _equations(rng: np.random.Generator, sizes: list[int], first: Any, shared: int, rank: str) -> Floats:
    """Return equality rows: some over an interval, some that define a variable, some that tie two knots."""
    total = sum(sizes) + shared
    rows = [_knot_rows(rng, sizes, first, shared, int(rng.integers(0, sum(sizes) // 4 + 1)), rng.uniform(0.2, 1.0))]
    for knot, size in enumerate(sizes):
        for _ in range(int(rng.integers(0, size // 3 + 1))):
            row = np.zeros((1, total))
            own = first[knot] + rng.permutation(size)
            row[0, own[1:4]] = rng.standard_normal(own[1:4].size)
            row[0, own[0]] = rng.choice([-1.0, 1.0, 0.05])
            if knot and sizes[knot - 1] and rng.random() < 0.5:
                row[0, first[knot - 1] + int(rng.integers(sizes[knot - 1]))] = -1.0
            rows.append(row)
    stacked = np.vstack(rows)
    if rank == "short" and len(stacked) > 1:
        stacked[-1] = stacked[0]  # linearly dependent
    if rank == "zero" and len(stacked):
        stacked[int(rng.integers(len(stacked)))] = 0.0
    return stacked


def _curvature(rng: np.random.Generator, sizes: list[int], first: Any, shared: int, kind: str) -> Floats:
    total = sum(sizes) + shared
    matrix = np.zeros((total, total))
    for knot, size in enumerate(sizes):
        places = np.r_[first[max(knot - 1, 0)] : first[knot] + size, total - shared : total]
        block = rng.standard_normal((places.size, places.size)) * (rng.random((places.size, places.size)) < 0.3)
        matrix[np.ix_(places, places)] += block + block.T
    if kind == "zero":
        return np.zeros_like(matrix)
    if kind == "convex" and total:
        matrix += np.eye(total) * (0.1 - min(np.linalg.eigvalsh(matrix).min(), 0.0))
    if kind == "wide":
        scale = 10.0 ** rng.uniform(-3, 3, total)
        matrix = matrix * scale[:, None] * scale
    return matrix


def draw(rng: np.random.Generator, knots: int | None = None, largest: int | None = None) -> StageMatrix:
    """Draw a matrix.

    Args:
        rng: what is drawn from.
        knots: by default 1 to 12.
        largest: variables of a knot; by default up to 8, now and then up to 30.
    """
    knots = int(rng.integers(1, 13)) if knots is None else knots
    largest = (30 if rng.random() < 0.1 else 8) if largest is None else largest
    sizes = [int(size) for size in rng.integers(0, largest + 1, knots)]
    first, shared = np.concatenate([[0], np.cumsum(sizes)]), int(rng.choice([0, 1, 1, 3]))
    rank = str(rng.choice(["full", "full", "full", "short", "zero"]))
    curvature = str(rng.choice(["convex", "convex", "any", "wide", "zero"]))
    a = _equations(rng, sizes, first, shared, rank)
    c = _knot_rows(rng, sizes, first, shared, int(rng.integers(0, 2 * sum(sizes) + 1)), rng.uniform(0.1, 1.0))
    delta = float(rng.choice([0.0, 0.0, 0.0, 1e-8, 1e-3]))
    structure = KktStructure(
        knots=knots,
        variable_knots=np.r_[np.repeat(np.arange(knots), sizes), np.full(shared, -1)].astype(np.int32),
        inequalities=len(c),
        equalities=len(a),
    )
    return assembled(rng, structure, _curvature(rng, sizes, first, shared, curvature), a, c, delta)


def assembled(
    rng: np.random.Generator, structure: KktStructure, w: Floats, a: Floats, c: Floats, delta: float
) -> StageMatrix:
    """Return the KKT matrix of a Hessian, of equality and of inequality rows.

    Args:
        rng: what the barrier's part of the slacks, and the triplets, are drawn from.
        structure: of the matrix.
        w: Hessian with the barrier's part, (n, n).
        a: equality rows, (m, n).
        c: inequality rows, (p, n).
        delta: what IPOPT subtracts from the diagonal of the rows.
    """
    n, m, p = w.shape[0], len(a), len(c)
    slack, equality, row = n, n + p, n + p + m
    dense = np.zeros((n + 2 * p + m,) * 2)
    dense[:n, :n] = w
    dense[range(slack, equality), range(slack, equality)] = 10.0 ** rng.uniform(-3, 4, p)
    dense[equality:row, :n], dense[row:, :n] = a, c
    dense[range(row, row + p), range(slack, equality)] = -1.0
    dense[range(equality, row + p), range(equality, row + p)] = -delta
    dense = np.tril(dense) + np.tril(dense, -1).T
    i, j = np.nonzero(np.tril(dense))
    extra = np.arange(dense.shape[0])  # diagonals that are zero are among IPOPT's entries
    i, j, values = np.r_[i, extra], np.r_[j, extra], np.r_[dense[i, j], np.zeros(extra.size)]
    twice = rng.integers(0, i.size, i.size // 10) if i.size else np.zeros(0, dtype=int)  # an entry in two parts
    part = rng.standard_normal(twice.size)
    np.subtract.at(values, twice, part)
    i, j, values = np.r_[i, i[twice]], np.r_[j, j[twice]], np.r_[values, part]
    over = rng.random(i.size) < 0.5  # either triangle
    i, j = np.where(over, j, i), np.where(over, i, j)
    return StageMatrix(
        structure=structure, dense=dense, triplets=((i + 1).astype(np.int32), (j + 1).astype(np.int32), values)
    )


class Ma27:
    """The library as IPOPT calls it: one object for one solver of IPOPT."""

    def __init__(self, library: ctypes.CDLL) -> None:
        self._library = library
        self._icntl, self._cntl = (ctypes.c_int * 30)(), (ctypes.c_double * 5)()
        self._info, self._one = (ctypes.c_int * 20)(), ctypes.c_int(1)
        self._size = ctypes.c_int(0)
        library.ma27id_(self._icntl, self._cntl)

    def structure(self, size: int, i: NDArray[np.int32], j: NDArray[np.int32]) -> int:
        """Hand over the structure; return INFO(1)."""
        self._size, self._count = ctypes.c_int(size), ctypes.c_int(i.size)
        self._i, self._j = np.ascontiguousarray(i), np.ascontiguousarray(j)
        self._library.ma27ad_(
            *self._refs(self._size, self._count, self._i, self._j), *[None] * 4, ctypes.byref(self._one), None,
            self._icntl, self._cntl, self._info, None,
        )  # fmt: skip
        return self._info[0]

    def factorise(self, values: Floats) -> tuple[int, int]:
        """Hand over the values; return INFO(1) and the number of negative eigenvalues."""
        values = np.ascontiguousarray(values)
        self._library.ma27bd_(
            *self._refs(self._size, self._count, self._i, self._j, values), *[None] * 4, ctypes.byref(self._one),
            ctypes.byref(ctypes.c_int()), None, self._icntl, self._cntl, self._info,
        )  # fmt: skip
        return self._info[0], self._info[14]

    def solve(self, right_side: Floats) -> tuple[int, Floats]:
        """Return INFO(1) and the solution."""
        x = np.array(right_side)
        self._library.ma27cd_(
            ctypes.byref(self._size),
            *[None] * 6,
            *self._refs(x),
            None,
            ctypes.byref(self._one),
            self._icntl,
            self._info,
        )
        return self._info[0], x

    @staticmethod
    def _refs(*arguments: Any) -> list[Any]:
        return [
            argument.ctypes.data_as(ctypes.c_void_p) if isinstance(argument, np.ndarray) else ctypes.byref(argument)
            for argument in arguments
        ]


def judge(library: ctypes.CDLL, matrix: StageMatrix, right_side: Floats) -> tuple[str, str]:
    """Factorise a matrix and solve with it; return how it ended, and what is wrong with that: nothing, if all is right.

    Args:
        library: the native one.
        matrix: what is factorised.
        right_side: what is solved for.
    """
    eigenvalues = np.linalg.eigvalsh(matrix.dense)
    largest = np.abs(eigenvalues).max(initial=1e-300)
    least = np.abs(eigenvalues).min(initial=largest) / largest
    negative = int((eigenvalues < 0).sum())
    i, j, values = matrix.triplets
    with StageSolver(library, matrix.structure) as solver, solver.announced():
        ma27 = Ma27(library)
        if ma27.structure(matrix.dense.shape[0], i, j):
            return "refused", f"the structure was refused: {solver.refusal}"
        ended, found = ma27.factorise(values)
        if ended == SINGULAR:
            return "singular", "" if least < SURE else f"called singular, but its least eigenvalue is {least:.1e}"
        if ended:
            return "failed", f"INFO(1) is {ended}: {solver.refusal}"
        if found != matrix.rows:
            wrong = least > SMALL and (negative == matrix.rows or (found < matrix.dense.shape[0] and found != negative))
            return "wrong inertia", f"{found} negative eigenvalues were found, of {negative}" if wrong else ""
        if least > SMALL and negative != found:
            return "right inertia", f"{found} negative eigenvalues were found, of {negative}"
        ended, x = ma27.solve(right_side)
        residual = np.abs(matrix.dense @ x - right_side).max(initial=0.0)
        size = np.abs(right_side).max(initial=0.0) + largest * np.abs(x).max(initial=0.0)
        if ended or (least > SMALL and not residual <= 1e-12 * size):
            return "right inertia", f"INFO(1) is {ended}, the residual {residual:.1e} of {size:.1e}"
        return "right inertia", ""


def main() -> int:
    """Judge many matrices; print what was found."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=10_000)
    parser.add_argument("--seed", type=int, default=0)
    asked = parser.parse_args()
    library = native.library()
    if library is None:
        print(native.missing())
        return 1
    ends, wrong = Counter[str](), 0
    for number in range(asked.count):
        rng = np.random.default_rng([asked.seed, number])
        matrix = draw(rng)
        end, fault = judge(library, matrix, rng.standard_normal(matrix.dense.shape[0]))
        ends[end] += 1
        if fault:
            wrong += 1
            print(f"matrix {number}: {fault}", flush=True)
    print(f"{asked.count} matrices: {', '.join(f'{count} {end}' for end, count in ends.most_common())}; {wrong} wrong")
    return int(wrong > 0)


if __name__ == "__main__":
    sys.exit(main())

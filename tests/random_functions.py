"""Random functions of scalars, drawn operation by operation, for CasADi and for tapes."""

from __future__ import annotations

import casadi as cs
import numpy as np
from numpy.typing import NDArray

UNARY = (
    *("SQ", "TWICE", "NEG", "INV", "SQRT", "SIN", "COS", "TAN", "ASIN", "ACOS", "ATAN", "SINH", "COSH", "TANH"),
    *("ASINH", "ACOSH", "ATANH", "EXP", "LOG", "EXPM1", "LOG1P", "ERF", "FABS", "SIGN", "FLOOR", "CEIL", "NOT"),
)
BINARY = (
    *("ADD", "SUB", "MUL", "DIV", "POW", "FMIN", "FMAX", "FMOD", "REMAINDER", "ATAN2", "HYPOT"),
    *("LT", "LE", "EQ", "NE", "AND", "OR", "IF_ELSE_ZERO"),
)
"""All but `COPYSIGN`: it reads the sign of a NaN, which is nobody's promise."""
COMMON = ("ADD", "SUB", "MUL")
"""Two of three operations are one of these, as in derivatives."""
CONSTANTS = (0.5, -2.0, 3.25, 1e-200, 1e200, np.inf, np.nan, 7.0)


def random_function(random: np.random.Generator, size: int, outputs: int = 20) -> cs.Function:
    """Return a function of three arguments with some `size` operations, each of values that were drawn before."""
    arguments = [cs.SX.sym(name, count) for name, count in (("a", 9), ("b", 1), ("c", 4))]
    values = [*cs.vertcat(*arguments).nonzeros(), *map(cs.SX, CONSTANTS)]
    for _ in range(size):
        recent = max(0, len(values) - 40)
        first, second = (values[random.integers(recent if random.random() < 0.7 else 0, len(values))] for _ in range(2))
        draw = random.random()
        if draw < 0.67:
            values.append(cs.SX.binary(getattr(cs, f"OP_{random.choice(COMMON)}"), first, second))
        elif draw < 0.85:
            values.append(cs.SX.binary(getattr(cs, f"OP_{random.choice(BINARY)}"), first, second))
        else:
            values.append(cs.SX.unary(getattr(cs, f"OP_{random.choice(UNARY)}"), first))
    chosen = [cs.densify(values[index]) for index in random.integers(len(values) // 2, len(values), outputs)]
    return cs.Function("random", arguments, [cs.vertcat(*chosen)])


def random_columns(random: np.random.Generator, function: cs.Function, knots: int) -> list[NDArray[np.float64]]:
    """Return arguments for a number of knots: of order one, some far from it."""
    shapes = [(function.nnz_in(index), knots) for index in range(function.n_in())]
    return [random.normal(size=shape) * 10.0 ** random.integers(-2, 2, shape) for shape in shapes]

"""A function's values at many knots, by a tape and by CasADi."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence

import casadi as cs
import numpy as np
import pytest
from numpy.typing import NDArray

from multimodal_to.native import library
from multimodal_to.native.tape import Horizon, Tape
from multimodal_to.ocp.tapes import tape_of
from random_functions import random_columns, random_function

Array = NDArray[np.float64]

needs_library = pytest.mark.skipif(library() is None, reason="there is no native library")


def taped(function: cs.Function) -> Tape:
    tape = tape_of(function)
    assert tape is not None, function
    return tape


def horizon_of(function: cs.Function, repeats: int, tape: Tape | None = None) -> Horizon:
    """Return the horizon whose only result is all values of a function, repeat by repeat."""
    arguments, outputs = function.n_in(), function.nnz_out(0)
    sizes = np.array([function.nnz_in(index) for index in range(arguments)], dtype=np.int64)
    horizon = Horizon(1)
    horizon.add(
        tape or taped(function),
        range(arguments),
        sizes[:, None] * np.arange(repeats),
        outputs,
    )
    nothing = np.zeros(0, dtype=np.int64)
    horizon.result(0, np.arange(repeats * outputs), nothing, nothing)
    return horizon


def run(horizon: Horizon, columns: Sequence[Array], outputs: int) -> Array:
    """Return the values (outputs, knots) for arguments (size, knots)."""
    arguments = [np.asfortranarray(each, dtype=np.float64) for each in columns]
    values = np.full((outputs, arguments[0].shape[1]), np.pi, order="F")
    horizon.run([each.ctypes.data for each in arguments], [values.ctypes.data])
    return values


def by_tape(function: cs.Function, *columns: Array) -> Array:
    return run(horizon_of(function, columns[0].shape[1]), columns, function.nnz_out(0))


def by_casadi(function: cs.Function, *columns: Array) -> Array:
    """Return the same from CasADi, knot by knot."""
    knots = columns[0].shape[1]
    return np.array(function.map(knots)(*columns)) if knots > 1 else np.array(function(*columns))


def same_bits(found: Array, expected: Array) -> bool:
    """Return whether all numbers are the same to the last bit, zeros in their sign too; one NaN is like another."""
    assert found.shape == expected.shape
    bits = [np.ascontiguousarray(each).view(np.int64) for each in (found, expected)]
    return bool(((bits[0] == bits[1]) | (np.isnan(found) & np.isnan(expected))).all())


def fuzzed() -> str:
    """Return what the values of some random functions hash to."""
    digest = hashlib.sha256()
    for seed in range(25):
        random = np.random.default_rng(seed)
        function = random_function(random, size=400)
        values = by_tape(function, *random_columns(random, function, knots=13))
        digest.update(np.where(np.isnan(values), np.nan, values).tobytes())
    return digest.hexdigest()

"""From CasADi's functions to tapes of the native library."""

from __future__ import annotations

import struct

import casadi as cs
import numpy as np
from numpy.typing import NDArray

from multimodal_to.native.library import library
from multimodal_to.native.tape import Tape, operations

Instructions = NDArray[np.int32]

_ROW = 32
"""Characters of an instruction in what `Function.serialize` says: four integers of eight half bytes, the low first."""
_PROBES = 32
"""How many instructions are read one by one, to be sure of the others."""


def tape_of(function: cs.Function) -> Tape | None:
    """Return the tape of a function with one output; None where it has none.

    There is none without the native library, nor for a function with an operation that tapes do not know, such as a
    call of another function. Its values are CasADi's then.

    Args:
        function: of scalars, as `casadi.Function` makes it of `casadi.SX`.
    """
    if library() is None or function.class_name() != "SXFunction" or function.n_out() != 1:
        return None
    rows = read(function)
    rows[:, 0] = _numbers()[rows[:, 0]]
    if (rows[:, 0] < 0).any():
        return None
    try:
        return Tape(rows, int(function.n_in()), int(function.nnz_out(0)))
    except ValueError:  # it holds too many values at once
        return None


def read(function: cs.Function) -> Instructions:
    """Return a function's instructions, (n, 4): CasADi's number of the operation, and i0, i1, i2 as it keeps them.

    CasADi hands out one at a time, at two microseconds each. What `serialize` says holds them all in a row, in a
    quarter of that time; where they are not found there, they are read one by one.
    """
    count = int(function.n_instructions())
    if not count:
        return np.zeros((0, 4), dtype=np.int32)
    probes = {int(k): _instruction(function, int(k)) for k in np.linspace(0, count - 1, min(_PROBES, count))}
    found = _found(function.serialize(), count, probes)
    if found is not None:
        return found
    rows = np.zeros((count, 4), dtype=np.int32)
    for k in range(count):
        row = _instruction(function, k)
        rows[k, : len(row)] = row
    return rows


def _found(text: str, count: int, probes: dict[int, tuple[int, ...]]) -> Instructions | None:
    """Return the instructions in a text: where those that are known are found at their distances from the first."""
    codes = "".join(f"{byte:02x}"[::-1] for byte in struct.pack("4i", *probes[0])).translate(_LETTERS)
    start = text.find(codes)
    while start >= 0:
        if start + _ROW * count <= len(text) and all(
            tuple(_decoded(text, start + _ROW * k, 1)[0, : len(row)]) == row for k, row in probes.items()
        ):
            return _decoded(text, start, count)
        start = text.find(codes, start + 1)
    return None


_LETTERS = str.maketrans("0123456789abcdef", "abcdefghijklmnop")


def _decoded(text: str, start: int, count: int) -> Instructions:
    letters = np.frombuffer(text[start : start + _ROW * count].encode("ascii"), dtype=np.uint8) - ord("a")
    return (letters[0::2] | letters[1::2] << 4).view("<i4").reshape(count, 4)


def _instruction(function: cs.Function, index: int) -> tuple[int, ...]:
    """Return an instruction in the order in which CasADi keeps it; only as much of it as says something."""
    operation = int(function.instruction_id(index))
    read, written = function.instruction_input(index), function.instruction_output(index)
    if operation == cs.OP_CONST:
        return (operation, written[0], *struct.unpack("2i", struct.pack("d", function.instruction_constant(index))))
    if operation == cs.OP_OUTPUT:
        return operation, written[0], read[0], written[1]
    return operation, *written[:1], *read[:2]


def _numbers() -> Instructions:
    """Return the number in a tape of each of CasADi's operations; −1: it has none."""
    numbers = np.full(1 + max(getattr(cs, name) for name in dir(cs) if name.startswith("OP_")), -1, dtype=np.int32)
    for name, number in operations().items():
        numbers[getattr(cs, f"OP_{name}")] = number
    return numbers

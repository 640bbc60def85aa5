"""Functions of scalars that run for several knots at once: `tape*.c` of the native library."""

from __future__ import annotations

import ctypes
import weakref
from collections.abc import Sequence
from functools import cache

import numpy as np
from numpy.typing import NDArray

from multimodal_to.native.library import library

Array = NDArray[np.float64]
Integers = NDArray[np.int64]

_POINTER, _INT64 = ctypes.c_void_p, ctypes.c_int64
_SIGNATURES = {
    "mt_tape_operation": (ctypes.c_char_p, (ctypes.c_int,)),
    "mt_tape_new": (_POINTER, (_INT64, _POINTER, _INT64, _INT64)),
    "mt_tape_delete": (None, (_POINTER,)),
    "mt_tape_count": (_INT64, (_POINTER,)),
    "mt_tape_registers": (_INT64, (_POINTER,)),
    "mt_horizon_new": (_POINTER, (_INT64,)),
    "mt_horizon_delete": (None, (_POINTER,)),
    "mt_horizon_add": (ctypes.c_int, (_POINTER, _POINTER, _INT64, _INT64, _POINTER, _POINTER, _INT64)),
    "mt_horizon_result": (ctypes.c_int, (_POINTER, _INT64, _INT64, _POINTER, _INT64, _POINTER, _POINTER)),
    "mt_horizon_run": (ctypes.c_int, (_POINTER, _POINTER, _POINTER, _POINTER)),
}


@cache
def _native() -> ctypes.CDLL:
    opened = library()
    if opened is None:
        raise RuntimeError("tapes need the native library; ask `native.library.library()` first")
    for name, (result, arguments) in _SIGNATURES.items():
        function = getattr(opened, name)
        function.restype, function.argtypes = result, arguments
    return opened


@cache
def operations() -> dict[str, int]:
    """Return the operations that a tape knows: by CasADi's name without `OP_`, its number in a tape."""
    names = iter(lambda: _native().mt_tape_operation(len(found)), None)
    found: dict[str, int] = {}
    for name in names:
        found[name.decode()] = len(found)
    return found


class Tape:
    """The operations of a function, in the memory of the library.

    Args:
        instructions: (n, 4), the rows operation, i0, i1, i2: a number of `operations`, the register that is written,
            and the two that are read. CONST: i1 and i2 are the halves of the number. INPUT: argument i1, nonzero i2.
            OUTPUT: nonzero i2 of the only output is register i1.
        arguments: how many the function has.
        outputs: how many nonzeros its output has.

    Raises:
        ValueError: an instruction makes no sense, or there are too many of them.
    """

    def __init__(self, instructions: NDArray[np.int32], arguments: int, outputs: int) -> None:
        rows = np.ascontiguousarray(instructions, dtype=np.int32)
        self.handle = _native().mt_tape_new(rows.shape[0], rows.ctypes.data, arguments, outputs)
        if not self.handle:
            raise ValueError(f"the {rows.shape[0]} instructions are no tape")
        _freed(self, "mt_tape_delete", self.handle)
        self.outputs = outputs

    @property
    def instructions(self) -> int:
        """Return how many instructions are left."""
        return int(_native().mt_tape_count(self.handle))

    @property
    def registers(self) -> int:
        """Return how many values the tape holds at once for a knot."""
        return int(_native().mt_tape_registers(self.handle))


class Horizon:
    """Functions at all their intervals, whose values add up to results.

    Args:
        results: how many there are.

    Raises:
        MemoryError: there is not enough memory; so do the methods.
    """

    def __init__(self, results: int) -> None:
        self._handle = _kept(_native().mt_horizon_new(results))
        _freed(self, "mt_horizon_delete", self._handle)
        self._tapes: list[Tape | None] = []  # they have to live as long
        self._results = results

    def add(self, tape: Tape | None, sources: Sequence[int], offsets: Integers, outputs: int) -> None:
        """Add a function.

        Args:
            tape: its tape; None: its values are brought to every run.
            sources: the array that each argument is a part of.
            offsets: where in that array it begins, (arguments, repeats).
            outputs: how many values it has.
        """
        source = np.ascontiguousarray(sources, dtype=np.int32)
        offset = np.ascontiguousarray(offsets, dtype=np.int64)
        self._tapes.append(tape)
        handle = None if tape is None else tape.handle
        _kept(
            _native().mt_horizon_add(
                self._handle, handle, offset.shape[1], offset.shape[0], source.ctypes.data, offset.ctypes.data, outputs
            )
        )

    def result(self, index: int, first: Integers, targets: Integers, terms: Integers) -> None:
        """Say what a result is the sum of, once all functions are there.

        Values count through the functions in their order, in each through its repeats, in each through its outputs.

        Args:
            index: which result.
            first: the first value of each of its numbers; −1: it is zero.
            targets: the numbers to which more values are added, ascending; values of one add up in their order.
            terms: those values.
        """
        arrays = [np.ascontiguousarray(each, dtype=np.int64) for each in (first, targets, terms)]
        first, targets, terms = arrays
        _kept(
            _native().mt_horizon_result(
                self._handle, index, first.size, first.ctypes.data, terms.size, targets.ctypes.data, terms.ctypes.data
            )
        )

    def run(
        self,
        sources: Sequence[int | None],
        results: Sequence[int | None],
        brought: Sequence[Array | None] | None = None,
    ) -> None:
        """Compute results.

        Args:
            sources: addresses of the arrays.
            results: addresses of where each is put; None: it is not computed.
            brought: values of the functions without a tape, (repeats, outputs); None where there is a tape, or where
                no result asks for them.
        """
        values = None
        if brought is not None:
            held = [None if each is None else np.ascontiguousarray(each) for each in brought]
            values = (_POINTER * len(held))(*(None if each is None else each.ctypes.data for each in held))
        _kept(
            _native().mt_horizon_run(
                self._handle, (_POINTER * len(sources))(*sources), (_POINTER * len(results))(*results), values
            )
        )


def _freed(owner: object, function: str, handle: int) -> None:
    """Free what a handle names when its owner goes; not at the end of the process, where a thread may still use it."""
    weakref.finalize(owner, getattr(_native(), function), handle).atexit = False


def _kept(returned: int | None) -> int:
    if not returned:
        raise MemoryError("there is not enough memory for the tapes, or values that have to be brought are not")
    return returned

"""Functions of a whole horizon that add up what the stages' functions return at each interval."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Self

import casadi as cs
import numpy as np
from numpy.typing import NDArray

from multimodal_to.adam.spatial import Array
from multimodal_to.native.library import library
from multimodal_to.native.tape import Horizon, Tape
from multimodal_to.ocp.tapes import tape_of

Integers = NDArray[np.int64]

THREADS = min(os.cpu_count() or 1, 4)
"""Threads of CasADi that evaluate a function without a tape; what comes out doesn't depend on their number."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Block:
    """A stage's function at all its intervals."""

    function: cs.Function  # with one output, a column
    sources: tuple[int, ...]  # which input of the whole each argument is a part of
    offsets: Integers  # where in that input it begins, (arguments, repeats)

    @property
    def repeats(self) -> int:
        """Return how many intervals there are."""
        return int(self.offsets.shape[1])

    @property
    def outputs(self) -> int:
        """Return how many values an interval has."""
        return int(self.function.nnz_out(0))

    @cached_property
    def tape(self) -> Tape | None:
        """Return the function's tape, if it has one."""
        return tape_of(self.function)

    @cached_property
    def _mapped(self) -> cs.Function:
        return mapped(self.function, self.repeats)

    def values(self, inputs: Sequence[Array]) -> Array:
        """Return the values as CasADi computes them, (repeats, outputs)."""
        values = np.empty((self.repeats, self.outputs))
        columns = [
            np.ascontiguousarray(inputs[source][offsets[:, None] + np.arange(self.function.nnz_in(index))])
            for index, (source, offsets) in enumerate(zip(self.sources, self.offsets, strict=True))
        ]
        buffer, evaluate = self._mapped.buffer()  # CasADi reads and writes these arrays themselves
        for index, column in enumerate(columns):
            if column.size:
                buffer.set_arg(index, column.ravel().data)
        buffer.set_res(0, values.ravel().data)
        evaluate()
        return values


def mapped(function: cs.Function, repeats: int) -> cs.Function:
    """Return a function of `repeats` columns, evaluated by `THREADS` at once; each column is what it would be alone."""
    return function if repeats == 1 else function.map(repeats, "thread", min(THREADS, repeats))


@dataclass(frozen=True, kw_only=True, eq=False)
class Entries:
    """Where the values of a block stand in a vector or a matrix."""

    block: Block
    rows: Integers  # of a shape that broadcasts to (outputs, repeats)
    columns: Integers  # likewise


@dataclass(frozen=True, kw_only=True, eq=False)
class Output:
    """A vector or a matrix: the sum of the entries of blocks."""

    name: str
    shape: tuple[int, int]
    entries: Sequence[Entries]
    dense: bool = False  # otherwise its nonzeros are where entries are
    in_order: bool = (
        False  # dense, each number from zero, value by value; otherwise its first value plus the others' sum
    )
    total: bool = False  # what is returned is the sum over a vector, one number


@dataclass(frozen=True, kw_only=True, eq=False)
class _Sum:
    """Which values an output is the sum of: they count through the blocks, their repeats and their outputs."""

    pattern: cs.Sparsity
    first: Integers  # the first value of each nonzero; −1: it is zero
    targets: Integers  # the nonzeros to which more values are added, ascending
    terms: Integers  # those values

    @classmethod
    def of(cls, output: Output, begins: dict[Block, int]) -> _Sum:
        """Return it for an output.

        Args:
            output: which.
            begins: where the values of each block begin.
        """
        (height, width), shapes = output.shape, [(some.block.outputs, some.block.repeats) for some in output.entries]
        values = [
            begins[some.block] + np.arange(shape[0])[:, None] + shape[0] * np.arange(shape[1])
            for some, shape in zip(output.entries, shapes, strict=True)
        ]
        keys = [
            np.broadcast_to(some.columns * height + some.rows, shape)
            for some, shape in zip(output.entries, shapes, strict=True)
        ]
        value, key = (_flat(each) for each in (values, keys))
        order = np.argsort(key, kind="stable")
        new = np.diff(key[order], prepend=-1) > 0
        places, first, terms = key[order[new]], value[order[new]], value[order[~new]]
        targets = (np.cumsum(new) - 1)[~new]
        if not output.dense:
            starts = np.searchsorted(places, height * np.arange(width + 1))
            pattern = cs.Sparsity(height, width, starts.tolist(), (places % height).tolist())
            return cls(pattern=pattern, first=first, targets=targets, terms=terms)
        firsts = np.full(height * width, -1)
        if output.in_order:
            return cls(pattern=cs.Sparsity.dense(height, width), first=firsts, targets=key[order], terms=value[order])
        firsts[places] = first
        return cls(pattern=cs.Sparsity.dense(height, width), first=firsts, targets=places[targets], terms=terms)

    def add_up(self, values: Array, out: Array) -> None:
        """Write the sums of values, behind which there is a zero, in the order in which a tape's are added."""
        out[:] = values[self.first]
        sums = np.zeros(out.size)
        np.add.at(sums, self.targets, values[self.terms])
        out[self.targets] = out[self.targets] + sums[self.targets]


def _flat(arrays: Sequence[Integers]) -> Integers:
    return np.concatenate([np.zeros(0, dtype=np.int64), *(each.ravel(order="F") for each in arrays)])


class Evaluation(cs.Callback):  # type: ignore[misc]
    """A function for CasADi that computes outputs by tapes, and by CasADi what has no tape.

    CasADi calls it with the memory of its inputs and outputs, so that nothing is copied. It keeps no state between
    calls, and several threads may call it at once.

    Args:
        name: of the function.
        inputs: name and size of each; they are columns.
        outputs: what it computes.
    """

    def __init__(self, name: str, inputs: dict[str, int], outputs: Sequence[Output]) -> None:
        cs.Callback.__init__(self)
        self._inputs, self._outputs = inputs, tuple(outputs)
        self._blocks = list(dict.fromkeys(some.block for output in outputs for some in output.entries))
        begins = np.cumsum([0, *(block.repeats * block.outputs for block in self._blocks)]).tolist()
        self._begins = dict(zip(self._blocks, begins, strict=False))
        self._count = begins[-1]
        self._sums = [_Sum.of(output, self._begins) for output in outputs]
        self._tapes = [None if library() is None else block.tape for block in self._blocks]
        self._horizon = None if library() is None else self._native()
        self.construct(name, {})

    def __copy__(self) -> Self:
        return self

    def __deepcopy__(self, memo: dict[int, Any]) -> Self:
        return self  # it does not change, so that copies of a problem share it

    def _native(self) -> Horizon:
        horizon = Horizon(len(self._outputs))
        for block, tape in zip(self._blocks, self._tapes, strict=True):
            horizon.add(tape, block.sources, block.offsets, block.outputs)
        for index, some in enumerate(self._sums):
            horizon.result(index, some.first, some.targets, some.terms)
        return horizon

    @property
    def taped(self) -> bool:
        """Return whether nothing of it is evaluated by CasADi."""
        return None not in self._tapes

    def get_n_in(self) -> int:
        """Return how many inputs there are; this and the rest is for CasADi."""
        return len(self._inputs)

    def get_n_out(self) -> int:
        """Return how many outputs there are."""
        return len(self._outputs)

    def get_name_in(self, index: int) -> str:
        """Return the name of an input."""
        return tuple(self._inputs)[index]

    def get_name_out(self, index: int) -> str:
        """Return the name of an output."""
        return self._outputs[index].name

    def get_sparsity_in(self, index: int) -> cs.Sparsity:
        """Return the shape of an input, dense."""
        return cs.Sparsity.dense(tuple(self._inputs.values())[index], 1)

    def get_sparsity_out(self, index: int) -> cs.Sparsity:
        """Return where an output may be other than zero."""
        return cs.Sparsity.dense(1, 1) if self._outputs[index].total else self._sums[index].pattern

    def has_eval_buffer(self) -> bool:
        """Return that it works on the memory that it is given."""
        return True

    def eval_buffer(self, arguments: Sequence[Any], results: Sequence[Any]) -> int:
        """Compute the outputs that have memory; return 0."""
        inputs = [
            np.frombuffer(given) if size and given is not None else np.zeros(size)
            for given, size in zip(arguments, self._inputs.values(), strict=True)
        ]
        vectors = [None if given is None else self._vector(index, given) for index, given in enumerate(results)]
        values = self._by_casadi(inputs, vectors)
        if self._horizon is None:
            self._add_up(values, vectors)
        else:
            self._horizon.run(_addresses(inputs), _addresses(vectors), values)
        for output, given, vector in zip(self._outputs, results, vectors, strict=True):
            if output.total and vector is not None:
                np.frombuffer(given)[0] = sum(vector.tolist())
        return 0

    def _vector(self, index: int, given: Any) -> Array | None:
        """Return where an output's numbers go: the memory that CasADi gives, unless they are added up."""
        size = self._sums[index].first.size
        if not size:
            return None
        return np.empty(size) if self._outputs[index].total else np.frombuffer(given)

    def _by_casadi(self, inputs: Sequence[Array], vectors: Sequence[Array | None]) -> list[Array | None] | None:
        """Return the values of those blocks without a tape that are asked for; None: all have one."""
        if self.taped:
            return None
        asked = {
            some.block
            for output, vector in zip(self._outputs, vectors, strict=True)
            if vector is not None
            for some in output.entries
        }
        return [
            block.values(inputs) if tape is None and block in asked else None
            for block, tape in zip(self._blocks, self._tapes, strict=True)
        ]

    def _add_up(self, values: Sequence[Array | None] | None, vectors: Sequence[Array | None]) -> None:
        flat = np.zeros(self._count + 1)
        for block, some in zip(self._blocks, values or (), strict=True):
            if some is not None:
                flat[self._begins[block] :][: some.size] = some.ravel()
        for place, vector in zip(self._sums, vectors, strict=True):
            if vector is not None:
                place.add_up(flat, vector)


def _addresses(arrays: Sequence[Array | None]) -> list[int | None]:
    return [None if each is None else each.__array_interface__["data"][0] for each in arrays]

"""`StageSolver`: the linear solver of the native library, for KKT matrices of problems with knots in a row."""

from __future__ import annotations

import ctypes
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from multimodal_to.errors import SolverError

_KNOT = ctypes.POINTER(ctypes.c_int)


@dataclass(frozen=True, kw_only=True, eq=False)
class KktStructure:
    """What the solver is told of a problem: sizes of IPOPT's KKT matrix, and the knot of each variable in it.

    The matrix is in the unknowns x (variables that are not fixed), s (a slack for each inequality row) and the
    multipliers of equality and of inequality rows. Everything else it finds in the entries.
    """

    knots: int  # knots, the first one counted
    variable_knots: NDArray[np.int32]  # of each free variable, from 0; −1: of no knot, as Δt
    inequalities: int
    equalities: int

    def equals(self, other: KktStructure) -> bool:
        """Return whether another structure says the same."""
        mine, theirs = ((some.knots, some.inequalities, some.equalities) for some in (self, other))
        return mine == theirs and np.array_equal(self.variable_knots, other.variable_knots)


@dataclass(frozen=True, kw_only=True)
class Counts:
    """What a solver has done; the fields are those of KktCounts in `kkt_solver.h`, in their order."""

    factorisations: float
    broken_off: float  # factorisations that ended early, as their inertia was certainly wrong
    wrong_inertia: float  # these and others
    singular: float
    without_definitions: float  # factorisations with more freedom to pivot, which take longer
    fronts: float
    solves: float
    refinements: float
    poor_solves: float  # solves after which the matrix was factorised again, with larger pivots
    seconds_factorising: float  # [s]
    seconds_solving: float  # [s]
    seconds_planning: float  # [s]
    operations: float  # of the dense part of a factorisation: multiplications and additions
    largest_front: float  # unknowns
    definitions: float  # variables that a row defines
    pairs: float


class _Counts(ctypes.Structure):
    _fields_ = [(field.name, ctypes.c_double) for field in fields(Counts)]


class StageSolver:
    """A linear solver for the matrices of one problem; IPOPT takes it for MA27 of the library that it is in.

    Raises:
        SolverError: there is no memory for it.
    """

    def __init__(self, library: ctypes.CDLL, structure: KktStructure) -> None:
        self._library, self._pointer, self._number = _declared(library), None, 0
        knots = np.ascontiguousarray(structure.variable_knots, dtype=np.int32)
        self._pointer = self._library.mt_kkt_new(
            knots.size, structure.inequalities, structure.equalities, structure.knots, knots.ctypes.data_as(_KNOT)
        )
        self._number = self._library.mt_kkt_open(self._pointer) if self._pointer else 0
        if not self._number:
            self.close()
            raise SolverError("there is not enough memory for the structured linear solver")

    @contextmanager
    def announced(self) -> Iterator[None]:
        """Let the solves of IPOPT that begin in this thread take this solver."""
        self._library.mt_kkt_announce(self._number)
        try:
            yield
        finally:
            self._library.mt_kkt_announce(0)

    @property
    def refusal(self) -> str:
        """Return why the solver refused a matrix, in one sentence; nothing where it has not."""
        words = self._library.mt_kkt_refusal(self._pointer)
        return "" if words is None else str(words.decode())

    @property
    def counts(self) -> Counts:
        """Return what the solver has done so far."""
        counts = _Counts()
        self._library.mt_kkt_counts(self._pointer, ctypes.byref(counts))
        return Counts(**{field.name: getattr(counts, field.name) for field in fields(Counts)})

    def close(self) -> None:
        """Give its memory back; it cannot be used any more."""
        if self._number:
            self._library.mt_kkt_close(self._number)
        if self._pointer:
            self._library.mt_kkt_free(self._pointer)
        self._pointer, self._number = None, 0

    def __enter__(self) -> StageSolver:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def _declared(library: ctypes.CDLL) -> ctypes.CDLL:
    """Say what the library's functions take and return."""
    library.mt_kkt_new.argtypes = [ctypes.c_int, ctypes.c_int, ctypes.c_int, ctypes.c_int, _KNOT]
    library.mt_kkt_new.restype = ctypes.c_void_p
    library.mt_kkt_open.argtypes = library.mt_kkt_free.argtypes = library.mt_kkt_refusal.argtypes = [ctypes.c_void_p]
    library.mt_kkt_free.restype = library.mt_kkt_close.restype = library.mt_kkt_announce.restype = None
    library.mt_kkt_refusal.restype = ctypes.c_char_p
    library.mt_kkt_close.argtypes = library.mt_kkt_announce.argtypes = [ctypes.c_int]
    library.mt_kkt_counts.argtypes, library.mt_kkt_counts.restype = [ctypes.c_void_p, ctypes.POINTER(_Counts)], None
    return library

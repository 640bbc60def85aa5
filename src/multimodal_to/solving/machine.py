"""What an answer depends on beside its inputs: versions of the packages, and the threads of the linear algebra."""

from __future__ import annotations

import ctypes
import os
import platform
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from functools import cache
from importlib import metadata
from pathlib import Path

import casadi as cs

_TRIM_THRESHOLD, _MMAP_MAX = -1, -4
"""Parameters of glibc's mallopt, from its malloc.h."""

_THREAD_VARIABLES = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")


def versions() -> dict[str, str]:
    """Return the versions of this library and of what it solves with, by name, as far as they are known."""
    return dict(_versions())


@cache
def _versions() -> dict[str, str]:
    found = {
        "multimodal-to": metadata.version("multimodal-to"),
        "casadi": str(cs.CasadiMeta.version()),
        "ipopt": _ipopt_version(),
        "numpy": metadata.version("numpy"),
        "python": platform.python_version(),
    }
    return {name: version for name, version in found.items() if version}


def threads() -> dict[str, int | str | None]:
    """Return how many threads the solver's BLAS uses (None: not known), the cores, and what the environment asks."""
    library = _blas()
    return {
        "blas": None if library is None else int(library.openblas_get_num_threads()),
        "cores": os.cpu_count(),
        **{name: os.environ[name] for name in _THREAD_VARIABLES if name in os.environ},
    }


@contextmanager
def one_blas_thread() -> Iterator[None]:
    """Let the BLAS below CasADi's solvers use one thread, so that its sums always add up in the same order.

    Where CasADi does not bring its own OpenBLAS nothing happens, and `threads` says so; there OMP_NUM_THREADS=1, set
    before Python starts, does the same.
    """
    library = _blas()
    if library is None:
        yield
        return
    before = int(library.openblas_get_num_threads())
    library.openblas_set_num_threads(1)
    try:
        yield
    finally:
        library.openblas_set_num_threads(before)


@contextmanager
def memory_kept() -> Iterator[None]:
    """Keep freed memory instead of giving it back, where the C library is glibc, and give it back at the end.

    MUMPS takes its workspace anew for each factorisation. Blocks of more than 32 MB, of long horizons, glibc takes from
    the system and returns each time, and the system fills them with zeros: an eighth of the time to solve.
    """
    library = _glibc()
    if library is None:
        yield
        return
    library.malloc_trim(0)
    library.mallopt(_MMAP_MAX, 0)
    library.mallopt(_TRIM_THRESHOLD, 2**31 - 1)
    try:
        yield
    finally:
        library.mallopt(_MMAP_MAX, 65536)  # its own values
        library.mallopt(_TRIM_THRESHOLD, 128 * 1024)
        library.malloc_trim(0)


@cache
def _glibc() -> ctypes.CDLL | None:
    library = ctypes.CDLL(None) if os.name == "posix" else None
    return library if library is not None and hasattr(library, "mallopt") and hasattr(library, "malloc_trim") else None


@cache
def _blas() -> ctypes.CDLL | None:
    library = _beside_casadi("libcasadi-tp-openblas")
    return library if library is not None and hasattr(library, "openblas_set_num_threads") else None


@cache
def _ipopt_version() -> str:
    library = _beside_casadi("libipopt")
    if library is None or not hasattr(library, "GetIpoptVersion"):
        return ""
    numbers = [ctypes.c_int() for _ in range(3)]
    library.GetIpoptVersion(*(ctypes.byref(number) for number in numbers))
    return ".".join(str(number.value) for number in numbers)


def _beside_casadi(stem: str) -> ctypes.CDLL | None:
    """Return a shared library that CasADi's wheel brings and its solver has loaded; the wheel holds copies of each."""
    cs.has_nlpsol("ipopt")  # loads it, in silence
    mode = getattr(os, "RTLD_NOLOAD", 0) | getattr(os, "RTLD_NOW", 0)
    for path in sorted(Path(cs.__file__).parent.glob(f"{stem}.*")):
        if path.suffix not in (".a", ".la"):
            with suppress(OSError):  # of a copy that nobody uses
                return ctypes.CDLL(str(path), mode=mode)
    return None

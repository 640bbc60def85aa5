"""Which linear solver IPOPT factorises with: what is here is found out without a risk to this process."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import casadi as cs

from multimodal_to import children, native
from multimodal_to.errors import InputError, SolverError, said, unknown

AUTO = "auto"
"""`STAGES` where the native library is, else the first of `_PREFERRED` that works, and MUMPS where none does."""
STAGES = "stages"
"""The native library's own: it factorises along the horizon, and IPOPT takes it for MA27."""
MUMPS = "mumps"
LINEAR_SOLVERS = (STAGES, MUMPS, "spral", "ma27", "ma57", "ma77", "ma86", "ma97", "pardiso", "pardisomkl")
"""Their names; all but the first are IPOPT's own."""
HSL_VARIABLE = "MULTIMODAL_TO_HSL"
"""The environment variable with the path of an HSL library."""

_PREFERRED = ("ma57", "ma97", "ma86", "ma27")
_HSL = tuple(f"lib{stem}{suffix}" for stem in ("hsl", "coinhsl") for suffix in (".so", ".dylib", ".dll"))
_LIBRARY_PATHS = ("LD_LIBRARY_PATH", "DYLD_LIBRARY_PATH")
_SYSTEM_FOLDERS = (
    "/usr/local/lib",
    "/usr/lib",
    "/usr/lib64",
    "/usr/lib/x86_64-linux-gnu",
    "/usr/lib/aarch64-linux-gnu",
    "/opt/homebrew/lib",
)
_PATIENCE = 30.0  # what a trial may take [s]; with MUMPS it takes 0.3
_MUMPS = {
    "mumps_pivtol": 1e-8,  # saves a fifth of the linear algebra
    "mumps_mem_percent": 50,  # of what it expects; by default it takes ten times that anew at each iteration
}

_TRIAL = """
import contextlib, sys
name, library, sys.path[:] = sys.argv[1], sys.argv[2], sys.argv[3:]
with contextlib.suppress(ImportError):  # a crash leaves no core file behind
    import resource
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
import casadi as cs
x = cs.SX.sym("x", 20)
options = {"linear_solver": name, "print_level": 0, "sb": "yes"} | ({"hsllib": library} if library else {})
problem = {"x": x, "f": cs.sumsqr(x - 1) + cs.sumsqr(x[1:] * x[:-1]), "g": cs.sum1(x)}
solver = cs.nlpsol("trial", "ipopt", problem, {"ipopt": options, "print_time": False})
solver(x0=0, lbg=5, ubg=5)
sys.exit(0 if solver.stats()["return_status"] == "Solve_Succeeded" else 1)
"""
"""Solves a tiny nonlinear programme, in a child process: naming MA97 where there is no HSL ends it with a crash."""


@dataclass(frozen=True, kw_only=True)
class LinearSolver:
    """A linear solver that is here."""

    name: str  # one of `LINEAR_SOLVERS`
    library: str = ""  # file of the library that it comes from, where that is neither CasADi nor IPOPT

    def options(self) -> dict[str, Any]:
        """Return the options that make IPOPT use it."""
        if self.name == STAGES:
            return {"linear_solver": "ma27", "hsllib": self.library, "linear_system_scaling": "none"}
        options: dict[str, Any] = {"linear_solver": self.name}
        if self.name == MUMPS:
            options |= _MUMPS
        if self.library:
            options["hsllib"] = self.library
        return options


def check(name: str, hsl_library: str = "") -> None:
    """Make sure that there is a linear solver of a name, here or elsewhere, and a file where one is named.

    Raises:
        InputError: the name is unknown, or the HSL library is no file.
    """
    if name not in (AUTO, *LINEAR_SOLVERS):
        raise InputError(unknown("linear solver", name, (AUTO, *LINEAR_SOLVERS)))
    if hsl_library and not Path(hsl_library).is_file():
        raise InputError(f"the HSL library '{hsl_library}' is no file")


def choose(name: str = AUTO, hsl_library: str = "") -> LinearSolver:
    """Return the linear solver of a name, or for `AUTO` the best one that is here.

    `STAGES` comes with this package and MUMPS with CasADi; they are not tried. All others are tried in a child process,
    which takes part of a second, once in the life of this one; for `AUTO` only where there is an HSL library and no
    native one.

    Args:
        name: `AUTO`, or one of `LINEAR_SOLVERS`.
        hsl_library: its file; otherwise the one that MULTIMODAL_TO_HSL names, otherwise one in the usual folders.

    Raises:
        InputError: the name is unknown, or the HSL library is no file.
        SolverError: the solver of that name is not here, or does not work.
    """
    check(name, hsl_library)
    own = native.library()
    if own is not None and name in (AUTO, STAGES):
        return LinearSolver(name=STAGES, library=own._name)
    if name == STAGES:
        raise SolverError(f"the linear solver '{STAGES}' cannot be used: {native.missing()}; 'mumps' needs nothing")
    takes_hsl = name == AUTO or _is_hsl(name)
    named = hsl_library or os.environ.get(HSL_VARIABLE, "") if takes_hsl else ""
    check(name, named)
    library = named or (next(_hsl_libraries(), "") if takes_hsl else "")
    if name == AUTO:
        works = (LinearSolver(name=hsl, library=library) for hsl in _PREFERRED if library and not _trial(hsl, library))
        return next(works, LinearSolver(name=MUMPS))
    failure = "" if name == MUMPS else _trial(name, library)
    if failure:
        raise SolverError(f"the linear solver '{name}' cannot be used, {failure}; {_advice(name, library)}")
    return LinearSolver(name=name, library=library)


def _is_hsl(name: str) -> bool:
    return name.startswith("ma")


def _advice(name: str, library: str) -> str:
    if _is_hsl(name) and library:
        return f"the HSL library '{library}' seems to lack it or to be broken; 'mumps' needs nothing"
    if _is_hsl(name):
        return (
            "it needs the HSL library, which was not found: build it from https://licences.stfc.ac.uk/product/coin-hsl "
            f"and name its file in {HSL_VARIABLE}; 'mumps' needs nothing"
        )
    return f"{_NEEDS[name]}; 'mumps' needs nothing"


_NEEDS = {
    "spral": "it needs an IPOPT with SPRAL, as in CasADi's wheels for Linux, and OMP_CANCELLATION=TRUE in the "
    "environment before Python starts",
    "pardiso": "it needs libpardiso of https://panua.ch in a folder of LD_LIBRARY_PATH",
    "pardisomkl": "it needs a CasADi whose IPOPT was built with Intel's MKL, which its wheels are not",
}


def _hsl_libraries() -> Iterator[str]:
    """Yield HSL libraries in the folders where the dynamic linker would look, in its order, and CasADi's own."""
    listed = [folder for variable in _LIBRARY_PATHS for folder in os.environ.get(variable, "").split(os.pathsep)]
    prefixes = [sys.prefix, os.environ.get("CONDA_PREFIX", "")]
    beside = [str(Path(cs.__file__).parent), *(str(Path(prefix) / "lib") for prefix in prefixes if prefix)]
    for folder in (*filter(None, listed), *beside, *_SYSTEM_FOLDERS):
        for name in _HSL:
            path = Path(folder, name)
            if path.is_file():
                yield str(path.resolve())


def _command(name: str, library: str) -> list[str]:
    """Return the command of a trial; the child imports from where this process does."""
    return [sys.executable, "-c", _TRIAL, name, library, *sys.path]


@cache
def _trial(name: str, library: str) -> str:
    """Solve a tiny programme in a child process; return nothing where it works, otherwise what went wrong."""
    try:
        ended = children.run(_command(name, library), timeout=_PATIENCE)
    except subprocess.TimeoutExpired:
        return f"a trial of it did not end within {_PATIENCE:g} s"
    except (OSError, ValueError) as error:
        return f"a trial of it did not start ({said(error)})"
    if ended < 0:
        return f"a trial of it crashed with signal {-ended}"
    return "a trial of it failed" if ended else ""

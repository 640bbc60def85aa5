"""Machine code of a problem's functions, kept on disk: several times faster than CasADi's walk through its operations.

A file is named by what its function says, operation by operation, so that what is found is what was asked for: another
robot, contact or weight has other files, another target, which no derivative sees, the same.
"""

from __future__ import annotations

import hashlib
import os
import platform
import shutil
import subprocess
from collections.abc import Iterable
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from pathlib import Path

import casadi as cs
import numpy as np
import platformdirs

from multimodal_to.errors import OutputError, SolverError
from multimodal_to.files.writing import scratch

CACHE_VARIABLE = "MULTIMODAL_TO_CACHE"
"""Environment variable that names another folder than the user's cache."""

_FLAGS = ("-O1", "-shared", "-fPIC")
"""A second level of optimisation takes seven times as long to compile, for 2 ms of an iteration's 105."""
_WORTHWHILE = 1000
"""Fewest operations of a function that is worth a file."""
_AGREEMENT = 1e-9
"""By how much machine code may differ from the function that it is of, relative to its largest value."""


def folder() -> Path:
    """Return the folder of the machine code, which may be deleted at any time."""
    named = os.environ.get(CACHE_VARIABLE)
    return (Path(named) if named else platformdirs.user_cache_path("multimodal-to", appauthor=False)) / "compiled"


def machine_code(function: cs.Function) -> cs.Function:
    """Return a function's machine code where there is some, otherwise the function itself."""
    if not _worthwhile(function) or not folder().is_dir() or _compiler() is None:
        return function
    path = _path(function)
    try:
        return cs.external(function.name(), str(path)) if path.is_file() else function
    except RuntimeError:  # it is no library, or one of another kind of machine
        return function


def is_compiled(function: cs.Function) -> bool:
    """Return whether a function is machine code, or a map of what is."""
    while function.class_name() in ("Map", "ThreadMap"):
        function = function.info()["f"]  # CasADi 3.7 finds no functions inside a map
    return bool(function.class_name() == "External")


def compile_functions(functions: Iterable[cs.Function]) -> tuple[Path, ...]:
    """Compile functions and keep what comes out, where it is not kept already; return the files of all.

    Raises:
        SolverError: there is no C compiler, it refuses, or what it makes says something else than the function.
        OutputError: the folder cannot be written to.
    """
    if _compiler() is None:
        raise SolverError("there is no C compiler; install gcc or clang, or name one in CC")
    try:
        folder().mkdir(parents=True, exist_ok=True)
        with ThreadPoolExecutor(os.cpu_count()) as pool:
            return tuple(pool.map(_compile, filter(_worthwhile, functions)))
    except OSError as error:
        raise OutputError(f"cannot write to the folder '{folder()}': {error.strerror}") from error


def _worthwhile(function: cs.Function) -> bool:
    return int(function.n_instructions()) >= _WORTHWHILE


def _path(function: cs.Function) -> Path:
    parts = (function.serialize(), cs.CasadiMeta.version(), platform.machine(), *(_compiler() or ()), *_FLAGS)
    return folder() / f"{hashlib.sha256(repr(parts).encode()).hexdigest()[:32]}.so"


def _compile(function: cs.Function) -> Path:
    path = _path(function)
    if path.is_file():
        return path
    command, _ = _compiler() or ("", "")
    with scratch(folder()) as place:
        source, made = place / "function.c", place / "function.so"
        generator = cs.CodeGenerator(source.name)
        generator.add(function)
        generator.generate(f"{place}{os.sep}")
        ended = subprocess.run(
            [command, *_FLAGS, str(source), "-o", str(made), "-lm"],
            capture_output=True,
            text=True,
            errors="replace",
            check=False,
        )
        if ended.returncode or not made.is_file():
            said = (ended.stderr.strip() or "it says nothing").splitlines()[0]
            raise SolverError(f"the compiler '{command}' refuses the code of {function.name()}: {said}")
        _compare(function, cs.external(function.name(), str(made)))
        os.replace(made, path)
    return path


def _compare(function: cs.Function, machine_code: cs.Function) -> None:
    """Make sure that both say the same somewhere."""
    random = np.random.default_rng(0)  # within (0.1, 1), where nothing is divided by zero
    somewhere = [random.uniform(0.1, 1.0, function.size_in(index)) for index in range(function.n_in())]
    expected, found = (np.array(each(*somewhere)) for each in (function, machine_code))
    if not np.allclose(found, expected, rtol=0.0, atol=_AGREEMENT * np.abs(expected).max(initial=1.0)):
        raise SolverError(f"the compiled code of {function.name()} says something else than the function")


@cache
def _compiler() -> tuple[str, str] | None:
    """Return the C compiler that CC names, or that is found, with what it says of its version."""
    for name in filter(None, (os.environ.get("CC"), "cc", "gcc", "clang")):
        found = shutil.which(name)
        if found is None:
            continue
        ended = subprocess.run([found, "--version"], capture_output=True, text=True, errors="replace", check=False)
        if ended.returncode == 0:
            return found, ended.stdout.split("\n", 1)[0]
    return None

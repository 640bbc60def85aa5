from __future__ import annotations

import ctypes
import os
import shutil
from collections.abc import Callable
from pathlib import Path

import pytest

from multimodal_to.native import compiling

SOURCES = sorted(Path(__file__).with_name("sources").glob("*.c"))
"""Functions for the tests, beside those of the package."""
STRICT = ("-Wall", "-Wextra", "-Werror", *os.environ.get("MULTIMODAL_TO_SANITIZED", "").split())
"""The flags of a sanitizer come from `benchmarks/native.py`."""


@pytest.fixture(scope="session")
def compiler() -> compiling.Compiler:
    try:
        return compiling.any_compiler()
    except compiling.BuildError as error:
        pytest.skip(str(error))


@pytest.fixture(scope="session")
def tested(compiler, tmp_path_factory) -> Path:
    """The library's file with the functions for the tests in it."""
    file = tmp_path_factory.mktemp("native") / compiling.library_name()
    return compiling.build(file, compiler, also=SOURCES, flags=STRICT)


@pytest.fixture
def opened_anew(tmp_path) -> Callable[[Path], ctypes.CDLL]:
    """Open a copy of a library's file: what it keeps in memory is its own."""

    def opened(file: Path) -> ctypes.CDLL:
        copy = Path(shutil.copy(file, tmp_path / f"copy-{len(list(tmp_path.iterdir()))}-{file.name}"))
        return ctypes.CDLL(str(copy))

    return opened

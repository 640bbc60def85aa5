"""Commands of the command line, run in this process or in one of their own."""

from __future__ import annotations

import io
import os
import subprocess
import sys
import warnings
from contextlib import redirect_stderr, redirect_stdout
from dataclasses import dataclass
from pathlib import Path

import pytest

from multimodal_to.cli import main
from multimodal_to.cli.common import out as console


@dataclass(frozen=True, kw_only=True)
class Ended:
    """What a command printed, and its exit status."""

    returncode: int
    stdout: str
    stderr: str


def run(*arguments: object, cwd: Path | None = None, columns: int = 200, **environment: str) -> Ended:
    """Run a command in this process, where every warning is an error; that spares the imports of a process."""
    out, err = io.StringIO(), io.StringIO()
    code = _run(out, err, *arguments, cwd=cwd, columns=columns, **environment)
    return Ended(returncode=code, stdout=out.getvalue(), stderr=err.getvalue())


def run_into(encoding: str, *arguments: object, cwd: Path | None = None) -> Ended:
    """Run a command in this process with streams of an encoding; what it printed is decoded from their bytes."""
    out, err = (io.TextIOWrapper(io.BytesIO(), encoding=encoding, newline="") for _ in range(2))
    code = _run(out, err, *arguments, cwd=cwd, columns=200)
    texts = []
    for stream in (out, err):
        stream.flush()
        texts.append(stream.buffer.getvalue().decode(encoding))
    return Ended(returncode=code, stdout=texts[0], stderr=texts[1])


def _run(
    out: io.TextIOBase, err: io.TextIOBase, *arguments: object, cwd: Path | None, columns: int, **environment: str
) -> int:
    with pytest.MonkeyPatch.context() as patch, redirect_stdout(out), redirect_stderr(err):
        patch.setattr(sys, "argv", ["multimodal-to", *map(str, arguments)])
        patch.setattr(sys.modules["__main__"], "__package__", None)  # else the usage names that of the tests' runner
        patch.setattr(warnings, "showwarning", warnings.showwarning)  # which `main` replaces
        for name, value in {"COLUMNS": str(columns), **environment}.items():
            patch.setenv(name, value)
        patch.setattr(console, "_width", columns)  # it has that of COLUMNS where it was made
        if cwd is not None:
            patch.chdir(cwd)
        with pytest.raises(SystemExit) as ended:
            main()
    return ended.value.code


def run_process(*arguments: object, **environment: str) -> Ended:
    """Run a command in a process of its own, as a person does."""
    ended = subprocess.run(
        [sys.executable, "-m", "multimodal_to", *map(str, arguments)],
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
        env={**os.environ, "COLUMNS": "200", **environment},
    )
    return Ended(returncode=ended.returncode, stdout=ended.stdout, stderr=ended.stderr)

"""The native library, found and opened; everything works without it, only slower."""

from __future__ import annotations

import ctypes
import os
import struct
import sys
from functools import cache
from pathlib import Path

from multimodal_to.native import compiling

VARIABLE = "MULTIMODAL_TO_NATIVE"
"""The environment variable that leaves the library unused (`0`), or names another file."""
BESIDE = Path(__file__).parent / compiling.library_name()
"""Where the installation puts the library."""
THREADS_MOST = 4
"""More threads than this are not taken unasked."""

_ELF_HEADER = struct.Struct("=40x Q 10x H H 2x")  # e_shoff, e_shentsize, e_shnum
_REBUILD = "`python -m multimodal_to.native` builds it"
INSTRUCTION_SETS = ("portable", "sse2", "avx2", "avx512", "neon")
"""The instruction sets by their numbers in `common.h`."""


def library() -> ctypes.CDLL | None:
    """Return the opened library, or None where there is none, as `missing` says.

    It is opened once; what the environment says is read then.
    """
    return _opened()[0]


def library_file() -> Path | None:
    """Return the file of the opened library, for what opens it by its path; None where there is no library."""
    return None if (opened := library()) is None else Path(opened._name)


def missing() -> str:
    """Return in one sentence why there is no library; nothing where there is one."""
    return _opened()[1]


def instruction_set() -> str:
    """Return the instruction set of the kernels that run, one of `INSTRUCTION_SETS`; nothing without the library."""
    opened = library()
    return "" if opened is None else INSTRUCTION_SETS[opened.mt_instruction_set()]


@cache
def _opened() -> tuple[ctypes.CDLL | None, str]:
    return opened_as_asked(os.environ.get(VARIABLE, ""))


def opened_as_asked(asked: str) -> tuple[ctypes.CDLL | None, str]:
    """Return the library that `MULTIMODAL_TO_NATIVE` asks for, or None and in one sentence why there is none.

    Args:
        asked: `0` for none, a file's path, or nothing for the one that was installed.
    """
    if asked == "0":
        return None, f"{VARIABLE}=0 leaves the native library unused"
    opened, problem = opened_file(Path(asked) if asked else BESIDE)
    if opened is not None:
        opened.mt_set_threads(default_threads())
    return opened, problem


def opened_file(file: Path) -> tuple[ctypes.CDLL | None, str]:
    """Return a file opened as the library, or None and in one sentence why it is not taken.

    It is taken only if it was built from the sources that are beside this file: functions of other sources may take
    other arguments.
    """
    if not file.is_file():
        return None, f"there is no native library '{file}'; {_REBUILD}"
    if not _is_whole(file):
        return None, f"the native library '{file}' cannot be opened (it is cut off); {_REBUILD}"
    try:
        opened = ctypes.CDLL(str(file.resolve()))
    except OSError as error:
        return None, f"the native library '{file}' cannot be opened ({error}); {_REBUILD}"
    try:
        built_from = opened.mt_fingerprint
    except AttributeError:
        return None, f"'{file}' is not the native library of this package; {_REBUILD}"
    built_from.restype = ctypes.c_char_p
    if built_from().decode() != compiling.fingerprint():
        return None, f"the native library '{file}' was built from other sources than are here; {_REBUILD}"
    return opened, ""


def _is_whole(file: Path) -> bool:
    """Return whether no end of an ELF file is missing, which would end the process when it is opened.

    The table of its sections stands at its end. Other kinds of files are checked by the systems that open them.
    """
    content = file.read_bytes()
    if content[:5] != b"\x7fELF\x02" or len(content) < _ELF_HEADER.size:  # of 64 bits
        return True
    table, entry, entries = _ELF_HEADER.unpack_from(content)
    return bool(table + entry * entries <= len(content))


def default_threads() -> int:
    """Return how many threads loops take: the cores that this process may use, at most `THREADS_MOST`."""
    allowed = len(os.sched_getaffinity(0)) if sys.platform == "linux" else os.cpu_count() or 1
    return max(1, min(allowed, cgroup_cores(Path("/sys/fs/cgroup/cpu.max")), THREADS_MOST))


def cgroup_cores(file: Path) -> int:
    """Return the cores that a container is given, rounded up; many where there is no limit."""
    try:
        quota, period = file.read_text(encoding="ascii").split()
        return -(-int(quota) // int(period))
    except (OSError, ValueError):  # no such file, or `max`
        return THREADS_MOST

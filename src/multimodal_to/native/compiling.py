"""How the native library is compiled: its sources, the flags, and which compiler is asked.

The build hook of the package loads this file by its path, before the package exists. So it imports nothing of it.
"""

from __future__ import annotations

import hashlib
import os
import platform
import shlex
import shutil
import subprocess
import sys
import sysconfig
import tempfile
from collections.abc import Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path

SOURCES = Path(__file__).parent / "sources"
"""The folder of the C files."""
ZIGLANG = "ziglang>=0.15"
"""What the build asks for where there is no compiler: Zig brings Clang and the C libraries of all systems."""

_GLIBC = "2.17"
"""The oldest glibc that a library made by Zig loads with: that of manylinux2014, as CasADi's wheels."""
_MACOS = "11.0"
"""The oldest macOS that a library loads on."""
_TIMEOUT = 600.0  # for one call of a compiler [s]; the first one of Zig compiles the C library

_COMMON = ("-std=gnu11", "-O3", "-fno-math-errno", "-fvisibility=hidden")
_SETS: dict[str, dict[str, tuple[str, ...]]] = {
    "x86_64": {
        "sse2": (),
        "avx2": ("-mavx2", "-mfma"),
        "avx512": ("-mavx2", "-mfma", "-mavx512f", "-mavx512dq", "-mavx512vl", "-mprefer-vector-width=512"),
    },
    "aarch64": {"neon": ()},
}
"""The flags of each instruction set of a machine; the first set is what every processor of it has."""
_OTHER_MACHINE: dict[str, tuple[str, ...]] = {"portable": ()}
_UNFUSED = ("tape",)
"""How the names of files begin in which a·b + c is rounded twice, as CasADi does it; others may use one operation."""

_TINY = """
#include <math.h>
#include <stdatomic.h>
typedef double vector __attribute__((vector_size(16)));
__attribute__((visibility("default"))) double mt_tiny(double x) { vector v = {x, x}; v = v * v; return sqrt(v[0]); }
"""
"""What a compiler is tried with; every file is compiled with the flags of every instruction set."""
_OPEN = "import ctypes, sys; ctypes.CDLL(sys.argv[1])"


class BuildError(Exception):
    """The library could not be built; the text says why, in one sentence."""


@dataclass(frozen=True, kw_only=True)
class Compiler:
    """A C compiler that takes the arguments of GCC, and what it compiles for."""

    command: tuple[str, ...]
    target: str  # machine-system or machine-system-abi, as Zig writes it

    @property
    def name(self) -> str:
        """Return what it is called in a sentence."""
        return "ziglang" if self.is_zig else self.command[0]

    @property
    def is_zig(self) -> bool:
        """Return whether it is Zig from PyPI."""
        return "ziglang" in self.command

    @property
    def machine(self) -> str:
        """Return the kind of processor: `x86_64`, `aarch64`, or another."""
        return self.target.split("-")[0]

    @property
    def system(self) -> str:
        """Return the system: `linux`, `macos` or `windows`."""
        return self.target.split("-")[1].partition(".")[0]

    @property
    def instruction_sets(self) -> tuple[str, ...]:
        """Return the instruction sets that kernels are compiled for, the smallest first."""
        return tuple(_SETS.get(self.machine, _OTHER_MACHINE))

    def flags(self) -> tuple[str, ...]:
        """Return the arguments that every call takes."""
        flags: tuple[str, ...] = () if self.system == "windows" else ("-fPIC", "-pthread")
        if self.is_zig:
            return *flags, "-target", self.target, "-g0", "-fno-sanitize=undefined"
        return (*flags, f"-mmacosx-version-min={_MACOS}") if self.system == "macos" else flags

    def library_flags(self) -> tuple[str, ...]:
        """Return the arguments that make a shared library, after its objects."""
        return ("-shared", "-s") if self.system == "windows" else ("-shared", "-lm", *self._stripped())

    def _stripped(self) -> tuple[str, ...]:
        return () if self.system == "macos" else ("-s",)


def native_target() -> str:
    """Return the target of the Python that runs this, as Zig writes it."""
    machine = sysconfig.get_platform().split("-")[-1].lower().replace("amd64", "x86_64").replace("arm64", "aarch64")
    if sys.platform == "win32":
        return f"{machine}-windows-gnu"
    if sys.platform == "darwin":  # Python itself may be of two machines
        return f"{platform.machine().replace('arm64', 'aarch64')}-macos.{_MACOS}"
    return f"{machine}-linux-gnu.{_GLIBC}" if platform.libc_ver()[0] == "glibc" else f"{machine}-linux-musl"


def library_name(target: str | None = None) -> str:
    """Return the name of the library's file on a system, by default on this one."""
    suffixes = {"windows": ".dll", "macos": ".dylib"}
    return "_native" + suffixes.get(_compiler((), target).system, ".so")


def platform_tag(compiler: Compiler) -> str:
    """Return the platform of a wheel with a library that a compiler made for this Python.

    Zig compiles for an old glibc, others for the one that is here.
    """
    machine = compiler.machine
    if compiler.system == "macos":
        return f"macosx_{_MACOS.replace('.', '_')}_{'arm64' if machine == 'aarch64' else machine}"
    if compiler.is_zig and "-gnu" in compiler.target and compiler.system == "linux":
        return f"manylinux_{_GLIBC.replace('.', '_')}_{machine}"
    return sysconfig.get_platform().replace("-", "_").replace(".", "_")


def fingerprint(sources: Path = SOURCES) -> str:
    """Return a number of 16 digits that changes with any file of the sources, or with this one."""
    digest = hashlib.sha256()
    for file in (Path(__file__), *sorted(sources.glob("*.[ch]"))):
        digest.update(file.name.encode() + b"\0" + file.read_bytes() + b"\0")
    return digest.hexdigest()[:16]


def own_compilers() -> list[Compiler]:
    """Return the compilers of this machine: what CC names, and those of the usual names; none has been tried."""
    named = shlex.split(os.environ.get("CC", ""))
    usual = [[path] for path in map(shutil.which, ("cc", "gcc", "clang")) if path]
    return [_compiler(tuple(command)) for command in ([named] if named else []) + usual]


def zig(target: str | None = None) -> Compiler:
    """Return Zig from PyPI as a compiler for a target, by default for this machine.

    Raises:
        BuildError: it is not installed.
    """
    if find_spec("ziglang") is None:
        raise BuildError("ziglang is not installed")
    return _compiler((sys.executable, "-m", "ziglang", "cc"), target)


def _compiler(command: tuple[str, ...], target: str | None = None) -> Compiler:
    return Compiler(command=command, target=target or native_target())


def own_compiler() -> Compiler:
    """Return the first compiler of this machine that works.

    Raises:
        BuildError: none does; says why.
    """
    failures = []
    for compiler in own_compilers():
        failure = failure_of(compiler)
        if not failure:
            return compiler
        failures.append(f"{compiler.name}: {failure}")
    raise BuildError(f"no C compiler works here ({'; '.join(failures) or 'cc, gcc and clang are not found'})")


def any_compiler() -> Compiler:
    """Return the first compiler of this machine that works, otherwise Zig.

    Raises:
        BuildError: there is neither.
    """
    try:
        return own_compiler()
    except BuildError as error:
        try:
            return zig()
        except BuildError as other:
            raise BuildError(f"{error}, and {other}") from None


def requirements() -> list[str]:
    """Return what has to be installed to build the library: Zig where no other compiler works, else nothing."""
    try:
        own_compiler()
    except BuildError:
        target = _compiler(())
        known = target.machine in _SETS and target.system in ("linux", "macos", "windows")
        return [ZIGLANG] if known else []
    return []


def failure_of(compiler: Compiler) -> str:
    """Return why a compiler cannot make the library for this Python; nothing where it can make a tiny one."""
    with tempfile.TemporaryDirectory() as folder:
        tiny = Path(folder, "tiny.c")
        tiny.write_text(_TINY, encoding="utf-8")
        library = Path(folder, library_name())
        try:
            objects = [Path(folder, f"tiny-{name}.o") for name in compiler.instruction_sets]
            for name, file in zip(compiler.instruction_sets, objects, strict=True):
                _call(
                    [
                        *compiler.command,
                        *_COMMON,
                        *compiler.flags(),
                        *_set_flags(compiler, name),
                        "-c",
                        tiny,
                        "-o",
                        file,
                    ]
                )
            _call([*compiler.command, *compiler.flags(), objects[0], *compiler.library_flags(), "-o", library])
            _call([sys.executable, "-c", _OPEN, library])
        except BuildError as error:
            return str(error)
    return ""


def build(
    library: Path,
    compiler: Compiler | None = None,
    *,
    sources: Iterable[Path] | None = None,
    instruction_sets: Sequence[str] | None = None,
    flags: Sequence[str] = (),
) -> Path:
    """Compile the library and put it in its place as a whole; return its path.

    Args:
        library: its file, replaced where it exists.
        compiler: by default the first that works here.
        sources: the C files; by default all of the package.
        instruction_sets: those that the kernels are compiled for; by default all of the compiler's machine.
        flags: more arguments, for each file and for the library.

    Raises:
        BuildError: there is no compiler, or it fails.
    """
    compiler = compiler or any_compiler()
    files = sorted(SOURCES.glob("*.c")) if sources is None else list(sources)
    sets = compiler.instruction_sets if instruction_sets is None else tuple(instruction_sets)
    with tempfile.TemporaryDirectory() as folder:
        made = Path(folder, library.name)
        units = [
            (file, name, Path(folder, f"{file.stem}-{name}.o"))
            for file in files
            for name in (sets if file.stem.endswith("_kernel") else ("",))
        ]
        shared = [*_COMMON, f"-I{SOURCES}", f'-DMT_FINGERPRINT="{fingerprint()}"']
        shared += [*(f"-DMT_WITH_{name.upper()}" for name in sets), *compiler.flags(), *flags]
        commands = [
            [*compiler.command, *shared, *_file_flags(compiler, file, name), "-c", file, "-o", made_object]
            for file, name, made_object in units
        ]
        with ThreadPoolExecutor(os.cpu_count()) as pool:
            list(pool.map(_call, commands))
        objects = [made_object for _, _, made_object in units]
        _call([*compiler.command, *compiler.flags(), *flags, *objects, *compiler.library_flags(), "-o", made])
        return _put(made, library)


def _file_flags(compiler: Compiler, file: Path, instruction_set: str) -> list[str]:
    contract = "off" if file.stem.startswith(_UNFUSED) else "fast"
    flags = [f"-ffp-contract={contract}"]
    if instruction_set:
        flags += [f"-DMT_SET_{instruction_set.upper()}", *_set_flags(compiler, instruction_set)]
    return flags


def _set_flags(compiler: Compiler, instruction_set: str) -> tuple[str, ...]:
    return _SETS.get(compiler.machine, _OTHER_MACHINE)[instruction_set]


def _put(made: Path, library: Path) -> Path:
    """Move a file to its place in one step: a process may have the old one open."""
    beside = library.with_name(f"{library.name}.{os.getpid()}")
    try:
        shutil.copyfile(made, beside)
        beside.replace(library)
    except OSError as error:
        raise BuildError(f"the library cannot be written to '{library}' ({error})") from None
    finally:
        beside.unlink(missing_ok=True)
    return library


def _call(command: Sequence[str | Path]) -> None:
    """Run a command; the last line that says error is the reason when it fails."""
    try:
        ended = subprocess.run(
            command,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            timeout=_TIMEOUT,
            check=False,
        )
    except (OSError, subprocess.TimeoutExpired) as error:
        raise BuildError(f"{error}") from None
    if ended.returncode:
        lines = ended.stdout.decode(errors="replace").strip().splitlines()
        said = [line for line in lines if "error" in line.lower()] or lines[-1:]
        raise BuildError(said[0].strip() if said else f"{command[0]} ended with {ended.returncode}")

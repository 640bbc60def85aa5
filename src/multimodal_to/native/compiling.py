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
from collections.abc import Iterable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
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
_ZIG_MACOS = 12
"""The oldest macOS that Zig itself runs on."""
_TIMEOUT = 600.0  # for one call of a compiler [s]; the first one of Zig compiles parts of the C library

_COMMON = ("-std=gnu11", "-O3", "-fno-math-errno", "-fvisibility=hidden", f"-I{SOURCES}")
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
"""What a compiler is tried with, once with the flags of every instruction set."""
_OPEN = "import ctypes, sys; ctypes.CDLL(sys.argv[1])"
_READ = """
import ctypes, sys
read = ctypes.CDLL(sys.argv[1]).mt_fingerprint
read.restype = ctypes.c_char_p
sys.exit(read().decode() != sys.argv[2])
"""
"""Opening a file runs in a child process: a broken one may end it, and Windows lets nobody replace an open one."""


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
        return "ziglang" if self.is_zig else " ".join(self.command)

    @property
    def is_zig(self) -> bool:
        """Return whether it is Zig, which compiles for the processor that it runs on unless a target is named."""
        return Path(self.command[0]).stem == "zig"

    @property
    def machine(self) -> str:
        """Return the kind of processor: `x86_64`, `aarch64`, or another."""
        return self.target.split("-")[0]

    @property
    def system(self) -> str:
        """Return the system: `linux`, `macos` or `windows`."""
        return self.target.split("-")[1].partition(".")[0]

    @property
    def instruction_sets(self) -> Mapping[str, tuple[str, ...]]:
        """Return the instruction sets that kernels are compiled for, the smallest first, with their flags."""
        return _SETS.get(self.machine, _OTHER_MACHINE)

    def compile(self, source: Path, made: Path, *flags: str) -> None:
        """Compile a file to an object.

        Raises:
            BuildError: the compiler fails.
        """
        self._call(made, *_COMMON, *self._flags(), *flags, "-c", str(source))

    def link(self, objects: Iterable[Path], made: Path, *flags: str) -> None:
        """Make a shared library of objects, without the names that nobody needs.

        Raises:
            BuildError: the compiler fails.
        """
        mathematics = [] if self.system == "windows" else ["-lm"]
        stripped = [] if self.system == "macos" else ["-s"]
        self._call(made, *self._flags(), *flags, "-shared", *map(str, objects), *mathematics, *stripped)

    def _flags(self) -> tuple[str, ...]:
        """Return the arguments that every call takes: those of the system, and of the plainest processor."""
        flags: tuple[str, ...] = () if self.system == "windows" else ("-fPIC", "-pthread")
        if self.is_zig:
            return *flags, "-target", self.target, "-g0", "-fno-sanitize=undefined"
        if self.machine == "x86_64":
            flags += ("-march=x86-64",)
        if self.system == "macos":
            flags += ("-arch", _apple(self.machine), f"-mmacosx-version-min={_MACOS}")
        return flags

    def _call(self, made: Path, *arguments: str) -> None:
        cache = str(made.with_name("zig-cache"))  # else Zig keeps 90 MB in the home folder
        _run([*self.command, *arguments, "-o", str(made)], ZIG_GLOBAL_CACHE_DIR=cache, ZIG_LOCAL_CACHE_DIR=cache)


# ---------------------------------------------------------------- what is compiled for


def native_target() -> str:
    """Return the target of the Python that runs this, as Zig writes it."""
    machine = sysconfig.get_platform().split("-")[-1].lower().replace("amd64", "x86_64").replace("arm64", "aarch64")
    if sys.platform == "win32":
        return f"{machine}-windows-gnu"
    if sys.platform == "darwin":  # Python itself may be of two machines
        return f"{platform.machine().replace('arm64', 'aarch64')}-macos.{_MACOS}"
    return f"{machine}-linux-gnu.{_GLIBC}" if platform.libc_ver()[0] == "glibc" else f"{machine}-linux-musl"


def library_name(target: str = "") -> str:
    """Return the name of the library's file for a target, by default for this machine."""
    suffixes = {"windows": ".dll", "macos": ".dylib"}
    return "_native" + suffixes.get(_compiler((), target).system, ".so")


def platform_tag(compiler: Compiler) -> str:
    """Return the platform of a wheel with a library that a compiler made for this Python.

    Zig compiles for an old glibc, others for the one that is here.
    """
    if compiler.system == "macos":
        return f"macosx_{_MACOS.replace('.', '_')}_{_apple(compiler.machine)}"
    if compiler.is_zig and "-linux-gnu." in compiler.target:
        return f"manylinux_{_GLIBC.replace('.', '_')}_{compiler.machine}"
    return sysconfig.get_platform().replace("-", "_").replace(".", "_")


def _apple(machine: str) -> str:
    return "arm64" if machine == "aarch64" else machine


# ---------------------------------------------------------------- which compiler


def own_compiler() -> Compiler:
    """Return the first compiler of this machine that works: the one that CC names, cc, gcc, clang.

    Raises:
        BuildError: none does; says why.
    """
    named = shlex.split(os.environ.get("CC", ""))
    usual = [[path] for path in map(shutil.which, ("cc", "gcc", "clang")) if path]
    failures = []
    for command in ([named] if named else []) + usual:
        compiler = _compiler(tuple(command))
        failure = failure_of(compiler)
        if not failure:
            return compiler
        failures.append(f"{compiler.name}: {failure}")
    raise BuildError(f"no C compiler works here ({'; '.join(failures) or 'cc, gcc and clang are not found'})")


def zig(target: str = "") -> Compiler:
    """Return Zig from PyPI as a compiler for a target, by default for this machine.

    Raises:
        BuildError: it is not installed.
    """
    found = find_spec("ziglang")
    if found is None or found.origin is None:
        raise BuildError(f"{ZIGLANG} is not installed")
    return _compiler((str(Path(found.origin).with_name("zig")), "cc"), target)


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
        return [ZIGLANG] if _zig_runs_here() else []
    return []


def _zig_runs_here() -> bool:
    """Return whether PyPI has Zig for this machine; a build that asks for what does not exist would fail."""
    if sys.platform == "darwin" and int(platform.mac_ver()[0].split(".")[0] or 0) < _ZIG_MACOS:
        return False
    return _compiler(()).machine in _SETS and sys.platform in ("linux", "darwin", "win32")


def _compiler(command: tuple[str, ...], target: str = "") -> Compiler:
    return Compiler(command=command, target=target or native_target())


def failure_of(compiler: Compiler) -> str:
    """Return why a compiler cannot make a library for this Python; nothing where it makes a tiny one that opens."""
    with tempfile.TemporaryDirectory() as folder:
        source, library = Path(folder, "tiny.c"), Path(folder, library_name())
        source.write_text(_TINY, encoding="utf-8")
        objects = {Path(folder, f"{name}.o"): flags for name, flags in compiler.instruction_sets.items()}
        try:
            for made, flags in objects.items():
                compiler.compile(source, made, *flags)
            compiler.link([*objects][:1], library)
            _run([sys.executable, "-c", _OPEN, str(library)])
        except BuildError as error:
            return str(error)
    return ""


# ---------------------------------------------------------------- the library


def fingerprint() -> str:
    """Return 16 digits that change with any file of the sources, and with this one."""
    digest = hashlib.sha256()
    for file in (Path(__file__), *sorted(SOURCES.glob("*.[ch]"))):
        digest.update(file.name.encode() + b"\0" + file.read_bytes() + b"\0")
    return digest.hexdigest()[:16]


def is_current(library: Path) -> bool:
    """Return whether a file opens here as a library that was built from the sources as they are."""
    try:
        _run([sys.executable, "-c", _READ, str(library), fingerprint()])
    except BuildError:
        return False
    return True


def build(
    library: Path,
    compiler: Compiler | None = None,
    *,
    also: Sequence[Path] = (),
    instruction_sets: Sequence[str] | None = None,
    flags: Sequence[str] = (),
) -> Path:
    """Compile the library and put it in its place as a whole; return its path.

    Args:
        library: its file, replaced where it exists.
        compiler: by default the first that works here.
        also: C files beside those of the package.
        instruction_sets: those that the kernels are compiled for; by default all of the compiler's machine.
        flags: more arguments, for each file and for the library.

    Raises:
        BuildError: there is no compiler, or it fails.
    """
    compiler = compiler or any_compiler()
    sets = {name: compiler.instruction_sets[name] for name in instruction_sets or compiler.instruction_sets}
    shared = [*(f"-DMT_WITH_{name.upper()}" for name in sets), f'-DMT_FINGERPRINT="{fingerprint()}"', *flags]
    with tempfile.TemporaryDirectory() as folder:
        units = [
            (file, Path(folder, f"{file.stem}-{number}.o"), more)
            for file in (*sorted(SOURCES.glob("*.c")), *also)
            for number, more in enumerate(_variants(file, sets))
        ]
        with ThreadPoolExecutor(os.cpu_count()) as pool:
            list(pool.map(lambda unit: compiler.compile(unit[0], unit[1], *unit[2], *shared), units))
        made = Path(folder, library.name)
        compiler.link([unit[1] for unit in units], made, *flags)
        return _put(made, library)


def _variants(file: Path, sets: Mapping[str, tuple[str, ...]]) -> list[list[str]]:
    """Return the flags of a file, for every time that it is compiled."""
    contraction = f"-ffp-contract={'off' if file.stem.startswith(_UNFUSED) else 'fast'}"
    if not file.stem.endswith("_kernel"):
        return [[contraction]]
    return [[contraction, f"-DMT_SET_{name.upper()}", *flags] for name, flags in sets.items()]


def _put(made: Path, library: Path) -> Path:
    """Move a file to its place in one step: a process may have the old one open."""
    beside = library.with_name(f"{library.name}.{os.getpid()}")
    try:
        shutil.copyfile(made, beside)
        beside.replace(library)
    except OSError as error:
        raise BuildError(f"the library cannot be written to '{library}' ({error})") from None
    finally:
        with suppress(OSError):
            beside.unlink()
    return library


def _run(command: Sequence[str], **environment: str) -> None:
    """Run a command; when it fails, the first line with `error:` is the reason."""
    try:
        ended = subprocess.run(
            command,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            timeout=_TIMEOUT,
            env={**os.environ, **environment},
            check=False,
        )
    except (OSError, subprocess.TimeoutExpired) as error:
        raise BuildError(str(error)) from None
    if ended.returncode:
        lines = ended.stdout.decode(errors="replace").strip().splitlines()
        said = [line for line in lines if "error:" in line.lower()] or lines[-1:]
        raise BuildError(said[0].strip() if said else f"{command[0]} ended with {ended.returncode}")

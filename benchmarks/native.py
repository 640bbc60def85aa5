"""Compile the native library by every compiler and for every system, and run its tests under sanitizers.

python benchmarks/native.py [compilers] [systems] [sanitizers]   (all three by default)

compilers:   seconds to compile, and size of the library, with GCC, Clang and Zig, as far as they are here.
systems:     Zig compiles it for Linux, macOS and Windows on x86-64 and 64-bit Arm; nothing is run.
sanitizers:  the native tests on a library with AddressSanitizer and UndefinedBehaviorSanitizer, and those of the
             threads on one with ThreadSanitizer; GCC on Linux.

Zig comes by `pip install ziglang`.

Exit status 0 when all went well.
"""

import os
import platform
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path

from multimodal_to.native import compiling
from multimodal_to.native.library import VARIABLE

ROOT = Path(__file__).parents[1]
TESTS = ROOT / "tests" / "native"
STRICT = ("-Wall", "-Wextra", "-Werror")
TARGETS = (
    "x86_64-linux-gnu.2.17",
    "x86_64-linux-musl",
    "aarch64-linux-gnu.2.17",
    "aarch64-linux-musl",
    "x86_64-macos.11.0",
    "aarch64-macos.11.0",
    "x86_64-windows-gnu",
    "aarch64-windows-gnu",
)
SANITIZERS = {
    "address,undefined": (("libasan.so", "libubsan.so"), {"ASAN_OPTIONS": "detect_leaks=0"}, "test_*.py"),
    "thread": (("libtsan.so",), {"TSAN_OPTIONS": "halt_on_error=1:die_after_fork=0"}, "test_parallel.py"),
}
"""What is loaded before Python, the options, and the tests that run."""
NOT_SANITIZED = ("test_compiling.py", "test_wheel.py", "test_without.py")
"""Tests of what is compiled, not of what runs."""


def compiled(compiler: compiling.Compiler, folder: Path) -> str:
    """Compile the library; return seconds, those of the processor too, and size."""
    started, used = time.perf_counter(), sum(os.times()[2:4])
    library = compiling.build(folder / compiling.library_name(compiler.target), compiler, flags=STRICT)
    seconds, used = time.perf_counter() - started, sum(os.times()[2:4]) - used
    return f"{seconds:.1f} s ({used:.1f} s of processors), {library.stat().st_size / 1e3:.0f} kB"


def compilers() -> bool:
    """Compile with each compiler that is here."""
    commands = [compiling.Compiler(command=(name,), target=compiling.native_target()) for name in ("gcc", "clang")]
    found = [compiler for compiler in commands if not compiling.failure_of(compiler)]
    try:
        found.append(compiling.zig())
    except compiling.BuildError as error:
        print(f"ziglang: {error}")
    for compiler in found:
        with tempfile.TemporaryDirectory() as folder:
            print(f"{compiler.name}: {compiled(compiler, Path(folder))}", flush=True)
    return bool(found)


def systems() -> bool:
    """Compile for every system with Zig."""
    worked = True
    for target in TARGETS:
        with tempfile.TemporaryDirectory() as folder:
            try:
                print(f"{target}: {compiled(compiling.zig(target), Path(folder))}", flush=True)
            except compiling.BuildError as error:
                worked = False
                print(f"{target}: {error}", flush=True)
    return worked


def sanitizers() -> bool:
    """Run the native tests on sanitized libraries."""
    return all([sanitized(name, *rest) for name, rest in SANITIZERS.items()])


def sanitized(name: str, runtimes: Sequence[str], options: dict[str, str], tests: str) -> bool:
    """Run tests on a library with a sanitizer; the tests' own library is compiled with it too."""
    flags = f"-fsanitize={name} -fno-sanitize-recover=all -fno-omit-frame-pointer -g"
    gcc = compiling.Compiler(command=("gcc",), target=compiling.native_target())
    with tempfile.TemporaryDirectory() as folder:
        library = compiling.build(Path(folder, compiling.library_name()), gcc, flags=flags.split())
        environment = {
            **os.environ,
            **options,
            VARIABLE: str(library),
            "MULTIMODAL_TO_SANITIZED": flags,
            "LD_PRELOAD": " ".join(runtime(file) for file in runtimes),
        }
        fixed = ["setarch", platform.machine(), "-R"]  # ThreadSanitizer wants addresses where it expects them
        command = [
            *fixed,
            sys.executable,
            "-m",
            "pytest",
            "-p",
            "no:cacheprovider",
            "--capture=sys",  # what a sanitizer writes is seen
            "--durations=0",
            "--durations-min=5",
        ]
        files = [file for file in sorted(TESTS.glob(tests)) if file.name not in NOT_SANITIZED]
        print(f"{name}:", flush=True)
        ended = subprocess.run([*command, *files], cwd=ROOT, env=environment, check=False)
    return ended.returncode == 0


def runtime(name: str) -> str:
    """Return the path of a sanitizer's library."""
    found = subprocess.run(["gcc", f"-print-file-name={name}"], check=True, capture_output=True, text=True)
    return found.stdout.strip()


PARTS = {"compilers": compilers, "systems": systems, "sanitizers": sanitizers}


def main() -> None:
    """Run the parts that are asked for."""
    names = sys.argv[1:] or list(PARTS)
    if not set(names) <= PARTS.keys():
        sys.exit(__doc__)
    sys.exit(0 if all([PARTS[name]() for name in names]) else 1)


if __name__ == "__main__":
    main()

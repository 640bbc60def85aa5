"""Build a wheel where there is no compiler, install it where there is none, and solve the take-off there.

python benchmarks/wheel_without_compiler.py   (Linux; it fetches some 250 MB from PyPI and takes a few minutes)

All of it runs in a mount namespace of its own, in which compilers, assemblers, linkers, the libraries of GCC and the
headers of the system are covered by nothing; and with an empty PATH. Before anything is built, each of these names is
looked for and called, and a call that works ends the run. Exit status 0 when the take-off is solved with the library.
"""

import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).parents[1]
FOLDERS = dict.fromkeys(["/usr/bin", "/usr/local/bin", "/bin", *os.environ["PATH"].split(os.pathsep)])
TOOLS = ("cc", "c++", "gcc", "g++", "clang", "tcc", "cpp", "c89", "c99", "as", "ld", "gold", "lld", "zig", "icx", "icc")
"""What a compiler, an assembler or a linker is called, maybe with a machine before it and a version after it."""
COVERED = ("/usr/include", "/usr/local/include", "/usr/lib/gcc", "/usr/libexec/gcc", "/usr/lib/llvm*", "/usr/lib/tcc")
INSIDE = "--inside"

USES_LIBRARY = """
import multimodal_to
from multimodal_to.native import instruction_set, library, missing
assert library() is not None, missing()
print(f"{library()._name}: {instruction_set()}, {library().mt_threads()} threads", flush=True)
"""
SAYS_SOLVER = """
import sys
from multimodal_to import Trajectory
record = Trajectory.load(sys.argv[1]).solve_record()
print(f"{record['status']}, {record['iterations']} iterations in {record['solve_time']:.1f} s, ", end="")
print(f"linear solver {record['linear_solver']}, native kernels {record['native']}", flush=True)
"""


def tools() -> Iterator[Path]:
    """Yield every compiler, assembler and linker in the usual folders."""
    for folder in map(Path, FOLDERS):
        for file in sorted(folder.iterdir()) if folder.is_dir() else ():
            parts = file.name.split(".")[0].split("-")
            loader = file.name == "ld.so"  # of every program
            if any(part in TOOLS for part in parts) and not loader and os.access(file, os.X_OK):
                yield file


def cover() -> list[str]:
    """Cover the tools and their files; return what was covered."""
    covered = []
    for file in {file.resolve() for file in tools()}:
        subprocess.run(["mount", "--bind", "/dev/null", file], check=True)
        covered.append(str(file))
    for pattern in COVERED:
        for folder in Path("/").glob(pattern[1:]):
            subprocess.run(["mount", "-t", "tmpfs", "none", folder], check=True)
            covered.append(f"{folder}/")
    return sorted(covered)


def certify() -> None:
    """Make sure that no tool of any name can be called."""
    names = {name for name in TOOLS} | {str(Path(folder, name)) for name in TOOLS for folder in FOLDERS}
    for name in sorted(names | {str(file) for file in tools()}):
        try:
            subprocess.run([name, "--version"], check=True, capture_output=True)
        except (OSError, subprocess.CalledProcessError):
            continue
        sys.exit(f"{name} can still be called")


def run(*command: object, title: str = "") -> None:
    """Run a command in an empty folder; say what it took."""
    started = time.perf_counter()
    with tempfile.TemporaryDirectory() as folder:
        subprocess.run([str(part) for part in command], check=True, cwd=folder)
    if title:
        print(f"{title}: {time.perf_counter() - started:.1f} s", flush=True)


def inside(work: Path) -> None:
    """Build, install and solve, in a namespace of its own."""
    print(f"covered: {', '.join(cover())}")
    os.environ["PATH"] = str(work / "nothing")
    for name in ("CC", "PYTHONPATH", "MULTIMODAL_TO_NATIVE", "PIP_CONSTRAINT"):
        os.environ.pop(name, None)
    certify()
    print("no compiler, assembler or linker can be called", flush=True)

    source, wheels = work / "source", work / "wheels"
    builder, user = work / "builder", work / "user"
    for environment in (builder, user):
        run(sys.executable, "-m", "venv", environment)
    pip = ("-m", "pip", "--quiet", "--disable-pip-version-check")
    run(
        builder / "bin/python",
        *pip,
        "wheel",
        "--no-deps",
        "-w",
        wheels,
        source,
        title="wheel built, with ziglang fetched",
    )
    (wheel,) = wheels.iterdir()
    print(f"{wheel.name}, {wheel.stat().st_size / 1e3:.0f} kB", flush=True)
    shutil.rmtree(source)
    shutil.rmtree(builder)
    constraints = ROOT / "constraints.txt"
    run(
        user / "bin/python",
        *pip,
        "install",
        "--constraint",
        constraints,
        wheel,
        title="installed, with all that it needs",
    )
    certify()
    run(user / "bin/python", "-c", USES_LIBRARY)
    run(
        user / "bin/multimodal-to", "solve", "take-off", "--no-pictures", "--output", work / "results", title="take-off"
    )
    run(user / "bin/python", "-c", SAYS_SOLVER, work / "results/trajectory.npz")


def main() -> None:
    """Make a clean copy of the sources, and go on in a namespace where nothing can be compiled."""
    if sys.argv[1:2] == [INSIDE]:
        inside(Path(sys.argv[2]))
        return
    with tempfile.TemporaryDirectory() as folder:
        work = Path(folder)
        leave_out = shutil.ignore_patterns(".git", ".venv*", "results", "site", "_native.*", "__pycache__", ".*_cache")
        shutil.copytree(ROOT, work / "source", ignore=leave_out)
        namespace = ["unshare", "--mount", *([] if os.geteuid() == 0 else ["--user", "--map-root-user"])]
        sys.exit(subprocess.run([*namespace, sys.executable, __file__, INSIDE, folder], check=False).returncode)


if __name__ == "__main__":
    main()

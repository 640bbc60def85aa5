"""How the library is compiled: which compiler, which flags, and what happens when none works."""

from __future__ import annotations

import ctypes
import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from multimodal_to.native import compiling
from multimodal_to.native.library import INSTRUCTION_SETS

CASES = {"sse2": 2, "avx2": 4, "avx512": 8, "neon": 2, "portable": 2}
"""The doubles of a register."""


@pytest.fixture
def without_compiler(monkeypatch, tmp_path):
    """No compiler on the path, and no Zig."""
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.delenv("CC", raising=False)
    monkeypatch.setattr(compiling, "find_spec", lambda name: None)


def script(file: Path, text: str) -> Path:
    file.write_text(f"#!{sys.executable}\n{text}")
    file.chmod(0o755)
    return file


def test_the_sources_compile_without_a_warning(tested):
    assert compiling.is_current(tested)  # its flags make every warning an error


@pytest.mark.parametrize("asked", CASES)
def test_a_kernel_of_every_instruction_set_computes_the_same(tested, opened_anew, monkeypatch, compiler, asked):
    if asked not in compiler.instruction_sets:
        pytest.skip(f"{compiler.machine} has no {asked}")
    monkeypatch.setenv("MULTIMODAL_TO_INSTRUCTION_SET", asked)
    opened = opened_anew(tested)
    if INSTRUCTION_SETS[opened.mt_instruction_set()] != asked:
        pytest.skip(f"this processor has no {asked}")
    assert opened.mt_test_lanes() == CASES[asked]
    opened.mt_test_dot.restype = ctypes.c_double
    rng = np.random.default_rng(0)
    for count in range(40):
        a, b = rng.integers(-99, 99, (2, count)).astype(float)  # whole numbers: every order has the same sum
        double_p = ctypes.POINTER(ctypes.c_double)
        assert opened.mt_test_dot(count, a.ctypes.data_as(double_p), b.ctypes.data_as(double_p)) == a @ b


def test_what_is_no_kernel_runs_on_every_processor_of_the_machine(tmp_path, compiler):
    """No instruction of the whole library names a register that only larger sets have."""
    if compiler.machine != "x86_64" or shutil.which("objdump") is None:
        pytest.skip("needs objdump and an x86-64 processor")
    plain = compiling.build(tmp_path / "plain.so", compiler, instruction_sets=["sse2"])
    listing = subprocess.run(["objdump", "-d", plain], check=True, capture_output=True, text=True).stdout
    assert "%xmm" in listing or "call" in listing
    assert not [line for line in listing.splitlines() if "%ymm" in line or "%zmm" in line or "\tv" in line]


FUSED = """
#include "common.h"
MT_EXPORT double MT_KERNEL(mt_test_fused)(double a, double b, double c) { return a * b + c; }
"""


def test_a_product_and_a_sum_are_rounded_twice_in_the_tape_as_casadi_does_it(tmp_path, compiler):
    sets = [name for name in compiler.instruction_sets if name != "avx512"]
    source = tmp_path / "tape_test_kernel.c"
    source.write_text(FUSED)
    opened = ctypes.CDLL(str(compiling.build(tmp_path / "fused.so", compiler, also=[source], instruction_sets=sets)))
    function = opened[f"mt_test_fused_{sets[-1]}"]  # with FMA, where the machine has that
    function.argtypes, function.restype = [ctypes.c_double] * 3, ctypes.c_double
    if sets[-1] == "avx2" and "avx2" not in Path("/proc/cpuinfo").read_text():
        pytest.skip("this processor has no AVX2")
    a = 1.0 + 2.0**-30
    assert function(a, a, -(1.0 + 2.0**-29)) == 0.0  # rounded once it would be 2^-60


def test_the_compiler_that_cc_names_comes_first(tmp_path, monkeypatch, compiler):
    own = compiling.own_compiler()
    log = tmp_path / "log"
    text = f"import os, sys; open({str(log)!r}, 'a').write('x'); os.execv({own.command[0]!r}, ['cc', *sys.argv[1:]])"
    monkeypatch.setenv("CC", f"{script(tmp_path / 'my cc', text)!s}".replace(" ", "\\ ") + " -O1")
    found = compiling.own_compiler()
    assert found.command == (str(tmp_path / "my cc"), "-O1")
    assert log.exists()


def test_a_compiler_that_cc_names_and_that_fails_is_passed_over(monkeypatch, compiler):
    expected = compiling.own_compiler()
    monkeypatch.setenv("CC", "/no/such/compiler")
    assert compiling.own_compiler() == expected
    monkeypatch.setenv("CC", "false")
    assert compiling.own_compiler() == expected


def test_a_compiler_whose_libraries_do_not_open_here_is_passed_over(tmp_path, monkeypatch, without_compiler):
    """As one for another machine: it takes every argument and writes files."""
    text = "import sys; open(sys.argv[sys.argv.index('-o') + 1], 'w').write('of another machine')"
    script(tmp_path / "cc", text)
    with pytest.raises(compiling.BuildError, match="no C compiler works here") as raised:
        compiling.own_compiler()
    assert "cc: OSError" in str(raised.value)


def test_ziglang_is_asked_for_only_where_no_compiler_works(request, compiler):
    assert compiling.requirements() == []
    request.getfixturevalue("without_compiler")
    expected = [compiling.ZIGLANG] if compiler.machine in ("x86_64", "aarch64") else []
    assert compiling.requirements() == expected


@pytest.mark.parametrize(
    ("system", "macos", "machine", "runs"),
    [
        ("linux", "", "x86_64", True),
        ("linux", "", "riscv64", False),
        ("freebsd14", "", "x86_64", False),
        ("darwin", "14.2", "x86_64", True),
        ("darwin", "11.7", "x86_64", False),
    ],
)
def test_ziglang_is_not_asked_for_where_it_does_not_exist(monkeypatch, without_compiler, system, macos, machine, runs):
    monkeypatch.setattr(sys, "platform", system)
    monkeypatch.setattr(compiling.platform, "mac_ver", lambda: (macos, ("", "", ""), ""))
    monkeypatch.setattr(compiling.platform, "machine", lambda: machine)
    monkeypatch.setattr(compiling.sysconfig, "get_platform", lambda: f"{system}-{machine}")
    assert compiling.requirements() == ([compiling.ZIGLANG] if runs else [])


def test_without_any_compiler_a_sentence_says_what_was_looked_for(tmp_path, without_compiler):
    with pytest.raises(compiling.BuildError) as raised:
        compiling.build(tmp_path / "native.so")
    assert str(raised.value) == (
        f"no C compiler works here (cc, gcc and clang are not found), and {compiling.ZIGLANG} is not installed"
    )


def test_an_error_in_a_source_names_file_and_line(tmp_path, compiler):
    wrong = tmp_path / "wrong.c"
    wrong.write_text("int mt_wrong(void) {\n  return nothing;\n}\n")
    with pytest.raises(compiling.BuildError, match=r"wrong\.c:2:\d+: error: .*nothing"):
        compiling.build(tmp_path / "native.so", compiler, also=[wrong])
    assert not (tmp_path / "native.so").exists()


def test_a_library_is_replaced_as_a_whole_while_a_process_has_it_open(tmp_path, compiler):
    file = compiling.build(tmp_path / "native.so", compiler)
    opened = ctypes.CDLL(str(file))
    before = file.stat().st_ino
    compiling.build(file, compiler)
    assert file.stat().st_ino != before
    assert opened.mt_threads() == 1
    assert [path.name for path in tmp_path.iterdir()] == ["native.so"]


def test_a_place_that_cannot_be_written_is_named(tmp_path, compiler):
    with pytest.raises(compiling.BuildError, match=r"cannot be written to '.*native\.so'"):
        compiling.build(tmp_path / "no" / "native.so", compiler)


def compiler_for(target: str, command: str = "gcc") -> compiling.Compiler:
    return compiling.Compiler(command=(command, "cc"), target=target)


def test_the_platform_of_a_wheel_is_that_of_its_library():
    assert compiling.platform_tag(compiler_for("x86_64-linux-gnu.2.17", "/x/zig")) == "manylinux_2_17_x86_64"
    assert compiling.platform_tag(compiler_for("aarch64-macos.11.0")) == "macosx_11_0_arm64"
    assert compiling.platform_tag(compiler_for("x86_64-macos.11.0", "zig")) == "macosx_11_0_x86_64"


@pytest.mark.parametrize(
    ("system", "platform", "machine", "libc", "target", "name"),
    [
        ("linux", "linux-x86_64", "x86_64", "glibc", "x86_64-linux-gnu.2.17", "_native.so"),
        ("linux", "linux-aarch64", "aarch64", "glibc", "aarch64-linux-gnu.2.17", "_native.so"),
        ("linux", "linux-x86_64", "x86_64", "", "x86_64-linux-musl", "_native.so"),
        ("darwin", "macosx-10.9-universal2", "arm64", "", "aarch64-macos.11.0", "_native.dylib"),
        ("darwin", "macosx-10.9-universal2", "x86_64", "", "x86_64-macos.11.0", "_native.dylib"),
        ("win32", "win-amd64", "AMD64", "", "x86_64-windows-gnu", "_native.dll"),
        ("win32", "win-arm64", "ARM64", "", "aarch64-windows-gnu", "_native.dll"),
    ],
)
def test_the_target_is_that_of_the_python_that_runs(monkeypatch, system, platform, machine, libc, target, name):
    monkeypatch.setattr(sys, "platform", system)
    monkeypatch.setattr(compiling.sysconfig, "get_platform", lambda: platform)
    monkeypatch.setattr(compiling.platform, "machine", lambda: machine)
    monkeypatch.setattr(compiling.platform, "libc_ver", lambda: (libc, ""))
    assert compiling.native_target() == target
    assert compiling.library_name() == name


def test_a_developer_builds_it_anew_with_one_command(compiler):
    file = Path(compiling.__file__).with_name(compiling.library_name())
    before = file.stat().st_mtime_ns if file.exists() else 0
    subprocess.run([sys.executable, "-m", "multimodal_to.native"], check=True, env={**os.environ})
    assert file.stat().st_mtime_ns > before
    assert compiling.is_current(file)

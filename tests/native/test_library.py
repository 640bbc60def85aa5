"""The native library is found, opened and checked; where there is none, one sentence says why."""

from __future__ import annotations

import ctypes
import subprocess
import sys
from pathlib import Path

import pytest

from multimodal_to.native import compiling, instruction_set, library, library_file, missing
from multimodal_to.native.library import (
    BESIDE,
    INSTRUCTION_SETS,
    THREADS_MOST,
    cgroup_cores,
    default_threads,
    opened_as_asked,
    opened_file,
)


def test_the_library_of_this_installation_opens(compiler):
    assert missing() == ""
    assert isinstance(library(), ctypes.CDLL)
    assert instruction_set() in compiler.instruction_sets


def test_it_is_opened_once():
    assert library() is library()


def test_who_opens_its_file_by_path_shares_its_memory(compiler):
    """As IPOPT does, which loads its linear solver by a path."""
    again = ctypes.CDLL(str(library_file()))
    before = library().mt_threads()
    again.mt_set_threads(before + 1)
    assert library().mt_threads() == before + 1
    library().mt_set_threads(before)


def test_loops_take_the_threads_that_this_process_may_use(compiler):
    assert library().mt_threads() == default_threads()
    assert 1 <= default_threads() <= THREADS_MOST


def test_a_container_may_allow_fewer_cores_than_the_machine_has(tmp_path):
    limit = tmp_path / "cpu.max"
    for text, cores in (("200000 100000\n", 2), ("150000 100000\n", 2), ("max 100000\n", THREADS_MOST), ("", 4)):
        limit.write_text(text)
        assert cgroup_cores(limit) == cores
    assert cgroup_cores(tmp_path / "none") == THREADS_MOST


def test_the_environment_leaves_it_unused():
    code = "from multimodal_to.native import *; print(library(), instruction_set(), missing(), sep='|')"
    ended = subprocess.run(
        [sys.executable, "-c", code],
        env={"MULTIMODAL_TO_NATIVE": "0", "PYTHONPATH": ":".join(sys.path)},
        check=True,
        capture_output=True,
        text=True,
    )
    assert ended.stdout == "None||MULTIMODAL_TO_NATIVE=0 leaves the native library unused\n"


def test_the_environment_names_another_file(tested):
    opened, problem = opened_as_asked(str(tested))
    assert problem == ""
    assert opened.mt_test_lanes() in (2, 4, 8)  # only that of the tests has this function
    assert opened_as_asked("")[0] is None or opened_as_asked("")[0]._name == str(BESIDE)


def test_a_file_that_is_not_there_is_named(tmp_path):
    opened, problem = opened_file(tmp_path / "none.so")
    assert opened is None
    assert f"no native library '{tmp_path / 'none.so'}'; `python -m multimodal_to.native` builds it" in problem


@pytest.mark.parametrize("content", [b"", b"no library", b"\x7fELF" + bytes(100)])
def test_a_file_that_cannot_be_opened_is_named(tmp_path, content):
    broken = tmp_path / compiling.library_name()
    broken.write_bytes(content)
    opened, problem = opened_file(broken)
    assert opened is None
    assert f"'{broken}' cannot be opened (" in problem


def test_half_a_library_cannot_be_opened(tmp_path, tested):
    half = tmp_path / tested.name
    half.write_bytes(tested.read_bytes()[: tested.stat().st_size // 2])
    opened, problem = opened_file(half)
    assert opened is None
    assert "cannot be opened (" in problem


def test_the_library_of_another_package_is_not_taken(tmp_path, compiler):
    source = tmp_path / "other.c"
    source.write_text("int mt_other(void) { return 1; }\n")
    compiler.compile(source, tmp_path / "other.o")
    compiler.link([tmp_path / "other.o"], tmp_path / "other.so")
    opened, problem = opened_file(tmp_path / "other.so")
    assert opened is None
    assert "is not the native library of this package" in problem


def test_a_library_of_other_sources_is_not_taken(tmp_path, compiler):
    old = compiling.build(
        tmp_path / compiling.library_name(), compiler, flags=["-UMT_FINGERPRINT", '-DMT_FINGERPRINT="0123456789abcdef"']
    )
    opened, problem = opened_file(old)
    assert opened is None
    assert "was built from other sources than are here; `python -m multimodal_to.native` builds it" in problem
    assert not compiling.is_current(old)


def test_the_fingerprint_changes_with_any_source(tmp_path, monkeypatch):
    before = compiling.fingerprint()
    for file in compiling.SOURCES.glob("*.[ch]"):
        (tmp_path / file.name).write_bytes(file.read_bytes())
    monkeypatch.setattr(compiling, "SOURCES", tmp_path)
    assert compiling.fingerprint() == before
    with (tmp_path / "common.h").open("a") as header:
        header.write("\n")
    assert compiling.fingerprint() != before


# ---------------------------------------------------------------- instruction sets

DOT = sorted(Path(__file__).with_name("sources").glob("dot*.c"))
FMA, OSXSAVE, AVX, AVX2 = 1 << 12, 1 << 27, 1 << 28, 1 << 5
AVX512F, AVX512DQ, AVX512VL = 1 << 16, 1 << 17, 1 << 31
YMM_SAVED, ZMM_SAVED = 0b111, 0b11100111


@pytest.mark.parametrize(
    ("leaf1", "leaf7", "xcr0", "expected"),
    [
        (0, 0, 0, "sse2"),
        (OSXSAVE | AVX | FMA, AVX2, YMM_SAVED, "avx2"),
        (OSXSAVE | AVX | FMA, AVX2 | AVX512F | AVX512DQ | AVX512VL, ZMM_SAVED, "avx512"),
        (OSXSAVE | AVX | FMA, AVX2 | AVX512F | AVX512DQ | AVX512VL, YMM_SAVED, "avx2"),  # the system does not save ZMM
        (OSXSAVE | AVX | FMA, AVX2 | AVX512F | AVX512DQ | AVX512VL, 0b011, "sse2"),  # nor YMM
        (AVX | FMA, AVX2, 0, "sse2"),  # a system that knows nothing of AVX
        (OSXSAVE | AVX, AVX2, YMM_SAVED, "sse2"),  # no FMA
        (OSXSAVE | AVX | FMA, 0, YMM_SAVED, "sse2"),  # AVX, not AVX2
        (OSXSAVE | AVX | FMA, AVX2 | AVX512F, ZMM_SAVED, "avx2"),  # the first AVX-512, without DQ and VL
    ],
)
def test_a_set_is_taken_only_where_processor_and_system_have_it(tested, compiler, leaf1, leaf7, xcr0, expected):
    if compiler.machine != "x86_64":
        pytest.skip("not an x86-64 processor")
    opened = ctypes.CDLL(str(tested))
    found = opened.mt_set_of_processor(ctypes.c_uint(leaf1), ctypes.c_uint(leaf7), ctypes.c_uint(xcr0))
    assert INSTRUCTION_SETS[found] == expected


def in_use(opened: ctypes.CDLL) -> str:
    return INSTRUCTION_SETS[opened.mt_instruction_set()]


def smaller(sets: list[str], one: str, other: str) -> str:
    return min(one, other, key=sets.index)


@pytest.mark.parametrize("asked", ["sse2", "avx2", "avx512", "mmx", ""])
def test_the_environment_asks_for_a_smaller_set_and_cannot_ask_for_more(tested, opened_anew, monkeypatch, asked):
    monkeypatch.delenv("MULTIMODAL_TO_INSTRUCTION_SET", raising=False)
    here = in_use(opened_anew(tested))
    monkeypatch.setenv("MULTIMODAL_TO_INSTRUCTION_SET", asked)
    sets = list(INSTRUCTION_SETS)
    expected = smaller(sets, here, asked) if asked in sets and here not in ("neon", "portable") else here
    assert in_use(opened_anew(tested)) == expected


def test_a_library_without_a_set_takes_the_next_smaller_one(tmp_path, compiler, opened_anew, monkeypatch):
    monkeypatch.delenv("MULTIMODAL_TO_INSTRUCTION_SET", raising=False)
    if compiler.machine != "x86_64":
        pytest.skip("not an x86-64 processor")
    whole = in_use(opened_anew(compiling.build(tmp_path / "whole.so", compiler)))
    for kept in (["sse2"], ["sse2", "avx2"], ["sse2", "avx512"]):
        built = compiling.build(tmp_path / "part.so", compiler, also=DOT, instruction_sets=kept)
        able = list(INSTRUCTION_SETS)[: INSTRUCTION_SETS.index(whole) + 1]
        assert in_use(opened_anew(built)) == [name for name in kept if name in able][-1]

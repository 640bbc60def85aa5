"""The build hook: what is in a wheel, for which platform it is, and that no lack of a compiler stops it."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tarfile
import zipfile
from importlib.metadata import version
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path

import pytest
from hatchling.bridge.app import Application

from multimodal_to.native import compiling

ROOT = Path(__file__).parents[2]
LIBRARY = f"multimodal_to/native/{compiling.library_name()}"


def built(kind: str, folder: Path, **environment: str) -> tuple[Path, str]:
    """The package that the build makes, and what it says."""
    ended = subprocess.run(
        [sys.executable, "-m", "hatchling", "build", "-t", kind, "-d", folder],
        cwd=ROOT,
        check=True,
        capture_output=True,
        text=True,
        env={**os.environ, **environment},
    )
    (made,) = folder.iterdir()
    return made, ended.stdout + ended.stderr


def described(wheel: Path) -> tuple[set[str], str]:
    """The names in a wheel, and what its file WHEEL says."""
    with zipfile.ZipFile(wheel) as archive:
        names = set(archive.namelist())
        (facts,) = [name for name in names if name.endswith(".dist-info/WHEEL")]
        return names, archive.read(facts).decode()


def test_a_wheel_holds_the_library_and_is_one_of_its_platform_for_every_python(tmp_path, compiler):
    wheel, said = built("wheel", tmp_path / "dist")
    names, facts = described(wheel)
    tag = f"py3-none-{compiling.platform_tag(compiler)}"
    assert wheel.name == f"multimodal_to-{version('multimodal-to')}-{tag}.whl"
    assert f"Tag: {tag}\n" in facts
    assert "Root-Is-Purelib: false\n" in facts
    assert "without" not in said
    with zipfile.ZipFile(wheel) as archive:
        assert compiling.is_current(Path(archive.extract(LIBRARY, tmp_path)))
    sources = {f"multimodal_to/native/sources/{file.name}" for file in compiling.SOURCES.iterdir()}
    assert {name for name in names if name.startswith("multimodal_to/native/sources/")} == sources


@pytest.mark.parametrize(
    ("reason", "environment"),
    [
        ("asked for", {"MULTIMODAL_TO_NATIVE": "0"}),
        ("no compiler", {"PATH": "/nowhere", "CC": ""}),
        ("a compiler that fails", {"PATH": "/nowhere", "CC": "false"}),
    ],
)
def test_without_a_library_the_wheel_is_built_all_the_same_for_every_platform(tmp_path, reason, environment):
    if reason != "asked for" and compiling.find_spec("ziglang"):
        pytest.skip("ziglang is installed")
    wheel, said = built("wheel", tmp_path, **environment)
    names, facts = described(wheel)
    assert wheel.name == f"multimodal_to-{version('multimodal-to')}-py3-none-any.whl"
    assert "Root-Is-Purelib: true\n" in facts
    assert LIBRARY not in names
    warnings = [line for line in said.splitlines() if "without its native library" in line]
    assert len(warnings) == (0 if reason == "asked for" else 1)
    assert all("solves take longer: no C compiler works here" in line for line in warnings)


def test_the_source_distribution_holds_what_the_build_needs_and_no_library(tmp_path):
    archive, _ = built("sdist", tmp_path)
    with tarfile.open(archive) as files:
        names = {name.partition("/")[2] for name in files.getnames()}
    assert {"hatch_build.py", "src/multimodal_to/native/compiling.py"} <= names
    assert {f"src/multimodal_to/native/sources/{file.name}" for file in compiling.SOURCES.iterdir()} <= names
    assert not [name for name in names if "_native." in name]


@pytest.fixture
def hook(tmp_path):
    """The hook, for a copy of the sources of the native part."""
    shutil.copytree(ROOT / "src/multimodal_to/native/sources", tmp_path / "src/multimodal_to/native/sources")
    shutil.copy(compiling.__file__, tmp_path / "src/multimodal_to/native/compiling.py")
    spec = spec_from_file_location("hatch_build", ROOT / "hatch_build.py")
    module = module_from_spec(spec)
    spec.loader.exec_module(module)
    return module.NativeLibrary(str(tmp_path), {}, None, None, "", "wheel", Application())


def test_an_editable_installation_puts_the_library_among_the_sources(tmp_path, hook, compiler):
    data = {"force_include": {}}
    library = tmp_path / "src" / LIBRARY
    hook.initialize("editable", data)
    assert compiling.is_current(library)
    assert data == {"force_include": {}}
    first = library.stat().st_mtime_ns
    hook.initialize("editable", data)
    assert library.stat().st_mtime_ns == first  # it was made from these sources
    (tmp_path / "src/multimodal_to/native/sources/new.c").write_text("int mt_new(void) { return 1; }\n")
    hook.initialize("editable", data)
    assert library.stat().st_mtime_ns > first
    assert not compiling.is_current(library)  # of the sources of this checkout, which lack the new file


def test_the_build_asks_for_ziglang_only_where_no_compiler_works(hook, compiler, monkeypatch, tmp_path):
    expected = [] if not compiler.is_zig else [compiling.ZIGLANG]
    assert hook.dependencies() == expected
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.setenv("CC", "")
    assert hook.dependencies() == [compiling.ZIGLANG]
    monkeypatch.setenv("MULTIMODAL_TO_NATIVE", "0")
    assert hook.dependencies() == []

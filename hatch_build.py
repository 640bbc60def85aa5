"""The build hook: compiles the native library and puts it into the wheel, which becomes one of its platform."""

from __future__ import annotations

import os
import shutil
import sys
import tempfile
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from types import ModuleType
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

NATIVE = Path("multimodal_to", "native")
SKIPPED = "MULTIMODAL_TO_NATIVE"
"""The environment variable that, with the value 0, builds a package without the library."""


def recipe(root: str | Path) -> ModuleType:
    """Return the module that knows how to compile, loaded by its path: the package is not installed yet."""
    name = "multimodal_to_compiling"
    spec = spec_from_file_location(name, Path(root, "src", NATIVE, "compiling.py"))
    assert spec is not None
    assert spec.loader is not None
    module = module_from_spec(spec)
    sys.modules[name] = module
    spec.loader.exec_module(module)
    return module


class NativeLibrary(BuildHookInterface[Any]):
    """Compiles the library into a wheel, or for an editable installation into its place among the sources.

    Where it cannot be compiled, the package is built without it, for every platform, and works without it.
    """

    def dependencies(self) -> list[str]:
        """Return what the build needs more: Zig where no compiler of the machine works."""
        return [] if _skipped() else recipe(self.root).requirements()

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Compile the library; it is left alone where it stands among the sources and was built from them."""
        if _skipped():
            return
        compiling = recipe(self.root)
        name = compiling.library_name()
        try:
            if version == "editable":
                library = Path(self.root, "src", NATIVE, name)
                if not compiling.is_current(library):
                    _build(compiling, library, compiling.any_compiler())
                return
            self._folder = tempfile.mkdtemp()
            library, compiler = Path(self._folder, name), compiling.any_compiler()
            _build(compiling, library, compiler)
        except compiling.BuildError as error:
            self.app.display_warning(f"multimodal-to comes without its native library, solves take longer: {error}")
            return
        build_data["pure_python"] = False
        build_data["tag"] = f"py3-none-{compiling.platform_tag(compiler)}"
        build_data["force_include"][str(library)] = (NATIVE / name).as_posix()

    def finalize(self, version: str, build_data: dict[str, Any], artifact_path: str) -> None:
        """Remove what was needed on the way."""
        shutil.rmtree(getattr(self, "_folder", ""), ignore_errors=True)


def _build(compiling: ModuleType, library: Path, compiler: Any) -> None:
    compiling.build(library, compiler)
    if not compiling.is_current(library):
        raise compiling.BuildError(f"what {compiler.name} made does not open")


def _skipped() -> bool:
    return os.environ.get(SKIPPED) == "0"

"""Folders and files of packages: those of ROS and Gazebo by their folder, those of Python by their list of files."""

from __future__ import annotations

import os
from collections.abc import Iterator
from importlib import metadata
from pathlib import Path

ROOT_VARIABLES = ("ROS_PACKAGE_PATH", "AMENT_PREFIX_PATH", "GAZEBO_MODEL_PATH", "GZ_SIM_RESOURCE_PATH")
"""Environment variables that list folders in which packages lie."""


def package_folders(name: str, home: Path) -> Iterator[Path]:
    """Yield where the package that an address `package://NAME/...` names may lie.

    It may hold the file that says so, or lie beside it or beside a folder above it, or in a folder of `ROOT_VARIABLES`,
    or be installed with its `package.xml`, as example-robot-data is.

    Args:
        name: of the package.
        home: the file that holds the address.
    """
    if name in ("", ".", "..") or "\\" in name or "/" in name:
        return
    for folder in home.parents:
        if folder.name == name:
            yield folder
        yield folder / name
    for variable in ROOT_VARIABLES:
        for entry in filter(None, os.environ.get(variable, "").split(os.pathsep)):
            yield Path(entry) / name
            yield Path(entry) / "share" / name
    if (share := package_file(name, f"{name}/package.xml")) is not None:
        yield share.parent


def package_file(package: str, ending: str) -> Path | None:
    """Return the file of an installed package whose path ends so; None where the package is not installed."""
    try:
        files = metadata.files(package) or []
    except (metadata.PackageNotFoundError, ValueError):
        return None
    found = (Path(str(file.locate())) for file in files if f"/{file.as_posix()}".endswith(f"/{ending}"))
    return next((Path(os.path.normpath(path)) for path in found if path.is_file()), None)

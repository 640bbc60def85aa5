"""Mesh files of a URDF: where they are, what is wrong with those that cannot be used, and their triangles."""

from __future__ import annotations

import io
import os
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import numpy as np
import trimesh

from multimodal_to.adam.spatial import Array
from multimodal_to.errors import MultimodalError, said
from multimodal_to.files.packages import ROOT_VARIABLES, package_folders
from multimodal_to.replay.collada import mended
from multimodal_to.values import Value

SUFFIXES = (".stl", ".dae", ".obj", ".ply", ".glb", ".gltf", ".off")
"""Kinds of mesh files that are read."""
LARGEST_MESH = 200_000_000
"""The largest mesh file that is read [byte]."""

_POINTER = b"version https://git-lfs"
_SCHEMES = ("package", "model")


class MeshWarning(UserWarning):
    """Meshes that a robot names but that cannot be drawn."""


class _UnusableError(MultimodalError):
    """Why a mesh cannot be used."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Part(Value):
    """Triangles of one colour, in metres in the frame of the visual."""

    vertices: Array  # (n, 3) [m]
    faces: np.ndarray  # (m, 3), indices of vertices
    rgba: tuple[float, ...] | None  # None: the file states none


def load_parts(uri: str, urdf: Path, scale: Array) -> list[Part]:
    """Return the triangles of a mesh that a URDF names, one part per colour of the file.

    Args:
        uri: the mesh's address as the URDF has it, see `find_mesh`.
        urdf: the file that names it.
        scale: of the mesh along its x, y and z [1], (3,).

    Raises:
        MultimodalError: the file is missing, outside its root, a git-LFS pointer, too large, or no mesh.
    """
    file = find_mesh(uri, urdf)
    if file.suffix.lower() not in SUFFIXES:
        raise _UnusableError(f"no {', '.join(SUFFIXES)} file")
    try:
        with file.open("rb") as stream:
            start, size = stream.read(len(_POINTER)), file.stat().st_size
    except OSError as error:
        raise _UnusableError(f"cannot be read: {error.strerror}") from error
    if start == _POINTER:
        raise _UnusableError("a git-LFS pointer; `git lfs pull` fetches the mesh")
    if size > LARGEST_MESH:
        raise _UnusableError(f"larger than {LARGEST_MESH / 1e6:g} MB")
    try:
        scene = _collada_scene(file) if file.suffix.lower() == ".dae" else trimesh.load_scene(file)
        meshes = [mesh for mesh in scene.dump() if isinstance(mesh, trimesh.Trimesh)]
    except Exception as error:  # readers of a dozen formats raise whatever they run into
        raise _UnusableError(f"no mesh that can be read: {said(error)}") from error
    if not meshes:
        raise _UnusableError("no triangles that can be read")
    return [Part(vertices=mesh.vertices * scale, faces=np.asarray(mesh.faces), rgba=_colour(mesh)) for mesh in meshes]


def _collada_scene(file: Path) -> Any:
    text = mended(file.read_bytes())
    return trimesh.load_scene(io.BytesIO(text), file_type="dae", resolver=trimesh.resolvers.FilePathResolver(str(file)))


def find_mesh(uri: str, urdf: Path) -> Path:
    """Return the file that a mesh's address in a URDF means.

    `package://NAME/PATH` and `model://NAME/PATH` mean PATH in the folder NAME: one that holds the URDF, or lies beside
    it or beside a folder above it, or in a folder of `ROOT_VARIABLES`, or the folder of an installed package. Any
    other path is relative to the URDF, or absolute, with `file://` before it or not. Backslashes are taken for slashes
    where no file has them in its name. Links are followed as the system does; a URDF that is one lies in both places.
    No address may leave its root by `..`: that is the folder NAME, or the package that holds the URDF (else the folder
    above it).

    Raises:
        MultimodalError: there is no such file, or the address leaves its root.
    """
    scheme, inside = _split(uri)
    if scheme not in ("", "file", *_SCHEMES) or "\0" in inside:
        where = "" if "\0" in inside else f": an address of '{scheme}://', and meshes are read from files"
        raise _UnusableError(f"not found{where}")
    problems: dict[str, None] = {}
    for address in dict.fromkeys((inside, inside.replace("\\", "/"))):
        for root, relative in _places(scheme, address, urdf, problems):
            candidate = root[1] / relative
            plain = Path(os.path.normpath(candidate))
            if not plain.is_relative_to(os.path.normpath(root[0])):
                problems["leaves the folder of its robot by '..'"] = None
            elif os.path.isfile(candidate):  # which takes names that no file can have, too
                return plain if os.path.isfile(plain) and os.path.samefile(plain, candidate) else candidate
            elif os.path.isfile(plain):
                return plain
    raise _UnusableError(next(iter(problems), "not found"))


def _split(uri: str) -> tuple[str, str]:
    """Return the scheme of an address in small letters, empty where it has none, and the rest with `%20` read."""
    scheme, found, inside = uri.partition("://")
    if not found or not scheme.isalpha():
        scheme, found, inside = uri.partition(":")
        return ("file", unquote(inside)) if found and scheme.lower() == "file" else ("", uri)
    return scheme.lower(), unquote(inside)


def _places(
    scheme: str, address: str, urdf: Path, problems: dict[str, None]
) -> Iterator[tuple[tuple[Path, Path], str]]:
    """Yield where a mesh may be: (the folder that it may not leave, the folder that its path starts in), and its path.

    Args:
        scheme: of the address, in small letters.
        address: without its scheme.
        urdf: the file that names it.
        problems: takes why a place is none, as the end of a sentence.
    """
    homes = tuple(dict.fromkeys((urdf.absolute(), urdf.resolve())))
    if scheme in _SCHEMES:
        name, _, inside = address.lstrip("/").partition("/")
        roots = [root for home in homes for root in package_folders(name, home) if root.is_dir()]
        for root in roots:
            yield (root, root), inside.lstrip("/")
        if roots:
            problems[f"not found in the folder '{roots[0]}'"] = None
        else:
            problems[
                f"not found: no folder '{name}' holds the URDF, lies beside it or above, or in "
                f"{', '.join(ROOT_VARIABLES)}"
            ] = None
        return
    local = address.removeprefix("localhost") if address.startswith("localhost/") and scheme == "file" else address
    path = Path(local)
    if ".." in path.parts or not path.is_absolute():
        for home in homes:
            yield (_own_root(home), home.parent), local
    elif path.suffix.lower() in SUFFIXES:
        yield (Path(path.anchor), Path(path.anchor)), local
    else:
        problems[f"not found as a mesh: no {', '.join(SUFFIXES)} file"] = None


def _own_root(urdf: Path) -> Path:
    folders = urdf.parents
    packages = (
        folder for folder in folders if any((folder / mark).is_file() for mark in ("package.xml", "robot.toml"))
    )
    return next(packages, folders[min(1, len(folders) - 1)])


def _colour(mesh: Any) -> tuple[float, ...] | None:
    """Return the one colour of a mesh whose file states colours: its material's, or the mean of its faces'."""
    if not mesh.visual.defined:
        return None
    if mesh.visual.kind == "texture":
        colour = np.asarray(mesh.visual.material.main_color, dtype=float)
    else:
        colour = np.asarray(mesh.visual.face_colors, dtype=float).mean(axis=0)
    return tuple(colour / 255.0)


def simplified(parts: list[Part], faces: int) -> list[Part]:
    """Return the parts with at most about so many triangles in all, each part thinned out in the same proportion."""
    total = sum(len(part.faces) for part in parts)
    if total <= faces:
        return parts
    return [_simplified(part, faces / total) for part in parts]


def _simplified(part: Part, share: float) -> Part:
    mesh = trimesh.Trimesh(part.vertices, part.faces)  # merges vertices that coincide, as those of STL
    count = max(round(share * len(mesh.faces)), min(len(mesh.faces), 12))
    if count >= len(mesh.faces):
        return part
    mesh = mesh.simplify_quadric_decimation(face_count=count)
    return Part(vertices=np.asarray(mesh.vertices), faces=np.asarray(mesh.faces), rgba=part.rgba)


def shaded(part: Part, crease: float = np.radians(35.0)) -> tuple[Array, np.ndarray, Array]:
    """Return vertices, faces and normals such that edges sharper than the crease [rad] look sharp, others smooth."""
    mesh = trimesh.graph.smooth_shade(trimesh.Trimesh(part.vertices, part.faces), angle=crease, facet_minarea=None)
    return np.asarray(mesh.vertices), np.asarray(mesh.faces), np.asarray(mesh.vertex_normals)

"""`.npz` archives of anybody, read within limits: no pickle, nothing too large, errors that name the file."""

from __future__ import annotations

import math
import os
import zipfile
from collections.abc import Iterable, Mapping
from pathlib import Path

import numpy as np

from multimodal_to.adam.spatial import Array
from multimodal_to.errors import TrajectoryError, said, shown

LARGEST_ARCHIVE = 32_000_000
"""The largest `.npz` that is read [byte] ..."""
LARGEST_CONTENT = 256_000_000
"""... and the most that its arrays may take in memory [byte]; ten thousand knots of a humanoid take a twentieth."""
LARGEST_VALUE = 1e15
"""The largest number that is read: squares and products of larger ones leave what a float holds."""
MOST_ARRAYS = 1_000
"""The most arrays of an archive."""


def read_archive(source: Path, *, leave_out_pickled: bool = False) -> dict[str, np.ndarray]:
    """Return the arrays of an `.npz` archive by name; nothing that is pickled is read, and nothing is too large.

    What the archive says of its sizes is checked before anything is unpacked: that of each file in the directory of the
    archive, which unpacking never exceeds, and that of each array against its file.

    Args:
        source: the file.
        leave_out_pickled: pass over arrays of pickled objects, which else break the archive; they are not read.

    Raises:
        TrajectoryError: the file is missing, is no such archive, or is too large.
    """
    if not os.path.isfile(source):  # which takes names that no file can have, too
        raise TrajectoryError(f"no trajectory file '{source}'")
    if (size := source.stat().st_size) > LARGEST_ARCHIVE:
        raise TrajectoryError(
            f"'{source}' has {size / 1e6:.0f} MB; trajectory files of at most {LARGEST_ARCHIVE / 1e6:.0f} MB are read"
        )
    if not zipfile.is_zipfile(source):
        raise TrajectoryError(f"'{source}' is not a trajectory file of this library: it is no .npz archive")
    try:
        with zipfile.ZipFile(source) as archive:
            _check_directory(archive, source)
            found = {member.filename.removesuffix(".npy"): _array(archive, member) for member in archive.infolist()}
    except TrajectoryError:
        raise
    except Exception as error:  # a broken archive takes zipfile, its unpackers and numpy to a dozen kinds of errors
        raise TrajectoryError(f"'{source}' is not a trajectory file of this library: {said(error)}") from error
    if (pickled := [name for name, array in found.items() if array is None]) and not leave_out_pickled:
        reason = f"'{pickled[0]}.npy' holds pickled objects, which are not read"
        raise TrajectoryError(f"'{source}' is not a trajectory file of this library: {reason}")
    return {name: array for name, array in found.items() if array is not None}


def _check_directory(archive: zipfile.ZipFile, source: Path) -> None:
    members = archive.infolist()
    if len(members) > MOST_ARRAYS:
        raise TrajectoryError(f"'{source}' holds {len(members)} arrays; at most {MOST_ARRAYS} are read")
    if (content := sum(member.file_size for member in members)) > LARGEST_CONTENT:
        raise TrajectoryError(
            f"'{source}' unpacks to {content / 1e6:.0f} MB; at most {LARGEST_CONTENT / 1e6:.0f} MB are read"
        )
    if len({member.filename for member in members}) < len(members):
        raise TrajectoryError(f"'{source}' is not a trajectory file of this library: it holds two arrays of one name")
    for member in members:  # other ways of packing are not unpacked piece by piece, so that their size has no limit
        if member.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
            raise TrajectoryError(f"'{source}' is not a trajectory file of this library: it is packed in another way")


def _array(archive: zipfile.ZipFile, member: zipfile.ZipInfo) -> np.ndarray | None:
    """Return an array of an archive after a look at its head, or None if it holds pickled objects.

    Numpy allots what the head says before it reads on.
    """
    with archive.open(member) as stream:
        version = np.lib.format.read_magic(stream)
        read = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
        shape, _, kind = read(stream)
        if kind.hasobject:
            return None
        if min(shape, default=1) < 0 or math.prod(shape) * kind.itemsize != member.file_size - stream.tell():
            raise ValueError(f"'{member.filename}' has another size than its shape {shown(shape)} says")
    with archive.open(member) as stream:
        return np.asarray(np.lib.format.read_array(stream, allow_pickle=False))


def refuse_missing(stored: Mapping[str, np.ndarray], wanted: Iterable[str], source: Path) -> None:
    """Name what an archive lacks.

    Args:
        stored: the arrays of the archive by name.
        wanted: the names that it has to have.
        source: the file, for the error.

    Raises:
        TrajectoryError: it lacks something.
    """
    if missing := [name for name in wanted if name not in stored]:
        raise TrajectoryError(f"'{source}' lacks {', '.join(missing)}")


def numbers(stored: Mapping[str, np.ndarray], name: str, source: Path) -> Array:
    """Return an array of an archive as floats.

    Args:
        stored: the arrays of the archive by name.
        name: of the array.
        source: the file, for errors.

    Raises:
        TrajectoryError: the array is not numeric, or a number is larger than `LARGEST_VALUE`.
    """
    array = stored[name]
    if array.dtype.kind not in "fiu":
        raise TrajectoryError(f"'{source}': '{name}' is not numeric")
    with np.errstate(over="ignore"):  # what a float cannot hold becomes infinite
        array = array.astype(float)
    if (np.abs(array) > LARGEST_VALUE).any():
        raise TrajectoryError(f"'{source}': '{name}' holds values larger than {LARGEST_VALUE:g}")
    return array


def texts(stored: Mapping[str, np.ndarray], name: str, source: Path) -> tuple[str, ...]:
    """Return an array of an archive as texts.

    Args:
        stored: the arrays of the archive by name.
        name: of the array.
        source: the file, for errors.

    Raises:
        TrajectoryError: the array holds no texts.
    """
    array = stored[name]
    try:
        if array.ndim > 1 or (array.size and array.dtype.kind != "U"):
            raise ValueError
        found = tuple(str(entry) for entry in np.atleast_1d(array).tolist())
        "".join(found).encode("utf-8")  # no halves of characters
    except ValueError as error:  # numpy's too, of codes that are no characters
        raise TrajectoryError(f"'{source}': '{name}' is no text") from error
    return found


def text(stored: Mapping[str, np.ndarray], name: str, source: Path) -> str:
    """Return an array of an archive as one text.

    Args:
        stored: the arrays of the archive by name.
        name: of the array.
        source: the file, for errors.

    Raises:
        TrajectoryError: the array does not hold one text.
    """
    found = texts(stored, name, source)
    if len(found) != 1:
        raise TrajectoryError(f"'{source}': '{name}' is no single text")
    return found[0]

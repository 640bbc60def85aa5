"""Files that appear whole or not at all."""

from __future__ import annotations

import os
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path

from multimodal_to import ending
from multimodal_to.errors import OutputError


@contextmanager
def whole(path: str | os.PathLike[str]) -> Iterator[Path]:
    """Give a path beside the target to write to, with the target's suffix; it becomes the target when all went well.

    Raises:
        OutputError: the folder does not exist or cannot be written.
    """
    target = Path(path)
    if "\0" in str(target):
        raise OutputError(f"cannot write '{target}': a path holds no null character")
    try:
        handle, name = tempfile.mkstemp(dir=target.parent, prefix=".", suffix=target.suffix)
        os.close(handle)
        draft = Path(name)
        with ending.cleaned(draft.unlink):
            try:
                yield draft
                draft.chmod(0o644)
                draft.replace(target)
            finally:
                draft.unlink(missing_ok=True)
    except OSError as error:
        raise OutputError(f"cannot write '{target}': {error.strerror or error}") from error


@contextmanager
def scratch(folder: str | os.PathLike[str] | None = None) -> Iterator[Path]:
    """Make a folder for files that are not kept, by default where the system has such folders; it goes at the end."""
    made = Path(tempfile.mkdtemp(dir=folder))
    remove = partial(shutil.rmtree, made, ignore_errors=True)
    with ending.cleaned(remove):
        try:
            yield made
        finally:
            remove()


def make_folder(path: str | os.PathLike[str]) -> None:
    """Make a folder, and those above it, where they are missing.

    Raises:
        OutputError: it cannot be made.
    """
    try:
        os.makedirs(path, exist_ok=True)
    except OSError as error:
        raise OutputError(f"cannot make the folder '{path}': {error.strerror or error}") from error


def write_text(path: str | os.PathLike[str], text: str) -> Path:
    """Write a text as UTF-8, whole or not at all, and return the path."""
    with whole(path) as draft:
        draft.write_text(text, encoding="utf-8")
    return Path(path)

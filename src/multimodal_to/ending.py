"""How the command line ends on Ctrl-C: at once, with one line and the usual exit status, from its first import on.

The `KeyboardInterrupt` that Python raises may get lost: some modules of other packages catch everything while they look
for what is installed, and compiled code does not expect it. So the command handles the signal itself, before it imports
anything that takes time. A program that imports the library keeps its own handling.
"""

from __future__ import annotations

import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from types import FrameType

INTERRUPTED = 130
"""Exit status of a command that Ctrl-C has ended: 128 + SIGINT, as shells have it."""
_cleaners: list[Callable[[], object]] = []


@contextmanager
def handled() -> Iterator[None]:
    """Let Ctrl-C end the process, unless it is handled or ignored already."""
    ours = _handle()
    try:
        yield
    finally:
        if ours:
            signal.signal(signal.SIGINT, signal.default_int_handler)


@contextmanager
def raised() -> Iterator[None]:
    """Let Ctrl-C raise `KeyboardInterrupt` again, for a command that only waits for it."""
    before = signal.getsignal(signal.SIGINT)
    if before is on_interrupt:
        signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)


@contextmanager
def cleaned(clean: Callable[[], object]) -> Iterator[None]:
    """Call a function also where Ctrl-C ends the process in between; at the end it is not called."""
    _cleaners.append(clean)
    try:
        yield
    finally:
        _cleaners.remove(clean)


def on_interrupt(number: int, frame: FrameType | None) -> None:
    """Say one line, remove what is half written, and end the process.

    An exception would not do: it is lost where it meets an import that catches everything, or compiled code.
    """
    os.write(2, b"interrupted\n")
    for clean in reversed(_cleaners):
        with suppress(Exception):
            clean()
    os._exit(INTERRUPTED)


def _handle() -> bool:
    """Handle Ctrl-C, unless it is handled or ignored already; return whether it was not."""
    plain = threading.current_thread() is threading.main_thread() and (
        signal.getsignal(signal.SIGINT) is signal.default_int_handler
    )
    if plain:
        signal.signal(signal.SIGINT, on_interrupt)
    return plain


def _is_command() -> bool:
    """Return whether the process was started as `multimodal-to` or `python -m multimodal_to`."""
    started = sys.argv[0] if sys.argv else ""  # while `-m` imports the package, "-m"
    return "multimodal_to" in sys.orig_argv if started == "-m" else Path(started).stem == "multimodal-to"


if _is_command():
    _handle()

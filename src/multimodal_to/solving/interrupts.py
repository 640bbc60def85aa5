"""Ctrl-C during a solve, which spends its time in compiled code."""

from __future__ import annotations

import signal
import threading
from types import FrameType

from multimodal_to import ending


class Interrupts:
    """While entered, the first Ctrl-C is noted in `asked` instead of raising; the next one raises again.

    An exception raised between CasADi's calls would end as a failure of the solver, and its iterate would be lost.
    A program that handles Ctrl-C in a way of its own is left to it, and so is a thread that is not the main one.
    """

    def __init__(self) -> None:
        self.asked = False
        self._entered = False

    def __enter__(self) -> Interrupts:
        main = threading.current_thread() is threading.main_thread()
        self._before = signal.getsignal(signal.SIGINT) if main else None
        self._entered = self._before in (signal.default_int_handler, ending.on_interrupt)
        if self._entered:
            signal.signal(signal.SIGINT, self._note)
        return self

    def __exit__(self, *_: object) -> None:
        if self._entered:
            signal.signal(signal.SIGINT, self._before)

    def _note(self, number: int, frame: FrameType | None) -> None:
        self.asked = True
        signal.signal(signal.SIGINT, signal.default_int_handler)

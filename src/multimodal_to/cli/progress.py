"""How a solve is shown while it runs, and stopped by Ctrl-C."""

from __future__ import annotations

import signal
from types import FrameType

from rich.console import Console
from rich.live import Live
from rich.text import Text

from multimodal_to.cli.expectation import Expectation, Rest
from multimodal_to.solving import Iterate

_LINE_EVERY = 5.0  # [s] between progress lines where the output is no terminal


class Progress:
    """Shows where a solve stands, and ends it cleanly on Ctrl-C; a second one, also later, ends the process at once."""

    def __init__(self, console: Console, expectation: Expectation | None = None) -> None:
        self._console = console
        self._rest = None if expectation is None else Rest(expectation)
        self._live = Live(console=console, transient=True, refresh_per_second=4)
        self.interrupted = False
        self._printed = -_LINE_EVERY

    def __call__(self, iterate: Iterate) -> bool:
        """Show an iterate; return whether Ctrl-C was pressed."""
        rest = "" if self._rest is None else f"{self._rest.after(iterate.iteration, iterate.elapsed)}   "
        line = (
            f"{iterate.elapsed:5.1f} s   {rest}iteration {iterate.iteration:4d}   "
            f"objective {iterate.objective:11.5g}   "
            f"largest violation {iterate.violation:.1e} {iterate.unit} ({iterate.worst})"
        )
        if self._console.is_terminal:
            self._live.update(Text(line, no_wrap=True, overflow="ellipsis"))
        elif iterate.elapsed - self._printed >= _LINE_EVERY:
            self._printed = iterate.elapsed
            self._console.print(line, soft_wrap=True)
        if self.interrupted:
            self._console.print("stopping; Ctrl-C again ends the process at once")
        return self.interrupted

    def __enter__(self) -> Progress:
        self._before = signal.signal(signal.SIGINT, self._interrupt)
        if self._console.is_terminal:
            self._live.start()
        return self

    def __exit__(self, *_: object) -> None:
        if self._console.is_terminal:
            self._live.stop()
        if not self.interrupted:
            signal.signal(signal.SIGINT, self._before)

    def _interrupt(self, number: int, frame: FrameType | None) -> None:
        self.interrupted = True
        self._console.show_cursor()  # whatever comes next
        signal.signal(signal.SIGINT, signal.SIG_DFL)  # which needs no Python to run, and the solver may not let it

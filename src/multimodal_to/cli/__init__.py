"""The command line, `multimodal-to`: the only part of the library that prints.

Exit status: 0 when done, 1 when a solve ended without an answer, an audit found something or a simulated
robot fell, 2 on bad input or a hopeless task, 130 when Ctrl-C ended the command.
"""

from __future__ import annotations

import sys
import warnings
from importlib.metadata import version
from typing import Annotated

import typer

# They register their commands, in this order.
# isort: off
from multimodal_to.cli import solving, sweeping, showing, judging, simulating, robots  # noqa: F401

# isort: on
from multimodal_to import ending
from multimodal_to.cli import streams
from multimodal_to.cli.common import app, out, remove_unused, say
from multimodal_to.errors import MultimodalError

__all__ = ["app", "main"]


def main() -> None:
    """Run the command line; errors of the library end in one sentence and exit status 2."""
    warnings.showwarning = _show_warning  # type: ignore[assignment]
    streams.fit()
    try:
        with ending.handled(), ending.cleaned(remove_unused):
            app()
    except MultimodalError as error:
        say("error", "bold red", str(error))
        sys.exit(2)


def _show_version(wanted: bool) -> None:
    if wanted:
        out.print(f"multimodal-to {version('multimodal-to')}")
        raise typer.Exit


@app.callback()
def _options(
    context: typer.Context,
    show_version: Annotated[
        bool, typer.Option("--version", callback=_show_version, is_eager=True, help="Print the version and leave.")
    ] = False,
) -> None:
    context.call_on_close(remove_unused)


def _show_warning(message: Warning | str, *_: object) -> None:
    say("warning", "yellow", str(message))

"""`sweep`: many plans from one file."""

from __future__ import annotations

import math
from itertools import islice
from pathlib import Path
from typing import Annotated

import typer
from rich.table import Table

from multimodal_to import ending
from multimodal_to.cli.common import app, number_option, out, whole_number_option
from multimodal_to.errors import InputError
from multimodal_to.sweeping.design import Design, read_design
from multimodal_to.sweeping.folder import Folder
from multimodal_to.sweeping.report import write_sweep_report
from multimodal_to.sweeping.sweep import ENGINES, TIME_LIMIT, Counts, counted, sweep

STATUS = "status"
_SHOWN = 5  # plans of a dry run
_FAILURES = 10  # plans without an answer that are named


@app.command("sweep")
def sweep_file(
    file: Annotated[Path, typer.Argument(help="Sweep file, TOML; or `status`, and then the folder of a sweep.")],
    folder: Annotated[Path | None, typer.Argument(help="Of `sweep status`.", show_default=False)] = None,
    output: Annotated[Path | None, typer.Option("--output", "-o", help="Folder of the sweep; gone on from.")] = None,
    dry_run: Annotated[
        bool, typer.Option("--dry-run", help="Say how many plans there are, and the first five.")
    ] = False,
    workers: Annotated[
        int | None, typer.Option(parser=whole_number_option, metavar="INT", help="Plans at once. [processors]")
    ] = None,
    engine: Annotated[str, typer.Option(help=f"What runs the plans: {' or '.join(ENGINES)}.")] = ENGINES[0],
    address: Annotated[str, typer.Option(help="Of a Ray cluster, as `auto`.")] = "",
    time_limit: Annotated[
        float, typer.Option(parser=number_option, metavar="FLOAT", help="Of each solve [s].")
    ] = TIME_LIMIT,
    simulate: Annotated[bool, typer.Option("--simulate", help="Play each answer back in MuJoCo.")] = False,
    cold: Annotated[bool, typer.Option("--cold", help="Start every plan from its own start guess.")] = False,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="Print nothing but errors.")] = False,
) -> None:
    """Make many plans over scenarios and robots; write each, its row, one table and a page. Given again, it goes on.

    `sweep status DIR` says how far one is. Exit status 0 when every plan has an answer that the audit passes, else 1.

    Example: multimodal-to sweep examples/sweep.toml --output results/sweep
    """
    if str(file) == STATUS and not file.exists():
        _status(folder)
        return
    if folder is not None:
        raise InputError(f"'{folder}' follows the sweep file; expected --output {folder}")
    design = read_design(file)
    if dry_run:
        _dry(design)
        return
    if output is None:
        raise InputError("expected the folder of the sweep: --output DIR")

    def tell(counts: Counts) -> None:
        line.update(_said(counts))

    try:
        with ending.raised(), out.status("") as line:
            counts = sweep(
                design,
                output,
                workers=workers,
                engine=engine,
                address=address,
                time_limit=time_limit,
                simulate=simulate,
                warm=not cold,
                progress=None if quiet else tell,
            )
    except KeyboardInterrupt:
        out.print("interrupted; the same command goes on with the plans that are left")
        raise typer.Exit(ending.INTERRUPTED) from None
    page = write_sweep_report(output)
    if not quiet:
        out.print(_said(counts))
        out.print(f"wrote {output / 'table.csv'}\nwrote {page}", soft_wrap=True)
    raise typer.Exit(1 if counts.failed else 0)


def _said(counts: Counts) -> str:
    rate = f", {3600.0 * counts.rate:.0f} plans an hour" if counts.made else ""
    left = f", {_time(counts.left)} left" if math.isfinite(counts.left) and counts.done < counts.total else ""
    return f"{counts.done} of {counts.total} plans, {counts.failed} failed{rate}{left}"


def _time(seconds: float) -> str:
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours} h {minutes} min" if hours else f"{minutes} min {rest} s" if minutes else f"{rest} s"


def _dry(design: Design) -> None:
    table = Table("plan", "scenario", "robot", *design.varied, box=None, pad_edge=False)
    for row in islice(design.rows(), _SHOWN):
        values = [f"{value:.6g}" if isinstance(value, float) else str(value) for value in row.inputs.values()]
        table.add_row(str(row.index), str(row.scenario["name"]), row.robot, *values)
    out.print(f"{design.count} plans")
    out.print(table)


def _status(folder: Path | None) -> None:
    if folder is None:
        raise InputError("expected the folder of a sweep: sweep status DIR")
    design, counts = counted(folder)
    out.print(_said(counts))
    kept = Folder(path=folder)
    failed = (row for row in kept.rows(design.count) if not (row.get("solved") and row.get("audit_holds")))
    for row in islice(failed, _FAILURES):
        why = row.get("message") if not row.get("solved") else f"audit: {row.get('audit_worst')}"
        out.print(f"{row['index']}: {row['status']}: {why}", soft_wrap=True)

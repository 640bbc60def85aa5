"""Runs beside the paper's figures, in two tables: how the solves went, and what the audit says of the motions."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from multimodal_to.arguments import checked
from multimodal_to.auditing.findings import Finding
from multimodal_to.reporting.published import PUBLISHED, PublishedRun
from multimodal_to.reporting.reproduce import Run

UNKNOWN = "–"


def _unknown(_: PublishedRun) -> str:
    return UNKNOWN


@dataclass(frozen=True, kw_only=True)
class Column:
    """A column: its title, and its text for a run and for figures of the paper."""

    title: str
    of_run: Callable[[Run], str]
    of_published: Callable[[PublishedRun], str] = _unknown


@dataclass(frozen=True, kw_only=True)
class ResultsTable:
    """Texts in rows, the first of each row its label."""

    titles: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]


def _number(value: float | None, form: str) -> str:
    return UNKNOWN if value is None else format(value, form)


def _worst(title: str, name: str, form: str, of_published: Callable[[PublishedRun], str] = _unknown) -> Column:
    """Return the column of a property of the audit.

    Args:
        title: of the column.
        name: of the property in the audit.
        form: format of its worst value.
        of_published: text for figures of the paper.
    """
    return Column(title=title, of_run=lambda run: format(run.report[name].worst, form), of_published=of_published)


def _verdict(run: Run) -> str:
    findings = run.report.findings
    failed = [finding.name for finding in findings if not finding.holds]
    if failed:
        return f"{len(failed)} of {len(findings)} fail"
    allowed = ", ".join(_limit(run.report[name]) for name in run.report.allowances_used)
    return f"all {len(findings)} hold" + (f", allowed {allowed}" if allowed else "")


def _limit(finding: Finding) -> str:
    return f"{finding.name} {finding.limit:g} {finding.unit}"


SOLVES = (
    Column(
        title="status",
        of_run=lambda run: run.solution.status.value if run.solution else UNKNOWN,
        of_published=lambda paper: paper.status or UNKNOWN,
    ),
    Column(
        title="iterations",
        of_run=lambda run: str(run.solution.iterations) if run.solution else UNKNOWN,
        of_published=lambda paper: _number(paper.iterations, "d"),
    ),
    Column(
        title="in the solver [s]",
        of_run=lambda run: f"{run.solution.solve_time:.2f}" if run.solution else UNKNOWN,
        of_published=lambda paper: _number(paper.solve_time, ".0f"),
    ),
    Column(title="in all [s]", of_run=lambda run: _number(run.whole_time, ".1f")),
    Column(
        title="duration [s]",
        of_run=lambda run: f"{run.report.duration:.1f}",
        of_published=lambda paper: _number(paper.duration, ".1f"),
    ),
    Column(
        title="airborne [s]",
        of_run=lambda run: f"{run.report.airborne:.2f}",
        of_published=lambda paper: _number(paper.airborne, ".2f"),
    ),
    Column(title="steps", of_run=lambda run: str(run.steps)),
    Column(
        title="thrust / weight",
        of_run=lambda run: f"{run.report.final_thrust_over_weight:.2f}",
        of_published=lambda paper: _number(paper.thrust_over_weight, ".2f"),
    ),
)
"""How the solve went and what motion came out."""

AUDITS = (
    _worst("force × height [N m]", "normal force × height", "z.4f", lambda paper: _number(paper.force_height, ".3f")),
    Column(
        title="slip under load [mm]",
        of_run=lambda run: f"{1e3 * run.report['slip under load'].worst:.2f}",
        of_published=lambda paper: UNKNOWN if paper.slip is None else f"{1e3 * paper.slip:.1f}",
    ),
    _worst("penetration [m]", "penetration", ".0e"),
    _worst("CoM [m]", "CoM consistency", ".0e"),
    _worst("momentum [kg m²/s]", "momentum consistency", ".0e"),
    _worst("torque beyond effort [N m]", "torque beyond effort", ".0f"),
    _worst("unexplained base force [N]", "unexplained base force", ".1f"),
    Column(title="verdict", of_run=_verdict),
)
"""What the audit of the motion says; a torque beyond effort that is negative is so far within the joints' limits."""

_SOLVES_NOTE = """\
*In all* is the time to build, solve and audit. A step of the iRonCub lifts at least 1 cm and lands at least 5 cm away.
Thrust over weight is vertical: ours at the end, the paper's in flight. The paper's rows are its published figures and
an audit of its published data. They are not runs on this machine."""

_AUDITS_NOTE = """\
Torque beyond effort is that of all joints by inverse dynamics; a negative one is within their limits. The unexplained
base force is the force that inverse dynamics asks for at the base, where nothing pushes."""


@checked
def table(runs: Sequence[Run], columns: Sequence[Column]) -> ResultsTable:
    """Return a table of runs; below those that were solved here, the paper's and published files of that scenario.

    A row of which nothing is known is left out.
    """
    solved, files = [run for run in runs if run.solution], [run for run in runs if not run.solution]
    rows = []
    for run in solved:
        label = run.name if run.executable else f"{run.name}, the paper's problem"
        rows.append((label, *(column.of_run(run) for column in columns)))
        rows += [
            (f"{run.name}, {paper.label}", *(column.of_published(paper) for column in columns))
            for paper in PUBLISHED
            if paper.scenario == run.name and not run.executable
        ]
        rows += [_of_file(file, columns) for file in files if file.name == run.name and not run.executable]
    names = {run.name for run in solved}
    rows += [_of_file(file, columns) for file in files if file.name not in names]
    known = tuple(row for row in rows if set(row[1:]) != {UNKNOWN})
    return ResultsTable(titles=("", *(column.title for column in columns)), rows=known)


def _of_file(run: Run, columns: Sequence[Column]) -> tuple[str, ...]:
    return (f"{run.name}, published file", *(column.of_run(run) for column in columns))


@checked
def markdown(runs: Sequence[Run]) -> str:
    """Return both tables as Markdown, each with what its columns mean: four paragraphs."""
    solves, audits = (table(runs, columns) for columns in (SOLVES, AUDITS))
    return "\n".join([*_lines(solves), "", _SOLVES_NOTE, "", *_lines(audits), "", _AUDITS_NOTE, ""])


def _lines(results: ResultsTable) -> list[str]:
    head = [results.titles, tuple("--" for _ in results.titles)]
    return ["| " + " | ".join(cells) + " |" for cells in (*head, *results.rows)]

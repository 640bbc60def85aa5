"""`audit`."""

from __future__ import annotations

import math
from dataclasses import asdict
from typing import Annotated, Any

import typer
from rich.table import Column, Table
from rich.text import Text

from multimodal_to.auditing.audit import Audit, audit
from multimodal_to.cli.common import File, RobotOption, app, described, loaded, out
from multimodal_to.cli.streams import print_json
from multimodal_to.trajectory.conditions import differences

_SAID = 5  # so many differences of robots are printed


@app.command("audit")
def audit_file(
    file: File,
    robot: RobotOption = "",
    kinematic: Annotated[
        bool, typer.Option("--kinematic", help="Judge only what needs no force, of motions that are no plans.")
    ] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print the findings as JSON, for programs.")] = False,
) -> None:
    """Check from the file alone whether a trajectory is physically true and does what its scenario asks.

    Exit status 0 only when every property holds, 1 when one does not.

    With --robot it also takes bare arrays under the names of a trajectory file, as the paper's data can be had, and
    motion files of trackers and simulators, as `export --to motion` writes them.

    Example: multimodal-to audit results/take-off/trajectory.npz
    """
    the_robot, trajectory = loaded(file, robot)
    report, unusual = audit(the_robot, trajectory, kinematic=kinematic), trajectory.unusual_formulation()
    others = differences(the_robot, trajectory)
    if as_json:
        more = {"formulation": unusual, "planned_for": list(others)}
        print_json({**_as_data(report), **more})
        raise typer.Exit(0 if report.holds else 1)
    narrow = [Column(title, no_wrap=True) for title in ("property", "worst", "limit", "unit", "knot")]
    table = Table(*narrow, "where", Column(no_wrap=True), box=None, pad_edge=False)
    for finding in report.findings:
        verdict = Text("ok", style="green") if finding.holds else Text("FAILS", style="bold red")
        table.add_row(
            finding.name,
            f"{finding.worst:.1e}",
            f"{finding.limit:.2g}",
            finding.unit,
            str(finding.knot),
            finding.body,
            verdict,
        )
    out.print(table)
    out.print(described(report))
    if report.scenario is None:
        out.print(
            "the file keeps no scenario: its start, end and ranges were not judged, the ground was taken as flat, and "
            "the friction as the robot's own pyramid",
            soft_wrap=True,
        )
    if unusual:
        out.print(f"the problem had {unusual}; the audit does not judge these", soft_wrap=True)
    for difference in others[:_SAID]:
        out.print(f"planned for another robot: {difference}", soft_wrap=True)
    if len(others) > _SAID:
        out.print(f"and {len(others) - _SAID} more")
    raise typer.Exit(0 if report.holds else 1)


def _as_data(report: Audit) -> dict[str, Any]:
    """Return an audit as what JSON can hold; a worst value that is not finite becomes null."""
    return {
        "holds": report.holds,
        "scenario": None if report.scenario is None else report.scenario.name,
        "duration": report.duration,
        "airborne": report.airborne,
        "final_thrust_over_weight": report.final_thrust_over_weight,
        "findings": [
            asdict(finding) | {"worst": finding.worst if math.isfinite(finding.worst) else None, "holds": finding.holds}
            for finding in report.findings
        ],
    }

"""`audit` and `simulate`."""

from __future__ import annotations

import math
from dataclasses import asdict
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.table import Column, Table
from rich.text import Text

from multimodal_to.auditing.audit import Audit, audit
from multimodal_to.cli.common import File, RobotOption, app, described, loaded, number_option, out, writable
from multimodal_to.cli.streams import print_json
from multimodal_to.errors import OutputError
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


@app.command()
def simulate(
    file: File,
    output: Annotated[
        Path | None, typer.Option("--output", "-o", help="Simulated trajectory to write. [FILE-simulated.npz]")
    ] = None,
    stabilise: Annotated[
        bool, typer.Option(help="Let a small stabiliser correct thrusts, contact forces and joints.")
    ] = True,
    delay: Annotated[
        float,
        typer.Option(
            parser=number_option,
            metavar="FLOAT",
            help="How far the motion follows the forces, from 0 to 1 intervals of the plan.",
        ),
    ] = 0.0,
    torque_limits: Annotated[bool, typer.Option(help="Clip joint torques at the robot's effort limits.")] = True,
    robot: RobotOption = "",
) -> None:
    """Play a trajectory back in MuJoCo, say how far it gets, and write what happened as a trajectory.

    Exit status 0 when the robot stands or hovers at the end, 1 when not. Needs the extra `sim`.

    Example: multimodal-to simulate results/take-off/trajectory.npz --output simulated.npz
    """
    target = output or file.with_stem(f"{file.stem}-simulated")
    if target.suffix.lower() != ".npz":
        raise OutputError(f"'{target}' is no .npz")
    the_robot, plan = loaded(file, robot)
    from multimodal_to import simulation

    agreement = {
        "at 100 random states": simulation.disagreement(the_robot, simulation.random_states(the_robot, 100)),
        "along the plan": simulation.disagreement(the_robot, simulation.states_along(plan)),
    }
    writable(target.parent)
    playback = simulation.play(the_robot, plan, stabilise=stabilise, delay=delay, torque_limits=torque_limits)
    outcome = simulation.tracking(playback)
    for note in playback.notes:
        out.print(f"note: {note}", soft_wrap=True)
    for where, difference in agreement.items():
        out.print(
            f"inverse dynamics {where}: MuJoCo and RNEA differ by {difference:.1e} of the largest force", soft_wrap=True
        )
    joints = f"joints {outcome.joint:.1f}° ({outcome.joint_name}), " if outcome.joint_name else ""
    slides = f"sliding joints {100 * outcome.slide:.1f} cm ({outcome.slide_name}), " if outcome.slide_name else ""
    out.print(
        f"largest errors over {plan.duration:.2f} s: CoM {100 * outcome.com:.1f} cm, base {outcome.attitude:.1f}°, "
        f"{joints}{slides}thrust {outcome.thrust:.1f} N",
        soft_wrap=True,
    )
    beyond = "clipped" if outcome.clipped else "not clipped, beyond it"
    for index, torque in enumerate(outcome.torques):
        if index == 0 or torque.beyond > 0.0:
            out.print(
                f"largest torque asked of {torque.joint}: {100 * torque.over_effort:.0f} % of its effort limit, at "
                f"{torque.when:.2f} s; {beyond} for {torque.beyond:.3f} s",
                soft_wrap=True,
            )
    for switch in outcome.switches:
        kind = "touch-down" if switch.touches else "lift-off"
        happened = "never" if switch.simulated is None else f"{switch.simulated - switch.planned:+.2f} s"
        out.print(f"{kind} of the {switch.foot} foot: planned at {switch.planned:.2f} s, simulated {happened}")
    when = "" if outcome.fell is None else f" at {outcome.fell:.2f} s"
    out.print(
        f"the robot {outcome.end}{when}; CoM error after the end "
        f"{100 * outcome.com_at_end:.1f} cm, base {outcome.attitude_at_end:.1f}°",
        soft_wrap=True,
    )
    out.print(f"wrote {simulation.simulated_trajectory(playback).save(target)}", soft_wrap=True)
    raise typer.Exit(0 if outcome.end in ("stands", "hovers") else 1)

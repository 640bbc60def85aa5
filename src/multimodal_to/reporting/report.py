"""A report of a motion: one HTML page with replay, figures, audit and scenario, which fetches nothing."""

from __future__ import annotations

import html
import io
import os
import platform
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from importlib import metadata, resources
from pathlib import Path
from string import Template
from typing import Any

import numpy as np

from multimodal_to.arguments import checked
from multimodal_to.auditing.audit import Audit, audit
from multimodal_to.auditing.findings import Finding
from multimodal_to.files.writing import write_text
from multimodal_to.models.robot import Robot
from multimodal_to.plotting import FIGURES, plot, plot_margins
from multimodal_to.replay import mark_of_fall, packed, player
from multimodal_to.scenarios.files import to_toml
from multimodal_to.scenarios.scenario import Scenario
from multimodal_to.trajectory import Trajectory
from multimodal_to.trajectory.derived import LargestTorque, largest_torques

PACKAGES = ("multimodal-to", "casadi", "numpy")
"""Whose versions the report names as those that drew it."""

_COSTLIEST = 6  # so many costs are named

_CAPTIONS: Mapping[str, str] = {
    "forces": "Throttle, thrust and vertical contact force",
    "com": "Centre of mass",
    "momentum": "Angular momentum about the centre of mass",
    "joints": "Joint positions and speeds",
    "torques": "Joint torques, by inverse dynamics of the planned motion under the planned forces",
    "contacts": "Contacts",
    "margins": "Height × force and slip × force, and the audit against its limits",
}


@dataclass(frozen=True, kw_only=True, eq=False)
class Carried:
    """What a controller made of a plan in a simulation."""

    motion: Trajectory  # what happened, on the plan's knots
    summary: str  # how it ended, a sentence
    fell: float | None = None  # when [s]


@checked
def write_report(
    robot: Robot,
    trajectory: Trajectory,
    path: str | os.PathLike[str],
    *,
    carried: Carried | None = None,
    meshes: bool = True,
) -> Path:
    """Write the report of a motion as one page that opens from disk; whole or not at all.

    Args:
        robot: that moves.
        trajectory: its motion, with the scenario and the record of its solve where it keeps them.
        path: of the page.
        carried: what a controller made of the motion, which is then drawn with the motion faint beside it.
        meshes: draw meshes where the robot has them; else boxes, cylinders and spheres alone.

    Raises:
        InputError: the trajectory is for another robot.
        OutputError: the folder does not exist or cannot be written.
    """
    report = audit(robot, trajectory)
    scenario = report.scenario
    title = trajectory.scenario if scenario is None else scenario.title
    template = Template(resources.files("multimodal_to.reporting").joinpath("report.html").read_text(encoding="utf-8"))
    return write_text(
        path,
        template.substitute(
            title=html.escape(f"{title} · {trajectory.robot}"),
            summary=_summary(report),
            facts="".join(_row(("th", name), ("td", text)) for name, text in _facts(robot, trajectory, report).items()),
            solve=_solve(trajectory),
            playback="" if carried is None else f"<p>{html.escape(carried.summary)}</p>",
            player=player(robot, trajectory, meshes=meshes)
            if carried is None
            else player(
                robot,
                carried.motion,
                ghost=trajectory,
                marks=mark_of_fall(trajectory, carried.fell),
                meshes=meshes,
            ),
            figures="\n".join(_figure(name, robot, trajectory, report) for name in FIGURES),
            findings="\n".join(_findings(report.findings)),
            scenario=_scenario(scenario),
        ),
    )


def _summary(report: Audit) -> str:
    failed = [finding.name for finding in report.findings if not finding.holds]
    count = len(report.findings)
    if not failed:
        return f'<span class="holds">All {count} properties of the audit hold.</span>'
    return f'<span class="fails">{len(failed)} of {count} properties fail: {html.escape(", ".join(failed))}.</span>'


def _torque(largest: LargestTorque) -> str:
    share = f", {100 * largest.over_effort:.0f} % of its effort limit" if np.isfinite(largest.effort) else ""
    return f"{largest.torque:.1f} {largest.unit} of {largest.joint} at {largest.when:.2f} s{share}"


def _facts(robot: Robot, trajectory: Trajectory, report: Audit) -> dict[str, str]:
    versions = [f"{name} {metadata.version(name)}" for name in PACKAGES]
    torques = largest_torques(robot, trajectory)
    status, took = (_solve_facts(trajectory.solve_record())[name] for name in ("status", "time in the solver"))
    return {
        "scenario": trajectory.scenario,
        "robot": f"{robot.name}: {len(robot.joint_names)} joints, {robot.mass:.2f} kg, "
        f"{len(robot.contacts)} contact points, {len(robot.jets)} jets",
        "time": f"{report.duration:.2f} s in {trajectory.knots} intervals; longest flight {report.airborne:.2f} s",
        "largest joint torque": _torque(torques[0]) if torques else "the robot has no joints",
        "thrust at the end": f"{100 * report.final_thrust_over_weight:.2f} % of the weight, vertically",
        "solver": ", ".join(filter(None, (status, took))) or "not known",
        "report made with": ", ".join([*versions, f"Python {platform.python_version()}"]),
    }


def _solve(trajectory: Trajectory) -> str:
    """Return how the trajectory was solved, as far as its file says."""
    record = trajectory.solve_record()
    if not record:
        return '<p class="quiet">The file does not say how it was solved.</p>'
    texts = {name: text for name, text in _solve_facts(record, trajectory.unusual_formulation()).items() if text}
    return f'<table class="facts">{"".join(_row(("th", name), ("td", text)) for name, text in texts.items())}</table>'


def _solve_facts(record: Mapping[str, Any], unusual: str = "") -> dict[str, str]:
    """Return the facts of a solve's record in words; those that it lacks are empty.

    Args:
        record: as the trajectory's file keeps it.
        unusual: how the problem differed from the paper's, in words.
    """
    violations, costs, threads, versions = (
        part if isinstance(part := record.get(name), dict) else {}
        for name in ("violations", "costs", "threads", "versions")
    )
    worst = sorted(_numbers(violations).items(), key=lambda entry: -entry[1])[:1]
    costliest = sorted(_numbers(costs).items(), key=lambda entry: -entry[1])[:_COSTLIEST]
    return {
        "status": " · ".join(str(record[name]) for name in ("status", "message") if record.get(name)),
        "unfinished": "the best iterate of a solve that had not ended" if record.get("kind") == "checkpoint" else "",
        "iterations": str(record.get("iterations", "")),
        "time in the solver": _measured(record, "solve_time", ".1f", " s"),
        "objective": _measured(record, "objective", ".6g", ""),
        "largest costs": ", ".join(f"{name} {value:.3g}" for name, value in costliest),
        "formulation": unusual,
        "largest violation": ", ".join(f"{value:.1e} ({name})" for name, value in worst),
        "linear solver": str(record.get("linear_solver", "")),
        "threads": ", ".join(f"{name} {count}" for name, count in threads.items() if count is not None),
        "solved with": ", ".join(f"{name} {version}" for name, version in versions.items()),
    }


def _numbers(table: Mapping[str, Any]) -> dict[str, float]:
    return {name: float(value) for name, value in table.items() if isinstance(value, int | float)}


def _measured(record: Mapping[str, Any], name: str, form: str, unit: str) -> str:
    return "".join(f"{value:{form}}{unit}" for value in _numbers({name: record.get(name)}).values())


def _row(*cells: tuple[str, str]) -> str:
    return "<tr>" + "".join(f"<{tag}>{html.escape(text)}</{tag.split()[0]}>" for tag, text in cells) + "</tr>"


def _findings(findings: Iterable[Finding]) -> Iterable[str]:
    number = 'td class="number"'
    for finding in findings:
        verdict = ('td class="holds"', "holds") if finding.holds else ('td class="fails"', "fails")
        yield _row(
            ("td", finding.name),
            (number, f"{finding.worst:.1e}"),
            (number, f"{finding.limit:.2g}"),
            ("td", finding.unit),
            (number, str(finding.knot)),
            ("td", finding.body),
            verdict,
        )


def _figure(name: str, robot: Robot, trajectory: Trajectory, report: Audit) -> str:
    figure = plot_margins(robot, trajectory, audits=[report]) if name == "margins" else plot(name, robot, trajectory)
    figure.suptitle("")  # the caption says it
    stream = io.BytesIO()
    figure.savefig(stream, format="svg")
    width, height = figure.get_size_inches()
    caption = html.escape(_CAPTIONS[name])
    tall = ' class="tall"' if height > width else ""
    image = f'<img alt="{caption}" data-packed="{packed(stream.getvalue())}">'
    return f"<figure{tall}><figcaption>{caption}</figcaption>{image}</figure>"


def _scenario(scenario: Scenario | None) -> str:
    if scenario is None:
        return (
            '<h2>Scenario</h2><p class="quiet">The file keeps no scenario: start, end and ranges were not judged.</p>'
        )
    return f"<h2>Scenario</h2><pre>{html.escape(to_toml(scenario), quote=False)}</pre>"

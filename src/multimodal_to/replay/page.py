"""The page that plays a motion: one file that opens from disk and fetches nothing."""

from __future__ import annotations

import base64
import gzip
import html
import json
import os
from collections.abc import Mapping, Sequence
from importlib import resources
from pathlib import Path
from string import Template
from types import MappingProxyType
from typing import Any

from multimodal_to.adam.spatial import Array
from multimodal_to.arguments import checked, vector
from multimodal_to.files.writing import write_text
from multimodal_to.models.robot import Robot
from multimodal_to.replay.ghost import GHOST_COLOUR
from multimodal_to.replay.motion import Picture, draw_motion, draw_still
from multimodal_to.replay.regions import COLOUR, regions_of
from multimodal_to.replay.scene import HOLD, Recorder, meshcat
from multimodal_to.replay.visuals import appearance
from multimodal_to.trajectory import Trajectory
from multimodal_to.trajectory.derived import flight_phases
from multimodal_to.trajectory.pushes import known_pushes

_VIEWER = Path(meshcat.__file__).parent / "viewer" / "dist" / "main.min.js"
_FLAME = ("#f58a24", "flame: thrust of a jet")
_ARROW = ("#1fa34a", "arrow: contact force")
_PUSH = ("#b5179e", "arrow: push from outside")
_REGION = (f"#{COLOUR:06x}", "seen through: wall or box of the task")
_COM = ("#2b6ce0", "sphere and line: centre of mass")
_MARK = "#111111"
_FLIGHT = ("#d62728", "bar above the time: flight")


@checked
def write_html(
    robot: Robot,
    trajectory: Trajectory,
    path: str | os.PathLike[str],
    *,
    ghost: Trajectory | None = None,
    marks: Mapping[float, str] | None = None,
    meshes: bool = True,
) -> Path:
    """Write one page that plays the motion in a browser, from disk, with networking off; whole or not at all.

    Opened with ``#t=2.5`` at its address's end, it stands still at 2.5 s; ``#t=2.5&bare`` hides the panels as well.

    Args:
        robot: that moves.
        trajectory: its motion.
        path: of the page.
        ghost: another motion of the same robot, drawn faint: the plan of a simulation, or the other way round.
        marks: what happens when [s], such as a fall; each is marked above the time and named.
        meshes: draw meshes where the robot has them; else boxes, cylinders and spheres alone.

    Raises:
        InputError: the ghost is not one of the same robot.
        OutputError: the folder does not exist or cannot be written.
    """
    return write_text(path, page(robot, trajectory, ghost=ghost, marks=marks, meshes=meshes))


@checked
def mark_of_fall(plan: Trajectory, fell: float | None) -> dict[float, str]:
    """Return the mark of a fall for a page that plays what happened to a plan; none where the robot did not fall.

    A fall after the end of the plan is marked at its end.

    Args:
        plan: that was carried out.
        fell: when, since the plan's start [s].
    """
    if fell is None:
        return {}
    late = fell - plan.duration
    text = "it fell" + (f" {late:.1f} s after the end" if late > 0.05 else "")
    return {float(plan.time[0]) + min(fell, plan.duration): text}


@checked
def page(
    robot: Robot,
    trajectory: Trajectory,
    *,
    ghost: Trajectory | None = None,
    marks: Mapping[float, str] | None = None,
    meshes: bool = True,
) -> str:
    """Return the page that `write_html` writes.

    Args:
        robot: that moves.
        trajectory: its motion.
        ghost: another motion of the same robot, drawn faint in the same scene; it begins when this one does.
        marks: what happens when [s], such as a fall; each is marked above the time and named.
        meshes: draw meshes where the robot has them; else boxes, cylinders and spheres alone.
    """
    return _page(trajectory, player(robot, trajectory, ghost=ghost, marks=marks, meshes=meshes))


@checked
def write_still_html(
    robot: Robot,
    trajectory: Trajectory,
    times: Sequence[float] | Array,
    path: str | os.PathLike[str],
    *,
    aspect: float,
    meshes: bool = True,
) -> Path:
    """Write a page with the robot at several times [s] in one still scene, for a picture of that width over height.

    Args:
        robot: that moves.
        trajectory: its motion.
        times: that increase [s], (stills,).
        path: of the page.
        aspect: width over height of the picture.
        meshes: draw meshes where the robot has them; else boxes, cylinders and spheres alone.

    Raises:
        InputError: a time is not within the trajectory.
        OutputError: the folder does not exist or cannot be written.
    """
    recorder, look = Recorder(), appearance(robot.urdf, meshes=meshes)
    picture = draw_still(
        meshcat.Visualizer(window=recorder),
        robot,
        trajectory,
        vector("the times of the snapshots", times, None),
        look,
        aspect,
    )
    return write_text(path, _page(trajectory, _player(robot, trajectory, recorder, picture, look.attribution)))


@checked
def player(
    robot: Robot,
    trajectory: Trajectory,
    *,
    ghost: Trajectory | None = None,
    marks: Mapping[float, str] | None = None,
    meshes: bool = True,
) -> str:
    """Return the HTML that plays the motion, for a page that has one: a block as high as what it stands in.

    Args:
        robot: that moves.
        trajectory: its motion.
        ghost: another motion of the same robot, drawn faint in the same scene; it begins when this one does.
        marks: what happens when [s], such as a fall; each is marked above the time and named.
        meshes: draw meshes where the robot has them; else boxes, cylinders and spheres alone.
    """
    recorder, look = Recorder(), appearance(robot.urdf, meshes=meshes)
    picture = draw_motion(meshcat.Visualizer(window=recorder), robot, trajectory, look, ghost=ghost)
    return _player(robot, trajectory, recorder, picture, look.attribution, ghost, marks or {})


def _page(trajectory: Trajectory, content: str) -> str:
    return _template("page.html").substitute(title=_title(trajectory), player=content)


def _player(
    robot: Robot,
    trajectory: Trajectory,
    recorder: Recorder,
    picture: Picture,
    attribution: str,
    ghost: Trajectory | None = None,
    marks: Mapping[float, str] = MappingProxyType({}),
) -> str:
    phases = [] if picture.still or not trajectory.contact_names else flight_phases(robot, trajectory)
    shown = {
        _FLAME: trajectory.jet_names,
        _ARROW: trajectory.contact_names,
        _PUSH: known_pushes(trajectory),
        _REGION: regions_of(trajectory),
        _COM: not picture.still,
        _FLIGHT: phases,
    }
    keys = [
        f'<div><span class="key" style="background: {colour}"></span>{text}</div>'
        for (colour, text), some in shown.items()
        if some
    ]
    if ghost is not None:
        text = f"faint, and its line: {html.escape(ghost.scenario)}"
        keys.append(f'<div><span class="key" style="background: #{GHOST_COLOUR:06x}"></span>{text}</div>')
    keys += [
        f'<div><span class="key" style="background: {_MARK}"></span>{html.escape(text)} at {time:.2f} s</div>'
        for time, text in marks.items()
    ]
    bands = [_band(trajectory, *phase) for phase in phases]
    bands += [_tick(trajectory, time, text) for time, text in marks.items()]
    return _template("player.html").substitute(
        title=_title(trajectory),
        legend="".join(keys),
        credit=f'<div class="panel credit">{html.escape(attribution)}</div>' if attribution else "",
        bands="".join(bands),
        duration=f"{trajectory.duration:.6f}",
        packed=packed(b"".join([_VIEWER.read_bytes(), *recorder.commands])),
        scene=_json(_content(trajectory, recorder, picture)),
    )


def _content(trajectory: Trajectory, recorder: Recorder, picture: Picture) -> dict[str, Any]:
    return {
        "duration": trajectory.duration,
        "hold": HOLD,
        "still": picture.still,
        "follow": picture.follow,
        "times": (trajectory.time - trajectory.time[0]).tolist(),
        "home": picture.home.tolist(),
        "way": picture.way.tolist(),
        "labels": [{"text": text, "position": place.tolist()} for text, place in picture.labels],
        "lengths": [_VIEWER.stat().st_size, *map(len, recorder.commands)],
    }


@checked
def packed(data: bytes) -> str:
    """Return bytes, compressed, as text that a page unpacks: a third of them, or less."""
    return base64.b64encode(gzip.compress(data, mtime=0)).decode("ascii")


def _title(trajectory: Trajectory) -> str:
    return html.escape(f"{trajectory.scenario} · {trajectory.robot}")


def _band(trajectory: Trajectory, start: float, end: float) -> str:
    left, width = ((instant / trajectory.duration) for instant in (start - trajectory.time[0], end - start))
    return f'<span class="band" style="left: {100 * left:.3f}%; width: {100 * width:.3f}%" title="flight"></span>'


def _tick(trajectory: Trajectory, time: float, text: str) -> str:
    left, what = 100 * (time - trajectory.time[0]) / trajectory.duration, html.escape(text)
    return f'<span class="tick" style="left: {left:.3f}%; background: {_MARK}" title="{what}"></span>'


def _json(content: Any) -> str:
    return json.dumps(content, separators=(",", ":")).replace("</", "<\\/")


def _template(name: str) -> Template:
    return Template(resources.files("multimodal_to.replay").joinpath(name).read_text(encoding="utf-8"))

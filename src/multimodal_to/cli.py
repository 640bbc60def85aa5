"""The command line, `multimodal-to`: the only part of the library that prints.

Exit status: 0 when done, 1 when a solve ended without an answer, an audit found something or a simulated
robot fell, 2 on bad input.
"""

from __future__ import annotations

import json
import math
import signal
import sys
import time
import warnings
from dataclasses import asdict
from importlib.metadata import version
from pathlib import Path
from tempfile import TemporaryFile
from types import FrameType
from typing import Annotated, Any

import typer
from rich.console import Console
from rich.live import Live
from rich.table import Column, Table
from rich.text import Text

from multimodal_to.adam.inspection import describe
from multimodal_to.audit import Audit, audit
from multimodal_to.errors import InputError, MultimodalError, OutputError, ScenarioError, unknown
from multimodal_to.export import EXPORTS
from multimodal_to.importing import import_arrays
from multimodal_to.models.robot import Robot, load_robot
from multimodal_to.ocp import Ipopt, Iterate, Solution, build
from multimodal_to.ocp import solve as run_solver
from multimodal_to.ocp.scenario import Scenario
from multimodal_to.ocp.scenario_data import stored, to_dict
from multimodal_to.scenario_files import change, load, to_toml
from multimodal_to.scenarios import SCENARIOS, find
from multimodal_to.trajectory import Trajectory, read_archive

app = typer.Typer(
    name="multimodal-to",
    help="Whole-body trajectory optimisation of robots that walk and fly.",
    no_args_is_help=True,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
)
robot_app = typer.Typer(help="Look at robots.", no_args_is_help=True)
app.add_typer(robot_app, name="robot")
_out = Console(highlight=False)
_LINE_EVERY = 5.0  # [s] between progress lines where the output is no terminal

File = Annotated[Path, typer.Argument(help="Trajectory file, as `solve` writes it.")]
ScenarioName = Annotated[str, typer.Argument(help="Scenario, as `list` shows it, or a TOML file of one.")]
Settings = Annotated[
    list[str] | None,
    typer.Option("--set", metavar="KEY=VALUE", help="Change a value, as in --set final_com_height=0.8; repeatable."),
]
RobotOption = Annotated[str, typer.Option("--robot", help="Bundled robot by name, or a robot's folder.")]


def main() -> None:
    """Run the command line; errors of the library end in one sentence and exit status 2."""
    warnings.showwarning = _show_warning  # type: ignore[assignment]
    try:
        app()
    except MultimodalError as error:
        Console(stderr=True, highlight=False).print(f"error: {error}", markup=False, soft_wrap=True)
        sys.exit(2)


def _show_version(wanted: bool) -> None:
    if wanted:
        _out.print(f"multimodal-to {version('multimodal-to')}")
        raise typer.Exit


@app.callback()
def _options(
    show_version: Annotated[
        bool, typer.Option("--version", callback=_show_version, is_eager=True, help="Print the version and leave.")
    ] = False,
) -> None:
    pass


@app.command("list")
def list_scenarios() -> None:
    """List the bundled scenarios with their numbers."""
    table = Table(Column(no_wrap=True), Column(), box=None, show_header=False, pad_edge=False)
    for make in SCENARIOS.values():
        scenario = make()
        table.add_row(scenario.name, f"{scenario.title}\n{_numbers(scenario)}")
    _out.print(table)


def _numbers(scenario: Scenario) -> str:
    durations = dict.fromkeys(f"{scenario.knots * dt:g}" for dt in (scenario.interval_min, scenario.interval_max))
    start, end = (" ".join(f"{number:g}" for number in com) for com in (scenario.initial_com, scenario.final_com))
    middle = "" if scenario.mid_height_min is None else f"above {scenario.mid_height_min:g} m at mid-horizon, "
    return (
        f"{scenario.knots} knots, {' to '.join(durations)} s, CoM from {start} m ({scenario.start.value}) to {end} m "
        f"({scenario.terminal.value}), {middle}jets {'on' if scenario.jets else 'off'}, "
        f"ground: {to_dict(scenario)['surface']['kind']}"
    )


@app.command()
def show(name: ScenarioName, settings: Settings = None) -> None:
    """Print a scenario as TOML, complete; also the one that a trajectory file was solved from.

    Example: multimodal-to show take-off > my_task.toml
    """
    scenario = stored(Trajectory.load(name)) if name.endswith(".npz") else _scenario(name, None)
    if scenario is None:
        raise ScenarioError(f"'{name}' keeps no scenario")
    _out.print(to_toml(change(scenario, settings or ())), markup=False, soft_wrap=True, end="")


def _scenario(name: str, settings: list[str] | None) -> Scenario:
    """Return a bundled scenario or that of a file, with the changes asked for."""
    return change(load(name) if name.endswith(".toml") else find(name), settings or ())


@app.command()
def solve(
    name: ScenarioName,
    settings: Settings = None,
    output: Annotated[
        Path | None, typer.Option("--output", "-o", help="Folder for the results; made if missing. [results/NAME]")
    ] = None,
    robot: RobotOption = "ironcub",
    max_iterations: Annotated[int, typer.Option(help="Give up after so many iterations.")] = 1000,
    time_limit: Annotated[float, typer.Option(help="Give up after so many seconds in the solver.")] = 3600.0,
    warm_start: Annotated[
        Path | None, typer.Option(help="Trajectory of a task much like this one to start from, for a faster answer.")
    ] = None,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="Print nothing but errors.")] = False,
) -> None:
    """Solve a scenario; write the trajectory, its plot and its replay page.

    Example: multimodal-to solve take-off --set final_com_height=0.8 --set weights.thrust=3 --output results/higher
    """
    scenario = _scenario(name, settings)
    solver = Ipopt(max_iterations=max_iterations, time_limit=time_limit)
    start = None if warm_start is None else Trajectory.load(warm_start)
    folder = _writable(output or Path("results") / scenario.name)
    console = Console(highlight=False, quiet=quiet)
    started = time.perf_counter()
    problem = build(load_robot(robot), scenario)
    the_robot = problem.robot  # with the jets that the scenario uses
    console.print(
        f"{scenario.title}: {the_robot.name}, {scenario.knots} knots, {problem.lower.size} variables, "
        f"{problem.row_lower.size} rows, built in {time.perf_counter() - started:.1f} s",
        soft_wrap=True,
    )
    with _Progress(console) as progress:
        solution = run_solver(problem, solver, progress, start=start)
    report = audit(the_robot, solution.trajectory, scenario)
    _summarise(console, solution, report)

    from multimodal_to.plotting import plot_forces, save  # viewers take a second to import, other commands need none
    from multimodal_to.replay import write_html

    written = [solution.trajectory.save(folder / "trajectory.npz")]
    written.append(save(plot_forces(the_robot, solution.trajectory), folder / "forces.png"))
    written.append(write_html(the_robot, solution.trajectory, folder / "replay.html"))
    for path in written:
        console.print(f"wrote {path}", soft_wrap=True)
    if not solution.status.solved:
        raise typer.Exit(1)


@app.command("reproduce")
def reproduce_scenarios(
    names: Annotated[list[str] | None, typer.Argument(help="Bundled scenarios; without, all.")] = None,
    output: Annotated[Path, typer.Option("--output", "-o", help="Folder for the results; made if missing.")] = Path(
        "results"
    ),
    published: Annotated[
        Path | None, typer.Option(help="Folder of the paper's trajectories as bare arrays, to audit beside.")
    ] = None,
) -> None:
    """Solve the bundled scenarios again and tabulate the answers beside the paper's figures.

    For each, trajectory, figures and report go to a folder of its name; the tables go to table.md. Exit status 0 only
    when every solve has an answer that passes the audit.

    Example: multimodal-to reproduce take-off jump --output results
    """
    scenarios = [find(name) for name in names or SCENARIOS]
    folders = [_writable(output / scenario.name) for scenario in scenarios]
    robot = load_robot("ironcub")

    from multimodal_to.comparison import AUDITS, SOLVES, markdown, table
    from multimodal_to.reproduce import read_published, reproduce, write_run
    from multimodal_to.writing import write_text

    files = [] if published is None else read_published(robot, published)
    runs = []
    for scenario, folder in zip(scenarios, folders, strict=True):
        _out.print(f"{scenario.name}: {scenario.title}")
        with _Progress(_out) as progress:
            run = reproduce(robot, scenario, progress=progress)
        write_run(run, folder)
        runs.append(run)
        _out.print(f"wrote {folder}", soft_wrap=True)
        if progress.interrupted:
            break
    for columns in (SOLVES, AUDITS):
        results = table([*runs, *files], columns)
        others = [Column(title, overflow="fold") for title in results.titles[1:]]
        drawn = Table(Column(no_wrap=True), *others, box=None, pad_edge=False)
        for cells in results.rows:
            drawn.add_row(*cells)
        _out.print(drawn)
    _out.print(f"wrote {write_text(output / 'table.md', markdown([*runs, *files]))}", soft_wrap=True)
    if len(runs) < len(scenarios) or not all(run.holds for run in runs):
        raise typer.Exit(1)


def _load(file: Path, robot: str) -> tuple[Robot, Trajectory]:
    """Return a trajectory with its robot; a file of bare arrays needs the robot named."""
    if robot and "format_version" not in read_archive(file):
        the_robot = load_robot(robot)
        return the_robot, import_arrays(the_robot, file)
    trajectory = Trajectory.load(file)
    return load_robot(robot or trajectory.robot).with_jets(trajectory.jet_names), trajectory


@app.command()
def plot(
    files: Annotated[list[Path], typer.Argument(help="Trajectory files; several are drawn in one figure.")],
    figure: Annotated[
        str, typer.Option(help="forces, com, momentum, joints, torques, contacts, margins, or all of them.")
    ] = "forces",
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", help="Picture: .png, .svg or .pdf; of all, the start of the names. [FILE.png]"),
    ] = None,
    robot: RobotOption = "",
) -> None:
    """Plot a trajectory, or several to compare, with limits dashed and flight in red.

    Example: multimodal-to plot results/take-off/trajectory.npz --figure com --output com.svg
    """
    from multimodal_to.plotting import FIGURES, SUFFIXES, save
    from multimodal_to.plotting import plot as draw

    target = output or files[0].with_suffix(".png")
    if target.suffix.lower() not in SUFFIXES:
        raise OutputError(f"'{target}' is no .png, .svg or .pdf")
    if figure not in (*FIGURES, "all"):
        raise InputError(unknown("figure", figure, (*FIGURES, "all")))
    loaded = [_load(file, robot) for file in files]
    the_robot = load_robot(robot or loaded[0][1].robot)
    trajectories = [trajectory for _, trajectory in loaded]
    _writable(target.parent)
    for name in FIGURES if figure == "all" else (figure,):
        path = target.with_stem(f"{target.stem}-{name}") if figure == "all" else target
        drawn = draw(name, the_robot, *trajectories, labels=_labels(files, trajectories))
        _out.print(f"wrote {save(drawn, path)}", soft_wrap=True)


def _labels(files: list[Path], trajectories: list[Trajectory]) -> list[str]:
    """Return a short name for each file: its scenario, or its path where two are of one scenario."""
    scenarios = [trajectory.scenario for trajectory in trajectories]
    return [
        scenario if scenarios.count(scenario) == 1 else str(file)
        for scenario, file in zip(scenarios, files, strict=True)
    ]


@app.command()
def replay(
    file: File,
    html: Annotated[Path | None, typer.Option(help="Write a page that opens from disk, without a server.")] = None,
    gif: Annotated[Path | None, typer.Option(help="Write a GIF that repeats.")] = None,
    mp4: Annotated[Path | None, typer.Option(help="Write an MP4 film.")] = None,
    snapshots: Annotated[Path | None, typer.Option(help="Write a PNG of the robot at several times.")] = None,
    times: Annotated[str, typer.Option(help="Times of the snapshots [s], as 0,2.5,7.")] = "",
    fps: Annotated[float | None, typer.Option(help="Frames a second. [GIF 12.5, MP4 25]")] = None,
    meshes: Annotated[bool, typer.Option(help="Draw meshes where the robot has them.")] = True,
    robot: RobotOption = "",
) -> None:
    """Replay a trajectory in the browser, live or as a page, or render it; GIF, MP4 and PNG need Chromium or Chrome.

    Example: multimodal-to replay results/take-off/trajectory.npz --html take-off.html --gif take-off.gif
    """
    the_robot, trajectory = _load(file, robot)
    instants = _option_numbers("--times", times) if times else None
    wanted = {".html": html, ".png": snapshots, ".gif": gif, ".mp4": mp4}
    targets = {suffix: path for suffix, path in wanted.items() if path is not None}
    for suffix, path in targets.items():
        _writable_file(path, suffix)
    from multimodal_to.replay import show, write_gif, write_html, write_mp4, write_snapshots

    write = {
        ".html": lambda path: write_html(the_robot, trajectory, path, meshes=meshes),
        ".png": lambda path: write_snapshots(the_robot, trajectory, path, times=instants, meshes=meshes),
        ".gif": lambda path: write_gif(the_robot, trajectory, path, rate=12.5 if fps is None else fps, meshes=meshes),
        ".mp4": lambda path: write_mp4(the_robot, trajectory, path, rate=25.0 if fps is None else fps, meshes=meshes),
    }
    for suffix, path in targets.items():
        _out.print(f"wrote {write[suffix](path)}", soft_wrap=True)
    if targets:
        return
    visualizer = show(the_robot, trajectory, meshes=meshes)
    _out.print(f"replaying at {visualizer.url()}; Ctrl-C ends", soft_wrap=True)
    visualizer.open()
    try:
        while True:
            time.sleep(1.0)
    except KeyboardInterrupt:
        _out.print()


@app.command("report")
def report_file(
    file: File,
    output: Annotated[Path | None, typer.Option("--output", "-o", help="Page to write. [FILE.html]")] = None,
    meshes: Annotated[bool, typer.Option(help="Draw meshes where the robot has them.")] = True,
    robot: RobotOption = "",
) -> None:
    """Write one page with replay, figures, audit and scenario of a trajectory; it opens from disk and prints.

    Example: multimodal-to report results/take-off/trajectory.npz --output take-off.html
    """
    the_robot, trajectory = _load(file, robot)
    target = output or file.with_suffix(".html")
    _writable_file(target, ".html")
    from multimodal_to.report import write_report

    _out.print(f"wrote {write_report(the_robot, trajectory, target, meshes=meshes)}", soft_wrap=True)


@app.command("export")
def export_file(
    file: File,
    to: Annotated[str, typer.Option("--to", help="csv, mat, mujoco or pinocchio.")],
    output: Annotated[Path | None, typer.Option("--output", "-o", help="File to write. [FILE.csv and so on]")] = None,
    robot: RobotOption = "",
) -> None:
    """Write a trajectory for another program, with names, units and conventions.

    Example: multimodal-to export results/take-off/trajectory.npz --to mujoco --output take-off-mujoco.npz
    """
    if to not in EXPORTS:
        raise InputError(unknown("export", to, EXPORTS))
    the_robot, trajectory = _load(file, robot)
    suffix, write = EXPORTS[to]
    target = output or (file.with_stem(f"{file.stem}-{to}") if suffix == ".npz" else file.with_suffix(suffix))
    _writable_file(target, suffix)
    _out.print(f"wrote {write(the_robot, trajectory, target)}", soft_wrap=True)


@app.command()
def simulate(
    file: File,
    output: Annotated[
        Path | None, typer.Option("--output", "-o", help="Simulated trajectory to write. [FILE-simulated.npz]")
    ] = None,
    stabilise: Annotated[
        bool, typer.Option(help="Let a small stabiliser correct thrusts, contact forces and joints.")
    ] = True,
    robot: RobotOption = "",
) -> None:
    """Play a trajectory back in MuJoCo, say how far it gets, and write what happened as a trajectory.

    Exit status 0 when the robot stands or hovers at the end, 1 when not. Needs the extra `sim`.

    Example: multimodal-to simulate results/take-off/trajectory.npz --output simulated.npz
    """
    target = output or file.with_stem(f"{file.stem}-simulated")
    if target.suffix.lower() != ".npz":
        raise OutputError(f"'{target}' is no .npz")
    the_robot, plan = _load(file, robot)
    from multimodal_to import simulation

    agreement = {
        "at 100 random states": simulation.disagreement(the_robot, simulation.random_states(the_robot, 100)),
        "along the plan": simulation.disagreement(the_robot, simulation.states_along(plan)),
    }
    _writable(target.parent)
    playback = simulation.play(the_robot, plan, stabilise=stabilise)
    outcome = simulation.tracking(playback)
    for where, difference in agreement.items():
        _out.print(f"inverse dynamics {where}: MuJoCo and RNEA differ by {difference:.1e} of the largest force",
                   soft_wrap=True)  # fmt: skip
    _out.print(
        f"largest errors over {plan.duration:.2f} s: CoM {100 * outcome.com:.1f} cm, base {outcome.attitude:.1f}°, "
        f"joints {outcome.joint:.1f}° ({outcome.joint_name}), thrust {outcome.thrust:.1f} N; largest torque "
        f"{100 * outcome.torque_over_effort:.0f} % of its joint's effort limit",
        soft_wrap=True,
    )
    for switch in outcome.switches:
        kind = "touch-down" if switch.touches else "lift-off"
        happened = "never" if switch.simulated is None else f"{switch.simulated - switch.planned:+.2f} s"
        _out.print(f"{kind} of the {switch.foot} foot: planned at {switch.planned:.2f} s, simulated {happened}")
    when = "" if outcome.fell is None else f" at {outcome.fell:.2f} s"
    _out.print(f"the robot {outcome.end}{when}; CoM error after the end "
               f"{100 * outcome.com_at_end:.1f} cm, base {outcome.attitude_at_end:.1f}°", soft_wrap=True)  # fmt: skip
    _out.print(f"wrote {simulation.simulated_trajectory(playback).save(target)}", soft_wrap=True)
    raise typer.Exit(0 if outcome.end in ("stands", "hovers") else 1)


@robot_app.command("info")
def robot_info(
    path: Annotated[str, typer.Argument(help="URDF file, a robot's folder, or the name of a bundled robot.")],
) -> None:
    """Show a robot's tree, masses and frames, what was merged or locked, and what looks wrong.

    Example: multimodal-to robot info ironcub
    """
    if Path(path).is_file():
        description = describe(path)
    else:
        the_robot = load_robot(path)
        description = describe(the_robot.urdf, the_robot.joint_names)
    _out.print(str(description), markup=False, soft_wrap=True)


@app.command("audit")
def audit_file(
    file: File,
    robot: RobotOption = "",
    as_json: Annotated[bool, typer.Option("--json", help="Print the findings as JSON, for programs.")] = False,
) -> None:
    """Check from the file alone whether a trajectory is physically true and does what its scenario asks.

    Exit status 0 only when every property holds, 1 when one does not.

    With --robot it also takes bare arrays under the names of a trajectory file, as the paper's data can be had.

    Example: multimodal-to audit results/take-off/trajectory.npz
    """
    report = audit(*_load(file, robot))
    if as_json:
        typer.echo(json.dumps(_as_data(report), indent=2, ensure_ascii=False))
        raise typer.Exit(0 if report.holds else 1)
    narrow = [Column(title, no_wrap=True) for title in ("property", "worst", "limit", "unit", "knot")]
    table = Table(*narrow, "where", Column(no_wrap=True), box=None, pad_edge=False)
    for finding in report.findings:
        verdict = "ok" if finding.holds else "FAILS"
        table.add_row(finding.name, f"{finding.worst:.1e}", f"{finding.limit:.2g}", finding.unit, str(finding.knot),
                      finding.body, verdict)  # fmt: skip
    _out.print(table)
    _out.print(_describe(report))
    if report.scenario is None:
        _out.print(
            "the file keeps no scenario: its start, end and ranges were not judged, the ground was taken as flat, and "
            "the friction as the robot's own pyramid",
            soft_wrap=True,
        )
    raise typer.Exit(0 if report.holds else 1)


def _option_numbers(option: str, text: str) -> list[float]:
    try:
        return [float(word) for word in text.split(",")]
    except ValueError as error:
        raise InputError(f"{option} is '{text}'; expected numbers with commas between them") from error


def _show_warning(message: Warning | str, *_: object) -> None:
    Console(stderr=True, highlight=False).print(f"warning: {message}", markup=False, soft_wrap=True)


def _writable(folder: Path) -> Path:
    """Make a folder if it is missing and make sure that files can be written there."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with TemporaryFile(dir=folder):
            pass
    except OSError as error:
        raise OutputError(f"cannot write to the folder '{folder}': {error.strerror or error}") from error
    return folder


def _writable_file(path: Path, suffix: str) -> None:
    """Make sure that a file has its suffix and that its folder can be written to; the folder is made if missing."""
    if path.suffix.lower() != suffix:
        raise OutputError(f"'{path}' is no {suffix}")
    _writable(path.parent)


def _describe(report: Audit) -> str:
    return (
        f"{report.duration:.2f} s, longest flight {report.airborne:.2f} s, vertical thrust at the end "
        f"{100 * report.final_thrust_over_weight:.2f} % of the weight"
    )


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


def _summarise(console: Console, solution: Solution, report: Audit) -> None:
    name, violation, unit = solution.largest_violation
    console.print(
        f"{solution.status.value}: {solution.status.advice}\n"
        f"{solution.iterations} iterations in {solution.solve_time:.1f} s, objective {solution.objective:.6g}, largest "
        f"violation {violation:.1e} {unit} ({name})\n{_describe(report)}",
        soft_wrap=True,
    )
    failed = [finding for finding in report.findings if not finding.holds]
    for finding in failed:
        console.print(
            f"audit: {finding.name} is {finding.worst:.2e} {finding.unit} at knot {finding.knot} {finding.body}, "
            f"more than {finding.limit:g}",
            soft_wrap=True,
        )
    if not failed:
        console.print(f"audit: all {len(report.findings)} properties hold")


class _Progress:
    """Shows where a solve stands, and ends it cleanly on Ctrl-C."""

    def __init__(self, console: Console) -> None:
        self._console = console
        self._live = Live(console=console, transient=True, refresh_per_second=4)
        self.interrupted = False
        self._printed = -_LINE_EVERY

    def __call__(self, iterate: Iterate) -> bool:
        line = (
            f"{iterate.elapsed:5.1f} s   iteration {iterate.iteration:4d}   objective {iterate.objective:11.5g}   "
            f"largest violation {iterate.violation:.1e} {iterate.unit} ({iterate.worst})"
        )
        if self._console.is_terminal:
            self._live.update(Text(line, no_wrap=True, overflow="ellipsis"))
        elif iterate.elapsed - self._printed >= _LINE_EVERY:
            self._printed = iterate.elapsed
            self._console.print(line, soft_wrap=True)
        return self.interrupted

    def __enter__(self) -> _Progress:
        self._before = signal.signal(signal.SIGINT, self._interrupt)
        if self._console.is_terminal:
            self._live.start()
        return self

    def __exit__(self, *_: object) -> None:
        if self._console.is_terminal:
            self._live.stop()
        signal.signal(signal.SIGINT, self._before)

    def _interrupt(self, number: int, frame: FrameType | None) -> None:
        self.interrupted = True

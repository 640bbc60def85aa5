"""`list`, `show`, `doctor`, `solve` and `reproduce`."""

from __future__ import annotations

import math
import time
from dataclasses import asdict, replace
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.table import Column, Table

from multimodal_to.auditing import Audit, audit, check_allowances
from multimodal_to.cli import completion
from multimodal_to.cli.common import (
    DEFAULT_ROBOT,
    OptionalName,
    RobotOption,
    ScenarioName,
    Settings,
    app,
    chosen,
    described,
    loaded,
    number_option,
    out,
    robot_for,
    say,
    whole_number_option,
    writable,
)
from multimodal_to.cli.expectation import expect
from multimodal_to.cli.progress import Progress
from multimodal_to.cli.streams import print_json, print_toml
from multimodal_to.cli.tasks import free_checkpoint, given
from multimodal_to.doctor import Diagnosis, Severity, refusal
from multimodal_to.doctor import doctor as examine
from multimodal_to.errors import InputError, ScenarioError, apart, listed
from multimodal_to.models.loading import bundled_robots, load_robot
from multimodal_to.models.robot import Robot
from multimodal_to.native import missing
from multimodal_to.ocp import Formulation, Problem, build
from multimodal_to.ocp.integration import LEAPFROG
from multimodal_to.scenarios import SCENARIOS, find
from multimodal_to.scenarios import paper as as_in_paper
from multimodal_to.scenarios.data import stored, to_dict
from multimodal_to.scenarios.files import change, to_toml
from multimodal_to.scenarios.scenario import Scenario, word
from multimodal_to.solving import Ipopt, Solution, Status, relax
from multimodal_to.solving import solve as run_solver
from multimodal_to.solving.linear_solvers import AUTO, LINEAR_SOLVERS, choose
from multimodal_to.tasks import BUNDLED_FOR, TASKS
from multimodal_to.tasks.finding import is_starter, numbers, refuse_unknown
from multimodal_to.trajectory import Trajectory
from multimodal_to.trajectory.conditions import under_conditions
from multimodal_to.trajectory.derived import largest_torques

_VIOLATIONS_SHOWN = 5


@app.command("list")
def list_scenarios() -> None:
    """List the bundled scenarios with their numbers, and the starter tasks of any robot with what can be set.

    Example: multimodal-to list
    """
    table = Table(Column(no_wrap=True), Column(), box=None, show_header=False, pad_edge=False)
    for make in SCENARIOS.values():
        scenario = make()
        table.add_row(scenario.name, f"{scenario.title}\n{_numbers(scenario)}")
    out.print(table)
    above = [f"{name} of {robot}" for robot in BUNDLED_FOR for name in TASKS if not is_starter(name, robot)]
    out.print(
        f"\nStarter tasks of any robot, as in `solve squat --robot DIR`; {listed(above)} are those above:\n",
        soft_wrap=True,
    )
    table = Table(Column(no_wrap=True), Column(), box=None, show_header=False, pad_edge=False)
    for name, task in TASKS.items():
        about = (task.__doc__ or "").split("\n", 1)[0].removeprefix("Return ")
        table.add_row(name, f"{about}\n--set {', '.join(f'{key}=' for key in numbers(name))}")
    out.print(table)


def _numbers(scenario: Scenario) -> str:
    durations = dict.fromkeys(f"{scenario.knots * dt:g}" for dt in (scenario.interval_min, scenario.interval_max))
    start, end = (" ".join(f"{number:g}" for number in com) for com in (scenario.start_com, scenario.end_com))
    middle = "" if scenario.mid_height_min is None else f"above {scenario.mid_height_min:g} m at mid-horizon, "
    return (
        f"{scenario.knots} knots, {' to '.join(durations)} s, CoM from {start} m ({word(scenario.start)}) to {end} m "
        f"({word(scenario.terminal)}), {middle}jets {'on' if scenario.jets else 'off'}, "
        f"ground: {to_dict(scenario)['surface']['kind']}"
    )


@app.command()
def show(
    name: Annotated[
        str,
        typer.Argument(
            help="Task, as `list` shows it, a TOML file of one, or a trajectory file.",
            autocompletion=completion.scenarios_or_trajectories,
        ),
    ],
    settings: Settings = None,
    torques: Annotated[
        bool, typer.Option("--torques", help="Print the largest torque of every joint of a trajectory file.")
    ] = False,
    robot: RobotOption = "",
) -> None:
    """Print a task as TOML, complete; also the one that a trajectory file was solved from.

    With --torques it prints what the motion of a trajectory file asks of its joints instead, by inverse dynamics.

    Example: multimodal-to show take-off > my_task.toml
    """
    if torques:
        _show_torques(Path(name), robot)
        return
    trajectory = Trajectory.load(name) if name.endswith(".npz") else None
    if trajectory is None:
        asked = chosen(name, settings, robot=robot)
        whose = robot if robot in bundled_robots() or not robot else str(Path(robot).absolute())
        print_toml(to_toml(replace(asked, robot=whose or asked.robot)))
        return
    scenario = stored(trajectory)
    if scenario is None:
        raise ScenarioError(f"'{name}' keeps no scenario")
    if unusual := trajectory.unusual_formulation():
        out.print(f"# the problem had {unusual}; a scenario does not hold these", soft_wrap=True)
    print_toml(to_toml(change(scenario, settings or ())))


def _show_torques(file: Path, robot: str) -> None:
    """Print the largest torque of every joint, the nearest to its effort limit first."""
    if file.suffix != ".npz":
        raise InputError(f"--torques goes with a trajectory file; '{file}' is no .npz")
    found = largest_torques(*loaded(file, robot))
    units = {one.unit for one in found}
    head = f" [{units.pop()}]" if len(units) == 1 else ""  # one unit stands in the head, several with each number
    titles = (f"largest torque{head}", "at [s]", f"effort{head}", "share")
    table = Table("joint", *(Column(title, justify="right") for title in titles), box=None, pad_edge=False)
    for one in found:
        unit = "" if head else f" {one.unit}"
        limited = math.isfinite(one.effort)
        limit, share = (f"{one.effort:g}{unit}", f"{100 * one.over_effort:.0f} %") if limited else ("none", "")
        table.add_row(one.joint, f"{one.torque:.1f}{unit}", f"{one.when:.2f}", limit, share)
    out.print(table)


@app.command()
def doctor(
    name: ScenarioName,
    settings: Settings = None,
    robot: RobotOption = "",
    as_json: Annotated[bool, typer.Option("--json", help="Print the findings as JSON, for programs.")] = False,
) -> None:
    """Say in about a second whether a task can work at all, and what to change where it cannot.

    Exit status 2 when it is hopeless, which `solve` refuses; warnings and notes leave 0.

    Example: multimodal-to doctor take-off --set knots=20
    """
    if not name.endswith(".toml"):
        refuse_unknown(name)
    try:
        scenario = chosen(name, settings, robot=robot)
    except ScenarioError as error:  # there is no scenario to look at
        the_robot, diagnosis = load_robot(robot or DEFAULT_ROBOT), refusal("scenario", error)
    else:
        the_robot = load_robot(robot_for(scenario, robot, file=name))
        diagnosis = examine(the_robot, scenario)
    if as_json:
        findings = [asdict(finding) | {"severity": finding.severity.value} for finding in diagnosis.findings]
        data = {"task": name, "robot": the_robot.name, "hopeless": diagnosis.hopeless, "findings": findings}
        print_json(data)
    else:
        for finding in diagnosis.findings:
            out.print(f"{finding.severity.value}: {finding}", soft_wrap=True)
        verdict = "refused" if diagnosis.hopeless else "nothing found that makes it hopeless"
        counts = ", ".join(f"{severity.value}s: {len(diagnosis.of(severity))}" for severity in Severity)
        out.print(f"{name}: {verdict} ({counts})", soft_wrap=True)
    raise typer.Exit(2 if diagnosis.hopeless else 0)


def _refuse_hopeless(diagnosis: Diagnosis, console: Console, force: bool) -> None:
    """Print warnings, and errors to standard error; leave with exit status 2 after errors unless forced to go on."""
    errors = diagnosis.of(Severity.ERROR)
    for finding in errors:
        say("error", "bold red", str(finding))
    for finding in diagnosis.of(Severity.WARNING):
        console.print(f"warning: {finding}", soft_wrap=True)
    if errors and not force:
        raise typer.Exit(2)


@app.command()
def solve(
    name: OptionalName = None,
    settings: Settings = None,
    output: Annotated[
        Path | None, typer.Option("--output", "-o", help="Folder for the results; made if missing. [results/NAME]")
    ] = None,
    robot: Annotated[
        str,
        typer.Option(
            "--robot",
            help="Bundled robot by name, or a robot's folder. [the task's, or ironcub]",
            autocompletion=completion.robots_or_folders,
        ),
    ] = "",
    max_iterations: Annotated[
        int, typer.Option(parser=whole_number_option, metavar="INTEGER", help="Most iterations.")
    ] = 1000,
    time_limit: Annotated[
        float, typer.Option(parser=number_option, metavar="FLOAT", help="Most seconds in the solver.")
    ] = 3600.0,
    linear_solver: Annotated[
        str,
        typer.Option(
            help=f"{LINEAR_SOLVERS[0]}, {LINEAR_SOLVERS[1]}, pardiso, or one of HSL such as ma57.",
            autocompletion=completion.linear_solvers,
        ),
    ] = AUTO,
    paper: Annotated[bool, typer.Option("--paper", help="Solve the paper's own problem.")] = False,
    warm_start: Annotated[Path | None, typer.Option(help="Trajectory of a similar task to start from.")] = None,
    force: Annotated[bool, typer.Option("--force", help="Try a task that the doctor calls hopeless.")] = False,
    resume: Annotated[Path | None, typer.Option(help="Checkpoint or trajectory to go on from.")] = None,
    checkpoint: Annotated[
        bool, typer.Option(help="Keep the best iterate in checkpoint.npz while the solve runs.")
    ] = True,
    explain: Annotated[bool, typer.Option("--explain", help="Without an answer: which rows give way.")] = False,
    no_pictures: Annotated[bool, typer.Option("--no-pictures", help="Write no plot and no replay page.")] = False,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="Print nothing but errors.")] = False,
) -> None:
    """Solve a task; write the trajectory, its plot and its replay page.

    The doctor looks at it first: a hopeless task is refused with exit status 2, and nothing is written. Ctrl-C ends the
    solve with its best iterate, twice at once.

    Example: multimodal-to solve take-off --set final_com_height=0.8 --set weights.thrust=3 --output results/higher

    Example: multimodal-to solve --resume results/take-off/checkpoint.npz
    """
    task = given(name, settings, robot, paper=paper, warm_start=warm_start, resume=resume, quiet=quiet)
    scenario = task.scenario
    solver = Ipopt(max_iterations=max_iterations, time_limit=time_limit, linear_solver=linear_solver)
    chosen_solver = choose(linear_solver)  # before anything takes time
    console = Console(highlight=False, markup=False, emoji=False, quiet=quiet)
    the_robot = load_robot(task.robot)
    if resume is not None and task.start is not None:
        the_robot = under_conditions(the_robot, task.start)
    diagnosis = examine(the_robot, scenario, task.formulation, initial=task.initial)
    _refuse_hopeless(diagnosis, console, force)
    folder = writable(output or (Path("results") / scenario.name if resume is None else resume.parent))
    started = time.perf_counter()
    problem = build(the_robot, scenario, task.formulation, initial=task.initial)
    scenario = problem.scenario  # with numbers for all that is said from home or from a state
    the_robot = problem.robot  # with the jets that the scenario uses
    check_allowances(the_robot, scenario)  # so that a wrong name ends before the solve
    console.print(
        f"{scenario.title}: {the_robot.name}, {scenario.knots} knots, {problem.lower.size} variables, "
        f"{problem.row_lower.size} rows, built in {time.perf_counter() - started:.1f} s"
        f"{'' if problem.taped or missing() else ' with some functions by CasADi'}, "
        f"linear solver {chosen_solver.name}",
        soft_wrap=True,
    )
    if without := missing():
        console.print(f"warning: the solve takes longer, as {without}", soft_wrap=True)
    expectation = expect(scenario) if task.start is None and not paper else None
    if expectation is not None:
        console.print(f"{expectation}", soft_wrap=True)
    kept = free_checkpoint(folder, resume, console) if checkpoint else None
    with Progress(console, expectation) as progress:
        solution = run_solver(problem, solver, progress, start=task.start, checkpoint=kept)
    written = [solution.trajectory.save(folder / "trajectory.npz")]
    if kept is not None:
        kept.unlink(missing_ok=True)
    report = audit(the_robot, solution.trajectory, scenario)
    _summarise(console, solution, report)
    _repeat(console, solution, diagnosis)
    if explain and not solution.status.solved and not progress.interrupted:
        written += _explain(console, problem, solution, solver, folder)
    if not (no_pictures or progress.interrupted):  # who stops a solve does not want to wait for pictures
        written += _draw(the_robot, solution.trajectory, folder)
    for path in written:
        console.print(f"wrote {path}", soft_wrap=True)
    if not solution.status.solved:
        raise typer.Exit(1)


def _repeat(console: Console, solution: Solution, diagnosis: Diagnosis) -> None:
    """Say again what the doctor said, where there is no answer."""
    if not solution.status.solved and solution.status is not Status.STOPPED:
        for finding in diagnosis.of(Severity.ERROR) + diagnosis.of(Severity.WARNING):
            console.print(f"the doctor said: {finding}", soft_wrap=True)


def _explain(console: Console, problem: Problem, solution: Solution, solver: Ipopt, folder: Path) -> list[Path]:
    """Say what has to give way, or that nothing has to; then keep the motion that shows it, and return its path.

    Args:
        console: that it is said on.
        problem: without an answer.
        solution: where its solve ended.
        solver: whose limits hold.
        folder: of the results.
    """
    found = relax(problem, solution.trajectory, solver, physics=1.0)
    if not found.status.solved or found.gives_way:  # some row has to: then what is asked before physics
        asked = relax(problem, solution.trajectory, solver)
        found = asked if asked.status.solved or not found.status.solved else found
    spent = f"{found.iterations} iterations in {found.solve_time:.1f} s"
    if not found.status.solved:
        console.print(f"explain: found nothing for certain in {spent}: {found.status.value}", soft_wrap=True)
    for some in found.gives_way:
        console.print(f"explain: gives way: {some}", soft_wrap=True)
    if found.gives_way or not found.status.solved:
        return []
    path = found.trajectory.save(folder / "explained.npz")
    console.print(
        f"explain: nothing has to give way, all rows can be met together ({spent}): the task is feasible, and the "
        f"start guess led the solver astray; --warm-start {path} starts from a motion that meets them",
        soft_wrap=True,
    )
    return [path]


def _draw(robot: Robot, trajectory: Trajectory, folder: Path) -> list[Path]:
    """Write plot and replay page; return their paths."""
    from multimodal_to.plotting import plot_forces, save  # viewers take a second to import, other commands need none
    from multimodal_to.replay import write_html

    forces = save(plot_forces(robot, trajectory), folder / "forces.png")
    return [forces, write_html(robot, trajectory, folder / "replay.html")]


def _summarise(console: Console, solution: Solution, report: Audit) -> None:
    name, violation, unit = solution.largest_violation
    console.print(
        f"{solution.status.value}: {solution.status.advice}\n"
        f"{solution.iterations} iterations in {solution.solve_time:.1f} s, objective {solution.objective:.6g}, largest "
        f"violation {violation:.1e} {unit} ({name})\n{described(report)}",
        soft_wrap=True,
    )
    if not solution.status.solved:
        feasible = "feasible" if solution.feasible else "not feasible"
        console.print(f"the trajectory is the best iterate, of iteration {solution.iteration}: {feasible}")
        for some in solution.unmet[:_VIOLATIONS_SHOWN]:
            console.print(f"not met: {some}", soft_wrap=True)
    failed = [finding for finding in report.findings if not finding.holds]
    for finding in failed:
        console.print(
            f"audit: {finding.name} is {apart(finding.worst, finding.limit)} {finding.unit} at knot {finding.knot} "
            f"{finding.body}, more than {finding.limit:g}",
            soft_wrap=True,
        )
    if not failed:
        console.print(f"audit: all {len(report.findings)} properties hold")


@app.command("reproduce")
def reproduce_scenarios(
    names: Annotated[
        list[str] | None, typer.Argument(help="Bundled scenarios; without, all.", autocompletion=completion.scenarios)
    ] = None,
    output: Annotated[Path, typer.Option("--output", "-o", help="Folder for the results; made if missing.")] = Path(
        "results"
    ),
    published: Annotated[
        Path | None, typer.Option(help="Folder of the paper's trajectories as bare arrays, to audit beside.")
    ] = None,
) -> None:
    """Solve the bundled scenarios again and tabulate the answers beside the paper's figures.

    Each is solved as a plan that the robot carries out and, into a folder NAME-paper, as the paper's own problem.
    Trajectory, figures and report go to the folders; the tables go to table.md. Exit status 0 only when every solve has
    an answer, and those of the first kind pass the audit.

    Example: multimodal-to reproduce take-off jump --output results
    """
    asked = names or SCENARIOS
    tasks = [(find(name), Formulation.executable(), writable(output / name)) for name in asked]
    tasks += [(as_in_paper(name), Formulation.paper(), writable(output / f"{name}-paper")) for name in asked]
    robot = load_robot(DEFAULT_ROBOT)

    from multimodal_to.files.writing import write_text
    from multimodal_to.reporting.comparison import AUDITS, SOLVES, markdown, table
    from multimodal_to.reporting.reproduce import read_published, reproduce, write_run

    files = [] if published is None else read_published(robot, published)
    runs = []
    for scenario, formulation, folder in tasks:
        out.print(f"{folder.name}: {scenario.title}")
        known = expect(scenario) if formulation.rule == LEAPFROG else None
        with Progress(out, known) as progress:
            run = reproduce(robot, scenario, progress=progress, formulation=formulation)
        write_run(run, folder)
        runs.append(run)
        out.print(f"wrote {folder}", soft_wrap=True)
        if progress.interrupted:
            break
    for columns in (SOLVES, AUDITS):
        results = table([*runs, *files], columns)
        others = [Column(title, overflow="fold") for title in results.titles[1:]]
        drawn = Table(Column(no_wrap=True), *others, box=None, pad_edge=False)
        for cells in results.rows:
            drawn.add_row(*cells)
        out.print(drawn)
    out.print(f"wrote {write_text(output / 'table.md', markdown([*runs, *files]))}", soft_wrap=True)
    if len(runs) < len(tasks) or not all(run.holds if run.executable else run.solved for run in runs):
        raise typer.Exit(1)

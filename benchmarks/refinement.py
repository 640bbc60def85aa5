"""Of which order the integration rules are: errors against an accurate integrator on Δt, Δt/2 and Δt/4.

    python benchmarks/refinement.py [SCENARIO | TRAJECTORY.npz | free-flight ...] [--rule backward-euler leapfrog]
                                    [--into docs/mathematics.md]
    python benchmarks/refinement.py --solve [SCENARIO ...] [--rule paper executable] [--parts 1 2 4]

The first command takes the controls of one motion as functions of time: contact forces and throttles, constant over the
time in which each acts, and the way of the joints and contact points, by a cubic spline. From up to `--starts` of its
knots each rule goes through a stretch of 2 √(L/g) in steps of Δt, Δt/2 and Δt/4. Its steps are the rows of the optimal
control problem. The errors are those at the stretch's end, the greatest over all starts. A bundled scenario is solved
first, by leapfrog; a trajectory file is taken as it is. `free-flight` is the robot in the air, without thrust, that
tumbles and moves its joints. This is the order of the rule alone, since all steps have the same controls.

The second command solves each scenario with N, 2N and 4N intervals, each from the answer before, and gives what the
audit finds. Answers on finer steps are other motions. So these orders say how plans get better, and scatter more. 4N
intervals of a long scenario take minutes to hours.

The order between two rows is log₂ of the ratio of their errors. `--into` also sets the table, with the last order of
each rule, between the marks of a page.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import casadi as cs
import numpy as np
from rich.console import Console
from rich.markup import escape
from rich.table import Table

import multimodal_to as mt
from multimodal_to import scenarios
from multimodal_to.auditing.findings import Motion
from multimodal_to.auditing.integrator import STRETCH, Controls, angles, natural_time, spline
from multimodal_to.models.robot import Robot
from multimodal_to.ocp import constraints
from multimodal_to.ocp.integration import BACKWARD_EULER, LEAPFROG, IntegrationRule, Interval
from multimodal_to.ocp.knot import Knot
from multimodal_to.ocp.parameters import Parameters
from multimodal_to.trajectory import QUANTITIES, Trajectory, rules
from multimodal_to.trajectory.derived import frame_poses
from pages import put

FORMULATIONS: dict[str, Callable[[], mt.Formulation]] = {
    "paper": mt.Formulation.paper,
    "executable": mt.Formulation.executable,
}
"""What `--solve` can solve, by name."""
RULES: dict[str, IntegrationRule] = {"backward-euler": BACKWARD_EULER, "leapfrog": LEAPFROG}
FREE_FLIGHT = "free-flight"
PARTS = (1, 2, 4)
ROUNDING = 1e-4  # errors below it have no order [mm, °, N]
ROWS = (
    constraints.momentum_dynamics,
    constraints.com_integration,
    constraints.base_position_integration,
    constraints.base_orientation_integration,
    constraints.angular_momentum_kinematics,
    constraints.thrust_integration,
    constraints.thrust_dynamics,
)
"""The rows of an interval that say how the state goes on; those of the CoM at its end come with them."""
UNKNOWN = (
    "com_position",
    "com_velocity",
    "angular_momentum",
    "base_quaternion_xyzw",
    "thrust",
    "thrust_rate",
    "base_position",
    "base_linear_velocity",
    "base_angular_velocity",
)
"""The variables of an interval's end that its rows determine; the first six are those of the integrator's state."""
GIVEN = ("joint_positions", "joint_velocities", "contact_positions", "contact_forces", "throttle")
"""Those that the motion prescribes."""


@dataclass(frozen=True, kw_only=True)
class Errors:
    """How far a rule is from the accurate integrator at the end of a stretch, the greatest over all starts."""

    com: float  # of the CoM [m]
    base: float  # of the base's attitude [rad]
    thrust: float  # of a thrust [N]


def orders(errors: list[float], parts: tuple[int, ...] = PARTS) -> list[float]:
    """Return the order between each two neighbours, log(e / e⁺) / log(parts⁺ / parts)."""
    with np.errstate(all="ignore"):
        return list(np.log(np.divide(errors[:-1], errors[1:])) / np.log(np.divide(parts[1:], parts[:-1])))


# -------------------------------------------------------------------- one motion's controls, in steps of a rule


def free_flight(robot: Robot, knots: int = 20, duration: float = 1.0) -> Trajectory:
    """Return the robot without jets in the air: it tumbles, and moves its joints up to 0.3 rad from home.

    Only what drives it is true: how it starts, and the way of its joints. The rest is zero.

    Args:
        robot: whose jets do nothing.
        knots: the number of intervals.
        duration: of the motion [s].
    """
    time = np.linspace(0.0, duration, knots + 1)
    bodies = {"robot": 1, "joint": len(robot.joint_names), "contact": len(robot.contact_names), "jet": 0}
    arrays = {name: np.zeros((quantity.rows * bodies[quantity.of], time.size)) for name, quantity in QUANTITIES.items()}
    home, phases = robot.home.joint_positions[:, None], np.arange(len(robot.joint_names))[:, None]
    arrays["joint_positions"][:] = home + 0.3 * np.sin(2 * np.pi * time + phases) - 0.3 * np.sin(phases)
    arrays["base_quaternion_xyzw"][3] = 1.0
    arrays["base_position"][:] = robot.home.base_position[:, None]
    arrays["com_velocity"][:] = [[0.5], [0.2], [2.0]]
    arrays["angular_momentum"][:] = [[3.0], [4.0], [1.5]]

    def trajectory() -> Trajectory:
        return Trajectory(
            robot=robot.name,
            scenario=FREE_FLIGHT,
            time=time,
            joint_names=robot.joint_names,
            contact_names=robot.contact_names,
            jet_names=(),
            rule=rules.BACKWARD_EULER,  # with all at the first knot, which the integrator starts from
            **arrays,
        )

    feet = [frame_poses(robot, trajectory(), name)[:, :3, 3].T for name in robot.contact_names]
    arrays["contact_positions"] = np.concatenate(feet)
    base = np.eye(4)
    base[:3, 3] = robot.home.base_position
    com = np.array(robot.kindyn.CoM_position_fun()(base, arrays["joint_positions"][:, 0]))
    arrays["com_position"][:] = com
    return trajectory()


def errors(controls: Controls, rule: IntegrationRule, parts: tuple[int, ...], starts: int = 10) -> list[Errors]:
    """Return how far a rule is off on steps of Δt, divided by each number of parts.

    Args:
        controls: of a motion with equal intervals.
        rule: that makes the steps.
        parts: into how many steps each interval of the motion is divided.
        starts: from how many knots at most a stretch begins; a free flight has one, its first knot.
    """
    plan, robot = controls.trajectory, controls.robot
    interval = plan.duration / plan.knots
    if plan.scenario == FREE_FLIGHT:
        first, intervals = np.array([0]), plan.knots
    else:
        intervals = max(1, round(STRETCH * natural_time(robot) / interval))
        first = np.unique(np.linspace(0, plan.knots - intervals, starts).round().astype(int))
    exact = controls.starts[first]
    for index in range(intervals):
        exact = controls.advanced(exact, first + index)
    jets, step, found = len(robot.jets), _step(robot, rule, first.size), []
    for count in parts:
        states = _flow(controls, rule, step, first, intervals, count)
        found.append(
            Errors(
                com=float(np.linalg.norm(states[:, :3] - exact[:, :3], axis=1).max()),
                base=float(angles(states[:, 9:13], exact[:, 9:13]).max()),
                thrust=float(np.abs(states[:, 13 : 13 + jets] - exact[:, 13 : 13 + jets]).max(initial=0.0)),
            )
        )
    return found


def _step(robot: Robot, rule: IntegrationRule, count: int) -> cs.Function:
    """Return the solution of an interval's rows for what is unknown at its end, for many intervals at once.

    It takes a guess of the unknown, then the start's variables, what is given at the end, and Δt.
    """
    sizes = {"base_quaternion_xyzw": 4, "contact_positions": 3 * len(robot.contacts)}
    sizes |= dict.fromkeys(("joint_positions", "joint_velocities"), len(robot.joint_names))
    sizes |= {"contact_forces": sizes["contact_positions"]}
    sizes |= dict.fromkeys(("thrust", "thrust_rate", "throttle"), len(robot.jets))
    start, end = (
        {name: cs.SX.sym(f"{when}_{name}", sizes.get(name, 3)) for name in (*UNKNOWN, *GIVEN)}
        for when in ("start", "end")
    )
    duration = cs.SX.sym("duration")
    interval = Interval(Knot(robot, **start), Knot(robot, **end), duration, rule)
    parameters = Parameters.of(robot, scenarios.jump(), robot.home)
    rows = [row(interval, parameters) for row in ROWS] + [constraints.com_kinematics(interval.end, parameters)]
    problem = {
        "x": cs.vertcat(*(end[name] for name in UNKNOWN)),
        "p": cs.vertcat(*start.values(), *(end[name] for name in GIVEN), duration),
        "g": cs.vertcat(*rows),
    }
    return cs.rootfinder("step", "newton", problem, {"abstol": 1e-11, "error_on_fail": True}).map(count)


def _flow(
    controls: Controls, rule: IntegrationRule, step: cs.Function, first: np.ndarray, intervals: int, parts: int
) -> np.ndarray:
    """Return the states that a rule's steps lead to at their last instants, (starts, 13 + 2 jets)."""
    plan, robot = controls.trajectory, controls.robot
    dt = plan.duration / plan.knots / parts
    times = plan.time[first][:, None] + dt * np.arange(intervals * parts + 1)
    flat = np.clip(times.ravel(), plan.time[0], plan.time[-1])
    points = Motion.of(robot, plan).points.transpose(1, 0, 2).reshape(plan.time.size, -1)
    joints = spline(plan.time, plan.joint_positions.T, flat)[0].reshape(*times.shape, -1)
    contacts = spline(plan.time, points, flat)[0].reshape(*times.shape, -1)

    def given(index: int) -> np.ndarray:
        before = joints[:, index - 1] if index else joints[:, 0]
        parts_given = [joints[:, index], (joints[:, index] - before) / dt, contacts[:, index]]
        return np.hstack([*parts_given, acting(plan.contact_forces, index), acting(plan.throttle, index)])

    def acting(values: np.ndarray, index: int) -> np.ndarray:
        """Return what acts just before an instant; by leapfrog, whose steps have it in the middle, also just after."""
        share = index / parts - rules.acts_after(plan.rule)
        until = values[:, first + int(np.ceil(share))].T
        since = values[:, np.minimum(first + int(np.floor(share)) + 1, plan.knots)].T
        return 0.5 * (until + since) if rules.acts_after(rule.name) else until

    jets, start = len(robot.jets), controls.starts[first]
    shares = np.zeros(start.shape[1])
    shares[3:9], shares[13 + jets :] = (rules.instant(rule.name, name) for name in ("com_velocity", "thrust_rate"))
    state = start
    for _ in range(20):  # velocities before the first knot, from which `Controls.starts` leads to those of the knot
        state = start - shares * dt * controls.slope(state, 2 * controls.steps * first, first)
    bases = np.zeros((first.size, 9))
    bases[:, :3] = plan.base_position[:, first].T
    unknown = np.hstack([state, bases])
    for index in range(1, intervals * parts + 1):
        known = np.hstack([unknown, given(index - 1), given(index), np.full((first.size, 1), dt)])
        unknown = np.array(step(x0=unknown.T, p=known.T)["x"]).T
    return unknown[:, : state.shape[1]]


def controls_of(name: str) -> Controls:
    """Return the controls of a bundled scenario, solved by leapfrog, of a file, or of the free flight."""
    if name == FREE_FLIGHT:
        robot = mt.load_robot("ironcub").with_jets(())
        plan = free_flight(robot)
    elif name.endswith(".npz"):
        plan = Trajectory.load(name)
        robot = mt.load_robot(plan.robot).with_jets(plan.jet_names)
    else:
        problem = mt.build(mt.load_robot("ironcub"), scenarios.find(name), mt.Formulation.executable())
        plan, robot = mt.solve(problem).trajectory, problem.robot
    return Controls.of(Motion.of(robot, plan), steps=16)


@dataclass(frozen=True, kw_only=True)
class Study:
    """The errors of a rule on the controls of a motion, one for each step."""

    rule: str
    steps: tuple[float, ...]  # [s]
    parts: tuple[int, ...]  # into how many of them an interval is divided
    errors: tuple[Errors, ...]

    @property
    def columns(self) -> dict[str, list[float]]:
        """Return the errors of CoM [mm], base [°] and thrust [N], by head of their columns."""
        return {
            "CoM [mm]": [1e3 * entry.com for entry in self.errors],
            "base [°]": [float(np.degrees(entry.base)) for entry in self.errors],
            "thrust [N]": [entry.thrust for entry in self.errors],
        }


def study(controls: Controls, chosen: list[str], parts: tuple[int, ...], starts: int) -> list[Study]:
    """Return the errors of rules on a motion's controls."""
    interval = controls.trajectory.duration / controls.trajectory.knots
    steps = tuple(interval / count for count in parts)
    return [
        Study(rule=rule, steps=steps, parts=parts, errors=tuple(errors(controls, RULES[rule], parts, starts)))
        for rule in chosen
    ]


def controls_table(found: dict[str, list[Study]]) -> Table:
    """Return the errors of each motion, rule and step as a table."""
    table = Table(*map(escape, ("motion", "rule", "step [ms]", "CoM [mm]", "base [°]", "thrust [N]")))
    for name, studies in found.items():
        for entry in studies:
            rows = with_orders(list(entry.columns.values()), entry.parts)
            for step, row in zip(entry.steps, rows, strict=True):
                table.add_row(name, entry.rule, f"{1e3 * step:.3g}", *row)
    return table


def markdown(found: dict[str, list[Study]]) -> str:
    """Return the errors as a table of a page, one row for each motion and rule, with the order of its last steps."""
    lines = ["| motion | rule | steps [ms] | CoM [mm] | base [°] | thrust [N] |", "|--|--|--|--|--|--|"]
    for name, studies in found.items():
        for entry in studies:
            cells = [name, RULES[entry.rule].name, ", ".join(f"{1e3 * step:.3g}" for step in entry.steps)]
            for column in entry.columns.values():
                if max(column) <= ROUNDING:
                    cells.append("exact" if max(column) > 0.0 else "–")
                else:
                    shown = ", ".join(f"{value:.3g}" if value > ROUNDING else "exact" for value in column)
                    told = min(column[-2:]) > ROUNDING
                    cells.append(f"{shown}; order {orders(column, entry.parts)[-1]:.1f}" if told else shown)
            lines.append(f"| {' | '.join(cells)} |")
    return "\n".join(lines)


# -------------------------------------------------------------------- plans on finer and finer steps


def solved(name: str, formulation: str, parts: tuple[int, ...]) -> list[tuple[mt.Solution, mt.Audit]]:
    """Return the answers of a scenario with its intervals divided, each started from the one before, with audits."""
    scenario, found = scenarios.find(name), list[tuple[mt.Solution, mt.Audit]]()
    for count in parts:
        finer = replace(
            scenario,
            knots=count * scenario.knots,
            interval_min=scenario.interval_min / count,
            interval_max=scenario.interval_max / count,
        )
        problem = mt.build(mt.load_robot("ironcub"), finer, FORMULATIONS[formulation]())
        solution = mt.solve(problem, start=found[-1][0].trajectory if found else None)
        found.append((solution, mt.audit(problem.robot, solution.trajectory)))
    return found


FOUND = {
    "CoM off integrator, stretch": ("CoM [mm]", 1e3),
    "base off integrator, stretch": ("base [°]", 180.0 / np.pi),
    "CoM off integrator, horizon": ("CoM, horizon [mm]", 1e3),
    "thrust off CVODES, horizon": ("thrust, horizon [N]", 1.0),
}
"""Which properties of the audit `--solve` shows, by which head, and in which unit."""


def solve_study(names: list[str], chosen: list[str], parts: tuple[int, ...]) -> Table:
    """Return what the audit finds in answers on finer and finer steps; a motion's starts are all its knots."""
    heads = [escape(head) for head, _ in FOUND.values()]
    table = Table("scenario", "formulation", "intervals", "status", "iterations", *heads)
    for name in names:
        for formulation in chosen:
            found = solved(name, formulation, parts)
            shown = [entry for entry in FOUND if any(finding.name == entry for finding in found[0][1].findings)]
            columns = [[FOUND[entry][1] * report[entry].worst for _, report in found] for entry in shown]
            for (solution, _), row in zip(found, with_orders(columns, parts), strict=True):
                state = (solution.status.value, str(solution.iterations))
                table.add_row(name, formulation, str(solution.trajectory.knots), *state, *row)
    return table


# -------------------------------------------------------------------- tables


def with_orders(columns: list[list[float]], parts: tuple[int, ...]) -> list[list[str]]:
    """Return rows of a table: each error with the order since the row before."""
    texts = []
    for column in columns:
        told = min(column) > ROUNDING
        slopes = ["", *(f" ({order:.1f})" if told else "" for order in orders(column, parts))]
        texts.append([f"{value:.3g}{slope}" for value, slope in zip(column, slopes, strict=True)])
    return [list(row) for row in zip(*texts, strict=True)]


def main() -> None:
    """Run a study and print its table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("motions", nargs="*", help="scenarios, trajectory files, or free-flight; default: all of them")
    parser.add_argument("--rule", nargs="+", help=f"of {', '.join(RULES)}; with --solve of {', '.join(FORMULATIONS)}")
    parser.add_argument("--solve", action="store_true", help="solve each scenario on each step")
    parser.add_argument("--parts", nargs="+", type=int, default=PARTS, help="into which intervals are divided")
    parser.add_argument("--starts", type=int, default=10, help="of stretches in a motion")
    parser.add_argument("--into", type=Path, metavar="PAGE", help="also set the table between the marks of a page")
    options = parser.parse_args()
    names, parts = options.motions or list(scenarios.SCENARIOS), tuple(options.parts)
    if not options.motions and not options.solve:
        names.insert(0, FREE_FLIGHT)
    known = FORMULATIONS if options.solve else RULES
    chosen = options.rule or list(known)
    if unknown := [rule for rule in chosen if rule not in known]:
        parser.error(f"no rule {unknown[0]}; expected {', '.join(known)}")
    if options.solve:
        Console().print(solve_study(names, chosen, parts))
        return
    found = {name: study(controls_of(name), chosen, parts, options.starts) for name in names}
    Console().print(controls_table(found))
    if options.into:
        put(options.into, "refinement", markdown(found))


if __name__ == "__main__":
    main()

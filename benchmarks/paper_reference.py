"""The paper's own transcription, as a reference: one graph over the horizon, solved by a quasi-Newton IPOPT.

    python benchmarks/paper_reference.py take-off jump walk-to-fly [--short] [--verbose] [--save FOLDER] [--json]

L'Erario et al., Humanoids 2022, section IV, with every quantity of its list a decision variable, the equations written
knot by knot into one `casadi.Opti`, and all else left to CasADi (`expand`) and IPOPT (limited-memory Hessian). Options,
scales and weights are those of the paper's code; only the linear solver is MUMPS instead of MA97. Rigid-body quantities
come from `multimodal_to.adam`, so this can only be faster than the original. `--short` stops after SHORT iterations.

Kept as published, because they shape the problem that is timed:

* the force of knot k multiplies the motion from k to k + 1 (eq. 21), though backward Euler applies that of k + 1, so
  that feet may slide under load;
* forces, velocities and throttles of the first knot are bounded but enter no dynamics;
* the start is met within 1e-3 and nothing holds the quaternion's norm; the end has an exact CoM and an upright base,
  and its rest is a cost;
* all bounds are rows, as `Opti` makes them unless told otherwise.

Not kept: charging the left hip pitch twice, and solving again with other options after a failure. The running cost is
charged at the ends of the intervals, where the rates act; the text's knots 0 to N − 1 would leave the last forces free.
Slacks are charged without Δt: with it the take-off leaves a force × height of 0.26 N m, the published one has 0.011.
Thrust ends at 160 N and 220 N, and heights are 0.70 m and 0.75 m, where the text and the code differ.

The take-off so restated ends like the published one (7.0 s, 1.1 s of it in flight, a force × height of 0.0105 N m), but
at the limit of 4000 iterations: IPOPT's scaled dual infeasibility stays above `acceptable_tol`, where the original
stopped after 2976. The jump stops as acceptable after 3508 iterations (the original: 1022), 0.3 s of it in flight,
with a slip under load of 0.26 m. So compare times per iteration before whole times.
"""

from __future__ import annotations

import argparse
import json
import multiprocessing
import resource
import time
from collections.abc import Mapping
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import casadi as cs
import numpy as np
from rich.console import Console
from rich.markup import escape
from rich.table import Column, Table

from multimodal_to import Robot, Trajectory, load_robot
from multimodal_to.adam import quaternion
from multimodal_to.trajectory import QUANTITIES, Quantity
from multimodal_to.trajectory.quantities import SCALAR

SHORT = 20  # iterations of --short
NEAR = 1e-3  # how exactly the start is met, and the base upright at the end
UPRIGHT = cs.DM([0, 0, 0, 1])
CONTACT_REACH = cs.DM([0.3, 0.3, 0.6])  # from the CoM [m]
JET_REACH = 0.5  # from the CoM [m]
VARIABLES = {
    **QUANTITIES,
    "complementarity_slack": Quantity(
        axes=SCALAR, of="contact", unit="N m", meaning="ε_n, bound of height × normal force"
    ),
    "sliding_slack": Quantity(axes=SCALAR, of="contact", unit="N m", meaning="ε_t, bound of slip × normal force"),
}
"""The decision variables of a knot: all quantities of a trajectory, and the slacks."""

SCALES = {
    "joint_positions": 2.0,
    "joint_velocities": 7.0,
    "contact_forces": 50.0,
    "contact_force_rates": 50.0,
    "thrust": 100.0,
}
IPOPT = {
    "linear_solver": "mumps",
    "hessian_approximation": "limited-memory",
    "tol": 1e-3,
    "dual_inf_tol": 1000.0,
    "compl_inf_tol": 1e-2,
    "constr_viol_tol": 1e-4,
    "acceptable_tol": 1.0,
    "acceptable_iter": 2,
    "acceptable_compl_inf_tol": 1.0,
    "alpha_for_y": "dual-and-full",
    "max_iter": 4000,
    "warm_start_init_point": "yes",
    "warm_start_bound_push": 1e-2,
    "warm_start_bound_frac": 1e-2,
    "warm_start_slack_bound_push": 1e-2,
    "warm_start_slack_bound_frac": 1e-2,
    "warm_start_mult_bound_push": 1e-2,
    "required_infeasibility_reduction": 0.8,
    "perturb_dec_fact": 0.1,
    "max_hessian_perturbation": 100.0,
    "fast_step_computation": "yes",
    "nlp_scaling_max_gradient": 100.0,
    "nlp_scaling_min_value": 1e-6,
}


@dataclass(frozen=True, kw_only=True)
class Case:
    """A scenario of the paper; weights multiply squared 2-norms and Δt, `slack_weight` the slacks themselves."""

    knots: int
    final_com: tuple[float, float, float]
    weights: Mapping[str, float]
    upper_body_weight: float
    legs_weight: float
    posture_weight: float
    initial_posture_weight: float
    final_posture_weight: float = 0.0
    base_orientation_weight: float = 0.0
    slack_weight: float
    slack_max: float = 1.0  # [N m]
    mid_height: float | None = None  # [m]
    jets: bool = True
    axes_of_speed: int = 3  # how many axes of the CoM's velocity the running cost has
    initial_com: tuple[float, float, float] = (0.0, 0.0, 0.57)


FLYING = {"com_acceleration": 1e5, "com_velocity": 1e7, "angular_momentum_rate": 1e4, "angular_momentum": 1e4}
FINAL_WEIGHTS = dict.fromkeys(FLYING, 1e6)
CASES = {
    "take-off": Case(
        knots=70,
        final_com=(0.0, 0.0, 0.70),
        weights=FLYING | {"contact_force_rates": 1.0, "contact_forces": 5e1, "throttle": 1e-1},
        upper_body_weight=5e5,
        legs_weight=1e4,
        posture_weight=1e6,
        initial_posture_weight=1e6,
        slack_weight=1e5,
    ),
    "walk-to-fly": Case(
        knots=100,
        final_com=(-0.9, 0.0, 0.70),
        weights=FLYING | {"contact_forces": 1.0, "thrust": 2e3},
        upper_body_weight=5e5,
        legs_weight=1e5,
        posture_weight=1e7,
        initial_posture_weight=1e6,
        base_orientation_weight=1e7,
        slack_weight=1e7,
    ),
    "jump": Case(
        knots=60,
        final_com=(0.0, 0.0, 0.57),
        mid_height=0.75,
        jets=False,
        weights=dict.fromkeys(FLYING, 1.0) | {"contact_force_rates": 1e-1, "contact_forces": 1.0},
        upper_body_weight=1e4,
        legs_weight=1e4,
        posture_weight=2e1,
        initial_posture_weight=1e5,
        final_posture_weight=1e5,
        axes_of_speed=2,
        slack_weight=5e4,
        slack_max=1e-3,
    ),
}


class Transcription:
    """The problem of a case as one `Opti`; `variables` holds every quantity by name, (dim, knots + 1), in SI units."""

    def __init__(self, case: Case) -> None:
        robot = load_robot("ironcub")
        self.case, self.robot, self.opti = case, robot if case.jets else robot.with_jets([]), cs.Opti()
        self.duration = self.opti.variable()
        self.dt = self.duration / case.knots
        self.variables = self._variables()
        self._boundary()
        for k in range(case.knots + 1):
            knot = self.at(k)
            self._bounds(knot)
            self._kinematics(knot)
            if k > 0:
                self._dynamics(knot)
                self._integration(self.at(k - 1), knot)
            if k < case.knots:
                self._sliding(knot, self.at(k + 1))
        self.opti.minimize(self._cost())

    def at(self, k: int) -> dict[str, cs.MX]:
        """Return the variables of a knot."""
        return {name: value[:, k] for name, value in self.variables.items()}

    def _variables(self) -> dict[str, cs.MX]:
        """Declare all quantities and set their start guess: standing, along a straight line of the CoM."""
        case, robot, home, count = self.case, self.robot, self.robot.home, self.case.knots + 1
        sizes = {"robot": 1, "joint": len(robot.joint_names), "contact": len(robot.contacts), "jet": len(robot.jets)}
        start, end = np.array(case.initial_com), np.array(case.final_com)
        travelled = np.outer(end - start, np.linspace(0, 1, count))
        pose = transform(cs.DM(home.base_quaternion_xyzw), cs.DM(home.base_position))
        points = [robot.kindyn.forward_kinematics(name, pose, home.joint_positions) for name in robot.contact_names]
        along_ground = np.tile(travelled * [[1], [1], [0]], (len(points), 1))
        guess = {
            "com_position": start[:, None] + travelled,
            "base_position": home.base_position[:, None],
            "base_quaternion_xyzw": home.base_quaternion_xyzw[:, None],
            "joint_positions": home.joint_positions[:, None],
            "contact_positions": np.vstack([np.array(point)[:3, 3:] for point in points]) + along_ground,
            "thrust": 30.0,
        }
        variables = {}
        for name, quantity in VARIABLES.items():
            rows, scale = quantity.rows * sizes[quantity.of], SCALES.get(name, 1.0)
            if rows:
                value = np.broadcast_to(guess.get(name, 0.0), (rows, count))
                variable = self.opti.variable(rows, count)
                self.opti.set_initial(variable, value / scale)
                variables[name] = scale * variable
            else:
                variables[name] = cs.MX(0, count)
        self.opti.set_initial(self.duration, 0.075 * case.knots)
        return variables

    def _boundary(self) -> None:
        """Start and end (eq. 30, 31), the least height at mid-horizon, and the duration."""
        opti, case, first, last = self.opti, self.case, self.at(0), self.at(self.case.knots)
        opti.subject_to(opti.bounded(0.05 * case.knots, self.duration, 0.1 * case.knots))
        opti.subject_to(first["com_position"] == cs.DM(case.initial_com))
        opti.subject_to(last["com_position"] == cs.DM(case.final_com))
        at_rest = ("com_velocity", "com_acceleration", "angular_momentum", "angular_momentum_rate")
        for name in (*at_rest, "thrust", "thrust_rate"):
            self._within(first[name], 0.0)
        self._within(first["base_quaternion_xyzw"], cs.DM(self.robot.home.base_quaternion_xyzw))
        self._within(first["contact_positions"][2::3], 0.0)
        self._within(last["base_quaternion_xyzw"], UPRIGHT)
        if case.mid_height is not None:
            opti.subject_to(self.at(case.knots // 2)["com_position"][2] >= case.mid_height)

    def _within(self, value: cs.MX, target: cs.DM | float) -> None:
        if value.numel():
            self.opti.subject_to(self.opti.bounded(target - NEAR, value, target + NEAR))

    def _bounds(self, knot: dict[str, cs.MX]) -> None:
        """Box constraints (eq. 28, 29), friction (eq. 19) and the slacks' bounds."""
        opti, limits, jets = self.opti, self.robot.joint_limits, self.robot.jets
        opti.subject_to(opti.bounded(limits.lower, knot["joint_positions"], limits.upper))
        opti.subject_to(opti.bounded(-limits.speed, knot["joint_velocities"], limits.speed))
        opti.subject_to(opti.bounded(-1.5, knot["com_position"][:2], 1.5))
        for name in ("base_linear_velocity", "base_angular_velocity"):
            opti.subject_to(opti.bounded(-2, knot[name], 2))
        for name in ("complementarity_slack", "sliding_slack"):
            opti.subject_to(opti.bounded(0, knot[name], self.case.slack_max))
        for force in cs.vertsplit(knot["contact_forces"], 3):
            reach = self.robot.friction * force[2]
            opti.subject_to(force[2] >= 0)
            for axis in (0, 1):
                opti.subject_to(force[axis] <= reach)
                opti.subject_to(force[axis] >= -reach)
        for index, jet in enumerate(jets):
            opti.subject_to(opti.bounded(0, knot["thrust"][index], jet.thrust_max))
            opti.subject_to(opti.bounded(jet.throttle_min, knot["throttle"][index], jet.throttle_max))

    def _kinematics(self, knot: dict[str, cs.MX]) -> None:
        """CoM (eq. 15), contact points (eq. 17), non-penetration (eq. 18), complementarity (eq. 20) and reach."""
        opti, kindyn = self.opti, self.robot.kindyn
        pose, joints, com = base_pose(knot), knot["joint_positions"], knot["com_position"]
        opti.subject_to(com == kindyn.CoM_position(pose, joints))
        for index, name in enumerate(self.robot.contact_names):
            point = knot["contact_positions"][3 * index : 3 * index + 3]
            opti.subject_to(point == kindyn.forward_kinematics(name, pose, joints)[:3, 3])
            opti.subject_to(point[2] >= 0)
            opti.subject_to(opti.bounded(-CONTACT_REACH, point - com, CONTACT_REACH))
            product = point[2] * knot["contact_forces"][3 * index + 2]
            opti.subject_to(product <= knot["complementarity_slack"][index])
        for jet in self.robot.jets:
            arm = kindyn.forward_kinematics(jet.frame, pose, joints)[:3, 3] - com
            opti.subject_to(opti.bounded(-JET_REACH, arm, JET_REACH))

    def _dynamics(self, knot: dict[str, cs.MX]) -> None:
        """Centroidal dynamics with gravity (eq. 14), centroidal momentum (eq. 16) and thrust dynamics (eq. 23)."""
        opti, robot, pose = self.opti, self.robot, base_pose(knot)
        points = cs.vertsplit(knot["contact_positions"], 3)
        forces = cs.vertsplit(knot["contact_forces"], 3)
        for index, jet in enumerate(robot.jets):
            thrust, rate, throttle = (knot[name][index] for name in ("thrust", "thrust_rate", "throttle"))
            frame = robot.kindyn.forward_kinematics(jet.frame, pose, knot["joint_positions"])
            points.append(frame[:3, 3])
            forces.append(-frame[:3, 2] * thrust)
            opti.subject_to(knot["thrust_acceleration"][index] == jet.model.acceleration(thrust, rate, throttle))
        moments = [cs.cross(point - knot["com_position"], f) for point, f in zip(points, forces, strict=True)]
        opti.subject_to(robot.mass * knot["com_acceleration"] == robot.mass * cs.DM(robot.gravity) + sum(forces))
        opti.subject_to(knot["angular_momentum_rate"] == sum(moments))
        matrix = robot.kindyn.centroidal_momentum_matrix(pose, knot["joint_positions"])
        names = ("base_linear_velocity", "base_angular_velocity", "joint_velocities")
        opti.subject_to(knot["angular_momentum"] == matrix[3:, :] @ cs.vertcat(*(knot[name] for name in names)))

    def _integration(self, start: dict[str, cs.MX], end: dict[str, cs.MX]) -> None:
        """Backward Euler (eq. 24 to 27)."""
        for name, rate in (
            ("com_position", "com_velocity"),
            ("com_velocity", "com_acceleration"),
            ("angular_momentum", "angular_momentum_rate"),
            ("base_position", "base_linear_velocity"),
            ("joint_positions", "joint_velocities"),
            ("contact_forces", "contact_force_rates"),
            ("thrust", "thrust_rate"),
            ("thrust_rate", "thrust_acceleration"),
        ):
            if start[name].numel():
                self.opti.subject_to(end[name] == start[name] + end[rate] * self.dt)
        turn = quaternion.exp(end["base_angular_velocity"] * self.dt)
        turned = quaternion.product(turn, start["base_quaternion_xyzw"])
        self.opti.subject_to(end["base_quaternion_xyzw"] == turned)

    def _sliding(self, start: dict[str, cs.MX], end: dict[str, cs.MX]) -> None:
        """Planar complementarity with the force of the interval's start (eq. 21)."""
        moved = end["contact_positions"] - start["contact_positions"]
        for index in range(len(self.robot.contacts)):
            slack, force = start["sliding_slack"][index], start["contact_forces"][3 * index + 2]
            for axis in (0, 1):
                product = moved[3 * index + axis] * force
                self.opti.subject_to(product <= slack)
                self.opti.subject_to(product >= -slack)

    def _cost(self) -> cs.MX:
        """Return the running and final costs (eq. 32)."""
        case, robot, values = self.case, self.robot, self.variables
        home = robot.home
        posture = values["joint_positions"] - cs.repmat(cs.DM(home.joint_positions), 1, case.knots + 1)
        turned = values["base_quaternion_xyzw"] - cs.repmat(cs.DM(home.base_quaternion_xyzw), 1, case.knots + 1)
        speed = values["joint_velocities"][:, 1:]
        running = case.posture_weight * cs.sumsqr(posture[:, 1:])
        running += case.upper_body_weight * cs.sumsqr(speed[robot.group_indices("upper_body"), :])
        running += case.legs_weight * cs.sumsqr(speed[robot.group_indices("legs"), :])
        running += case.base_orientation_weight * cs.sumsqr(turned[:, 1:])
        for name, weight in case.weights.items():
            rows = case.axes_of_speed if name == "com_velocity" else values[name].shape[0]
            running += weight * cs.sumsqr(values[name][:rows, 1:])
        slacks = cs.vertcat(values["complementarity_slack"], values["sliding_slack"])
        ends = sum(weight * cs.sumsqr(values[name][:, -1]) for name, weight in FINAL_WEIGHTS.items())
        ends += case.initial_posture_weight * cs.sumsqr(posture[:, 0])
        ends += case.final_posture_weight * cs.sumsqr(posture[:, -1])
        return ends + running * self.dt + case.slack_weight * cs.sum(cs.vec(slacks))

    def solve(self, max_iterations: int, verbose: bool) -> None:
        """Let CasADi derive what it needs and IPOPT run; the last iterate stays in `opti.debug` whatever happens."""
        options = IPOPT | {"max_iter": max_iterations, "print_level": 5 if verbose else 0, "sb": "yes"}
        self.opti.solver("ipopt", {"expand": True, "print_time": False, "record_time": True}, options)
        try:
            self.opti.solve_limited()
        except RuntimeError:  # which says only what return_status in the statistics does
            if "return_status" not in self.opti.stats():
                raise

    def violation(self) -> float:
        """Return by how much the worst row of the last iterate is violated, in the rows' mixed SI units."""
        opti = self.opti
        rows, low, high = (np.array(opti.debug.value(value)).ravel() for value in (opti.g, opti.lbg, opti.ubg))
        return float(np.maximum(low - rows, rows - high).max(initial=0.0))

    def trajectory(self, name: str) -> Trajectory:
        """Return the last iterate, to save and audit."""
        known = {name: self.variables[name] for name in QUANTITIES}
        values = {key: np.reshape(self.opti.debug.value(value), value.shape) for key, value in known.items()}
        robot: Robot = self.robot
        return Trajectory(
            robot=robot.name,
            scenario=name,
            joint_names=robot.joint_names,
            contact_names=robot.contact_names,
            jet_names=robot.jet_names,
            time=np.linspace(0.0, float(self.opti.debug.value(self.duration)), self.case.knots + 1),
            **values,
        )


def transform(rotation: cs.MX, position: cs.MX) -> cs.MX:
    """Return the pose (4, 4) of a quaternion and a position."""
    return cs.vertcat(cs.horzcat(quaternion.rotation_matrix(rotation), position), cs.DM([[0, 0, 0, 1]]))


def base_pose(knot: dict[str, cs.MX]) -> cs.MX:
    """Return w_H_base of a knot, (4, 4)."""
    return transform(knot["base_quaternion_xyzw"], knot["base_position"])


def run(name: str, short: bool, verbose: bool, folder: Path | None) -> dict[str, float | str]:
    """Build and solve a case in this process and return its figures.

    CasADi makes IPOPT's functions when `Opti` is asked to solve: what that takes beside IPOPT's own time is building.
    """
    started = time.perf_counter()
    problem = Transcription(CASES[name])
    problem.solve(SHORT if short else IPOPT["max_iter"], verbose)
    whole = time.perf_counter() - started
    statistics = problem.opti.stats()
    iterations, solver = statistics["iter_count"], statistics["t_wall_total"]
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3
    if folder is not None:
        problem.trajectory(name).save(folder / f"{name}.npz")
    return {
        "scenario": name,
        "status": statistics["return_status"],
        "variables": problem.opti.nx,
        "rows": problem.opti.ng,
        "build [s]": whole - solver,
        "iterations": iterations,
        "solver [s]": solver,
        "solver per iteration [s]": solver / max(iterations, 1),
        "whole [s]": whole,
        "peak memory [MB]": peak,
        "objective": float(problem.opti.debug.value(problem.opti.f)),
        "largest violation": problem.violation(),
    }


def main() -> None:
    """Run each case in a process of its own, so that the peak memory is its own, and print the figures."""
    parser = argparse.ArgumentParser(description="Time the paper's own transcription.")
    parser.add_argument("scenario", nargs="+", choices=sorted(CASES))
    parser.add_argument("--short", action="store_true", help=f"stop after {SHORT} iterations")
    parser.add_argument("--verbose", action="store_true", help="show IPOPT's iterations")
    parser.add_argument("--save", type=Path, metavar="FOLDER", help="write each last iterate to FOLDER/SCENARIO.npz")
    parser.add_argument("--json", action="store_true", help="print JSON instead of a table")
    chosen = parser.parse_args()
    if chosen.save:
        chosen.save.mkdir(parents=True, exist_ok=True)
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(max_workers=1, mp_context=context, max_tasks_per_child=1) as pool:
        jobs = [pool.submit(run, name, chosen.short, chosen.verbose, chosen.save) for name in chosen.scenario]
        results = [job.result() for job in jobs]
    if chosen.json:
        print(json.dumps(results, indent=2))
        return
    table = Table("", *(Column(str(result["scenario"]), overflow="fold") for result in results))
    for key in list(results[0])[1:]:
        cells = [f"{value:.6g}" if isinstance(value := result[key], float) else str(value) for result in results]
        table.add_row(escape(key), *cells)
    Console().print(table)


if __name__ == "__main__":
    main()

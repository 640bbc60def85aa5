"""The rows that keep links apart: what they are, what they depend on, and that a solver obeys them."""

from __future__ import annotations

from dataclasses import replace

import casadi as cs
import numpy as np
import pytest

import multimodal_to as mt
from drones import HOP, drone
from multimodal_to.auditing import link_clearances
from multimodal_to.models import capsule_pairs
from multimodal_to.models.capsule import pair_name
from multimodal_to.ocp.knot import Knot
from multimodal_to.ocp.parameters import Parameters
from multimodal_to.ocp.self_collision import link_distances, link_pair_labels
from multimodal_to.ocp.variables import Layout

APART = 0.06
"""Farther than the arms are from the chest's jets at home [m]."""
LINKS = mt.Constraint(
    value=link_distances, within=mt.at_least(APART), unit="m", labels=link_pair_labels, holds=mt.Where.LATER_KNOTS
)


@pytest.fixture(scope="module")
def rows(ironcub):
    """The rows, and their derivatives, as functions of the joint positions with all else left open."""
    layout = Layout.of(ironcub)
    z = cs.SX.sym("z", layout.size)
    knot = Knot(ironcub, **layout.read(z))
    value = link_distances(knot, Parameters.of(ironcub, mt.scenarios.take_off(), ironcub.home))
    s = knot.joint_positions
    jacobian = cs.jacobian(value, z)
    joints = cs.Function("rows", [s], [value, cs.jacobian(value, s)])  # it fails where the rows need anything else
    return joints, jacobian, layout


def postures(robot, count, seed=1):
    limits = robot.joint_limits
    return np.random.default_rng(seed).uniform(limits.lower, limits.upper, (count, limits.lower.size)).T


def test_the_rows_are_the_exact_distances_up_to_a_few_millimetres(ironcub, rows):
    s = postures(ironcub, 2000)
    smooth = np.array(rows[0].map(2000)(s)[0])
    exact = capsule_pairs.distances(ironcub.kindyn, s, ironcub.near_capsule_pairs)
    assert (smooth > exact - 1e-9).all()
    near = (exact > -0.01) & (exact < 0.05)
    assert near.sum() > 500
    assert (smooth - exact)[near].max() < 5e-3


def test_a_row_depends_on_the_joints_between_its_two_bodies_alone(ironcub, rows):
    _, jacobian, layout = rows
    joints = layout.rows["joint_positions"]
    names = {index: name for index, name in zip(range(joints.start, joints.stop), ironcub.joint_names, strict=True)}
    row, column = jacobian.sparsity().get_triplet()
    needed = {}
    for r, c in zip(row, column, strict=True):
        needed.setdefault(pair_name(ironcub.near_capsule_pairs[r]), set()).add(names[c])
    leg = {f"l_{joint}" for joint in ("hip_pitch", "hip_roll", "hip_yaw", "knee", "ankle_pitch", "ankle_roll")}
    assert needed["left foot – right foot"] == leg | {name.replace("l_", "r_", 1) for name in leg}
    assert "torso_pitch" not in needed["left chest jet – left upper arm"]
    assert not any("ankle_roll" in name for name in needed["left thigh – right thigh"])


def test_the_derivatives_of_the_rows_are_those_of_finite_differences(ironcub, rows):
    step = 1e-6
    for s in postures(ironcub, 5).T:
        jacobian = np.array(rows[0](s)[1])
        sides = [(rows[0](s + step * axis)[0], rows[0](s - step * axis)[0]) for axis in np.eye(s.size)]
        slopes = np.hstack([np.array(after - before) / (2 * step) for after, before in sides])
        assert jacobian == pytest.approx(slopes, abs=1e-6)


def test_a_solver_keeps_arms_off_the_jets_by_the_margin(ironcub):
    squat = replace(
        mt.scenarios.take_off(),
        knots=6,
        interval_max=0.2,
        final_com=(0.0, 0.0, 0.54),
        terminal=mt.Terminal.STANDING,
        jets=False,
    )
    nearest = {}
    for terms in ((), (LINKS,)):
        solution = mt.solve(mt.build(ironcub, squat, mt.Formulation.paper().with_terms(*terms)))
        assert solution.status is mt.Status.OPTIMAL
        robot = ironcub.with_jets(())
        held = {pair_name(pair) for pair in robot.near_capsule_pairs}
        distances = capsule_pairs.distances(
            robot.kindyn, solution.trajectory.joint_positions[:, 1:], robot.near_capsule_pairs
        )
        nearest[bool(terms)] = distances.min()
        found = link_clearances(robot, solution.trajectory)
        assert held <= {entry.pair for entry in found}
    assert nearest[False] < APART - 5e-3
    assert nearest[True] > APART - 2e-3


def test_a_robot_without_capsules_has_no_rows_and_is_solved_as_before(tmp_path):
    robot = drone(tmp_path)
    assert link_pair_labels(Parameters.of(robot, HOP, robot.home)) == ()
    plain, asked = (
        mt.solve(mt.build(robot, HOP, mt.Formulation.paper().with_terms(*terms))) for terms in ((), (LINKS,))
    )
    assert asked.status is plain.status is mt.Status.OPTIMAL
    assert asked.objective == plain.objective
    assert "link_distances" not in asked.violations

"""Distances of capsules against brute force, their derivatives, and the pairs that a robot keeps apart."""

from __future__ import annotations

from dataclasses import replace

import casadi as cs
import numpy as np
import pytest

import multimodal_to as mt
from multimodal_to.adam.kinematics import Pose
from multimodal_to.errors import ModelError
from multimodal_to.models import capsule_pairs
from multimodal_to.models.capsule import (
    CROSSING,
    OVER,
    Capsule,
    exact_distances,
    pair_name,
    plume,
    segment,
    segment_distances,
    smooth_distance,
)

LENGTHS = [(0.2, 0.2), (0.2, 0.07), (0.1, 0.5), (0.3, 0.0), (0.0, 0.0)]
"""Of the segments of a pair [m]; a segment without length makes a sphere."""
COUNT = 20_000


def capsule(length, radius=0.05, name="one"):
    return Capsule(name=name, frame="f", start=(-length / 2, 0, 0), end=(length / 2, 0, 0), radius=radius)


def distance_function(one, other):
    """The smooth distance as a function of how the second capsule lies in the first's frame: turn and shift."""
    turn, shift = cs.SX.sym("turn", 3), cs.SX.sym("shift", 3)
    rotation = rotation_of(turn)
    at = segment(one, Pose(cs.SX.eye(3), cs.SX(3, 1))), segment(other, Pose(rotation, shift))
    x = cs.vertcat(turn, shift)
    value = smooth_distance(one, at[0], other, at[1])
    return cs.Function("distance", [x], [value]), cs.Function("hessian", [x], [*reversed(cs.hessian(value, x))])


def rotation_of(angles):
    cosine, sine = cs.cos(angles), cs.sin(angles)
    about_z = cs.vertcat(cs.horzcat(cosine[2], -sine[2], 0), cs.horzcat(sine[2], cosine[2], 0), cs.horzcat(0, 0, 1))
    about_y = cs.vertcat(cs.horzcat(cosine[1], 0, sine[1]), cs.horzcat(0, 1, 0), cs.horzcat(-sine[1], 0, cosine[1]))
    return about_z @ about_y


def placements(kind, size, reach):
    """Random ways in which a capsule may lie in the frame of another, (6, size); all within a reach [m]."""
    random = np.random.default_rng(3)
    turns = random.uniform(-np.pi, np.pi, (3, size))
    if kind == "nearly parallel":
        turns = random.choice([-1.0, 1.0], (3, size)) * 10 ** random.uniform(-5, -0.5, (3, size))
    if kind == "parallel":
        turns *= 0.0
    shifts = random.uniform(-1, 1, (3, size))
    shifts *= reach * random.uniform(0, 1, size) / np.linalg.norm(shifts, axis=0)
    if kind == "crossing":
        shifts *= 0.0
    return np.vstack([turns, shifts])


def poses(placed):
    found = np.tile(np.eye(4), (placed.shape[1], 1, 1))
    angles = cs.SX.sym("angles", 3)
    turned = cs.Function("rotation", [angles], [rotation_of(angles)]).map(placed.shape[1])(placed[:3])
    found[:, :3, :3] = np.array(turned).reshape(3, -1, 3).transpose(1, 0, 2)
    found[:, :3, 3] = placed[3:].T
    return found


def exact(one, other, placed):
    return exact_distances(one, np.tile(np.eye(4), (placed.shape[1], 1, 1)), other, poses(placed))


@pytest.mark.parametrize("kind", ["any", "nearly parallel", "parallel"])
def test_the_exact_distance_of_segments_is_that_of_a_fine_grid_of_their_points(kind):
    one, other = capsule(0.2), capsule(0.3, name="other")
    placed = placements(kind, 80, 0.4)
    share = np.linspace(0, 1, 401)[:, None]
    there = poses(placed)
    found = exact(one, other, placed) + one.radius + other.radius
    own = one.start + share * (one.end - one.start)
    for index, pose in enumerate(there):
        points = (other.start + share * (other.end - other.start)) @ pose[:3, :3].T + pose[:3, 3]
        brute = np.linalg.norm(own[:, None] - points, axis=2).min()
        assert found[index] - 1e-12 <= brute <= found[index] + 1e-3


def test_segments_at_known_distances():
    along = np.array([[0.0, 0, 0]]), np.array([[1.0, 0, 0]])
    for start, end, distance in (
        ((0.5, -1, 0.3), (0.5, 1, 0.3), 0.3),  # above the middle, across
        ((0.2, 0, 0.4), (0.8, 0, 0.4), 0.4),  # parallel
        ((2, 0, 0), (3, 0, 0), 1.0),  # one behind the other
        ((1.3, 0.4, 0), (1.3, 2, 0), 0.5),  # end to end
        ((0.5, -1, 0), (0.5, 1, 0), 0.0),  # crossing
        ((0.5, 0.6, 0), (0.5, 0.6, 0), 0.6),  # a point
    ):
        found = segment_distances(*along, np.array([start], dtype=float), np.array([end], dtype=float))
        assert found[0] == pytest.approx(distance, abs=1e-15)


@pytest.mark.parametrize("lengths", LENGTHS, ids=str)
@pytest.mark.parametrize("kind", ["any", "nearly parallel", "parallel", "crossing"])
def test_the_smooth_distance_is_hardly_above_the_exact_one_and_never_below_it(kind, lengths):
    one, other = (capsule(length, name=str(index)) for index, length in enumerate(lengths))
    placed = placements(kind, COUNT, sum(lengths) + 0.1)
    smooth = np.array(distance_function(one, other)[0].map(COUNT)(placed)).ravel()
    radii = one.radius + other.radius
    squared = (exact(one, other, placed) + radii) ** 2
    most = np.sqrt(squared + OVER * (lengths[0] ** 2 + lengths[1] ** 2) + (CROSSING * radii) ** 2) - radii
    assert (smooth <= most + 1e-12).all()
    assert (smooth >= np.sqrt(squared) - radii - 1e-9).all()


def test_thighs_that_touch_are_seen_within_a_millimetre():
    one, other = capsule(0.13), capsule(0.13, name="other")
    placed = placements("any", 200_000, 0.25)
    distances = exact(one, other, placed)
    touching = np.abs(distances) < 2e-3
    assert touching.sum() > 1000
    smooth = np.array(distance_function(one, other)[0].map(int(touching.sum()))(placed[:, touching])).ravel()
    assert np.abs(smooth - distances[touching]).max() < 1e-3


SPECIAL = {
    "parallel, side by side": [0, 0, 0, 0, 0.1, 0],
    "parallel, end to end": [0, 0, 0, 0.25, 0, 0],
    "the same": [0, 0, 0, 0, 0, 0],
    "opposite": [0, 0, np.pi, 0.02, 0.1, 0],
    "crossing in the middle": [0, 0, np.pi / 2, 0, 0, 0],
    "crossing at an end": [0, 0, np.pi / 2, 0.1, 0.1, 0],
    "touching": [0, 0, np.pi / 2, 0, 0, 0.1],
    "any": [0, 0.4, 1.1, 0.05, 0.07, -0.12],
}


@pytest.mark.parametrize("lengths", LENGTHS, ids=str)
@pytest.mark.parametrize("placed", SPECIAL.values(), ids=SPECIAL)
def test_both_derivatives_are_those_of_finite_differences_wherever_segments_lie(placed, lengths):
    one, other = (capsule(length, name=str(index)) for index, length in enumerate(lengths))
    function, derivatives = distance_function(one, other)
    x, step = np.array(placed, dtype=float), 1e-5
    gradient, hessian = (np.array(part) for part in derivatives(x))
    assert np.isfinite(gradient).all()
    assert np.isfinite(hessian).all()
    sides = [(x + step * axis, x - step * axis) for axis in np.eye(6)]
    slopes = [float(function(after) - function(before)) / (2 * step) for after, before in sides]
    assert gradient.ravel() == pytest.approx(slopes, abs=1e-6)
    curvature = [
        np.array(derivatives(after)[0] - derivatives(before)[0]).ravel() / (2 * step) for after, before in sides
    ]
    assert hessian == pytest.approx(np.array(curvature), rel=1e-4, abs=1e-3)


def test_the_smooth_distance_does_not_care_which_capsule_comes_first_beyond_its_own_error():
    one, other = capsule(0.2), capsule(0.1, name="other")
    origin = Pose(cs.SX.eye(3), cs.SX(3, 1))
    there = Pose(cs.SX(np.array(rotation_of(cs.DM([0, 0.3, 1.0])))), cs.SX([0.05, 0.02, 0.13]))
    ahead = float(smooth_distance(one, segment(one, origin), other, segment(other, there)))
    back = float(smooth_distance(other, segment(other, there), one, segment(one, origin)))
    assert ahead == pytest.approx(back, abs=1e-4)


def test_a_plume_reaches_as_far_as_it_says_along_z():
    exhaust = plume("left plume", "nozzle", 0.5, 0.05)
    assert exhaust.start[2] - exhaust.radius == pytest.approx(0.0)
    assert exhaust.end[2] + exhaust.radius == pytest.approx(0.5)
    assert exhaust.plume
    assert plume("short", "nozzle", 0.1, 0.2).length == 0.0


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        ({"radius": 0.0}, "radius is 0.0; expected a positive number"),
        ({"end": (0, 1)}, r"end has the shape \(2,\); expected \(3,\)"),
        ({"start": (0, 0, np.nan)}, "start is .*; expected finite numbers"),
    ],
)
def test_a_capsule_that_cannot_be_is_refused(change, sentence):
    with pytest.raises(ModelError, match=f"capsule 'one': {sentence}"):
        replace(capsule(0.1), **change)


# -------------------------------------------------------------------- pairs


def names(pairs):
    return {pair_name(pair) for pair in pairs}


def mirrored(name):
    return name.replace("left", "?").replace("right", "left").replace("?", "right")


def test_no_pair_of_the_ironcub_touches_at_home(ironcub):
    pairs = capsule_pairs.apart_at_home(
        ironcub.kindyn, ironcub.home.joint_positions, ironcub.capsules, ironcub.standing_height
    )
    assert min(pairs.values()) > capsule_pairs.AT_HOME * ironcub.standing_height
    assert set(ironcub.near_capsule_pairs) <= set(ironcub.capsule_pairs) <= set(pairs)


def test_neighbours_are_left_out_and_legs_and_jets_are_not(ironcub):
    kept = names(ironcub.capsule_pairs)
    assert {"left foot – right foot", "left arm jet – left thigh", "left shank – left arm plume"} <= kept
    assert not {"left thigh – left shank", "left shank – left foot", "left forearm – left arm jet"} & kept
    assert not any(one.plume and other.plume for one, other in ironcub.capsule_pairs)
    assert not any("chest jet – left chest plume" in name for name in kept)  # its own


@pytest.mark.parametrize("stated", [True, False])
def test_the_rows_are_few_and_alike_on_both_sides(ironcub, stated):
    robot = ironcub if stated else replace(ironcub, held_pairs=frozenset())
    sets = {frozenset(entry.name for entry in pair) for pair in robot.near_capsule_pairs}
    assert {frozenset(mirrored(name) for name in pair) for pair in sets} == sets
    assert frozenset({"left foot", "right foot"}) in sets
    assert len(sets) <= (25 if stated else 40)
    if stated:
        assert sets == ironcub.held_pairs


def test_pairs_that_are_chosen_can_meet_and_are_near_at_home(ironcub):
    robot = replace(ironcub, held_pairs=frozenset())
    near, limits = robot.near_capsule_pairs, robot.joint_limits
    postures = np.random.default_rng(8).uniform(limits.lower, limits.upper, (20_000, limits.lower.size)).T
    assert (capsule_pairs.distances(robot.kindyn, postures, near) < 0).any(axis=1).all()
    at_home = capsule_pairs.distances(robot.kindyn, robot.home.joint_positions[:, None], near)
    assert at_home.max() < capsule_pairs.NEAR * robot.standing_height


def test_a_pair_that_is_ignored_is_in_no_list(ironcub):
    pair = frozenset({"left foot", "right foot"})
    robot = replace(ironcub, held_pairs=frozenset(), ignored_pairs=frozenset({pair}))
    for pairs in (robot.capsule_pairs, robot.near_capsule_pairs):
        assert "left foot – right foot" not in names(pairs)
    assert len(robot.capsule_pairs) == len(ironcub.capsule_pairs) - 1


def test_neighbours_cannot_be_held_apart(ironcub):
    robot = replace(ironcub, held_pairs=frozenset({frozenset({"left thigh", "left shank"})}))
    with pytest.raises(
        ModelError, match="the capsules left shank, left thigh cannot be held apart: they are neighbours"
    ):
        _ = robot.near_capsule_pairs


def test_the_plumes_are_those_of_the_jets_in_use(ironcub):
    only = ironcub.with_jets(["left arm"])
    assert [capsule.name for capsule in only.capsules if capsule.plume] == ["left arm plume"]
    bare = ironcub.with_jets(())
    assert bare.capsules == bare.link_capsules == ironcub.link_capsules
    solid = {name for name in names(ironcub.near_capsule_pairs) if "plume" not in name}
    assert names(bare.near_capsule_pairs) == solid


def test_a_pair_that_is_stated_is_held_apart_however_near_it_is_at_home(tmp_path):
    """Postures of a person's own bring Talos's feet nearer than what counts as touching where nothing is stated."""
    talos = mt.load_robot("talos")
    names = frozenset({"left foot", "right foot"})

    def feet_apart(robot):
        return names in {frozenset(one.name for one in pair) for pair in robot.capsule_pairs}

    turned = talos.home.joint_positions.copy()
    for side, sign in (("left", -1.0), ("right", 1.0)):
        turned[talos.joint_names.index(f"leg_{side}_2_joint")] += 0.04 * sign
    near = replace(talos, home=replace(talos.home, joint_positions=turned))
    away = capsule_pairs.distances(
        near.kindyn, turned[:, None], [pair for pair in talos.capsule_pairs if {one.name for one in pair} == names]
    )[0, 0]
    assert 0.0 < away < capsule_pairs.AT_HOME * talos.standing_height
    assert feet_apart(talos)
    assert feet_apart(near)
    assert near.near_capsule_pairs
    assert not feet_apart(replace(near, held_pairs=frozenset()))

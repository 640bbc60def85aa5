"""Soles: the size that the URDF gives them, and levers about their edges against centres of pressure by hand."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from xml.etree import ElementTree

import numpy as np
import pytest

from drones import drone
from multimodal_to.models.contact import ContactPoint
from multimodal_to.models.sole import soles
from solo import solo


def corners_of_the_urdf(robot, foot):
    """Where the URDF puts the contact points of a foot in its ankle [m], (4, 3), by name."""
    places = {}
    for joint in ElementTree.parse(robot.urdf).getroot().iter("joint"):
        child, origin = joint.find("child").get("link"), joint.find("origin")
        if child.startswith(f"{foot[0]}_sole_"):
            places[child] = np.array(origin.get("xyz").split(), dtype=float)
    return places


def with_contacts(robot, frames, foot="left"):
    return replace(robot, contacts=tuple(ContactPoint(foot=foot, frame=frame) for frame in frames))


def pressed(sole, loads):
    """The centre of pressure of loads on a sole's contact points, in its plane [m], (2,)."""
    return loads @ sole.places / loads.sum()


# ------------------------------------------------------------------------------------------ what is a sole


@pytest.mark.parametrize(("index", "foot"), [(0, "left"), (1, "right")])
def test_each_foot_of_the_ironcub_is_a_sole_of_four_corners_with_the_size_of_the_urdf(ironcub, index, foot):
    assert len(soles(ironcub)) == 2
    sole, points = soles(ironcub)[index], corners_of_the_urdf(ironcub, foot)
    assert sole.foot == foot
    assert [ironcub.contact_names[member] for member in sole.members] == list(points)
    assert sorted(sole.corners) == [0, 1, 2, 3]
    expected = np.array(list(points.values()))
    for one in range(4):
        for other in range(4):
            away = np.linalg.norm(expected[one] - expected[other])
            assert np.linalg.norm(sole.places[one] - sole.places[other]) == pytest.approx(away, abs=1e-12)
    assert sole.places.mean(axis=0) == pytest.approx([0.0, 0.0], abs=1e-12)


def test_the_corners_go_round_once_counter_clockwise(ironcub):
    for sole in soles(ironcub):
        ring = sole.places[list(sole.corners)]
        x, y = ring.T
        area = 0.5 * np.sum(x * np.roll(y, -1) - y * np.roll(x, -1))
        spans = np.ptp(np.array(list(corners_of_the_urdf(ironcub, sole.foot).values())), axis=0)
        assert area == pytest.approx(spans[0] * spans[1])  # a rectangle
        assert len(set(sole.edges)) == 4
        assert all(before[1] == after[0] for before, after in pairwise((*sole.edges, sole.edges[0])))


def test_a_foot_of_one_point_is_no_sole(tmp_path):
    assert soles(solo(tmp_path)) == ()


@pytest.mark.parametrize(
    ("frames", "found"),
    [
        (("foot_0", "foot_1"), 0),  # an edge
        (("jet_left", "body", "jet_right"), 0),  # on one line
        (("foot_0", "foot_1", "foot_2"), 1),
    ],
)
def test_a_sole_has_three_points_that_are_not_on_one_line(tmp_path, frames, found):
    assert len(soles(with_contacts(drone(tmp_path), frames))) == found


def test_points_of_two_links_are_no_sole(ironcub):
    assert soles(with_contacts(ironcub, ("l_sole_1", "l_sole_2", "r_sole_1", "r_sole_2"))) == ()


def test_a_point_amid_the_others_is_no_corner_and_is_inside_every_edge(ironcub):
    (sole,) = soles(with_contacts(ironcub, ("l_sole_1", "l_sole", "l_sole_2", "l_sole_3", "l_sole_4")))
    assert sorted(sole.corners) == [0, 2, 3, 4]
    assert {point for edge in sole.edges for point in edge} == {0, 2, 3, 4}
    assert (sole.leverage(1.0)[:, 1] > 0.01).all()
    assert sole.places[list(sole.corners)].mean(axis=0) == pytest.approx([0.0, 0.0], abs=1e-12)


# ------------------------------------------------------------------------------------------ leverage


def test_levers_of_a_square_are_its_width_and_zero_and_what_the_margin_takes(tmp_path):
    """A square of 0.4 m: points are on an edge or 0.4 m from it; a share of 0.75 takes 0.05 m from either."""
    (sole,) = soles(drone(tmp_path))
    assert np.sort(sole.leverage(1.0), axis=1) == pytest.approx(np.tile([0.0, 0.0, 0.4, 0.4], (4, 1)), abs=1e-12)
    assert np.sort(sole.leverage(0.75), axis=1) == pytest.approx(np.tile([-0.05, -0.05, 0.35, 0.35], (4, 1)), abs=1e-12)


@pytest.mark.parametrize("share", [1.0, 0.75, 0.3])
def test_a_lever_is_zero_just_where_the_centre_of_pressure_is_on_the_edge_of_the_shrunk_sole(ironcub, share):
    for sole in soles(ironcub):
        ring = (*sole.corners, sole.corners[0])
        for edge, (here, there) in enumerate(pairwise(ring)):
            for along in (0.1, 0.5, 0.9):
                loads = np.full(4, (1.0 - share) / 4)
                loads[[here, there]] += share * np.array([1.0 - along, along])
                on_edge = share * ((1.0 - along) * sole.places[here] + along * sole.places[there])
                assert pressed(sole, loads) == pytest.approx(on_edge, abs=1e-12)
                moments = sole.leverage(share) @ loads
                assert moments[edge] == pytest.approx(0.0, abs=1e-12)
                assert (np.delete(moments, edge) > 0.0).all()


def test_a_lever_times_the_load_is_the_distance_of_the_centre_of_pressure_from_the_edge(ironcub):
    random, share = np.random.default_rng(2), 0.6
    for sole in soles(ironcub):
        for loads in random.uniform(0.0, 100.0, (20, 4)):
            there = pressed(sole, loads)
            for edge, (here, next_one) in enumerate(pairwise((*sole.corners, sole.corners[0]))):
                start, along = share * sole.places[here], sole.places[next_one] - sole.places[here]
                away = (along[0] * (there - start)[1] - along[1] * (there - start)[0]) / np.linalg.norm(along)
                assert sole.leverage(share)[edge] @ loads == pytest.approx(loads.sum() * away, abs=1e-9)

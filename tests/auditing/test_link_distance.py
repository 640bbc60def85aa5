"""Legs that cross and arms that go into jets are found, by capsules and by the shapes of the links."""

from __future__ import annotations

import sys
from dataclasses import replace

import numpy as np
import pytest

import synthetic
from drones import drone
from multimodal_to.auditing import PROPERTIES, audit, link_clearances
from multimodal_to.auditing.properties import judged
from multimodal_to.auditing.solids import hull, solid_clearances, urdf_solids
from multimodal_to.errors import OutputError
from multimodal_to.models.units import REFERENCE

KNOT = 7


@pytest.fixture(scope="module")
def standing(ironcub):
    """A motion that stays at home."""
    motion = synthetic.take_off(ironcub)
    return replace(motion, joint_positions=np.tile(ironcub.home.joint_positions[:, None], motion.time.size))


def posed(robot, motion, knot=KNOT, **joints):
    """The motion with some joints [rad] elsewhere at one knot."""
    positions = motion.joint_positions.copy()
    for name, value in joints.items():
        positions[robot.joint_names.index(name), knot] = value
    return replace(motion, joint_positions=positions)


CROSSED = {"l_hip_roll": -0.26, "r_hip_roll": -0.26}


def test_a_robot_at_home_keeps_its_links_apart(ironcub, standing):
    finding = audit(ironcub, standing)["link distance"]
    assert finding.holds
    assert -0.06 < finding.worst < -0.03
    assert finding.unit == "m"


@pytest.mark.parametrize(
    ("joints", "pair"),
    [(CROSSED, "left shank – right shank"), ({"l_hip_pitch": -0.6}, "left shank – left chest plume")],
    ids=["legs that cross", "a leg in a plume"],
)
def test_links_that_overlap_are_found_where_they_are(ironcub, standing, joints, pair):
    finding = audit(ironcub, posed(ironcub, standing, **joints))["link distance"]
    assert not finding.holds
    assert finding.worst > 0.01
    assert (finding.knot, finding.body) == (KNOT, pair)


def test_a_plume_counts_only_where_its_jet_is_used(ironcub, standing):
    without = ironcub.with_jets(["left arm", "right arm"])
    rows = [ironcub.jet_names.index(name) for name in without.jet_names]
    quantities = ("thrust", "thrust_rate", "thrust_acceleration", "throttle")
    motion = posed(ironcub, standing, l_hip_pitch=-0.6)
    fewer = {name: getattr(motion, name)[rows] for name in quantities}
    assert audit(without, replace(motion, jet_names=without.jet_names, **fewer))["link distance"].holds


def test_every_pair_is_reported_with_its_least_distance_and_the_nearest_first(ironcub, standing):
    found = link_clearances(ironcub, posed(ironcub, standing, **CROSSED))
    assert len(found) == len(ironcub.capsule_pairs)
    assert [entry.distance for entry in found] == sorted(entry.distance for entry in found)
    assert found[0].distance < 0
    assert found[0].knot == KNOT
    worst = audit(ironcub, posed(ironcub, standing, **CROSSED))["link distance"]
    assert (worst.body, worst.worst) == (found[0].pair, -found[0].distance)


def test_a_robot_without_capsules_is_not_judged_by_them(tmp_path):
    bare = drone(tmp_path)
    assert "link distance" not in judged(None, bare)
    share = bare.standing_height / REFERENCE.length
    assert PROPERTIES["link distance"].limit_for(bare, None) == pytest.approx(1e-4 * share)


# -------------------------------------------------------------------- solids


def test_the_shapes_of_the_links_tell_the_same_as_the_capsules(ironcub, standing):
    pytest.importorskip("coal")
    motion = posed(ironcub, standing, **CROSSED)
    capsules = {entry.pair: entry for entry in link_clearances(ironcub, motion)}
    solids = {entry.pair: entry for entry in solid_clearances(ironcub, motion)}
    for pair, links in (
        ("left foot – right foot", "r_ankle_2 – l_ankle_2"),
        ("left thigh – right thigh", "r_upper_leg – l_upper_leg"),
        ("left shank – right shank", "r_lower_leg – l_lower_leg"),
        ("left arm jet – left thigh", "l_upper_leg – l_arm_jet_turbine"),
        ("left chest jet – left upper arm", "l_shoulder_3 – chest_l_jet_turbine"),
    ):
        assert capsules[pair].distance == pytest.approx(solids[links].distance, abs=0.02)
    for found, pair in ((capsules, "left shank – right shank"), (solids, "r_lower_leg – l_lower_leg")):
        assert found[pair].knot == KNOT
        assert found[pair].distance < -0.05


def test_boxes_and_hulls_are_as_far_apart_as_they_are():
    """The corners of a cube as a mesh, in two frames of a robot whose links are known."""
    coal = pytest.importorskip("coal")
    corners = np.array([[x, y, z] for x in (0, 0.1) for y in (0, 0.1) for z in (0, 0.1)])
    solid = hull("a", np.eye(4), corners)
    assert solid.transform[:3, 3] == pytest.approx([0.05, 0.05, 0.05])
    assert solid.radius == pytest.approx(0.05 * np.sqrt(3))
    away = coal.Transform3s(np.eye(3), solid.transform[:3, 3] + [0.3, 0, 0])
    here = coal.Transform3s(np.eye(3), solid.transform[:3, 3])
    found = coal.distance(solid.shape, here, solid.shape, away, coal.DistanceRequest(), coal.DistanceResult())
    assert found == pytest.approx(0.2, abs=1e-9)


def test_the_meshes_that_the_robot_wears_tell_of_crossed_legs_too(ironcub, standing):
    pytest.importorskip("coal")
    pytest.importorskip("icub_models")
    from multimodal_to.replay.visuals import appearance

    looks = appearance(ironcub.urdf).visuals
    hulls = [hull(look.link, look.transform, look.part.vertices) for look in looks if look.part is not None]
    assert len(hulls) > 20
    assert solid_clearances(ironcub, standing, hulls)[0].distance > 0
    worst = solid_clearances(ironcub, posed(ironcub, standing, **CROSSED), hulls)[0]
    assert worst.distance < 0
    assert worst.knot == KNOT
    assert "ankle_2" in worst.pair or "lower_leg" in worst.pair


def test_without_the_library_a_sentence_says_what_to_install(ironcub, monkeypatch):
    monkeypatch.setitem(sys.modules, "coal", None)
    with pytest.raises(OutputError, match=r"need coal: pip install 'multimodal-to\[solids\]'"):
        urdf_solids(ironcub)

"""A motion that moves no mass has no acceleration: it is named before anything divides by it."""

from __future__ import annotations

import numpy as np
import pytest
from test_adam_urdf import INERTIAL, link, robot

from multimodal_to.adam import KinDynComputations
from multimodal_to.adam.inspection import describe
from multimodal_to.adam.singular import massless_motions
from multimodal_to.errors import ModelError
from random_trees import random_urdf

POINT = '<inertial><mass value="1"/><inertia ixx="0" iyy="0" izz="0" ixy="0" ixz="0" iyz="0"/></inertial>'


def joint(name: str, parent: str, child: str, axis: str = "0 0 1", kind: str = "continuous", xyz: str = "0 0 0") -> str:
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/><origin xyz="{xyz}"/>'
        f'<axis xyz="{axis}"/><limit lower="-1" upper="1" effort="1" velocity="1"/></joint>'
    )


SINGULAR = {
    "a base without mass": (
        robot(link("a", ""), link("b"), joint("j", "a", "b")),
        ("the base 'a' and joint 'j' can move together",),
    ),
    "a base without mass on a rail": (
        robot(link("a", ""), link("b"), joint("j", "a", "b", "1 0 0", "prismatic")),
        ("the base 'a' and joint 'j' can move together",),
    ),
    "a base of a point mass": (robot(link("a", POINT)), ("the base 'a' turns without moving any mass",)),
    "two joints on one axis": (
        robot(link("a"), link("b", ""), link("c"), joint("j", "a", "b"), joint("k", "b", "c", xyz="0 0 0.3")),
        ("joint 'j' and joint 'k' can move together",),
    ),
    "two rails one way": (
        robot(
            link("a"),
            link("b", ""),
            link("c"),
            joint("j", "a", "b", "0 1 0", "prismatic"),
            joint("k", "b", "c", "0 1 0", "prismatic", "0.1 0 0"),
        ),
        ("joint 'j' and joint 'k' can move together",),
    ),
    "four joints at one point": (
        robot(
            *(link(name, "") for name in "bcd"),
            link("a"),
            link("e"),
            joint("j", "a", "b"),
            joint("k", "b", "c", "0 1 0"),
            joint("l", "c", "d", "1 0 0"),
            joint("m", "d", "e", "0 1 1"),
        ),
        ("joint 'j' and joint 'k' and joint 'l' and joint 'm' can move together",),
    ),
    "a point mass on its axis": (
        robot(link("a"), link("b", POINT), joint("j", "a", "b")),
        ("joint 'j' moves nothing that has mass",),
    ),
    "nothing behind a joint": (
        robot(link("a"), link("b", ""), joint("j", "a", "b")),
        ("joint 'j' moves nothing that has mass",),
    ),
    "two faults": (
        robot(link("a"), link("b", ""), link("c", ""), joint("j", "a", "b"), joint("k", "a", "c")),
        ("joint 'j' moves nothing that has mass", "joint 'k' moves nothing that has mass"),
    ),
}


@pytest.mark.parametrize("case", SINGULAR)
def test_a_motion_that_moves_no_mass_is_named(case):
    text, expected = SINGULAR[case]
    said = [str(finding) for finding in describe(text).findings if "undefined" in finding.text]
    assert len(said) == len(expected)
    assert all(any(sentence.startswith(start) for sentence in said) for start in expected), said
    kindyn = KinDynComputations(text)
    with pytest.raises(ModelError, match=expected[0]):
        kindyn.aba(np.eye(4), np.zeros(kindyn.NDoF), np.zeros(6), np.zeros(kindyn.NDoF), np.zeros(kindyn.NDoF))


FINE = {
    "a base without mass that two arms hold": robot(
        link("a", ""),
        link("b"),
        link("c"),
        joint("j", "a", "b", xyz="0.1 0 0"),
        joint("k", "a", "c", "0 1 0", xyz="-0.1 0 0"),
    ),
    "a universal joint": robot(
        link("a"), link("b", ""), link("c"), joint("j", "a", "b"), joint("k", "b", "c", "1 0 0")
    ),
    "a light finger": robot(
        link("a", INERTIAL.replace('"1"', '"100"').replace('"0.1"', '"50"')),
        link("b", INERTIAL.replace('"1"', '"1e-6"').replace('"0.1"', '"1e-11"')),
        joint("j", "a", "b", xyz="1 1 1"),
    ),
}


@pytest.mark.parametrize("case", FINE)
def test_what_moves_mass_is_fine_and_its_acceleration_is_that_of_the_mass_matrix(case):
    kindyn = KinDynComputations(FINE[case])
    assert massless_motions(kindyn.tree) == ()
    s, torques = 0.3 + np.arange(kindyn.NDoF), np.linspace(1.0, 2.0, kindyn.NDoF) * 1e-6
    rest = np.zeros(6), np.zeros(kindyn.NDoF)
    found = np.array(kindyn.aba(np.eye(4), s, *rest, torques)).ravel()
    force = np.append(np.zeros(6), torques) - np.array(kindyn.gravity_term(np.eye(4), s)).ravel()
    matrix = np.array(kindyn.mass_matrix(np.eye(4), s))
    assert matrix @ found == pytest.approx(force, abs=1e-6 * np.abs(force).max())


@pytest.mark.parametrize("seed", range(4))
def test_random_trees_are_fine(seed):
    assert massless_motions(KinDynComputations(random_urdf(12, seed)).tree) == ()


def test_a_posture_in_which_axes_meet_is_said_when_it_comes():
    """The middle of three axes turns the other two into line at zero: no acceleration there, and one elsewhere."""
    text = robot(
        link("a"),
        link("b", ""),
        link("c", ""),
        link("d", INERTIAL.replace('"0.1"', '"0.5"')),
        joint("j", "a", "b"),
        joint("k", "b", "c", "1 0 0"),
        joint("l", "c", "d"),
    )
    kindyn = KinDynComputations(text)
    rest = np.zeros(6), np.zeros(3), np.zeros(3)
    assert np.isfinite(np.array(kindyn.aba(np.eye(4), [0.1, 0.7, 0.2], *rest))).all()
    with pytest.raises(ModelError, match="aba: the result is no finite number; in this posture"):
        kindyn.aba(np.eye(4), [0.0, 0.0, 0.0], *rest)

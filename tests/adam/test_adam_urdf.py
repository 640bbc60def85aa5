"""What the URDF reader makes of good, odd and bad input: each bad one ends in one sentence of the right class."""

from __future__ import annotations

import logging
import re
from pathlib import Path

import casadi as cs
import numpy as np
import pytest

from adam_robots import IRONCUB, example_robots, ironcub_joints
from multimodal_to.adam import KinDynComputations, load_tree
from multimodal_to.adam.inspection import describe
from multimodal_to.errors import InputError, ModelError

INERTIAL = '<inertial><mass value="1"/><inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial>'
LIMIT = '<limit lower="-1" upper="1" effort="10" velocity="5"/>'
ABOUT_Z = '<axis xyz="0 0 1"/>' + LIMIT


def link(name: str, inside: str = INERTIAL) -> str:
    return f'<link name="{name}">{inside}</link>'


def joint(name: str, parent: str, child: str, kind: str = "revolute", inside: str = ABOUT_Z) -> str:
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="0.1 0.2 0.3" rpy="0.3 0.2 0.1"/>{inside}</joint>'
    )


def robot(*parts: str) -> str:
    return f'<robot name="r">{"".join(parts)}</robot>'


def pair(inside: str = ABOUT_Z, kind: str = "revolute", child: str = INERTIAL) -> str:
    return robot(link("a"), link("b", child), joint("j", "a", "b", kind, inside))


def inertia(mass: object = 1, xx: object = 0.1, yy: object = 0.1, zz: object = 0.1) -> str:
    return (
        f'<inertial><mass value="{mass}"/>'
        f'<inertia ixx="{xx}" iyy="{yy}" izz="{zz}" ixy="0" ixz="0" iyz="0"/></inertial>'
    )


LAUGHS = '<!DOCTYPE r [<!ENTITY a "ha"><!ENTITY b "&a;&a;&a;&a;&a;&a;">]>'
BOMB = "".join(f'<!ENTITY e{i} "{f"&e{i - 1};" * 10}">' for i in range(1, 12))

BAD = {
    "nothing at all": ("<", "not valid XML"),
    "half a file": ("<robot name='r'><link name='a'>", "not valid XML"),
    "no URDF": ("<sdf/>", "root element is <sdf>"),
    "no links": (robot(), "holds no links"),
    "a document type": (LAUGHS + robot(link("a")), "document type"),
    "an entity bomb": (f'<!DOCTYPE r [<!ENTITY e0 "x">{BOMB}]>' + robot(link("&e11;")), "valid XML|document type"),
    "a file of someone else": (
        '<!DOCTYPE r [<!ENTITY x SYSTEM "file:///etc/hostname">]>' + robot(link("a", "&x;")),
        "document type",
    ),
    "a link without a name": (robot("<link/>"), "no name"),
    "a joint without a type": (robot(link("a"), '<joint name="j"/>'), "no type"),
    "a joint without a parent": (
        robot(link("a"), '<joint name="j" type="fixed"><child link="a"/></joint>'),
        "no parent",
    ),
    "two links of one name": (robot(link("a"), link("a")), "more than one link named a"),
    "two joints of one name": (
        robot(link("a"), link("b"), link("c"), joint("j", "a", "b"), joint("j", "a", "c")),
        "one joint named j",
    ),
    "a joint to nowhere": (robot(link("a"), joint("j", "a", "b")), "'b', which does not exist"),
    "several roots": (robot(link("a"), link("b")), "2 trees, with the roots a, b"),
    "a loop": (robot(link("r"), link("a"), link("b"), joint("j", "a", "b"), joint("k", "b", "a")), "loop"),
    "a link on two joints": (
        robot(link("a"), link("b"), link("c"), joint("j", "a", "c"), joint("k", "b", "c")),
        "child of two joints",
    ),
    "a link on itself": (robot(link("a"), joint("j", "a", "a")), "loop"),
    "a floating joint": (pair(kind="floating"), "'j' is of type 'floating'"),
    "a planar joint": (pair(kind="planar"), "'j' is of type 'planar'"),
    "a joint of no type": (pair(kind="screw"), "'j' is of type 'screw'"),
    "a zero axis": (pair('<axis xyz="0 0 0"/>' + LIMIT), "no direction"),
    "an axis of two numbers": (pair('<axis xyz="0 1"/>' + LIMIT), "3 finite numbers"),
    "an axis of words": (pair('<axis xyz="up 0 0"/>' + LIMIT), "3 finite numbers"),
    "a NaN in a mass": (pair(child=inertia(mass="nan")), "value=\"nan\" of <mass> in 'b'"),
    "an infinite inertia": (pair(child=inertia(xx="inf")), "not a finite number"),
    "an empty mass": (pair(child=inertia(mass="")), "not a finite number"),
    "a mass without a value": (pair(child="<inertial><mass/></inertial>"), "<mass> in .* has no value"),
    "half an inertia": (pair(child='<inertial><mass value="1"/><inertia ixx="1"/></inertial>'), "has no ixy"),
    "a negative mass": (pair(child=inertia(mass=-1)), "mass -1.0 kg"),
    "a negative inertia": (pair(child=inertia(xx=-0.1)), "'b' has an inertia with the negative principal value"),
    "limits the wrong way round": (pair('<limit lower="1" upper="-1" effort="1" velocity="1"/>'), "above its upper"),
    "a limit that is no number": (pair('<limit lower="nan" upper="1" effort="1" velocity="1"/>'), 'lower="nan"'),
    "no mass at all": (robot(link("a", ""), link("b", ""), joint("j", "a", "b")), "no mass"),
    "a mimic joint of one that does not exist": (
        pair(f'<mimic joint="left"/>{LIMIT}'),
        "'j' mimics an unknown joint 'left'",
    ),
    "a mimic joint of itself": (pair(f'<mimic joint="j"/>{LIMIT}'), "'j' mimics itself"),
    "mimic joints in a circle": (
        robot(
            *(link(name) for name in "abcd"),
            joint("i", "a", "b", inside=f'<mimic joint="j"/>{LIMIT}'),
            joint("j", "a", "c", inside=f'<mimic joint="k"/>{LIMIT}'),
            joint("k", "a", "d", inside=f'<mimic joint="j"/>{LIMIT}'),
        ),
        "the joints j, k mimic each other in a circle",
    ),
    "a mimic joint that moves too far": (
        robot(
            *(link(name) for name in "abcd"),
            joint("i", "a", "b"),
            joint("j", "a", "c", inside=f'<mimic joint="i" multiplier="1e8"/>{LIMIT}'),
            joint("k", "a", "d", inside=f'<mimic joint="j" multiplier="1e8"/>{LIMIT}'),
        ),
        r"'k' mimics 'i' by the multiplier 1e\+16",
    ),
}


@pytest.mark.parametrize("case", BAD)
def test_bad_input_is_refused_in_one_sentence(case: str) -> None:
    text, expected = BAD[case]
    with pytest.raises(ModelError, match=expected) as caught:
        load_tree(text)
    assert "\n" not in str(caught.value)
    assert len(str(caught.value)) < 400


def test_files_that_cannot_be_read_are_refused(tmp_path: Path) -> None:
    binary = tmp_path / "binary.urdf"
    binary.write_bytes(bytes(range(256)))
    for urdf in (tmp_path, tmp_path / "absent.urdf", binary, "no urdf", "x" * 5000, "a\0b"):
        with pytest.raises(ModelError, match=r"cannot read|valid XML"):
            load_tree(urdf)


def test_the_readers_logger_is_left_as_it_was() -> None:
    logger = logging.getLogger("yourdfpy")
    level = logger.level
    load_tree(pair())
    assert logger.level == level


def test_limits_have_the_defaults_of_urdf() -> None:
    def read(inside: str, kind: str = "revolute"):
        return load_tree(pair(inside, kind)).joints[0]

    full = read('<limit lower="-1" upper="2" effort="3" velocity="4"/>')
    assert (full.lower, full.upper, full.effort, full.velocity) == (-1, 2, 3, 4)
    bare = read('<limit effort="3" velocity="4"/>')
    assert (bare.lower, bare.upper) == (0, 0)
    endless = read('<limit lower="-1" upper="2" effort="3" velocity="4"/>', "continuous")
    assert (endless.lower, endless.upper, endless.effort) == (-np.inf, np.inf, 3)
    none = read("")
    assert (none.lower, none.upper, none.effort, none.velocity) == (-np.inf, np.inf, np.inf, np.inf)


def test_an_axis_is_x_by_default_and_made_a_unit_one() -> None:
    default = KinDynComputations(pair(LIMIT))
    stated = KinDynComputations(pair('<axis xyz="1 0 0"/>' + LIMIT))
    longer = KinDynComputations(pair('<axis xyz="5 0 0"/>' + LIMIT))
    poses = [np.array(kindyn.forward_kinematics("b", np.eye(4), [0.7])) for kindyn in (default, stated, longer)]
    np.testing.assert_allclose(poses[0], poses[1], atol=1e-15)
    np.testing.assert_allclose(poses[0], poses[2], atol=1e-15)


def test_a_link_without_mass_is_a_frame() -> None:
    kindyn = KinDynComputations(robot(link("a"), link("tip", ""), joint("f", "a", "tip", "fixed")))
    assert kindyn.get_total_mass() == 1
    assert kindyn.forward_kinematics("tip", np.eye(4), []).shape == (4, 4)


def test_a_joint_that_moves_no_mass_has_kinematics_but_no_acceleration() -> None:
    kindyn = KinDynComputations(pair(child=""))
    assert np.isfinite(np.array(kindyn.mass_matrix(np.eye(4), [0.3]))).all()
    with pytest.raises(ModelError, match="'j' moves nothing that has mass"):
        kindyn.aba(np.eye(4), [0.3], np.zeros(6), [0], [0])


def test_a_small_wrong_inertia_is_carried_by_the_body_it_is_fixed_to() -> None:
    parts = link("a"), link("b", inertia(mass=1e-6, xx=-1e-8)), joint("f", "a", "b", "fixed")
    assert any("negative" in finding.text for finding in describe(robot(*parts)).findings)


def mimics(**limits: str) -> str:
    """Return a robot whose joint k follows i at 2 i + 0.1, j follows k at −k + 0.2, and only i moves on its own."""
    limits = {"i": LIMIT, "j": LIMIT, "k": LIMIT} | limits
    return robot(
        *(link(name) for name in "abcd"),
        joint("j", "a", "b", inside='<axis xyz="0 1 0"/><mimic joint="k" multiplier="-1" offset="0.2"/>' + limits["j"]),
        joint("i", "a", "c", inside='<axis xyz="0 0 1"/>' + limits["i"]),
        joint("k", "c", "d", "prismatic", '<mimic joint="i" multiplier="2" offset="0.1"/>' + limits["k"]),
    )


def limit(lower: float, upper: float, effort: float = 10, velocity: float = 5) -> str:
    return f'<limit lower="{lower}" upper="{upper}" effort="{effort}" velocity="{velocity}"/>'


def test_a_mimic_joint_moves_as_its_leader_says() -> None:
    """A follower of a follower too, on another branch, and before its leader in the file."""
    tied = KinDynComputations(mimics())
    assert tied.joint_names == ("i",)
    assert {name: (how.joint, how.multiplier, how.offset) for name, how in tied.tree.followers.items()} == {
        "j": ("i", -2.0, pytest.approx(0.1)),
        "k": ("i", 2.0, 0.1),
    }
    free = KinDynComputations(re.sub("<mimic[^>]*>", "", mimics()), ["i", "j", "k"])
    i = 0.3
    s = [i, 0.2 - (2 * i + 0.1), 2 * i + 0.1]
    assert {name: float(at) for name, at in tied.tree.joint_values(np.array([i])).items()} == pytest.approx(
        dict(zip("ijk", s, strict=True))
    )
    G = np.vstack([np.hstack([np.eye(6), np.zeros((6, 1))]), np.hstack([np.zeros((3, 6)), [[1], [-2], [2]]])])
    for frame in "abcd":
        expected = np.array(free.forward_kinematics(frame, np.eye(4), s))
        np.testing.assert_allclose(np.array(tied.forward_kinematics(frame, np.eye(4), [i])), expected, atol=1e-14)
        J = np.array(free.jacobian(frame, np.eye(4), s)) @ G
        np.testing.assert_allclose(np.array(tied.jacobian(frame, np.eye(4), [i])), J, atol=1e-14)
    M = G.T @ np.array(free.mass_matrix(np.eye(4), s)) @ G
    np.testing.assert_allclose(np.array(tied.mass_matrix(np.eye(4), [i])), M, atol=1e-14)


def test_a_mimic_joint_is_locked_where_its_leader_is() -> None:
    text = mimics()
    assert load_tree(text, []).locked == {"i": 0.0, "j": pytest.approx(0.1), "k": 0.1}
    assert load_tree(text, [], {"i": 0.3}).locked == {"i": 0.3, "j": pytest.approx(-0.5), "k": pytest.approx(0.7)}
    assert load_tree(text, locked={"i": 0.3}).locked == load_tree(text, [], {"i": 0.3}).locked
    held = load_tree(text, ["i"], {"k": 0.5})  # by hand: what follows it is held by it
    assert held.locked == {"j": pytest.approx(-0.3), "k": 0.5}
    assert held.followers == {}
    with pytest.raises(ModelError, match="'k' mimics 'i' and cannot move on its own; leave it out"):
        load_tree(text, ["i", "k"])


def test_a_mimic_joint_of_a_joint_that_never_moves_is_held_at_its_offset() -> None:
    follower = joint("k", "a", "c", inside=f'<mimic joint="j" multiplier="2" offset="0.1"/>{LIMIT}')
    parts = link("a"), link("b"), link("c"), joint("j", "a", "b", "fixed", ""), follower
    assert load_tree(robot(*parts)).locked == {"k": 0.1}
    still = pair(), joint("k", "a", "c", inside=f'<mimic joint="j" multiplier="0" offset="0.1"/>{LIMIT}'), link("c")
    assert load_tree(still[0].replace("</robot>", still[1] + still[2] + "</robot>")).locked == {"k": 0.1}


def test_the_limits_of_a_joint_are_kept_by_its_followers() -> None:
    """k = 2 i + 0.1 and j = −2 i + 0.1: i has what all three ranges leave it, k its speed twice, τ half its force."""

    def limits(**given: str) -> tuple[float, float, float, float]:
        (leader,) = load_tree(mimics(**given)).joints
        return leader.lower, leader.upper, leader.velocity, leader.effort

    wide = limit(-9, 9)
    assert limits(i=limit(-1, 2), j=wide, k=wide) == (-1, 2, 2.5, 10)
    assert limits(i=limit(-1, 2), j=wide, k=limit(-0.9, 1.1)) == pytest.approx((-0.5, 0.5, 2.5, 10))
    assert limits(i=limit(-1, 2), j=limit(-1.9, 0.5), k=wide) == pytest.approx((-0.2, 1, 2.5, 10))
    assert limits(i=limit(-1, 2, 7, 1), j=limit(-9, 9, 3, 4), k=limit(-9, 9, 4, 8)) == pytest.approx((-1, 2, 1, 6))
    assert limits(i=limit(-1, 2), j=limit(-9, 9, 0, 0), k=limit(-9, 9, 0, 0)) == (-1, 2, 5, 10)  # 0 stands for none
    assert limits(i=limit(-1, 2), j=wide, k=limit(7, 8)) == (-1, 2, 2.5, 10)  # nothing in common: a finding
    found = [str(finding) for finding in describe(mimics(i=limit(-1, 2), j=wide, k=limit(7, 8))).findings]
    assert "joint 'k' follows 'i' at 2 i + 0.1, which leaves its own range 7 to 8" in " ".join(found)
    assert limits(i=limit(-1, 2), j=wide, k='<limit effort="10" velocity="5"/>')[:2] == (-1, 2)  # it states no range


def test_a_description_says_how_a_mimic_joint_follows() -> None:
    text = str(describe(mimics()))
    for expected in (
        "4 links, 1 moving joints (7 degrees",
        "← k (follows i: 2 i + 0.1)",
        "mimic joints: 2",
        "  j = -2 i + 0.1",
    ):
        assert expected in text, text
    assert not [finding for finding in describe(mimics(j=limit(-9, 9), k=limit(-9, 9))).findings]


def test_a_locked_joint_is_one_that_stands_still() -> None:
    urdf, names = IRONCUB / "ironcub.urdf", ironcub_joints()
    still = {"l_knee": -0.7, "torso_yaw": 0.4}
    free, locked = (
        KinDynComputations(urdf, names),
        KinDynComputations(urdf, [name for name in names if name not in still], locked_joints=still),
    )
    s = np.linspace(-0.5, 0.5, free.NDoF)
    for name, value in still.items():
        s[names.index(name)] = value
    kept = [names.index(name) for name in locked.joint_names]
    pose = np.eye(4), s[kept]
    for frame in ("l_sole", "head"):
        expected = np.array(free.forward_kinematics(frame, np.eye(4), s))
        np.testing.assert_allclose(np.array(locked.forward_kinematics(frame, *pose)), expected, atol=1e-11)
    rows = [*range(6), *(6 + index for index in kept)]
    expected = np.array(free.mass_matrix(np.eye(4), s))[np.ix_(rows, rows)]
    np.testing.assert_allclose(np.array(locked.mass_matrix(*pose)), expected, atol=1e-11)


@pytest.mark.parametrize(
    ("arguments", "error", "expected"),
    [
        ({"joints_name_list": ["knee"]}, ModelError, "unknown joint 'knee'"),
        ({"joints_name_list": ["l_knee", "l_knee"]}, ModelError, "given twice"),
        ({"joints_name_list": "l_knee"}, ModelError, "list of names"),
        ({"joints_name_list": ["l_knee"], "locked_joints": {"l_knee": 0}}, ModelError, "both moving and locked"),
        ({"locked_joints": {"l_knee": np.nan}}, ModelError, "finite number"),
        ({"root_link": "head"}, ModelError, "root link is 'root_link', not 'head'"),
        ({"gravity": [0, 0]}, InputError, "three finite numbers"),
        ({"gravity": [0, 0, np.nan]}, InputError, "three finite numbers"),
        ({"gravity": [0, 0, -9.8, 0, 0, 1]}, InputError, "three finite numbers"),
        ({"representation": "mixed"}, InputError, "unknown representation 'mixed'; available: BODY_FIXED"),
    ],
)
def test_arguments_that_fit_no_robot_are_refused(arguments: dict, error: type, expected: str) -> None:
    with pytest.raises(error, match=expected):
        KinDynComputations(IRONCUB / "ironcub.urdf", **arguments)


def test_quantities_check_shapes_numbers_and_names() -> None:
    kindyn = KinDynComputations(pair())
    with pytest.raises(InputError, match=r"mass_matrix: 's' has shape \(2,\); expected \(1, 1\)"):
        kindyn.mass_matrix(np.eye(4), [0, 0])
    with pytest.raises(InputError, match="'H' has shape"):
        kindyn.mass_matrix(cs.SX.eye(3), [0])
    with pytest.raises(InputError, match="not finite"):
        kindyn.bias_force(np.eye(4), [0], np.full(6, np.nan), [0])
    with pytest.raises(ModelError, match=r"unknown frame 'c'\. Available: a, b"):
        kindyn.jacobian("c", np.eye(4), [0])
    with pytest.raises(ModelError, match="unknown frame"):
        kindyn.rnea(np.eye(4), [0], np.zeros(6), [0], np.zeros(6), [0], {"c": np.zeros(6)})


def test_what_looks_wrong_is_found() -> None:
    child = inertia(xx=0.1, yy=0.1, zz=0.5)
    text = pair('<axis xyz="0 0 2"/><limit lower="0" upper="0" effort="50000" velocity="5"/>', child=child)
    said = [str(finding) for finding in describe(text).findings]
    for expected in (
        "link 'b' has an inertia that no body can have",
        "joint 'j' had an axis of length 2",
        "joint 'j' has the effort limit 50000, which looks like a placeholder",
        "joint 'j' has the range 0 to 0",
    ):
        assert any(sentence.startswith(expected) for sentence in said), said


def test_a_description_names_links_masses_and_what_is_merged_or_locked() -> None:
    text = str(describe(example_robots() / "talos_data/robots/talos_full_v2.urdf"))
    for expected in (
        "torso_1_link",
        " kg",
        "merged",
        "gripper_left_inner_double_joint = gripper_left_joint",
        "looks wrong",
    ):
        assert expected in text
    quiet = str(describe(pair()))
    assert "2 links, 1 moving joints" in quiet
    assert "b  1.000 kg  ← j (revolute -1 to 1 rad)" in quiet

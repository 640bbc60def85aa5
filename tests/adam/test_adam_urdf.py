"""What the URDF reader makes of good, odd and bad input: each bad one ends in one sentence of the right class."""

from __future__ import annotations

import logging
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
    "a mimic joint that moves": (
        robot(
            link("a"),
            link("b"),
            link("c"),
            joint("j", "a", "b"),
            joint("k", "a", "c", inside=f'<mimic joint="j"/>{LIMIT}'),
        ),
        "'k' mimics 'j'",
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


def test_a_mimic_joint_left_out_is_locked_where_the_other_one_holds_it() -> None:
    mimic = f'<mimic joint="j" multiplier="2" offset="0.1"/>{LIMIT}'
    text = robot(link("a"), link("b"), link("c"), joint("j", "a", "b"), joint("k", "a", "c", inside=mimic))
    assert load_tree(text, []).locked == {"j": 0.0, "k": 0.1}
    assert load_tree(text, [], {"j": 0.3}).locked == {"j": 0.3, "k": pytest.approx(0.7)}
    assert load_tree(text, ["j"], {"k": 0.5}).locked == {"k": 0.5}
    with pytest.raises(ModelError, match="'k' mimics 'j', which moves"):
        load_tree(text, ["j"])
    circle = robot(link("a"), link("b"), joint("j", "a", "b", inside=f'<mimic joint="j"/>{LIMIT}'))
    with pytest.raises(ModelError, match="leads to no joint"):
        load_tree(circle, [])


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
    for expected in ("torso_1_link", " kg", "merged", "gripper_left_inner_double_joint at 0", "looks wrong"):
        assert expected in text
    quiet = str(describe(pair()))
    assert "2 links, 1 moving joints" in quiet
    assert "b  1.000 kg  ← j (revolute -1 to 1 rad)" in quiet

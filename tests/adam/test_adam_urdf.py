"""What the URDF reader makes of good, odd and bad input: each bad one ends in one sentence of the right class."""

from __future__ import annotations

import itertools
import logging
import re
import shutil
import subprocess
from pathlib import Path

import casadi as cs
import numpy as np
import pytest

from adam_robots import IRONCUB, example_robots, ironcub_joints
from multimodal_to.adam import KinDynComputations, Representations, load_tree
from multimodal_to.adam.inspection import describe
from multimodal_to.adam.urdf import _COUNTS
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
    opposite = describe(mimics(i=limit(0, 2), j=limit(0.1, 9), k=wide))  # as both of PR2's grippers
    assert "joint 'i' has the range 0 to 0 with what its mimic joints allow, so it cannot move" in str(opposite)
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
        ({"joints_name_list": "l_knee"}, InputError, "sequence of texts"),
        ({"joints_name_list": ["l_knee"], "locked_joints": {"l_knee": 0}}, ModelError, "both moving and locked"),
        ({"locked_joints": {"l_knee": np.nan}}, ModelError, "finite number"),
        ({"root_link": "head"}, ModelError, "root link is 'root_link', not 'head'"),
        ({"gravity": [0, 0]}, InputError, "three finite numbers"),
        ({"gravity": [0, 0, np.nan]}, InputError, "three finite numbers"),
        ({"gravity": [0, 0, -9.8, 0, 0, 1]}, InputError, "three finite numbers"),
        ({"representation": "mixed"}, InputError, "'representation' is 'mixed'; expected one of BODY_FIXED"),
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


def star(*names: str) -> KinDynComputations:
    """Return a robot with a link of each name on a base of its own joint each."""
    parts = [joint(f"j{index}", "base", name) for index, name in enumerate(names)]
    return KinDynComputations(robot(link("base"), *map(link, names), *parts))


ALIKE = (
    ("l-sole", "l_sole", "l sole", "l__sole", "_l_sole", "l_sole_", "l.sole", "L_sole"),
    ("left foot", "left", "foot", "left_foot"),
    ("foot", "dot_foot", "dot_nu_foot", "nu_foot"),
    ("é", "è", "_", "ä b", "äb", "1"),
)


@pytest.mark.parametrize("names", ALIKE, ids=lambda names: names[0])
def test_every_function_has_a_name_of_its_own(names: tuple[str, ...]) -> None:
    """Also where names differ in blanks and signs only, and where the name of one quantity begins another's."""
    kindyn = star(*names)
    frames = [
        getattr(kindyn, f"{of}_fun") for of in ("jacobian", "jacobian_dot", "jacobian_dot_nu", "relative_jacobian")
    ]
    functions = [function(name) for function in frames for name in names]
    groups = [(), *((name,) for name in names), *itertools.permutations(names, 2), names]
    functions += [function(group) for function in (kindyn.rnea_fun, kindyn.aba_fun) for group in groups]
    functions += [kindyn.mass_matrix_fun()]
    kindyn.g = [0, 0, -1.62]
    functions += [kindyn.rnea_fun(), kindyn.mass_matrix_fun()]
    kindyn.set_frame_velocity_representation(Representations.BODY_FIXED_REPRESENTATION)
    functions += [kindyn.rnea_fun(), kindyn.mass_matrix_fun(), kindyn.jacobian_fun(names[0])]
    assert len({function.name() for function in functions}) == len(functions)


def test_a_name_that_looks_like_a_mark_is_marked() -> None:
    """A frame that is called as the function of another one is."""
    marked = star("l-sole").jacobian_fun("l-sole").name()
    kindyn = star("l-sole", marked.removeprefix("jacobian_"))
    names = {kindyn.jacobian_fun(frame).name() for frame in kindyn.frame_names[1:]}
    assert len(names) == 2
    assert marked in names


@pytest.mark.parametrize("names", ALIKE, ids=lambda names: names[0])
def test_wrenches_on_frames_of_alike_names_add_up_and_their_c_compiles(names: tuple[str, ...], tmp_path: Path) -> None:
    kindyn, rng = star(*names), np.random.default_rng(1)
    n = kindyn.NDoF
    motion = (
        np.eye(4),
        rng.normal(size=n),
        rng.normal(size=6),
        rng.normal(size=n),
        rng.normal(size=6),
        rng.normal(size=n),
    )
    still = np.array(kindyn.rnea(*motion))
    for group in [*((name,) for name in names), *itertools.permutations(names, 2), names]:
        wrenches = {name: rng.normal(size=6) for name in group}
        pushed = sum(np.array(kindyn.jacobian(name, *motion[:2])).T @ wrench for name, wrench in wrenches.items())
        expected = still.ravel() - pushed
        np.testing.assert_allclose(np.array(kindyn.rnea(*motion, wrenches)).ravel(), expected, atol=1e-12)
        symbols = {name: cs.MX.sym("w", 6) for name in group}
        graph = cs.Function("graph", [*symbols.values()], [kindyn.rnea(*motion, symbols)])
        np.testing.assert_allclose(np.array(graph(*wrenches.values())).ravel(), expected, atol=1e-12)
    generator = cs.CodeGenerator("functions.c", {"with_header": True})
    for name in names:
        generator.add(kindyn.jacobian_fun(name))
        generator.add(kindyn.rnea_fun((name,)))
    for pair_of_names in itertools.permutations(names[:3], 2):
        generator.add(kindyn.rnea_fun(pair_of_names))
    generator.generate(f"{tmp_path}/")
    compiler = shutil.which("cc") or shutil.which("gcc")
    if compiler is None:
        pytest.skip("no C compiler")
    done = subprocess.run(
        [compiler, "-fsyntax-only", "-Werror", str(tmp_path / "functions.c")],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr[:500]


def test_wrenches_on_one_frame_add_up() -> None:
    """As where two jets are in one frame, or a jet where the robot touches the ground."""
    kindyn, rng = star("b", "c"), np.random.default_rng(3)
    motion = (np.eye(4), *(rng.normal(size=size) for size in (2, 6, 2, 6, 2)))
    one, other, third = rng.normal(size=(3, 6))
    twice = kindyn.rnea_fun(("b", "c", "b"))(*motion, one, other, third)
    once = kindyn.rnea(*motion, {"b": one + third, "c": other})
    np.testing.assert_allclose(np.array(twice), np.array(once), atol=1e-13)


@pytest.mark.parametrize("kind", [cs.SX, cs.MX])
def test_lists_of_symbols_are_taken_for_every_argument(kind: type) -> None:
    """As a list, a tuple, an array of objects, rows of a matrix, with numbers between, and DM as well."""
    kindyn, rng = star("b", "c"), np.random.default_rng(2)
    H, s, v = kind.sym("H", 4, 4), kind.sym("s", 2), kind.sym("v", 6)
    rows = [[H[i, j] for j in range(4)] for i in range(4)]
    values = cs.DM.eye(4), rng.normal(size=2), rng.normal(size=6)
    expected = np.array(kindyn.bias_force(*values, values[1]))
    lists = [
        (rows, [s[0], s[1]], cs.vertsplit(v), (s[0], s[1])),
        (tuple(map(tuple, rows)), (s[0], s[1]), [v[:3], v[3:]], [s]),
        ([cs.horzcat(*row) for row in rows], s, v, np.array([s[0], s[1]], dtype=object)),
    ]
    for arguments in lists:
        function = cs.Function("f", [H, s, v], [kindyn.bias_force(*arguments)])
        np.testing.assert_allclose(np.array(function(*values)), expected, atol=1e-13)
    mixed = kindyn.mass_matrix(np.eye(4), [s[0], 0.3])
    assert isinstance(mixed, kind)
    assert isinstance(kindyn.mass_matrix(np.eye(4), [cs.DM(0.1), 0.3]), cs.DM)
    with pytest.raises(InputError, match=r"'s' has shape \(3, 1\)"):
        kindyn.mass_matrix(np.eye(4), [s[0], s[1], s[0]])


def test_sx_and_mx_together_are_refused_in_one_sentence() -> None:
    kindyn, x, y = star("b", "c"), cs.SX.sym("x", 2), cs.MX.sym("y", 2)
    with pytest.raises(InputError, match="mass_matrix: some arguments are SX and some MX"):
        kindyn.mass_matrix(cs.MX.eye(4), x)
    with pytest.raises(InputError, match="mass_matrix: 's' mixes SX and MX"):
        kindyn.mass_matrix(np.eye(4), [x[0], y[0]])
    with pytest.raises(InputError, match=r"rnea.*: some arguments are SX and some MX"):
        kindyn.rnea(np.eye(4), x, np.zeros(6), x, np.zeros(6), x, {"b": cs.MX.sym("w", 6)})


NUMBERS = [(element, key, counts[-1]) for element, keys in _COUNTS.items() for key, counts in keys.items()]


@pytest.mark.parametrize(("element", "key", "count"), NUMBERS)
@pytest.mark.parametrize("text", ["0,0,1", "0, 0, 0.3", "0;1", "1 2 3 4 5", "", "one", "1_5", "nan"])
def test_numbers_that_are_none_are_named_by_file_element_and_attribute(
    element: str, key: str, count: int, text: str, tmp_path: Path
) -> None:
    """Every attribute of every element that holds numbers, with the texts that other readers may take."""
    others = {name: " ".join("1" * counts[-1]) for name, counts in _COUNTS[element].items() if name != key}
    stated = " ".join(f'{name}="{value}"' for name, value in {**others, key: text}.items())
    extra = {"mimic": ' joint="j"', "mesh": ' filename="m.stl"'}.get(element, "")
    whole, inside = f"<{element} {stated}{extra}/>", {"link": "", "joint": LIMIT}
    if element in ("mass", "inertia"):
        inside["link"] = f"<inertial>{whole}</inertial>"
    elif element in ("box", "cylinder", "sphere", "mesh"):
        inside["link"] = f"<visual><geometry>{whole}</geometry></visual>"
    elif element == "color":
        inside["link"] = (
            f'<visual><geometry><box size="1 1 1"/></geometry><material name="m">{whole}</material></visual>'
        )
    elif element == "origin":
        inside["link"] = f'<inertial>{whole}<mass value="1"/></inertial>'
    else:
        inside["joint"] = whole
    file = tmp_path / "r.urdf"
    file.write_text(robot(link("a"), link("b", inside["link"]), joint("j", "a", "b", inside=inside["joint"])))
    expected = "a finite number" if count == 1 else f"{count} finite numbers"
    with pytest.raises(ModelError) as caught:
        load_tree(file)
    said = str(caught.value)
    assert said.startswith(f"'{file}': {key}=\"{text}\" of <{element}> in '")
    assert f"is not {expected}" in said


def test_a_text_that_is_none_or_holds_what_is_no_character_says_so():
    for empty in ("", " \n\t", "\ufeff"):
        with pytest.raises(ModelError, match=r"^the URDF text is empty; expected a path, or the XML itself$"):
            load_tree(empty)
    with pytest.raises(ModelError, match=r"udc80', which is no character$"):
        load_tree(robot(link("a\udc80")))

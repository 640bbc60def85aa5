"""Nothing of a URDF that is the robot gets lost without a word, in whatever order, encoding or words it is written."""

from __future__ import annotations

from itertools import permutations
from pathlib import Path

import numpy as np
import pytest

from multimodal_to.adam import load_tree
from multimodal_to.adam.inspection import describe
from multimodal_to.cli.common import number_option, option_numbers, whole_number_option
from multimodal_to.errors import InputError, ModelError, ScenarioError
from multimodal_to.files.numbers import number, numbers
from multimodal_to.replay.visuals import PLAIN, appearance
from multimodal_to.scenarios import take_off
from multimodal_to.scenarios.files import change

XACRO = 'xmlns:xacro="http://www.ros.org/wiki/xacro"'
INERTIAL = '<inertial><mass value="1"/><inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial>'
TRUNK = f'<link name="trunk">{INERTIAL}</link>'
LEG = f'<link name="leg">{INERTIAL}</link>'
HIP = '<joint name="hip" type="continuous"><parent link="trunk"/><child link="leg"/><axis xyz="0 1 0"/></joint>'


def robot(*parts: str, more: str = "") -> str:
    return f'<robot name="r" {more}>{"".join(parts)}</robot>'


LOST = {
    "a macro": (robot(TRUNK, '<xacro:leg side="left"/>', more=XACRO), r"<xacro:leg> in <robot>; expand"),
    "an include": (robot(TRUNK, '<xacro:include filename="x"/>', more=XACRO), "<xacro:include> in <robot>"),
    "another prefix": (robot(TRUNK, "<x:if/>", more='xmlns:x="http://ros.org/wiki/xacro"'), "<xacro:if> in <robot>"),
    "no namespace": (robot(TRUNK, "<xacro:leg/>"), "prefix xacro on leg is not defined"),
    "in a link": (robot('<link name="trunk"><xacro:box/></link>', more=XACRO), '<xacro:box> in <link name="trunk">'),
    "in a joint": (
        robot(TRUNK, LEG, HIP.replace("<axis", "<xacro:limits/><axis"), more=XACRO),
        '<xacro:limits> in <joint name="hip">',
    ),
    "in an inertial": (
        robot(TRUNK.replace("<mass", '<xacro:m a="1"/><mass'), more=XACRO),
        '<xacro:m> in <inertial> in <link name="trunk">',
    ),
    **{
        f"in a {part}": (
            robot(TRUNK.replace("</link>", f"<{part}><geometry><xacro:shape/></geometry></{part}></link>"), more=XACRO),
            f'<xacro:shape> in <geometry> in <{part}> in <link name="trunk">',
        )
        for part in ("visual", "collision")
    },
    "a mesh": (
        robot(
            TRUNK.replace("</link>", '<visual><geometry><mesh filename="$(find p)/a.stl"/></geometry></visual></link>')
        ),
        r'filename="\$\(find p\)/a.stl" of <mesh> in <geometry> in <visual> in <link name="trunk">; expand',
    ),
    **{
        f"the attribute {attribute}": (
            robot(TRUNK, LEG, HIP).replace(attribute, f'{attribute.partition("=")[0]}="${{x}}"', 1),
            rf'still holds {attribute.partition("=")[0]}="\$\{{x\}}" of <.*; expand the file with xacro',
        )
        for attribute in ('value="1"', 'ixx="0.1"', 'xyz="0 1 0"', 'type="continuous"', 'link="leg"', 'name="r"')
    },
    "a link's name": (
        robot(TRUNK.replace("trunk", "${prefix}trunk")),
        r'name="\$\{prefix\}trunk" of <link> in <robot>',
    ),
    "a joint's name": (
        robot(TRUNK, LEG, HIP.replace('"hip"', '"$(arg side)_hip"')),
        'name="..arg side._hip" of <joint>',
    ),
    "a child": (robot(TRUNK, LEG, HIP.replace('"leg"', '"${side}_leg"')), r'of <child> in <joint name="hip">'),
    "a capital": (
        robot(TRUNK, LEG.replace("link", "Link"), HIP),
        r'<Link name="leg"> in <robot> is not read; .*<link>',
    ),
    "a group": (robot(TRUNK, f"<group>{LEG}{HIP}</group>"), r'<link name="leg"> in <group> in <robot> is not read'),
    "a mass beside its inertial": (
        robot('<link name="trunk"><mass value="3"/></link>'),
        "expected <mass> in <inertial>",
    ),
    "a link in a link": (robot(TRUNK.replace("</link>", LEG + "</link>")), "expected <link> in <robot>"),
    "an inertial with a capital": (robot(TRUNK, LEG.replace("inertial", "Inertial"), HIP), "<Inertial> in <link"),
    "an axis in a link": (robot('<link name="trunk"><axis xyz="0 0 1"/></link>'), "expected <axis> in <joint>"),
    "an include of another kind": (robot(TRUNK, '<include filename="leg.urdf"/>'), "<include> in <robot> is not read"),
    "a joint of Drake's": (
        robot(TRUNK, LEG, HIP.replace("joint", "drake:joint"), more='xmlns:drake="http://drake.mit.edu"'),
        "<drake:joint name=.hip.> in <robot>",
    ),
    "two inertials": (robot(TRUNK.replace("</link>", INERTIAL + "</link>")), "more than one <inertial>"),
    "two masses": (robot(TRUNK.replace("<mass", '<mass value="2"/><mass')), 'name="trunk"> has more than one <mass>'),
    "two axes": (robot(TRUNK, LEG, HIP.replace("<axis", '<axis xyz="1 0 0"/><axis')), "more than one <axis>"),
}


@pytest.mark.parametrize("case", LOST)
def test_a_part_of_the_robot_that_would_get_lost_is_named(case):
    text, expected = LOST[case]
    for read in (load_tree, describe):
        with pytest.raises(ModelError, match=expected):
            read(text)


def test_a_namespace_that_the_whole_file_stands_in_changes_nothing():
    text = robot(TRUNK, LEG, HIP, more='xmlns="http://www.ros.org" xmlns:drake="http://drake.mit.edu"')
    assert load_tree(text).joint_names == ("hip",)
    assert load_tree(text).total_mass == 2
    with pytest.raises(ModelError, match="xacro:leg"):
        load_tree(robot(TRUNK, "<xacro:leg/>", more=f'xmlns="http://www.ros.org" {XACRO}'))


def test_what_other_programs_read_is_left_alone_and_what_none_is_known_to_read_is_named():
    others = (
        '<gazebo reference="trunk"><sensor name="x"><link name="y"/><xacro:z/></sensor></gazebo>',
        '<transmission name="t"><joint name="hip"/></transmission>',
        '<ros2_control name="c" type="system"><joint name="other"/></ros2_control>',
        '<drake:collision_filter_group name="g" xmlns:drake="http://drake.mit.edu"/>',
    )
    text = robot(TRUNK.replace("</link>", "<colour/><colour/></link>"), LEG, HIP, *others, more=XACRO)
    assert load_tree(text).joint_names == ("hip",)
    said = [str(finding) for finding in describe(text).findings]
    assert "link 'trunk' holds 2 <colour>, which is not known and not read" in said
    assert not any("gazebo" in sentence or "transmission" in sentence for sentence in said)


# ---------------------------------------------------------------- colours


def test_a_colour_defined_in_one_link_is_that_of_its_name_in_every_order(tmp_path: Path):
    def link(name: str, material: str) -> str:
        return (
            f'<link name="{name}">{INERTIAL}<visual><geometry><sphere radius="1"/></geometry>{material}</visual></link>'
        )

    red, blue = (f'<material name="skin"><color rgba="{rgb} 1"/></material>' for rgb in ("1 0 0", "0 0 1"))
    used = '<material name="skin"/>'
    joints = "".join(
        f'<joint name="{child}" type="fixed"><parent link="a"/><child link="{child}"/></joint>' for child in "bc"
    )
    file = tmp_path / "r.urdf"
    cases = (
        ((red, used, used), {"a": (1, 0, 0, 1), "b": (1, 0, 0, 1), "c": (1, 0, 0, 1)}),
        ((used, blue, red), {"a": (0, 0, 1, 1), "b": (0, 0, 1, 1), "c": (1, 0, 0, 1)}),
        ((used, used, used), dict.fromkeys("abc", PLAIN)),
    )
    for materials, expected in cases:
        for order in permutations([link(*pair) for pair in zip("abc", materials, strict=True)]):
            file.write_text(robot(*order, joints), encoding="utf-8")
            assert {visual.link: visual.rgba for visual in appearance(file).visuals} == expected
    for parts in ((blue, link("a", red), link("b", used)), (link("b", used), link("a", red), blue)):
        file.write_text(robot(*parts, joints.partition("</joint>")[0] + "</joint>"), encoding="utf-8")
        colours = {visual.link: visual.rgba for visual in appearance(file).visuals}
        assert colours == {"a": (1, 0, 0, 1), "b": (0, 0, 1, 1)}


# ---------------------------------------------------------------- encodings


@pytest.mark.parametrize("encoding", ["ISO-8859-1", "UTF-8", "UTF-16", "windows-1252"])
def test_names_are_the_same_from_a_text_and_a_file_whatever_encoding_they_declare(tmp_path: Path, encoding: str):
    text = f'<?xml version="1.0" encoding="{encoding}"?>\n' + robot(TRUNK.replace("trunk", "Rumpf-für-ß"))
    file = tmp_path / "r.urdf"
    file.write_bytes(text.encode(encoding))
    for urdf in (text, "\ufeff" + text, file):
        assert list(load_tree(urdf).frames) == ["Rumpf-für-ß"]
        assert describe(urdf).tree.base == "Rumpf-für-ß"


# ---------------------------------------------------------------- numbers

NO_NUMBERS = (
    "1_5",
    "nan",
    "NaN",
    "infinity",
    "-Infinity",
    "inf",
    "0x1p3",
    "0x10",
    "1e",
    "1.5.2",
    "١٥",
    "１",
    "1,5",
    "1\u00a0",
    "",
)


@pytest.mark.parametrize("text", NO_NUMBERS)
def test_only_xmls_numbers_are_numbers(text):
    with pytest.raises(ValueError, match="is no number"):
        number(text)
    for wrong in (
        TRUNK.replace('value="1"', f'value="{text}"'),
        TRUNK.replace('ixx="0.1"', f'ixx="{text}"'),
        TRUNK.replace("<mass", f'<origin xyz="0 0 {text or "x"}"/><mass'),
    ):
        with pytest.raises(ModelError, match=r"in 'trunk' is not (a|3) finite number"):
            load_tree(robot(wrong))
    limited = HIP.replace("<axis", f'<limit effort="{text}" velocity="1"/><axis')
    with pytest.raises(ModelError, match="of <limit> in 'hip' is not a finite number"):
        load_tree(robot(TRUNK, LEG, limited))
    for option in (number_option, whole_number_option, lambda value: option_numbers("--times", f"0;{value}")):
        with pytest.raises(InputError):
            option(text)


def test_xmls_numbers_are_read():
    assert [number(text) for text in ("1", " +1.", "-.5", "1e3", "\n2.5E-1\t", "-INF")] == [
        1,
        1,
        -0.5,
        1000,
        0.25,
        -np.inf,
    ]
    assert numbers(" 1 2\n3 ") == [1, 2, 3]
    limited = HIP.replace("<axis", '<limit effort="INF" velocity="1e1"/><axis')
    (joint,) = load_tree(robot(TRUNK, LEG, limited)).joints
    assert (joint.effort, joint.velocity) == (np.inf, 10)
    assert change(take_off(), ["weights.thrust=.5"]).weights.thrust == 0.5
    for text in ("infinity", "nan", "0x1p3"):
        with pytest.raises(ScenarioError):
            change(take_off(), [f"weights.thrust={text}"])

from __future__ import annotations

import warnings
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trimesh

from multimodal_to import replay
from multimodal_to.adam import KinDynComputations
from multimodal_to.adam.urdf import parse_urdf
from multimodal_to.errors import MultimodalError
from multimodal_to.files.packages import package_file
from multimodal_to.models.proportions import Gait
from multimodal_to.models.robot import JointLimits, Posture, Robot
from multimodal_to.replay import MeshWarning
from multimodal_to.replay.dress import read_dress, zero_poses
from multimodal_to.replay.meshes import Part, find_mesh, load_parts, shaded
from multimodal_to.replay.page import page
from multimodal_to.replay.visuals import FACES, appearance
from multimodal_to.trajectory import QUANTITIES, Trajectory
from multimodal_to.trajectory.derived import frame_poses
from places import example_robots
from synthetic import take_off

IRONCUB = Path(__file__).parents[2] / "robots" / "ironcub"
VISUAL = '<visual><geometry><mesh filename="{}" scale="{}"/></geometry></visual>'
needs_icub = pytest.mark.skipif(
    package_file("icub-models", "iCubGazeboV2_5/model.urdf") is None, reason="icub-models is not installed"
)


@pytest.fixture
def folder(tmp_path):
    """A package `boxes` with a URDF in a folder beside its meshes, and a mesh that is none of its business."""
    package = tmp_path / "share" / "boxes"
    for inside in ("urdf", "meshes"):
        (package / inside).mkdir(parents=True)
    (package / "package.xml").write_text("<package/>")
    box = trimesh.creation.box((0.1, 0.2, 0.3))
    box.export(package / "meshes" / "box.stl")
    box.export(tmp_path / "secret.stl")
    (package / "meshes" / "pointer.stl").write_text("version https://git-lfs.github.com/spec/v1\noid sha256:0\n")
    (package / "meshes" / "broken.stl").write_bytes(b"no mesh at all")
    return package


def urdf(folder: Path, *addresses: str, scale: str = "1 1 1") -> Path:
    path = folder / "urdf" / "robot.urdf"
    visuals = "".join(VISUAL.format(address, scale) for address in addresses)
    path.write_text(f'<robot name="r"><link name="base">{visuals}</link></robot>')
    return path


@pytest.mark.parametrize(
    "address",
    [
        "package://boxes/meshes/box.stl",
        "model://boxes/meshes/box.stl",
        "../meshes/box.stl",
        "package://boxes/urdf/../meshes/box.stl",
        "package://boxes//meshes/box.stl",
        "package:///boxes/meshes/box.stl",
        "package://boxes/meshes//./box.stl",
        "PACKAGE://boxes/meshes/box.stl",
        "package://boxes\\meshes\\box.stl",
        "package://boxes/meshes\\box.stl",
        "..\\meshes\\box.stl",
        "package://boxes/meshes/%62ox.stl",
        "file://../meshes/box.stl",
        "file:../meshes/box.stl",
    ],
)
def test_a_mesh_is_found_however_a_urdf_names_it(folder, address):
    assert find_mesh(address, urdf(folder)) == folder / "meshes" / "box.stl"
    assert find_mesh((folder / "meshes" / "box.stl").as_uri(), urdf(folder)) == folder / "meshes" / "box.stl"


def test_a_mesh_with_an_absolute_address_is_found_wherever_it_is(folder, tmp_path):
    mesh = tmp_path / "secret.stl"
    for address in (mesh.as_uri(), f"file:{mesh}", f"file://localhost{mesh}", str(mesh), f"FILE://{mesh}"):
        assert find_mesh(address, urdf(folder)) == mesh


@pytest.mark.parametrize(
    ("address", "sentence"),
    [
        ("gone.stl", "not found"),
        ("package://boxes/gone.stl", "not found in the folder '{folder}'"),
        ("package://crates/box.stl", "not found: no folder 'crates' holds the URDF, lies beside it or above"),
        ("https://example.org/box.stl", "not found: an address of 'https://', and meshes are read from files"),
        ("file:///etc/hostname", "not found as a mesh: no .stl"),
        ("..\\..\\..\\secret.stl", "leaves the folder of its robot by '..'"),
        ("file://../../../secret.stl", "leaves the folder of its robot by '..'"),
        ("C:\\meshes\\box.stl", "not found"),
    ],
)
def test_the_reason_why_a_mesh_is_not_found_is_true(folder, address, sentence):
    with pytest.raises(MultimodalError) as caught:
        find_mesh(address, urdf(folder))
    assert str(caught.value).startswith(sentence.format(folder=folder))


def test_links_are_followed_as_the_system_does(folder, tmp_path):
    """A workspace that links each file, one that links the folder, and one that links the URDF alone."""
    by_file, by_folder, alone = (tmp_path / name / "boxes" for name in ("by_file", "by_folder", "alone"))
    description = urdf(folder)
    for inside in ("urdf/robot.urdf", "meshes/box.stl", "package.xml"):
        (by_file / inside).parent.mkdir(parents=True, exist_ok=True)
        (by_file / inside).symlink_to(folder / inside)
    by_folder.mkdir(parents=True)
    (by_folder / "model").symlink_to(folder / "urdf")
    (alone / "urdf").mkdir(parents=True)
    (alone / "urdf" / "robot.urdf").symlink_to(description)
    for link in (by_file / "urdf" / "robot.urdf", by_folder / "model" / "robot.urdf", alone / "urdf" / "robot.urdf"):
        for address in ("../meshes/box.stl", "package://boxes/meshes/box.stl"):
            assert find_mesh(address, link).samefile(folder / "meshes" / "box.stl")
        with pytest.raises(MultimodalError, match="leaves the folder of its robot"):
            find_mesh("../../../../secret.stl", link)


# ---------------------------------------------------------------- Collada

POINTS = "0 0 0 1 0 0 0 1 0 1 1 0"
COLLADA = """<?xml version="1.0"?>
<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
<asset><unit meter="1"/><up_axis>Z_UP</up_axis></asset>{materials}
<library_geometries><geometry id="g"><mesh>
<source id="p"><float_array id="a" count="12">{points}</float_array><technique_common>
<accessor source="#a" count="4" stride="3"><param name="X" type="float"/><param name="Y" type="float"/>
<param name="Z" type="float"/></accessor></technique_common></source>
<vertices id="v"><input semantic="POSITION" source="#p"/></vertices>
<{kind} count="{count}" material="m"><input semantic="VERTEX" source="#v" offset="0"/>{indices}</{kind}>
</mesh></geometry></library_geometries>{scene}</COLLADA>"""
SCENE = """<library_visual_scenes><visual_scene id="s"><node id="n"><matrix>1 0 0 0 0 1 0 0 0 0 1 5 0 0 0 1</matrix>
<instance_geometry url="#g">{bound}</instance_geometry></node></visual_scene></library_visual_scenes>
<scene><instance_visual_scene url="#s"/></scene>"""
BOUND = """<bind_material><technique_common><instance_material symbol="m" target="#red"/></technique_common>
</bind_material>"""
RED = """<library_effects><effect id="e"><profile_COMMON><technique sid="c"><lambert><diffuse>{}</diffuse></lambert>
</technique></profile_COMMON></effect></library_effects>
<library_materials><material id="red"><instance_effect url="#e"/></material></library_materials>"""
COLOUR, TEXTURE = "<color>1 0 0 1</color>", '<texture texture="gone-sampler" texcoord="UV"/>'
KINDS = {
    "triangles": (2, "<p>0 1 2 2 1 3</p>"),
    "polylist": (1, "<vcount>4</vcount><p>0 1 3 2</p>"),
    "polygons": (1, "<p>0 1 3 2</p>"),
    "tristrips": (1, "<p>0 1 2 3</p>"),
    "trifans": (1, "<p>0 1 3 2</p>"),
}


def square(folder, kind="triangles", *, scene=SCENE, bound="", materials=""):
    """The parts of a unit square at z = 5, or at 0 without a scene."""
    count, indices = KINDS[kind]
    text = COLLADA.format(
        kind=kind, count=count, indices=indices, points=POINTS, scene=scene.format(bound=bound), materials=materials
    )
    (folder / "meshes" / "square.dae").write_text(text)
    return load_parts("../meshes/square.dae", urdf(folder), np.ones(3))


@pytest.mark.parametrize("kind", KINDS)
def test_every_kind_of_collada_shape_is_read(folder, kind):
    (part,) = square(folder, kind)
    corners = part.vertices[part.faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    np.testing.assert_allclose(normals, [[0, 0, 1], [0, 0, 1]])  # half the square each, and both seen from above
    np.testing.assert_allclose(part.vertices[:, 2], 5)


@pytest.mark.parametrize("materials", [RED.format(TEXTURE), RED.format(COLOUR).replace('url="#e"', 'url="#gone"'), ""])
def test_a_material_that_cannot_be_made_costs_the_colour_and_not_the_shape(folder, materials):
    (part,) = square(folder, bound=BOUND, materials=materials)
    assert len(part.faces) == 2
    (red,) = square(folder, bound=BOUND, materials=RED.format(COLOUR))
    assert red.rgba == (1, 0, 0, 1)


def test_a_collada_file_without_a_scene_shows_all_that_it_holds(folder):
    (part,) = square(folder, scene="")
    np.testing.assert_allclose(part.vertices[:, 2], 0)


def test_the_feet_of_anymal_are_drawn_although_a_texture_is_missing():
    """In three colours, of which one has a texture whose image the file does not declare."""
    description = example_robots() / "anymal_b_simple_description" / "robots" / "anymal.urdf"
    address = "package://example-robot-data/robots/anymal_b_simple_description/meshes/foot/anymal_foot.dae"
    assert address in description.read_text(encoding="utf-8")
    parts = load_parts(address, description, np.ones(3))
    assert sum(len(part.faces) for part in parts) == 4604
    assert len({part.rgba for part in parts}) == 3
    appearance(description)  # warnings are errors


def test_a_package_elsewhere_is_found_through_the_environment(folder, tmp_path, monkeypatch):
    other = tmp_path / "elsewhere" / "robot.urdf"
    other.parent.mkdir()
    with pytest.raises(MultimodalError, match="not found"):
        find_mesh("package://boxes/meshes/none.stl", other)
    monkeypatch.setenv("ROS_PACKAGE_PATH", str(folder.parent))
    assert find_mesh("package://boxes/meshes/box.stl", other) == folder / "meshes" / "box.stl"


@pytest.mark.parametrize(
    "address",
    [
        "package://boxes/../../secret.stl",
        "model://boxes/meshes/../../../secret.stl",
        "../../../secret.stl",
        "package://../secret.stl",
        "file:///etc/hostname",
        "package://boxes/%2e%2e/%2e%2e/secret.stl",
    ],
)
def test_no_path_leaves_its_root(folder, address):
    with pytest.raises(MultimodalError, match=r"leaves the folder of its robot|not found"):
        find_mesh(address, urdf(folder))


def test_one_warning_names_all_meshes_that_cannot_be_drawn_and_why(folder):
    names = ["gone.stl", "../../../secret.stl", "../meshes/pointer.stl", "../meshes/broken.stl", "../meshes/box.stl"]
    with pytest.warns(MeshWarning) as caught:
        found = appearance(urdf(folder, *names)).visuals
    assert [visual.name for visual in found] == ["visual_4"]
    (warning,) = caught
    text = str(warning.message)
    assert text.startswith("4 meshes are not drawn: 'gone.stl': not found; '../../../secret.stl': leaves the folder")
    assert "'../meshes/pointer.stl': a git-LFS pointer" in text
    assert text.endswith("and 1 more")


COLLISION = '<collision><origin xyz="0 0 {z}"/><geometry>{shape}</geometry></collision>'
RED_VISUAL = VISUAL.format("gone.stl", "1 1 1").replace(
    "</visual>", '<material name="m"><color rgba="1 0 0 1"/></material></visual>'
)
BROKEN = ("<box size='1 1 a'/>", "<sphere/>", "<capsule radius='1' length='1'/>", "<box size='1 1'/>")


def with_links(folder, **links: str) -> Path:
    """A URDF of links with these elements in them, each fixed to the first."""
    path, base = folder / "urdf" / "links.urdf", next(iter(links))
    joints = [
        f'<joint name="to_{name}" type="fixed"><parent link="{base}"/><child link="{name}"/></joint>'
        for name in links
        if name != base
    ]
    written = [f'<link name="{name}">{inside}</link>' for name, inside in links.items()]
    path.write_text(f'<robot name="r">{"".join((*written, *joints))}</robot>')
    return path


def test_collision_shapes_stand_in_for_meshes_that_cannot_be_drawn(folder):
    """Where they are and in the visual's colour, once a link; those that cannot be read are left out."""
    shapes = [COLLISION.format(z=0, shape=shape) for shape in BROKEN]
    shapes += [COLLISION.format(z=2, shape='<sphere radius="0.3"/>')]
    shapes += [COLLISION.format(z=3, shape='<mesh filename="../meshes/box.stl" scale="1 1 2"/>')]
    shapes += [COLLISION.format(z=4, shape='<mesh filename="none.stl"/>')]
    other = VISUAL.format("../meshes/broken.stl", "1 1 1")
    path = with_links(folder, base="", foot=RED_VISUAL + other + "".join(shapes), arm=other, whole="".join(shapes))
    with pytest.warns(MeshWarning) as caught:
        ball, box = appearance(path).visuals
    (warning,) = caught
    assert str(warning.message).startswith("2 meshes are not drawn: 'gone.stl': not found; ")
    assert str(warning.message).endswith("; the collision shapes of the link foot stand in")
    assert (ball.link, box.link) == ("foot", "foot")
    assert ball.name != box.name
    assert ball.primitive.sphere.radius == 0.3
    assert (ball.transform[2, 3], box.transform[2, 3]) == (2, 3)
    assert ball.rgba == box.rgba == (1, 0, 0, 1)
    np.testing.assert_allclose(np.ptp(box.part.vertices, axis=0), [0.1, 0.2, 0.6], atol=1e-7)
    (ball,) = appearance(path, meshes=False).visuals
    assert ball.primitive.sphere is not None


def test_a_link_that_can_be_drawn_keeps_its_look_beside_its_collision_shape(folder):
    shape = COLLISION.format(z=0, shape='<sphere radius="0.3"/>')
    (visual,) = appearance(with_links(folder, base=VISUAL.format("../meshes/box.stl", "1 1 1") + shape)).visuals
    assert visual.part is not None


def test_a_mesh_is_scaled_and_its_colour_is_the_urdfs(folder):
    path = urdf(folder, "../meshes/box.stl", scale="2 1 1")
    path.write_text(
        path.read_text().replace("</visual>", '<material name="m"><color rgba="1 0 0 0.5"/></material></visual>')
    )
    (visual,) = appearance(path).visuals
    np.testing.assert_allclose(np.ptp(visual.part.vertices, axis=0), [0.2, 0.2, 0.3], atol=1e-7)
    assert visual.rgba == (1.0, 0.0, 0.0, 0.5)


def test_sharp_edges_stay_sharp_and_round_ones_round():
    box, ball = trimesh.creation.box(), trimesh.creation.icosphere(subdivisions=3)
    corners, _, normals = shaded(Part(vertices=box.vertices, faces=box.faces, rgba=None))
    assert len(corners) == 24
    np.testing.assert_allclose(np.abs(normals).max(axis=1), 1.0, atol=1e-9)
    points, _, normals = shaded(Part(vertices=ball.vertices, faces=ball.faces, rgba=None))
    assert len(points) == len(ball.vertices)
    np.testing.assert_allclose(normals, points, atol=0.02)


@needs_icub
def test_the_icubs_legs_hips_and_torso_coincide_with_the_ironcubs():
    dress = read_dress(IRONCUB)
    ours, theirs = (zero_poses(parse_urdf(path), "root_link") for path in (IRONCUB / "ironcub.urdf", dress.urdf))
    lower = [name for name in ours if name in theirs and any(part in name for part in ("hip", "leg", "ankle", "torso"))]
    assert len(lower) == 14
    for name in lower:
        np.testing.assert_allclose(ours[name], theirs[name], atol=1e-4)


@needs_icub
def test_each_mesh_meets_the_link_that_the_table_names():
    dress = read_dress(IRONCUB)
    ours, other = parse_urdf(IRONCUB / "ironcub.urdf"), parse_urdf(dress.urdf)
    mine, theirs = zero_poses(ours, "root_link"), zero_poses(other, "root_link")
    for garment, placement in zip(dress.garments, dress.placements(ours, other), strict=True):
        mesh = mine[garment.link] @ placement  # root_H_mesh
        np.testing.assert_allclose(mesh[:3, :3], theirs[garment.source][:3, :3], atol=1e-9)
        anchor = mesh @ np.linalg.inv(theirs[garment.source]) @ theirs[garment.at]
        np.testing.assert_allclose(anchor[:3, 3], mine[garment.at][:3, 3], atol=1e-9)


@needs_icub
def test_the_dressed_ironcub_keeps_its_jetpack_and_turbines_and_stands_on_its_soles(ironcub):
    look = appearance(ironcub.urdf)
    names = {(visual.link, visual.part is None) for visual in look.visuals}
    assert ("chest", True) in names
    assert ("chest", False) in names
    assert ("l_ankle_2", True) not in names
    assert sum(visual.link.endswith("turbine") for visual in look.visuals) == 36
    assert sum(len(visual.part.faces) for visual in look.visuals if visual.part is not None) <= 1.01 * FACES
    assert "CC BY-SA 4.0" in look.attribution
    soles = [visual for visual in look.visuals if visual.name.endswith("_foot_mesh_0")]
    home = at_home(ironcub)
    for visual in soles:
        pose = frame_poses(ironcub, home, visual.link)[0] @ visual.transform
        lowest = (visual.part.vertices @ pose[2, :3] + pose[2, 3]).min()
        points = home.contact_positions[2::3, 0]
        assert abs(lowest - points.min()) < 0.005


def test_without_the_package_primitives_serve(ironcub, monkeypatch):
    monkeypatch.setattr("multimodal_to.replay.dress.package_file", lambda package, ending: None)
    look = appearance(ironcub.urdf)
    assert look.attribution == ""
    assert all(visual.part is None for visual in look.visuals)
    assert len(look.visuals) > 90


def at_home(robot: Robot) -> Trajectory:
    """A trajectory in which the robot stands at home."""
    counts = {"robot": 1, "joint": len(robot.joint_names), "contact": len(robot.contacts), "jet": len(robot.jets)}
    arrays = {name: np.zeros((quantity.rows * counts[quantity.of], 2)) for name, quantity in QUANTITIES.items()}
    arrays["base_position"] += robot.home.base_position[:, None]
    arrays["base_quaternion_xyzw"] += robot.home.base_quaternion_xyzw[:, None]
    arrays["joint_positions"] += robot.home.joint_positions[:, None]
    bare = Trajectory(
        robot=robot.name,
        scenario="home",
        time=np.array([0.0, 1.0]),
        joint_names=robot.joint_names,
        contact_names=robot.contact_names,
        jet_names=robot.jet_names,
        **arrays,
    )
    points = [frame_poses(robot, bare, name)[:, :3, 3].T for name in robot.contact_names]
    return replace(
        bare, contact_positions=np.concatenate([np.zeros((0, 2)), *points]), com_position=arrays["base_position"]
    )


@pytest.mark.parametrize("name", ["talos_data/robots/talos_reduced.urdf", "solo_description/robots/solo12.urdf"])
def test_a_robot_of_example_robot_data_replays_with_its_meshes(name, tmp_path):
    path = example_robots() / name
    kindyn = KinDynComputations(path)
    count = len(kindyn.joint_names)
    robot = Robot(
        name=path.stem,
        urdf=path,
        kindyn=kindyn,
        joint_groups={},
        contacts=(),
        friction=0.7,
        jets=(),
        joint_limits=JointLimits(
            lower=np.full(count, -3.0),
            upper=np.full(count, 3.0),
            speed=np.full(count, 9.0),
            effort=np.full(count, 50.0),
        ),
        home=Posture(
            base_position=np.array([0, 0, 1.0]),
            base_quaternion_xyzw=np.array([0, 0, 0, 1.0]),
            joint_positions=np.zeros(count),
        ),
        contact_reach=np.ones(3),
        jet_reach=np.ones(3),
        gait=Gait(lift=0.01, swing=0.65),
    )
    with warnings.catch_warnings():
        warnings.simplefilter("error", MeshWarning)
        look = appearance(path)
        page = replay.write_html(robot, at_home(robot), tmp_path / "robot.html")
    assert sum(visual.part is not None for visual in look.visuals) > 10
    assert page.stat().st_size < 15e6


@needs_icub
def test_the_page_of_the_dressed_ironcub_is_small_enough_to_send(ironcub):
    assert len(page(ironcub, take_off(ironcub))) < 3e6

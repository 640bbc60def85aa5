from __future__ import annotations

import base64
import gzip
import io
import json
import re
from dataclasses import replace

import numpy as np
import pytest
import umsgpack
import yourdfpy

from hopper import hopper
from multimodal_to import children, replay, scenarios
from multimodal_to.errors import InputError, OutputError
from multimodal_to.models.loading import load_robot
from multimodal_to.models.terrain import Stairs
from multimodal_to.models.terrain_mesh import CELL
from multimodal_to.replay import effects, scene
from multimodal_to.replay.bodies import link_paths, link_poses
from multimodal_to.replay.visuals import appearance
from multimodal_to.scenarios.data import to_json
from multimodal_to.scenarios.regions import Box, Wall
from multimodal_to.trajectory import rules
from multimodal_to.trajectory.derived import flight_force, frame_poses
from multimodal_to.trajectory.pushes import KnownPush
from synthetic import DURATION, KNOTS, take_off

quaternion_matrix = scene.meshcat.transformations.quaternion_matrix
quaternion_slerp = scene.meshcat.transformations.quaternion_slerp


@pytest.fixture(scope="module")
def robot():
    return load_robot("ironcub")


@pytest.fixture(scope="module")
def trajectory(robot):
    return take_off(robot)


@pytest.fixture(scope="module")
def page(robot, trajectory, tmp_path_factory):
    path = tmp_path_factory.mktemp("replay") / "replay.html"
    assert replay.write_html(robot, trajectory, path, meshes=False) == path
    return path.read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def stage(page):
    return Stage(page)


def vertices(geometry) -> np.ndarray:
    return np.frombuffer(geometry["data"]["attributes"]["position"]["array"].data, dtype=np.float32).reshape(-1, 3)


class Stage:
    """What the viewer knows after the commands of a page."""

    def __init__(self, page: str) -> None:
        self.content = json.loads(re.search(r"^  const scene = (.*);$", page, re.MULTILINE).group(1))
        (packed,) = re.findall(r'unpack\("([A-Za-z0-9+/=]*)"\)', page)
        parts, content = io.BytesIO(gzip.decompress(base64.b64decode(packed))), self.content
        commands = [umsgpack.unpackb(part) for part in [parts.read(length) for length in content["lengths"]][1:]]
        self.objects = {c["path"]: c["object"] for c in commands if c["type"] == "set_object"}
        self.transforms = {
            c["path"]: np.reshape(c["matrix"], (4, 4)).T for c in commands if c["type"] == "set_transform"
        }
        self.properties = {(c["path"], c["property"]): c["value"] for c in commands if c["type"] == "set_property"}
        (self.animation,) = (c for c in commands if c["type"] == "set_animation")
        self.tracks = {
            (animation["path"], track["name"].lstrip(".")): track["keys"]
            for animation in self.animation["animations"]
            for track in animation["clip"]["tracks"]
        }
        self.rates = {animation["clip"]["fps"] for animation in self.animation["animations"]}

    def find(self, ending: str) -> str:
        """Return the one path of an object or of a node above it that ends so."""
        nodes = {path[: match.end()] for path in self.objects for match in re.finditer(r"[^/]+", path)}
        (path,) = (node for node in nodes if node.endswith(f"/{ending}"))
        return path

    def value(self, path: str, key: str, knot: int) -> np.ndarray:
        if (path, key) in self.tracks:
            return np.array(self.tracks[path, key][knot]["value"])
        return np.array(self.properties[path, key])

    def world(self, path: str, knot: int, part: float = 0.0) -> np.ndarray:
        """Return the pose of a node at a knot, or a part of the way to the next, from all nodes above it."""
        pose = np.eye(4)
        for match in list(re.finditer(r"[^/]+", path))[2:]:
            pose = pose @ self._local(path[: match.end()], knot, part)
        return pose

    def _local(self, path: str, knot: int, part: float) -> np.ndarray:
        if path in self.transforms:
            return self.transforms[path]
        after = min(knot + 1, KNOTS)
        pose = np.eye(4)
        if (path, "quaternion") in self.tracks or (path, "quaternion") in self.properties:
            turns = [np.roll(self.value(path, "quaternion", k), 1) for k in (knot, after)]
            pose = quaternion_matrix(quaternion_slerp(*turns, part))
            places = [self.value(path, "position", k) for k in (knot, after)]
            pose[:3, 3] = (1 - part) * places[0] + part * places[1]
        return pose


def test_a_fall_is_marked_when_it_was_and_one_after_the_end_at_the_end(trajectory):
    plan = replace(trajectory, time=trajectory.time + 3.0)
    assert replay.mark_of_fall(plan, None) == {}
    assert replay.mark_of_fall(plan, 0.5) == {3.5: "it fell"}
    late = replay.mark_of_fall(plan, plan.duration + 0.4)
    assert late == {3.0 + plan.duration: "it fell 0.4 s after the end"}


def test_another_motion_is_drawn_with_the_first_in_step_and_faint(robot, trajectory, tmp_path):
    later = replace(trajectory, time=2.0 * trajectory.time + 3.0, base_position=trajectory.base_position + 0.1)
    path = replay.write_html(robot, trajectory, tmp_path / "both.html", ghost=later, meshes=False)
    text = path.read_text(encoding="utf-8")
    both = Stage(text)
    own, ghost = ("/meshcat/robot/root_link", "/meshcat/ghost/robot/root_link")
    for knot in (0, 10, KNOTS):  # the ghost takes twice as long, so it is half as far
        expected = frame_poses(robot, later, "root_link")[knot // 2]
        np.testing.assert_allclose(both.world(ghost, knot), expected, atol=1e-6)
        np.testing.assert_allclose(both.world(own, knot), frame_poses(robot, trajectory, "root_link")[knot], atol=1e-6)
    opacity = {path: object["materials"][0]["opacity"] for path, object in both.objects.items() if "visual_" in path}
    assert {value for path, value in opacity.items() if "/ghost/" in path} == {0.35}
    assert {value for path, value in opacity.items() if "/ghost/" not in path} == {1.0}
    assert f"faint, and its line: {later.scenario}" in text.replace("&amp;", "&")


def test_a_motion_of_another_robot_is_no_ghost(robot, trajectory, tmp_path):
    stranger = replace(trajectory, robot="stranger")
    with pytest.raises(InputError, match="with it is for another robot: 'stranger'; expected 'ironcub'"):
        replay.write_html(robot, trajectory, tmp_path / "both.html", ghost=stranger)


def test_the_page_fetches_nothing(page):
    without_viewer = re.sub(r'unpack\("[A-Za-z0-9+/=]*"\)', "", page)  # nor has it the scene
    assert len(without_viewer) < 0.2 * len(page)
    assert "http" not in without_viewer
    assert not re.search(r"(src|action)\s*=", without_viewer)
    assert re.findall(r'href="([^"]*)"', without_viewer) == ["data:,"]
    assert not re.search(r"fetch|@import|url\(|WebSocket|\.connect\(", without_viewer)


def test_the_page_names_scenario_and_robot_and_stays_small(page, trajectory):
    assert f"<title>take-off &amp; hover · {trajectory.robot}</title>" in page
    assert len(page.encode()) < 2e6


def test_every_visual_of_every_link_is_drawn(robot, stage):
    urdf = yourdfpy.URDF.load(str(robot.urdf), build_scene_graph=False, load_meshes=False)
    visuals = {link.name: len(link.visuals) for link in urdf.robot.links if link.visuals}
    assert len(visuals) >= 24
    for name, count in visuals.items():
        for index in range(count):
            assert any(path.endswith(f"/{name}/visual_{index}") for path in stage.objects)


def test_the_animation_runs_from_the_first_knot_to_the_last_at_true_speed_and_repeats(stage, trajectory):
    assert stage.rates == {1}
    assert stage.animation["options"] == {"play": True, "repetitions": np.inf}
    for keys in stage.tracks.values():
        times = [key["time"] for key in keys]
        np.testing.assert_allclose(times[:-1], trajectory.time, atol=1e-12)
        assert times[-1] == pytest.approx(DURATION + scene.HOLD)
        assert keys[-1]["value"] == keys[-2]["value"]


@pytest.mark.parametrize("link", ["root_link", "head", "l_elbow_1", "r_ankle_2", "chest_l_jet_turbine"])
def test_links_are_where_forward_kinematics_puts_them_at_the_knots(robot, trajectory, stage, link):
    poses, path = frame_poses(robot, trajectory, link), stage.find(link)
    for knot in range(KNOTS + 1):
        np.testing.assert_allclose(stage.world(path, knot), poses[knot], atol=1e-9)


def test_between_two_knots_every_joint_moves_linearly(robot, trajectory, stage):
    half_way = {
        name: np.repeat((getattr(trajectory, name)[:, 12:13] + getattr(trajectory, name)[:, 13:14]) / 2, KNOTS + 1, 1)
        for name in ("base_position", "base_quaternion_xyzw", "joint_positions")
    }
    for link in ("head", "r_elbow_1", "l_ankle_2"):
        expected = frame_poses(robot, replace(trajectory, **half_way), link)[0]
        np.testing.assert_allclose(stage.world(stage.find(link), 12, 0.5), expected, atol=1e-9)


def test_quaternions_never_change_sign_between_keys(stage):
    tracks = [keys for (_, key), keys in stage.tracks.items() if key == "quaternion"]
    assert len(tracks) > 20
    for keys in tracks:
        values = np.array([key["value"] for key in keys])
        assert (np.sum(values[1:] * values[:-1], axis=1) > 0).all()
        np.testing.assert_allclose(np.linalg.norm(values, axis=1), 1.0, atol=1e-9)


def test_a_flame_is_as_long_as_its_thrust_is_large_and_has_no_length_without_thrust(robot, trajectory, stage):
    strongest = max(jet.thrust_max for jet in robot.jets)
    for jet, thrust in zip(robot.jets, trajectory.thrust, strict=True):
        path = stage.find(f"{jet.frame}/flame")
        lengths = np.array([stage.value(path, "scale", knot)[2] for knot in range(KNOTS + 1)])
        assert thrust[0] == 0.0
        assert lengths[0] == 0.0
        np.testing.assert_allclose(lengths, effects.FLAME_LENGTH * thrust / strongest, atol=1e-12)


def test_a_jet_that_never_burns_has_a_hidden_flame(robot, trajectory, tmp_path):
    cold = replace(trajectory, thrust=np.zeros_like(trajectory.thrust))
    stage = Stage(replay.write_html(robot, cold, tmp_path / "cold.html", meshes=False).read_text())
    for jet in robot.jets:
        assert stage.properties[stage.find(f"{jet.frame}/flame"), "visible"] is False


def test_exhaust_leaves_along_plus_z_of_the_jet_frame(stage):
    for path in (path for path in stage.objects if path.endswith("/flame/plume")):
        (plume,) = stage.objects[path]["geometries"]
        points = vertices(plume)
        assert points[:, 2].min() == 0.0
        assert points[:, 2].max() == 1.0
        width = np.linalg.norm(points[:, :2], axis=1)
        assert width[points[:, 2] > 0.95].max() < 0.3 * width.max()
        assert path not in stage.transforms or np.array_equal(stage.transforms[path], np.eye(4))


def test_a_flame_is_the_brighter_the_more_of_its_thrust_a_jet_gives(robot, trajectory, stage):
    for jet, thrust in zip(robot.jets, trajectory.thrust, strict=True):
        keys = stage.tracks[f"{stage.find(f'{jet.frame}/flame')}/plume/<object>", "material.opacity"]
        opacity = np.array([key["value"] for key in keys[:-1]])
        slope, faintest = np.polyfit(thrust / jet.thrust_max, opacity, 1)
        np.testing.assert_allclose(opacity, faintest + slope * thrust / jet.thrust_max, atol=1e-12)
        assert slope > 2 * faintest > 0


def test_arrows_start_at_the_contact_points_and_point_along_the_forces(robot, trajectory, stage):
    points, forces = trajectory.per_contact("contact_positions"), trajectory.per_contact("contact_forces")
    for name, point, force in zip(trajectory.contact_names, points, forces, strict=True):
        path = stage.find(f"contact_forces/{name}")
        for knot in range(KNOTS + 1):
            pose, size = stage.world(path, knot), np.linalg.norm(force[:, knot])
            np.testing.assert_allclose(pose[:3, 3], point[:, knot], atol=1e-9)
            length = stage.value(path, "scale", knot)[2]
            if size > flight_force(robot):
                np.testing.assert_allclose(pose[:3, 2], force[:, knot] / size, atol=1e-9)
                assert length == pytest.approx(effects.ARROW_LENGTH * size / robot.weight)
            else:
                assert length == 0.0
        visible = [stage.value(path, "visible", knot) for knot in range(KNOTS + 1)]
        assert visible[0]
        assert not any(visible[KNOTS // 2 :])


def test_an_arrow_by_leapfrog_is_the_force_of_its_knot(robot, trajectory, tmp_path):
    motion = replace(trajectory, rule=rules.LEAPFROG)
    shown = Stage(replay.write_html(robot, motion, tmp_path / "l.html", meshes=False).read_text(encoding="utf-8"))
    name, force = trajectory.contact_names[0], trajectory.per_contact("contact_forces")[0]
    for knot in range(5):
        expected = effects.ARROW_LENGTH * np.linalg.norm(force[:, knot]) / robot.weight
        assert shown.value(shown.find(f"contact_forces/{name}"), "scale", knot)[2] == pytest.approx(expected)


def test_an_arrow_at_a_knot_is_the_mean_of_the_intervals_that_meet_there_in_an_older_file(robot, trajectory, tmp_path):
    staggered = replace(trajectory, rule=rules.STAGGERED)
    shown = Stage(replay.write_html(robot, staggered, tmp_path / "s.html", meshes=False).read_text(encoding="utf-8"))
    name, force = trajectory.contact_names[0], trajectory.per_contact("contact_forces")[0]
    for knot in range(5):
        expected = effects.ARROW_LENGTH * np.linalg.norm(force[:, knot : knot + 2].mean(axis=1)) / robot.weight
        assert shown.value(shown.find(f"contact_forces/{name}"), "scale", knot)[2] == pytest.approx(expected)


def test_an_arrow_can_point_straight_down_or_sideways():
    vectors = np.array([[0.0, 0.0, -50.0], [30.0, 0.0, 0.0], [0.0, -2.0, 0.0], [1e-9, 0.0, -9.0], [0.0, 0.0, 0.0]])
    for vector, (x, y, z, w) in zip(vectors, scene.turns_from_z(vectors, 1.0), strict=True):
        direction = quaternion_matrix([w, x, y, z])[:3, 2]
        expected = vector / np.linalg.norm(vector) if vector.any() else [0.0, 0.0, 1.0]
        np.testing.assert_allclose(direction, expected, atol=1e-6)


def test_the_sphere_follows_the_com(trajectory, stage):
    for knot in (0, 7, KNOTS):
        np.testing.assert_allclose(stage.value("/meshcat/com", "position", knot), trajectory.com_position[:, knot])


def test_the_way_of_the_com_is_a_thin_tube_about_it_that_shines_through_the_robot(robot, trajectory, stage, tmp_path):
    (tube,) = stage.objects[stage.find("com_trace/outside")]["geometries"]
    points, way = vertices(tube), trajectory.com_position.T
    away = np.linalg.norm(np.cross(points - way[0], way[-1] - way[0]), axis=1) / np.linalg.norm(way[-1] - way[0])
    np.testing.assert_allclose(away, effects._TRACE_RADIUS, atol=1e-6)  # this CoM moves along a line
    assert (points[:, 2].min(), points[:, 2].max()) == pytest.approx((way[0, 2], way[-1, 2]), abs=1e-4)
    (material,) = stage.objects[stage.find("com_trace/within")]["materials"]
    assert material["depthTest"] is False
    resting = replace(trajectory, com_position=np.repeat(trajectory.com_position[:, :1], KNOTS + 1, axis=1))
    page = replay.write_html(robot, resting, tmp_path / "resting.html", meshes=False)
    assert not any("com_trace" in path for path in Stage(page.read_text(encoding="utf-8")).objects)


def test_the_drawn_robot_looks_where_its_toes_point_and_carries_the_jets_on_its_back(robot, trajectory, stage):
    toes_forward = frame_poses(robot, trajectory, "l_ankle_2")[0][:3, 0]
    knot_poses = {name: frame_poses(robot, trajectory, name)[0] for name in ("head", "chest", "chest_l_jet_turbine")}
    red = 0xCC1F1A
    (mouth,) = (
        path
        for path, thing in stage.objects.items()
        if "/head/visual_" in path and thing["materials"][0]["color"] == red
    )
    mouth_from_head = stage.world(mouth, 0)[:3, 3] - knot_poses["head"][:3, 3]
    jet_from_chest = knot_poses["chest_l_jet_turbine"][:3, 3] - knot_poses["chest"][:3, 3]
    assert mouth_from_head @ toes_forward > 0.03
    assert jet_from_chest @ toes_forward < -0.03


def test_a_robot_without_jets_is_drawn_without_flames(robot, trajectory, tmp_path):
    none = np.zeros((0, trajectory.time.size))
    walker = replace(trajectory, jet_names=(), thrust=none, thrust_rate=none, thrust_acceleration=none, throttle=none)
    stage = Stage(
        replay.write_html(replace(robot, jets=()), walker, tmp_path / "walker.html", meshes=False).read_text()
    )
    assert stage.find("chest_l_jet_turbine")
    assert not any("flame" in path for path in stage.objects)


def test_a_page_that_cannot_be_written_says_where(robot, trajectory, tmp_path):
    with pytest.raises(OutputError, match="nowhere"):
        replay.write_html(robot, trajectory, tmp_path / "nowhere" / "replay.html", meshes=False)


def test_the_live_viewer_serves_the_same_scene_without_a_word(robot, trajectory, stage, capfd):
    visualizer = replay.serve(robot, trajectory, meshes=False)
    try:
        assert visualizer.url().startswith("http://127.0.0.1:")
        served = visualizer.static_html()
    finally:
        window = visualizer.window
        window.zmq_socket.close()
        children.end(window.server_proc)
    assert served.count("fetch(") >= len(stage.objects)
    captured = capfd.readouterr()
    assert captured.out == captured.err == ""


def test_ground_that_is_not_flat_is_drawn_as_a_patch_on_its_surface(robot, trajectory, tmp_path):
    stairs = Stairs(edges=(0.3,), heights=(0.0, 0.1), direction=(-1.0, 0.0))
    kept = to_json(replace(scenarios.take_off(), surface=stairs))
    path = replay.write_html(robot, replace(trajectory, scenario_json=kept), tmp_path / "stairs.html")
    stage = Stage(path.read_text(encoding="utf-8"))
    assert not [path for path in stage.objects if path.endswith(("ground/disc", "ground/grid"))]
    (treads,), (risers,) = (
        stage.objects[stage.find(f"ground/{name}")]["geometries"] for name in ("terrain", "steep_terrain")
    )
    heights = vertices(treads)[:, 2]
    assert np.unique(heights.round(6)) == pytest.approx([0.0, 0.1], abs=1e-6)
    assert np.ptp(vertices(risers)[:, 0]) < 2.1 * CELL


@pytest.mark.parametrize(("heights", "side"), [((0.0, 0.1), 1.0), ((0.1, 0.0), -1.0), ((0.0, 0.0), -1.0)])
def test_the_camera_stands_where_the_ground_hides_no_step(robot, trajectory, tmp_path, heights, side):
    stairs = Stairs(edges=(0.3,), heights=heights, direction=(-1.0, 0.0))
    kept = to_json(replace(scenarios.take_off(), surface=stairs))
    path = replay.write_html(robot, replace(trajectory, scenario_json=kept), tmp_path / "p.html", meshes=False)
    x, _, _ = Stage(path.read_text(encoding="utf-8")).value("/Cameras/default/rotated/<object>", "position", 0)
    assert x * side > 0.5


NAMES = {"body": "robot", "left_wing": "robot/left", "left_jet": "left", "right_wing": "visual_0", "right_jet": "flame"}


def test_links_are_in_their_place_whatever_they_are_called(tmp_path):
    """With slashes, as the scene's own nodes, and as each other's ways: no two share a node, and none is lost."""
    hopper(tmp_path)
    for file in (tmp_path / "hopper.urdf", tmp_path / "robot.toml"):
        text = file.read_text(encoding="utf-8")
        for old, new in NAMES.items():
            text = text.replace(f'"{old}"', f'"{new}"')
        box = '<visual><geometry><box size="1 1 1"/></geometry></visual><inertial>'
        file.write_text(text.replace("<inertial>", box), encoding="utf-8")
    robot = load_robot(tmp_path)
    motion, look = take_off(robot), appearance(robot.urdf)
    paths = link_paths(robot, look, "robot")
    assert set(paths) == set(NAMES.values())
    poses = link_poses(robot, motion, paths)
    at = {paths[name]: pose for name, pose in poses.items()}
    drawn = [f"{paths[visual.link]}/{visual.name}" for visual in look.visuals]
    drawn += [f"{paths[jet.frame]}/flame" for jet in robot.jets]
    assert len({*drawn, *at}) == len(drawn) + len(NAMES)
    for name, path in paths.items():
        parts = path.split("/")
        world = np.eye(4)
        for length in range(2, len(parts) + 1):
            world = world @ at["/".join(parts[:length])]
        np.testing.assert_allclose(world, frame_poses(robot, motion, name), atol=1e-9)


def test_what_the_task_says_of_pushes_walls_and_boxes_is_drawn(robot, trajectory, tmp_path):
    """An arrow ends where the push acts, while it acts; a box is seen over its stretch; a wall is in its plane."""
    push = KnownPush(of="chest", force=(0.0, 60.0, 0.0), begin=0.25, end=0.5)
    wall, box = Wall(normal=(0.0, -3.0, 0.0), offset=-0.8), Box(lower=(0.3, 0.0, 0.0), upper=(0.5, 0.4, 0.2), begin=0.5)
    task = replace(scenarios.take_off(), pushes=(push,), walls=(wall,), boxes=(box,))
    path = replay.write_html(
        robot, replace(trajectory, scenario_json=to_json(task)), tmp_path / "task.html", meshes=False
    )
    text = path.read_text(encoding="utf-8")
    shown = Stage(text)
    assert "push from outside" in text
    assert "wall or box of the task" in text
    arrow, acts = shown.find("pushes/0"), list(push.knots(KNOTS, trajectory.rule))
    at, length = frame_poses(robot, trajectory, "chest")[:, :3, 3], effects.ARROW_LENGTH * 60.0 / robot.weight
    for knot in range(KNOTS + 1):
        scale = shown.value(arrow, "scale", knot)[2]
        assert scale == pytest.approx(length if knot in acts else 0.0)
        if knot in acts:
            end = shown.world(arrow, knot)[:3, 3] + scale * shown.world(arrow, knot)[:3, 2]
            np.testing.assert_allclose(end, at[knot], atol=1e-6)
    faces = {index: shown.transforms[shown.find(f"regions/{index}/faces")] for index in (0, 1)}
    assert faces[0][:3, 2] == pytest.approx([0.0, -1.0, 0.0])
    assert faces[0][1, 3] == pytest.approx(0.8, abs=0.002)
    assert faces[1][:3, 3] == pytest.approx([0.4, 0.2, 0.1])
    seen = [bool(shown.value(shown.find("regions/1"), "visible", knot)) for knot in (0, KNOTS // 4, KNOTS)]
    assert seen == [False, False, True]

"""What a person sees: the pages in a headless Chromium with networking off, and the pictures taken there."""

from __future__ import annotations

import io
import time
from dataclasses import replace

import numpy as np
import pytest
from PIL import Image

from multimodal_to import replay, scenarios
from multimodal_to.errors import InputError, OutputError, TrajectoryError
from multimodal_to.models.terrain import Stairs
from multimodal_to.replay.browser import find_browser, open_browser
from multimodal_to.scenarios.data import to_json
from synthetic import DURATION, LIFT_OFF, take_off

needs_browser = pytest.mark.skipif(find_browser() is None, reason="no Chromium or Chrome is installed")


@pytest.fixture(scope="module")
def trajectory(ironcub):
    return take_off(ironcub)


@pytest.fixture(scope="module")
def shown(ironcub, trajectory, tmp_path_factory):
    if find_browser() is None:
        pytest.skip("no Chromium or Chrome is installed")
    page = replay.write_html(ironcub, trajectory, tmp_path_factory.mktemp("page") / "replay.html")
    assert page.stat().st_size < 3e6
    with open_browser((500, 400)) as browser:
        browser.open(page)
        browser.evaluate("replay.run(false)")  # drawing without end takes a processor
        yield browser


def image(browser) -> np.ndarray:
    return np.asarray(Image.open(io.BytesIO(browser.picture())).convert("RGB"), dtype=float)


def test_the_page_opens_without_a_network_and_without_an_error(shown):
    assert [address.partition(":")[0] for address in shown.requests] == ["file"]
    assert shown.errors == []


def test_the_scene_holds_every_body_of_the_robot(shown, ironcub):
    shown.evaluate("""names = [], replay.viewer.scene_tree.find(["meshcat", "robot"]).object
        .traverse(node => { if (node.type === "Group" || node.children.length) names.push(node.name); }), true""")
    names = set(shown.evaluate("names"))
    assert {"root_link", "chest", "head", "l_ankle_2", "r_elbow_1", "l_arm_jet_turbine"} <= names
    assert {body.name for body in ironcub.kindyn.tree.bodies} <= names


def test_it_plays_by_itself_at_true_speed_and_moves_the_slider(shown):
    shown.evaluate("replay.show(0)")
    shown.evaluate("document.querySelector('.loop').checked = false")
    shown.evaluate("replay.run(true)")
    start = time.monotonic()
    while not shown.evaluate("replay.state.time > 0.4"):
        assert time.monotonic() - start < 60.0
    ran = shown.evaluate("""new Promise(done => requestAnimationFrame(first => {
        const from = replay.state.time;
        const look = now => now - first < 500 ? requestAnimationFrame(look)
            : requestAnimationFrame(last => done([(last - first) / 1000, replay.state.time - from]));
        requestAnimationFrame(look);
    }))""")
    assert shown.evaluate("Number(document.querySelector('.time').value)") > 0.4
    if shown.evaluate("replay.state.playing"):  # a slow machine may have come to the end
        assert ran[1] == pytest.approx(ran[0], rel=0.25)


def test_without_loop_it_stops_at_the_end_and_play_starts_again(shown):
    shown.evaluate(f"document.querySelector('.loop').checked = false, replay.seek({DURATION - 0.05}), replay.run(true)")
    start = time.monotonic()
    while shown.evaluate("replay.state.playing"):
        assert time.monotonic() - start < 60.0
    assert shown.evaluate("replay.state.time") == pytest.approx(DURATION)
    shown.evaluate("document.querySelector('.play').click()")
    assert shown.evaluate("replay.state.playing")
    assert shown.evaluate("replay.state.time") < DURATION


def test_the_slider_moves_the_robot_and_flames_follow_the_thrust(shown, trajectory):
    def at(instant):
        shown.evaluate(f"slider = document.querySelector('.time'), slider.value = {instant}, slider.oninput()")
        return shown.evaluate("""(() => {
            let base = replay.viewer.scene_tree.find(["meshcat", "robot", "root_link"]).object, flame = 0;
            base.traverse(node => {
                if (node.name === "flame" && node.visible) flame = Math.max(flame, node.scale.z);
            });
            return [...base.position.toArray(), flame];
        })()""")

    for knot in (0, 5, 20):
        x, y, z, flame = at(trajectory.time[knot])
        np.testing.assert_allclose([x, y, z], trajectory.base_position[:, knot], atol=1e-6)
        assert (flame > 0.05) == (knot > 0)
    assert not shown.evaluate("replay.state.playing")


def test_pictures_differ_between_ground_and_flight(shown):
    shown.evaluate("replay.show(0)")
    ground = image(shown)
    shown.evaluate(f"replay.show({DURATION})")
    assert np.abs(image(shown) - ground).mean() > 1.0


@needs_browser
def test_snapshots_hold_ghosts_side_by_side_and_a_gif_runs_at_true_speed(ironcub, trajectory, tmp_path):
    picture = replay.write_snapshots(
        ironcub, trajectory, tmp_path / "s.png", times=[0.0, 1.0, 2.0], size=(300, 150), meshes=False
    )
    with Image.open(picture) as still:
        assert still.size == (300, 150)
    path, durations = (
        replay.write_gif(ironcub, trajectory, tmp_path / "f.gif", rate=3.0, size=(200, 160), meshes=False),
        [],
    )
    with Image.open(path) as film:
        for index in range(film.n_frames):
            film.seek(index)
            durations.append(film.info["duration"])
    assert len(durations) == 7
    assert sum(durations[:-1]) == pytest.approx(1000 * DURATION, abs=10)


@needs_browser
def test_an_mp4_runs_at_true_speed(ironcub, trajectory, tmp_path):
    ffmpeg = pytest.importorskip("imageio_ffmpeg")
    film = replay.write_mp4(ironcub, trajectory, tmp_path / "f.mp4", rate=4.0, size=(200, 160), meshes=False)
    frames, seconds = ffmpeg.count_frames_and_secs(str(film))
    assert (frames, seconds) == (13, pytest.approx(DURATION + 1.25, abs=0.05))


def test_without_a_browser_one_sentence_says_what_to_install(ironcub, trajectory, tmp_path, monkeypatch):
    monkeypatch.setenv("PATH", "")
    monkeypatch.delenv("CHROME_PATH", raising=False)
    with pytest.raises(OutputError, match="apt-get install chromium"):
        replay.write_gif(ironcub, trajectory, tmp_path / "f.gif", meshes=False)
    assert list(tmp_path.iterdir()) == []


def test_bad_times_and_rates_are_refused_before_anything_is_drawn(ironcub, trajectory, tmp_path):
    for times in ([5.0], [1.0, 0.5], []):
        with pytest.raises(InputError):
            replay.write_snapshots(ironcub, trajectory, tmp_path / "s.png", times=times, meshes=False)
    with pytest.raises(InputError, match="frame rate is 0"):
        replay.write_gif(ironcub, trajectory, tmp_path / "f.gif", rate=0.0, meshes=False)
    assert list(tmp_path.iterdir()) == []


def test_snapshots_are_taken_where_flight_begins_by_default(ironcub, trajectory):
    times = replay.snapshot_times(ironcub, trajectory)
    assert LIFT_OFF in times
    assert times[0] == 0.0
    assert times[-1] == DURATION


def test_ghosts_that_climb_stand_side_by_side_and_need_no_room_along_their_way(ironcub, trajectory):
    stairs = Stairs(edges=(0.3,), heights=(0.0, 0.1), direction=(-1.0, 0.0))
    kept = to_json(replace(scenarios.take_off(), surface=stairs))
    com = trajectory.com_position.copy()
    com[0] = -0.5 * trajectory.time
    walking = replace(trajectory, scenario_json=kept, com_position=com)
    np.testing.assert_allclose(replay.snapshot_times(ironcub, walking), [0.0, 0.5, 1.0, 1.5, DURATION])


@needs_browser
def test_a_replay_plays_in_the_frame_of_a_notebook(ironcub, trajectory, tmp_path):
    cell = trajectory.show(ironcub, meshes=False, height=300)
    (tmp_path / "notebook.html").write_text(
        f"<!DOCTYPE html><body>{cell._repr_html_()}<script>let replay = {{}};</script></body>", encoding="utf-8"
    )
    with open_browser((600, 400)) as browser:
        browser.open(tmp_path / "notebook.html")
        inside = "document.querySelector('iframe').contentWindow.eval"
        start = time.monotonic()
        while not browser.evaluate(f"{inside}('typeof replay === \"object\" && replay.state.time > 0.1')"):
            assert time.monotonic() - start < 60.0
        height = browser.evaluate(f"{inside}('replay.viewer.renderer.domElement.clientHeight')")
        assert height == 300
        assert browser.errors == []


def test_a_notebook_shows_a_motion_of_a_bundled_robot_without_being_given_the_robot(ironcub, trajectory):
    found, asked = trajectory.show(meshes=False), replay.show(ironcub, trajectory, meshes=False)
    scene = [cell.page.split("const scene = ")[1].splitlines()[0] for cell in (found, asked)]
    assert scene[0] == scene[1]
    with pytest.raises(TrajectoryError, match="is not bundled"):
        replace(trajectory, robot="../ironcub").show()


def test_a_frame_without_height_is_refused(ironcub, trajectory):
    with pytest.raises(InputError, match="height of the frame is 0"):
        replay.show(ironcub, trajectory, meshes=False, height=0)

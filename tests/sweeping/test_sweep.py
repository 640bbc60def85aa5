from __future__ import annotations

import base64
import csv
import json
import os
import re
import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import multimodal_to as mt
from multimodal_to.errors import InputError, ModelError, OutputError, ScenarioError
from multimodal_to.scenarios.data import from_dict
from multimodal_to.sweeping import Design, engines, plan, read_design
from multimodal_to.sweeping import sweep as sweeping
from multimodal_to.sweeping.engines import Ended, Processes
from multimodal_to.sweeping.folder import Folder
from multimodal_to.sweeping.ordering import origins
from multimodal_to.sweeping.plan import Order, facts
from multimodal_to.sweeping.report import verdict, write_sweep_report
from multimodal_to.sweeping.sweep import ATTEMPTS, Counts, counted
from multimodal_to.sweeping.variants import variant
from multimodal_to.trajectory import Trajectory
from places import EXAMPLES
from synthetic import take_off

SWEEP = """
scenario = "take-off"
[settings]
knots = 6
terminal = "standing"
jets = false
interval_max = 0.2
[grid]
final_com_height = { from = 0.53, to = 0.56, count = 3 }
"robot.mass" = [0.98, 1.02]
"""
sweeping_module = sys.modules["multimodal_to.sweeping.sweep"]
TIMES = ("seconds", "solve_seconds", "cpu_seconds", "attempts")


@pytest.fixture
def file(tmp_path):
    path = tmp_path / "sweep.toml"
    path.write_text(SWEEP, encoding="utf-8")
    return path


def lasting(folder):
    """All rows of a sweep, without what depends on the machine's load."""
    kept = Folder(path=folder)
    design, _ = counted(folder)
    return [{key: value for key, value in row.items() if key not in TIMES} for row in kept.rows(design.count)]


def workers_of(driver):
    """Return the workers that a process has started."""
    try:
        children = Path(f"/proc/{driver}/task/{driver}/children").read_text().split()
        commands = {int(pid): Path(f"/proc/{pid}/cmdline").read_bytes() for pid in children}
    except OSError:  # one has just gone
        return []
    return [pid for pid, command in commands.items() if b"sweeping.worker" in command]


def started(file, folder, workers=2):
    return subprocess.Popen(
        [sys.executable, "-m", "multimodal_to", "sweep", str(file), "-o", str(folder), "--workers", str(workers)],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
    )


def wait_for(condition, timeout=240.0):
    end = time.monotonic() + timeout
    while not condition():
        assert time.monotonic() < end, "nothing happened"
        time.sleep(0.02)


@pytest.mark.skipif(sys.platform != "linux", reason="looks for processes in /proc")
def test_a_sweep_survives_kills_of_its_workers_and_its_driver_with_nothing_lost_and_nothing_twice(file, tmp_path):
    calm, rough = tmp_path / "calm", tmp_path / "rough"
    counts = mt.sweep(file, calm, workers=1)
    assert (counts.total, counts.done) == (6, 6)
    written = {}

    def rows():
        return sorted((rough / "rows").rglob("*.json")) if (rough / "rows").exists() else []

    for kill in ("worker", "driver", "worker"):
        driver = started(file, rough)
        before = len(rows())
        wait_for(lambda driver=driver: driver.poll() is not None or workers_of(driver.pid))
        if kill == "worker":
            for pid in workers_of(driver.pid)[:1]:
                os.kill(pid, signal.SIGKILL)
            wait_for(lambda driver=driver, before=before: driver.poll() is not None or len(rows()) > before)
        workers = workers_of(driver.pid)
        driver.kill()
        driver.wait()
        driver.stderr.close()
        wait_for(lambda workers=workers: not any(os.path.exists(f"/proc/{pid}") for pid in workers), timeout=20.0)
        for path in written:  # what was done is not done again
            assert path.stat().st_mtime_ns == written[path]
        written |= {path: path.stat().st_mtime_ns for path in rows()}
    counts = mt.sweep(file, rough, workers=2)
    assert counts.done == 6
    for path in written:
        assert path.stat().st_mtime_ns == written[path]
    assert [row["index"] for row in lasting(rough)] == list(range(6))
    assert lasting(rough) == lasting(calm)
    with (rough / "table.csv").open(encoding="utf-8") as stream:
        table = list(csv.DictReader(stream))
    assert [int(row["index"]) for row in table] == list(range(6))
    assert [float(row["robot.mass"]) for row in table] == 3 * [0.98, 1.02]
    for row in table:
        motion = Trajectory.load(rough / row["plan"])
        robot = mt.load_robot(rough / row["robot_folder"]).with_jets(())
        assert mt.audit(robot, motion).holds == (row["audit_holds"] == "True")


def small(**changes):
    scenario = replace(
        mt.scenarios.take_off(),
        knots=6,
        interval_max=0.2,
        final_com=(0.0, 0.0, 0.54),
        terminal=mt.Terminal.STANDING,
        jets=False,
    )
    return Design(scenarios=(scenario,), **changes)


class Fake:
    """An engine that never solves: it ends each order as it is told."""

    def __init__(self, ends):
        self.slots, self._ends, self._pending, self.seen = 2, ends, [], []

    def submit(self, order):
        self.seen.append(order)
        self._pending.append(order)

    def wait(self):
        return [self._ends(self._pending.pop(0))]

    def close(self):
        pass


def solved(order):
    row = {
        "index": order.row.index,
        "inputs": dict(order.row.inputs),
        "scenario": "s",
        "robot": "r",
        "status": "optimal",
        "solved": True,
        "audit_holds": True,
        "iterations": 3,
    }
    Folder(path=Path(order.folder)).write_row(row)
    return Ended(order=order, row=row)


def test_a_plan_whose_process_dies_each_time_is_a_row_that_says_so_and_the_rest_goes_on(tmp_path, monkeypatch):
    def ends(order):
        return (
            Ended(order=order, problem="crashed", message="gone", lost=True) if order.row.index == 1 else solved(order)
        )

    fake = Fake(ends)
    monkeypatch.setattr(sweeping_module, "Processes", lambda workers: fake)
    counts = mt.sweep(small(grid={"weights.thrust": (1.0, 2.0, 3.0)}), tmp_path / "s")
    assert (counts.done, counts.failed) == (3, 1)
    assert sum(order.row.index == 1 for order in fake.seen) == ATTEMPTS
    rows = list(Folder(path=tmp_path / "s").rows(3))
    assert [row["status"] for row in rows] == ["optimal", "crashed", "optimal"]
    assert rows[1]["message"] == "gone"
    children = [order for order in fake.seen if order.row.index == 2]
    assert children[0].started_from != 1  # not from a plan that has no answer


def test_a_plan_that_takes_too_long_is_killed_and_says_so(tmp_path, monkeypatch):
    monkeypatch.setattr(engines, "GRACE", 0.0)
    counts = mt.sweep(small(), tmp_path / "s", workers=1, time_limit=0.05)
    (row,) = Folder(path=tmp_path / "s").rows(1)
    assert row["status"] == "timed out"
    assert counts.failed == 1


def order_of(row, folder, *, simulate=False):
    return Order(
        row=row,
        folder=str(folder),
        started_from=None,
        base=row.scenario,
        time_limit=60.0,
        simulate=simulate,
        attempts=0,
        facts=facts(),
    )


@pytest.mark.parametrize("what", ["robots", "plans", "rows"])
def test_what_cannot_be_written_ends_the_sweep_and_is_no_row_so_that_the_plan_is_made_later(
    ironcub, tmp_path, monkeypatch, what
):
    (row,) = small(grid={"robot.mass": (1.02,)}).rows()
    if what != "robots":
        made = take_off(ironcub), {"status": "optimal", "solved": True, "audit_holds": True}
        monkeypatch.setattr(plan, "_made", lambda order, folder: made)
    (tmp_path / what).write_text("as a full disk, this file is in the way of the folder", encoding="utf-8")
    with pytest.raises(OutputError, match="cannot"):
        plan.perform(order_of(row, tmp_path))
    (tmp_path / what).unlink()
    assert Folder(path=tmp_path).read_row(0) is None
    if what != "robots":
        first = plan.perform(order_of(row, tmp_path))
        assert plan.perform(order_of(row, tmp_path)) == first  # also its times: it is not made twice


@pytest.mark.skipif(sys.platform == "win32", reason="SIGKILL")
def test_a_killed_process_is_replaced_and_a_plan_is_played_back_where_that_is_asked(tmp_path):
    engine = Processes(1)
    (row,) = small().rows()
    order = order_of(row, tmp_path, simulate=True)
    try:
        engine.submit(order)
        (worker,) = engine._workers.values()
        os.kill(worker.process.pid, signal.SIGKILL)
        (ended,) = engine.wait()
        assert (ended.problem, ended.lost, ended.row) == ("crashed", True, None)
        engine.submit(order)
        (ended,) = engine.wait()
        assert ended.row["status"] == "optimal"
        assert (ended.row["survived"], ended.row["simulated_end"]) == (True, "stands")
    finally:
        engine.close()


def test_a_task_that_contradicts_itself_is_a_row_that_says_why(tmp_path):
    design = small(grid={"robot.link.tail.mass": (1.0,)})
    counts = mt.sweep(design, tmp_path / "s", workers=1)
    (row,) = Folder(path=tmp_path / "s").rows(1)
    assert counts.failed == 1
    assert row["status"] == "refused"
    assert "unknown link 'tail'" in row["message"]


def test_an_unknown_key_ends_before_anything_is_made(tmp_path):
    with pytest.raises(ScenarioError, match="unknown key 'final_com_hight'"):
        mt.sweep(small(grid={"final_com_hight": (0.5, 0.6)}), tmp_path / "s")
    with pytest.raises(InputError, match=r"unknown key of a robot 'robot\.masss'"):
        small(grid={"robot.masss": (0.5, 0.6)})


def test_another_sweep_does_not_go_into_the_folder_of_one(tmp_path, monkeypatch):
    monkeypatch.setattr(sweeping_module, "Processes", lambda workers: Fake(solved))
    mt.sweep(small(), tmp_path / "s")
    with pytest.raises(InputError, match="holds another sweep"):
        mt.sweep(small(seed=2), tmp_path / "s")
    with pytest.raises(InputError, match="was begun with"):
        mt.sweep(small(), tmp_path / "s", warm=False)
    with Folder(path=tmp_path / "s").held(), pytest.raises(OutputError, match="another process works on"):
        mt.sweep(small(), tmp_path / "s")


def test_draws_follow_from_the_seed_and_the_index_and_stay_in_their_range():
    ranges = {"friction": (0.25, 0.6), "final_com": ((-0.1, 0.0, 0.5), (0.1, 0.0, 0.6))}
    design = small(draws=50, seed=3, between=ranges, among={"weights.thrust": (1.0, 2.0)})
    for x, y, z in (row.scenario["final_com"] for row in design.rows()):
        assert -0.1 < x < 0.1
        assert y == 0.0
        assert 0.5 < z < 0.6
    assert Design.of_plain(json.loads(json.dumps(design.plain()))) == design
    rows, again = list(design.rows()), list(design.rows())
    assert [row.inputs for row in rows] == [row.inputs for row in again]
    drawn = np.array([row.inputs["friction"] for row in rows])
    assert ((drawn > 0.25) & (drawn < 0.6)).all()
    assert np.unique(drawn).size == 50
    assert {row.inputs["weights.thrust"] for row in rows} == {1.0, 2.0}
    longer = list(replace(design, draws=60).rows())
    assert [row.inputs for row in longer[:50]] == [row.inputs for row in rows]
    other = list(replace(design, seed=4).rows())
    assert rows[0].inputs != other[0].inputs
    assert rows[0].scenario["friction"] == rows[0].inputs["friction"]


def test_a_grid_a_list_and_several_robots_multiply(tmp_path):
    design = small(
        robots=("ironcub", str(tmp_path)),
        grid={"knots": (5, 6, 7)},
        listed={"friction": (0.3, 0.4), "weights.thrust": (1.0, 2.0)},
        draws=2,
        between={"mid_height_min": (0.5, 0.6)},
    )
    rows = list(design.rows())
    assert design.count == len(rows) == 2 * 3 * 2 * 2
    assert {(row.inputs["friction"], row.inputs["weights.thrust"]) for row in rows} == {(0.3, 1.0), (0.4, 2.0)}
    assert [row.index for row in rows] == list(range(design.count))
    assert Design.of_plain(json.loads(json.dumps(design.plain()))).digest() == design.digest()


def test_plans_start_from_the_nearest_plan_that_is_made_before_theirs():
    rows = list(small(draws=40, seed=1, between={"friction": (0.25, 0.6), "mid_height_min": (0.5, 0.6)}).rows())
    found = origins(rows)
    points = np.array([[(r.inputs["friction"]), r.inputs["mid_height_min"]] for r in rows])
    points = (points - points.min(axis=0)) / np.ptp(points, axis=0)
    before = []
    assert sorted(found) == list(range(40))
    for index, origin in found.items():
        if origin is None:
            assert not before
        else:
            away = np.linalg.norm(points[before] - points[index], axis=1)
            assert np.linalg.norm(points[origin] - points[index]) == pytest.approx(away.min())
        before.append(index)


def test_a_changed_robot_weighs_reaches_and_pushes_as_asked(ironcub, tmp_path):
    changes = {
        "robot.mass": 1.05,
        "robot.friction": 0.5,
        "robot.link.*.length": 1.1,
        "robot.link.chest.mass": 2.0,
        "robot.jet.left arm.thrust_max": 170.0,
        "robot.jet.left arm.place": [0.0, 0.0, 0.02],
        "robot.jet.left arm.tilt": [5.0, 0.0],
    }
    folder = variant("ironcub", changes, tmp_path)
    assert variant("ironcub", changes, tmp_path) == folder
    robot = mt.load_robot(folder)
    alone = mt.load_robot(variant("ironcub", {"robot.link.chest.mass": 2.0}, tmp_path))
    chest = alone.mass - ironcub.mass
    assert chest > 0.1
    assert robot.mass == pytest.approx(1.05 * (ironcub.mass + chest))
    assert (robot.friction, robot.jets[0].thrust_max) == (0.5, 170.0)

    def placed(some, frame):
        at_home = some.home
        return np.array(some.kindyn.forward_kinematics(frame, np.eye(4), at_home.joint_positions))

    for foot in ironcub.contact_names:
        longer, plain = placed(robot, foot)[:3, 3], placed(ironcub, foot)[:3, 3]
        np.testing.assert_allclose(longer, 1.1 * plain, atol=1e-12)
    before, after = placed(ironcub, "l_arm_jet_turbine"), placed(robot, "l_arm_jet_turbine")
    assert np.degrees(np.arccos(before[:3, 2] @ after[:3, 2])) == pytest.approx(5.0)
    assert np.linalg.norm(after[:3, 3] - 1.1 * before[:3, 3]) == pytest.approx(0.02)
    lowest = [
        min(float((r.home.base_transform @ placed(r, f))[2, 3]) for f in r.contact_names) for r in (robot, ironcub)
    ]
    assert lowest[0] == pytest.approx(lowest[1])
    with pytest.raises(ModelError, match="unknown jet 'left leg'"):
        variant("ironcub", {"robot.jet.left leg.tilt": [1.0, 0.0]}, tmp_path)
    with pytest.raises(InputError, match="expected a positive number"):
        variant("ironcub", {"robot.mass": -1.0}, tmp_path)


def test_the_example_is_eight_take_offs(tmp_path):
    design = read_design(EXAMPLES / "sweep.toml")
    assert design.count == 8
    assert {row.scenario["knots"] for row in design.rows()} == {20}


def test_a_sweep_file_that_is_wrong_says_where(tmp_path):
    def refused(text, match):
        path = tmp_path / "s.toml"
        path.write_text(text, encoding="utf-8")
        with pytest.raises(InputError, match=match):
            read_design(path)

    refused('scenario = "take-off"\n[gird]\nknots = [3]', "the sweep has gird; expected scenario, robot")
    refused('scenario = "take-of"', "take-off")
    refused('scenario = "take-off"\n[grid]\nknots = 3', "'knots' is 3; expected a list of values")
    refused('scenario = "take-off"\n[list]\nknots = [3]\nfriction = [1, 2]', "the lists differ in length")
    refused('scenario = "take-off"\n[grid]\nknots = [3]\n[settings]\nknots = 4', "vary in two parts")
    refused('scenario = "take-off"\n[random]\nseed = "a"', "expected a whole number")


def test_counts_say_rate_and_time_left():
    counts = Counts(total=100, done=40, failed=1, made=20, elapsed=10.0)
    assert (counts.rate, counts.left) == (2.0, 30.0)
    assert verdict({"status": "optimal", "solved": True, "audit_holds": True}) == "solved and audited"
    assert sweeping is mt.sweep


@pytest.mark.filterwarnings("default")
def test_a_ray_cluster_makes_the_same_rows_as_processes(file, tmp_path):
    pytest.importorskip("ray")
    mt.sweep(file, tmp_path / "here", workers=1)
    mt.sweep(file, tmp_path / "ray", engine="ray", workers=2)
    assert lasting(tmp_path / "ray") == lasting(tmp_path / "here")


def test_the_table_is_parquet_too_where_pyarrow_is(tmp_path, monkeypatch):
    parquet = pytest.importorskip("pyarrow.parquet")
    monkeypatch.setattr(sweeping_module, "Processes", lambda workers: Fake(solved))
    mt.sweep(small(grid={"friction": (0.3, 0.4)}), tmp_path / "s")
    table = parquet.read_table(tmp_path / "s" / "table.parquet").to_pydict()
    assert table["friction"] == [0.3, 0.4]
    assert table["status"] == ["optimal", "optimal"]


def test_the_page_shows_the_iterations_over_each_number_that_varies_also_those_of_a_place(tmp_path, monkeypatch):
    monkeypatch.setattr(sweeping_module, "Processes", lambda workers: Fake(solved))
    ranges = {"friction": (0.25, 0.6), "final_com": ((-0.1, 0.0, 0.5), (0.1, 0.0, 0.6))}
    mt.sweep(small(draws=5, between=ranges), tmp_path / "s")
    page = write_sweep_report(tmp_path / "s").read_text(encoding="utf-8")
    (drawn,) = re.findall(r'src="data:image/svg\+xml;base64,([^"]+)"', page)
    labels = re.findall("<!-- (f[^>]+) -->", base64.b64decode(drawn).decode())
    assert labels == ["friction", "final_com 1", "final_com 3"]


def test_a_sweep_takes_starter_tasks_by_the_words_of_solve(tmp_path):
    file = tmp_path / "s.toml"
    file.write_text(
        'scenario = "jump"\nrobot = "solo12"\n[grid]\nheight = [0.03, 0.05]\nknots = [90]\n', encoding="utf-8"
    )
    design, solo = read_design(file), mt.load_robot("solo12")
    rows = list(design.rows())
    assert [row.inputs for row in rows] == [{"height": 0.03, "knots": 90}, {"height": 0.05, "knots": 90}]
    for row in rows:
        task = mt.tasks.find("jump", solo, [f"height={row.inputs['height']}", "knots=90"])
        assert from_dict(row.scenario) == task
    assert Design.of_plain(json.loads(json.dumps(design.plain()))) == design


def test_a_name_of_both_is_found_for_each_robot_of_a_sweep(tmp_path):
    file = tmp_path / "s.toml"
    file.write_text('scenario = "jump"\nrobot = ["ironcub", "solo12"]\n', encoding="utf-8")
    cub, dog = read_design(file).rows()
    assert from_dict(cub.scenario) == mt.scenarios.jump()
    assert from_dict(dog.scenario) == mt.tasks.jump(mt.load_robot("solo12"))


def test_a_starter_task_that_no_robot_of_the_sweep_can_do_is_refused(tmp_path):
    file = tmp_path / "s.toml"
    for text, match in (
        ('scenario = "trot"\nrobot = "talos"', "expected four for a trot"),
        ('scenario = "jump"\nrobot = "solo12"\n[grid]\nhight = [0.1]', "unknown key 'hight'; did you mean 'height'"),
    ):
        file.write_text(text, encoding="utf-8")
        with pytest.raises(ScenarioError, match=match):
            list(read_design(file).rows())


def test_a_robot_whose_urdf_is_in_a_package_can_be_changed(tmp_path):
    solo, heavier = mt.load_robot("solo12"), mt.load_robot(variant("solo12", {"robot.mass": 1.1}, tmp_path))
    assert heavier.mass == pytest.approx(1.1 * solo.mass)

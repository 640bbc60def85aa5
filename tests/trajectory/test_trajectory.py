from __future__ import annotations

import pickle
from dataclasses import replace

import numpy as np
import pytest

from multimodal_to.errors import OutputError, TrajectoryError
from multimodal_to.trajectory import ENTRIES, QUANTITIES, Trajectory
from synthetic import take_off as synthetic_take_off


@pytest.fixture
def trajectory(ironcub):
    return synthetic_take_off(ironcub)


def test_what_is_saved_is_loaded_back(trajectory, tmp_path):
    loaded = Trajectory.load(trajectory.save(tmp_path / "motion.npz"))
    for name in QUANTITIES:
        assert np.array_equal(getattr(loaded, name), getattr(trajectory, name))
    assert np.array_equal(loaded.time, trajectory.time)
    assert (loaded.robot, loaded.joint_names) == (trajectory.robot, trajectory.joint_names)


def test_the_file_holds_no_pickle_and_the_names_that_others_use(trajectory, tmp_path):
    with np.load(trajectory.save(tmp_path / "motion.npz"), allow_pickle=False) as archive:
        assert all(archive[name].dtype.kind in "fiU" for name in archive.files)
        assert {"com_position", "base_quaternion_xyzw", "contact_forces", "thrust", "throttle", "time"} <= set(
            archive.files
        )
        assert archive["contact_forces"].shape == (24, trajectory.knots + 1)
        assert set(archive.files) == {*QUANTITIES, *ENTRIES}


def test_a_quantity_of_contact_points_that_does_not_exist_is_refused_with_those_that_do(trajectory):
    assert trajectory.per_contact("contact_forces").shape == (8, 3, trajectory.knots + 1)
    for name in ("contact_force", "com_position"):
        with pytest.raises(TrajectoryError, match=f"unknown quantity of contact points '{name}'.* contact_positions, "):
            trajectory.per_contact(name)


def test_files_of_earlier_versions_are_read_and_those_of_a_later_release_refused(trajectory, tmp_path):
    path = replace(trajectory, scenario_json="{}", solve_json='{"status": "optimal"}').save(tmp_path / "motion.npz")
    with np.load(path) as archive:
        arrays = {name: archive[name] for name in archive.files}
    assert Trajectory.load(path).scenario_json == "{}"
    assert Trajectory.load(path).solve_record() == {"status": "optimal"}
    np.savez(path, **{**arrays, "format_version": np.array(4)})
    with pytest.raises(TrajectoryError, match="has format version 4; this release reads 1 to 3"):
        Trajectory.load(path)
    del arrays["solve_json"]
    np.savez(path, **{**arrays, "format_version": np.array(2)})
    assert (Trajectory.load(path).scenario_json, Trajectory.load(path).solve_record()) == ("{}", {})
    del arrays["scenario_json"]
    np.savez(path, **{**arrays, "format_version": np.array(1)})
    assert Trajectory.load(path).scenario_json == ""


@pytest.mark.parametrize("text", ["[]", "optimal", "{", "[" * 100_000])
def test_a_record_of_a_solve_that_is_no_json_object_is_refused(trajectory, text):
    with pytest.raises(TrajectoryError, match=r"the record of the solve of 'take-off & hover' is no JSON"):
        replace(trajectory, solve_json=text).solve_record()


def test_a_missing_file_is_named(tmp_path):
    with pytest.raises(TrajectoryError, match="no trajectory file"):
        Trajectory.load(tmp_path / "none.npz")


def test_files_that_are_no_trajectory_are_refused(tmp_path, trajectory):
    text = tmp_path / "text.npz"
    text.write_text("hello")
    pickled = tmp_path / "pickled.npz"
    pickled.write_bytes(pickle.dumps({"a": 1}))
    single = tmp_path / "single.npz"
    with single.open("wb") as file:
        np.save(file, np.zeros(3))
    foreign = tmp_path / "foreign.npz"
    np.savez(foreign, a=np.zeros(3))
    whole = trajectory.save(tmp_path / "whole.npz").read_bytes()
    cut = tmp_path / "cut.npz"
    cut.write_bytes(whole[: len(whole) // 2])
    for path in (text, pickled, single, foreign, cut):
        with pytest.raises(TrajectoryError, match="is not a trajectory file"):
            Trajectory.load(path)


def test_a_file_with_objects_inside_executes_nothing(trajectory, tmp_path):
    path = trajectory.save(tmp_path / "motion.npz")
    with np.load(path) as archive:
        arrays = dict(archive)
    arrays["thrust"] = np.array([{"a": 1}], dtype=object)
    np.savez(path, **arrays)
    with pytest.raises(TrajectoryError, match="is not a trajectory file"):
        Trajectory.load(path)


def test_a_quantity_that_is_missing_is_named(trajectory, tmp_path):
    path = trajectory.save(tmp_path / "motion.npz")
    with np.load(path) as archive:
        arrays = {name: archive[name] for name in archive.files if name != "throttle"}
    np.savez(path, **arrays)
    with pytest.raises(TrajectoryError, match="lacks throttle"):
        Trajectory.load(path)


def test_wrong_shapes_and_values_are_refused(trajectory):
    with pytest.raises(TrajectoryError, match=r"'thrust' has shape \(3, .*expected \(4, "):
        replace(trajectory, thrust=trajectory.thrust[:3])
    with pytest.raises(TrajectoryError, match="'thrust' holds values that are not finite"):
        replace(trajectory, thrust=np.full_like(trajectory.thrust, np.nan))
    with pytest.raises(TrajectoryError, match="increase from knot to knot"):
        replace(trajectory, time=trajectory.time[::-1].copy())


def test_a_folder_that_does_not_exist_is_named_and_nothing_is_left_behind(trajectory, tmp_path):
    with pytest.raises(OutputError, match="cannot write"):
        trajectory.save(tmp_path / "missing" / "motion.npz")
    assert list(tmp_path.iterdir()) == []

from __future__ import annotations

import pickle
from dataclasses import replace

import numpy as np
import pytest

from multimodal_to.errors import InputError, OutputError, TrajectoryError
from multimodal_to.trajectory import ENTRIES, QUANTITIES, Trajectory, labels, row_labels
from multimodal_to.trajectory.quantities import TWIST, XYZ
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


def test_files_of_earlier_versions_are_read_and_those_of_a_later_release_refused(trajectory, tmp_path):
    path = replace(trajectory, scenario_json="{}", solve_json='{"status": "optimal"}').save(tmp_path / "motion.npz")
    with np.load(path) as archive:
        arrays = {name: archive[name] for name in archive.files}
    assert Trajectory.load(path).scenario_json == "{}"
    assert Trajectory.load(path).solve_record() == {"status": "optimal"}
    np.savez(path, **{**arrays, "format_version": np.array(6)})
    with pytest.raises(TrajectoryError, match="has format version 6; this release reads 1 to 5"):
        Trajectory.load(path)
    del arrays["robot_json"]
    np.savez(path, **{**arrays, "format_version": np.array(4)})
    assert Trajectory.load(path).robot_json == ""
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


def test_every_row_of_every_quantity_has_a_name_of_its_own(ironcub, trajectory):
    for name in QUANTITIES:
        names = trajectory.labels(name)
        assert len(set(names)) == len(names) == len(getattr(trajectory, name)), name
        assert labels(name, ironcub) == names


def test_rows_are_called_by_their_body_and_axis(ironcub, trajectory):
    assert trajectory.labels("com_position") == ("x", "y", "z")
    assert trajectory.labels("base_quaternion_xyzw") == ("x", "y", "z", "w")
    assert trajectory.labels("joint_velocities") == ironcub.joint_names
    assert trajectory.labels("contact_forces")[14] == "r_sole_1 z"
    assert trajectory.labels("thrust") == ("left arm", "right arm", "left chest", "right chest")
    assert labels("contact_forces", ironcub, separator=".")[14] == "r_sole_1.z"


def test_rows_that_are_no_quantity_take_the_axes_they_are_given(ironcub):
    faces = row_labels(ironcub, "contact", ("+x", "+y", "-x", "-y"))
    assert faces[:5] == ("l_sole_1 +x", "l_sole_1 +y", "l_sole_1 -x", "l_sole_1 -y", "l_sole_2 +x")
    assert row_labels(ironcub, "robot", TWIST)[3] == "angular x"
    assert row_labels(ironcub.with_jets(()), "jet", XYZ) == ()


def test_what_has_no_labels_is_named_with_what_exists(ironcub):
    with pytest.raises(InputError, match="unknown quantity 'thrusts'; did you mean 'thrust'"):
        labels("thrusts", ironcub)
    with pytest.raises(InputError, match="unknown kind of body 'jets'; did you mean 'jet'"):
        row_labels(ironcub, "jets", XYZ)


def test_the_frame_of_a_quantity_is_stated_where_its_rows_have_a_direction():
    assert all((quantity.frame == "world") == (quantity.rows > 1) for quantity in QUANTITIES.values())


@pytest.mark.parametrize("name", ["contact_force", "com_position", "time"])
def test_what_is_no_quantity_of_contact_points_is_named_with_those_that_are(trajectory, name):
    with pytest.raises(InputError, match="unknown quantity of contact points") as error:
        trajectory.per_contact(name)
    assert str(error.value).endswith("Available: contact_positions, contact_forces, contact_force_rates")

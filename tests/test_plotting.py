from __future__ import annotations

import io
from dataclasses import replace

import numpy as np
import pytest
from matplotlib._pylab_helpers import Gcf
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.patches import Rectangle

from multimodal_to import derived, plotting
from multimodal_to.models.robot import load_robot
from synthetic import DURATION, LIFT_OFF, take_off


@pytest.fixture(scope="module")
def robot():
    return load_robot("ironcub")


@pytest.fixture(scope="module")
def trajectory(robot):
    return take_off(robot)


@pytest.fixture
def figure(robot, trajectory):
    return plotting.plot_forces(robot, trajectory)


def lines(axes) -> dict[str, np.ndarray]:
    return {line.get_label(): line.get_ydata() for line in axes.lines}


def bands(axes) -> list[tuple[float, float]]:
    boxes = [patch for patch in axes.patches if isinstance(patch, Rectangle)]
    return [(box.get_x(), box.get_x() + box.get_width()) for box in boxes]


def test_there_are_three_panels_with_units(figure):
    assert [axes.get_ylabel() for axes in figure.axes] == ["throttle [%]", "thrust [N]", "vertical force [N]"]
    assert figure.axes[-1].get_xlabel() == "time [s]"


def test_every_jet_is_drawn_under_its_full_name(figure, robot, trajectory):
    for axes, values in zip(figure.axes[:2], (trajectory.throttle, trajectory.thrust), strict=True):
        for jet, row in zip(robot.jets, values, strict=True):
            np.testing.assert_array_equal(lines(axes)[jet.name], row)


def test_the_red_band_covers_the_flight_in_every_panel(figure):
    for axes in figure.axes:
        ((start, end),) = bands(axes)
        assert (start, end) == pytest.approx((LIFT_OFF, DURATION))


def test_each_flight_has_its_own_band_but_one_entry_in_the_legend(robot, trajectory):
    forces = trajectory.contact_forces.copy()
    forces[2, -2:] = 80.0
    forces[2::3, 2:4] = 0.0
    figure = plotting.plot_forces(robot, replace(trajectory, contact_forces=forces))
    time = trajectory.time
    np.testing.assert_allclose(bands(figure.axes[0]), [(time[2], time[3]), (LIFT_OFF, time[-3])])
    assert [text.get_text() for text in figure.axes[2].get_legend().get_texts()].count("flight") == 1


def test_a_robot_that_stays_on_the_ground_has_no_band(robot, trajectory):
    forces = np.full_like(trajectory.contact_forces, 20.0)
    figure = plotting.plot_forces(robot, replace(trajectory, contact_forces=forces))
    assert not any(bands(axes) for axes in figure.axes)


def test_a_force_just_below_the_threshold_counts_as_flight(robot, trajectory):
    forces = np.zeros_like(trajectory.contact_forces)
    forces[2] = 0.99 * derived.FLIGHT_FORCE
    assert derived.flight_phases(replace(trajectory, contact_forces=forces)) == [(0.0, DURATION)]
    forces[2] = 1.01 * derived.FLIGHT_FORCE
    assert derived.flight_phases(replace(trajectory, contact_forces=forces)) == []


def test_limits_and_weight_are_dashed_lines(figure, robot):
    dashed = [
        {float(line.get_ydata()[0]) for line in axes.lines if line.get_color() == plotting._LIMIT["color"]}
        for axes in figure.axes
    ]
    assert dashed[:2] == [{0.0, 100.0}, {jet.thrust_max for jet in robot.jets}]
    assert dashed[2] == {robot.weight}


def test_the_vertical_thrust_is_the_thrust_against_the_exhaust(robot, trajectory):
    expected = np.zeros(trajectory.time.size)
    for jet, thrust in zip(robot.jets, trajectory.thrust, strict=True):
        exhaust = derived.frame_poses(robot, trajectory, jet.frame)[:, :3, 2]
        expected += (-thrust[:, None] * exhaust)[:, 2]
    vertical = derived.vertical_thrust(robot, trajectory)
    np.testing.assert_allclose(vertical, expected, atol=1e-9)
    assert vertical[-1] > 0.0  # the jets point down


def test_a_robot_without_jets_can_be_plotted(robot, trajectory):
    none = np.zeros((0, trajectory.time.size))
    walker = replace(
        trajectory, jet_names=(), thrust=none, thrust_rate=none, thrust_acceleration=none, throttle=none
    )  # fmt: skip
    figure = plotting.plot_forces(replace(robot, jets=()), walker)
    np.testing.assert_array_equal(lines(figure.axes[2])["vertical thrust"], 0.0)


def test_frame_poses_are_those_of_the_base_for_the_base(robot, trajectory):
    poses = derived.frame_poses(robot, trajectory, "root_link")
    np.testing.assert_allclose(poses[:, :3, 3], trajectory.base_position.T, atol=1e-12)
    yaw = np.arctan2(poses[:, 1, 0], poses[:, 0, 0])
    np.testing.assert_allclose(yaw, 2 * np.arctan2(*trajectory.base_quaternion_xyzw[2:]), atol=1e-12)


def test_legends_touch_neither_data_nor_labels(figure):
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    renderer = canvas.get_renderer()
    legends = [axes.get_legend().get_window_extent(renderer) for axes in figure.axes]
    for axes, legend in zip(figure.axes, legends, strict=True):
        assert legend.y0 >= axes.get_window_extent(renderer).y1 - 1.0
        assert legend.x1 <= figure.bbox.x1
    for above, below in zip(figure.axes, legends[1:], strict=False):
        assert not below.overlaps(above.get_tightbbox(renderer))
    assert not legends[0].overlaps(figure._suptitle.get_window_extent(renderer))


def test_the_figure_belongs_to_no_window_and_is_saved_by_its_caller(figure):
    assert not Gcf.get_all_fig_managers()
    stream = io.BytesIO()
    figure.savefig(stream, format="png")
    assert stream.getvalue().startswith(b"\x89PNG")

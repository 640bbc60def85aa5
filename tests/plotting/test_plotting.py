from __future__ import annotations

import io
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from matplotlib._pylab_helpers import Gcf
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.patches import Rectangle
from matplotlib.text import Text

from multimodal_to import plotting, scenarios
from multimodal_to.errors import InputError, OutputError
from multimodal_to.models.loading import load_robot
from multimodal_to.plotting import style
from multimodal_to.scenarios.data import to_json
from multimodal_to.trajectory import derived, rules
from multimodal_to.trajectory.pushes import KnownPush
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


@pytest.fixture(scope="module")
def drawn(robot, trajectory):
    """A figure by its name with one or several runs, drawn once for all tests that look at it; and its renderer."""

    @cache
    def draw(name, count):
        runs = [replace(trajectory, scenario=f"scenario-{number}") for number in range(count)]
        labels = [f"results/of-today/{run.scenario}/trajectory.npz" for run in runs]
        figure = plotting.plot(name, robot, *runs, labels=labels if count > 1 else None)
        canvas = FigureCanvasAgg(figure)
        canvas.draw()
        return figure, canvas.get_renderer()

    return draw


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


def test_a_known_push_has_a_band_while_it_acts(robot, trajectory):
    push = KnownPush(of="chest", force=(0.0, 60.0, 0.0), begin=0.25, end=0.5)
    forces = np.full_like(trajectory.contact_forces, 20.0)  # so that there is no band of flight
    task = to_json(replace(scenarios.take_off(), pushes=(push,)))
    figure = plotting.plot_forces(robot, replace(trajectory, contact_forces=forces, scenario_json=task))
    for axes in figure.axes:
        assert bands(axes) == [pytest.approx((0.25 * DURATION, 0.5 * DURATION), abs=DURATION / trajectory.knots)]
    assert "known push" in [text.get_text() for text in figure.axes[2].get_legend().get_texts()]


def test_bands_of_several_runs_together_leave_the_data_visible(robot, trajectory):
    panel = plotting.plot_com(robot, *[trajectory] * 4, labels=list("abcd")).axes[0]
    bands_of_all = [patch for patch in panel.patches if isinstance(patch, Rectangle)]
    assert len(bands_of_all) == 4
    assert sum(band.get_alpha() for band in bands_of_all) <= 0.25


def test_a_robot_that_stays_on_the_ground_has_no_band(robot, trajectory):
    forces = np.full_like(trajectory.contact_forces, 20.0)
    figure = plotting.plot_forces(robot, replace(trajectory, contact_forces=forces))
    assert not any(bands(axes) for axes in figure.axes)


def test_a_force_just_below_the_threshold_counts_as_flight(robot, trajectory):
    forces = np.zeros_like(trajectory.contact_forces)
    forces[2] = 0.99 * derived.flight_force(robot)
    assert derived.flight_phases(robot, replace(trajectory, contact_forces=forces)) == [(0.0, DURATION)]
    forces[2] = 1.01 * derived.flight_force(robot)
    assert derived.flight_phases(robot, replace(trajectory, contact_forces=forces)) == []


def test_limits_and_weight_are_dashed_lines(figure, robot):
    dashed = [
        {float(line.get_ydata()[0]) for line in axes.lines if line.get_color() == style.LIMIT["color"]}
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
    walker = replace(trajectory, jet_names=(), thrust=none, thrust_rate=none, thrust_acceleration=none, throttle=none)
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


@pytest.mark.parametrize("name", sorted(plotting.FIGURES))
def test_every_figure_has_units_and_no_legend_over_its_data(name, drawn):
    figure, renderer = drawn(name, 1)
    titles = [axes.get_ylabel() for axes in figure.axes] + [text.get_text() for text in all_texts(figure)]
    assert any("[" in title for title in titles)
    for axes in figure.axes:
        if (legend := axes.get_legend()) is not None:
            box, data = legend.get_window_extent(renderer), axes.get_window_extent(renderer)
            assert box.y0 >= data.y1 - 1.0 or box.y1 <= data.y0 + 1.0


@pytest.mark.parametrize("count", [1, 4])
@pytest.mark.parametrize("name", sorted(plotting.FIGURES))
def test_no_text_of_a_figure_lies_over_another_or_beyond_its_edge(name, count, drawn):
    figure, renderer = drawn(name, count)
    boxes = [(text.get_text(), text.get_window_extent(renderer)) for text in drawn_texts(figure)]
    assert len(boxes) > 20
    for index, (text, box) in enumerate(boxes):
        assert -1 <= box.x0 <= box.x1 <= figure.bbox.x1 + 1, text
        assert -1 <= box.y0 <= box.y1 <= figure.bbox.y1 + 1, text
        for other, there in boxes[index + 1 :]:
            apart = box.x1 < there.x0 + 1 or there.x1 < box.x0 + 1 or box.y1 < there.y0 + 1 or there.y1 < box.y0 + 1
            assert apart, f"'{text}' lies over '{other}'"


def drawn_texts(figure) -> list[Text]:
    """Texts of a figure without the labels of ticks that are not in use or outside the range of their axis."""
    beyond = set()
    for axes in figure.get_axes():
        for axis, limits in ((axes.xaxis, axes.get_xlim()), (axes.yaxis, axes.get_ylim())):
            low, high = sorted(limits)
            low, high = low - 1e-9 * abs(low) - 1e-15, high + 1e-9 * abs(high) + 1e-15
            used = [*axis.get_major_ticks(), *axis.get_minor_ticks()]
            for tick in {*axis.majorTicks, *axis.minorTicks, *used}:
                if tick not in used or not low <= tick.get_loc() <= high:
                    beyond |= {tick.label1, tick.label2}
    texts = figure.findobj(lambda thing: isinstance(thing, Text) and thing.get_visible() and thing.get_text().strip())
    return [text for text in texts if text not in beyond]


def test_the_bounds_of_the_scenario_are_dashed_beside_the_products(robot, trajectory):
    scenario = scenarios.take_off()
    products = plotting.plot_margins(robot, replace(trajectory, scenario_json=to_json(scenario))).axes[0]
    dashed = {line.get_ydata()[0] for line in products.lines if line.get_color() == style.LIMIT["color"]}
    complementarity, sliding = scenario.contact_bounds(robot)
    assert dashed == {complementarity, np.sqrt(2.0) * sliding}


@pytest.mark.parametrize("name", ["joints", "torques"])
def test_every_column_of_joints_has_a_time_axis(name, robot, trajectory):
    figure = plotting.plot(name, robot, trajectory)
    columns = {round(axes.get_position().x0, 2) for axes in figure.axes if axes.axison}
    timed = {round(axes.get_position().x0, 2) for axes in figure.axes if axes.get_xlabel() == "time [s]"}
    assert timed == columns


def all_texts(figure) -> list:
    return [
        *figure.texts,
        *(text for part in figure.subfigs for text in part.texts),
        *(part._supylabel for part in (figure, *figure.subfigs) if part._supylabel is not None),
    ]


@pytest.mark.parametrize("name", sorted(plotting.FIGURES))
def test_two_runs_share_a_figure_and_a_legend_tells_them_apart(name, robot, trajectory):
    later = replace(trajectory, scenario="other", com_position=trajectory.com_position + 0.1)
    figure = plotting.plot(name, robot, trajectory, later, labels=["first", "second"])
    (legend,) = figure.legends
    assert [text.get_text() for text in legend.get_texts()] == ["first", "second"]
    styles = {line.get_linestyle() for line in legend.get_lines()}
    assert len(styles) == 2


def test_the_com_figure_shows_all_six_components(robot, trajectory):
    figure = plotting.plot_com(robot, trajectory)
    expected = [row for pair in zip(trajectory.com_position, trajectory.com_velocity, strict=True) for row in pair]
    for axes, row in zip(figure.axes, expected, strict=True):
        np.testing.assert_array_equal(axes.lines[0].get_ydata(), row)


def test_joint_panels_hold_the_whole_range_of_each_joint(robot, trajectory):
    figure = plotting.plot_joints(robot, trajectory)
    panels = {axes.get_title(): axes for axes in figure.axes}
    for index, name in enumerate(robot.joint_names):
        axes = panels[name]
        np.testing.assert_array_equal(axes.lines[0].get_ydata(), trajectory.joint_positions[index])
        assert axes.get_ylim()[0] <= robot.joint_limits.lower[index]
        assert axes.get_ylim()[1] >= robot.joint_limits.upper[index]


def test_torques_are_those_of_statics_when_the_robot_stands_still(robot, trajectory):
    count = trajectory.time.size
    still = {name: np.repeat(getattr(trajectory, name)[:, :1], count, axis=1) for name in trajectory_names()}
    standing = replace(trajectory, **still)
    torques = derived.generalised_forces(robot, standing)
    base = derived.base_poses(standing)[0]
    gravity = np.array(robot.kindyn.gravity_term_fun()(base, standing.joint_positions[:, 0])).ravel()
    pushed = np.zeros(len(gravity))
    for name, force in zip(robot.contact_names, standing.per_contact("contact_forces")[:, :, 0], strict=True):
        jacobian = np.array(robot.kindyn.jacobian_fun(name)(base, standing.joint_positions[:, 0]))
        pushed += jacobian[:3].T @ force
    np.testing.assert_allclose(torques[:, 5], gravity - pushed, atol=1e-9)
    (knee,) = (axes for axes in plotting.plot_torques(robot, standing).axes if axes.get_title().startswith("l_knee"))
    drawn = knee.lines[0].get_ydata()
    assert np.isnan(drawn[0])
    np.testing.assert_array_equal(drawn[1:], torques[6 + robot.joint_names.index("l_knee"), 1:])


def trajectory_names() -> tuple[str, ...]:
    return "base_position", "base_quaternion_xyzw", "joint_positions", "contact_forces", "thrust", "com_position"


def test_the_contact_timeline_ends_where_the_load_ends(robot, trajectory):
    timeline = plotting.plot_contacts(robot, trajectory).axes[0]
    assert [label.get_text() for label in timeline.get_yticklabels()] == list(robot.contact_names)
    assert len(timeline.collections) == len(robot.contacts)
    for bars in timeline.collections:
        (bar,) = bars.get_paths()
        assert bar.vertices[:, 0].min() == 0.0
        assert bar.vertices[:, 0].max() == pytest.approx(LIFT_OFF - DURATION / 20)  # the last knot above the threshold


def test_margins_colour_what_fails(robot, trajectory):
    from multimodal_to.auditing.audit import audit

    report = audit(robot, trajectory)
    bars = plotting.plot_margins(robot, trajectory, audits=[report]).axes[1].patches
    failed = [finding.name for finding in report.findings if not finding.holds]
    red = [
        finding.name
        for finding, bar in zip(report.findings, bars, strict=True)
        if bar.get_facecolor()[0] > 2 * bar.get_facecolor()[1]
    ]
    assert red == failed
    assert failed


@pytest.mark.parametrize("suffix", style.SUFFIXES)
def test_a_figure_is_saved_by_its_suffix_and_whole(figure, tmp_path, suffix):
    path = plotting.save(figure, tmp_path / f"figure{suffix}")
    assert path.stat().st_size > 5000
    assert list(tmp_path.iterdir()) == [path]


def test_bad_figures_end_in_one_sentence(figure, robot, trajectory, tmp_path):
    with pytest.raises(OutputError, match=r"is no \.png, \.svg or \.pdf"):
        plotting.save(figure, tmp_path / "figure.bmp")
    with pytest.raises(InputError, match="unknown figure 'force'; did you mean 'forces'"):
        plotting.plot("force", robot, trajectory)
    with pytest.raises(InputError, match="shows 1 to 4"):
        plotting.plot_com(robot)
    with pytest.raises(InputError, match="2 labels"):
        plotting.plot_com(robot, trajectory, labels=["one", "two"])
    assert list(tmp_path.iterdir()) == []


# ------------------------------------------------------------------------- each quantity at its own instant


@pytest.fixture(scope="module")
def leapfrog(trajectory):
    return replace(trajectory, rule=rules.LEAPFROG)


@pytest.fixture(scope="module")
def staggered(trajectory):
    return replace(trajectory, rule=rules.STAGGERED)


def test_a_backward_euler_motion_is_drawn_at_its_knots(robot, trajectory):
    drawn = [*plotting.plot_com(robot, trajectory).axes, *plotting.plot_forces(robot, trajectory).axes[:2]]
    for axes in drawn:
        np.testing.assert_array_equal(axes.lines[0].get_xdata(), trajectory.time)
        assert axes.lines[0].get_drawstyle() == "default"


def test_velocities_by_leapfrog_are_drawn_in_the_middles_of_intervals(robot, leapfrog):
    middles = (leapfrog.time[1:] + leapfrog.time[:-1]) / 2
    position, velocity = plotting.plot_com(robot, leapfrog).axes[:2]
    np.testing.assert_array_equal(position.lines[0].get_xdata(), leapfrog.time)
    np.testing.assert_allclose(velocity.lines[0].get_xdata(), middles, atol=1e-12)
    np.testing.assert_array_equal(velocity.lines[0].get_ydata(), leapfrog.com_velocity[0, 1:])
    momentum, rate = plotting.plot_momentum(robot, leapfrog).axes[:2]
    np.testing.assert_allclose(momentum.lines[0].get_xdata(), middles, atol=1e-12)
    np.testing.assert_allclose(rate.lines[0].get_xdata(), leapfrog.time[:-1], atol=1e-12)
    speeds = plotting.plot_joints(robot, leapfrog).axes[-1]
    np.testing.assert_allclose(speeds.lines[0].get_xdata(), middles, atol=1e-12)


def test_forces_and_throttles_by_leapfrog_are_drawn_at_its_knots(robot, leapfrog):
    throttle, _, force = plotting.plot_forces(robot, leapfrog).axes
    for axes, values in ((throttle, leapfrog.throttle[0]), (force, leapfrog.vertical_contact_force())):
        line = axes.lines[0]
        np.testing.assert_array_equal(line.get_xdata(), leapfrog.time)
        np.testing.assert_array_equal(line.get_ydata(), values)
        assert line.get_drawstyle() == "default"


@pytest.mark.parametrize(("rule", "later"), [(rules.BACKWARD_EULER, 0.0), (rules.LEAPFROG, 0.5)])
def test_bars_of_the_timeline_span_the_time_in_which_forces_act(robot, trajectory, rule, later):
    forces = np.zeros_like(trajectory.contact_forces)
    forces[2, 4:9] = 50.0
    timeline = plotting.plot_contacts(robot, replace(trajectory, rule=rule, contact_forces=forces)).axes[0]
    (path,) = [path for bars in timeline.collections for path in bars.get_paths()]
    step = DURATION / (trajectory.time.size - 1)
    ends = path.vertices[:, 0]
    assert (ends.min(), ends.max()) == pytest.approx(((3 + later) * step, (8 + later) * step))


def test_bands_of_flight_by_leapfrog_begin_when_the_last_force_ends(robot, leapfrog):
    for axes in plotting.plot_forces(robot, leapfrog).axes:
        assert bands(axes) == [pytest.approx((LIFT_OFF - DURATION / 40, DURATION))]


def test_forces_and_throttles_of_a_staggered_motion_are_steps_over_its_intervals(robot, staggered):
    throttle, thrust, force = plotting.plot_forces(robot, staggered).axes
    load, height = plotting.plot_contacts(robot, staggered).axes[1:]
    product = plotting.plot_margins(robot, staggered).axes[0]
    for axes, values in ((throttle, staggered.throttle[0]), (force, staggered.vertical_contact_force())):
        line = axes.lines[0]
        np.testing.assert_array_equal(line.get_xdata(), staggered.time)
        np.testing.assert_array_equal(line.get_ydata()[1:], values[1:])
    for axes in (throttle, force, load, product):
        line = axes.lines[0]
        assert line.get_drawstyle() == "steps-pre"  # column k fills the interval that ends at knot k
        assert line.get_ydata()[0] == line.get_ydata()[1]
    for axes in (thrust, height):
        assert axes.lines[0].get_drawstyle() == "default"


def test_bands_of_flight_of_a_staggered_file_fill_the_intervals_without_force(robot, staggered):
    for axes in plotting.plot_forces(robot, staggered).axes:
        assert bands(axes) == [pytest.approx((LIFT_OFF - DURATION / 20, DURATION))]


# ------------------------------------------------------------------------- limits of torques


def torque_panel(robot, trajectory, joint):
    panels = plotting.plot_torques(robot, trajectory).axes
    (panel,) = (axes for axes in panels if axes.get_title().split(" ")[0] == joint)
    dashed = {float(line.get_ydata()[0]) for line in panel.lines if line.get_color() == style.LIMIT["color"]}
    return panel.get_title(), dashed


def test_the_effort_limits_of_the_robots_file_are_dashed_where_torques_come_near(robot, trajectory):
    efforts = robot.joint_limits.effort.copy()
    row = robot.joint_names.index("l_elbow")
    assert torque_panel(robot, trajectory, "l_elbow")[0] == "l_elbow (±20)"
    efforts[row] = np.abs(derived.joint_torques(robot, trajectory)[row, 1:]).max()
    weak = replace(robot, joint_limits=replace(robot.joint_limits, effort=efforts))
    assert torque_panel(weak, trajectory, "l_elbow")[1] == {-efforts[row], efforts[row]}


def test_a_joint_without_an_effort_limit_has_no_dashed_line(robot, trajectory):
    efforts = np.full(len(robot.joint_names), np.inf)
    strong = replace(robot, joint_limits=replace(robot.joint_limits, effort=efforts))
    assert torque_panel(strong, trajectory, "l_elbow") == ("l_elbow", set())


def test_the_last_knot_by_leapfrog_has_no_torque(robot, leapfrog):
    drawn = plotting.plot_torques(robot, leapfrog).axes[0].lines[0].get_ydata()
    assert np.isnan(drawn[-1])
    assert np.isfinite(drawn[:-1]).all()

"""Jets that fail and places to keep away from: rows, bounds, audits, and what the doctor says before."""

from __future__ import annotations

from dataclasses import replace

import casadi as cs
import numpy as np
import pytest

import multimodal_to as mt
from drones import HOP, drone
from multimodal_to.adam.kinematics import Pose
from multimodal_to.auditing.regions import room as exact_room
from multimodal_to.doctor import Severity
from multimodal_to.errors import ModelError, ScenarioError
from multimodal_to.models.bodies import bodies_of
from multimodal_to.models.capsule import Capsule
from multimodal_to.ocp.regions import room
from multimodal_to.trajectory.derived import frame_poses

# ------------------------------------------------------------------------------------- jets that fail


@pytest.fixture(scope="module")
def plane(tmp_path_factory):
    return drone(tmp_path_factory.mktemp("drone"))


def failing(jet, at=0.0, **changes):
    return replace(HOP, failures=(mt.JetFailure(jet=jet, at=at),), **changes)


def test_a_jet_that_never_lights_has_no_thrust_at_any_knot(plane):
    problem = mt.build(plane, failing("left"))
    upper = problem.layout.read_horizon(problem.upper * problem.scale)["thrust"]
    assert (upper[plane.jet_names.index("left")] == 0.0).all()
    assert (upper[plane.jet_names.index("right"), 1:] > 0.0).all()
    assert "never_lit" in problem.bound_rows


def test_a_jet_that_fails_later_has_its_least_throttle_from_then_on(plane):
    problem = mt.build(plane, failing("left", 0.5, terminal=mt.Terminal.FREE))
    row, jet = plane.jet_names.index("left"), plane.jets[0]
    bounds = [
        problem.layout.read_horizon(side * problem.scale)["throttle"][row] for side in (problem.lower, problem.upper)
    ]
    for side in bounds:
        assert side[15:] == pytest.approx(jet.throttle_min)
    assert bounds[1][1:15] == pytest.approx(jet.throttle_max)


def test_the_guess_lets_the_other_jets_carry_what_the_failed_one_does_not(ironcub):
    landing = replace(mt.scenarios.landing(), knots=10, failures=(mt.JetFailure(jet="left chest", at=0.0),))
    problem = mt.build(ironcub, landing)
    thrust = problem.layout.read_horizon(problem.guess * problem.scale)["thrust"]
    assert thrust[ironcub.jet_names.index("left chest")] == pytest.approx(0.0)
    assert thrust[:, 0].sum() == pytest.approx(ironcub.weight, rel=1e-6)


def test_a_motion_whose_failed_jet_pushes_is_not_true(plane, ironcub, take_off):
    scenario = replace(mt.scenarios.take_off(), failures=(mt.JetFailure(jet="left arm", at=0.0),))
    report = mt.audit(ironcub, take_off.trajectory, scenario)
    finding = report["failed jet: thrust"]
    assert not finding.holds
    assert finding.body == "left arm"
    assert finding.worst == pytest.approx(take_off.trajectory.thrust[ironcub.jet_names.index("left arm")].max())
    later = replace(mt.scenarios.take_off(), failures=(mt.JetFailure(jet="left arm", at=0.5),))
    report = mt.audit(ironcub, take_off.trajectory, later)
    assert not report["failed jet: throttle"].holds
    assert report["failed jet: throttle"].knot >= 35


def test_the_doctor_refuses_a_hover_that_the_jets_that_are_left_cannot_hold(tmp_path):
    heavy = drone(tmp_path, mass=30.0)
    assert not [some for some in mt.doctor(heavy, HOP).findings if some.name == "thrust"]
    (error,) = [some for some in mt.doctor(heavy, failing("left")).of(Severity.ERROR) if some.name == "thrust"]
    assert "the jets that have not failed, 1 of 2, together hold at most 220 N" in error.found


def test_a_jet_that_is_not_there_cannot_fail(plane):
    with pytest.raises(ScenarioError, match="unknown jet 'tail'"):
        mt.build(plane, failing("tail"))
    assert any("unknown jet 'tail'" in some.found for some in mt.doctor(plane, failing("tail")).of(Severity.ERROR))
    with pytest.raises(ScenarioError, match=r"at is 1.0; expected at least 0 and below 1"):
        mt.JetFailure(jet="left", at=1.0)


# ------------------------------------------------------------------------------------- walls and boxes


BOX = mt.Box(lower=(-0.2, -0.1, 0.3), upper=(0.3, 0.4, 0.6))
ROD = Capsule(name="rod", frame="body", start=np.array([-0.1, 0.0, 0.05]), end=np.array([0.2, 0.1, 0.0]), radius=0.04)


class _At:
    """A knot with the base of a robot somewhere."""

    def __init__(self, rotation: np.ndarray, position: np.ndarray) -> None:
        self._pose = Pose(cs.SX(cs.DM(rotation)), cs.SX(cs.DM(position)))

    def pose(self, frame: str) -> Pose:
        return self._pose


def placed(rng):
    rotation = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    rotation[:, 0] *= np.linalg.det(rotation)
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = rotation, rng.uniform([-1.0, -1.0, -0.6], [1.0, 1.0, 1.4])
    return pose


@pytest.mark.parametrize(
    "region",
    [
        {"walls": (mt.Wall(normal=(1.0, 2.0, -1.0), offset=-0.3),)},
        {"boxes": (BOX,)},
        {"boxes": (replace(BOX, inside=True),)},
    ],
    ids=["wall", "out of a box", "inside a box"],
)
def test_rows_never_say_that_there_is_more_room_than_there_is(plane, region):
    """Against exact distances in random places; over the flat faces they agree to a centimetre."""
    robot, rng = replace(plane, link_capsules=(ROD,)), np.random.default_rng(1)
    parameters = mt.Parameters.of(robot, replace(HOP, **region), robot.home)
    (given,) = next(iter(region.values()))
    less = []
    for _ in range(200):
        pose = placed(rng)
        rows = np.array(cs.evalf(room(_At(pose[:3, :3], pose[:3, 3]), parameters))).ravel()
        free = exact_room(robot, given, ROD, pose[None], robot.home.joint_positions[:, None])[0]
        assert rows.min() <= free + 1e-9
        less.append(free - rows.min())
    assert min(less) < 0.01


def test_a_flight_keeps_under_a_ceiling_and_says_so(plane):
    free = replace(HOP, final_com=(0.0, 0.0, 0.5))
    low = replace(free, walls=(mt.Wall(normal=(0.0, 0.0, -1.0), offset=-0.52, of=("body",)),))
    solution = mt.solve(mt.build(plane, low))
    assert solution.feasible
    assert frame_poses(plane, solution.trajectory, "body")[:, 2, 3].max() < 0.52 + 1e-5
    assert mt.audit(plane, solution.trajectory, low)["beyond a wall or a box"].holds
    lower = replace(low, walls=(replace(low.walls[0], offset=-0.45),))
    finding = mt.audit(plane, solution.trajectory, lower)["beyond a wall or a box"]
    assert finding.worst == pytest.approx(0.05, abs=1e-3)
    assert finding.body == "body"


def test_a_region_holds_over_its_stretch_alone(plane):
    late = replace(HOP, boxes=(replace(BOX, of=("body",), begin=0.5),))
    problem = mt.build(plane, late)
    assert sorted(set(problem.rows["room"].knots.tolist())) == list(range(15, 31))


def test_the_doctor_says_what_is_beyond_a_wall_at_the_start(plane):
    wall = mt.Wall(normal=(0.0, 0.0, -1.0), offset=-0.3, of=("body",))
    (error,) = [
        some for some in mt.doctor(plane, replace(HOP, walls=(wall,))).of(Severity.ERROR) if "walls" in some.name
    ]
    assert "'body' is 0.1 m beyond" in error.found
    later = replace(HOP, walls=(replace(wall, begin=0.5, end=0.6),))
    assert not [some for some in mt.doctor(plane, later).of(Severity.ERROR) if "walls" in some.name]


def test_what_has_no_capsules_has_to_name_frames(plane):
    with pytest.raises(ModelError, match="has no capsules"):
        bodies_of(plane, ())
    assert any("no capsules" in some.found for some in mt.doctor(plane, replace(HOP, boxes=(BOX,))).of(Severity.ERROR))


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (lambda: mt.Wall(normal=(0.0, 0.0, 0.0), offset=0.0), "a direction with a length"),
        (lambda: mt.Box(lower=(0.0, 0.0, 0.0), upper=(1.0, 0.0, 1.0)), "that rise"),
        (
            lambda: mt.Box(lower=(0.0, 0.0, 0.0), upper=(1.0, 1.0, 1.0), begin=0.5, end=0.2),
            "expected a begin no later than the end",
        ),
        (lambda: mt.Wall(normal=(0.0, 0.0, 1.0), offset=0.0, distance=-0.1), "distance is -0.1"),
    ],
)
def test_a_region_that_is_none_is_refused(make, says):
    with pytest.raises(ScenarioError, match=says):
        make()

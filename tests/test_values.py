"""Every public value travels to another process, copies, compares and hashes by what it holds."""

from __future__ import annotations

import copy
import inspect
import multiprocessing
import pickle
from dataclasses import replace
from typing import Any

import casadi as cs
import numpy as np
import pytest

import multimodal_to as mt
from drones import drone
from multimodal_to.errors import apart
from multimodal_to.ocp.integration import LEAPFROG
from multimodal_to.trajectory.rules import VELOCITIES
from multimodal_to.values import FrozenMapping
from synthetic import take_off

NO_VALUES = {"Planner"}
"""They change as they are used."""
KEPT_APART = {"Knot", "Interval"}
"""They hold symbols, which are others in each process."""


def knot(robot: mt.Robot) -> mt.Knot:
    sizes = {"base_quaternion_xyzw": 4, "joint_positions": 1, "joint_velocities": 1, "contact_positions": 12}
    sizes |= {"contact_forces": 12, **dict.fromkeys(("thrust", "thrust_rate", "throttle"), 2)}
    names = [name for name in inspect.signature(mt.Knot).parameters if name not in ("robot", "lift")]
    return mt.Knot(robot, **{name: cs.SX.sym(name, sizes.get(name, 3)) for name in names})


def least_weight(parameters: mt.Parameters) -> float:
    return parameters.robot.weight


@pytest.fixture(scope="module")
def values(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """A value of every public class, by its name."""
    robot = drone(tmp_path_factory.mktemp("drone"), antenna=True)
    weights = mt.Weights(joint_velocities={"wings": 1.0}, com_velocity=2.0)
    scenario = replace(
        mt.scenarios.take_off(),
        knots=4,
        initial_com=[0.0, 0.0, 0.4],
        final_com=np.array([0.0, 0.0, 0.5]),
        weights=replace(weights, joint_velocities={}),
        allowances={"force balance": 1.0},
    )
    problem = mt.build(robot, scenario)
    trajectory = take_off(robot)
    at = knot(robot)
    surfaces = {
        "FlatGround": mt.FlatGround(height=0.1),
        "Plane": mt.Plane(slope=0.1, direction=[1.0, 1.0]),
        "Stairs": mt.Stairs(edges=[0.5], heights=[0.0, 0.1]),
        "HeightField": mt.HeightField.sampled(lambda x, y: x * y, x_range=[0, 1], y_range=(0, 1), spacing=0.2),
    }
    surfaces["HeightField"].height_and_slopes(cs.SX.sym("x"), cs.SX.sym("y"))  # which keeps something beside its fields
    return {
        **surfaces,
        "Audit": mt.audit(robot, trajectory, scenario),
        "Box": mt.Box(lower=[0, 0, 0], upper=(1.0, 1.0, 1.0), inside=True),
        "Constraint": mt.Constraint(value=least_weight, within=mt.at_least(least_weight), unit=["N"], labels=["z"]),
        "ContactState": mt.ContactState.OFF,
        "ContactStretch": mt.ContactStretch(of=["left"], state=mt.ContactState.ON, end=0.5),
        "Cost": mt.Cost(residual=least_weight, weight=1.0, unit="N"),
        "Diagnosis": mt.doctor(robot, scenario),
        "Ending": mt.Ending(x=np.zeros(3), status=mt.Status.FAILED, iterations=1, statistics={"a": [1.0]}),
        "Formulation": mt.Formulation.executable(),
        "FrameTarget": mt.FrameTarget(position=np.ones(3), orientation=[0.0, 0.0, 0.0, 2.0]),
        "FrictionCone": mt.FrictionCone.SECOND_ORDER,
        "GaitKind": mt.GaitKind.TROT,
        "GaitPlan": mt.GaitPlan(kind=mt.GaitKind.WALK, steps=4, clearance=0.01),
        "Interval": mt.Interval(at, knot(robot), cs.SX.sym("dt"), LEAPFROG),
        "Intervals": mt.Intervals([2]),
        "Ipopt": mt.Ipopt(max_iterations=3),
        "JetFailure": mt.JetFailure(jet="left", at=0.5),
        "Keyframe": mt.Keyframe(knot=2, com=[0.0, 0.0, 0.5], joints={"antenna": 0.1}),
        "KinDynComputations": robot.kindyn,
        "Knot": at,
        "Knots": mt.Knots(np.array([1, 2])),
        "KnownPush": mt.KnownPush(of="body", force=[1, 0, 0], begin=0.2),
        "Limits": mt.Limits(base_speed=1, thrusts={"left": 100}, begin=0.2),
        "Margins": mt.Margins(torque=0.5),
        "Momentum": mt.Momentum(angular={"z": 1.0}),
        "Parameters": mt.Parameters.of(robot, scenario, robot.home),
        "Problem": problem,
        "Robot": robot,
        "Scenario": scenario,
        "Solution": mt.solve(problem, mt.Ipopt(max_iterations=1)),
        "Start": mt.Start.HOVER,
        "State": mt.state_at(trajectory, 0.5),
        "StartPoint": mt.StartPoint(x=np.ones(2), record={"pass": "rough"}),
        "Status": mt.Status.OPTIMAL,
        "Terminal": mt.Terminal.FREE,
        "Trajectory": trajectory,
        "Wall": mt.Wall(normal=[0, 0, 2], offset=0.1, of="body"),
        "Weights": weights,
        "Where": mt.Where.LAST_KNOT,
    }


def public_classes() -> list[str]:
    things = {name: getattr(mt, name) for name in mt.__all__}
    return [
        name
        for name, thing in things.items()
        if name not in NO_VALUES
        and isinstance(thing, type)
        and not issubclass(thing, Exception)
        and not getattr(thing, "_is_protocol", False)
    ]


def test_every_public_class_is_held_to_it(values):
    assert sorted(values) == sorted(public_classes())
    assert all(type(value).__name__ == name for name, value in values.items())


@pytest.mark.parametrize("name", public_classes())
@pytest.mark.parametrize("again", [copy.copy, copy.deepcopy], ids=["copied", "deeply copied"])
def test_a_copy_equals_what_it_is_of_and_hashes_as_it(values, name, again):
    value = values[name]
    other = again(value)
    assert other == value
    assert hash(other) == hash(value)
    assert {value: 1}[other] == 1
    assert value != object()


@pytest.mark.parametrize("name", [name for name in public_classes() if name not in KEPT_APART])
def test_what_is_unpickled_equals_what_was_pickled(values, name):
    value = values[name]
    other = pickle.loads(pickle.dumps(value))
    assert other == value
    assert hash(other) == hash(value)


def test_knots_and_intervals_keep_what_depends_on_what(values):
    interval = pickle.loads(pickle.dumps(mt.Interval(values["Knot"], values["Knot"], cs.SX.sym("dt"), LEAPFROG)))
    assert interval.start.robot == values["Robot"]
    for name in VELOCITIES:
        assert getattr(interval.start, name).shape == getattr(values["Knot"], name).shape
    at = replace(values["Knot"], com_velocity=2 * values["Knot"].com_position)
    moved = pickle.loads(pickle.dumps(at))
    assert cs.depends_on(moved.com_velocity, moved.com_position)


def returned(value: Any) -> Any:
    return value


def test_a_pool_of_processes_takes_and_returns_every_value(values):
    sent = [value for name, value in values.items() if name not in KEPT_APART]
    with multiprocessing.get_context("spawn").Pool(1) as pool:
        assert pool.map(returned, sent) == sent


def test_a_value_differs_where_one_of_its_numbers_does(values):
    robot, trajectory = values["Robot"], values["Trajectory"]
    assert replace(robot, friction=0.4) != robot
    assert replace(trajectory, thrust=trajectory.thrust + 1e-9) != trajectory
    assert replace(trajectory, thrust=trajectory.thrust.copy()) == trajectory
    assert mt.Plane(slope=0.1) != mt.Plane(slope=0.2)
    moon = copy.deepcopy(robot.kindyn)
    moon.g = (0.0, 0.0, -1.62)
    assert moon != robot.kindyn
    assert robot.gravity[2] == pytest.approx(-9.80665)


def test_the_arrays_of_a_value_cannot_be_written_to(values):
    for array in (values["Trajectory"].thrust, values["Robot"].home.joint_positions, values["Problem"].guess):
        for held in (array, pickle.loads(pickle.dumps(values["Trajectory"])).thrust):
            with pytest.raises(ValueError, match="read-only"):
                held[...] = 0.0


def test_a_value_leaves_the_arrays_that_it_was_made_of_alone():
    x = np.zeros(2)
    point = mt.StartPoint(x=x)
    x[0] = 1.0
    assert point.x.tolist() == [0.0, 0.0]


def test_a_frozen_mapping_is_a_mapping_and_nothing_more():
    mapping = FrozenMapping({"b": 1, "a": 2})
    assert list(mapping) == ["b", "a"]
    assert mapping == {"a": 2, "b": 1} == dict(mapping)
    assert hash(mapping) == hash(FrozenMapping({"a": 2, "b": 1}))
    with pytest.raises(TypeError):
        mapping["c"] = 3
    with pytest.raises(AttributeError):
        mapping.more = 3


def test_numbers_that_are_compared_are_told_apart():
    assert apart(0.1, 0.1003) == "0.1"
    assert apart(0.10030412, 0.1) == "0.1003"
    assert apart(1.0000001e-5, 1e-5) == "1.0000001e-05"
    assert apart(2.0, 2.0) == "2"

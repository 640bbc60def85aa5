"""A wrong argument of a public function, or field of a public value, is refused in one sentence of our own."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from dataclasses import fields, is_dataclass, replace
from typing import Any

import casadi as cs
import numpy as np
import pytest

import multimodal_to as mt
from commands import run_process
from drones import drone
from multimodal_to.adam.quantity import ARGUMENTS
from multimodal_to.arguments import check
from multimodal_to.errors import InputError, MultimodalError
from multimodal_to.models.capsule import Capsule
from multimodal_to.models.contact import ContactPoint
from multimodal_to.simulation import Push
from odd_robots import at_rest

WRONG: dict[str, Any] = {
    "text": "no such thing",
    "number": 3,
    "None": None,
    "list": [1],
    "nested": [["a"]],
    "symbol": cs.SX.sym("x", 3),
    "complex": 1j,
    "bytes": b"x",
    "NaN": float("nan"),
    "object": object(),
}


@pytest.fixture(scope="module")
def robot(tmp_path_factory) -> mt.Robot:
    return drone(tmp_path_factory.mktemp("drone"), antenna=True)


@pytest.fixture(scope="module")
def values(robot) -> dict[str, Any]:
    """A value of every public dataclass whose fields a person fills in, and of those in a robot, by its name."""
    return {
        "Box": mt.Box(lower=(0.0, 0.0, 0.0), upper=(1.0, 1.0, 1.0)),
        "Constraint": mt.Constraint(value=len, within=mt.equal(), unit="m"),
        "ContactStretch": mt.ContactStretch(of=("left",), state=mt.ContactState.OFF),
        "Cost": mt.Cost(residual=len, weight=1.0, unit="m"),
        "FlatGround": mt.FlatGround(),
        "Formulation": mt.Formulation.paper(),
        "FrameTarget": mt.FrameTarget(position={"z": 0.1}),
        "GaitPlan": mt.GaitPlan(kind=mt.GaitKind.WALK, steps=2),
        "HeightField": mt.HeightField(x_range=(0, 1), y_range=(0, 1), heights=[[0.0] * 4] * 4),
        "Intervals": mt.Intervals((1,)),
        "Ipopt": mt.Ipopt(),
        "Keyframe": mt.Keyframe(knot=1, yaw=0.1, joints={"antenna": 0.1}),
        "Knots": mt.Knots((1,)),
        "JetFailure": mt.JetFailure(jet="left arm"),
        "KnownPush": mt.KnownPush(of="chest", force=(1.0, 0.0, 0.0)),
        "Limits": mt.Limits(base_speed=1.0),
        "Margins": mt.Margins(),
        "Momentum": mt.Momentum(angular={"z": 0.0}),
        "Plane": mt.Plane(slope=0.1),
        "Robot": robot,
        "Scenario": mt.scenarios.take_off(),
        "State": mt.State.at_rest(robot),
        "Stairs": mt.Stairs(edges=[0.0], heights=[0.0, 0.1]),
        "Trajectory": at_rest(robot),
        "Wall": mt.Wall(normal=(1.0, 0.0, 0.0), offset=0.0),
        "Weights": mt.Weights(),
        "ContactPoint": ContactPoint(frame="foot", foot="foot"),
        "Capsule": Capsule(name="leg", frame="leg", start=np.zeros(3), end=np.ones(3), radius=0.1),
        "Gait": robot.gait,
        "Jet": robot.jets[0],
        "JetModel": robot.jets[0].model,
        "JointLimits": robot.joint_limits,
        "Posture": robot.home,
        "Push": Push(force=(0.0, 0.0, 1.0), start=0.0, duration=1.0),
    }


MADE_HERE = {
    "Audit",
    "Diagnosis",
    "Ending",
    "Interval",
    "Knot",
    "Parameters",
    "Problem",
    "Solution",
    "StartPoint",
}
"""What the library makes, and a person reads."""


def refused(call: Callable[[], object]) -> bool:
    """Whether a call is refused in one sentence of the library's own; any other exception goes through."""
    try:
        call()
    except MultimodalError as error:
        sentence = str(error)
    else:
        return False
    assert "\n" not in sentence
    assert len(sentence) > 10
    return True


def test_every_public_dataclass_is_tried(values):
    known = {name for name in mt.__all__ if is_dataclass(getattr(mt, name))}
    assert known <= set(values) | MADE_HERE
    assert known >= MADE_HERE


@pytest.mark.parametrize("wrong", WRONG.values(), ids=WRONG)
def test_a_field_is_taken_or_refused(values, wrong):
    taken = set()
    for name, value in values.items():
        for entry in fields(value):
            if entry.init and not refused(lambda value=value, entry=entry: replace(value, **{entry.name: wrong})):
                taken.add((name, entry.name, entry.type))
    if not isinstance(wrong, str | int | list | type(None)):
        assert {kind for *_, kind in taken} <= {"Limit"}


ARGUMENTS_WRONG: dict[str, Callable[[mt.Robot, Any], object]] = {
    "load_robot": lambda robot, wrong: mt.load_robot(wrong),
    "with_jets": lambda robot, wrong: robot.with_jets(wrong),
    "group_indices": lambda robot, wrong: robot.group_indices(wrong),
    "build: robot": lambda robot, wrong: mt.build(wrong, mt.scenarios.take_off()),
    "build: scenario": lambda robot, wrong: mt.build(robot, wrong),
    "doctor": lambda robot, wrong: mt.doctor(robot, wrong),
    "solve": lambda robot, wrong: mt.solve(wrong),
    "relax": lambda robot, wrong: mt.relax(wrong),
    "audit: robot": lambda robot, wrong: mt.audit(wrong, at_rest(robot)),
    "audit: trajectory": lambda robot, wrong: mt.audit(robot, wrong),
    "audit[...]": lambda robot, wrong: mt.audit(robot, at_rest(robot))[wrong],
    "scenarios.find": lambda robot, wrong: mt.scenarios.find(wrong),
    "scenarios.paper": lambda robot, wrong: mt.scenarios.paper(wrong),
    "scenario_files.load": lambda robot, wrong: mt.scenario_files.load(wrong),
    "scenario_files.change": lambda robot, wrong: mt.scenario_files.change(mt.scenarios.take_off(), wrong),
    "scenario_files.to_toml": lambda robot, wrong: mt.scenario_files.to_toml(wrong),
    "Trajectory.load": lambda robot, wrong: mt.Trajectory.load(wrong),
    "labels": lambda robot, wrong: at_rest(robot).labels(wrong),
    "times": lambda robot, wrong: at_rest(robot).times(wrong),
    "per_contact": lambda robot, wrong: at_rest(robot).per_contact(wrong),
    "of_rule": lambda robot, wrong: mt.Formulation.of_rule(wrong),
    "with_terms": lambda robot, wrong: mt.Formulation.paper().with_terms(wrong),
    "without": lambda robot, wrong: mt.Formulation.paper().without(wrong),
    "with_scales": lambda robot, wrong: mt.Formulation.paper().with_scales(wrong),
    "URDF": lambda robot, wrong: mt.KinDynComputations(wrong),
    "joints": lambda robot, wrong: mt.KinDynComputations(robot.urdf, [wrong]),
    "locked joints": lambda robot, wrong: mt.KinDynComputations(robot.urdf, [], locked_joints={"antenna": wrong}),
    "gravity": lambda robot, wrong: mt.KinDynComputations(robot.urdf, gravity=wrong),
    "representation": lambda robot, wrong: mt.KinDynComputations(robot.urdf, representation=wrong),
    "frame": lambda robot, wrong: robot.kindyn.forward_kinematics_fun(wrong),
    "frames": lambda robot, wrong: robot.kindyn.rnea_fun([wrong]),
    "HeightField.sampled": lambda robot, wrong: mt.HeightField.sampled(
        lambda x, y: wrong, x_range=(0, 1), y_range=(0, 1), spacing=0.2
    ),
}
TAKEN = {
    ("representation", "number"),
    ("joints", "text"),
    ("locked joints", "number"),
    ("HeightField.sampled", "number"),
}


@pytest.mark.parametrize("wrong", WRONG)
@pytest.mark.parametrize("function", ARGUMENTS_WRONG)
def test_an_argument_is_refused(robot, function, wrong):
    assert refused(lambda: ARGUMENTS_WRONG[function](robot, WRONG[wrong])) or (function, wrong) in TAKEN


@pytest.mark.parametrize("wrong", [wrong for wrong in WRONG if wrong != "symbol"])
@pytest.mark.parametrize("argument", ARGUMENTS)
def test_an_argument_of_a_quantity_is_refused(robot, argument, wrong):
    for quantity in ("rnea", "aba"):
        method = getattr(robot.kindyn, quantity)
        names = [name for name in inspect.signature(method).parameters if name in ARGUMENTS]
        if argument not in names:
            continue
        shapes = {name: ARGUMENTS[name].shape for name in names}
        given = {name: np.zeros([1 if size is None else size for size in shape]) for name, shape in shapes.items()}
        given[argument] = WRONG[wrong]
        right = ("number", "list") if shapes[argument][0] is None else ()
        assert refused(lambda method=method, given=given: method(**given)) or wrong in right


def test_lists_of_symbols_are_columns_and_kinds_of_symbols_are_not_mixed(robot):
    s, v = cs.SX.sym("s"), [cs.SX.sym(f"v_{index}") for index in range(6)]
    momentum = robot.kindyn.centroidal_momentum(cs.SX.eye(4), [s], v, [0.0])
    assert cs.depends_on(momentum, cs.vertcat(*v))
    with pytest.raises(InputError, match="SX and some MX"):
        robot.kindyn.centroidal_momentum(cs.MX.eye(4), [s], v, [0.0])
    with pytest.raises(InputError, match="mixes SX and MX"):
        robot.kindyn.centroidal_momentum(cs.SX.eye(4), [s], [*v[:5], cs.MX.sym("x")], [0.0])


def test_a_sentence_says_what_was_expected():
    for value, annotation, said in (
        ("x", float, "x is 'x'; expected a number"),
        (True, int, "x is True; expected a whole number"),
        ("ab", tuple[str, ...], "x is 'ab'; expected a sequence of texts"),
        (3, dict[str, float], "x is 3; expected a mapping from texts to numbers"),
        (3, str | None, "x is 3; expected a text"),
        (3, Callable[[], None], "x is 3; expected a function"),
        (3, mt.Robot, "x is 3; expected a Robot"),
        (3, mt.Ipopt, "x is 3; expected an Ipopt"),
    ):
        with pytest.raises(InputError, match=f"^{said}$"):
            check("x", value, annotation)


def test_numbers_of_numpy_are_numbers():
    assert mt.Margins(torque=np.float32(0.5)).torque == 0.5
    assert mt.Weights(joint_velocities={"legs": np.int64(2)}).joint_velocities == {"legs": 2}


def test_a_backend_that_matplotlib_does_not_know_is_one_sentence(tmp_path):
    file = at_rest(drone(tmp_path)).save(tmp_path / "motion.npz")
    ended = run_process("plot", file, "--robot", tmp_path, MPLBACKEND="nonsense")
    assert (ended.returncode, ended.stdout) == (2, "")
    assert ended.stderr.startswith("error: matplotlib does not start: MPLBACKEND is 'nonsense'; expected a backend")
    assert len(ended.stderr.splitlines()) == 1

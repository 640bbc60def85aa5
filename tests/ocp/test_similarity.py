"""Robots of one shape move alike, whatever their size (W. Froude, 1874): so do their plans, step by step."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from collections.abc import Mapping
from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest

import multimodal_to as mt
from hopper import hop, hopper
from multimodal_to.models.jet import FirstOrder
from multimodal_to.trajectory import QUANTITIES, row_units

_ATTRIBUTES = {"xyz": "m", "value": "kg", "effort": "N m", "velocity": "rad/s"}
_INERTIA = ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")
_WEIGHTED = {
    "com_velocity": "m/s",
    "com_acceleration": "m/s²",
    "angular_momentum": "kg m²/s",
    "joint_velocities": "rad/s",
    "posture": "rad",
    "contact_forces": "N",
    "contact_force_rates": "N/s",
    "throttle": "%",
}
"""What each weight of the hop is per square of, beside one unit of time."""


def ratio(large: mt.Robot, small: mt.Robot, unit: str) -> float:
    return small.units.of(unit) / large.units.of(unit)


def large_one(folder: Path) -> mt.Robot:
    """The hopper on quick fans, whose lag scales as all else does."""
    robot = hopper(folder)
    fan = FirstOrder(gain=2.2, time_constant=0.1)
    return replace(robot, jets=tuple(replace(jet, model=fan) for jet in robot.jets))


def small_one(folder: Path, large: mt.Robot, mass: float, length: float) -> mt.Robot:
    """The same robot, with all masses and lengths, and what follows from them, times a factor.

    Args:
        folder: where to write it.
        large: the robot that it is like; its files are beside this one's.
        mass: factor of masses.
        length: factor of lengths.
    """
    factors = {"m": length, "kg": mass, "N m": mass * length, "rad/s": length**-0.5}
    tree = ElementTree.parse(large.urdf)
    for element in tree.iter():
        for name, unit in _ATTRIBUTES.items():
            if name in element.attrib and element.tag != "axis":
                numbers = (float(number) * factors[unit] for number in element.attrib[name].split())
                element.set(name, " ".join(map(repr, numbers)))
        if element.tag == "inertia":
            for name in _INERTIA:
                element.set(name, repr(float(element.attrib[name]) * mass * length**2))
    folder.mkdir()
    tree.write(folder / "hopper.urdf")
    text = (large.urdf.parent / "robot.toml").read_text(encoding="utf-8")
    text = text.replace("speed = 3.0", f"speed = {3.0 * length**-0.5!r}").replace("220.0", f"{220.0 * mass!r}")
    (folder / "robot.toml").write_text(text, encoding="utf-8")
    robot = mt.load_robot(folder)
    fan = FirstOrder(gain=2.2 * mass, time_constant=0.1 * length**0.5)
    home = replace(robot.home, base_position=large.home.base_position * length)
    return replace(robot, jets=tuple(replace(jet, model=fan) for jet in robot.jets), home=home)


def small_task(task: mt.Scenario, large: mt.Robot, small: mt.Robot) -> mt.Scenario:
    """The task with lengths, times and weights of the small robot."""
    length, time = ratio(large, small, "m"), ratio(large, small, "s")
    weights = {}
    for entry in fields(task.weights):
        value = getattr(task.weights, entry.name)
        if value:
            share = 1.0 / (time * ratio(large, small, _WEIGHTED[entry.name]) ** 2)
            by_group = isinstance(value, Mapping)
            weights[entry.name] = {key: one * share for key, one in value.items()} if by_group else value * share
    return replace(
        task,
        initial_com=tuple(length * x for x in task.initial_com),
        final_com=tuple(length * x for x in task.final_com),
        interval_min=time * task.interval_min,
        interval_max=time * task.interval_max,
        weights=mt.Weights(**weights),
    )


@pytest.mark.parametrize(("mass", "length"), [(1 / 16, 1 / 4), (0.1, 0.5)])
def test_a_small_robot_of_the_same_shape_lands_alike_and_its_plan_takes_the_same_iterations(tmp_path, mass, length):
    large = large_one(tmp_path / "large")
    small = small_one(tmp_path / "small", large, mass, length)
    assert small.units.mass == pytest.approx(mass * large.units.mass)
    assert small.units.length == pytest.approx(length * large.units.length)
    task = hop(
        large,
        knots=12,
        start=mt.Start.HOVER,
        initial_com=(0.05, 0.0, 0.6),
        final_com=(0.0, 0.0, 0.4),
        terminal=mt.Terminal.STANDING,
    )
    first, second = (
        mt.solve(mt.build(robot, own)) for robot, own in ((large, task), (small, small_task(task, large, small)))
    )
    assert first.status is second.status is mt.Status.OPTIMAL
    assert second.iterations == first.iterations
    assert second.objective == pytest.approx(first.objective, rel=1e-9)
    for name in ("com_position", "com_velocity", "joint_velocities", "contact_forces", "thrust", "thrust_rate"):
        units = row_units(QUANTITIES[name], large)
        wanted, found = (
            getattr(one.trajectory, name) / np.array([[robot.units.of(unit)] for unit in units])
            for robot, one in ((large, first), (small, second))
        )
        assert np.abs(wanted).max() > 1e-2, name
        assert found == pytest.approx(wanted, rel=1e-6, abs=1e-8), name
    assert mt.audit(small, second.trajectory).holds == mt.audit(large, first.trajectory).holds

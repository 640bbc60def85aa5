"""Starter tasks on the ground and off it by the legs alone."""

from __future__ import annotations

import math
from typing import Any

from multimodal_to.arguments import checked
from multimodal_to.errors import ScenarioError
from multimodal_to.models.robot import Robot
from multimodal_to.scenarios.contacts import ContactState
from multimodal_to.scenarios.gaits import GaitKind, GaitPlan, groups_of
from multimodal_to.scenarios.keyframes import HOME, Keyframe, Momentum
from multimodal_to.scenarios.margins import Margins
from multimodal_to.scenarios.scenario import Scenario, Terminal
from multimodal_to.tasks.costs import weights
from multimodal_to.tasks.given import given, looks, positive, refuse_footless
from multimodal_to.tasks.leaping import leap_height
from multimodal_to.trajectory.instants import END

DEPTH, HEIGHT = 0.2, 0.15
"""How far a robot squats and jumps by default, the latter at most [L]."""
LEAST = 0.02
"""A robot whose motors throw it less high is refused to jump by default [L]."""
DISTANCE = {GaitKind.WALK: 0.8, GaitKind.TROT: 1.5, GaitKind.BOUND: 0.8, GaitKind.JUMP: 0.6}
"""How far it gets by default [L]."""
STRIDE = {GaitKind.WALK: 0.4, GaitKind.TROT: 0.8, GaitKind.BOUND: 0.5, GaitKind.JUMP: 0.3}
"""How far each foot goes at most from one standing place to the next [L]."""


@checked
def squat(robot: Robot, *, depth: float | None = None) -> Scenario:
    """Return a squat: from home down and up again, with all feet on the ground.

    Args:
        robot: that squats.
        depth: how far its CoM goes down [m]; 0.2 L where it is not said.

    Raises:
        ScenarioError: the robot has no feet, or the depth is no positive number.
    """
    _refuse_stiff(robot, "a squat")
    depth = positive("depth", DEPTH * robot.standing_height if depth is None else depth, "m")
    return _on_feet(
        robot,
        "squat",
        f"Squat by {depth:.3g} m",
        knots=40,
        interval=0.2,
        keyframes=(Keyframe(when=0.5, com=HOME, com_shift=(0.0, 0.0, -depth), rest=True),),
        contacts=(given(robot, ContactState.ON, 0.0, 1.0),),
    )


@checked
def jump(robot: Robot, *, height: float | None = None) -> Scenario:
    """Return a jump by the legs: with all feet in the air for T = 2 √(2 h / g), and the CoM h above home at the apex.

    Args:
        robot: that jumps; its jets are off.
        height: h, how far the CoM rises above home [m]; where it is not said 0.15 L, or `leap_height` where that is
            less.

    Raises:
        ScenarioError: the robot has no feet or no legs, there is no gravity, the height is no positive number, or
            none is said and the joints are too weak or too slow.
    """
    _refuse_stiff(robot, "a jump")
    length = robot.standing_height
    if not robot.weight:
        raise ScenarioError(
            f"{robot.name} is without gravity; expected some for a jump, which ends where it falls back"
        )
    height = _easy_height(robot) if height is None else positive("height", height, "m")
    flight = 2.0 * math.sqrt(2.0 * height / length)  # in units of time
    in_air, before = max(round(flight / 0.06), 4), 40
    knots = 2 * before + in_air
    begin, end = before / knots, (before + in_air) / knots
    return _on_feet(
        robot,
        "jump",
        f"Jump by {height:.3g} m",
        knots=knots,
        interval=flight / in_air,
        margins=Margins(touch_down_speed=math.sqrt(2.0 * height / length)),
        mid_height_min=robot.home_com[2] + height,
        keyframes=(Keyframe(when=END, momentum=Momentum(linear=(0.0, 0.0, 0.0))),),
        contacts=(
            given(robot, ContactState.ON, 0.0, begin),
            given(robot, ContactState.OFF, begin, end, clearance=0.5 * height),
            given(robot, ContactState.ON, end, 1.0),
        ),
    )


@checked
def step(robot: Robot, *, ahead: float | None = None, aside: float = 0.0) -> Scenario:
    """Return one step of each foot, after which the robot stands as at home, elsewhere.

    Args:
        robot: that steps.
        ahead: how far it gets where it looks, see `looks` [m]; 0.3 L where neither is said.
        aside: how far it gets to its left [m].

    Raises:
        ScenarioError: the robot has no legs, or neither two feet nor four.
    """
    _refuse_stiff(robot, "a step")
    ahead = (0.0 if aside else 0.3 * robot.standing_height) if ahead is None else ahead
    return _gait(robot, "step", f"Step by {math.hypot(ahead, aside):.3g} m", GaitKind.WALK, (ahead, aside), 1)


@checked
def walk(robot: Robot, *, distance: float | None = None, gait: GaitKind = GaitKind.WALK) -> Scenario:
    """Return a walk from standing to standing, in as many steps as the legs' length asks for.

    Args:
        robot: that walks.
        distance: how far it gets where it looks, backwards where it is negative [m]; where it is not said,
            `DISTANCE` of the gait.
        gait: which feet swing together.

    Raises:
        ScenarioError: the robot has no legs, or not the number of feet that the gait is for.
    """
    _refuse_stiff(robot, f"a {gait.value}")
    length = robot.standing_height
    distance = DISTANCE[gait] * length if distance is None else distance
    rounds = max(math.ceil(abs(distance) / (STRIDE[gait] * length) - 1e-9), 1)
    return _gait(robot, gait.value, f"{gait.value.capitalize()} of {distance:.3g} m", gait, (distance, 0.0), rounds)


@checked
def trot(robot: Robot, *, distance: float | None = None) -> Scenario:
    """Return a trot of a robot on four feet: those that are diagonal to each other swing together.

    Args:
        robot: that trots.
        distance: how far it gets where it looks, backwards where it is negative [m]; 1.5 L where it is not said.

    Raises:
        ScenarioError: the robot has no legs, or not four feet.
    """
    _refuse_stiff(robot, "a trot")
    if len(robot.feet) != 4:
        raise ScenarioError(f"{robot.name} has {len(robot.feet)} feet; expected four for a trot, see walk")
    return walk(robot, distance=distance, gait=GaitKind.TROT)


_PACE = {GaitKind.WALK: (12, 0.25), GaitKind.TROT: (10, 0.15), GaitKind.BOUND: (10, 0.1), GaitKind.JUMP: (10, 0.1)}
"""How many intervals a step lasts, and how long one is [√(L/g)]."""
_AT_REST = 2.5
"""How long the robot stands before its first step and after its last one [√(L/g)]."""


def _gait(robot: Robot, name: str, title: str, kind: GaitKind, way: tuple[float, float], rounds: int) -> Scenario:
    if not all(map(math.isfinite, way)):
        raise ScenarioError(f"the way is {way[0]} m ahead and {way[1]} m aside; expected finite numbers")
    each, interval = _PACE[kind]
    steps, still = rounds * len(groups_of(robot, kind)), round(_AT_REST / interval)
    knots = 2 * still + each * steps
    plan = GaitPlan(kind=kind, steps=steps, begin=still / knots, end=1.0 - still / knots, clearance=robot.gait.lift)
    return _on_feet(
        robot,
        name,
        title,
        knots=knots,
        interval=interval,
        margins=Margins(touch_down_speed=0.15 if kind is GaitKind.WALK else 0.25),
        final_com_shift=(looks(robot) * way[0], looks(robot) * way[1], 0.0),
        gait=plan,
    )


def _on_feet(robot: Robot, name: str, title: str, *, knots: int, interval: float, **more: Any) -> Scenario:
    refuse_footless(robot, name)
    time = robot.units.of("s")
    return Scenario(
        name=name,
        title=title,
        knots=knots,
        jets=False,
        initial_com=HOME,
        final_com=HOME,
        terminal=Terminal.STANDING,
        interval_min=interval * time,
        interval_max=interval * time,
        weights=weights(robot, robot.units),
        **more,
    )


def _refuse_stiff(robot: Robot, what: str) -> None:
    refuse_footless(robot, what.split()[-1])
    if not robot.joint_names:
        raise ScenarioError(f"{robot.name} has no joints; expected a robot with legs that move for {what}")
    tree = robot.kindyn.tree
    if not any(tree.path(tree.frame(name).body) for name in robot.contact_names):
        raise ScenarioError(f"no joint moves a foot of {robot.name}; expected a robot with legs that move for {what}")


def _easy_height(robot: Robot) -> float:
    """Return how high a robot jumps by default [m]: `HEIGHT` L, or what its motors can do where that is less.

    Raises:
        ScenarioError: its motors are too weak or too slow.
    """
    height = leap_height(robot)
    if height < LEAST * robot.standing_height:
        raise ScenarioError(
            f"the joints of {robot.name} are too weak or too slow for a jump: they throw it {1000.0 * height:.2g} mm "
            "high at most; expected stronger and faster ones, or a height [m] to try"
        )
    return min(HEIGHT * robot.standing_height, height)

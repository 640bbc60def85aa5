"""Where all thrusts push along one line of the base: the row of a hover that follows from the others is left out."""

from __future__ import annotations

import casadi as cs
import numpy as np

from multimodal_to.adam.kinematics import frame_in_base
from multimodal_to.models.robot import Robot
from multimodal_to.ocp.parameters import Parameters
from multimodal_to.ocp.schedule import Flags
from multimodal_to.scenarios.scenario import Start, Terminal

PARALLEL = 1e-9
"""How far the thrusts of jets may be off one line [rad]."""


def push_along_one_line(robot: Robot) -> bool:
    """Return whether all thrusts push along one line of the base, whatever the joints do, and no rotor has drag.

    Their moment about that line n is zero then, whatever they do: n · Σ (p_i − x) × T_i n = 0.
    """
    if not robot.jets or any(jet.drag for jet in robot.jets):
        return False
    tree, s = robot.kindyn.tree, cs.SX.sym("s", len(robot.joint_names))
    lines = [frame_in_base(tree, tree.frame(jet.frame), s).rotation[:, 2] for jet in robot.jets]
    if any(cs.depends_on(line, s) for line in lines):
        return False
    first, *others = (np.array(cs.DM(line)).ravel() for line in lines)
    return all(float(np.linalg.norm(np.cross(first, other))) < PARALLEL for other in others)


def needed_first(parameters: Parameters) -> Flags:
    """Return which rows of the balance of forces and moments a start needs, (6, N + 1)."""
    return _needed(parameters, 0, parameters.scenario.start is Start.HOVER)


def needed_over_intervals(parameters: Parameters) -> Flags:
    """Return which rows of the momentum's dynamics the intervals need, (6, N + 1); column k is of the one to knot k.

    The momentum is zero at both ends of the last interval before a hover, which therefore says that forces balance.
    """
    return _needed(parameters, parameters.scenario.knots, parameters.scenario.terminal is Terminal.HOVER)


def _needed(parameters: Parameters, knot: int, hovers: bool) -> Flags:
    """Return which rows are needed: all but that of the moment about the vertical where a hover ends the horizon.

    The balance of forces lets the thrusts be vertical there, so that this moment is zero. Where the robot hovers on its
    way as well, all rows stay: as it cannot turn about that line in the air, rows nearly follow from others anyway, and
    of 8 such solves without the row 2 failed that do not with it.

    Args:
        parameters: of the problem.
        knot: the column at which the row is left out.
        hovers: whether the robot hovers there.
    """
    robot, scenario = parameters.robot, parameters.scenario
    needed = np.ones((6, scenario.knots + 1), dtype=bool)
    between = any(one.keyframe.hover for one in scenario.keyframes_between())
    if hovers and not between and push_along_one_line(robot):
        needed[3 + int(np.argmax(np.abs(robot.up))), knot] = False
    return needed

"""Where a known push acts: the rows of momentum and joint torques there, in place of those without it."""

from __future__ import annotations

import casadi as cs
import numpy as np

from multimodal_to.adam.spatial import SX
from multimodal_to.ocp import constraints
from multimodal_to.ocp.integration import Interval
from multimodal_to.ocp.parameters import Parameters
from multimodal_to.ocp.schedule import Flags
from multimodal_to.trajectory import rules
from multimodal_to.trajectory.pushes import KnownPush, acting


def groups(parameters: Parameters) -> list[tuple[tuple[KnownPush, ...], Flags]]:
    """Return each set of pushes that act at once, with the intervals whose acceleration they are part of, (N + 1,).

    Column k is of the interval that ends at knot k.
    """
    pushes, knots = parameters.scenario.pushes, parameters.scenario.knots
    later = 1 if rules.acts_after(parameters.rule) else 0  # the acceleration is that of the interval's start
    found = []
    for some, where in acting(pushes, knots, parameters.rule).items():
        flags = np.zeros(knots + 1, dtype=bool)
        flags[[knot + later for knot in where if knot + later <= knots]] = True
        found.append((tuple(pushes[index] for index in some), flags))
    return found


def unpushed(parameters: Parameters, rows: int) -> Flags:
    """Return over which intervals nothing pushes, (rows, N + 1)."""
    flags = np.ones(parameters.scenario.knots + 1, dtype=bool)
    for _, pushed in groups(parameters):
        flags &= ~pushed
    return np.tile(flags, (rows, 1))


def pushed(parameters: Parameters, rows: int) -> Flags:
    """Return over which intervals each set of pushes acts, (rows for each set, N + 1)."""
    every = [np.tile(flags, (rows, 1)) for _, flags in groups(parameters)]
    return np.vstack([np.zeros((0, parameters.scenario.knots + 1), dtype=bool), *every])


def momentum_dynamics_pushed(interval: Interval, parameters: Parameters) -> SX:
    """m (ẋ⁺ − ẋ) = Δt (m g + Σ f⁺ + Σ f_push) and hω⁺ − hω = Δt Σ (p⁺ − x⁺) × f⁺, pushes included."""
    plain, rows = constraints.momentum_dynamics(interval, parameters), [cs.SX(0, 1)]
    knot = interval.at_accelerations
    for some, _ in groups(parameters):
        pushes = [(knot.pose(push.of).translation, cs.DM(push.force)) for push in some]
        linear = sum((force for _, force in pushes), cs.SX(3, 1)) / parameters.robot.mass
        angular = sum((cs.cross(point - knot.com_position, force) for point, force in pushes), cs.SX(3, 1))
        rows.append(plain - interval.duration * cs.vertcat(linear, angular))
    return cs.vertcat(*rows)

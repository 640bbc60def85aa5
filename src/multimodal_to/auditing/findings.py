"""What an audit works with: a motion with its forward kinematics, and findings, one for each property."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from multimodal_to.adam.spatial import Array
from multimodal_to.models.robot import Robot
from multimodal_to.trajectory import Trajectory
from multimodal_to.trajectory.derived import base_poses, contact_points, frame_poses, thrust_forces
from multimodal_to.trajectory.pushes import KnownPush, push_forces


@dataclass(frozen=True, kw_only=True)
class Finding:
    """One property: its worst value on the horizon, where that is, and the limit it is held to."""

    name: str  # of the property, as in `properties.PROPERTIES`
    worst: float
    unit: str
    knot: int
    body: str
    limit: float

    @property
    def holds(self) -> bool:
        """Return whether the worst value is within the limit."""
        return self.worst <= self.limit


@dataclass(frozen=True, kw_only=True)
class Worst:
    """The worst value of a property on the horizon, in the property's unit, and where it is."""

    name: str  # of the property
    worst: float
    knot: int
    body: str = ""  # joint, contact point, jet or axis; empty where there is only one


@dataclass(frozen=True, kw_only=True, eq=False)
class Motion:
    """A trajectory with what forward kinematics says of it, in world axes."""

    robot: Robot
    trajectory: Trajectory
    base: Array  # w_H_base, (knots + 1, 4, 4)
    points: Array  # contact points [m], (contacts, knots + 1, 3)
    thrust_points: Array  # where the jets push [m], (jets, knots + 1, 3)
    thrusts: Array  # with what force [N], (jets, knots + 1, 3)
    pushed_frames: tuple[str, ...] = ()  # what is pushed from outside
    push_points: Array  # where [m], (pushes, knots + 1, 3)
    pushes: Array  # with what force [N], (pushes, knots + 1, 3)

    @classmethod
    def of(cls, robot: Robot, trajectory: Trajectory, known: Sequence[KnownPush] = ()) -> Motion:
        """Return a trajectory with its forward kinematics.

        Args:
            robot: that moves.
            trajectory: its motion.
            known: what pushes it from outside.
        """
        count = trajectory.time.size
        push_points = [frame_poses(robot, trajectory, push.of)[:, :3, 3] for push in known]
        thrust_points, thrusts = thrust_forces(robot, trajectory)
        return cls(
            robot=robot,
            trajectory=trajectory,
            base=base_poses(trajectory),
            points=contact_points(robot, trajectory),
            thrust_points=thrust_points,
            thrusts=thrusts,
            pushed_frames=tuple(push.of for push in known),
            push_points=np.array(push_points).reshape(-1, count, 3),
            pushes=push_forces(known, trajectory),
        )

    @property
    def drag_moments(self) -> Array:
        """Return the moments of the rotors' drag on the robot [N m], (jets, knots + 1, 3)."""
        drags = [jet.drag for jet in self.robot.with_jets(self.trajectory.jet_names).jets]
        return np.asarray(np.reshape(drags, (-1, 1, 1)) * self.thrusts)

    @property
    def contact_forces(self) -> Array:
        """Return the contact forces [N], (contacts, knots + 1, 3)."""
        return self.trajectory.per_contact("contact_forces").transpose(0, 2, 1)


def worst_of(name: str, values: Array, bodies: tuple[str, ...] = (), first: int = 0) -> Worst:
    """Return the worst of a property's values; without values it is zero.

    Args:
        name: of the property.
        values: (bodies, knots) or (knots,), in the property's unit; the largest is the worst.
        bodies: names of the rows; none where there is one row, or where no row has a name.
        first: knot of the first column.
    """
    table = np.atleast_2d(values)
    if not table.size:
        return Worst(name=name, worst=0.0, knot=first)
    row, column = np.unravel_index(int(np.argmax(table)), table.shape)
    return Worst(
        name=name,
        worst=float(table[row, column]),
        knot=int(column) + first,
        body=bodies[row] if bodies else "",
    )


def largest(vectors: Array) -> Array:
    """Return the largest component by absolute value of (components, knots), per knot."""
    return np.asarray(np.abs(vectors).max(axis=0, initial=0.0))

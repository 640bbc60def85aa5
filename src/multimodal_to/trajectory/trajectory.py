"""`Trajectory`: every quantity of the problem on one time grid, with names and units, saved without pickle."""

from __future__ import annotations

import json
import os
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

from multimodal_to.adam.spatial import Array
from multimodal_to.arguments import check_fields, checked
from multimodal_to.errors import LONGEST, InputError, TrajectoryError, listed, shortened, unknown
from multimodal_to.files.writing import whole
from multimodal_to.models.attitude import continuous
from multimodal_to.models.robot import Robot
from multimodal_to.trajectory import rules
from multimodal_to.trajectory.archive import numbers, read_archive, refuse_missing, text, texts
from multimodal_to.trajectory.format import ENTRIES, FORMAT_VERSION, FORMATS
from multimodal_to.trajectory.quantities import QUANTITIES, labels
from multimodal_to.values import Value

_NO_ROTATION = 1e-6
"""A quaternion all of whose parts are smaller cannot be made a unit one."""


_LABELS = ("joint_names", "contact_names", "jet_names")


@dataclass(frozen=True, kw_only=True, eq=False)
class Trajectory(Value):
    """Every quantity of the optimal control problem at every knot.

    Column k is of knot k or of the interval that ends there, as `rule` says: `trajectory.rules` has the instants. Rates
    of column k are differences of the columns k and k − 1, divided by Δt. All vectors are in world axes; stacked
    quantities follow the order of `joint_names`, `contact_names` and `jet_names`. ρ and −ρ are the same attitude: the
    base's quaternions have the signs of `attitude.continuous`, whatever they are made with.

    Raises:
        TrajectoryError: an array has the wrong shape or is not finite, time does not increase, a name stands twice, or
            a quaternion is next to zero.
    """

    robot: str
    scenario: str
    time: Array  # [s], (knots + 1,)
    joint_names: tuple[str, ...]
    contact_names: tuple[str, ...]
    jet_names: tuple[str, ...]

    com_position: Array
    com_velocity: Array
    com_acceleration: Array
    angular_momentum: Array
    angular_momentum_rate: Array
    base_position: Array
    base_quaternion_xyzw: Array
    base_linear_velocity: Array
    base_angular_velocity: Array
    joint_positions: Array
    joint_velocities: Array
    contact_positions: Array
    contact_forces: Array
    contact_force_rates: Array
    thrust: Array
    thrust_rate: Array
    thrust_acceleration: Array
    throttle: Array

    scenario_json: str = ""  # the complete scenario, as `scenarios.data` writes it; empty where none is known
    rule: str = rules.BACKWARD_EULER  # of integration, which says at which instant each quantity is: `trajectory.rules`
    robot_json: str = ""  # what else the answer depends on, as `trajectory.conditions` writes it; empty: not known
    solve_json: str = ""  # how it was solved, as `solving.record` writes it; empty where no solver made it

    def __post_init__(self) -> None:
        super().__post_init__()
        check_fields(self, TrajectoryError)
        if self.time.ndim != 1 or self.time.size < 2:
            raise TrajectoryError(f"'time' has shape {self.time.shape}; expected (knots + 1,) with at least two knots")
        if not (np.isfinite(self.time).all() and (np.diff(self.time) > 0).all()):
            raise TrajectoryError("'time' must be finite and increase from knot to knot")
        bodies = {
            "robot": 1,
            "joint": len(self.joint_names),
            "contact": len(self.contact_names),
            "jet": len(self.jet_names),
        }
        for name, quantity in QUANTITIES.items():
            array, expected = getattr(self, name), (quantity.rows * bodies[quantity.of], self.time.size)
            if array.shape != expected:
                raise TrajectoryError(f"'{name}' has shape {array.shape}; expected {expected}")
            if not np.isfinite(array).all():
                raise TrajectoryError(f"'{name}' holds values that are not finite")
        for label in _LABELS:
            if len(set(names := getattr(self, label))) < len(names):
                raise TrajectoryError(f"'{label}' are {listed(names)}; expected each name once")
        if np.abs(self.base_quaternion_xyzw).max(axis=0).min() < _NO_ROTATION:
            raise TrajectoryError("'base_quaternion_xyzw' holds a quaternion next to zero, which is no rotation")
        self.__setstate__({"base_quaternion_xyzw": continuous(self.base_quaternion_xyzw)})

    @property
    def knots(self) -> int:
        """Return the number of intervals N; the arrays have N + 1 columns."""
        return int(self.time.size - 1)

    @property
    def duration(self) -> float:
        """Return the time from the first knot to the last [s]."""
        return float(self.time[-1] - self.time[0])

    def solve_record(self) -> dict[str, Any]:
        """Return how the trajectory was solved, by the keys of `solving.record`; empty where that is not known.

        Raises:
            TrajectoryError: `solve_json` is no JSON object.
        """
        try:
            record = json.loads(self.solve_json or "{}")
        except (ValueError, RecursionError) as error:
            raise TrajectoryError(f"the record of the solve of '{self.scenario}' is no JSON: {error}") from error
        if not isinstance(record, dict):
            raise TrajectoryError(f"the record of the solve of '{self.scenario}' is no JSON object")
        return record

    def unusual_formulation(self) -> str:
        """Return in words how the problem that was solved differs from the usual one of its rule, by names of terms.

        Empty where it does not differ, or where the file does not say. A file keeps the names of terms, not the terms.

        Raises:
            TrajectoryError: `solve_json` is no JSON object.
        """
        record = self.solve_record().get("formulation")
        if not isinstance(record, dict):
            return ""
        parts = [
            f"{words} {', '.join(str(name) for name in names)}"
            for key, words in (("own_terms", "terms of its own:"), ("left_out", "left out:"))
            if isinstance(names := record.get(key), list) and names
        ]
        if self.rule not in rules.INSTANTS:
            parts.append(f"integration by {self.rule}")
        return shortened("; ".join(parts), LONGEST)

    @checked
    def labels(self, name: str) -> tuple[str, ...]:
        """Return what the rows of a quantity are called, such as `l_knee` or `l_sole_1 z`.

        Raises:
            InputError: there is no such quantity.
        """
        return labels(name, self)

    @checked
    def times(self, name: str) -> Array:
        """Return at which times the columns of a quantity are [s], (knots + 1,), as the rule has it.

        The first one is before the first knot where the quantity is not at the ends of intervals.

        Raises:
            InputError: there is no such quantity.
        """
        if name not in QUANTITIES:
            raise InputError(unknown("quantity", name, QUANTITIES))
        return rules.instants(self.time, self.rule, name)

    @checked
    def per_contact(self, name: str) -> Array:
        """Return a contact quantity as (contacts, rows, knots + 1), for example forces as (contacts, 3, knots + 1).

        Raises:
            InputError: there is no such quantity of contact points.
        """
        known = [key for key, quantity in QUANTITIES.items() if quantity.of == "contact"]
        if name not in known:
            raise InputError(unknown("quantity of contact points", name, known))
        rows = QUANTITIES[name].rows
        return getattr(self, name).reshape(len(self.contact_names), rows, self.time.size)  # type: ignore[no-any-return]

    def vertical_contact_force(self) -> Array:
        """Return the sum of the world-vertical contact forces [N], (knots + 1,)."""
        return np.asarray(self.per_contact("contact_forces")[:, 2].sum(axis=0))

    @checked
    def show(self, robot: Robot | None = None, *, meshes: bool = True, height: int = 520) -> Any:
        """Return the replay of the motion, which a notebook shows where it is the value of a cell: `replay.show`.

        Args:
            robot: that moves; by default the bundled one that the trajectory names.
            meshes: draw meshes where the robot has them; else boxes, cylinders and spheres alone.
            height: of the frame [pixel].

        Raises:
            InputError: the height is not positive, or the trajectory is for another robot.
            TrajectoryError: no robot is given, and the trajectory names none that is bundled.
        """
        replay: Any = import_module("multimodal_to.replay")  # the one look up from here, for who has but a motion
        return replay.show(robot, self, meshes=meshes, height=height)

    @checked
    def save(self, path: str | os.PathLike[str]) -> Path:
        """Write the trajectory as a compressed `.npz` without pickle; the file appears whole or not at all.

        Raises:
            OutputError: the folder does not exist or cannot be written.
        """
        arrays: dict[str, Any] = {
            "format_version": np.array(FORMAT_VERSION),
            "robot": np.array(self.robot),
            "scenario": np.array(self.scenario),
            "scenario_json": np.array(self.scenario_json),
            "solve_json": np.array(self.solve_json),
            "robot_json": np.array(self.robot_json),
            "rule": np.array(self.rule),
            "time": self.time,
            "knots": np.array(self.knots),
            "total_time": np.array(self.duration),
            **{name: np.array(getattr(self, name), dtype=np.str_) for name in _LABELS},
            **{name: getattr(self, name) for name in QUANTITIES},
        }
        with whole(path) as draft, draft.open("wb") as stream:
            np.savez_compressed(stream, allow_pickle=False, **arrays)
        return Path(path)

    @classmethod
    @checked
    def load(cls, path: str | os.PathLike[str]) -> Trajectory:
        """Read a trajectory that `save` wrote, of this format version or an older one.

        Raises:
            TrajectoryError: the file is missing, is no such archive, is larger than `LARGEST_ARCHIVE` or
                `LARGEST_CONTENT`, or what it holds is no trajectory.
        """
        source = Path(path)
        stored = read_archive(source)
        version = stored.get("format_version")
        if version is None or version.shape != () or version.dtype.kind not in "iu":
            raise TrajectoryError(
                f"'{source}' is not a trajectory file of this library: it has no format_version; where the "
                "robot is named, by --robot or to read_motion, motions of other programs are read"
            )
        if int(version) not in FORMATS:
            raise TrajectoryError(
                f"'{source}' has format version {version}; this release reads {min(FORMATS)} to {FORMAT_VERSION}"
            )
        for name, entry in ENTRIES.items():
            if entry.since > 1:  # older files lack it
                stored.setdefault(name, np.array(""))
        refuse_missing(stored, ("robot", "scenario", "time", *_LABELS, *QUANTITIES), source)
        fields: dict[str, Any] = {name: numbers(stored, name, source) for name in ("time", *QUANTITIES)}
        fields |= {name: texts(stored, name, source) for name in _LABELS}
        words = ("robot", "scenario", "scenario_json", "solve_json", "robot_json", "rule")
        fields |= {name: text(stored, name, source) for name in words}
        fields["rule"] = fields["rule"] or rules.BACKWARD_EULER  # the one that there was before files said it
        try:
            return cls(**fields)
        except TrajectoryError as error:
            raise TrajectoryError(f"'{source}': {error}") from error

"""The format of a trajectory's file: its versions, and what it holds beside the quantities."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

FORMATS: Mapping[int, str] = MappingProxyType(
    {
        1: "all quantities, time, names of robot and scenario",
        2: "adds `scenario_json`",
        3: "adds `solve_json`",
        4: "adds `rule`",
        5: "adds `robot_json`",
    }
)
"""The versions of the file that are read, and what each one brought."""
FORMAT_VERSION = max(FORMATS)
"""The version that is written."""


@dataclass(frozen=True, kw_only=True)
class Entry:
    """What a file holds beside the quantities: kind of value, meaning, and the format version that brought it."""

    kind: str
    meaning: str
    since: int = 1


ENTRIES: Mapping[str, Entry] = MappingProxyType(
    {
        "format_version": Entry(kind="whole number", meaning="version of the file's format"),
        "robot": Entry(kind="text", meaning="name of the robot"),
        "scenario": Entry(kind="text", meaning="name of the scenario"),
        "scenario_json": Entry(
            kind="text, JSON",
            since=2,
            meaning="the complete scenario, by the scenario's keys; empty where none is known",
        ),
        "solve_json": Entry(
            kind="text, JSON", since=3, meaning="how it was solved; empty where no solver made the motion"
        ),
        "rule": Entry(
            kind="text",
            since=4,
            meaning="name of the integration rule, which says at which instant of the interval each quantity is",
        ),
        "robot_json": Entry(
            kind="text, JSON",
            since=5,
            meaning="what the answer depends on beside the task: gravity, friction, and the robot's mass, limits, "
            "locked joints and jets; empty where it is not known, and then those of the robot at hand hold",
        ),
        "time": Entry(kind="numbers, (N + 1,)", meaning="time of the knots [s], increasing"),
        "knots": Entry(
            kind="whole number", meaning="N, the number of intervals; for the reader's use, `load` counts `time`"
        ),
        "total_time": Entry(kind="number", meaning="last time minus first [s]; for the reader's use"),
        "joint_names": Entry(kind="texts", meaning="the joints, in the order of s"),
        "contact_names": Entry(kind="texts", meaning="the frames of the contact points"),
        "jet_names": Entry(kind="texts", meaning="the jets; empty where the motion uses none"),
    }
)
"""The file's arrays beside those of `QUANTITIES`."""

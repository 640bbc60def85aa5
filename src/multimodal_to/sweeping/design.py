"""What a sweep asks for: base scenarios and robots, and what varies over them by grid, list or random draws."""

from __future__ import annotations

import itertools
import json
import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from hashlib import sha256
from pathlib import Path
from typing import Any

import numpy as np

from multimodal_to.arguments import checked
from multimodal_to.errors import InputError, MultimodalError, listed, shown
from multimodal_to.files.reading import is_number, read_toml
from multimodal_to.models.loading import bundled_robots, load_robot
from multimodal_to.models.robot import Robot
from multimodal_to.scenarios import find
from multimodal_to.scenarios.data import from_dict, to_dict
from multimodal_to.scenarios.files import changed, load
from multimodal_to.scenarios.scenario import Scenario
from multimodal_to.sweeping.variants import PREFIX, check_key
from multimodal_to.tasks.finding import asked, follows_from, refuse_unknown

MOST_ROWS = 1_000_000
"""The most plans of a sweep."""


@dataclass(frozen=True, kw_only=True)
class Row:
    """One plan of a sweep, as plain data: what comes out follows from it and from the plan that it starts from."""

    index: int
    robot: str  # bundled one by name, or a folder
    robot_changes: Mapping[str, Any]  # by `variants.KEYS`
    scenario: Mapping[str, Any]  # complete, as `scenarios.data` has it
    inputs: Mapping[str, Any]  # what varies, by key
    seed: int | None  # of the random draws


@dataclass(frozen=True, kw_only=True)
class Design:
    """A sweep: every combination of scenarios, robots, the grid, the list and the draws.

    A name among the scenarios is that of a task, which is found for each robot as `solve` does: a starter task. A key
    is one of a scenario or of a starter task, as `--set` takes it (`final_com_height`, `weights.thrust`, `height`), or
    of the robot (`variants.KEYS`). A starter task follows from the robot as it is before any such change. A draw takes
    every random key at once; the draws of a row follow from the seed and the row's index alone.

    Raises:
        InputError: two parts vary one key, lists differ in length, a range is none, or there are too many rows.
    """

    scenarios: tuple[Scenario | str, ...]
    robots: tuple[str, ...] = ("ironcub",)
    settings: Mapping[str, Any] = field(default_factory=dict)  # the same in every row
    grid: Mapping[str, tuple[Any, ...]] = field(default_factory=dict)  # every combination
    listed: Mapping[str, tuple[Any, ...]] = field(default_factory=dict)  # entry by entry
    draws: int = 1  # of the random keys, for each combination
    seed: int = 0
    between: Mapping[str, tuple[Any, Any]] = field(default_factory=dict)  # uniform; numbers, or tuples of them
    among: Mapping[str, tuple[Any, ...]] = field(default_factory=dict)  # each as likely

    def __post_init__(self) -> None:
        parts = (self.settings, self.grid, self.listed, self.between, self.among)
        keys = [key for part in parts for key in part]
        if twice := sorted({key for key in keys if keys.count(key) > 1}):
            raise InputError(f"{listed(twice)} vary in two parts of the sweep; expected one for each key")
        if empty := [
            key for part in (self.grid, self.listed, self.among) for key, values in part.items() if not values
        ]:
            raise InputError(f"{listed(empty)} have no values")
        if len({len(values) for values in self.listed.values()}) > 1:
            lengths = ", ".join(f"{key} {len(values)}" for key, values in self.listed.items())
            raise InputError(f"the lists differ in length: {lengths}")
        for key, (low, high) in self.between.items():
            if np.shape(low) != np.shape(high) or not (np.array(low) <= np.array(high)).all():
                raise InputError(f"'{key}' is between {shown(low)} and {shown(high)}; expected numbers that rise")
        if self.draws < 1 or not self.scenarios or not self.robots:
            raise InputError("a sweep has at least one scenario, one robot and one draw")
        if self.count > MOST_ROWS:
            raise InputError(f"the sweep has {self.count} plans; at most {MOST_ROWS} are made")
        for key in keys:
            if key.startswith(PREFIX):
                check_key(key)

    @property
    def count(self) -> int:
        """Return the number of plans."""
        sizes = [len(values) for values in self.grid.values()]
        entries = len(next(iter(self.listed.values()), (None,)))
        return len(self.scenarios) * len(self.robots) * int(np.prod(sizes, dtype=float)) * entries * self.draws

    @property
    def varied(self) -> tuple[str, ...]:
        """Return what varies, by key."""
        several = [key for key, some in (("scenario", self.scenarios), ("robot", self.robots)) if len(some) > 1]
        return (*several, *self.grid, *self.listed, *self.between, *self.among)

    def rows(self) -> Iterator[Row]:
        """Yield the plans, each with the data of its own.

        Raises:
            ScenarioError: a key is none of the scenario's, or a value is not what its key takes.
        """
        entries = len(next(iter(self.listed.values()), (None,)))
        combinations = itertools.product(
            self.scenarios, self.robots, itertools.product(*self.grid.values()), range(entries), range(self.draws)
        )
        found: dict[str, Robot] = {}  # that starter tasks are made for
        for index, (scenario, robot, values, entry, _) in enumerate(combinations):
            if isinstance(scenario, str) and robot not in found:
                found[robot] = load_robot(robot)
            inputs: dict[str, Any] = {}
            if len(self.scenarios) > 1:
                inputs["scenario"] = scenario if isinstance(scenario, str) else scenario.name
            if len(self.robots) > 1:
                inputs["robot"] = robot
            inputs |= dict(zip(self.grid, values, strict=True))
            inputs |= {key: some[entry] for key, some in self.listed.items()}
            inputs |= self._drawn(index)
            made = partial(asked, scenario, found[robot]) if isinstance(scenario, str) else partial(changed, scenario)
            yield self._row(index, made, robot, inputs)

    def _drawn(self, index: int) -> dict[str, Any]:
        rng = np.random.default_rng([self.seed, index])
        drawn: dict[str, Any] = {key: np.asarray(rng.uniform(*ends)).tolist() for key, ends in self.between.items()}
        return drawn | {key: some[int(rng.integers(len(some)))] for key, some in self.among.items()}

    def _row(
        self, index: int, made: Callable[[Mapping[str, Any]], Scenario], robot: str, inputs: Mapping[str, Any]
    ) -> Row:
        """Return a row.

        Args:
            index: of the row.
            made: the scenario with changes by dotted keys.
            robot: before any change.
            inputs: what varies.
        """
        changes = {key: value for key, value in {**self.settings, **inputs}.items() if key not in ("scenario", "robot")}
        of_robot = {key: value for key, value in changes.items() if key.startswith(PREFIX)}
        values = {key: value for key, value in changes.items() if key not in of_robot}
        return Row(
            index=index,
            robot=robot,
            robot_changes=of_robot,
            scenario=to_dict(made(values)),
            inputs=inputs,
            seed=self.seed if self.between or self.among else None,
        )

    def digest(self) -> str:
        """Return what tells this sweep from any other."""
        return sha256(json.dumps(self.plain(), sort_keys=True).encode()).hexdigest()

    def plain(self) -> dict[str, Any]:
        """Return the sweep as what JSON can hold."""
        return {
            "scenarios": [one if isinstance(one, str) else to_dict(one) for one in self.scenarios],
            "robots": list(self.robots),
            "settings": dict(self.settings),
            "grid": {key: list(values) for key, values in self.grid.items()},
            "listed": {key: list(values) for key, values in self.listed.items()},
            "draws": self.draws,
            "seed": self.seed,
            "between": {key: list(values) for key, values in self.between.items()},
            "among": {key: list(values) for key, values in self.among.items()},
        }

    @classmethod
    @checked
    def of_plain(cls, table: Mapping[str, Any]) -> Design:
        """Return the sweep that `plain` made data of."""
        of_lists = {
            key: {name: tuple(map(_tuple, values)) for name, values in table[key].items()}
            for key in ("grid", "listed", "between", "among")
        }
        scenarios = tuple(one if isinstance(one, str) else from_dict(one) for one in table["scenarios"])
        plain: dict[str, Any] = {key: table[key] for key in ("settings", "draws", "seed")} | of_lists
        return cls(scenarios=scenarios, robots=tuple(table["robots"]), **plain)


def _tuple(value: Any) -> Any:
    return tuple(map(_tuple, value)) if isinstance(value, list) else value


# ---------------------------------------------------------------- the file

_KEYS = ("scenario", "robot", "settings", "grid", "list", "random")
_RANDOM = ("draws", "seed", "between", "among")


@checked
def read_design(path: str | os.PathLike[str]) -> Design:
    """Return the sweep of a TOML file; paths in it are from its folder.

    ```toml
    scenario = "take-off"            # a task as `solve` takes it, a TOML file, or a list of them
    robot = "ironcub"                # a bundled one, a folder, or a list of them
    [settings]                       # the same in every plan
    knots = 20
    [grid]                           # every combination
    final_com_height = { from = 0.7, to = 0.85, count = 4 }
    "robot.mass" = [0.97, 1.03]
    [list]                           # entry by entry
    [random]
    draws = 500
    seed = 1
    between = { friction = [0.25, 0.6], final_com = [[-0.2, 0.0, 0.65], [0.2, 0.0, 0.75]] }
    among = { "weights.thrust" = [1.0, 3.0] }
    ```

    Raises:
        InputError: the file is broken, or asks for what no sweep can be.
        ScenarioError: a scenario is unknown or broken.
    """
    source = Path(path)
    table = read_toml(source, InputError)
    try:
        return _design(table, source.parent)
    except MultimodalError as error:
        raise InputError(f"{source}: {error}") from error


def _design(table: dict[str, Any], folder: Path) -> Design:
    _refuse_strangers(table, _KEYS, "the sweep")
    random = _table(table, "random")
    _refuse_strangers(random, _RANDOM, "[random]")
    names = _texts(table.get("scenario", []), "scenario")
    robots = tuple(_robot(name, folder) for name in _texts(table.get("robot", "ironcub"), "robot"))
    for key in ("draws", "seed"):
        if not isinstance(random.get(key, 1), int) or isinstance(random.get(key, 1), bool):
            raise InputError(f"'{key}' is {shown(random[key])}; expected a whole number")
    between = {key: _range(key, value) for key, value in _table(random, "between").items()}
    return Design(
        scenarios=tuple(_scenario(name, folder, robots) for name in names),
        robots=robots,
        settings=_flat(_table(table, "settings")),
        grid={key: _values(key, value) for key, value in _table(table, "grid").items()},
        listed={key: _values(key, value) for key, value in _table(table, "list").items()},
        draws=random.get("draws", 1),
        seed=random.get("seed", 0),
        between=between,
        among={key: _values(key, value) for key, value in _table(random, "among").items()},
    )


def _refuse_strangers(table: Mapping[str, Any], known: Sequence[str], what: str) -> None:
    if strangers := [key for key in table if key not in known]:
        raise InputError(f"{what} has {listed(strangers)}; expected {listed(known)}")


def _table(table: Mapping[str, Any], key: str) -> dict[str, Any]:
    value = table.get(key, {})
    if not isinstance(value, dict):
        raise InputError(f"'{key}' is {shown(value)}; expected a table")
    return value


def _texts(value: Any, key: str) -> list[str]:
    values = [value] if isinstance(value, str) else value
    if not (isinstance(values, list) and values and all(isinstance(one, str) for one in values)):
        raise InputError(f"'{key}' is {shown(value)}; expected a name, or a list of them")
    return values


def _scenario(name: str, folder: Path, robots: Sequence[str]) -> Scenario | str:
    """Return the scenario of a name or a file; the name itself where its numbers follow from one of the robots.

    Args:
        name: in the sweep's file.
        folder: of that file.
        robots: of the sweep.
    """
    if name.endswith(".toml"):
        return load(folder / name)
    refuse_unknown(name)
    return name if any(follows_from(name, load_robot(robot).name) for robot in robots) else find(name)


def _robot(name: str, folder: Path) -> str:
    return name if name in bundled_robots() else str((folder / name).resolve())


def _flat(table: Mapping[str, Any], before: str = "") -> dict[str, Any]:
    """Return a table with dotted keys; tables in it are tables of TOML.

    Args:
        table: of the file.
        before: what its keys begin with.
    """
    flat: dict[str, Any] = {}
    for key, value in table.items():
        flat |= _flat(value, f"{before}{key}.") if isinstance(value, dict) else {f"{before}{key}": value}
    return flat


def _values(key: str, value: Any) -> tuple[Any, ...]:
    if isinstance(value, dict) and set(value) == {"from", "to", "count"}:
        count = value["count"]
        if is_number(value["from"]) and is_number(value["to"]) and isinstance(count, int) and 1 <= count <= MOST_ROWS:
            return tuple(float(number) for number in np.linspace(value["from"], value["to"], count))
    if isinstance(value, list) and value:
        return tuple(value)
    raise InputError(f"'{key}' is {shown(value)}; expected a list of values, or {{ from = 0.7, to = 0.9, count = 3 }}")


def _range(key: str, value: Any) -> tuple[Any, Any]:
    if isinstance(value, list) and len(value) == 2:
        if all(map(is_number, value)):
            return float(value[0]), float(value[1])
        if all(isinstance(end, list) and end and all(map(is_number, end)) for end in value):
            return tuple(map(float, value[0])), tuple(map(float, value[1]))
    raise InputError(f"'{key}' is between {shown(value)}; expected two numbers, or two lists of them")

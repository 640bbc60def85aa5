"""The folder of a sweep: where each plan and its row are, which are done, and the table of all rows."""

from __future__ import annotations

import csv
import json
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType
from typing import Any

from multimodal_to.errors import InputError, OutputError
from multimodal_to.files.writing import make_folder, whole, write_text
from multimodal_to.sweeping.design import Design

SWEEP_FILE, TABLE, README = "sweep.json", "table.csv", "README.md"
FACTS = (
    "index",
    "scenario",
    "robot",
    "status",
    "solved",
    "audit_holds",
    "audit_worst",
    "audit_worst_over_limit",
    "survived",
    "simulated_end",
    "iterations",
    "objective",
    "solve_seconds",
    "seconds",
    "cpu_seconds",
    "started_from",
    "message",
    "plan",
    "robot_folder",
    "seed",
    "attempts",
    "version",
    "casadi",
    "python",
    "commit",
)
"""The columns of the table beside the inputs."""
_README = """# A sweep of {count} plans

Made by multimodal-to. What varies: {varied}.

- `table.csv` has a row for each plan: the inputs by their keys, then how it went. `table.parquet` is the same, where
  pyarrow was there. `pandas.read_csv("table.csv")` reads it.
- `plans/` has the trajectory of each plan, named by its index; `multimodal-to audit`, `replay` and `export` take it.
- `robots/` has the changed robots, where robots vary; give the row's `robot_folder` as `--robot`.
- `rows/` has the rows as they were written, one JSON file each. A plan is done when both its files are here.
- `sweep.json` says what the sweep asks for. The command that made it, given again, goes on with what is left.

Columns: `status` is how the solve ended, or `refused` (the task contradicts itself), `crashed` or `timed out`.
`audit_worst` is the property that is nearest to its limit, or beyond it, and `audit_worst_over_limit` its share of the
limit. `survived` says whether the robot ends in MuJoCo as planned, and is empty where that was not asked.
`started_from` is the index of the plan whose answer this one started from. `attempts` counts workers that were lost on
it. Times are wall times [s], and `cpu_seconds` that of the processor.
"""


@dataclass(frozen=True, kw_only=True)
class Folder:
    """Where a sweep is kept."""

    path: Path

    @property
    def robots(self) -> Path:
        """Return where changed robots are."""
        return self.path / "robots"

    def plan(self, index: int) -> Path:
        """Return where the trajectory of a plan is; a thousand are in one folder."""
        return self.path / "plans" / f"{index // 1000:03d}" / f"{index:06d}.npz"

    def row(self, index: int) -> Path:
        """Return where the row of a plan is."""
        return self.path / "rows" / f"{index // 1000:03d}" / f"{index:06d}.json"

    def begin(self, design: Design, options: Mapping[str, Any]) -> None:
        """Make the folder, or see that what is there is of the same sweep.

        Args:
            design: of the sweep.
            options: what else the plans depend on.

        Raises:
            InputError: the folder holds another sweep.
            OutputError: the folder cannot be written.
        """
        stated = {"sweep": design.plain(), "options": dict(options), "digest": design.digest()}
        file = self.path / SWEEP_FILE
        if file.exists():
            before = self.stated()
            if before.get("digest") != stated["digest"]:
                raise InputError(f"'{self.path}' holds another sweep; expected an empty folder, or that of this one")
            if before.get("options") != stated["options"]:
                raise InputError(
                    f"'{self.path}' was begun with {before.get('options')}, and this is "
                    f"{stated['options']}; expected the same"
                )
            return
        make_folder(self.path)
        varied = ", ".join(f"`{key}`" for key in design.varied) or "nothing"
        write_text(self.path / README, _README.format(count=design.count, varied=varied))
        write_text(file, json.dumps(stated, ensure_ascii=False, indent=1))

    def stated(self) -> dict[str, Any]:
        """Return what `sweep.json` says.

        Raises:
            InputError: there is none, or it is broken.
        """
        file = self.path / SWEEP_FILE
        try:
            table = json.loads(file.read_text(encoding="utf-8"))
        except (OSError, ValueError) as error:
            raise InputError(
                f"'{self.path}' is no folder of a sweep: it has no {SWEEP_FILE} that can be read"
            ) from error
        return table if isinstance(table, dict) else {}

    def write_row(self, row: Mapping[str, Any]) -> None:
        """Write a row, whole or not at all; the plan is done then.

        Raises:
            OutputError: it cannot be written.
        """
        file = self.row(int(row["index"]))
        make_folder(file.parent)
        write_text(file, json.dumps(row, ensure_ascii=False))

    def read_row(self, index: int) -> dict[str, Any] | None:
        """Return the row of a plan that is done, else None: a row whose trajectory is gone is none."""
        try:
            row = json.loads(self.row(index).read_text(encoding="utf-8"))
        except (OSError, ValueError):
            return None
        if not isinstance(row, dict) or (row.get("plan") and not self.plan(index).exists()):
            return None
        return row

    def rows(self, count: int) -> Iterator[dict[str, Any]]:
        """Yield the rows of the plans that are done, in their order.

        Args:
            count: of the plans.
        """
        for index in range(count):
            row = self.read_row(index)
            if row is not None:
                yield row

    @contextmanager
    def held(self) -> Iterator[None]:
        """Hold the folder for one process; however that ends, the folder is free then.

        Raises:
            OutputError: another process works on it.
        """
        fcntl = _fcntl()
        with (self.path / ".lock").open("w") as stream:
            if fcntl is not None:
                try:
                    fcntl.flock(stream, fcntl.LOCK_EX | fcntl.LOCK_NB)
                except OSError as error:
                    raise OutputError(f"another process works on '{self.path}'") from error
            yield

    def write_tables(self, design: Design) -> list[Path]:
        """Write the table of the plans that are done, as CSV and, where pyarrow is installed, as Parquet.

        Args:
            design: of the sweep.
        """
        inputs = [key for key in design.varied if key not in FACTS]
        names = [*inputs, *FACTS]
        rows = [_flat(row, inputs) for row in self.rows(design.count)]
        with whole(self.path / TABLE) as draft, draft.open("w", encoding="utf-8", newline="") as stream:
            writer = csv.DictWriter(stream, names, lineterminator="\n")
            writer.writeheader()
            writer.writerows(rows)
        written = [self.path / TABLE]
        try:
            import pyarrow
            from pyarrow import parquet
        except ImportError:
            return written
        columns = {name: pyarrow.array(_alike([row.get(name) for row in rows])) for name in names}
        with whole(self.path / "table.parquet") as draft:
            parquet.write_table(pyarrow.table(columns), draft)
        return [*written, self.path / "table.parquet"]


def _flat(row: Mapping[str, Any], inputs: Sequence[str]) -> dict[str, Any]:
    """Return a row with its inputs as columns; what is no number and no text is JSON.

    Args:
        row: as it was written.
        inputs: the keys that vary.
    """
    own = row.get("inputs", {})
    values = {key: own.get(key) for key in inputs} | {name: row.get(name) for name in FACTS}
    return {
        key: json.dumps(value) if isinstance(value, list | dict) else value
        for key, value in values.items()
        if value is not None
    }


def _alike(values: list[Any]) -> list[Any]:
    """Return values of one type, as a column has them: texts where they are of several."""
    kinds = {type(value) for value in values if value is not None}
    if kinds <= {int, float} or len(kinds) < 2:
        return values
    return [None if value is None else str(value) for value in values]


def _fcntl() -> ModuleType | None:
    try:
        import fcntl
    except ImportError:  # not on Windows, where nothing holds the folder
        return None
    return fcntl

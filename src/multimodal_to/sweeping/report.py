"""The page of a sweep: how its plans went, over the inputs, with the failures first."""

from __future__ import annotations

import base64
import html
import io
import os
from collections import Counter
from collections.abc import Mapping, Sequence
from importlib import resources
from pathlib import Path
from string import Template
from typing import Any

import numpy as np

from multimodal_to.adam.spatial import Array
from multimodal_to.files.reading import is_number
from multimodal_to.files.writing import write_text
from multimodal_to.sweeping.design import Design
from multimodal_to.sweeping.folder import Folder

PAGE = "report.html"
_SHOWN = 500  # rows on the page; the table has all
_PASSED, _AUDIT, _FELL = "solved and audited", "audit fails", "falls in MuJoCo"
_COLOURS = {_PASSED: "#1fa34a", _AUDIT: "#f58a24", _FELL: "#9467bd"}
_FAILED = "#d62728"


def write_sweep_report(folder: str | os.PathLike[str]) -> Path:
    """Write the page of a sweep into its folder; it opens from disk and fetches nothing.

    Raises:
        InputError: it is no folder of a sweep.
        OutputError: the page cannot be written.
    """
    kept = Folder(path=Path(folder))
    design = Design.of_plain(kept.stated()["sweep"])
    rows = list(kept.rows(design.count))
    counts = Counter(verdict(row) for row in rows)
    template = Template(resources.files("multimodal_to.sweeping").joinpath("report.html").read_text(encoding="utf-8"))
    keys = [key for key in design.varied if key not in ("scenario", "robot")]
    first = sorted(rows, key=lambda row: (verdict(row) == _PASSED, row["index"]))
    return write_text(
        kept.path / PAGE,
        template.substitute(
            title=html.escape(kept.path.resolve().name),
            summary=html.escape(f"{len(rows)} of {design.count} plans are done"),
            verdicts="".join(_cells(name, count, f"{100 * count / len(rows):.1f} %") for name, count in counts.items()),
            figures=_figures(rows, keys),
            head="".join(
                f"<th>{html.escape(name)}</th>" for name in (*_columns(keys), "why, or what is nearest to its limit")
            ),
            rows="".join(_row(row, keys) for row in first[:_SHOWN]),
            left_out=f"The table has {len(rows) - _SHOWN} rows more." if len(rows) > _SHOWN else "",
        ),
    )


def verdict(row: Mapping[str, Any]) -> str:
    """Return in a few words how a plan went: its status where it has no answer."""
    if not row.get("solved"):
        return str(row["status"])
    if not row.get("audit_holds"):
        return _AUDIT
    return _FELL if row.get("survived") is False else _PASSED


def _columns(keys: Sequence[str]) -> tuple[str, ...]:
    return ("index", "scenario", *keys, "verdict", "iterations", "solve [s]")


def _cells(*values: object) -> str:
    return "<tr>" + "".join(f"<td>{html.escape(str(value))}</td>" for value in values) + "</tr>"


def _row(row: Mapping[str, Any], keys: Sequence[str]) -> str:
    inputs = [_number(row["inputs"].get(key)) for key in keys]
    why = row.get("message", "") if not row.get("solved") else f"{row.get('audit_worst')}, {_share(row)} of its limit"
    times = row.get("iterations", ""), _number(row.get("solve_seconds", ""))
    return _cells(row["index"], row["scenario"], *inputs, verdict(row), *times, why)


def _share(row: Mapping[str, Any]) -> str:
    share = row.get("audit_worst_over_limit")
    return "?" if share is None else f"{share:.2g}"


def _number(value: Any) -> str:
    if isinstance(value, list):
        return ", ".join(map(_number, value))
    return f"{value:.4g}" if isinstance(value, float) else str(value)


def _figures(rows: Sequence[Mapping[str, Any]], keys: Sequence[str]) -> str:
    """Return pictures: each numeric input against the iterations, coloured by the verdict, and the iterations' spread.

    Args:
        rows: that are done.
        keys: of the inputs.
    """
    from matplotlib.figure import Figure

    shown = [row for row in rows if row.get("iterations")]
    varied = {
        name: values
        for key in keys
        for name, values in _numeric(key, [row["inputs"].get(key) for row in shown]).items()
        if np.ptp(values) > 0.0
    }
    if not varied:
        return ""
    across = min(len(varied), 3)
    down = -(-len(varied) // across)
    figure = Figure(figsize=(4.2 * across, 3.2 * down), layout="constrained")
    axes = np.atleast_1d(figure.subplots(down, across, sharey=True)).ravel()
    iterations, verdicts = np.array([row["iterations"] for row in shown]), np.array([verdict(row) for row in shown])
    for axis, (key, values) in zip(axes, varied.items(), strict=False):
        for name in dict.fromkeys(verdicts.tolist()):
            of = verdicts == name
            axis.scatter(values[of], iterations[of], s=18, color=_COLOURS.get(name, _FAILED), label=name)
        axis.set_xlabel(key)
        axis.set_ylabel("iterations")
        axis.grid(alpha=0.3)
    for axis in axes[len(varied) :]:
        axis.remove()
    axes[0].legend(fontsize=8)
    stream = io.BytesIO()
    figure.savefig(stream, format="svg")
    data = base64.b64encode(stream.getvalue()).decode("ascii")
    return f'<img alt="iterations over each input" src="data:image/svg+xml;base64,{data}">'


def _numeric(key: str, values: Sequence[Any]) -> dict[str, Array]:
    """Return the numbers of an input by name, (rows,) each; those of a list, as of a place, one by one.

    Args:
        key: of the input.
        values: of the input in each row.
    """
    if not values:
        return {}
    if all(is_number(value) for value in values):
        return {key: np.array(values, dtype=float)}
    if all(isinstance(value, list) and len(value) == len(values[0]) and all(map(is_number, value)) for value in values):
        return {f"{key} {number}": part for number, part in enumerate(np.array(values, dtype=float).T, start=1)}
    return {}

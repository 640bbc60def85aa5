"""From which plan each plan of a sweep starts: the nearest one by its inputs, fixed before anything is solved.

So what comes out does not depend on how many solve side by side, nor on which of them is the first.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from multimodal_to.adam.spatial import Array
from multimodal_to.files.reading import is_number
from multimodal_to.sweeping.design import Row

LARGEST_GROUP = 5_000
"""So many rows at most have one beginning: the time grows with the square."""


def origins(rows: Sequence[Row]) -> dict[int, int | None]:
    """Return for each row the index of the row whose plan it starts from, in the order to solve; None: its own guess.

    Rows of one scenario and robot make a tree: it begins at the row in the middle of all, and the row that is nearest
    to any in the tree comes next. Inputs are scaled by their ranges.

    Args:
        rows: of the sweep.
    """
    groups: dict[tuple[str, str], list[Row]] = {}
    for row in rows:
        groups.setdefault((str(row.scenario["name"]), row.robot), []).append(row)
    found: dict[int, int | None] = {}
    for group in groups.values():
        for first in range(0, len(group), LARGEST_GROUP):
            part = group[first : first + LARGEST_GROUP]
            order = _tree(scaled([row.inputs for row in part]))
            found |= {part[i].index: None if parent is None else part[parent].index for i, parent in order}
    return found


def scaled(inputs: Sequence[Mapping[str, Any]]) -> Array:
    """Return inputs as points, (rows, columns): numbers from 0 to 1 over their ranges, and 0 or 1 for each other value.

    Args:
        inputs: of each row, all with the same keys.
    """
    columns: list[Array] = []
    for key in inputs[0]:
        values = [row[key] for row in inputs]
        for part in _flattened(values):
            span = float(np.ptp(part))
            if span > 0.0:
                columns.append((part - part.min()) / span)
    return np.array(columns).reshape(len(columns), len(inputs)).T


def _flattened(values: Sequence[Any]) -> list[Array]:
    if all(is_number(value) for value in values):
        return [np.array(values, dtype=float)]
    if all(isinstance(value, list | tuple) and len(value) == len(values[0]) for value in values) and all(
        is_number(number) for value in values for number in value
    ):
        return list(np.array(values, dtype=float).T)
    kinds = list(dict.fromkeys(map(repr, values)))
    return [np.array([float(repr(value) == kind) for value in values]) for kind in kinds]


def _tree(points: Array) -> list[tuple[int, int | None]]:
    """Return each point with the one that it hangs on, in the order in which they come in (Prim's algorithm).

    Args:
        points: (rows, columns).
    """
    count = len(points)
    first = int(np.argmin(np.linalg.norm(points - points.mean(axis=0), axis=1)))
    away = np.linalg.norm(points - points[first], axis=1)
    nearest = np.full(count, first)
    inside = np.zeros(count, dtype=bool)
    inside[first] = True
    order: list[tuple[int, int | None]] = [(first, None)]
    for _ in range(count - 1):
        following = int(np.argmin(np.where(inside, np.inf, away)))
        order.append((following, int(nearest[following])))
        inside[following] = True
        distances = np.linalg.norm(points - points[following], axis=1)
        closer = distances < away
        away[closer], nearest[closer] = distances[closer], following
    return order

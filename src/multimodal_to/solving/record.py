"""How a solve went, as the JSON object that a trajectory file keeps."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from enum import Enum
from typing import Any


class Kind(Enum):
    """What a trajectory file is of a solve."""

    ANSWER = "answer"
    """What it ended with; whether that is an answer is what its status says."""
    CHECKPOINT = "checkpoint"
    """Its best iterate so far, written while it ran."""


def to_json(*, kind: Kind, **facts: object) -> str:
    """Return the facts of a solve with its kind as JSON.

    A number that is not finite becomes null.
    """
    return json.dumps(_finite({"kind": kind.value, **facts}), ensure_ascii=False, allow_nan=False)


def _finite(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {key: _finite(entry) for key, entry in value.items()}
    return None if isinstance(value, float) and not math.isfinite(value) else value

"""The paper's published trajectories, where they lie beside this checkout."""

from __future__ import annotations

from pathlib import Path

import pytest

PUBLISHED = Path(__file__).parents[2] / "shared" / "ironcub" / "published"

needs_published = pytest.mark.skipif(
    not PUBLISHED.is_dir(), reason="the paper's published trajectories are not beside this checkout"
)

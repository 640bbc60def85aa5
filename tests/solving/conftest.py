from __future__ import annotations

from dataclasses import replace

import pytest

import multimodal_to as mt


@pytest.fixture(scope="session")
def stand() -> mt.Scenario:
    """A short problem without jets, so that its answers come fast: the CoM goes down by 2 cm."""
    return replace(
        mt.scenarios.jump(),
        knots=10,
        mid_height_min=None,
        final_com=(0.0, 0.0, 0.55),
        interval_min=0.1,
        interval_max=0.1,
        allowances={},
    )

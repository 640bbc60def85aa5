from __future__ import annotations

import pytest

import multimodal_to as mt


@pytest.fixture(scope="session")
def ironcub() -> mt.Robot:
    return mt.load_robot("ironcub")


@pytest.fixture(scope="session")
def take_off(ironcub: mt.Robot) -> mt.Solution:
    """The take-off with all its knots, from the plain start guess with default options."""
    return mt.solve(mt.build(ironcub, mt.scenarios.take_off()))

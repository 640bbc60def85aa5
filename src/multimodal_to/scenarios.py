"""The bundled scenarios: data only. Numbers are those of L'Erario et al., Humanoids 2022, section V, unless said."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from types import MappingProxyType

from multimodal_to.errors import ScenarioError, unknown
from multimodal_to.ocp.scenario import Scenario, Start, Terminal, Weights


def take_off() -> Scenario:
    """Return the vertical take-off: from standing with idle jets to a hover 13 cm higher."""
    return Scenario(
        name="take-off",
        title="Vertical take-off from standing to hover",
        knots=70,
        initial_com=(0.0, 0.0, 0.57),
        final_com=(0.0, 0.0, 0.70),
        terminal=Terminal.HOVER,
        interval_min=0.05,
        interval_max=0.10,
        slack_schedule=(0.02, 0.2, 1.0),
        weights=Weights(
            com_acceleration=1e5,
            com_velocity=1e7,
            angular_momentum_rate=1e4,
            angular_momentum=1e4,
            joint_velocities={"upper_body": 5e5, "legs": 1e4},
            posture=1e6,
            contact_force_rates=1.0,
            contact_forces=5e1,
            throttle=1e-1,
            complementarity_slack=5e5,  # 1e5 in the paper, which can leave a force × height of 0.02 N m
            sliding_slack=5e5,
        ),
    )


def landing() -> Scenario:
    """Return the landing: from a hover down to standing, with the jets spooling down.

    Weights start from the take-off's. A contact force costs a fiftieth and a thrust a little, so that the ground takes
    the weight over instead of the jets carrying it to the end; the speed's weight keeps the touch-down below 0.3 m/s.
    """
    return Scenario(
        name="landing",
        title="Landing from hover to standing",
        knots=70,
        initial_com=(0.0, 0.0, 0.70),
        final_com=(0.0, 0.0, 0.57),
        start=Start.HOVER,
        terminal=Terminal.STANDING,
        interval_min=0.10,
        interval_max=0.10,
        slack_schedule=(0.02, 0.2, 1.0),
        weights=replace(take_off().weights, contact_forces=1.0, thrust=5.0, initial_posture=1e6, final_posture=1e6),
    )


SCENARIOS: Mapping[str, Callable[[], Scenario]] = MappingProxyType({"take-off": take_off, "landing": landing})
"""The bundled scenarios by name."""


def find(name: str) -> Scenario:
    """Return a bundled scenario by name.

    Raises:
        ScenarioError: there is none of that name.
    """
    if name not in SCENARIOS:
        raise ScenarioError(unknown("scenario", name, SCENARIOS))
    return SCENARIOS[name]()

"""Figures of the paper's own runs, to set beside ours: constants with their sources, nothing measured here.

Sources: status, iterations and wall time are what IPOPT 3.13.4 with MA97 reported in the runs published with L'Erario
et al., Humanoids 2022 (https://github.com/ami-iit/paper_lerario_2022_planning-multimodal-locomotion). The other figures
are audited from the trajectories in its data, where a slip under load is counted as in `audit`.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class PublishedRun:
    """Figures of one run or data file of the paper; None where they are not known."""

    scenario: str  # the bundled scenario that it compares with
    label: str
    status: str | None = None
    iterations: int | None = None
    solve_time: float | None = None  # wall time [s]
    duration: float | None = None  # [s]
    airborne: float | None = None  # [s]
    thrust_over_weight: float | None = None  # vertical, in flight [1]
    force_height: float | None = None  # largest normal force × height [N m]
    slip: float | None = None  # largest slip under load over an interval [m]


PUBLISHED = (
    PublishedRun(
        scenario="take-off",
        label="paper",
        status="acceptable",
        iterations=2976,
        solve_time=689.0,
        duration=7.0,
        airborne=1.2,
        thrust_over_weight=1.09,
        force_height=0.011,
        slip=0.0016,
    ),
    PublishedRun(
        scenario="take-off-and-landing",
        label="paper",
        status="acceptable",
        iterations=2521,
        solve_time=1490.0,
        duration=19.3,
        airborne=3.0,
        thrust_over_weight=1.09,
        force_height=0.054,
        slip=0.033,
    ),
    PublishedRun(
        scenario="landing",
        label="paper",
        duration=7.0,
        thrust_over_weight=1.00,
        force_height=0.000,
        slip=0.0012,
    ),
    PublishedRun(
        scenario="walk-to-fly",
        label="paper",
        status="acceptable",
        iterations=2463,
        solve_time=1650.0,
    ),
    PublishedRun(
        scenario="walk-to-fly",
        label="paper, data (a)",
        duration=5.5,
        airborne=0.27,
        thrust_over_weight=0.54,
        force_height=0.000,
        slip=0.28,
    ),
    PublishedRun(
        scenario="walk-to-fly",
        label="paper, data (b)",
        duration=8.9,
        airborne=0.36,
        thrust_over_weight=0.67,
        force_height=0.000,
        slip=0.19,
    ),
    PublishedRun(scenario="jump", label="paper", status="acceptable", iterations=1022, solve_time=188.0),
)
"""The paper's runs; walk to fly has two trajectories, and which of them the solver's figures are of is not known."""

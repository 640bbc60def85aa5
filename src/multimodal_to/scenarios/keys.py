"""Every key that the TOML file of a scenario may have, as data."""

from __future__ import annotations

from dataclasses import replace

from multimodal_to.files.keys import Key, keys_of
from multimodal_to.scenarios.bundled import SCENARIOS
from multimodal_to.scenarios.data import HEIGHTS, RECORDS
from multimodal_to.scenarios.files import EMPTIED
from multimodal_to.scenarios.scenario import Scenario


def scenario_keys() -> tuple[Key, ...]:
    """Return every key, as `scenarios.files.load` reads them; with `based_on` none is required."""
    base = Key(
        name="based_on",
        kind=f"one of {', '.join(SCENARIOS)}",
        unit="",
        default="none",
        meaning="The bundled scenario that the file changes; the file then holds only what differs",
    )
    emptied = Key(
        name="replace",
        kind=f"list of some of {', '.join(EMPTIED)}",
        unit="",
        default="none",
        meaning="Tables of the bundled scenario that the file writes anew, instead of changing single keys of them",
    )
    name, *others = keys_of(Scenario, RECORDS.unions)
    heights = (
        Key(
            name=height,
            kind="number",
            unit="m",
            default="none",
            meaning=f"z of `{com}`, to change it alone",
        )
        for height, com in HEIGHTS.items()
    )
    return base, emptied, replace(name, default="the file's own name"), *others, *heights

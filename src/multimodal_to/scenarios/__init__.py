"""The task as data: what is asked of a motion, its files, and the bundled scenarios."""

from multimodal_to.scenarios.bundled import (
    SCENARIOS,
    find,
    jump,
    landing,
    paper,
    step_up,
    take_off,
    take_off_and_landing,
    walk_to_fly,
)
from multimodal_to.scenarios.contacts import ContactState, ContactStretch
from multimodal_to.scenarios.failures import JetFailure
from multimodal_to.scenarios.gaits import GaitKind, GaitPlan
from multimodal_to.scenarios.keyframes import FrameTarget, Keyframe, Momentum
from multimodal_to.scenarios.limits import Limits
from multimodal_to.scenarios.margins import Margins
from multimodal_to.scenarios.regions import Box, Wall
from multimodal_to.scenarios.scenario import Scenario, Start, Terminal
from multimodal_to.scenarios.weights import Weights
from multimodal_to.trajectory.pushes import KnownPush

__all__ = [
    "SCENARIOS",
    "Box",
    "ContactState",
    "ContactStretch",
    "FrameTarget",
    "GaitKind",
    "GaitPlan",
    "JetFailure",
    "Keyframe",
    "KnownPush",
    "Limits",
    "Margins",
    "Momentum",
    "Scenario",
    "Start",
    "Terminal",
    "Wall",
    "Weights",
    "find",
    "jump",
    "landing",
    "paper",
    "step_up",
    "take_off",
    "take_off_and_landing",
    "walk_to_fly",
]

"""Whole-body trajectory optimisation of robots that walk and fly.

A `Robot` and a `Scenario` go into `build`; `solve` returns a `Solution` with a `Trajectory` and its own verdict;
`doctor` says before that what cannot work; `audit`, `multimodal_to.plotting` and `multimodal_to.replay` need only the
trajectory and the robot.
"""

# It handles Ctrl-C where this is the command line: before anything that takes time.
# isort: off
from multimodal_to import ending  # noqa: F401

# isort: on
from multimodal_to import robots, scenarios, tasks
from multimodal_to.adam import KinDynComputations
from multimodal_to.auditing import Audit, audit
from multimodal_to.doctor import Diagnosis, doctor
from multimodal_to.errors import MultimodalError
from multimodal_to.exporting.motion import write_motion
from multimodal_to.exporting.reading import read_motion
from multimodal_to.models.contact import FrictionCone
from multimodal_to.models.loading import load_robot
from multimodal_to.models.robot import Robot
from multimodal_to.models.state import State
from multimodal_to.models.terrain import FlatGround, HeightField, Plane, Stairs
from multimodal_to.ocp import (
    Constraint,
    Cost,
    Formulation,
    Interval,
    Intervals,
    Knot,
    Knots,
    Parameters,
    Problem,
    Where,
    at_least,
    at_most,
    between,
    build,
    equal,
    standing_posture,
)
from multimodal_to.scenarios import (
    Box,
    ContactState,
    ContactStretch,
    FrameTarget,
    GaitKind,
    GaitPlan,
    JetFailure,
    Keyframe,
    KnownPush,
    Limits,
    Margins,
    Momentum,
    Scenario,
    Start,
    Terminal,
    Wall,
    Weights,
)
from multimodal_to.scenarios import files as scenario_files
from multimodal_to.solving import (
    Ending,
    Ipopt,
    Planner,
    Solution,
    Solver,
    StartPoint,
    Status,
    Watch,
    relax,
    solve,
)
from multimodal_to.sweeping import sweep
from multimodal_to.trajectory import Trajectory
from multimodal_to.trajectory.states import state_at

__all__ = [
    "Audit",
    "Box",
    "Constraint",
    "ContactState",
    "ContactStretch",
    "Cost",
    "Diagnosis",
    "Ending",
    "FlatGround",
    "Formulation",
    "FrameTarget",
    "FrictionCone",
    "GaitKind",
    "GaitPlan",
    "HeightField",
    "Interval",
    "Intervals",
    "Ipopt",
    "JetFailure",
    "Keyframe",
    "KinDynComputations",
    "Knot",
    "Knots",
    "KnownPush",
    "Limits",
    "Margins",
    "Momentum",
    "MultimodalError",
    "Parameters",
    "Plane",
    "Planner",
    "Problem",
    "Robot",
    "Scenario",
    "Solution",
    "Solver",
    "Stairs",
    "Start",
    "StartPoint",
    "State",
    "Status",
    "Terminal",
    "Trajectory",
    "Wall",
    "Watch",
    "Weights",
    "Where",
    "at_least",
    "at_most",
    "audit",
    "between",
    "build",
    "doctor",
    "equal",
    "load_robot",
    "read_motion",
    "relax",
    "robots",
    "scenario_files",
    "scenarios",
    "solve",
    "standing_posture",
    "state_at",
    "sweep",
    "tasks",
    "write_motion",
]

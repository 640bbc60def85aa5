"""How a problem is solved, and what came out of it."""

from multimodal_to.solving.ipopt import Ipopt
from multimodal_to.solving.planner import Planner
from multimodal_to.solving.relaxation import Relaxation, relax
from multimodal_to.solving.solution import Iterate, Solution, solve
from multimodal_to.solving.solver import Ending, Solver, StartPoint, Watch
from multimodal_to.solving.status import Status
from multimodal_to.solving.violations import Violation

__all__ = [
    "Ending",
    "Ipopt",
    "Iterate",
    "Planner",
    "Relaxation",
    "Solution",
    "Solver",
    "StartPoint",
    "Status",
    "Violation",
    "Watch",
    "relax",
    "solve",
]

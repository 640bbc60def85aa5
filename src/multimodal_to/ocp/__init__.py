"""The optimal control problem: scenarios, variables, constraints and costs, their transcription, and its solution."""

from multimodal_to.ocp.elastic import Relaxation, relax
from multimodal_to.ocp.misses import Miss
from multimodal_to.ocp.problem import Problem, build, precompile
from multimodal_to.ocp.scenario import Scenario, Start, Terminal, Weights
from multimodal_to.ocp.solution import Iterate, Solution, solve
from multimodal_to.ocp.solvers import Ipopt, Status

__all__ = [
    "Ipopt",
    "Iterate",
    "Miss",
    "Problem",
    "Relaxation",
    "Scenario",
    "Solution",
    "Start",
    "Status",
    "Terminal",
    "Weights",
    "build",
    "precompile",
    "relax",
    "solve",
]

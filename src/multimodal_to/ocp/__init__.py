"""The optimal control problem: variables, constraints and costs, their transcription, and the start guess."""

from multimodal_to.ocp.problem import Problem, build, precompile

__all__ = ["Problem", "build", "precompile"]

"""What is asked: variables, terms, the integration rule, and the problem that they make."""

from multimodal_to.ocp.building import build
from multimodal_to.ocp.formulation import Formulation
from multimodal_to.ocp.guess import standing_posture
from multimodal_to.ocp.integration import BackwardEuler, IntegrationRule, Interval
from multimodal_to.ocp.knot import Knot
from multimodal_to.ocp.parameters import Parameters
from multimodal_to.ocp.problem import Problem
from multimodal_to.ocp.terms import Constraint, Cost, Intervals, Knots, Where, Within, at_least, at_most, between, equal
from multimodal_to.ocp.variables import Variable

__all__ = [
    "BackwardEuler",
    "Constraint",
    "Cost",
    "Formulation",
    "IntegrationRule",
    "Interval",
    "Intervals",
    "Knot",
    "Knots",
    "Parameters",
    "Problem",
    "Variable",
    "Where",
    "Within",
    "at_least",
    "at_most",
    "between",
    "build",
    "equal",
    "standing_posture",
]

"""How a problem is solved, and what came out of it."""

from multimodal_to.solving.elastic import Relaxation, relax
from multimodal_to.solving.misses import Miss
from multimodal_to.solving.solution import Iterate, Solution, solve
from multimodal_to.solving.solvers import Ipopt, Status

__all__ = ["Ipopt", "Iterate", "Miss", "Relaxation", "Solution", "Status", "relax", "solve"]

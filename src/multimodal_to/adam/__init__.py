"""Rigid-body kinematics and dynamics of floating-base robots in pure CasADi, from a URDF."""

from multimodal_to.adam.inspection import Description, describe
from multimodal_to.adam.kindyn import KinDynComputations
from multimodal_to.adam.library import GRAVITY
from multimodal_to.adam.representation import Representations
from multimodal_to.adam.tree import Tree
from multimodal_to.adam.urdf import load_tree

__all__ = ["GRAVITY", "Description", "KinDynComputations", "Representations", "Tree", "describe", "load_tree"]

"""A motion as arrays with names and units: its file, what follows from it, other times, and the arrays of others."""

from multimodal_to.trajectory.format import ENTRIES, FORMATS, Entry
from multimodal_to.trajectory.quantities import QUANTITIES, Quantity, labels, row_labels, row_units
from multimodal_to.trajectory.trajectory import Trajectory

__all__ = ["ENTRIES", "FORMATS", "QUANTITIES", "Entry", "Quantity", "Trajectory", "labels", "row_labels", "row_units"]

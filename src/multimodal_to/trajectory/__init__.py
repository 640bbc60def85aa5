"""A motion as arrays with names and units: its file, what follows from it, other times, and the arrays of others."""

from multimodal_to.trajectory.trajectory import ENTRIES, FORMATS, QUANTITIES, Entry, Quantity, Trajectory

__all__ = ["ENTRIES", "FORMATS", "QUANTITIES", "Entry", "Quantity", "Trajectory"]

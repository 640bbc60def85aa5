"""Many plans: tasks drawn over scenarios and robots, solved side by side, resumable, in one folder with one table."""

from multimodal_to.sweeping.design import Design, read_design
from multimodal_to.sweeping.sweep import Counts, sweep

__all__ = ["Counts", "Design", "read_design", "sweep"]

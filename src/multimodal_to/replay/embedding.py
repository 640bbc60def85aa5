"""A replay inside a notebook."""

from __future__ import annotations

import html
from dataclasses import dataclass, field

from multimodal_to.arguments import checked
from multimodal_to.errors import InputError
from multimodal_to.models.robot import Robot
from multimodal_to.replay.page import page
from multimodal_to.trajectory import Trajectory


@dataclass(frozen=True, kw_only=True)
class Embedded:
    """A page in a frame of its own, which notebooks show where it is the value of a cell.

    Raises:
        InputError: the height is not positive.
    """

    page: str = field(repr=False)
    height: int = 520  # [pixel]

    def __post_init__(self) -> None:
        if not self.height > 0:
            raise InputError(f"the height of the frame is {self.height}; expected a positive number of pixels")

    def _repr_html_(self) -> str:
        """Return the frame as HTML; it holds the whole page and fetches nothing."""
        style = f"width: 100%; height: {self.height}px; border: 0"
        return f'<iframe title="replay" style="{style}" srcdoc="{html.escape(self.page)}"></iframe>'


@checked
def embed(robot: Robot, trajectory: Trajectory, *, meshes: bool = True, height: int = 520) -> Embedded:
    """Return the replay as a notebook shows it, in a frame of that height [pixel]; with meshes it has some 2 MB.

    Args:
        robot: that moves.
        trajectory: its motion.
        meshes: draw meshes where the robot has them; else boxes, cylinders and spheres alone.
        height: of the frame [pixel].
    """
    return Embedded(page=page(robot, trajectory, meshes=meshes), height=height)

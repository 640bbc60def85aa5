"""Replay of a `Trajectory`: pages that open from disk without a network, films and stills of them, a live viewer.

All are drawn by meshcat. Links are nested in the scene as they are in the URDF, and keyframes are the knots: between
two of them the viewer moves positions linearly and turns rotations about a fixed axis (slerp), so each joint moves
linearly and the links stay together.
"""

from multimodal_to.replay.embedding import Embedded, show
from multimodal_to.replay.live import serve
from multimodal_to.replay.meshes import MeshWarning
from multimodal_to.replay.page import mark_of_fall, packed, player, write_html, write_still_html
from multimodal_to.replay.pictures import snapshot_times, write_gif, write_mp4, write_snapshots

__all__ = [
    "Embedded",
    "MeshWarning",
    "mark_of_fall",
    "packed",
    "player",
    "serve",
    "show",
    "snapshot_times",
    "write_gif",
    "write_html",
    "write_mp4",
    "write_snapshots",
    "write_still_html",
]

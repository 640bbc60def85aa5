"""The hopper with one motor: its right wing and its mast follow the left wing."""

from __future__ import annotations

from pathlib import Path

from hopper import hopper
from multimodal_to.models.loading import load_robot
from multimodal_to.models.robot import Robot

FOLLOWERS = {"right_pitch": (0.8, 0.05), "mast": (0.1, 0.1)}  # multiplier and offset [rad, m]


def tied_hopper(folder: Path, home: float = 0.0) -> Robot:
    """Return the hopper whose right wing is at 0.8 q + 0.05 rad and whose mast at 0.1 q + 0.1 m, with q the left wing.

    Args:
        folder: where to write it.
        home: position of the left wing at home [rad].
    """
    hopper(folder, mast=True)
    urdf, table = folder / "hopper.urdf", folder / "robot.toml"
    text = urdf.read_text(encoding="utf-8")
    for name, (multiplier, offset) in FOLLOWERS.items():
        before, after = text.split(f'<joint name="{name}"')
        mimic = f'<mimic joint="left_pitch" multiplier="{multiplier}" offset="{offset}"/></joint>'
        text = before + f'<joint name="{name}"' + after.replace("</joint>", mimic, 1)
    urdf.write_text(text, encoding="utf-8")
    lines = [
        line.replace("home = 0.0", f"home = {home}").replace('["left_pitch", "right_pitch"]', '["left_pitch"]')
        for line in table.read_text(encoding="utf-8").splitlines()
        if not line.startswith(("right_pitch", "mast"))
    ]
    table.write_text("\n".join(lines), encoding="utf-8")
    return load_robot(folder)

"""Draw the pictures of the README from what `make take-off` wrote: python docs/make_pictures.py.

Needs Chromium (`apt-get install chromium`), which takes the snapshots, and icub-models (`pip install '.[meshes]'`).
"""

from pathlib import Path

import multimodal_to as mt
from multimodal_to.plotting import plot_forces
from multimodal_to.replay import write_snapshots

ROOT = Path(__file__).parents[1]
RESULTS = ROOT / "results" / "take-off"


def main() -> None:
    """Write docs/take-off.png and docs/take-off-forces.png."""
    trajectory = mt.Trajectory.load(RESULTS / "trajectory.npz")
    robot = mt.load_robot(trajectory.robot)
    write_snapshots(robot, trajectory, ROOT / "docs" / "take-off.png")
    plot_forces(robot, trajectory).savefig(ROOT / "docs" / "take-off-forces.png", dpi=100)


if __name__ == "__main__":
    main()

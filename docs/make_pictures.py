"""Draw the pictures of the README from what `make take-off` wrote: python docs/make_pictures.py.

Needs Chromium (`apt-get install chromium`), which takes the snapshots of the replay page from disk.
"""

import shutil
import subprocess
import tempfile
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from matplotlib.image import imread

import multimodal_to as mt
from multimodal_to.derived import flight_phases
from multimodal_to.plotting import plot_forces

ROOT = Path(__file__).parents[1]
RESULTS = ROOT / "results" / "take-off"
SIZE = (900, 1000)  # of one snapshot [pixel]


def snapshot(page: Path, time: float) -> np.ndarray:
    """Return the replay page at a time [s] as an image."""
    browser = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
    if browser is None:
        raise SystemExit("no Chromium found; install it, for example with: apt-get install chromium")
    with tempfile.TemporaryDirectory() as folder:
        target = Path(folder) / "shot.png"
        command = [
            browser, "--headless", "--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader",
            "--hide-scrollbars", "--disable-background-networking", "--disable-component-update", "--disable-sync",
            f"--user-data-dir={folder}/profile", f"--window-size={SIZE[0]},{SIZE[1]}", "--virtual-time-budget=4000",
            f"--screenshot={target}", f"{page.resolve().as_uri()}#t={time:.3f}&bare",
        ]  # fmt: skip
        subprocess.run(command, check=True, capture_output=True, timeout=180)
        image = imread(target)
    seen = np.flatnonzero((image[..., :3] < 1.0).any(axis=(1, 2)))  # headless windows end in white rows
    return image[: seen[-1] + 1]


def main() -> None:
    """Write docs/take-off.png and docs/take-off-forces.png."""
    trajectory = mt.Trajectory.load(RESULTS / "trajectory.npz")
    lift_off = flight_phases(trajectory)[0][0]
    times = (0.0, lift_off - 1.0, lift_off + 0.4, trajectory.duration)
    figure = Figure(figsize=(12, 3.6), dpi=110, layout="constrained")
    for axes, time in zip(figure.subplots(1, len(times)), times, strict=True):
        axes.imshow(snapshot(RESULTS / "replay.html", time))
        axes.set_title(f"{time:.1f} s", fontsize="medium")
        axes.axis("off")
    figure.savefig(ROOT / "docs" / "take-off.png", bbox_inches="tight")
    plot_forces(mt.load_robot(trajectory.robot), trajectory).savefig(ROOT / "docs" / "take-off-forces.png", dpi=100)


if __name__ == "__main__":
    main()

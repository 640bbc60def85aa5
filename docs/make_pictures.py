"""Draw the pictures of the README and set its table of results: python docs/make_pictures.py [--gallery [ROBOT ...]].

With --gallery it solves the tasks of `GALLERY`, of all robots or of those named, and draws only the pictures of
docs/gallery.md.

Both come from what `multimodal-to reproduce` wrote to results/, and the snapshots of `OF_EXAMPLES` from what examples
wrote there. The README has the first of the two tables, with its note; docs/results.md has both. Needs Chromium
(`apt-get install chromium`), which takes the snapshots, and
icub-models (`pip install '.[meshes]'`).
"""

import sys
from collections.abc import Sequence
from pathlib import Path

from PIL import Image

import multimodal_to as mt
from multimodal_to.plotting import plot_forces, save
from multimodal_to.replay import write_snapshots

ROOT = Path(__file__).parents[1]
RESULTS = ROOT / "results"
HEIGHT, COLOURS = 400, 256  # of the snapshots of each scenario
OF_EXAMPLES = {
    **dict.fromkeys(("turn", "reach", "slope", "sidesteps", "failed-jet", "jump-onto-box"), "ironcub"),
    "side-step": ROOT / "examples" / "hopper",
    "trot": "solo12",
}
"""The robots of the examples that have a picture, by what their results are called."""
SIDE_STEP = "side-step"
"""A hover to the left, by three times the standing height."""
GALLERY = {
    "solo12": ("squat", "jump", "step", "walk", "trot"),
    "talos": ("squat", "jump", "step", "walk"),
    "quadrotor": ("take-off", "hover", SIDE_STEP, "land"),
    "ironcub-mk3": (*mt.scenarios.SCENARIOS, "squat", "step", "hover", "land"),
}
"""Tasks of bundled robots that have a picture in the gallery."""
GALLERY_HEIGHT = 260
BEGIN, END = "<!-- results: begin -->", "<!-- results: end -->"


def draw_snapshots(robot: mt.Robot, trajectory: mt.Trajectory, name: str, height: int = HEIGHT) -> None:
    """Write docs/NAME-snapshots.png: the robot at several times, small enough for a page that shows all scenarios.

    Args:
        robot: that moves.
        trajectory: how.
        name: of the picture.
        height: of the picture.
    """
    path = write_snapshots(robot.with_jets(trajectory.jet_names), trajectory, ROOT / "docs" / f"{name}-snapshots.png")
    with Image.open(path) as picture:
        size = (round(height * picture.width / picture.height), height)
        small = picture.convert("RGB").resize(size, Image.Resampling.LANCZOS)
    small.quantize(COLOURS, kmeans=4, dither=Image.Dither.NONE).save(path, optimize=True)


def draw_gallery(robots: Sequence[str] = ()) -> None:
    """Write docs/gallery/ROBOT-TASK-snapshots.png; a task without an answer, or with an untrue one, ends it.

    Args:
        robots: names of those to draw; all where none is named.
    """
    (ROOT / "docs" / "gallery").mkdir(exist_ok=True)
    for name in robots or GALLERY:
        robot = mt.load_robot(name)
        for task in GALLERY[name]:
            problem = mt.build(robot, gallery_task(task, robot))
            solution = mt.solve(problem)
            report = mt.audit(problem.robot, solution.trajectory)
            if not (solution.status.solved and report.holds):
                raise SystemExit(f"{name}, {task}: {solution.status.value}, true: {report.holds}")
            draw_snapshots(robot, solution.trajectory, f"gallery/{name}-{task}", GALLERY_HEIGHT)


def gallery_task(name: str, robot: mt.Robot) -> mt.Scenario:
    """Return a task of `GALLERY`."""
    if name == SIDE_STEP:
        return mt.tasks.hover(robot, by=(0.0, 3.0 * robot.standing_height, 0.0))
    return mt.tasks.find(name, robot)


def main() -> None:
    """Write docs/take-off.png, docs/*-snapshots.png, docs/*-forces.png, and the tables between the marks."""
    if sys.argv[1:2] == ["--gallery"]:
        draw_gallery(sys.argv[2:])
        return
    robot = mt.load_robot("ironcub")
    for name in ("take-off", "take-off-and-landing", "walk-to-fly", "jump"):
        trajectory = mt.Trajectory.load(RESULTS / name / "trajectory.npz")
        figure = plot_forces(robot.with_jets(trajectory.jet_names), trajectory)
        save(figure, ROOT / "docs" / f"{name}-forces.png")
        if name == "take-off":
            write_snapshots(robot, trajectory, ROOT / "docs" / "take-off.png")
    for name in mt.scenarios.SCENARIOS:
        draw_snapshots(robot, mt.Trajectory.load(RESULTS / name / "trajectory.npz"), name)
    for name, robot_of_it in OF_EXAMPLES.items():
        draw_snapshots(mt.load_robot(robot_of_it), mt.Trajectory.load(RESULTS / name / "trajectory.npz"), name)
    tables = (RESULTS / "table.md").read_text(encoding="utf-8")
    set_table(ROOT / "docs" / "results.md", tables)
    set_table(ROOT / "README.md", "\n\n".join(tables.split("\n\n")[:2]) + "\n")


def set_table(page: Path, text: str) -> None:
    """Put a text between the marks of a page."""
    before, rest = page.read_text(encoding="utf-8").split(BEGIN)
    page.write_text(f"{before}{BEGIN}\n{text}{END}{rest.split(END)[1]}", encoding="utf-8")


if __name__ == "__main__":
    main()

"""Films and stills of a motion, taken of its page by a headless browser."""

from __future__ import annotations

import io
import os
from collections.abc import Iterable, Iterator
from pathlib import Path

import numpy as np
from PIL import Image

from multimodal_to.adam.spatial import Array
from multimodal_to.arguments import checked
from multimodal_to.errors import InputError, OutputError, shown
from multimodal_to.files.writing import scratch, whole
from multimodal_to.models.robot import Robot
from multimodal_to.models.terrain import FlatGround, uphill
from multimodal_to.replay.browser import open_browser
from multimodal_to.replay.motion import surface_of
from multimodal_to.replay.page import write_html, write_still_html
from multimodal_to.replay.scene import HOLD
from multimodal_to.trajectory import Trajectory
from multimodal_to.trajectory.derived import flight_phases
from multimodal_to.trajectory.resampling import resample

GIF_SIZE, MP4_SIZE = (640, 560), (960, 720)  # [pixel]
SNAPSHOT_SIZE = (400, 760)  # of each robot in a still scene [pixel]
_COLOURS = 128  # of a GIF
LARGEST_SIDE = 8192
"""Most pixels of a picture along each side; browsers draw no more."""
_ROOM = 0.35  # between ghosts that stand where they were [m]


@checked
def write_gif(
    robot: Robot,
    trajectory: Trajectory,
    path: str | os.PathLike[str],
    *,
    rate: float = 12.5,
    size: tuple[int, int] = GIF_SIZE,
    ghost: Trajectory | None = None,
    meshes: bool = True,
) -> Path:
    """Write the motion as a GIF that repeats, at true speed, of `rate` frames a second.

    Args:
        robot: that moves.
        trajectory: its motion.
        path: of the GIF.
        rate: frames a second [1/s], at most 100.
        size: width and height [pixel].
        ghost: another motion of the same robot, drawn faint in the same scene; it begins when this one does.
        meshes: draw meshes where the robot has them; else boxes, cylinders and spheres alone.

    Raises:
        InputError: the rate is not positive, or the ghost is not one of the same robot.
        OutputError: there is no browser, or the file cannot be written.
    """
    times = _frame_times(trajectory, rate)
    _check_size(size)
    with whole(path) as draft:
        shots = _film(robot, trajectory, times, size, ghost, meshes)
        frames = [Image.open(io.BytesIO(shot)).convert("RGB") for shot in shots]
        palette = frames[len(frames) // 2].quantize(_COLOURS, method=Image.Quantize.MEDIANCUT)
        pictures = [frame.quantize(palette=palette, dither=Image.Dither.NONE) for frame in frames]
        ends = np.round(100.0 * np.append(times[1:], times[-1] + HOLD))  # a GIF counts hundredths of a second
        delays = 10.0 * np.diff(ends, prepend=0.0)
        pictures[0].save(
            draft, save_all=True, append_images=pictures[1:], duration=delays.tolist(), loop=0, optimize=False
        )
    return Path(path)


@checked
def write_mp4(
    robot: Robot,
    trajectory: Trajectory,
    path: str | os.PathLike[str],
    *,
    rate: float = 25.0,
    size: tuple[int, int] = MP4_SIZE,
    ghost: Trajectory | None = None,
    meshes: bool = True,
) -> Path:
    """Write the motion as an MP4 (H.264), at true speed, of `rate` frames a second; the last pose stands for a second.

    Args:
        robot: that moves.
        trajectory: its motion.
        path: of the film.
        rate: frames a second [1/s], at most 100.
        size: width and height [pixel], even numbers.
        ghost: another motion of the same robot, drawn faint in the same scene; it begins when this one does.
        meshes: draw meshes where the robot has them; else boxes, cylinders and spheres alone.

    Raises:
        InputError: the rate is not positive, or the ghost is not one of the same robot.
        OutputError: there is no browser or no imageio-ffmpeg, or the file cannot be written.
    """
    try:
        import imageio_ffmpeg
    except ImportError as error:
        raise OutputError("MP4 needs imageio-ffmpeg: pip install 'multimodal-to[video]'") from error
    times = _frame_times(trajectory, rate)
    _check_size(size)
    with whole(path) as draft:
        writer = imageio_ffmpeg.write_frames(
            str(draft),
            size,
            fps=rate,
            codec="libx264",
            pix_fmt_in="rgb24",
            pix_fmt_out="yuv420p",
            quality=8,
            macro_block_size=2,
            output_params=["-movflags", "+faststart"],
        )
        writer.send(None)
        try:
            frame = b""
            for shot in _film(robot, trajectory, times, size, ghost, meshes):
                frame = Image.open(io.BytesIO(shot)).convert("RGB").tobytes()
                writer.send(frame)
            for _ in range(round(HOLD * rate)):
                writer.send(frame)
        finally:
            writer.close()
    return Path(path)


@checked
def write_snapshots(
    robot: Robot,
    trajectory: Trajectory,
    path: str | os.PathLike[str],
    *,
    times: Iterable[float] | None = None,
    size: tuple[int, int] | None = None,
    meshes: bool = True,
) -> Path:
    """Write one still picture (PNG) of the robot at several times [s]; `snapshot_times` without any.

    Args:
        robot: that moves.
        trajectory: its motion.
        path: of the picture.
        times: that increase [s].
        size: width and height [pixel]; by default room for each robot.
        meshes: draw meshes where the robot has them; else boxes, cylinders and spheres alone.

    Raises:
        InputError: a time is not within the trajectory, or times do not increase.
        OutputError: there is no browser, or the file cannot be written.
    """
    instants = snapshot_times(robot, trajectory) if times is None else np.array(list(times), dtype=float)
    if size is not None:
        _check_size(size)
    width, height = size or (max(SNAPSHOT_SIZE[0] * instants.size, SNAPSHOT_SIZE[1]), SNAPSHOT_SIZE[1])
    with scratch() as folder, whole(path) as draft:
        page = folder / "still.html"
        write_still_html(robot, trajectory, instants, page, aspect=width / height, meshes=meshes)
        with open_browser((width, height)) as browser:
            browser.open(page, "#bare")
            browser.evaluate("replay.show(0)")
            draft.write_bytes(browser.picture())
    return Path(path)


@checked
def snapshot_times(robot: Robot, trajectory: Trajectory) -> Array:
    """Return times [s] that tell a motion: start and end, and those where flight begins or ends, or even ones.

    They are five; on ground that changes every way, where ghosts stand where they were, only those that leave room
    between.

    Args:
        robot: whose weight tells flight.
        trajectory: its motion.
    """
    start, end = float(trajectory.time[0]), float(trajectory.time[-1])
    edges = [edge for phase in flight_phases(robot, trajectory) for edge in phase if start < edge < end]
    times = np.linspace(start, end, 5)
    if len(edges) == 1:
        times = np.array([start, (start + edges[0]) / 2, edges[0], (edges[0] + end) / 2, end])
    surface = surface_of(trajectory)
    return times if isinstance(surface, FlatGround) or uphill(surface) is not None else _apart(trajectory, times)


def _apart(trajectory: Trajectory, times: Array) -> Array:
    """Return the first and the last of times [s], and those between at which the CoM is away from all others kept."""
    com = resample(trajectory, times).com_position[:2].T
    kept = [0, len(times) - 1]
    for index in range(1, len(times) - 1):
        if np.linalg.norm(com[kept] - com[index], axis=1).min() > _ROOM:
            kept.append(index)
    return np.asarray(times[np.sort(kept)])


def _check_size(size: tuple[int, int]) -> None:
    if len(size) != 2 or not all(1 <= side <= LARGEST_SIDE for side in size):
        raise InputError(
            f"the size of the pictures is {shown(size)}; expected width and height, 1 to {LARGEST_SIDE} pixels"
        )


def _frame_times(trajectory: Trajectory, rate: float) -> Array:
    if not 0.0 < rate <= 100.0:
        raise InputError(f"the frame rate is {rate:g} a second; expected more than 0 and at most 100")
    count = int(np.floor(trajectory.duration * rate + 1e-9)) + 1
    return np.arange(count) / rate


def _film(
    robot: Robot, trajectory: Trajectory, times: Array, size: tuple[int, int], ghost: Trajectory | None, meshes: bool
) -> Iterator[bytes]:
    """Return a picture of the page at each time [s], with its clock and without its buttons.

    Args:
        robot: that moves.
        trajectory: its motion.
        times: of the pictures, since the motion's start [s], (pictures,).
        size: width and height [pixel].
        ghost: another motion of the same robot, drawn faint in the same scene; it begins when this one does.
        meshes: draw meshes where the robot has them; else boxes, cylinders and spheres alone.
    """
    with scratch() as folder:
        page = write_html(robot, trajectory, folder / "film.html", ghost=ghost, meshes=meshes)
        with open_browser(size) as browser:
            browser.open(page, "#film&t=0")
            for instant in times.tolist():
                browser.evaluate(f"replay.show({instant!r})")
                yield browser.picture("jpeg")

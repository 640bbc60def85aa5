"""A motion as a scene that moves, and as one still scene with the robot at several times."""

from __future__ import annotations

import math
import warnings
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from multimodal_to.adam.spatial import Array
from multimodal_to.errors import InputError
from multimodal_to.models.robot import Robot
from multimodal_to.models.terrain import FlatGround, Surface, heights_below, uphill
from multimodal_to.replay.bodies import draw_links, draw_visuals, drawn, faded, link_paths, link_poses
from multimodal_to.replay.effects import draw_com, draw_com_trace, draw_contact_forces, draw_flames, draw_pushes
from multimodal_to.replay.ghost import draw_ghost, in_step
from multimodal_to.replay.regions import draw_regions, regions_of
from multimodal_to.replay.scene import Scene, meshcat
from multimodal_to.replay.stage import View, draw_stage
from multimodal_to.replay.visuals import Appearance, Visual
from multimodal_to.scenarios.data import OwnSurfaceError, stored
from multimodal_to.trajectory import QUANTITIES, Trajectory
from multimodal_to.trajectory.derived import acting_times, frame_poses, outside_forces
from multimodal_to.trajectory.resampling import resample
from multimodal_to.trajectory.sameness import refuse_other_robot

FOLLOW_FROM = 0.6
"""The camera follows the CoM along the ground in motions that go farther than this [m]."""

_HALF_LEFT = np.array([-0.72, -0.66, 0.22])  # where the camera is, seen from a robot that faces −x
_BEHIND_LEFT = np.array([0.45, -0.85, 0.30])  # where it is if the ground, seen from there, would hide its steps
_FROM_THE_SIDE = 0.14  # how high the camera of a still scene is, per metre of distance
_BAR = 0.12  # room below the robot for the buttons of the page, per metre of its height
_LABEL = 0.12  # room for the labels below the ghosts [m]
_STILL_ZOOM = 4.0  # from farther off, so that ghosts look alike
_CLOCK = 0.01  # what the clock of a page shows [s]: a time so near to start or end means it
_GAP = 0.25  # between the ghosts of a motion that stays in its place, per width of the robot
_FAINTEST = 0.45  # opacity of the first of the ghosts that may overlap


class GroundWarning(UserWarning):
    """The ground of a motion is not known."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Picture:
    """How the scene is to be looked at: where it stands before the camera, and how that follows the CoM."""

    home: Array  # of the scene's root, (3,) [m]
    way: Array  # of the scene's root at every knot, so that the CoM stays before the camera, (knots + 1, 3) [m]
    follow: bool
    still: bool
    labels: tuple[tuple[str, Array], ...] = ()  # texts, and where in the world they stand


def draw_motion(
    visualizer: meshcat.Visualizer,
    robot: Robot,
    trajectory: Trajectory,
    look: Appearance,
    *,
    ghost: Trajectory | None = None,
    live: bool = False,
) -> Picture:
    """Draw stage, walls and boxes, robot, flames, forces and CoM, and set the animation that moves them, at true speed.

    In meshcat's own `live` page the animation also moves the scene so that the camera follows, which ours does itself,
    and flames keep one brightness, since it knows the materials too late.

    Args:
        visualizer: meshcat's, whose window may be a `Recorder`.
        robot: that moves.
        trajectory: its motion.
        look: the robot's visuals.
        ghost: another motion of the same robot, drawn faint in the same scene; it begins when this one does.
        live: draw for meshcat's own page.
    """
    refuse_other_robot(trajectory, robot)
    scene = Scene(visualizer=visualizer, time=trajectory.time - trajectory.time[0])
    com = trajectory.com_position.T * [1.0, 1.0, 0.0]
    span = np.ptp(com, axis=0)
    follow = bool(np.linalg.norm(span) > FOLLOW_FROM)
    low, high = _extent(robot, trajectory, look.visuals, com - com[0] if follow else np.zeros_like(com))
    if ghost is not None:
        ghost = in_step(trajectory, ghost)
        corners = _extent(robot, ghost, look.visuals, com - com[0] if follow else np.zeros_like(com))
        low, high = np.minimum(low, corners[0]), np.maximum(high, corners[1])
    low[2] = min(low[2], 0.0) - _BAR * (high[2] - low[2])
    surface = surface_of(trajectory)
    direction = _BEHIND_LEFT if _rises(surface, com.mean(axis=0), _HALF_LEFT) else _HALF_LEFT
    view = _view(np.array([[low, high]]), direction)
    draw_stage(scene, view, surface, reach=float(span.max()))
    draw_regions(scene, view, regions_of(trajectory))

    paths = link_paths(robot, look, "robot")
    draw_links(scene, paths, link_poses(robot, trajectory, paths))
    draw_visuals(scene, paths, {visual: drawn(visual) for visual in look.visuals})
    draw_flames(scene, robot, trajectory.thrust, paths, steady=live)
    draw_contact_forces(scene, robot, trajectory)
    draw_pushes(scene, robot, trajectory, outside_forces(trajectory))
    draw_com(scene, trajectory)
    if ghost is not None:
        draw_ghost(scene, robot, ghost, look)
    way = -view.middle - (com - com[0])
    if follow and live:
        scene.move("", "position", way)
    visualizer.set_animation(scene.animation, play=True, repetitions=math.inf)
    return Picture(home=-view.middle, way=way, follow=follow, still=False)


def draw_still(
    visualizer: meshcat.Visualizer, robot: Robot, trajectory: Trajectory, times: Array, look: Appearance, aspect: float
) -> Picture:
    """Draw the robot at several times [s] in one scene, with its flames and contact forces, and a label under each.

    Where it travels far enough from one to the next, ghosts stand where they were, the earlier the fainter; else they
    stand side by side, from left to right; on a slope or on stairs along their contour lines. Ground that changes every
    way forbids that.

    Args:
        visualizer: meshcat's, whose window may be a `Recorder`.
        robot: that moves.
        trajectory: its motion.
        times: that increase [s], (stills,).
        look: the robot's visuals.
        aspect: width over height of the picture.

    Raises:
        InputError: a time is not within the trajectory, or times do not increase.
    """
    refuse_other_robot(trajectory, robot)
    if not 0.0 < aspect < np.inf:
        raise InputError(f"the picture's width over height is {aspect}; expected a positive number")
    instants = np.asarray(times, dtype=float)
    ends = np.clip(instants, trajectory.time[0], trajectory.time[-1])
    instants = np.where(np.abs(instants - ends) < _CLOCK, ends, instants)
    if instants.size == 0 or (np.diff(instants) <= 0.0).any():
        raise InputError(f"the times of the snapshots are {instants.tolist()}; expected times that increase [s]")
    ghosts = _frozen(trajectory, instants)
    surface = surface_of(trajectory)
    direction, offsets, apart = _layout(robot, ghosts, look.visuals, surface)
    boxes = [
        np.array(_extent(robot, ghost, look.visuals, np.zeros((2, 3)))) + offset
        for ghost, offset in zip(ghosts, offsets, strict=True)
    ]
    boxes[0][0, 2] = min(boxes[0][0, 2], 0.0) - _LABEL
    view = _view(np.array(boxes), direction, aspect=aspect, zoom=_STILL_ZOOM)
    scene = Scene(visualizer=visualizer, time=np.zeros(1))
    draw_stage(scene, view, surface)
    if not apart:
        draw_regions(scene, view, regions_of(trajectory))
    bodies = {visual: drawn(visual) for visual in look.visuals}
    acting = np.minimum(np.searchsorted(acting_times(trajectory)[1], instants - 1e-9), trajectory.knots)
    opacities = np.ones(len(ghosts)) if apart else np.linspace(_FAINTEST, 1.0, len(ghosts))
    for index, (ghost, offset, opacity) in enumerate(zip(ghosts, offsets, opacities.tolist(), strict=True)):
        paths = link_paths(robot, look, f"ghost_{index}/robot")
        draw_links(scene, paths, link_poses(robot, ghost, paths))
        draw_visuals(scene, paths, bodies if opacity == 1.0 else faded(bodies, opacity))
        draw_flames(scene, robot, ghost.thrust, paths, opacity=opacity)
        draw_contact_forces(scene, robot, ghost, f"ghost_{index}/contact_forces")
        pushes = [(frame, force[:, acting[[index, index]]]) for frame, force in outside_forces(trajectory)]
        draw_pushes(scene, robot, ghost, pushes, f"ghost_{index}/pushes")
        visualizer[f"ghost_{index}"].set_property("position", offset.tolist())
    if not apart:
        draw_com_trace(scene, trajectory)
    toward = np.array([*direction[:2], 0.0]) / np.linalg.norm(direction[:2])
    labels = tuple(
        (f"{instant:.1f} s", np.array([*(ghost.com_position[:2, 0] + offset[:2]), 0.0]) + 0.35 * toward)
        for instant, ghost, offset in zip(instants, ghosts, offsets, strict=True)
    )
    return Picture(home=-view.middle, way=np.zeros((0, 3)), follow=False, still=True, labels=labels)


def surface_of(trajectory: Trajectory) -> Surface:
    """Return the ground of the scenario that the trajectory keeps; flat where it keeps none.

    It is flat as well where the ground is of a class of one's own, and a `GroundWarning` says so.
    """
    try:
        scenario = stored(trajectory)
    except OwnSurfaceError as error:
        warnings.warn(f"drawn on flat ground: {str(error).partition(';')[0]}", GroundWarning, stacklevel=2)
        return FlatGround()
    return FlatGround() if scenario is None else scenario.surface


def _rises(surface: Surface, place: Array, direction: Array) -> bool:
    """Return whether the ground a metre from a place in a direction is higher than a metre the other way.

    Args:
        surface: the ground.
        place: in the world [m], (3,).
        direction: horizontal part in the world, of any length, (3,).
    """
    step = np.array([*direction[:2], 0.0]) / np.linalg.norm(direction[:2])
    ahead, behind = heights_below(surface, np.column_stack([place + step, place - step]))
    return bool(ahead > behind + 0.01)


def _frozen(trajectory: Trajectory, instants: Array) -> list[Trajectory]:
    """Return for each instant [s] a trajectory of two knots that both show it."""
    times = np.union1d(instants, trajectory.time[[0, -1]])  # a trajectory has at least two knots
    sampled = resample(trajectory, times)
    return [
        replace(
            sampled, time=np.array([0.0, 1.0]), **{name: getattr(sampled, name)[:, [at, at]] for name in QUANTITIES}
        )
        for at in np.searchsorted(times, instants)
    ]


def _layout(
    robot: Robot, ghosts: list[Trajectory], visuals: tuple[Visual, ...], surface: Surface
) -> tuple[Array, Array, bool]:
    """Return the camera's direction, how far each ghost is moved aside (ghosts, 3), and whether they were moved.

    Args:
        robot: that moves.
        ghosts: the robot at each time, from `_frozen`.
        visuals: of the robot.
        surface: ghosts may be moved aside where it is flat, or across the way that it rises along.
    """
    low, high = _extent(robot, ghosts[0], visuals, np.zeros((2, 3)))
    width = float(np.linalg.norm((high - low)[:2])) / math.sqrt(2.0)
    places = np.array([ghost.com_position[:, 0] * [1.0, 1.0, 0.0] for ghost in ghosts])
    steps = np.linalg.norm(np.diff(places, axis=0), axis=1)
    flat, up = isinstance(surface, FlatGround), uphill(surface)
    movable = flat or up is not None
    if not movable and (len(ghosts) < 2 or not steps.any()):
        return _HALF_LEFT, np.zeros((len(ghosts), 3)), True
    if len(ghosts) > 1 and (steps.min() > 0.5 * width or not movable):
        farthest = places[np.linalg.norm(places - places[0], axis=1).argmax()] - places[0]
        travel = farthest / np.linalg.norm(farthest)
        side = np.array([travel[1], -travel[0], _FROM_THE_SIDE])  # from there the motion goes from left to right
        return side, np.zeros((len(ghosts), 3)), False
    direction = np.array([*_HALF_LEFT[:2], _FROM_THE_SIDE])
    right = np.array([-direction[1], direction[0], 0.0]) / np.linalg.norm(direction[:2])
    shares = np.arange(len(ghosts)) - (len(ghosts) - 1) / 2.0
    if up is not None:  # seen from below, and moved along the contour lines alone
        direction = np.array([-up[0], -up[1], _FROM_THE_SIDE])
        right = np.array([up[1], -up[0], 0.0])
        along = (places - places.mean(axis=0)) @ right
        return direction, (shares * (1.0 + _GAP) * width - along)[:, None] * right, True
    return direction, shares[:, None] * (1.0 + _GAP) * width * right - (places - places.mean(axis=0)), True


def _view(boxes: Array, direction: Array, **more: float) -> View:
    """Return the view of boxes, of which (boxes, 2, 3) are the lowest and highest corners, and of the ground below."""
    toward = direction[:2] / np.linalg.norm(direction[:2])
    axes = np.array([[-toward[1], toward[0]], toward])  # of the picture: to the right, and to the camera
    ends = boxes[:, :, :2]
    corners = np.concatenate([ends, np.stack([ends[:, [0, 1], [0, 1]], ends[:, [1, 0], [0, 1]]], axis=1)], axis=1)
    placed = corners.reshape(-1, 2) @ axes.T
    low, high = placed.min(axis=0), placed.max(axis=0)
    bottom, top = min(boxes[:, 0, 2].min(), 0.0), boxes[:, 1, 2].max()
    middle = np.array([*(low + high) / 2.0 @ axes, (bottom + top) / 2.0])
    width, depth = (high - low).tolist()
    return View(middle=middle, width=width, height=float(top - bottom), depth=depth, direction=direction, **more)


def _extent(robot: Robot, trajectory: Trajectory, visuals: tuple[Visual, ...], moved: Array) -> tuple[Array, Array]:
    """Return the corners of the box around the robot at all knots, each seen from `moved` (knots + 1, 3) [m].

    Args:
        robot: that moves.
        trajectory: its motion.
        visuals: of the robot.
        moved: places in the world at the knots [m], (knots + 1, 3).
    """
    low, high = np.full(3, np.inf), np.full(3, -np.inf)
    for link, points in _points(visuals).items():
        poses = frame_poses(robot, trajectory, link)
        world = points @ poses[:, :3, :3].transpose(0, 2, 1) + (poses[:, :3, 3] - moved)[:, None, :]
        low, high = np.minimum(low, world.min(axis=(0, 1))), np.maximum(high, world.max(axis=(0, 1)))
    if np.isfinite(low).all():
        return low, high
    com = trajectory.com_position.T - moved  # of a robot without a shape
    return com.min(axis=0) - 0.5, com.max(axis=0) + 0.5


def _points(visuals: tuple[Visual, ...]) -> Mapping[str, Array]:
    """Return points (n, 3) in each link's frame in whose hull its visuals lie."""
    found: dict[str, list[Array]] = {}
    for visual in visuals:
        if visual.part is not None:
            low, high = visual.part.vertices.min(axis=0), visual.part.vertices.max(axis=0)
        else:
            high = _half_size(visual)
            low = -high
        corners = np.array(np.meshgrid(*zip(low, high, strict=True))).reshape(3, -1).T
        found.setdefault(visual.link, []).append(corners @ visual.transform[:3, :3].T + visual.transform[:3, 3])
    return {link: np.vstack(parts) for link, parts in found.items()}


def _half_size(visual: Visual) -> Array:
    """Return half the edges of the box around a primitive [m], (3,)."""
    shape = visual.primitive
    assert shape is not None
    if shape.box is not None:
        return np.asarray(shape.box.size, dtype=float) / 2.0
    if shape.cylinder is not None:
        return np.array([shape.cylinder.radius, shape.cylinder.radius, shape.cylinder.length / 2.0], dtype=float)
    return np.full(3, float(shape.sphere.radius))

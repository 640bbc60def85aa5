"""A live viewer: meshcat's own server and page."""

from __future__ import annotations

import io
import os
import subprocess
import sys
import warnings
from contextlib import redirect_stdout
from pathlib import Path

from multimodal_to import children
from multimodal_to.arguments import checked
from multimodal_to.errors import OutputError
from multimodal_to.models.robot import Robot
from multimodal_to.replay.motion import draw_motion
from multimodal_to.replay.scene import meshcat
from multimodal_to.replay.visuals import appearance
from multimodal_to.trajectory import Trajectory


@checked
def serve(
    robot: Robot, trajectory: Trajectory, *, ghost: Trajectory | None = None, meshes: bool = True
) -> meshcat.Visualizer:
    """Start meshcat's server, draw the motion there and return the visualizer; a browser at its `url()` plays it.

    Args:
        robot: that moves.
        trajectory: its motion.
        ghost: another motion of the same robot, drawn faint in the same scene; it begins when this one does.
        meshes: draw meshes where the robot has them; else boxes, cylinders and spheres alone.

    Raises:
        OutputError: meshcat's server does not start.
        InputError: the ghost is not one of the same robot.
    """
    look = appearance(robot.urdf, meshes=meshes)
    server, address = _server()
    with redirect_stdout(io.StringIO()), warnings.catch_warnings():  # meshcat prints the address
        warnings.simplefilter("ignore", ResourceWarning)  # and connects twice without closing its first socket
        visualizer = meshcat.Visualizer(zmq_url=address)
    visualizer.window.server_proc = server
    draw_motion(visualizer, robot, trajectory, look, ghost=ghost, live=True)
    return visualizer


def _server() -> tuple[subprocess.Popen[bytes], str]:
    """Start meshcat's server, which ends with this process, and return it and the address that it listens at.

    Raises:
        OutputError: it does not start.
    """
    beside = str(Path(meshcat.__file__).parents[1])  # meshcat may have been found in any way
    process = children.start(
        [sys.executable, "-u", "-m", "meshcat.servers.zmqserver"],
        reads=True,
        env={**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, (beside, os.environ.get("PYTHONPATH"))))},
    )
    assert process.stdout is not None
    for line in process.stdout:
        if line.startswith(b"zmq_url="):
            return process, line.decode().strip().removeprefix("zmq_url=")
    children.end(process)
    raise OutputError("meshcat's server does not start")

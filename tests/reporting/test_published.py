"""With our URDF, CoM and angular momentum of the paper's published trajectories are met."""

from __future__ import annotations

import numpy as np
import pytest

from published_runs import PUBLISHED, needs_published


@needs_published
@pytest.mark.parametrize(
    ("name", "com_limit", "momentum_limit"), [("landing", 1e-7, 1e-6), ("take_off_and_landing", 2e-5, 1e-4)]
)
def test_published_momenta_are_met(ironcub, name, com_limit, momentum_limit):
    with np.load(PUBLISHED / f"{name}.npz", allow_pickle=False) as data:
        com_gaps, momentum_gaps = [], []
        for knot in range(int(data["knots"]) + 1):
            x, y, z, w = data["base_quaternion_xyzw"][:, knot] / np.linalg.norm(data["base_quaternion_xyzw"][:, knot])
            transform = np.eye(4)
            transform[:3, :3] = [
                [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
                [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
                [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
            ]
            transform[:3, 3] = data["base_position"][:, knot]
            joints = data["joint_positions"][:, knot]
            twist = np.concatenate([data["base_linear_velocity"][:, knot], data["base_angular_velocity"][:, knot]])
            com = np.array(ironcub.kindyn.CoM_position(transform, joints)).ravel()
            momentum = ironcub.kindyn.centroidal_momentum(transform, joints, twist, data["joint_velocities"][:, knot])
            com_gaps.append(np.abs(com - data["com_position"][:, knot]).max())
            momentum_gaps.append(np.abs(np.array(momentum).ravel()[3:] - data["angular_momentum"][:, knot]).max())
    assert max(com_gaps) <= com_limit
    assert max(momentum_gaps) <= momentum_limit

from __future__ import annotations

import numpy as np
import pytest

from multimodal_to.auditing.audit import audit
from multimodal_to.errors import TrajectoryError
from multimodal_to.trajectory import QUANTITIES
from multimodal_to.trajectory.importing import COMPUTED, import_arrays
from published_runs import PUBLISHED, needs_published
from synthetic import take_off as synthetic_take_off


@pytest.fixture
def bare(ironcub, tmp_path):
    """The arrays of a trajectory without anything that only our own files hold."""
    trajectory = synthetic_take_off(ironcub)
    arrays = {name: getattr(trajectory, name) for name in QUANTITIES if name not in COMPUTED}
    path = tmp_path / "their_motion.npz"
    np.savez(path, total_time=trajectory.duration, **arrays)
    return trajectory, path, arrays


def test_what_bare_arrays_lack_is_computed(ironcub, bare):
    trajectory, path, _ = bare
    imported = import_arrays(ironcub, path)
    assert imported.contact_positions == pytest.approx(trajectory.contact_positions, abs=1e-12)
    assert imported.time == pytest.approx(trajectory.time)
    assert imported.scenario == "their-motion"


def test_an_array_that_is_missing_is_named(ironcub, bare):
    _, path, arrays = bare
    np.savez(path, total_time=1.0, **{name: array for name, array in arrays.items() if name != "throttle"})
    with pytest.raises(TrajectoryError, match="lacks throttle"):
        import_arrays(ironcub, path)


def test_an_array_of_another_robot_is_refused(ironcub, bare):
    _, path, arrays = bare
    np.savez(path, total_time=1.0, **{**arrays, "joint_positions": arrays["joint_positions"][:20]})
    with pytest.raises(TrajectoryError, match=r"'joint_positions' has shape \(20, .*expected \(23, "):
        import_arrays(ironcub, path)


@needs_published
@pytest.mark.parametrize(
    ("name", "slip", "force_height"), [("landing", 0.0012, 0.0), ("take_off_and_landing", 0.033, 0.054)]
)
def test_the_audit_of_the_published_data_finds_what_is_known_of_them(ironcub, name, slip, force_height):
    report = audit(ironcub, import_arrays(ironcub, PUBLISHED / f"{name}.npz"))
    assert report["slip under load"].worst == pytest.approx(slip, rel=0.05)
    assert report["normal force × height"].worst == pytest.approx(force_height, abs=5e-4)

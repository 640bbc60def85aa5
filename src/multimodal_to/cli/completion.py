"""What the shell offers when a person presses Tab: names that commands know, and files where they take them."""

from __future__ import annotations

from collections.abc import Iterable
from glob import escape, glob
from pathlib import Path

from multimodal_to.exporting.export import EXPORTS
from multimodal_to.exporting.motion import FLAVOURS
from multimodal_to.models.loading import bundled_robots
from multimodal_to.scenarios import SCENARIOS
from multimodal_to.solving.linear_solvers import AUTO, LINEAR_SOLVERS
from multimodal_to.tasks import TASKS


def scenarios(incomplete: str) -> list[str]:
    """Return the bundled scenarios that start so."""
    return _starting(SCENARIOS, incomplete)


def controllers(incomplete: str) -> list[str]:
    """Return the controllers of `simulate` that start so."""
    from multimodal_to.simulation.trials import CONTROLLERS

    return _starting(CONTROLLERS, incomplete)


def tasks(incomplete: str) -> list[str]:
    """Return the bundled scenarios and the starter tasks that start so."""
    return _starting(dict.fromkeys((*SCENARIOS, *TASKS)), incomplete)


def scenarios_or_files(incomplete: str) -> list[str]:
    """Return the tasks and the TOML files and folders that start so."""
    return tasks(incomplete) + _paths(incomplete, (".toml",))


def scenarios_or_trajectories(incomplete: str) -> list[str]:
    """Return the tasks and the TOML files, trajectory files and folders that start so."""
    return tasks(incomplete) + _paths(incomplete, (".toml", ".npz"))


def robots_or_folders(incomplete: str) -> list[str]:
    """Return the bundled robots, and the folders that start so."""
    return _starting(bundled_robots(), incomplete) + _paths(incomplete, ())


def robots_or_urdfs(incomplete: str) -> list[str]:
    """Return the bundled robots, and the URDF files and folders that start so."""
    return _starting(bundled_robots(), incomplete) + _paths(incomplete, (".urdf",))


def linear_solvers(incomplete: str) -> list[str]:
    """Return the linear solvers that start so, here or not."""
    return _starting((AUTO, *LINEAR_SOLVERS), incomplete)


def figures(incomplete: str) -> list[str]:
    """Return the figures that start so, and `all`."""
    from multimodal_to.plotting import FIGURES  # takes a second, which only this completion should wait for

    return _starting((*FIGURES, "all"), incomplete)


def exports(incomplete: str) -> list[str]:
    """Return the kinds of export that start so."""
    return _starting((*EXPORTS, "motion"), incomplete)


def flavours(incomplete: str) -> list[str]:
    """Return the flavours of motion files that start so."""
    return _starting(FLAVOURS, incomplete)


def _starting(names: Iterable[str], incomplete: str) -> list[str]:
    return [name for name in names if name.startswith(incomplete)]


def _paths(incomplete: str, suffixes: tuple[str, ...]) -> list[str]:
    found = sorted(glob(f"{escape(incomplete)}*"))
    return [
        f"{path}/" if Path(path).is_dir() else path for path in found if Path(path).is_dir() or path.endswith(suffixes)
    ]

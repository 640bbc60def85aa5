"""The house: a file imports only from rooms below its own, and nothing goes round in a circle."""

from __future__ import annotations

import ast
from graphlib import TopologicalSorter
from pathlib import Path

import pytest

import multimodal_to

ROOT = Path(multimodal_to.__file__).parent
FLOORS = [
    {"children", "ending", "errors", "values"},
    {"arguments"},
    {"files", "native"},
    {"adam"},
    {"models"},
    {"trajectory"},
    {"scenarios", "exporting"},
    {"ocp", "auditing", "simulation", "replay", "tasks"},
    {"solving"},
    {"doctor", "plotting", "sweeping"},
    {"reporting", "robots"},
    {"cli", "__init__"},
    {"__main__"},
]
"""The rooms from the ground up; rooms of one floor do not know of each other."""

FILES = sorted(ROOT.rglob("*.py"))


def module_of(file: Path) -> str:
    parts = file.relative_to(ROOT.parent).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


MODULES = {module_of(file): file for file in FILES}


def room_of(module: str) -> str:
    return (*module.split("."), "__init__")[1]


def floor(room: str) -> int:
    return next(level for level, rooms in enumerate(FLOORS) if room in rooms)


def imported(file: Path) -> set[str]:
    """The modules of the package that a file imports, at its top or inside a function."""
    names = set()
    for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom) and node.module:
            for alias in node.names:
                inner = f"{node.module}.{alias.name}"
                names.add(inner if inner in MODULES else node.module)
        elif isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
    return names & MODULES.keys()


@pytest.mark.parametrize("module", MODULES)
def test_imports_point_down(module):
    here = room_of(module)
    for name in imported(MODULES[module]):
        there = room_of(name)
        assert floor(there) < floor(here) or there == here, f"{module} imports {name}"


def test_no_imports_go_round_in_a_circle():
    graph = {module: imported(file) - {module} for module, file in MODULES.items()}
    assert list(TopologicalSorter(graph).static_order())  # it raises CycleError, with the circle


def test_every_room_is_on_a_floor():
    assert {room_of(module) for module in MODULES} == set().union(*FLOORS)


def test_only_the_problem_makes_an_opti():
    users = {str(file.relative_to(ROOT)) for file in FILES if "Opti(" in file.read_text(encoding="utf-8")}
    assert users == {"ocp/building.py"}


def test_nothing_prints_below_the_command_line():
    for file in FILES:
        if file.parent.name != "cli":
            calls = [
                node for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))) if isinstance(node, ast.Call)
            ]
            assert not [
                call for call in calls if isinstance(call.func, ast.Name) and call.func.id in {"print", "input"}
            ]

"""A file imports only from rooms below its own."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest

import multimodal_to

ROOT = Path(multimodal_to.__file__).parent
FLOORS = [
    {"errors", "published", "machine"},
    {"reading", "writing"},
    {"trajectory"},
    {"resampling"},
    {"adam"},
    {"models"},
    {"ocp"},
    {"scenarios", "doctor"},
    {"scenario_files", "derived", "terrain_mesh"},
    {"findings"},
    {"audit_task", "audit_thrust"},
    {"audit", "importing"},
    {"replay", "plotting", "simulation"},
    {"report", "export"},
    {"reproduce"},
    {"comparison"},
    {"cli", "__init__"},
    {"__main__"},
]
OCP_FLOORS = [
    {"scenario"},
    {"scenario_data"},
    {"variables", "integrators", "linear_solvers", "compiled"},
    {"gait", "naming"},
    {"constraints", "guess"},
    {"costs", "boundary"},
    {"transcription", "solvers", "interrupts"},
    {"stages"},
    {"problem", "record"},
    {"motion", "misses"},
    {"best"},
    {"solution", "elastic"},
    {"__init__"},
]


def floor(room: str, floors: list[set[str]]) -> int:
    return next(level for level, rooms in enumerate(floors) if room in rooms)


def imported(file: Path) -> set[str]:
    names = set()
    for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom) and node.module:
            names |= {node.module} | {f"{node.module}.{alias.name}" for alias in node.names}
        elif isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
    return names


FILES = sorted(ROOT.rglob("*.py"))


@pytest.mark.parametrize("file", FILES, ids=[str(file.relative_to(ROOT)) for file in FILES])
def test_imports_point_down(file):
    room = file.relative_to(ROOT).parts[0].removesuffix(".py")
    for name in imported(file):
        parts = name.split(".")
        if (
            parts[0] != "multimodal_to"
            or len(parts) < 2
            or not (ROOT / parts[1]).with_suffix(".py").exists() | (ROOT / parts[1]).is_dir()
        ):
            continue
        below, here = floor(parts[1], FLOORS), floor(room, FLOORS)
        assert below < here or parts[1] == room, f"{room} imports {name}"
        if room == parts[1] == "ocp" and len(parts) > 2 and (ROOT / "ocp" / f"{parts[2]}.py").exists():
            assert floor(parts[2], OCP_FLOORS) < floor(file.stem, OCP_FLOORS), f"ocp.{file.stem} imports {name}"


def test_only_the_ocp_rooms_touch_opti():
    users = {str(file.relative_to(ROOT)) for file in FILES if "Opti(" in file.read_text(encoding="utf-8")}
    assert users == {"ocp/problem.py"}


def test_nothing_prints_below_the_command_line():
    for file in FILES:
        if file.parent.name != "cli":
            calls = [
                node for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))) if isinstance(node, ast.Call)
            ]
            assert not [
                call for call in calls if isinstance(call.func, ast.Name) and call.func.id in {"print", "input"}
            ]

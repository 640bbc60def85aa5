"""Public functions of three or more arguments say what each of them is."""

from __future__ import annotations

import ast
import re
from pathlib import Path

import pytest

import multimodal_to

ROOT = Path(multimodal_to.__file__).parent
ROOMS = ("files", "models", "trajectory", "scenarios", "exporting", "doctor", "ocp", "solving", "auditing")
FILES = [file for room in ROOMS for file in sorted((ROOT / room).glob("*.py"))]


def arguments(function: ast.FunctionDef) -> list[str]:
    spec = function.args
    names = [argument.arg for argument in (*spec.posonlyargs, *spec.args, *spec.kwonlyargs)]
    return [name for name in names if name not in ("self", "cls")]


@pytest.mark.parametrize("file", FILES, ids=lambda file: f"{file.parent.name}/{file.name}")
def test_a_function_of_three_or_more_arguments_says_what_they_are(file):
    silent = {}
    for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
        if isinstance(node, ast.FunctionDef) and not node.name.startswith("_") and len(arguments(node)) >= 3:
            said = (ast.get_docstring(node) or "").partition("Args:")[2]
            if missing := [name for name in arguments(node) if not re.search(rf"^    {name}: ", said, re.MULTILINE)]:
                silent[node.name] = missing
    assert silent == {}

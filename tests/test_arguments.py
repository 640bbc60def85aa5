"""Public functions check their arguments; those of three or more say what each of them is."""

from __future__ import annotations

import ast
import importlib
import inspect
import pkgutil
import re
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, get_type_hints

import pytest

import multimodal_to
from multimodal_to.arguments import check
from multimodal_to.errors import InputError

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


# ---------------------------------------------------------------- every argument is checked

API = Path(__file__).parents[1] / "docs" / "api"
USED = ("auditing", "doctor", "exporting", "plotting", "replay", "reporting", "scenarios", "simulation", "trajectory")
"""Rooms whose modules people use beside what their packages list: those that a page of the API describes."""
UNCHECKED = {
    "adam.kindyn.KinDynComputations": "its quantities check their arguments themselves",
    "auditing.integrator": "on motions that the audit has checked",
    "auditing.margins": "on motions that the audit has checked",
    "errors.MultimodalError": "by the library",
    "models.terrain": "on symbols, by problems",
    "ocp.integration": "on symbols, by problems",
    "ocp.knot": "on symbols, by problems",
    "ocp.parameters": "by problems",
    "ocp.terms.Constraint": "by problems",
    "ocp.terms.Cost": "by problems",
    "ocp.terms.Within": "by problems",
    "simulation.controller.Controller": "a protocol, for others to fill",
    "simulation.controller.drawn": "on dataclasses of any kind",
    "simulation.stabiliser": "in every control step of a simulation",
    "solving.ipopt.Ipopt": "by `solve`",
    "solving.solver": "protocols, for others to fill",
}
"""What is public and checks no arguments, and why or by whom it is called."""

ANY = {("simulation.model.SimulationModel.set_state", "data")}
"""Arguments whose class is no annotation, as MuJoCo's own."""


def public() -> Iterator[tuple[str, Callable[..., Any]]]:
    """Public functions and methods that take arguments, by where they stand."""
    names = ["multimodal_to"]
    names += [found.name for found in pkgutil.walk_packages(multimodal_to.__path__, "multimodal_to.") if found.ispkg]
    found: dict[str, object] = {}
    for package in map(importlib.import_module, names):
        for value in (getattr(package, name) for name in getattr(package, "__all__", ())):
            if inspect.isfunction(value) or inspect.isclass(value):
                found[f"{value.__module__}.{value.__qualname__}"] = value
    described = {
        name for page in API.glob("*.md") for name in re.findall(r"^::: (\S+)", page.read_text(), re.MULTILINE)
    }
    for name in described:
        room = name.split(".")[1]
        if room in USED and (ROOT / Path(*name.split(".")[1:])).with_suffix(".py").is_file():
            module = importlib.import_module(name)
            found |= {f"{name}.{key}": value for key, value in vars(module).items() if _belongs(key, value, module)}
    for where, value in sorted(found.items()):
        for name, function in _functions(value):
            yield f"{where}{name}".removeprefix("multimodal_to."), function


def _belongs(name: str, value: object, module: object) -> bool:
    return not name.startswith("_") and inspect.isfunction(value) and inspect.getmodule(value) is module


def _functions(value: object) -> Iterator[tuple[str, Callable[..., Any]]]:
    if inspect.isfunction(value):
        if inspect.signature(value).parameters:
            yield "", value
    elif str(getattr(value, "__module__", "")).startswith("multimodal_to"):
        for name, method in vars(value).items():
            function = getattr(method, "__func__", method)
            own = not name.startswith("_") or (name == "__init__" and "__dataclass_fields__" not in vars(value))
            if own and inspect.isfunction(function) and len(inspect.signature(function).parameters) > 1:
                yield f".{name}", function


PUBLIC = dict(public())
CHECKED = {name: function for name, function in PUBLIC.items() if not name.startswith(tuple(UNCHECKED))}


def test_as_much_is_public_as_the_packages_and_pages_say():
    rooms = {name.split(".")[0] for name in CHECKED}
    assert set(USED) <= rooms
    assert {"exporting.export.write_csv", "trajectory.derived.footsteps", "solving.planner.Planner.solve"} <= set(
        CHECKED
    )
    assert all(any(name.startswith(part) for name in PUBLIC) for part in UNCHECKED)


@pytest.mark.parametrize("name", CHECKED)
def test_a_public_function_refuses_what_is_no_argument_of_it(name):
    """Called with nothing right, it names one; and each of its annotations tells an argument from none."""
    function, given, named = CHECKED[name], [], {}
    hints = get_type_hints(function)
    for key, parameter in inspect.signature(function).parameters.items():
        wrong = None if key in ("self", "cls") else object()
        if parameter.kind is inspect.Parameter.KEYWORD_ONLY:
            named[key] = wrong
        else:
            given.append(wrong)
        if wrong is not None and (name, key) not in ANY:
            with pytest.raises(InputError):
                check(key, wrong, hints[key])
    said = name.removesuffix(".__init__").rpartition(".")[2]
    with pytest.raises(InputError, match=f"^{said}: '.*' is <object object at .*>; expected "):
        function(*given, **named)

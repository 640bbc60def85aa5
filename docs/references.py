"""The tables of the reference pages, made from the package itself, so that they say what the code does.

A page asks for a table by a comment `<!-- from the code: NAME -->`; `TABLES` holds the names.
"""

from __future__ import annotations

import ast
import importlib
import inspect
import math
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from html import escape
from pathlib import Path
from types import MappingProxyType

from multimodal_to.adam import urdf
from multimodal_to.auditing import PROPERTIES, Judged, Property
from multimodal_to.files.keys import Key
from multimodal_to.files.reading import LARGEST_TOML
from multimodal_to.models.joint_units import either
from multimodal_to.models.loading import load_robot
from multimodal_to.models.robot_keys import robot_keys
from multimodal_to.models.terrain import MOST_NODES
from multimodal_to.ocp import Constraint, Cost, Formulation, Parameters
from multimodal_to.ocp import keyframes as asked
from multimodal_to.replay.meshes import LARGEST_MESH
from multimodal_to.scenarios import SCENARIOS
from multimodal_to.scenarios.keys import scenario_keys
from multimodal_to.scenarios.scenario import MOST_KNOTS
from multimodal_to.trajectory import ENTRIES, FORMATS, QUANTITIES, archive, rules

MARK = re.compile(r"<!-- from the code: ([a-z ]+) -->")
_COUNTS = {"robot": "", "joint": "joints", "contact": "contacts", "jet": "jets"}


def fill(markdown: str) -> str:
    """Return a page with its tables in it.

    Raises:
        KeyError: a page asks for a table that does not exist.
    """
    return MARK.sub(lambda found: TABLES[found[1]](), markdown)


def table(titles: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Return a Markdown table; a bar inside a cell is escaped."""
    lines = [titles, ["--"] * len(titles), *rows]
    return "\n".join("| " + " | ".join(cell.replace("|", r"\|") for cell in line) + " |" for line in lines)


# ---------------------------------------------------------------- the trajectory's file


def quantities() -> str:
    """Return the quantities of a trajectory."""
    return table(
        ("name", "shape", "unit", "axes of", "leapfrog: where in the interval", "meaning"),
        [
            (
                f"`{name}`",
                _shape(quantity.rows, _COUNTS[quantity.of]),
                either(quantity.unit) if quantity.of == "joint" else quantity.unit,
                quantity.frame or "–",
                _INSTANTS[rules.instant(rules.LEAPFROG, name)],
                quantity.meaning,
            )
            for name, quantity in QUANTITIES.items()
        ],
    )


_INSTANTS = {0.0: "end", 0.5: "middle", 1.0: "start"}


def _shape(rows: int, bodies: str) -> str:
    first = bodies if rows == 1 and bodies else f"{rows} × {bodies}" if bodies else str(rows)
    return f"({first}, N + 1)"


def entries() -> str:
    """Return what a trajectory's file holds beside the quantities."""
    return table(
        ("name", "kind", "since version", "meaning"),
        [(f"`{name}`", entry.kind, str(entry.since), entry.meaning) for name, entry in ENTRIES.items()],
    )


def formats() -> str:
    """Return the versions of a trajectory's file."""
    return table(("format version", "what it brought"), [(str(number), text) for number, text in FORMATS.items()])


def limits() -> str:
    """Return which files are read, within which limits, and by which error they are refused."""
    return table(
        ("file", "error", "what is read"),
        [
            (
                "trajectory, `.npz`",
                "`TrajectoryError`",
                f"At most {_size(archive.LARGEST_ARCHIVE)}, unpacked {_size(archive.LARGEST_CONTENT)}, and "
                f"{archive.MOST_ARRAYS} arrays. Sizes are looked up before anything is unpacked. No pickled objects. "
                f"Numbers are finite and at most {archive.LARGEST_VALUE:.0e}. Each name stands once. Shapes fit each "
                f"other and the robot. Format versions {min(FORMATS)} to {max(FORMATS)}.",
            ),
            (
                "scenario, `.toml`",
                "`ScenarioError`",
                f"At most {_size(LARGEST_TOML)}, {MOST_KNOTS} knots, and {MOST_NODES} nodes of a height field. An "
                "unknown key is an error that names the nearest one. The name has to be a plain one, because results "
                "go to a folder of that name.",
            ),
            (
                "`robot.toml`, `dress.toml`",
                "`ModelError`",
                f"At most {_size(LARGEST_TOML)}. Unknown keys are errors. The URDF is inside the folder.",
            ),
            (
                "URDF",
                "`ModelError`",
                f"At most {_size(urdf.LARGEST_URDF)}, {urdf.MOST_ELEMENTS} elements, {urdf.MOST_LINKS} links and as "
                "many joints. No document type, so no entities. One tree with one root. Numbers are XML's, finite and "
                f"at most {urdf.LARGEST_NUMBER:.0e}; only joint limits may be larger. Collision shapes, transmissions "
                "and simulators' elements are not looked at.",
            ),
            (
                "meshes",
                "none: a warning, and the mesh is not drawn",
                f"At most {_size(LARGEST_MESH)}. A path that leaves the robot's package by `..` is not followed.",
            ),
        ],
    )


def _size(count: int) -> str:
    return f"{count / 1e6:.0f} MB"


# ---------------------------------------------------------------- the audit


def properties() -> str:
    """Return what an audit judges, one table for each condition under which it does."""
    parts = []
    for condition in Judged:
        rows = [
            (f"`{entry.name}`", entry.meaning, _limit(entry), entry.reason)
            for entry in PROPERTIES.values()
            if entry.judged is condition
        ]
        head = "Always judged" if condition is Judged.ALWAYS else f"Judged where {condition.value}"
        parts.append(f"### {head}\n\n{table(('property', 'value', 'limit', 'where the limit comes from'), rows)}")
    return "\n\n".join(parts)


def _limit(entry: Property) -> str:
    unit = either(entry.unit) if entry.of_joints else entry.unit
    share = unit if entry.counted_in == entry.unit else entry.counted_in
    margin = "" if entry.margin is None else f"`margins.{entry.margin}` + "
    others = {
        "second-order cone": entry.second_order_limit,
        "rule of order one": entry.first_order_limit,
        "no such margin": entry.unasked and entry.unasked + entry.limit,
    }
    amounts = [f"{margin}{entry.limit:g}", *(f"{name} {limit:g}" for name, limit in others.items() if limit)]
    parts = [f"{amount} {share}" for amount in amounts]
    return "; ".join(part.removesuffix(" 1") for part in parts)


# ---------------------------------------------------------------- files of TOML


def keys(every: Iterable[Key]) -> str:
    """Return the keys of a file with what each takes, its unit, what holds without it, and its meaning."""
    return table(
        ("key", "type", "unit", "default", "meaning"),
        [
            (
                f"`{key.name}`",
                key.kind,
                key.unit or "–",
                key.default,
                f"{key.meaning}. Only with `{key.where}`" if key.where else key.meaning,
            )
            for key in every
        ],
    )


_OFF: Mapping[str, Callable[..., object]] = MappingProxyType(
    {
        "com": asked.off_com,
        "base_position": asked.off_base_position,
        "base_orientation": asked.off_orientation,
        "yaw": asked.off_yaw,
        "joints": asked.off_joints,
        "frames[].position": asked.off_frame,
        "frames[].orientation": asked.off_frame_orientation,
        "momentum.linear": asked.off_linear_momentum,
        "momentum.angular": asked.off_angular_momentum,
    }
)
"""What a keyframe asks to be zero, by its field."""


def keyframes() -> str:
    """Return what keyframes ask for: the formula of each residual."""
    rows = [(f"`{name}`", _first_paragraph(function.__doc__ or "")) for name, function in _OFF.items()]
    return table(("field", "what is held within the tolerance of zero, or charged"), rows)


# ---------------------------------------------------------------- the formulation


def terms() -> str:
    """Return the terms of the two formulations: constraints and costs, each with its formula."""
    formulation = Formulation.paper()
    known = {term.name for term in formulation.terms}
    more = [term for term in Formulation.executable().terms if term.name not in known]
    robot = load_robot("ironcub")
    tasks = {
        name: Parameters.of(robot, make(), robot.home) for name, make in SCENARIOS.items()
    }  # what terms ask for that the robot or the scenario says
    constraints = table(
        ("constraint", "formula", "set", "unit", "where"),
        [
            (f"`{term.name}`", _formula(term), _set(term, tasks["take-off"]), _units(term), _places(term, tasks))
            for term in (*formulation.constraints, *(term for term in more if isinstance(term, Constraint)))
        ],
    )
    names = ", ".join(f"`{term.name}`" for term in more)
    costs = table(
        ("cost", "residual", "unit", "charged", "how"),
        [
            (
                f"`{term.name}`",
                _formula(term),
                _units(term),
                _places(term, tasks),
                "per second" if term.per_second else "once",
            )
            for term in (*formulation.costs, *(term for term in more if isinstance(term, Cost)))
        ],
    )
    return (
        f"Only `Formulation.executable()` has {names}.\n\n## Constraints\n\n{constraints}\n\n## Costs\n\n"
        "A cost adds weight × |residual|² to the objective. If it is charged per second, it is multiplied by Δt. The "
        f"weight is the key of the same name in `weights` of the scenario.\n\n{costs}"
    )


def _formula(term: Constraint | Cost) -> str:
    """Return the first paragraph of what a term's function says of itself."""
    return _first_paragraph(term.formula)


def _first_paragraph(text: str) -> str:
    return " ".join(text.split("\n\n")[0].split()).removesuffix(".")


def _units(term: Constraint | Cost) -> str:
    if inspect.isfunction(term.unit):
        return _first_paragraph(term.unit.__doc__ or "")
    if isinstance(term.unit, str) or callable(term.unit):
        return str(term.unit)
    return ", ".join(dict.fromkeys(term.unit))


def _set(term: Constraint, parameters: Parameters) -> str:
    """Return the set of a constraint; a limit that the robot or the scenario says is that of the take-off."""
    lower, upper = term.within.limits(parameters)
    said = " (the scenario's)" if callable(term.within.lower) or callable(term.within.upper) else ""
    if lower == upper:
        return f"= {lower:g}{said}"
    if upper == math.inf:
        return f"≥ {lower:g}{said}"
    return f"≤ {upper:g}{said}" if lower == -math.inf else f"{lower:g} to {upper:g}{said}"


def _places(term: Constraint | Cost, tasks: Mapping[str, Parameters]) -> str:
    """Return where a term holds, and in which bundled scenarios if not in all."""
    text = ", ".join(place.value for place in term.places)
    if term.when is None:
        return text
    there = ", ".join(name for name, parameters in tasks.items() if term.exists(parameters))
    return f"{text}; in {there or 'no bundled scenario'}"


# ---------------------------------------------------------------- the rooms

_LAYERING = Path(__file__).parents[1] / "tests" / "test_layering.py"
_WIDTH, _HEIGHT, _GAP = 720, 34, 6  # of the picture, a floor, and what is between two [pixel]


def floors() -> list[list[str]]:
    """Return the rooms from the ground up, as the test of the layering holds them; files at the top are no rooms."""
    tree = ast.parse(_LAYERING.read_text(encoding="utf-8"))
    (value,) = (
        node.value
        for node in tree.body
        if isinstance(node, ast.Assign) and [target.id for target in node.targets] == ["FLOORS"]
    )
    every = [sorted(name for name in rooms if not name.startswith("__")) for rooms in ast.literal_eval(value)]
    return [rooms for rooms in every if rooms]


def rooms() -> str:
    """Return what each room holds, by the first line of its docstring, from the top of the house down."""
    return table(
        ("floor", "room", "what it holds"),
        [
            (str(level), f"`{name}`", _first_line(name))
            for level, names in reversed([*enumerate(floors(), 1)])
            for name in names
        ],
    )


def _first_line(room: str) -> str:
    return (importlib.import_module(f"multimodal_to.{room}").__doc__ or "").strip().partition("\n")[0]


def rooms_picture() -> str:
    """Return the house as SVG in the text's colour."""
    every = floors()
    parts = []
    for level, names in enumerate(every):
        y = (len(every) - 1 - level) * (_HEIGHT + _GAP) + 1
        width = (_WIDTH - _GAP * (len(names) - 1)) / len(names)
        for place, name in enumerate(names):
            x = place * (width + _GAP) + 1
            parts.append(
                f'<rect x="{x:.0f}" y="{y}" width="{width - 2:.0f}" height="{_HEIGHT}" rx="4" fill="currentColor" '
                'fill-opacity="0.08" stroke="currentColor" stroke-opacity="0.5"/>'
                f'<text x="{x + width / 2:.0f}" y="{y + 22}" text-anchor="middle" fill="currentColor" '
                f'font-size="14">{escape(name)}</text>'
            )
    height = len(every) * (_HEIGHT + _GAP)
    return (
        f'<svg viewBox="0 0 {_WIDTH + 2} {height}" role="img" aria-label="The rooms of the package, one floor a line" '
        f'style="max-width: {_WIDTH}px">{"".join(parts)}</svg>'
    )


TABLES: Mapping[str, Callable[[], str]] = MappingProxyType(
    {
        "quantities": quantities,
        "entries": entries,
        "formats": formats,
        "limits": limits,
        "properties": properties,
        "scenario keys": lambda: keys(scenario_keys()),
        "robot keys": lambda: keys(robot_keys()),
        "keyframes": keyframes,
        "terms": terms,
        "rooms": rooms,
        "rooms picture": rooms_picture,
    }
)
"""The tables by the name that a page asks for."""

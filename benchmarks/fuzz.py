"""Reads files that were broken on purpose, and counts how each ended: read, or refused by an error of the library.

    python benchmarks/fuzz.py [urdf toml npz] [--count 10000] [--seed 1] [--failures fuzz-failures]

Valid URDFs, scenarios, `robot.toml`s, `dress.toml`s and trajectory files are mutated, drawn with a seed: bytes flipped,
chunks cut, moved and doubled, words exchanged for nasty ones, and, in the structure of each format, elements and
attributes of XML, keys and values of TOML, arrays and their heads. Whatever else than an error of the library a reader
raises, more than `PATIENCE` seconds and anything executed is a failure: its input is kept, and the exit status is 1.
"""

from __future__ import annotations

import argparse
import io
import random
import re
import resource
import signal
import sys
import tempfile
import tomllib
import traceback
import warnings
import zipfile
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path
from types import FrameType
from typing import Any

import numpy as np
import tomli_w
from lxml import etree
from rich.console import Console
from rich.table import Table

import multimodal_to as mt
from multimodal_to import errors, scenario_files, scenarios
from multimodal_to.adam.inspection import describe
from multimodal_to.errors import LONGEST, MultimodalError
from multimodal_to.models.loading import bundled_robots
from multimodal_to.models.terrain import HeightField, Plane, Stairs
from multimodal_to.replay.dress import read_dress
from multimodal_to.replay.visuals import appearance
from multimodal_to.scenarios import (
    Box,
    ContactState,
    ContactStretch,
    GaitKind,
    GaitPlan,
    JetFailure,
    KnownPush,
    Limits,
    Wall,
)
from multimodal_to.scenarios.data import stored, to_json
from multimodal_to.trajectory import QUANTITIES, Trajectory
from multimodal_to.trajectory.importing import import_arrays

PATIENCE = 10.0  # [s] for one input, of which none needs one
MEMORY = 8 << 30  # address space of the process [byte], so that what is allotted without measure fails

INERTIAL = (
    '<inertial><origin xyz="0 0.1 0" rpy="0.1 0 0"/><mass value="2"/>'
    '<inertia ixx="0.02" ixy="0" ixz="0" iyy="0.02" iyz="0" izz="0.02"/></inertial>'
)
LIMIT = '<limit lower="-0.8" upper="0.8" effort="40" velocity="5"/>'
URDF = f"""<?xml version="1.0"?>
<robot name="small"><!-- a body, an arm with a jet, a follower and a foot -->
  <material name="grey"><color rgba="0.5 0.5 0.5 1"/></material>
  <link name="body">{INERTIAL}<visual><geometry><box size="0.3 0.2 0.5"/></geometry><material name="grey"/></visual>
  </link>
  <link name="arm">{INERTIAL}<visual><origin xyz="0 0 1"/><geometry><mesh filename="arm.stl" scale="1 1 1"/></geometry>
    </visual><collision><geometry><sphere radius="1"/></geometry></collision></link>
  <link name="slide">{INERTIAL}<visual><geometry><cylinder radius="0.1" length="2"/></geometry></visual></link>
  <link name="finger">{INERTIAL}</link><link name="jet"/><link name="foot"/>
  <joint name="pitch" type="revolute"><parent link="body"/><child link="arm"/><origin xyz="0 0.1 0" rpy="0 0 0.2"/>
    <axis xyz="0 1 0"/>{LIMIT}<dynamics damping="1" friction="0"/></joint>
  <joint name="lift" type="prismatic"><parent link="arm"/><child link="slide"/><axis xyz="0 0 1"/>{LIMIT}</joint>
  <joint name="curl" type="continuous"><parent link="slide"/><child link="finger"/>
    <mimic joint="pitch" multiplier="2" offset="0.1"/></joint>
  <joint name="jet_mount" type="fixed"><parent link="arm"/><child link="jet"/><origin rpy="3.14 0 0"/></joint>
  <joint name="foot_mount" type="fixed"><parent link="body"/><child link="foot"/><origin xyz="0 0 -0.4"/></joint>
  <transmission name="t"><type>simple</type><joint name="pitch"/></transmission>
</robot>"""
ROBOT = """
name = "small"
urdf = "small.urdf"
[joints]
lift = { lower = -0.8, upper = 0.8, speed = 3.0, home = 0.0 }
curl2 = { lower = -0.8, upper = 0.8, speed = 3.0, home = 0.1 }
[joint_groups]
arm = ["lift", "curl2"]
[home]
base_position = [0.0, 0.0, 0.4]
base_quaternion_xyzw = [0.0, 0.0, 0.0, 1.0]
[contact]
friction = 0.5
[contact.feet]
only = ["foot"]
[jet_models.P]
K_T = 0.0
K_TT = 0.0
K_D = -2.0
K_DD = 0.0
K_TD = 0.0
B_U = 1.0
B_T = 0.0
B_D = 0.0
B_UU = 0.0
c = 0.0
[[jet]]
name = "only"
frame = "jet"
model = "P"
thrust_max = 100.0
throttle = [0.0, 100.0]
"""
NASTY = (
    "",
    " ",
    "nan",
    "inf",
    "-inf",
    "1e400",
    "1e308",
    "-1e-320",
    "0",
    "-1",
    "true",
    "9" * 5000,
    "0x" + "f" * 9000,
    "../../../etc/passwd",
    "/dev/zero",
    "file:///etc/passwd",
    "package://x/../../y",
    "a" * 5000,
    "\ud800",
    "\0",
    "&x;",
    "&#0;",
    "%00",
    "é",
    "1 2",
    "1,2,3",
    "[" * 3000,
    "{" * 3000,
    "a." * 3000 + "a",
    "'" * 3,
    '"',
    "=",
    "\x1b[2J",
    "\r\n",
    "[/b]",
    "1979-05-27T07:32:00Z",
    "[[a]]",
    "<",
    "]]>",
    "<!DOCTYPE a>",
    "joint",
    "link",
    "robot",
)


class Hang(BaseException):
    """A reader took too long; not an `Exception`, so that no reader takes it for its own."""


class Trap:
    """Something that makes a folder when it is unpickled."""

    marker = ""

    def __reduce__(self) -> tuple[Callable[..., Any], tuple[Any, ...]]:
        """Return what a pickle would call."""
        return Path.mkdir, (Path(self.marker),)


@dataclass(kw_only=True)
class Result:
    """How the inputs of one kind ended."""

    endings: Counter[str] = field(default_factory=Counter)
    failures: list[tuple[bytes, str]] = field(default_factory=list)


# ---------------------------------------------------------------- bytes and words


def mutated_bytes(data: bytes, rng: random.Random) -> bytes:
    """Return data with bytes flipped, or a chunk cut, doubled, moved or overwritten."""
    content = bytearray(data)
    for _ in range(rng.choice((1, 1, 2, 5))):
        start = rng.randrange(len(content) + 1)
        end = min(len(content), start + rng.choice((1, 2, 8, 64, 1000)))
        chunk = content[start:end]
        match rng.randrange(6):
            case 0 if chunk:
                content[start] ^= 1 << rng.randrange(8)
            case 1:
                del content[start:end]
            case 2:
                content[start:start] = chunk * rng.choice((1, 2, 50))
            case 3:
                del content[start:end]
                place = rng.randrange(len(content) + 1)
                content[place:place] = chunk
            case 4:
                content[start:end] = rng.randbytes(len(chunk))
            case _:
                del content[start:]
        if not content:
            break
    return bytes(content)


def mutated_words(data: bytes, rng: random.Random) -> bytes:
    """Return a text with words exchanged for each other or for nasty ones."""
    parts = re.split(r"(\w+(?:[.-]\w+)*)", data.decode("utf-8", errors="replace"))
    words = range(1, len(parts), 2)
    for _ in range(rng.choice((1, 1, 2, 5))):
        here, there = rng.choice(words), rng.choice(words)
        if rng.random() < 0.5:
            parts[here], parts[there] = parts[there], parts[here]
        else:
            parts[here] = rng.choice(NASTY)
    return "".join(parts).encode("utf-8", errors="surrogatepass")


# ---------------------------------------------------------------- structures


def mutated_xml(data: bytes, rng: random.Random) -> bytes:
    """Return XML with elements removed, doubled, moved, nested or renamed, or attributes changed."""
    root = etree.fromstring(data)
    for _ in range(rng.choice((1, 1, 2, 5))):
        elements = [element for element in root.iter() if isinstance(element.tag, str)]
        element, other = rng.choice(elements), rng.choice(elements)
        action = rng.randrange(7)
        if action == 0 and element is not root:
            element.getparent().remove(element)
        elif action == 1 and element is not root:
            element.addnext(etree.fromstring(etree.tostring(element, with_tail=False)))
        elif action == 2 and element is not other and other not in element.iterancestors() and other is not root:
            if element not in other.iterancestors():
                element.append(other)
        elif action == 3:
            element.tag = rng.choice((other.tag, "x", "{urn:x}link"))
        elif action == 4 and element.attrib:
            del element.attrib[rng.choice(list(element.attrib))]
        elif element.attrib:
            values = [value for each in elements for value in each.attrib.values()]
            value = rng.choice((rng.choice(values), rng.choice(NASTY)))
            try:
                element.set(rng.choice(list(element.attrib)), value)
            except ValueError:  # no text that XML can hold
                continue
    return etree.tostring(root)


def mutated_toml(data: bytes, rng: random.Random) -> bytes:
    """Return TOML with keys removed, renamed or moved, or values exchanged for those of other kinds."""
    root = tomllib.loads(data.decode("utf-8"))
    for _ in range(rng.choice((1, 1, 2, 5))):
        places = list(_places(root))
        if not places:
            break
        (owner, key), (other, second) = rng.choice(places), rng.choice(places)
        action = rng.randrange(5)
        if action == 0:
            del owner[key]
        elif action == 1:
            owner[key] = other[second] if not isinstance(other[second], dict | list) else 0
        elif action == 2 and isinstance(owner, dict):
            owner[rng.choice((f"{key}x", "kind", "", rng.choice(NASTY[:20])[:40]))] = owner.pop(key)
        else:
            owner[key] = rng.choice(
                (
                    float("nan"),
                    float("inf"),
                    -1.0,
                    0,
                    1e308,
                    5e-324,
                    10**400,
                    1 << 40000,
                    True,
                    "",
                    "x",
                    [],
                    {},
                    [[]],
                    [0.0] * 3,
                    {"kind": "stairs"},
                    "plane",
                    "height-field",
                    ["a", "a"],
                    rng.choice(NASTY),
                    [{"a": [{}]}],
                )
            )
    try:
        return tomli_w.dumps(root).encode("utf-8", errors="surrogatepass")
    except ValueError:  # more digits than Python writes
        return data


def _places(value: Any) -> Any:
    """Yield every table and list within a value, with each key or index."""
    for key, entry in value.items() if isinstance(value, dict) else enumerate(value):
        yield value, key
        if isinstance(entry, dict | list):
            yield from _places(entry)


def mutated_arrays(data: bytes, rng: random.Random) -> bytes:
    """Return an archive with arrays removed, renamed, exchanged, reshaped, of other kinds or with odd values."""
    with np.load(io.BytesIO(data)) as archive:
        arrays = dict(archive)
    for _ in range(rng.choice((1, 1, 2, 5))):
        name, other = rng.choice(list(arrays)), rng.choice(list(arrays))
        array, action = arrays[name], rng.randrange(8)
        if action == 0 and len(arrays) > 1:
            del arrays[name]
        elif action == 1:
            arrays[name] = arrays[other]
        elif action == 2:
            arrays[name] = rng.choice((array.T, array.ravel(), array[None], np.atleast_1d(array)[..., :-1]))
        elif action == 3:
            arrays[name] = (
                array.astype(rng.choice(("U3", "S3", "V8", "c16", "f2", "?", "M8[s]", "i1", "g")))
                if array.dtype.kind == "f"
                else np.zeros(3)
            )
        elif action == 4 and array.dtype.kind == "f" and array.size:
            array = array.copy()
            array.flat[rng.randrange(array.size)] = rng.choice((np.nan, np.inf, 1e308, -1e308, 5e-324, 1e20))
            arrays[name] = array
        elif action == 5:
            arrays[name] = np.array([Trap()] * rng.randrange(1, 3), dtype=object)
        elif action == 6:
            arrays[name] = np.array(rng.choice((*NASTY[:30], "[" * 30000, "1", "{}", "[1]", "null", '{"name": 1}')))
        else:
            arrays[name] = np.zeros(rng.choice(((0,), (0, 3), (), (1, 1, 1, 1), (7, 10**5))))
    return packed({f"{name}.npy": _npy(array) for name, array in arrays.items()}, rng)


def mutated_members(data: bytes, rng: random.Random) -> bytes:
    """Return an archive whose check sums hold, with bytes of its arrays or of their heads changed."""
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        members = {name: archive.read(name) for name in archive.namelist()}
    for name in rng.sample(list(members), rng.choice((1, 1, 2, len(members)))):
        head, action = members[name], rng.randrange(4)
        if action == 0:
            head = mutated_bytes(head, rng)
        elif action == 1:
            head = head[:10] + mutated_words(head[10:128], rng)[:118].ljust(118) + head[128:]
        elif action == 2:
            shape = rng.choice((b"(99999999999,)", b"(-1, 4)", b"(" * 100, b"(1" + b",1" * 40 + b")", b"-" * 60, b"()"))
            head = re.sub(rb"\([0-9, ]*\)", lambda _, shape=shape: shape, head, count=1)
        else:
            kind = rng.choice((b"|O", b"<U4", b">f8", b"<f4", b"|V8", b"<c16", b"<m8", b"|S8", b"<U1073741824"))
            head = re.sub(rb"'[<|>][A-Za-z]\d*'", lambda _, kind=kind: b"'" + kind + b"'", head, count=1)
        members[name] = head
    return packed(members, rng)


def packed(members: dict[str, bytes], rng: random.Random) -> bytes:
    """Return an archive of files, stored or packed."""
    stream = io.BytesIO()
    way = rng.choices((zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED, zipfile.ZIP_BZIP2), (8, 8, 1))[0]
    with warnings.catch_warnings(action="ignore"), zipfile.ZipFile(stream, "w", way) as archive:
        for name, content in members.items():
            archive.writestr(rng.choice(NASTY[13:18]) if rng.random() < 0.01 else name, content)
    return stream.getvalue()


def _npy(array: np.ndarray) -> bytes:
    stream = io.BytesIO()
    np.lib.format.write_array(stream, np.asarray(array), allow_pickle=True)
    return stream.getvalue()


# ---------------------------------------------------------------- readers

SMALL = URDF.replace('<mimic joint="pitch" multiplier="2" offset="0.1"/>', "").replace('"curl"', '"curl2"')
Mutation = Callable[[bytes, random.Random], bytes]
Reader = Callable[[Path], object]


def read_urdf(path: Path) -> None:
    """Read a URDF, describe it, and look at what it would be drawn with."""
    str(describe(path))
    appearance(path)


def read_robot(path: Path) -> None:
    """Read a `robot.toml` beside the URDF that it is for."""
    (path.parent / "small.urdf").write_text(SMALL, encoding="utf-8")
    mt.load_robot(path.parent)


def read_scenario(path: Path) -> None:
    """Read a scenario, and what is written of it again."""
    scenario = scenario_files.load(path)
    assert scenario_files.load(scenario_files.save(scenario, path.with_name("again.toml"))) == scenario


def read_trajectory(path: Path) -> None:
    """Read a trajectory with its scenario, and what is written of it again."""
    trajectory = Trajectory.load(path)
    stored(trajectory)
    again = Trajectory.load(trajectory.save(path.with_name("again.npz")))
    assert all(np.array_equal(getattr(again, name), getattr(trajectory, name)) for name in QUANTITIES)


def trajectory_file(robot: mt.Robot, folder: Path) -> bytes:
    """Return a valid trajectory file of a robot, in which nothing moves."""
    bodies = {"robot": 1, "joint": len(robot.joint_names), "contact": len(robot.contacts), "jet": len(robot.jets)}
    arrays = {name: np.ones((quantity.rows * bodies[quantity.of], 4)) for name, quantity in QUANTITIES.items()}
    trajectory = Trajectory(
        robot=robot.name,
        scenario="take-off",
        time=np.arange(4.0),
        joint_names=robot.joint_names,
        contact_names=robot.contact_names,
        jet_names=robot.jet_names,
        scenario_json=to_json(scenarios.take_off()),
        **arrays,
    )
    return trajectory.save(folder / "valid.npz").read_bytes()


KEYFRAMES = """
based_on = "take-off"
replace = ["weights.joint_velocities", "margins"]
robot = "ironcub"
initial_com = "home"
final_com_shift = [0.0, 0.0, 0.13]
[[keyframes]]
when = 0.25
com = {z = 0.6}
com_min = {x = -0.1}
com_max = {x = 0.1}
base_position.y = 0.0
yaw = 0.1
orientation_tolerance = 0.05
joints.l_knee = -0.3
joint_tolerance = 0.1
frames.l_sole_1 = {position = [0.0, -0.1, 0.2], position_tolerance = 0.3, orientation = [0, 0, 0, 1]}
momentum = {linear = [0, 0, 0], angular.z = 0.0}
[[keyframes]]
knot = 60
com = "home"
com_shift = [0.0, 0.0, 0.1]
hover = true
[[keyframes]]
when = "end"
base_orientation = [0.0, 0.0, 0.0, 1.0]
weight = 2.0
"""

Source = tuple[str, bytes, tuple[Mutation, ...], Reader, float]
"""A file's name, valid content, what changes it, what reads it, and its share of the inputs."""


def sources(kind: str, folder: Path) -> list[Source]:
    """Return what is mutated of one kind."""
    ironcub = bundled_robots()["ironcub"]
    if kind == "urdf":
        changes: tuple[Mutation, ...] = (mutated_bytes, mutated_words, mutated_xml, mutated_xml)
        return [
            ("small.urdf", URDF.encode(), changes, read_urdf, 0.99),
            ("ironcub.urdf", (ironcub / "ironcub.urdf").read_bytes(), changes, read_urdf, 0.01),
        ]
    if kind == "toml":
        changes = (mutated_bytes, mutated_words, mutated_toml, mutated_toml)
        field_ = HeightField.sampled(lambda x, y: x * y, x_range=(-1.0, 1.0), y_range=(-1.0, 1.0), spacing=0.6)
        tasks = [make() for make in scenarios.SCENARIOS.values()] + [
            replace(scenarios.take_off(), surface=surface)
            for surface in (field_, Plane(slope=0.1), Stairs(edges=(0.1,), heights=(0.0, 0.1)))
        ]
        tasks.append(
            replace(
                scenarios.take_off(),
                contacts=(ContactStretch(of=("left", "right"), state=ContactState.OFF, begin=0.8, clearance=0.01),),
                gait=GaitPlan(kind=GaitKind.WALK, steps=4, first="left", clearance=0.02),
                failures=(JetFailure(jet="left arm", at=0.5),),
                pushes=(KnownPush(of="chest", force=(10.0, 0.0, 0.0), begin=0.4, end=0.5),),
                walls=(Wall(normal=(0.0, 0.0, -1.0), offset=-1.5, of=("head",)),),
                boxes=(Box(lower=(0.0, 0.0, 0.0), upper=(1.0, 1.0, 1.0), begin=0.5),),
                limits=(Limits(base_speed=0.5, joint_speeds={"legs": 1.0}, thrusts={"left arm": 90.0}, end=0.8),),
            )
        )
        short = b'based_on = "take-off"\nfinal_com_height = 0.8\nweights.thrust = 3\nsurface = "flat"\n'
        texts = [scenario_files.to_toml(task).encode() for task in tasks] + [short, KEYFRAMES.encode()]
        return [
            *(("task.toml", text, changes, read_scenario, 0.6 / len(texts)) for text in texts),
            ("robot.toml", ROBOT.encode(), changes, read_robot, 0.3),
            ("dress.toml", (ironcub / "dress.toml").read_bytes(), changes, lambda path: read_dress(path.parent), 0.1),
        ]
    (folder / "small.urdf").write_text(SMALL, encoding="utf-8")
    (folder / "robot.toml").write_text(ROBOT, encoding="utf-8")
    robot = mt.load_robot(folder)
    content = trajectory_file(robot, folder)
    changes = (mutated_bytes, mutated_arrays, mutated_arrays, mutated_members)
    return [
        ("motion.npz", content, changes, read_trajectory, 0.8),
        ("arrays.npz", content, changes, lambda path: import_arrays(robot, path), 0.2),
    ]


KINDS = ("urdf", "toml", "npz")


def run(kind: str, count: int, seed: int, folder: Path) -> Result:
    """Read so many mutated inputs of one kind, in a folder that is there for nothing else."""
    result, rng = Result(), random.Random(f"{kind} {seed}")
    Trap.marker = str(folder / "executed")
    pool = sources(kind, folder)
    shares = [share for *_, share in pool]
    for name, content, _, reader, _ in pool:
        if (ending := outcome(reader, folder / name, content)) != ("read", ""):
            raise RuntimeError(f"{name} is not read before it is changed: {ending}")
    for _ in range(count):
        name, content, changes, reader, _ = rng.choices(pool, shares)[0]
        data = rng.choice(changes)(content, rng)
        ending, fault = outcome(reader, folder / name, data)
        result.endings[ending] += 1
        if fault:
            result.failures.append((data, fault))
    return result


def outcome(reader: Reader, path: Path, data: bytes) -> tuple[str, str]:
    """Return how an input ended, and what was wrong about that."""
    path.write_bytes(data)
    signal.signal(signal.SIGALRM, _hang)
    signal.setitimer(signal.ITIMER_REAL, PATIENCE)
    try:
        with warnings.catch_warnings(action="ignore"):
            reader(path)
        ending, fault = "read", ""
    except MultimodalError as error:
        ending, text = type(error).__name__, str(error)
        fault = "" if text.isprintable() and 10 < len(text) < 2 * LONGEST else f"no sentence: {text!r}"
    except (Exception, Hang) as error:
        ending, fault = type(error).__name__, traceback.format_exc()
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
    if Path(Trap.marker).exists():
        Path(Trap.marker).rmdir()
        return "executed", "what the file holds was executed"
    return ending, fault


def _hang(_: int, __: FrameType | None) -> None:
    raise Hang


def main() -> None:
    """Fuzz, tabulate, and keep what failed."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("kinds", nargs="*", help=f"of {', '.join(KINDS)}; without, all")
    parser.add_argument("--count", type=int, default=10_000, help="inputs of each kind")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--failures", type=Path, default=Path("fuzz-failures"))
    options = parser.parse_args()
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
    console, failed = Console(highlight=False, markup=False), 0
    table = Table("kind", "inputs", "read", "refused", "by", "failures")
    for kind in options.kinds or KINDS:
        with tempfile.TemporaryDirectory() as folder:
            result = run(kind, options.count, options.seed, Path(folder))
        refusals = {
            name: count for name, count in result.endings.items() if name.endswith("Error") and hasattr(errors, name)
        }
        for index, (data, fault) in enumerate(result.failures):
            options.failures.mkdir(parents=True, exist_ok=True)
            (options.failures / f"{index}.{kind}").write_bytes(data)
            (options.failures / f"{index}.{kind}.txt").write_text(fault, encoding="utf-8")
            console.print(f"{kind} {index}: {fault.strip().splitlines()[-1][:200]}")
        failed += len(result.failures)
        by = ", ".join(f"{name} {count}" for name, count in sorted(refusals.items()))
        table.add_row(
            kind,
            str(options.count),
            str(result.endings["read"]),
            str(sum(refusals.values())),
            by,
            str(len(result.failures)),
        )
    console.print(table)
    sys.exit(1 if failed else 0)


if __name__ == "__main__":
    main()

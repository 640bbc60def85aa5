"""What the command line makes of broken input: one sentence, the right class of error, soon, and nothing written."""

from __future__ import annotations

import io
import os
import shutil
import subprocess
import sys
import time
import warnings
import zipfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from multimodal_to.cli import main
from multimodal_to.errors import InputError, ModelError, OutputError, ScenarioError, TrajectoryError
from multimodal_to.models.loading import bundled_robots
from synthetic import take_off as synthetic_take_off

PATIENCE = 5.0  # [s]

INERTIAL = '<inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>'
LINKS = "".join(f'<link name="{name}">{INERTIAL}</link>' for name in "abc")
ENTITIES = "".join(f'<!ENTITY e{i} "{f"&e{i - 1};" * 10}">' for i in range(1, 12))


def fixed(parent: str, child: str) -> str:
    return f'<joint name="{parent}{child}" type="fixed"><parent link="{parent}"/><child link="{child}"/></joint>'


@dataclass(frozen=True, kw_only=True)
class Broken:
    """An input: the command that meets it, what it has to say, and how the input comes to be in a folder."""

    command: str
    error: type[Exception] | None  # None: the parser of options refuses it, or the doctor
    says: tuple[str, ...]
    make: Callable[[Path, Path], object] = lambda folder, good: None


def text(content: str) -> Callable[[Path, Path], object]:
    return lambda folder, good: (folder / "in").write_text(content, encoding="utf-8")


def toml(content: str, *says: str, error: type[Exception] | None = ScenarioError) -> Broken:
    """A scenario that is the take-off but for its content."""
    return Broken(
        command="solve in.toml --output out/new",
        error=error,
        says=says,
        make=lambda folder, good: (folder / "in.toml").write_text(content, encoding="utf-8"),
    )


def urdf(content: str, *says: str) -> Broken:
    return Broken(command="robot info in", error=ModelError, says=says, make=text(content))


def robot(old: str, new: str, *says: str) -> Broken:
    """The iRonCub's folder with a change to its `robot.toml`."""

    def make(folder: Path, good: Path) -> None:
        shutil.copytree(bundled_robots()["ironcub"], folder / "mine")
        path = folder / "mine" / "robot.toml"
        content = path.read_text(encoding="utf-8")
        assert old in content
        path.write_text(content.replace(old, new, 1), encoding="utf-8")

    return Broken(command="solve take-off --robot mine --output out/new", error=ModelError, says=says, make=make)


def arrays(*says: str, command: str = "audit in.npz", **changes: object) -> Broken:
    """A good trajectory with some arrays changed; None takes one away."""

    def make(folder: Path, good: Path) -> None:
        with np.load(good) as archive:
            content = {**archive, **changes}
        np.savez(folder / "in.npz", **{name: array for name, array in content.items() if array is not None})

    return Broken(command=command, error=TrajectoryError, says=says, make=make)


def flipped(good: bytes) -> bytes:
    """The file with one bit of an array's numbers changed."""
    with zipfile.ZipFile(io.BytesIO(good)) as members:
        header = members.getinfo("thrust.npy").header_offset
    lengths = (
        int.from_bytes(good[header + 26 : header + 28], "little"),
        int.from_bytes(good[header + 28 : header + 30], "little"),
    )
    at = header + 30 + sum(lengths) + 60  # behind the names of the local header
    return good[:at] + bytes([good[at] ^ 1]) + good[at + 1 :]


def archive(change: Callable[[bytes], bytes], *says: str) -> Broken:
    return Broken(
        command="replay in.npz --html out/new/page.html",
        error=TrajectoryError,
        says=says,
        make=lambda folder, good: (folder / "in.npz").write_bytes(change(good.read_bytes())),
    )


def option(command: str, error: type[Exception] | None, *says: str) -> Broken:
    return Broken(
        command=command, error=error, says=says, make=lambda folder, good: shutil.copy(good, folder / "good.npz")
    )


class Trap:
    """Something that makes a folder when it is unpickled."""

    def __reduce__(self):
        return os.mkdir, ("executed",)


def bomb(folder: Path, good: Path) -> None:
    with (
        zipfile.ZipFile(folder / "in.npz", "w", zipfile.ZIP_DEFLATED, compresslevel=1) as zipped,
        zipped.open("thrust.npy", "w", force_zip64=True) as stream,
    ):
        for _ in range(300):
            stream.write(bytes(1_000_000))


def fifo(folder: Path, good: Path) -> None:
    os.mkfifo(folder / "in.toml")


BROKEN = {
    # scenarios
    "no file": Broken(command="solve none.toml", error=ScenarioError, says=("none.toml", "No such file")),
    "a pipe that never ends": Broken(
        command="solve in.toml", error=ScenarioError, says=("no regular file",), make=fifo
    ),
    "half a table": toml("based_on = 'take-off'\n[weights", "in.toml", "not valid TOML", "Expected ']'"),
    "text of another time": Broken(
        command="solve in.toml",
        error=ScenarioError,
        says=("not valid TOML", "utf-8"),
        make=lambda folder, good: (folder / "in.toml").write_bytes(b"title = '\xff\xfe'"),
    ),
    "an unknown key": toml(
        "based_on = 'take-off'\nfinal_con = [0, 0, 1]", "unknown key 'final_con'", "did you mean 'final_com'?"
    ),
    "an unknown weight": toml(
        "based_on = 'take-off'\nweights.trust = 1", "unknown key 'weights.trust'", "did you mean 'weights.thrust'?"
    ),
    "an unknown joint group": toml(
        "based_on = 'take-off'\nweights.joint_velocities.leg = 1",
        "unknown joint group 'leg'",
        "did you mean 'legs'?",
        error=None,
    ),
    "a text for a number": toml("based_on = 'take-off'\nknots = 'many'", "'knots' is 'many'", "a whole number"),
    "a NaN": toml("based_on = 'take-off'\nfinal_com = [0, 0, nan]", "'final_com[2]' is nan", "a finite number"),
    "a number beyond floats": toml(f"based_on = 'take-off'\nfriction = {10**400}", "'friction'", "a finite number"),
    "a number of too many digits": toml(f"based_on = 'take-off'\nknots = {'9' * 5000}", "not valid TOML", "digits"),
    "knots without end": toml(f"based_on = 'take-off'\nknots = {10**12}", "knots is 1000000000000", "3 to 10000"),
    "an unknown base": toml("based_on = 'takeoff'", "unknown scenario 'takeoff'", "did you mean 'take-off'?"),
    "a name that leads elsewhere": toml("based_on = 'take-off'\nname = '../../home'", "name is '../../home'"),
    "a title that clears the screen": toml("based_on = 'take-off'\ntitle = \"\\u001b[2J\"", "control characters"),
    "an abyss of lists": toml(f"a = {'[' * 100_000}", "nested too deep"),
    "a key of a thousand parts": toml(f"{'a.' * 1000}a = 1", "a key has more than 32 parts"),
    "a TOML of 2 MB": toml("#" * 2_000_000, "larger than 1 MB"),
    "an unknown ground": toml("based_on = 'take-off'\nsurface = 'slope'", "'surface.kind' is 'slope'", "plane"),
    "a ragged field": toml(
        "based_on = 'take-off'\n[surface]\nkind = 'height-field'\nx_range = [0, 1]\ny_range = [0, 1]\n"
        "heights = [[0, 0, 0, 0], [0]]",
        "'surface'",
        "rows of one length",
    ),
    "a keyframe of no time": toml("based_on = 'take-off'\n[[keyframes]]\nyaw = 1", "keyframes[0]", "'when' or 'knot'"),
    "an unknown part of a keyframe": toml(
        "based_on = 'take-off'\n[[keyframes]]\nknot = 3\nyaww = 1", "'keyframes[0].yaww'; did you mean"
    ),
    "a keyframe of two positions": toml(
        "based_on = 'take-off'\n[[keyframes]]\nknot = 3\ncom = [0, 0]", "keyframes[0].com", "a list of 3"
    ),
    "a joint that no robot has": toml(
        "based_on = 'take-off'\n[[keyframes]]\nknot = 3\njoints.tail = 1", "unknown joint 'tail'", error=None
    ),
    "a robot that is not there": toml("based_on = 'take-off'\nrobot = 'nobody'", "unknown robot", error=ModelError),
    "a replacement of nothing": toml("replace = ['weights']", "expected 'based_on' beside it"),
    "a state that is not there": toml(
        "based_on = 'take-off'\nstart = 'given'\ninitial_state = 'nowhere.npz'", "nowhere.npz", error=None
    ),
    "contacts without a state": toml(
        "based_on = 'take-off'\n[[contacts]]\nof = 'left'", "the scenario lacks 'contacts[0].state'"
    ),
    "contacts of an unknown state": toml(
        "based_on = 'take-off'\n[[contacts]]\nof = 'left'\nstate = 'up'", "'contacts[0].state' is 'up'", "on, off, free"
    ),
    "contacts of a foot that is not there": toml(
        "based_on = 'take-off'\n[[contacts]]\nof = 'tail'\nstate = 'on'",
        "unknown foot or contact point 'tail'",
        error=None,
    ),
    "contacts that run backwards": toml(
        "based_on = 'take-off'\n[[contacts]]\nof = 'left'\nstate = 'on'\nbegin = 0.6\nend = 0.2",
        "expected a begin before the end",
    ),
    "an unknown gait": toml("based_on = 'take-off'\ngait = {kind = 'canter', steps = 2}", "'gait.kind' is 'canter'"),
    "a gait without steps": toml(
        "based_on = 'take-off'\ngait = {kind = 'walk', steps = 0}", "steps is 0", "at least one"
    ),
    "a jet that cannot fail": toml(
        "based_on = 'take-off'\n[[failures]]\njet = 'tail'", "unknown jet 'tail'", error=None
    ),
    "a jet that fails after the end": toml(
        "based_on = 'take-off'\n[[failures]]\njet = 'left arm'\nat = 1.5", "at is 1.5", "a share from 0 to 1"
    ),
    "a push of two numbers": toml(
        "based_on = 'take-off'\n[[pushes]]\nof = 'chest'\nforce = [1, 2]", "'pushes[0].force'", "a list of 3"
    ),
    "a push on a frame that is not there": toml(
        "based_on = 'take-off'\n[[pushes]]\nof = 'tail'\nforce = [1, 2, 3]", "'tail'", error=None
    ),
    "a wall without a direction": toml(
        "based_on = 'take-off'\n[[walls]]\nnormal = [0, 0, 0]\noffset = 1", "a direction with a length"
    ),
    "a box inside out": toml(
        "based_on = 'take-off'\n[[boxes]]\nlower = [1, 1, 1]\nupper = [0, 0, 0]", "finite numbers that rise"
    ),
    "limits of nothing": toml(
        "based_on = 'take-off'\n[[limits]]\nend = 0.5", "nothing is limited; expected base_speed"
    ),
    "a limit below zero": toml(
        "based_on = 'take-off'\n[[limits]]\nthrusts.\"left arm\" = -1", "thrusts.left arm is -1", "at least zero"
    ),
    "a limit of a joint that is not there": toml(
        "based_on = 'take-off'\n[[limits]]\njoint_speeds.tail = 1", "unknown joint or joint group 'tail'", error=None
    ),
    "a limit of a jet that is not there": toml(
        "based_on = 'take-off'\n[[limits]]\nthrusts.tail = 1", "unknown jet 'tail'", error=None
    ),
    "limits that run backwards": toml(
        "based_on = 'take-off'\n[[limits]]\nbase_speed = 1\nbegin = 0.6\nend = 0.2", "expected a begin before the end"
    ),
    "half a scenario": toml("title = 'half'", "the scenario lacks", "'knots'"),
    # robots
    "a URDF elsewhere": robot('"ironcub.urdf"', '"../../ironcub.urdf"', "'urdf' is", "outside the robot's folder"),
    "a robot's unknown key": robot(
        "friction = 0.33", "friction = 0.33\nfriktion = 1", "did you mean 'contact.friction'?"
    ),
    "a joint that is not there": robot("torso_pitch ", "torso_pich ", "unknown joint 'torso_pich'", "'torso_pitch'"),
    "a robot's number beyond floats": robot(
        "friction = 0.33", f"friction = {10**400}", "'contact.friction'", "finite number"
    ),
    "an unknown robot": Broken(
        command="solve take-off --robot ironcup --output out/new", error=ModelError, says=("did you mean 'ironcub'?",)
    ),
    "a robot of no name": Broken(
        command=f"solve take-off --robot {'x' * 5000} -o out/new", error=ModelError, says=("unknown robot 'xxx",)
    ),
    "a folder without a robot": Broken(
        command="solve take-off --robot . --output out/new", error=ModelError, says=("robot.toml", "No such file")
    ),
    # URDFs
    "a web page": urdf("<html><body>404</body></html>", "root element is <html>", "expected <robot>"),
    "half a URDF": urdf(f"<robot name='r'>{LINKS}", "not valid XML"),
    "an entity bomb": urdf(
        f'<!DOCTYPE r [<!ENTITY e0 "x">{ENTITIES}]><robot name="r"><link name="a">&e11;</link></robot>',
        "document type",
        "write out",
    ),
    "a file of someone else": urdf(
        '<!DOCTYPE r [<!ENTITY x SYSTEM "file:///etc/passwd">]><robot name="r"><link name="&x;"/></robot>',
        "document type",
        "write out",
    ),
    "a million links": urdf(f"<robot name='r'>{'<link/>' * 1_000_000}</robot>", "at most 50000 are read"),
    "two thousand links": urdf(f"<robot name='r'>{'<link/>' * 2_000}</robot>", "2000 links", "at most 1000"),
    "a URDF of 11 MB": urdf(f"<robot name='r'>{' ' * 11_000_000}</robot>", "larger than 10 MB"),
    "an abyss of links": urdf("<robot name='r'>" + "<link name='a'>" * 10_000, "not valid XML"),
    "a loop": urdf(f"<robot name='r'>{LINKS}{fixed('b', 'c')}{fixed('c', 'b')}</robot>", "loop", "b, c"),
    "several roots": urdf(f"<robot name='r'>{LINKS}{fixed('a', 'b')}</robot>", "the roots a, c", "expected one root"),
    "two links of one name": urdf(f"<robot name='r'>{LINKS}{LINKS}</robot>", "more than one link named a, b, c"),
    "a mass that is none": urdf(
        "<robot name='r'>" + LINKS.replace('value="1"', 'value="nan"') + "</robot>", 'value="nan"', "finite number"
    ),
    "an inertia of a star": urdf(
        "<robot name='r'>" + LINKS.replace('ixx="1"', 'ixx="1e30"') + "</robot>", 'ixx="1e30"', "larger than 1e+09"
    ),
    # trajectory files
    "no trajectory": Broken(command="audit none.npz", error=TrajectoryError, says=("no trajectory file 'none.npz'",)),
    "a text": archive(lambda good: b"hello", "it is no .npz archive"),
    "half a file": archive(lambda good: good[: len(good) // 2], "is not a trajectory file"),
    "a flipped byte": archive(flipped, "is not a trajectory"),
    "a zip bomb": Broken(command="audit in.npz", error=TrajectoryError, says=("unpacks to 300 MB",), make=bomb),
    "a pickle": arrays("'thrust.npy' holds pickled objects", thrust=np.array([Trap()], dtype=object)),
    "a quantity too few": arrays("lacks throttle", throttle=None),
    "a wrong shape": arrays("'thrust' has shape (3, 3)", "expected (4, 21)", thrust=np.zeros((3, 3))),
    "words for numbers": arrays("'thrust' is not numeric", thrust=np.full((4, 21), "x")),
    "a NaN in the thrust": arrays("'thrust' holds values that are not finite", thrust=np.full((4, 21), np.nan)),
    "an infinite thrust": arrays("'thrust' holds values larger than 1e+15", thrust=np.full((4, 21), np.inf)),
    "no rotation": arrays("a quaternion next to zero", base_quaternion_xyzw=np.zeros((4, 21))),
    "a time that stands": arrays("increase from knot to knot", time=np.zeros(21)),
    "a file of a later release": arrays("format version 99", "this release reads 1 to", format_version=np.array(99)),
    "a robot by its path": arrays("names its robot as the path '/tmp/evil'", "--robot", robot=np.array("/tmp/evil")),
    "a robot above": arrays("names its robot as the path '..'", robot=np.array("..")),
    "another robot's joints": arrays(
        "is for another robot", "those of ironcub are torso_pitch", joint_names=np.array([f"j{i}" for i in range(23)])
    ),
    "one joint twice": arrays("expected each name once", joint_names=np.array(["j"] * 23)),
    "an abyss in the scenario": Broken(
        command="audit in.npz",
        error=ScenarioError,
        says=("the scenario kept with", "cannot be read"),
        make=arrays(scenario_json=np.array("[" * 100_000)).make,
    ),
    # options
    "an unknown option": option("audit good.npz --josn", None, "No such option: --josn", "--json"),
    "an unknown command": option("adit good.npz", None, "No such command 'adit'"),
    "a word for a number": option("solve take-off --max-iterations many", None, "'--max-iterations'", "whole number"),
    "no iterations": option("solve take-off --max-iterations 0 -o out/new", InputError, "max_iterations is 0"),
    "a change without a value": option("solve take-off --set knots -o out/new", ScenarioError, "expected key=value"),
    "a change of nothing": option("solve take-off --set knotz=9", ScenarioError, "did you mean 'knots'?"),
    "an unknown scenario": option("solve takeoff -o out/new", ScenarioError, "did you mean 'take-off'?"),
    "an unknown figure": option("plot good.npz --figure forcs", InputError, "did you mean 'forces'?"),
    "a picture of no kind": option("plot good.npz --output out/a.bmp", OutputError, "'out/a.bmp' is no .png"),
    "an unknown export": option("export good.npz --to cvs", InputError, "did you mean 'csv'?"),
    "a film that stands": option(
        "replay good.npz --gif out/new/a.gif --fps 0", InputError, "frame rate is 0", "more than 0"
    ),
    "times that are none": option(
        "replay good.npz --snapshots out/new/a.png --times 0,later", InputError, "--times is '0,later'"
    ),
    "a folder that is a file": option("solve take-off --output good.npz", OutputError, "cannot write to the folder"),
}


@pytest.fixture(scope="module")
def good(ironcub, tmp_path_factory) -> Path:
    return synthetic_take_off(ironcub).save(tmp_path_factory.mktemp("good") / "good.npz")


def listing(folder: Path) -> dict[str, bytes]:
    return {str(path): path.read_bytes() if path.is_file() else b"" for path in sorted(folder.rglob("*"))}


def prepare(case: Broken, good: Path, folder: Path) -> dict[str, bytes]:
    case.make(folder, good)
    return listing(folder)


@pytest.mark.parametrize("name", BROKEN)
def test_broken_input_ends_in_one_sentence_soon_and_with_nothing_written(name, good, tmp_path, monkeypatch, capsys):
    case = BROKEN[name]
    before = prepare(case, good, tmp_path)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "argv", ["multimodal-to", *case.command.split()])
    monkeypatch.setattr(warnings, "showwarning", warnings.showwarning)  # which `main` replaces
    started = time.perf_counter()
    with pytest.raises(SystemExit) as ended:
        main()
    assert time.perf_counter() - started < PATIENCE
    assert ended.value.code == 2
    said = capsys.readouterr().err.strip()
    for words in case.says:
        assert words in said
    if case.error is not None:
        assert type(ended.value.__context__) is case.error
        assert said.startswith("error: ")
        assert said.isprintable()  # no line break either
        assert len(said) < 1000
    assert listing(tmp_path) == before


@pytest.mark.parametrize("name", ["an unknown key", "a pickle", "an entity bomb", "an unknown option"])
def test_a_process_of_its_own_ends_with_status_2(name, good, tmp_path):
    case = BROKEN[name]
    before = prepare(case, good, tmp_path)
    result = subprocess.run(
        [sys.executable, "-m", "multimodal_to", *case.command.split()],
        capture_output=True,
        text=True,
        cwd=tmp_path,
        timeout=60,
        check=False,
    )
    assert (result.returncode, result.stdout) == (2, "")
    assert all(words in result.stderr for words in case.says)
    assert "Traceback" not in result.stderr
    assert listing(tmp_path) == before


def test_a_folder_that_was_made_for_a_command_stays_when_something_was_written(good, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "argv", ["multimodal-to", "export", str(good), "--to", "csv", "-o", "new/folder/a.csv"])
    monkeypatch.setattr(warnings, "showwarning", warnings.showwarning)
    with pytest.raises(SystemExit) as ended:
        main()
    assert ended.value.code == 0
    assert (tmp_path / "new/folder/a.csv").is_file()

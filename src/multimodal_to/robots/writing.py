"""A draft as the text of a `robot.toml`, in which every guess says that it is one."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Sequence

import numpy as np

from multimodal_to.adam.inspection import is_placeholder
from multimodal_to.models import proportions
from multimodal_to.robots.drafting import Draft

EFFORT = {"legs": 0.4, "torso": 0.4}
"""Proposed effort of a joint whose URDF states none, by group [m g L]."""
EFFORT_OF_OTHERS = 0.1  # [m g L]
DRAG = 0.065
"""Guessed drag of a rotor: its moment over its thrust, as a share of the rotors' greatest distance from the CoM [1]."""
THRUST = 2.0
"""Guessed thrust of all jets together [m g]."""
TIME_CONSTANT = 0.3
"""Guessed time constant of an engine [√(d / g)]; d is how far the farthest of them is from the CoM."""
FRICTION = 0.5  # guessed [1]
_GRAVITY = 9.81  # [m/s²]
_BARE = re.compile(r"[A-Za-z0-9_-]+")


def toml(draft: Draft, urdf: str) -> str:
    """Return the text of a robot's file.

    Args:
        draft: the robot.
        urdf: what the file says of where the URDF is.
    """
    return (
        "\n".join(
            [*_head(draft, urdf), *_joints(draft), *_groups(draft), *_home(draft), *_contact(draft), *_jets(draft)]
        )
        + "\n"
    )


def _head(draft: Draft, urdf: str) -> Iterator[str]:
    yield "# Made from the URDF. What a comment calls a guess is one: look at home.png, and put in what you know."
    yield f"name = {_text(draft.name)}"
    yield f"urdf = {_text(urdf)}"
    for name, reason in draft.left_out.items():
        yield f"# joint {_text(name)} is held at zero, a guess: {reason}"


def _joints(draft: Draft) -> Iterator[str]:
    if not draft.joints:
        return
    yield ""
    yield "[joints]  # range and speed to plan in, and the pose at home [rad, rad/s; m, m/s where it slides]"
    weight_times_height = draft.kindyn.get_total_mass() * _GRAVITY * draft.standing_height
    for joint, of, home in zip(draft.joints, draft.ranges, draft.home, strict=True):
        guesses = list(of.guesses)
        far_too_much = joint.effort > proportions.MOST_EFFORT * weight_times_height
        if is_placeholder(joint.effort) or not np.isfinite(joint.effort) or far_too_much:
            share = next(
                (share for group, share in EFFORT.items() if joint.name in draft.groups.get(group, ())),
                EFFORT_OF_OTHERS,
            )
            proposal = f"effort = {float(f'{share * weight_times_height:.2g}'):g}"
            guesses.append(
                f"the URDF's effort {joint.effort:g} limits nothing; state the motor's own, perhaps {proposal}"
            )
        entries = f"lower = {_number(of.lower)}, upper = {_number(of.upper)}, speed = {_number(of.speed)}"
        comment = f"  # {'; '.join(guesses)}" if guesses else ""
        at_home = _number(min(max(round(float(home), 4), of.lower), of.upper))
        yield f"{_key(joint.name)} = {{ {entries}, home = {at_home} }}{comment}"


def _groups(draft: Draft) -> Iterator[str]:
    if draft.groups:
        yield ""
        yield "[joint_groups]  # by the branches of the tree; names are guesses, from where a branch ends at home"
        for name, members in draft.groups.items():
            yield f"{_key(name)} = {_list(members)}"


def _home(draft: Draft) -> Iterator[str]:
    source = "the URDF's zero, or near zero where that is outside"
    if draft.state is not None:
        source = f"the state '{draft.state.name}' of {draft.state.source.name}"
    yield ""
    yield f"# Joints at home: {source}{_bent(draft)}. The lowest contact point is on the ground."
    if draft.state is None:
        ahead = "the soles say where ahead is" if draft.base_quaternion_xyzw[3] != 1.0 else "x is ahead"
        yield f"# A guess: the base is upright and z is up; {ahead}."
    yield "[home]"
    yield f"base_position = [0.0, 0.0, {_number(round(draft.base_height, 5))}]  # [m], world"
    yield f"base_quaternion_xyzw = [{', '.join(map(_number, draft.base_quaternion_xyzw))}]"


def _bent(draft: Draft) -> str:
    if not draft.bent_legs:
        return ""
    return (
        f"; bent, as they would be straight (a guess): {', '.join(name.replace('_', ' ') for name in draft.bent_legs)}"
    )


def _contact(draft: Draft) -> Iterator[str]:
    if not draft.feet:
        yield ""
        yield "# There is no table [contact]: the robot touches nothing."
        return
    if draft.frames:
        yield ""
        yield "[frames]  # guesses: the lowest points of the feet's shapes at home [m]"
        for name, frame in draft.frames.items():
            place = ", ".join(_number(float(value)) for value in frame.translation)
            yield f"{_key(name)} = {{ link = {_text(frame.link)}, position = [{place}] }}"
    yield ""
    yield "[contact]"
    yield f"friction = {FRICTION}  # a guess"
    yield ""
    yield "[contact.feet]"
    for name, frames in draft.feet.items():
        yield f"{_key(name)} = {_list(frames)}"
    if draft.reach is not None:
        yield ""
        yield "[reach]  # guesses, by the lengths of the legs: from the CoM, by world axis [m]"
        yield f"contacts = [{', '.join(_number(float(value)) for value in draft.reach)}]"


def _jets(draft: Draft) -> Iterator[str]:
    if not draft.jets:
        return
    greatest = THRUST * draft.kindyn.get_total_mass() * _GRAVITY / len(draft.jets)
    greatest = float(f"{greatest:.2g}")
    away = np.linalg.norm(draft.stance.places(tuple(draft.jets)) - draft.stance.com, axis=1).max()
    drags = _drags(draft, float(away))
    for frame, axis in draft.jets.items():
        yield ""
        yield "[[jet]]"
        yield f"name = {_text(frame)}"
        yield f"frame = {_text(frame)}"
        yield f"thrust_axis = [{', '.join(_number(value) for value in axis)}]  # in the frame; a guess, up at home"
        yield 'model = "engine"'
        yield f"thrust_max = {_number(greatest)}  # [N], a guess: all jets together carry {THRUST:g} times the weight"
        yield "throttle = [0.0, 100.0]  # [%]"
        guess = "; a guess, neighbours turn opposite ways" if drags[frame] else ""
        yield (
            f"drag = {_number(drags[frame])}  # of a rotor [m]: moment for each newton of thrust, positive about "
            f"thrust_axis{guess}"
        )
    lag = float(f"{TIME_CONSTANT * (away / _GRAVITY) ** 0.5:.2g}")
    yield ""
    yield "[jet_models.engine]  # guesses: how fast and how strongly the thrust follows the throttle"
    yield 'kind = "first-order"'
    yield f"gain = {_number(greatest / 100.0)}  # [N/%]"
    yield f"time_constant = {_number(lag)}  # [s]"


def _drags(draft: Draft, away: float) -> dict[str, float]:
    """Return the drag of each rotor [m]; zero where joints turn the jets, or where they are no even ring.

    A body with a ring of rotors and nothing that moves turns about the vertical by their drag alone. So neighbours have
    opposite signs.

    Args:
        draft: with its jets.
        away: how far the farthest of them is from the CoM [m].
    """
    count = len(draft.jets)
    if draft.kindyn.joint_names or count < 4 or count % 2:
        return dict.fromkeys(draft.jets, 0.0)
    places = draft.stance.places(tuple(draft.jets)) - draft.stance.com
    around = np.argsort(np.arctan2(places[:, 1], places[:, 0]))
    signs = np.empty(count)
    signs[around] = np.where(np.arange(count) % 2, -1.0, 1.0)
    size = float(f"{DRAG * away:.2g}")
    return {frame: size * float(sign) for frame, sign in zip(draft.jets, signs, strict=True)}


def _number(value: float) -> str:
    text = repr(float(value) + 0.0)
    return text if "e" not in text else f"{value:.12f}"


def _text(value: str) -> str:
    return json.dumps(value, ensure_ascii=False)


def _key(name: str) -> str:
    return name if _BARE.fullmatch(name) else _text(name)


def _list(names: Sequence[str]) -> str:
    return f"[{', '.join(map(_text, names))}]"

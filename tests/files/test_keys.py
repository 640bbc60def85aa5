"""The keys of a file follow from the dataclass that it is read into, which its reader follows too."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum

import pytest

from multimodal_to.errors import InputError, ModelError
from multimodal_to.files.keys import Key, field_texts, keys_of
from multimodal_to.files.records import Records


class Colour(Enum):
    RED = "red"
    BLUE = "blue"


@dataclass(frozen=True, kw_only=True)
class Round:
    radius: float
    """From the middle to the rim [m]."""


@dataclass(frozen=True, kw_only=True)
class Square:
    sides: tuple[float, float] = (1.0, 2.0)
    """Length and width,
    along x and y [m]."""


class Shape:
    """What is round or square."""


@dataclass(frozen=True, kw_only=True)
class Screw:
    radius: float
    """Of its thread [mm]."""


@dataclass(frozen=True, kw_only=True)
class Thing:
    name: str
    """What it is called."""
    shape: Shape = field(default_factory=Square)  # type: ignore[assignment]
    """How it looks."""
    count: int | None = None
    """How many there are [1]; where there is none, any."""
    colour: Colour = Colour.BLUE
    """Its paint."""
    parts: tuple[Screw, ...] = ()
    """What it is made of."""
    prices: Mapping[str, float] = field(default_factory=dict)
    """What it costs, by shop [€]."""

    def __post_init__(self) -> None:
        if self.count == 0:
            raise InputError("count is 0; expected some")


UNIONS = {Shape: {"round": Round, "square": Square}}
THINGS = Records(what="the thing", error=ModelError, unions=UNIONS)


def test_every_field_is_a_key_with_its_kind_unit_default_and_meaning():
    assert keys_of(Thing, UNIONS) == (
        Key(name="name", kind="text", unit="", default="required", meaning="What it is called"),
        Key(
            name="shape",
            kind="table with a kind, or the kind alone",
            unit="",
            default="square",
            meaning="How it looks",
        ),
        Key(name="shape.kind", kind="one of round, square", unit="", default="square", meaning="Which one it is"),
        Key(
            name="shape.radius",
            kind="number",
            unit="m",
            default="required",
            meaning="From the middle to the rim",
            where="shape.kind = round",
        ),
        Key(
            name="shape.sides",
            kind="two numbers",
            unit="m",
            default="[1, 2]",
            meaning="Length and width, along x and y",
            where="shape.kind = square",
        ),
        Key(
            name="count",
            kind="whole number",
            unit="1",
            default="none",
            meaning="How many there are; where there is none, any",
        ),
        Key(name="colour", kind="one of red, blue", unit="", default="blue", meaning="Its paint"),
        Key(name="parts", kind="list of tables", unit="", default="none", meaning="What it is made of"),
        Key(name="parts[].radius", kind="number", unit="mm", default="required", meaning="Of its thread"),
        Key(
            name="prices",
            kind="table of names, each with a number",
            unit="€",
            default="none",
            meaning="What it costs, by shop",
        ),
    )


def test_a_field_without_a_text_is_refused():
    @dataclass(frozen=True)
    class Silent:
        said: int = 0
        """Something."""
        unsaid: int = 0

    assert field_texts(Silent) == {"said": "Something."}
    with pytest.raises(InputError, match="the field 'unsaid' of Silent has no text below it that says its meaning"):
        keys_of(Silent, {})


def test_a_record_survives_being_written_as_plain_data():
    thing = Thing(name="ball", shape=Round(radius=0.2), parts=(Screw(radius=1.0),), prices={"here": 3.0})
    plain = THINGS.plain(thing)
    assert plain["shape"] == {"kind": "round", "radius": 0.2}
    assert "count" not in plain
    assert THINGS.read(Thing, plain) == thing


def test_a_base_is_changed_by_part_of_a_table():
    base = Thing(name="box", shape=Square(sides=(3.0, 4.0)), prices={"here": 3.0, "there": 4.0})
    changed = THINGS.read(Thing, {"prices": {"there": 5.0}, "shape": {"sides": [1, 1]}}, base)
    assert changed == Thing(name="box", shape=Square(sides=(1.0, 1.0)), prices={"here": 3.0, "there": 5.0})


@pytest.mark.parametrize(
    ("table", "sentence"),
    [
        (3, "'the thing' is 3; expected a table"),
        ({}, "the thing lacks 'name'"),
        ({"nme": "x"}, "unknown key 'nme'; did you mean 'name'? Available: name, shape, count"),
        (
            {"name": "x", "parts": [{"radius": 1}, {"radios": 1}]},
            "unknown key 'parts[1].radios'; did you mean 'parts[1]",
        ),
        ({"name": "x", "parts": [{"radius": 1}, {}]}, "the thing lacks 'parts[1].radius'"),
        ({"name": "x", "shape": {"kind": "square", "sides": [1, "a"]}}, "'shape.sides[1]' is 'a'; expected a finite n"),
        ({"name": "x", "shape": "oval"}, "'shape.kind' is 'oval'; expected one of round, square"),
        ({"name": "x", "prices": {"here": True}}, "'prices.here' is True; expected a finite number"),
        ({"name": "x", "colour": "green"}, "'colour' is 'green'; expected one of red, blue"),
        ({"name": "x", "count": 0}, "count is 0; expected some"),
    ],
)
def test_what_is_wrong_is_named_by_its_key(table, sentence):
    with pytest.raises(ModelError) as error:
        THINGS.read(Thing, table)
    assert str(error.value).startswith(sentence)

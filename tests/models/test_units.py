"""A robot's own units, and numbers that grow and shrink with it."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from multimodal_to.errors import InputError
from multimodal_to.models.units import ONE_OF_A_POINT, REFERENCE, OwnSize, Sized, Units, size_of, sized
from multimodal_to.ocp.variables import VARIABLES

SMALL = Units(mass=2.5, length=0.2, gravity=9.81, contact_points=4)


@pytest.mark.parametrize(
    ("unit", "own"),
    [
        ("m", 0.2),
        ("s", math.sqrt(0.2 / 9.81)),
        ("m/s", math.sqrt(0.2 * 9.81)),
        ("m/s²", 9.81),
        ("rad/s²", 9.81 / 0.2),
        ("N", 2.5 * 9.81),
        ("N m", 2.5 * 9.81 * 0.2),
        ("kg m²/s", 2.5 * 0.2 * math.sqrt(0.2 * 9.81)),
        ("W", 2.5 * 9.81 * math.sqrt(0.2 * 9.81)),
        ("1", 1.0),
        ("%", 1.0),
    ],
)
def test_every_unit_follows_from_mass_length_and_gravity(unit, own):
    assert SMALL.of(unit) == pytest.approx(own)


def test_a_unit_that_is_none_is_refused():
    with pytest.raises(InputError, match="'feet' is no unit"):
        SMALL.of("feet")
    with pytest.raises(InputError, match="is no unit"):
        Sized(1.0, "kg feet")
    with pytest.raises(InputError, match="contact_points is 0"):
        replace(SMALL, contact_points=0)


def test_the_ironcub_has_every_number_as_it_is_written(ironcub):
    assert ironcub.units.contact_points == REFERENCE.contact_points == 8
    for unit in ("m", "N", "N m", "kg m²/s", "m/s", "rad/s", "N/s²"):
        assert Sized(0.3, unit).of(ironcub.units) == 0.3
        assert Sized(0.3, unit, of_a_point=True).of(ironcub.units) == 0.3
    scales = {variable.name: set(variable.scales(ironcub)) for variable in VARIABLES}
    assert {name: size for name, size in scales.items() if size != {1.0}} == {
        "contact_forces": {50.0},
        "thrust": {100.0},
        "thrust_rate": {50.0},
        "throttle": {50.0},
    }


def test_the_load_of_a_point_is_its_share_of_the_weight():
    of_all, of_one = Sized(50.0, "N").of(SMALL), Sized(50.0, "N", of_a_point=True).of(SMALL)
    assert of_one / of_all == pytest.approx(8 / 4)
    assert size_of(ONE_OF_A_POINT, "m", SMALL) == size_of(OwnSize(1.0), "m", SMALL)
    assert sized(7.0, SMALL) == size_of(7.0, "N", SMALL) == 7.0

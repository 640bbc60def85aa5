"""A tape's values are CasADi's, to the last bit, whatever is computed and at however many knots."""

from __future__ import annotations

import gc
import os
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from itertools import product

import casadi as cs
import numpy as np
import pytest

from multimodal_to.native import library
from multimodal_to.native.tape import Tape, operations
from multimodal_to.ocp.tapes import read, tape_of
from random_functions import random_columns, random_function
from tapes import by_casadi, by_tape, fuzzed, horizon_of, needs_library, run, same_bits, taped

pytestmark = needs_library

SPECIAL = np.array(
    [
        *(0.0, -0.0, 1.0, -1.0, 0.5, -0.7, 2.0, -3.0, 1e-3, 7.25, 100.5, -1e5, 2.0**53, 710.0, -746.0),
        *(1e300, -1e300, 1e-300, 5e-324, -3e-310, np.inf, -np.inf, np.nan),
        *(np.pi, np.pi / 2, np.nextafter(1.0, 2.0), np.nextafter(1.0, 0.0)),
    ]
)
NOT_OPERATIONS = {"CONST", "INPUT", "OUTPUT"}
BINARY = (
    *("ADD", "SUB", "MUL", "DIV", "POW", "CONSTPOW", "LT", "LE", "EQ", "NE", "AND", "OR", "FMOD", "REMAINDER"),
    *("COPYSIGN", "IF_ELSE_ZERO", "FMIN", "FMAX", "ATAN2", "HYPOT", "LIFT"),
)


@pytest.mark.parametrize("name", sorted(operations().keys() - NOT_OPERATIONS) if library() else ())
def test_an_operation_is_casadis_for_ordinary_and_special_numbers(name):
    x, y = cs.SX.sym("x"), cs.SX.sym("y")
    number = getattr(cs, f"OP_{name}")
    value = cs.SX.binary(number, x, y) if name in BINARY else cs.SX.unary(number, x)
    function = cs.Function("operation", [x, y], [cs.densify(value)])
    random = np.random.default_rng(0)
    drawn = np.concatenate([random.normal(size=200), random.uniform(-30, 30, 200), 10 ** random.uniform(-9, 9, 200)])
    pairs = np.array([*product(SPECIAL, SPECIAL), *zip(drawn, random.permutation(drawn), strict=True)]).T
    columns = [pairs[index : index + 1] for index in range(2)]
    assert same_bits(by_tape(function, *columns), by_casadi(function, *columns))


def test_the_operations_of_casadi_without_a_place_on_a_tape_are_known():
    """All others that a function of scalars can hold are on tapes."""
    x, y = cs.SX.sym("x"), cs.SX.sym("y")
    assert {"SIN", "ERF", "LOG1P", "ATAN2", "HYPOT"} < operations().keys()
    assert tape_of(cs.Function("f", [x], [cs.erfinv(x)])) is None
    assert tape_of(cs.Function("f", [x, y], [x.printme(y)])) is None
    inner = cs.Function("inner", [x], [cs.sin(x)], {"never_inline": True})
    assert tape_of(cs.Function("f", [x], [inner(x)])) is None
    assert tape_of(inner.map(3)) is None


@pytest.mark.parametrize("seed", range(60))
def test_random_functions_are_casadis(seed):
    random = np.random.default_rng(seed)
    function = random_function(random, size=int(random.integers(1, 600)))
    columns = random_columns(random, function, knots=int(random.integers(1, 30)))
    assert same_bits(by_tape(function, *columns), by_casadi(function, *columns))


def test_a_function_longer_than_the_window_that_is_put_in_order_is_casadis():
    random = np.random.default_rng(7)
    x = cs.SX.sym("x", 800)
    value = older = x
    for _ in range(60):
        value, older = cs.sin(value) * older[random.permutation(800).tolist()] + older / 3, value
    function = cs.Function("long", [x], [value])
    column = random.normal(size=(800, 9))
    assert taped(function).instructions > 2**16
    assert same_bits(by_tape(function, column), by_casadi(function, column))


@pytest.mark.parametrize("knots", [1, 2, 7, 8, 9, 16, 17, 1000])
def test_any_number_of_knots_will_do(knots):
    random = np.random.default_rng(knots)
    function = random_function(random, size=300)
    columns = random_columns(random, function, knots=knots)
    assert same_bits(by_tape(function, *columns), by_casadi(function, *columns))


def test_what_is_the_same_twice_is_computed_once_and_what_nobody_asks_for_never():
    x = cs.SX.sym("x", 2)
    again = cs.sin(x[0]) * x[1] + cs.sin(x[0] + 0) * x[1]
    function = cs.Function("f", [x], [cs.vertcat(cs.sin(x[0]) * x[1], cs.sin(x[0]) * x[1], again)])
    # x[0], x[1], sin, their product, twice it, three outputs and the end
    assert taped(function).instructions <= 9
    assert same_bits(by_tape(function, np.ones((2, 3))), by_casadi(function, np.ones((2, 3))))


def test_products_and_sums_are_rounded_one_after_the_other():
    """1 + ε squared, less its rounded square, is zero unless the product is left unrounded."""
    x, y = cs.SX.sym("x"), cs.SX.sym("y")
    function = cs.Function("f", [x, y], [cs.vertcat(x * x - y, y - x * x, x * y - x, x - x * y, x * y + x)])
    near_one = 1 + np.arange(1, 18)[None] * 2.0**-30
    columns = near_one, near_one * near_one
    found = by_tape(function, *columns)
    assert same_bits(found, by_casadi(function, *columns))
    assert not found[:2].any()


def test_a_nan_goes_where_it_belongs_and_nowhere_else():
    """Of nine knots only the one with the NaN has one, and only in what depends on it."""
    x = cs.SX.sym("x", 2)
    function = cs.Function("f", [x], [cs.vertcat(cs.sin(x[0]) + 1, x[1] * 2)])
    column = np.ones((2, 9))
    column[0, 4] = np.nan
    found = by_tape(function, column)
    assert np.flatnonzero(np.isnan(found[0])).tolist() == [4]
    assert not np.isnan(found[1]).any()


def test_functions_without_inputs_outputs_or_instructions_are_tapes_too():
    x, empty = cs.SX.sym("x", 3), cs.SX.sym("e", 0)
    constant = cs.Function("constant", [empty], [cs.vertcat(cs.SX(1.5), cs.SX(-0.0))])
    assert same_bits(by_tape(constant, np.zeros((0, 11))), by_casadi(constant, np.zeros((0, 11))))
    nothing = cs.Function("nothing", [x], [cs.SX(0, 1)])
    assert by_tape(nothing, np.ones((3, 5))).shape == (0, 5)
    assert taped(nothing).registers == 0


def test_a_function_that_holds_too_many_values_at_once_is_no_tape():
    """An instruction names one of 65 535 registers; of x, 70 000 values wait for the sum that all of them divide."""
    x = cs.SX.sym("x", 70_000)
    assert tape_of(cs.Function("f", [x], [x / cs.sum1(x)])) is None


def test_what_makes_no_sense_is_no_tape():
    known = operations()
    good = [[known["INPUT"], 0, 0, 0], [known["SIN"], 0, 0, 0], [known["OUTPUT"], 0, 0, 0]]
    assert Tape(np.array(good), 1, 1).instructions == 4
    for row, column, number in ((0, 0, -1), (0, 0, 999), (0, 1, -2), (0, 2, 1), (0, 3, -1), (1, 2, 5), (2, 3, 1)):
        bad = np.array(good)
        bad[row, column] = number
        with pytest.raises(ValueError, match="are no tape"):
            Tape(bad, 1, 1)
    with pytest.raises(ValueError, match="are no tape"):  # a register is read before it is written
        Tape(np.array(good[1:]), 1, 1)


def test_instructions_are_those_that_casadi_hands_out_one_by_one():
    function = random_function(np.random.default_rng(3), size=400)
    found = read(function)
    for index, (operation, i0, i1, i2) in enumerate(found.tolist()):
        assert operation == function.instruction_id(index)
        inputs, outputs = function.instruction_input(index), function.instruction_output(index)
        if operation == cs.OP_CONST:
            assert found[index, 2:].tobytes() == np.float64(function.instruction_constant(index)).tobytes()
        elif operation == cs.OP_OUTPUT:
            assert (inputs, outputs) == ([i1], [i0, i2])
        else:
            assert (inputs, outputs) == ([i1, i2][: len(inputs)], [i0])


def test_instructions_are_found_without_the_short_way(monkeypatch):
    function = random_function(np.random.default_rng(4), size=200)
    columns = random_columns(np.random.default_rng(5), function, knots=4)
    monkeypatch.setattr("multimodal_to.ocp.tapes._found", lambda *_: None)
    assert same_bits(by_tape(function, *columns), by_casadi(function, *columns))


def test_threads_change_no_bit_and_many_may_ask_at_once():
    random = np.random.default_rng(11)
    function = random_function(random, size=4000, outputs=80)
    columns = random_columns(random, function, knots=203)
    horizon = horizon_of(function, 203)
    expected = by_casadi(function, *columns)
    before = library().mt_threads()
    try:
        for threads in (1, 2, 3, 4):
            library().mt_set_threads(threads)
            assert same_bits(run(horizon, columns, 80), expected)
        with ThreadPoolExecutor(6) as pool:
            for found in pool.map(lambda _: run(horizon, columns, 80), range(30)):
                assert same_bits(found, expected)
    finally:
        library().mt_set_threads(before)


@pytest.mark.skipif(sys.platform != "linux", reason="reads /proc")
@pytest.mark.skipif("MULTIMODAL_TO_SANITIZED" in os.environ, reason="a sanitizer keeps memory that is freed")
def test_memory_is_given_back():
    random = np.random.default_rng(12)
    function = random_function(random, size=5000, outputs=100)
    columns = random_columns(random, function, knots=400)

    def used() -> int:  # [bytes]
        gc.collect()
        with open("/proc/self/statm", encoding="ascii") as file:
            return int(file.read().split()[1]) * os.sysconf("SC_PAGE_SIZE")

    tape = taped(function)
    for _ in range(3):
        run(horizon_of(function, 400, tape), columns, 100)
    before = used()
    for _ in range(60):
        run(horizon_of(function, 400, tape), columns, 100)
    assert used() - before < 8e6  # 60 times 0.5 MB if it were kept


def test_every_instruction_set_has_the_same_bits():
    """On a processor that lacks one, the largest that it has runs instead."""
    said = {
        name: subprocess.run(
            [sys.executable, "-c", "import tapes; print(tapes.fuzzed(), end='')"],
            env={**os.environ, "MULTIMODAL_TO_INSTRUCTION_SET": name, "PYTHONPATH": os.pathsep.join(sys.path)},
            check=True,
            capture_output=True,
            text=True,
        ).stdout
        for name in ("sse2", "avx2")
    }
    assert set(said.values()) == {fuzzed()}

"""A program written for `adam.casadi` changes one line, its import, and gets the same numbers."""

from __future__ import annotations

import inspect
import pydoc
import warnings
from enum import IntEnum
from functools import partial
from pathlib import Path

import casadi as cs
import numpy as np
import pytest

from adam_robots import IRONCUB, State, example_robots, ironcub_joints, random_states
from multimodal_to import adam as ours
from multimodal_to.errors import InputError

with warnings.catch_warnings():
    warnings.simplefilter("ignore")
    import adam as theirs
    import adam.casadi as theirs_casadi

TOLERANCE = 1e-9  # of the largest entry
URDF = str(IRONCUB / "ironcub.urdf")
ROBOTS = {
    "ironcub": (Path(URDF), ["l_sole", "head"]),
    "solo": (example_robots() / "solo_description/robots/solo12.urdf", ["HR_FOOT", "FL_UPPER_LEG"]),
}
REPRESENTATIONS = [member.name for member in theirs.Representations]
ADAM_OPTIONS = {"jit": False, "jit_options": {"flags": "-Ofast"}, "cse": True}  # its own default


def joints_of(robot: str) -> list[str]:
    return ironcub_joints() if robot == "ironcub" else list(ours.load_tree(ROBOTS[robot][0]).joint_names)


def program(kindyn_class: type, robot: str, representation: str, states: list[State]) -> dict[str, np.ndarray]:
    """Use all that `adam.casadi` offers, in its own words; only the class, which is what one imports, differs."""
    urdf, frames = ROBOTS[robot]
    kindyn = kindyn_class.from_urdf(str(urdf), joints_of(robot), f_opts=ADAM_OPTIONS)
    kindyn.set_frame_velocity_representation(theirs.Representations[representation])
    also_called = robot != "ironcub"  # adam writes the expression anew in each call, which takes long
    found = {"mass": kindyn.get_total_mass(), "n": kindyn.NDoF, "g": kindyn.g}
    functions = {
        "M": (kindyn.mass_matrix_fun(), kindyn.mass_matrix),
        "CMM": (kindyn.centroidal_momentum_matrix_fun(), kindyn.centroidal_momentum_matrix),
        "CoM": (kindyn.CoM_position_fun(), kindyn.CoM_position),
        "J CoM": (kindyn.CoM_jacobian_fun(), kindyn.CoM_jacobian),
        "G": (kindyn.gravity_term_fun(), kindyn.gravity_term),
        "h": (kindyn.bias_force_fun(), kindyn.bias_force),
        "C": (kindyn.coriolis_term_fun(), kindyn.coriolis_term),
        "aba": (kindyn.aba_fun(), kindyn.aba),
    }
    for frame in frames:
        functions |= {
            f"FK {frame}": (kindyn.forward_kinematics_fun(frame), partial(kindyn.forward_kinematics, frame)),
            f"J {frame}": (kindyn.jacobian_fun(frame), partial(kindyn.jacobian, frame)),
            f"relative J {frame}": (kindyn.relative_jacobian_fun(frame), partial(kindyn.relative_jacobian, frame)),
            f"J dot {frame}": (kindyn.jacobian_dot_fun(frame), partial(kindyn.jacobian_dot, frame)),
        }
    for index, state in enumerate(states):
        everything = (*state.motion, state.s_ddot)  # the accelerations serve as torques
        for name, (function, call) in functions.items():
            given = everything[: function.n_in()] if function.n_in() > 1 else [state.s]
            found[f"{name}, state {index}"] = function(*given)
            if also_called and index == 0:
                found[f"{name} by a call"] = call(*given)
        # adam's J̇ alone is not the derivative of its J (ours is: test_adam_physics.py), but J̇ ν is the same
        found |= {name: numbers(value) @ state.nu for name, value in found.items() if is_jacobian_dot(name, value)}
    pushes = {frame: np.arange(1.0, 7.0) * (count + 1) for count, frame in enumerate(frames)}
    H, s, v, s_dot = states[0].motion
    found["aba with wrenches"] = kindyn.aba(
        base_transform=H,
        joint_positions=s,
        base_velocity=v,
        joint_velocities=s_dot,
        joint_torques=states[0].s_ddot,
        external_wrenches=pushes,
    )
    return {name: numbers(value) for name, value in found.items()}


def is_jacobian_dot(name: str, value: object) -> bool:
    return name.startswith("J dot") and not isinstance(value, np.ndarray)


def numbers(value: object) -> np.ndarray:
    """Return as an array what adam or we return: a number, an array, or a matrix of CasADi without symbols."""
    return np.array(value) if isinstance(value, int | float | np.ndarray) else np.array(cs.evalf(cs.SX(value)))


@pytest.mark.parametrize("robot", ROBOTS)
@pytest.mark.parametrize("representation", REPRESENTATIONS)
def test_one_import_is_all_that_a_program_changes(robot: str, representation: str) -> None:
    states = random_states(len(joints_of(robot)), 3, seed=21)
    expected = program(theirs_casadi.KinDynComputations, robot, representation, states)
    found = program(ours.KinDynComputations, robot, representation, states)
    assert len(found) == 3 + (3 if robot == "ironcub" else 4) * 16 + 1
    errors = {}
    for name, value in expected.items():
        assert found[name].size == value.size, name
        errors[name] = np.abs(found[name].ravel() - value.ravel()).max() / max(1.0, np.abs(value).max())
    assert {name: error for name, error in errors.items() if not error < TOLERANCE} == {}


def test_every_name_and_argument_of_adam_is_there_but_mujoco() -> None:
    """Names, and the order of arguments; ours may take more behind adam's."""
    missing = []
    for name, method in inspect.getmembers(theirs_casadi.KinDynComputations, inspect.isroutine):
        if name.startswith("_") and name != "__init__":
            continue
        if name not in dir(ours.KinDynComputations):
            missing.append(name)
            continue
        if name == "from_urdf":  # adam passes whatever follows on to the constructor
            method = theirs_casadi.KinDynComputations
        expected = list(inspect.signature(method).parameters)
        found = list(inspect.signature(getattr(ours.KinDynComputations, name)).parameters)
        assert found[: len(expected)] == expected, name
    assert missing == ["from_mujoco_model"]


@pytest.fixture
def kindyn() -> ours.KinDynComputations:
    return ours.KinDynComputations(URDF, ironcub_joints())


def test_a_new_representation_holds_for_later_calls_and_each_keeps_its_functions(kindyn) -> None:
    state = random_states(kindyn.NDoF, 1, seed=22)[0]
    mixed, numbers = kindyn.jacobian_fun("l_sole"), np.array(kindyn.jacobian("l_sole", *state.pose))
    kindyn.set_frame_velocity_representation(ours.Representations.BODY_FIXED_REPRESENTATION)
    assert kindyn.representation is ours.Representations.BODY_FIXED_REPRESENTATION
    body, turned = kindyn.jacobian_fun("l_sole"), np.array(kindyn.jacobian("l_sole", *state.pose))
    assert body is not mixed
    frame = np.array(kindyn.forward_kinematics("l_sole", *state.pose))[:3, :3]
    out, into = np.kron(np.eye(2), frame.T), np.eye(6 + kindyn.NDoF)
    into[:6, :6] = np.kron(np.eye(2), state.H[:3, :3])
    np.testing.assert_allclose(turned, out @ numbers @ into, atol=1e-12)
    np.testing.assert_array_equal(mixed(*state.pose), numbers)  # a function that was made before stays what it was
    kindyn.set_frame_velocity_representation(ours.Representations.MIXED_REPRESENTATION)
    assert kindyn.jacobian_fun("l_sole") is mixed


def test_a_representation_set_later_is_one_given_at_once() -> None:
    state = random_states(len(ironcub_joints()), 1, seed=23)[0]
    for representation in ours.Representations:
        at_once = ours.KinDynComputations(URDF, ironcub_joints(), representation=representation)
        later = ours.KinDynComputations(URDF, ironcub_joints())
        later.bias_force(*state.motion)
        later.set_frame_velocity_representation(representation)
        np.testing.assert_array_equal(later.bias_force(*state.motion), at_once.bias_force(*state.motion))


class Stranger(IntEnum):
    WORLD = 2


@pytest.mark.parametrize("wrong", [0, 4, "MIXED_REPRESENTATION", None, Stranger.WORLD])
def test_what_is_no_representation_is_refused_and_changes_nothing(kindyn, wrong: object) -> None:
    with pytest.raises(InputError, match=r"unknown representation .*; available: BODY_FIXED_REPRESENTATION, MIXED_"):
        kindyn.set_frame_velocity_representation(wrong)
    assert kindyn.representation is ours.Representations.MIXED_REPRESENTATION


@pytest.mark.parametrize("name", REPRESENTATIONS)
def test_members_of_adam_of_ours_and_their_numbers_mean_the_same(kindyn, name: str) -> None:
    for representation in (theirs.Representations[name], ours.Representations[name], int(theirs.Representations[name])):
        kindyn.set_frame_velocity_representation(representation)
        assert kindyn.representation is ours.Representations[name]


def test_from_urdf_is_the_constructor_also_of_a_class_of_ones_own() -> None:
    class Own(ours.KinDynComputations):
        pass

    gravity = [0.0, 0.5, -1.62, 0.0, 0.0, 0.0]
    made = Own.from_urdf(URDF, ironcub_joints()[:3], "root_link", gravity, {"cse": True})
    assert type(made) is Own
    assert made.joint_names == tuple(ironcub_joints()[:3])
    np.testing.assert_array_equal(made.g, gravity)
    assert made.f_opts == {"cse": True}


def test_options_reach_every_function() -> None:
    plain = ours.KinDynComputations(URDF, ironcub_joints())
    spread = ours.KinDynComputations(URDF, ironcub_joints(), f_opts={"live_variables": False})
    for name in ("mass_matrix_fun", "aba_fun"):  # without sharing of work memory a function needs more of it
        assert getattr(spread, name)().sz_w() > 2 * getattr(plain, name)().sz_w()
    assert spread.jacobian_fun("l_sole").sz_w() > 2 * plain.jacobian_fun("l_sole").sz_w()


def test_an_option_that_casadi_does_not_know_is_named() -> None:
    kindyn = ours.KinDynComputations(URDF, ironcub_joints(), f_opts={"fast": True})
    with pytest.raises(InputError, match=r"mass_matrix: CasADi takes no f_opts = \{'fast': True\}: .*fast"):
        kindyn.mass_matrix_fun()


def test_g_is_adams_gravity_and_a_new_one_holds_for_later_calls(kindyn) -> None:
    peer = theirs_casadi.KinDynComputations(URDF, ironcub_joints())
    np.testing.assert_array_equal(kindyn.g, peer.g)
    state = random_states(kindyn.NDoF, 1, seed=24)[0]
    earth = np.array(kindyn.gravity_term(*state.pose))
    moon = np.array([0.1, 0.0, -1.62, 0.0, 0.0, 0.0])
    kindyn.g = peer.g = moon
    np.testing.assert_array_equal(kindyn.gravity, moon[:3])
    found, expected = np.array(kindyn.gravity_term(*state.pose)), np.array(cs.DM(peer.gravity_term(*state.pose)))
    np.testing.assert_allclose(found, expected, atol=1e-10)
    assert np.abs(found - earth).max() > 1
    np.testing.assert_array_equal(kindyn.gravity_term_fun()(*state.pose), found)


@pytest.mark.parametrize("wrong", [9.81, [0, 0, np.nan], [0, 0, -9.81, 0, 0, 1]])
def test_a_g_that_is_no_gravity_is_refused(kindyn, wrong: object) -> None:
    with pytest.raises(InputError, match="expected three finite numbers"):
        kindyn.g = wrong
    np.testing.assert_array_equal(kindyn.gravity, ours.GRAVITY)


def test_gravity_cannot_be_changed_behind_the_functions_backs(kindyn) -> None:
    with pytest.raises(ValueError, match="read-only"):
        kindyn.gravity[2] = 0


QUANTITIES = [name.removesuffix("_fun") for name in vars(ours.KinDynComputations) if name.endswith("_fun")]


@pytest.mark.parametrize("name", QUANTITIES)
def test_help_of_a_quantity_says_its_formula_and_every_argument(name: str) -> None:
    method, function = (getattr(ours.KinDynComputations, each) for each in (name, f"{name}_fun"))
    text, about = (pydoc.plain(pydoc.render_doc(each)) for each in (method, function))
    parameters = list(inspect.signature(method).parameters)[1:]
    assert f"{name}(self, {parameters[0]}" in text
    assert "Return " in text
    for parameter in parameters:
        assert f"        {parameter}: " in text
    formula = text[text.index("Return ") :].splitlines()[0]
    assert f"{name}_fun(self" in about
    assert formula in about


def test_a_call_that_lacks_an_argument_names_it(kindyn) -> None:
    with pytest.raises(TypeError, match="jacobian: missing a required argument: 'joint_positions'"):
        kindyn.jacobian("l_sole", np.eye(4))
    with pytest.raises(TypeError, match=r"mass_matrix: .*'speed'"):
        kindyn.mass_matrix(np.eye(4), np.zeros(kindyn.NDoF), speed=1)

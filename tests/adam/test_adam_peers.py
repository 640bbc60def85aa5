"""A script written for `adam.casadi` runs with this library after its import is changed, and gives the same numbers."""

from __future__ import annotations

import warnings

import casadi as cs
import numpy as np
import pytest

from adam_robots import IRONCUB, ironcub_joints, random_states
from multimodal_to import adam as ours

URDF = str(IRONCUB / "ironcub.urdf")

with warnings.catch_warnings():
    warnings.simplefilter("ignore")
    import adam as theirs
    import adam.casadi as theirs_casadi


def script(kindyn, state) -> dict[str, np.ndarray]:
    """Use every quantity that adam has, by its functions and with its argument order."""
    H, s, v, s_dot = state.motion
    tau = state.s_ddot
    return {
        "M": kindyn.mass_matrix_fun()(H, s),
        "CMM": kindyn.centroidal_momentum_matrix_fun()(H, s),
        "FK": kindyn.forward_kinematics_fun("l_sole")(H, s),
        "J": kindyn.jacobian_fun("l_sole")(H, s),
        "J relative": kindyn.relative_jacobian_fun("l_sole")(s),
        # adam's J̇ alone is not the derivative of its J (ours is: test_adam_physics.py), but J̇ ν is the same
        "J dot nu": kindyn.jacobian_dot_fun("l_sole")(H, s, v, s_dot) @ state.nu,
        "CoM": kindyn.CoM_position_fun()(H, s),
        "J CoM": kindyn.CoM_jacobian_fun()(H, s),
        "h": kindyn.bias_force_fun()(H, s, v, s_dot),
        "C": kindyn.coriolis_term_fun()(H, s, v, s_dot),
        "G": kindyn.gravity_term_fun()(H, s),
        "aba": kindyn.aba_fun()(H, s, v, s_dot, tau),
        "aba with a wrench": cs.evalf(
            cs.SX(kindyn.aba(*map(cs.SX, (H, s, v, s_dot, tau)), {"r_sole": cs.SX(range(6))}))
        ),
        "mass": kindyn.get_total_mass() * np.ones(1),
        "n": kindyn.NDoF * np.ones(1),
    }


@pytest.mark.parametrize("name", [member.name for member in ours.Representations])
def test_the_same_script_gives_the_same_numbers(name: str) -> None:
    gravity = np.array([0.0, 0.0, -9.80665, 0.0, 0.0, 0.0])
    options = {"urdfstring": URDF, "joints_name_list": ironcub_joints(), "gravity": gravity}
    peer = theirs_casadi.KinDynComputations(**options, f_opts={})
    peer.set_frame_velocity_representation(theirs.Representations[name])
    mine = ours.KinDynComputations(**options, representation=theirs.Representations[name])
    state = random_states(mine.NDoF, 1, seed=8)[0]
    expected, found = script(peer, state), script(mine, state)
    errors = {}
    for key, value in expected.items():
        value = np.array(value).ravel()
        scale = max(1.0, float(np.abs(value).max()))
        errors[key] = float(np.abs(np.array(found[key]).ravel() - value).max()) / scale
    assert {key: error for key, error in errors.items() if not error < 1e-9} == {}


def test_representations_have_adams_names_and_values() -> None:
    assert {m.name: int(m) for m in ours.Representations} == {m.name: int(m) for m in theirs.Representations}


@pytest.fixture(scope="module")
def kindyn() -> ours.KinDynComputations:
    return ours.KinDynComputations(URDF, ironcub_joints())


def test_a_function_is_built_once(kindyn) -> None:
    assert kindyn.mass_matrix_fun() is kindyn.mass_matrix_fun()
    assert kindyn.jacobian_fun("l_sole") is kindyn.jacobian_fun("l_sole")
    assert kindyn.jacobian_fun("l_sole") is not kindyn.jacobian_fun("r_sole")
    assert kindyn.rnea_fun(("l_sole",)) is kindyn.rnea_fun(("l_sole",))


def test_every_quantity_has_a_function_and_a_docstring() -> None:
    public = {name for name in vars(ours.KinDynComputations) if not name.startswith("_")}
    functions = {name.removesuffix("_fun") for name in public if name.endswith("_fun")}
    assert len(functions) == 20
    assert functions <= public
    assert all(getattr(ours.KinDynComputations, name).__doc__ for name in public)


def test_functions_carry_names(kindyn) -> None:
    function = kindyn.jacobian_dot_fun("l_sole")
    assert function.name() == "jacobian_dot_l_sole"
    assert function.name_in() == ["H", "s", "v_b", "s_dot"]
    assert function.name_out() == ["J_dot"]


def test_sx_mx_dm_and_numpy_go_in_and_agree(kindyn) -> None:
    state = random_states(kindyn.NDoF, 1, seed=9)[0]
    numbers = kindyn.centroidal_momentum(*state.motion)
    assert isinstance(numbers, cs.DM)
    np.testing.assert_array_equal(kindyn.centroidal_momentum(*map(cs.DM, state.motion)), numbers)
    for kind in (cs.SX, cs.MX):
        symbols = [kind.sym(f"x{i}", *np.atleast_2d(value.T).T.shape) for i, value in enumerate(state.motion)]
        expression = kindyn.centroidal_momentum(*symbols)
        assert isinstance(expression, kind)
        np.testing.assert_array_equal(cs.Function("f", symbols, [expression])(*state.motion), numbers)
    mixed = kindyn.centroidal_momentum(state.H, cs.MX.sym("s", kindyn.NDoF), state.v, state.s_dot)
    assert isinstance(mixed, cs.MX)

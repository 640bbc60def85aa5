from __future__ import annotations

from dataclasses import replace

import casadi as cs
import numpy as np
import pytest

from multimodal_to.errors import InputError
from multimodal_to.models import contact
from multimodal_to.models.centroidal import momentum_rate, thrust_force
from multimodal_to.models.contact import FrictionCone
from multimodal_to.models.terrain import FlatGround, Plane


@pytest.mark.parametrize(("jet", "thrust"), [(0, 158.7), (2, 220.2)])
def test_full_throttle_settles_at_the_thrust_of_the_identified_model(ironcub, jet, thrust):
    model = ironcub.jets[jet].model
    value, rate, step = 10.0, 0.0, 0.01
    for _ in range(5000):
        rate += step * model.acceleration(value, rate, 100.0)
        value += step * rate
    assert value == pytest.approx(thrust, abs=0.1)
    assert rate == pytest.approx(0.0, abs=1e-3)


def test_an_idle_jet_needs_a_little_throttle(ironcub):
    model = ironcub.jets[0].model
    throttle = model.steady_throttle(0.0)
    assert throttle == pytest.approx(1.4, abs=0.05)
    assert model.acceleration(0.0, 0.0, throttle) == pytest.approx(0.0, abs=1e-12)


def test_the_jet_model_is_the_equation_of_the_paper(ironcub):
    m = ironcub.jets[2].model
    T, Td, u = 80.0, -12.0, 37.0
    f = m.K_T * T + m.K_TT * T**2 + m.K_D * Td + m.K_DD * Td**2 + m.K_TD * T * Td + m.c
    g = (m.B_U + m.B_T * T + m.B_D * Td) * (u + m.B_UU * u**2)
    assert m.acceleration(T, Td, u) == pytest.approx(f + g, rel=1e-14)


def test_a_thrust_that_no_throttle_holds_is_refused(ironcub):
    model = replace(ironcub.jets[0].model, B_UU=-10.0)
    with pytest.raises(InputError, match="no throttle holds a thrust of 300"):
        model.steady_throttle(300.0)


def test_the_friction_pyramid_is_negative_exactly_outside():
    ground, point = FlatGround(), np.zeros(3)
    for force, inside in (
        ([0.0, 0.0, 10.0], True),
        ([3.2, -3.2, 10.0], True),
        ([3.4, 0.0, 10.0], False),
        ([0.0, -3.4, 10.0], False),
        ([0.0, 0.0, -1.0], False),
    ):
        faces = np.array(contact.friction_pyramid(ground, cs.DM(point), cs.DM(force), 0.33))
        assert (faces.min() >= 0) == inside


def cone_margins(surface, point, force, friction):
    return tuple(
        float(cs.mmin(cs.DM(contact.FRICTION[cone](surface, cs.DM(point), cs.DM(force), friction))))
        for cone in (FrictionCone.PYRAMID, FrictionCone.SECOND_ORDER)
    )


@pytest.mark.parametrize("surface", [FlatGround(), Plane(slope=0.3, direction=(1.0, -0.4))])
def test_the_cone_lies_in_the_pyramid_and_holds_the_pyramid_of_a_smaller_friction(surface):
    """Four-sided and circumscribed: cone(μ) ⊂ pyramid(μ), and pyramid(μ / √2) ⊂ cone(μ)."""
    rng, point, friction = np.random.default_rng(2), np.array([0.1, 0.2, 0.3]), 0.33
    insides = np.zeros((2, 2), dtype=int)
    for force in 50 * rng.normal(size=(800, 3)) * [0.3, 0.3, 1.0]:
        pyramid, cone = cone_margins(surface, point, force, friction)
        small, _ = cone_margins(surface, point, force, friction / np.sqrt(2))
        assert cone < 0 or pyramid >= 0
        assert small < 0 or cone >= -1e-12
        insides[int(pyramid >= 0), int(cone >= 0)] += 1
    assert insides[1, 0] > 5  # in the corners of the pyramid
    assert insides[1, 1] > 50
    assert insides[0, 1] == 0


def test_the_cone_is_round_about_the_normal_and_lets_nothing_pull():
    plane, friction = Plane(slope=0.5, direction=(0.3, 1.0)), 0.4
    normal, tangents = np.array(plane.normal(np.zeros(3))).ravel(), np.array(plane.tangents(np.zeros(3)))
    for angle in np.linspace(0.0, 2 * np.pi, 13):
        along = tangents @ [np.cos(angle), np.sin(angle)]
        for load in (0.01, 1.0, 300.0):
            for share, sign in ((0.999, 1), (1.001, -1)):
                force = load * (normal + share * friction * along)
                assert sign * cone_margins(plane, np.zeros(3), force, friction)[1] > 0
                assert cone_margins(plane, np.zeros(3), -force, friction)[1] < 0


def test_complementarity_is_height_times_normal_force():
    ground = FlatGround(height=0.1)
    assert float(contact.complementarity(ground, cs.DM([1, 2, 0.3]), cs.DM([5, 6, 7]))) == pytest.approx(1.4)


def test_sliding_is_tangential_motion_times_normal_force():
    product = contact.sliding(FlatGround(), cs.DM([0, 0, 0]), cs.DM([1, 1, 20]), cs.DM([0.01, -0.02, 0.5]))
    assert np.array(product).ravel() == pytest.approx([0.2, -0.4])


def test_normal_and_tangents_of_the_ground_are_orthonormal():
    ground, point = FlatGround(height=0.2), cs.DM([0.3, -1.0, 0.5])
    frame = np.hstack([np.array(ground.tangents(point)), np.array(ground.normal(point))])
    assert frame.T @ frame == pytest.approx(np.eye(3))
    assert float(ground.distance(point)) == pytest.approx(0.3)


def test_thrust_pushes_along_minus_z_of_its_frame():
    rotation = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    assert np.array(thrust_force(cs.DM(rotation), 50.0)).ravel() == pytest.approx([-50.0, 0.0, 0.0])


def test_the_momentum_rate_is_the_derivative_of_the_momentum(ironcub):
    """Forces at contacts and jets, through forward dynamics of the whole robot, change h as the model says."""
    rng, kindyn, n = np.random.default_rng(3), ironcub.kindyn, 23
    transform, s = np.eye(4), ironcub.home.joint_positions
    transform[:3, 3] = ironcub.home.base_position
    twist, s_dot, torques = rng.normal(size=6), rng.normal(size=n), rng.normal(size=n)
    frames = [*ironcub.contact_names, *(jet.frame for jet in ironcub.jets)]
    forces = {frame: 20 * rng.normal(size=3) for frame in frames}
    pairs = []
    for frame, force in forces.items():
        point = np.array(kindyn.forward_kinematics(frame, transform, s))[:3, 3]
        pairs.append((cs.DM(point), cs.DM(force)))
    wrenches = {frame: np.concatenate([force, np.zeros(3)]) for frame, force in forces.items()}
    acceleration = np.array(kindyn.aba(transform, s, twist, s_dot, torques, wrenches)).ravel()
    com = kindyn.CoM_position(transform, s)
    linear, angular = momentum_rate(ironcub.mass, cs.DM(ironcub.gravity), com, pairs)
    expected = np.array(cs.evalf(cs.vertcat(linear, angular))).ravel()

    def momentum(step):
        turn = np.eye(3) + np.array(cs.skew(cs.DM(twist[3:]))) * step
        moved = np.eye(4)
        moved[:3, :3] = turn @ transform[:3, :3]
        moved[:3, 3] = transform[:3, 3] + step * twist[:3]
        velocity = np.concatenate([twist, s_dot]) + step * acceleration
        return np.array(kindyn.centroidal_momentum(moved, s + step * s_dot, velocity[:6], velocity[6:])).ravel()

    derivative = (momentum(1e-6) - momentum(-1e-6)) / 2e-6
    assert derivative == pytest.approx(expected, rel=1e-6, abs=1e-5)

"""Surfaces: distance, normal and tangents against geometry, finite differences and a peer's spline."""

from __future__ import annotations

import math

import casadi as cs
import numpy as np
import pytest

from multimodal_to.errors import InputError
from multimodal_to.models import bspline
from multimodal_to.models.terrain import (
    CachedSurface,
    FlatGround,
    HeightField,
    Plane,
    Stairs,
    frame,
    frame_function,
    heights_below,
    uphill,
)

RNG = np.random.default_rng(11)
SURFACES = {
    "flat": FlatGround(height=0.1),
    "plane": Plane(slope=0.4, direction=(-1.0, 2.0), height=-0.2),
    "stairs": Stairs(edges=(0.1, 0.5), heights=(0.0, 0.12, 0.3), direction=(-1.0, 0.3), width=0.3),
    "height field": HeightField.sampled(
        lambda x, y: 0.2 * math.sin(2 * x) * math.cos(3 * y), x_range=(-1.5, 1.5), y_range=(-1.2, 1.2), spacing=0.2
    ),
}


@pytest.fixture(params=SURFACES, ids=list(SURFACES))
def surface(request):
    return SURFACES[request.param]


def sphere(radius=1.0, count=60):
    directions = RNG.normal(size=(3, count))
    return radius * directions / np.linalg.norm(directions, axis=0)


def frames(surface, points):
    """d (count,), n (3, count) and t (count, 3, 2) at points (3, count)."""
    d, n, t = (np.array(part) for part in frame_function(surface).map(points.shape[1])(points))
    return d.ravel(), n, t.reshape(3, -1, 2).transpose(1, 0, 2)


def test_normal_and_tangents_are_a_right_handed_orthonormal_frame_that_looks_up(surface):
    _, normals, tangents = frames(surface, sphere())
    for n, t in zip(normals.T, tangents, strict=True):
        axes = np.column_stack([t, n])
        assert axes.T @ axes == pytest.approx(np.eye(3), abs=1e-12)
        assert np.linalg.det(axes) == pytest.approx(1.0)
        assert n[2] > 0


def test_a_point_on_the_surface_has_no_distance_and_one_moved_along_the_normal_that_far(surface):
    points = sphere()
    points[2] = heights_below(surface, points)
    distances, normals, _ = frames(surface, points)
    assert distances == pytest.approx(np.zeros(60), abs=1e-14)
    step = 1e-5
    for sign in (-1, 1):
        moved, _, _ = frames(surface, points + sign * step * normals)
        assert moved == pytest.approx(np.full(60, sign * step), abs=1e-8)


def test_on_the_surface_the_gradient_of_the_distance_is_the_normal(surface):
    points = sphere()
    points[2] = heights_below(surface, points)
    _, normals, _ = frames(surface, points)
    p = cs.SX.sym("p", 3)
    gradient = cs.Function("gradient", [p], [cs.gradient(cs.SX(surface.distance(p)), p)]).map(60)
    assert np.array(gradient(points)) == pytest.approx(normals, abs=1e-12)


def test_first_and_second_derivatives_match_finite_differences(surface):
    p = cs.SX.sym("p", 3)
    stacked = cs.vertcat(*(cs.vec(cs.SX(part)) for part in frame(surface, p)))
    weighted = cs.dot(cs.DM(RNG.normal(size=stacked.shape[0])), stacked)
    gradient = cs.gradient(weighted, p)
    value, slope, bend = (cs.Function("f", [p], [part]) for part in (weighted, gradient, cs.jacobian(gradient, p)))
    for point in sphere(count=20).T:
        for axis in np.eye(3):
            across = 1e-6 * axis
            difference = float(value(point + across) - value(point - across)) / 2e-6
            assert difference == pytest.approx(float(axis @ np.array(slope(point))[:, 0]), abs=2e-7)
            difference = np.array(slope(point + across) - slope(point - across)).ravel() / 2e-6
            assert difference == pytest.approx(np.array(bend(point)) @ axis, rel=1e-4, abs=5e-5)


def test_the_distance_to_a_plane_is_exact():
    plane, points = SURFACES["plane"], sphere(3.0)
    rise = 0.4 * np.array([-1.0, 2.0]) / math.sqrt(5)
    normal = np.array([-rise[0], -rise[1], 1.0]) / math.sqrt(1 + 0.16)
    distances, normals, _ = frames(plane, points)
    assert distances == pytest.approx(normal @ (points - np.array([[0.0], [0.0], [-0.2]])))
    assert normals == pytest.approx(np.tile(normal[:, None], 60))


def test_a_plane_without_slope_is_flat_ground():
    points = sphere()
    for one, other in zip(
        frames(Plane(slope=0.0, height=0.1), points), frames(FlatGround(height=0.1), points), strict=True
    ):
        assert one == pytest.approx(other)


def test_treads_are_exactly_flat_and_at_their_heights_and_risers_are_half_way_at_their_edges():
    stairs = Stairs(edges=(0.3, 0.7), heights=(0.0, 0.1, 0.05), direction=(-2.0, 0.0), width=0.04)
    ahead = np.array([-1.0, 0.0, 0.27, 0.3, 0.33, 0.67, 0.7, 0.73, 2.0])
    points = np.vstack([-ahead, np.ones(9), np.ones(9)])
    assert heights_below(stairs, points) == pytest.approx([0, 0, 0, 0.05, 0.1, 0.1, 0.075, 0.05, 0.05])
    _, normals, _ = frames(stairs, points[:, [0, 1, 2, 4, 5, 7, 8]])
    assert np.array_equal(np.abs(normals), np.tile([[0.0], [0.0], [1.0]], 7))


def test_the_spline_reproduces_cubic_polynomials_between_its_nodes():
    def cubic(x, y):
        return (x**3 - 2 * x**2 + x - 0.3) * (0.5 * y**3 + y - 1.0)

    field = HeightField.sampled(cubic, x_range=(-1.0, 2.0), y_range=(-1.5, 0.5), spacing=0.4)
    points = np.vstack([RNG.uniform(-1, 2, 200), RNG.uniform(-1.5, 0.5, 200), np.zeros(200)])
    assert heights_below(field, points) == pytest.approx(cubic(points[0], points[1]), abs=1e-12)


def test_the_spline_goes_through_its_nodes_and_agrees_with_casadis():
    values = RNG.normal(size=(7, 6))
    c = bspline.coefficients(values)
    nodes = [(float(bspline.evaluate(c, cs.DM(i), cs.DM(j))[0]), values[i, j]) for i in range(7) for j in range(6)]
    assert [got for got, _ in nodes] == pytest.approx([wanted for _, wanted in nodes], abs=1e-12)
    peer = cs.interpolant("peer", "bspline", [list(range(7)), list(range(6))], values.ravel(order="F"))
    for u, v in RNG.uniform([0, 0], [6, 5], size=(100, 2)):
        height, *slopes = (float(part) for part in bspline.evaluate(c, cs.DM(u), cs.DM(v)))
        assert height == pytest.approx(float(peer([u, v])), abs=1e-10)
        assert slopes == pytest.approx(np.array(peer.jacobian()([u, v], 0)).ravel(), abs=1e-9)


def test_beyond_its_grid_a_height_field_goes_on_with_the_slope_of_its_edge():
    field = HeightField.sampled(lambda x, y: x**2 + y, x_range=(-1.0, 1.0), y_range=(-1.0, 1.0), spacing=0.5)
    points = np.array([[1.0, 1.5, 3.0, -2.0, 0.0], [0.0, 0.0, 0.0, 0.0, 4.0], [0.0] * 5])
    assert heights_below(field, points) == pytest.approx([1.0, 2.0, 5.0, 3.0, 4.0], abs=1e-12)


def test_a_height_field_costs_the_operations_that_it_says_and_its_derivatives_none_of_them_again():
    def operations(nodes):
        ramp = np.add.outer(RNG.normal(size=nodes), RNG.normal(size=nodes))
        field = HeightField(x_range=(0.0, 1.0), y_range=(0.0, 1.0), heights=tuple(map(tuple, ramp)))
        p = cs.SX.sym("p", 3)
        height, *_ = field.height_and_slopes(p[0], p[1])
        functions = [height, cs.hessian(height, p)[0]]
        return [cs.Function("f", [p], [cs.cse(cs.densify(part))]).n_nodes() for part in functions]

    few, many = operations(10), operations(20)
    assert many[0] - few[0] < 11 * (20**2 - 10**2)
    assert abs((many[1] - many[0]) - (few[1] - few[0])) < 50


def test_a_remembered_surface_says_the_same_and_asks_once():
    asked = []

    class Counted(Plane):
        def height_and_slopes(self, x, y):
            asked.append((x, y))
            return super().height_and_slopes(x, y)

    plane = Counted(slope=0.2)
    remembered, point = CachedSurface(plane), cs.DM([0.3, 0.2, 0.5])
    parts = [remembered.distance(point), remembered.normal(point), remembered.tangents(point)]
    assert len(asked) == 1
    for part, expected in zip(parts, frame(plane, point), strict=True):
        assert np.array_equal(np.array(part), np.array(expected))


@pytest.mark.parametrize(
    ("make", "sentence"),
    [
        (lambda: Plane(slope=math.inf), "slope of the surface has inf"),
        (lambda: Plane(slope=0.1, direction=(0.0, 0.0)), r"direction of the surface is \(0.0, 0.0\)"),
        (lambda: Stairs(edges=(0.1,), heights=(0.0,)), "1 edges and 1 heights; expected"),
        (lambda: Stairs(edges=(), heights=(0.0,)), "0 edges and 1 heights; expected"),
        (lambda: Stairs(edges=(0.1, 0.11), heights=(0.0, 0.1, 0.2)), "at least a ramp's width, 0.02 m"),
        (lambda: Stairs(edges=(0.2, 0.1), heights=(0.0, 0.1, 0.2)), "edges of the stairs are"),
        (lambda: Stairs(edges=(0.2,), heights=(0.0, 0.1), width=0.0), "expected a positive number"),
        (lambda: HeightField(x_range=(0, 1), y_range=(0, 1), heights=((0.0,) * 4,) * 3), "at least 4 by 4"),
        (lambda: HeightField(x_range=(1, 1), y_range=(0, 1), heights=((0.0,) * 4,) * 4), "x_range of the height field"),
        (lambda: HeightField(x_range=(0, 1), y_range=(0, 1), heights=((0.0,) * 4, (0.0,) * 5)), "rows of one length"),
        (
            lambda: HeightField.sampled(lambda x, y: math.nan, x_range=(0, 1), y_range=(0, 1), spacing=0.5),
            "heights of the surface has nan",
        ),
        (
            lambda: HeightField.sampled(lambda x, y: 0.0, x_range=(0, 1), y_range=(0, 1), spacing=0.0),
            "spacing is 0.0 m; expected a positive number",
        ),
    ],
)
def test_surfaces_that_cannot_be_are_refused(make, sentence):
    with pytest.raises(InputError, match=sentence):
        make()


@pytest.mark.parametrize(
    ("surface", "way"),
    [
        (Plane(slope=0.3, direction=(1.0, 1.0)), (0.5**0.5, 0.5**0.5)),
        (Plane(slope=-0.3, direction=(0.0, 2.0)), (0.0, -1.0)),
        (Stairs(edges=(0.0, 0.5), heights=(0.0, 0.1, 0.2), direction=(-1.0, 0.0)), (-1.0, 0.0)),
        (Stairs(edges=(0.0,), heights=(0.2, 0.0)), (-1.0, 0.0)),
    ],
)
def test_the_ground_rises_uphill_and_stays_the_same_across(surface, way):
    x, y = uphill(surface)
    assert (x, y) == pytest.approx(way)
    start = np.array([[-1.0 * x], [-1.0 * y], [0.0]])
    above, across = np.array([[2.0 * x], [2.0 * y], [0.0]]), np.array([[-3.0 * y], [3.0 * x], [0.0]])
    low, high, same = (heights_below(surface, start + moved)[0] for moved in (np.zeros((3, 1)), above, across))
    assert high > low
    assert same == pytest.approx(low)


def test_a_height_field_has_no_way_that_alone_changes_its_height():
    field = HeightField.sampled(lambda x, y: x * y, x_range=(0.0, 1.0), y_range=(0.0, 1.0), spacing=0.3)
    assert uphill(field) is None
    assert uphill(FlatGround()) is None

"""Outer approximations contain what they replace, and say how far they reach."""

import time
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from scipy.spatial import ConvexHull

from certifier.scene import shapes
from certifier.scene.hull import contains, hull_vertices, outer


def in_a_tetrahedron(point, vertices):
    """Whether a point is exactly in a tetrahedron between the vertices' mean and three of them: an oracle in rational numbers."""
    exact = [[Fraction(x) for x in v] for v in vertices.tolist()]
    mean = [sum(column) / len(exact) for column in zip(*exact, strict=True)]
    p = [Fraction(x) - m for x, m in zip(point.tolist(), mean, strict=True)]
    for triangle in ConvexHull(vertices).simplices:
        a, b, c = ([x - m for x, m in zip(exact[k], mean, strict=True)] for k in triangle)
        whole = determinant(a, b, c)
        weights = [determinant(*rows) / whole for rows in ((p, b, c), (a, p, c), (a, b, p))] if whole else [Fraction(-1)]
        if min(weights) >= 0 and sum(weights) <= 1:
            return True
    return False


def determinant(a, b, c):
    return a[0] * (b[1] * c[2] - b[2] * c[1]) - a[1] * (b[0] * c[2] - b[2] * c[0]) + a[2] * (b[0] * c[1] - b[1] * c[0])


@st.composite
def clouds(draw):
    """Point clouds of many kinds: balls, rods, plates, flat discs, lattices with repeated and coplanar points; far from the origin too."""
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    count = draw(st.integers(4, 300))
    kind = draw(st.sampled_from(["ball", "sphere", "lattice", "cylinder"]))
    if kind == "ball":
        points = rng.standard_normal((count, 3))
    elif kind == "sphere":
        points = rng.standard_normal((count, 3))
        points /= np.linalg.norm(points, axis=1, keepdims=True)
    elif kind == "lattice":
        points = rng.integers(-3, 4, (count, 3)).astype(float)
    else:
        angle = 2 * np.pi * np.arange(count) / count
        points = np.concatenate([np.column_stack([np.cos(angle), np.sin(angle), np.full(count, z)]) for z in (-1.0, 1.0)])
    size = draw(st.sampled_from([0.001, 0.1, 1.0, 10.0]))
    thinness = draw(st.sampled_from([1.0, 0.1, 1e-3, 1e-6, 0.0]))
    rotation = np.linalg.qr(rng.standard_normal((3, 3)))[0]
    points = size * (points * np.array([1.0, 0.7, thinness])) @ rotation.T
    return points + draw(st.sampled_from([0.0, 5.0])) * rng.standard_normal(3)


@settings(max_examples=60, deadline=None)
@given(clouds(), st.integers(8, 40))
def test_outer_contains_every_point_and_knows_its_inflation(points, max_vertices):
    vertices, inflation, _ = outer(points, max_vertices)
    if inflation == 0:
        original = {tuple(p) for p in points}
        assert all(tuple(v) in original for v in vertices)
        return
    assert len(vertices) <= max_vertices
    assert contains(vertices, points)
    extreme = hull_vertices(points)
    for p in extreme[:: max(1, len(extreme) // 10)]:
        assert in_a_tetrahedron(p, vertices)
    center = extreme.mean(axis=0)
    directions = np.random.default_rng(0).standard_normal((500, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    gap = ((vertices - center) @ directions.T).max(axis=0) - ((extreme - center) @ directions.T).max(axis=0)
    assert gap.max() <= inflation + 1e-12
    assert inflation <= 2 * np.ptp(extreme, axis=0).max() + 1e-5


def test_few_vertices_are_kept_as_they_are():
    vertices, inflation, count = outer(np.concatenate([shapes.CORNERS, 0.5 * shapes.CORNERS, shapes.CORNERS]), 32)
    assert (inflation, count) == (0.0, 8)
    assert sorted(map(tuple, vertices)) == sorted(map(tuple, shapes.CORNERS))


@settings(max_examples=15, deadline=None)
@given(st.integers(0, 2**32 - 1), st.sampled_from([0.01, 1.0]), st.sampled_from([0.0, 5.0]), st.sampled_from([1.0, 0.01]))
@example(0, 1.0, 0.0, 1.0)
def test_no_point_is_outside_by_a_rounding_error(seed, size, offset, thinness):
    """The points of a turned box's faces are up to some 1e-16 outside of its corners' hull."""
    rng = np.random.default_rng(seed)
    grid = np.stack(np.meshgrid(*[[-1.0, -0.3, 1.0]] * 3), axis=-1).reshape(-1, 3)
    points = size * (grid * [1, 0.7, thinness]) @ np.linalg.qr(rng.standard_normal((3, 3)))[0].T + offset
    vertices, inflation, _ = outer(points, 32)
    own = {tuple(v) for v in vertices.tolist()}
    assert all(tuple(p) in own or in_a_tetrahedron(p, vertices) for p in points)
    assert inflation < 1e-7 * size
    if inflation > 0:
        assert shapes.polytope({"kind": "convex"}, points, np.zeros((0, 3), dtype=np.int64), 32).substitution is not None
        for v in vertices:
            assert np.linalg.norm(points - v, axis=1).min() <= inflation


def test_more_vertices_fit_closer():
    points = np.random.default_rng(1).standard_normal((400, 3))
    points /= np.linalg.norm(points, axis=1, keepdims=True)
    volumes = [ConvexHull(outer(points, k)[0]).volume for k in (8, 16, 32, 64)]
    assert volumes == sorted(volumes, reverse=True)
    assert volumes[-1] < 1.2 * ConvexHull(points).volume


@settings(max_examples=40, deadline=None)
@given(st.floats(0.001, 2), st.floats(0.001, 2), st.integers(3, 24))
@example(0.05, 0.3, 3)
def test_a_prism_is_circumscribed_about_its_cylinder(radius, length, sides):
    body = shapes.cylinder(radius, length, sides)
    angle = np.linspace(0, 2 * np.pi, 361)
    rim = np.concatenate(
        [np.column_stack([radius * np.cos(angle), radius * np.sin(angle), np.full(361, z)]) for z in (-length / 2, length / 2)]
    )
    assert len(body.vertices) == 2 * sides
    assert contains(body.vertices, rim, 1e-12)
    assert body.inflation == pytest.approx(np.linalg.norm(body.vertices[:, :2], axis=1).max() - radius)


@settings(max_examples=40, deadline=None)
@given(st.tuples(*[st.floats(0.01, 1)] * 3), st.integers(8, 60))
def test_a_polytope_is_circumscribed_about_its_ellipsoid(semi_axes, count):
    body = shapes.ellipsoid(semi_axes, count)
    u = np.random.default_rng(0).standard_normal((500, 3))
    surface = u / np.linalg.norm(u, axis=1, keepdims=True) * np.array(semi_axes)
    assert len(body.vertices) == count
    assert contains(body.vertices, surface, 1e-12)
    for v in body.vertices:
        inside = v / np.linalg.norm(v / np.array(semi_axes))
        assert np.linalg.norm(v - inside) <= body.inflation + 1e-12


@given(st.tuples(*[st.floats(-2, 2)] * 3), st.floats(0.1, 3))
def test_a_half_space_within_reach_is_a_box(center, reach):
    center = np.array(center)
    body = shapes.half_space(center, reach)
    u = np.random.default_rng(0).standard_normal((2000, 3))
    ball = center + reach * u / np.linalg.norm(u, axis=1, keepdims=True) * np.random.default_rng(1).uniform(0, 1, (2000, 1))
    below = ball[ball[:, 2] <= 0]
    assert np.all(below >= body.vertices.min(axis=0) - 1e-12)
    assert np.all(below <= body.vertices.max(axis=0) + 1e-12)
    assert body.vertices[:, 2].max() == 0.0


def test_the_time_for_a_mesh_grows_no_faster_than_its_size():
    """Meshes are the worst of their kind: all points on the hull, or every triangle as near as any other."""

    def round_mesh(size):
        points = shapes._spread(size)
        return points, ConvexHull(points).simplices.astype(np.int64)

    def crossing_mesh(size):
        return np.vstack([np.zeros(3), np.eye(3)]), np.tile([[0, 1, 2], [0, 1, 3], [0, 2, 3], [1, 2, 3]], (20 * size // 4, 1))

    def seconds(mesh):
        began = time.process_time()
        shapes.polytope({"kind": "mesh"}, *mesh, 32)
        return time.process_time() - began

    for kind, size in ((round_mesh, 5_000), (crossing_mesh, 1_000)):
        first, _, last = (seconds(kind(n * size)) for n in (1, 2, 4))
        assert last < 10 * first, "four times the size; a quadratic cost would be 16 times"

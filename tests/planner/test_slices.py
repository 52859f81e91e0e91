"""Slices of polytopes, against one inequality at a time."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from planner.slices import outline_in_q, slice_points, slice_polygon
from tests.certifier.scenes import planar_arm
from tests.planner.regions import cut_box, library


def inside_polygon(corners, points):
    """Whether each of the points (k, 2) is inside a convex polygon whose corners are anticlockwise."""
    edges = np.roll(corners, -1, axis=0) - corners
    to = points[:, None] - corners
    return (edges[:, 0] * to[:, :, 1] - edges[:, 1] * to[:, :, 0] >= 0).all(axis=1)


@given(seed=st.integers(0, 2**32 - 1), n=st.integers(2, 5), faces=st.integers(0, 30))
def test_a_slice_holds_what_the_region_holds(seed, n, faces):
    rng = np.random.default_rng(seed)
    polytope = library(cut_box(rng, "region", n, faces)).polytope(0)
    s, axes = rng.uniform(-1, 1, n), tuple(rng.permutation(n)[:2].tolist())
    lower, upper = np.full(2, -1.2), np.full(2, 0.9)
    corners = slice_polygon(polytope, s, axes, lower, upper)
    points = np.tile(s, (300, 1))
    points[:, axes] = rng.uniform(-1.5, 1.5, (300, 2))
    slack = (polytope.d - points @ polytope.C.T).min(axis=1)
    within = ((points[:, axes] >= lower) & (points[:, axes] <= upper)).all(axis=1)
    clear = np.abs(slack) > 1e-9
    expected = (slack >= 0) & within
    found = inside_polygon(corners, points[:, axes]) if len(corners) else np.zeros(300, dtype=bool)
    assert np.array_equal(found[clear], expected[clear])


def test_a_region_that_the_slice_misses_has_no_corners():
    polytope = library(cut_box(np.random.default_rng(0), "region", 3, 0, spread=0.0)).polytope(0)
    s = np.array([0.0, 0.0, 5.0])
    assert slice_polygon(polytope, s, (0, 1), np.full(2, -2.0), np.full(2, 2.0)).shape == (0, 2)
    assert len(slice_polygon(polytope, np.zeros(3), (0, 1), np.full(2, -2.0), np.full(2, 2.0))) == 4


def test_an_outline_in_q_is_the_outline_in_s():
    scene = planar_arm()
    corners = np.array([[-0.5, -0.2], [0.6, -0.3], [0.4, 0.7]])
    outline = outline_in_q(scene, corners, (1, 0))
    back = np.tan(outline / 2)
    edges = np.roll(corners, -1, axis=0) - corners
    for corner, edge, points in zip(corners, edges, back.reshape(3, -1, 2), strict=True):
        to = points - corner
        assert np.abs(edge[0] * to[:, 1] - edge[1] * to[:, 0]).max() < 1e-12
    assert np.allclose(outline[::12], 2 * np.arctan(corners))


def test_the_points_of_a_slice_lie_in_the_middle_of_its_squares():
    points = slice_points(np.array([7.0, 8.0, 9.0]), (2, 0), np.array([0.0, -1.0]), np.array([1.0, 1.0]), 2)
    assert points.tolist() == [[-0.5, 8.0, 0.25], [-0.5, 8.0, 0.75], [0.5, 8.0, 0.25], [0.5, 8.0, 0.75]]

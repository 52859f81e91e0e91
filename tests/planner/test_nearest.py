"""The nearest region and its nearest point, against a general solver and by the conditions that only the nearest point satisfies."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import linprog

from planner.library import Library
from planner.nearest import INWARDS, between, nearest, project
from tests.planner.regions import box, cut_boxes, library

SEEDS = st.integers(0, 2**32 - 1)


@given(seed=SEEDS, n=st.integers(1, 7), scale=st.sampled_from([1e-3, 1.0, 1e3]))
def test_the_projection_is_the_point_with_the_distance_in_the_cone_of_its_faces(seed: int, n: int, scale: float) -> None:
    """For a convex set, y is nearest to s if and only if (s - y)'(x - y) <= 0 for every x of the set."""
    rng = np.random.default_rng(seed)
    stored, s = cut_boxes(rng, n, 1, faces=20), scale * rng.normal(size=n)
    faces, norms = stored.faces, stored.norms
    C, d = faces[:, :-1] / norms[:, None], faces[:, -1] / norms
    y = project(C, d, s)
    assert y is not None
    assert (C @ y <= d).all()
    way = s - y
    farthest = linprog(-way, A_ub=C, b_ub=d, bounds=(None, None)).x
    assert way @ (farthest - y) <= 1e-6 * (1 + np.linalg.norm(way))


@given(seed=SEEDS, n=st.integers(1, 4), count=st.integers(1, 20))
def test_no_region_is_nearer_than_the_nearest(seed: int, n: int, count: int) -> None:
    rng = np.random.default_rng(seed)
    stored, s = cut_boxes(rng, n, count), rng.uniform(-3, 3, n)
    found = nearest(stored, s)
    assert found is not None
    assert found.distance == pytest.approx(np.linalg.norm(found.s - s))
    assert stored.polytope(found.region).contains(found.s)
    for region in range(count):
        polytope = stored.polytope(region)
        norms = np.linalg.norm(polytope.C, axis=1)
        point = project(polytope.C / norms[:, None], polytope.d / norms, s)
        assert point is not None
        assert found.distance <= np.linalg.norm(point - s) + 1e-9


def test_a_point_inside_is_its_own_nearest_point_and_corners_are_found() -> None:
    stored = library(box("a", [0, 0], [1, 1]), box("b", [2, 0], [3, 1]))
    inside, corner = nearest(stored, np.array([0.5, 1.0])), nearest(stored, np.array([1.25, 2.0]))
    assert inside is not None
    assert corner is not None
    assert (inside.region, inside.s.tolist(), inside.distance) == (0, [0.5, 1.0], 0.0)
    assert (corner.region, corner.distance) == (0, pytest.approx(np.hypot(0.25, 1.0), abs=2 * INWARDS))
    np.testing.assert_allclose(corner.s, [1.0, 1.0], atol=2 * INWARDS)


def test_regions_may_be_left_out() -> None:
    stored = library(box("a", [0, 0], [1, 1]), box("b", [2, 0], [3, 1]))
    found = nearest(stored, np.array([0.5, 0.5]), without=[0])
    assert found is not None
    assert (found.region, found.distance) == (1, pytest.approx(1.5))
    assert nearest(stored, np.array([0.5, 0.5]), without=[0, 1]) is None
    assert nearest(Library(2), np.zeros(2)) is None


def test_an_empty_polytope_has_no_nearest_point() -> None:
    assert project(np.array([[1.0], [-1.0]]), np.array([0.0, -1e-3]), np.array([5.0])) is None


def test_two_regions_are_as_near_as_their_nearest_points() -> None:
    stored = library(box("a", [0, 0], [1, 1]), box("b", [2, 3], [3, 4]), box("c", [0.5, 0.5], [3, 1]))
    x, y = between(stored, 0, 1)
    np.testing.assert_allclose([x, y], [[1, 1], [2, 3]], atol=1e-6)
    x, y = between(stored, 0, 2)
    assert np.linalg.norm(x - y) <= 1e-6

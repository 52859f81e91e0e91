"""The simplex method against HiGHS, on polytopes with corners where many faces meet, repeated, nearly parallel and badly scaled faces."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import linprog

from certifier.model import Polytope
from certifier.polytopes.simplex import WORK, corner, deepest, maximise


@st.composite
def programs(draw):
    """A, b, directions, a point inside or on the faces, and the size of the polytope."""
    rng = np.random.default_rng(draw(st.integers(0, 2**32)))
    n, m = draw(st.integers(1, 8)), draw(st.integers(0, 40))
    kind = draw(st.sampled_from(["random", "integer", "scaled", "parallel"]))
    size, start = 10.0 ** draw(st.floats(-4, 2)), rng.normal(size=n)
    A, reach, limits = rng.normal(size=(m, n)), rng.uniform(0, 2, m), rng.uniform(0.5, 3, 2 * n)
    if kind == "integer":
        A, reach, limits = np.rint(A), np.rint(reach), np.ones(2 * n)
    elif kind == "scaled":
        A *= 10.0 ** rng.uniform(-3, 3, (m, 1))
    elif kind == "parallel":
        A[m // 2 :] = A[: m - m // 2] + 1e-8 * rng.normal(size=(m - m // 2, n))
    A = np.concatenate([A, np.eye(n), -np.eye(n)])
    b = A @ start + size * np.concatenate([reach, limits]) * np.linalg.norm(A, axis=1)
    return A, b, np.concatenate([np.eye(n), -np.eye(n), rng.normal(size=(2, n)), A[:3]]), start, size


@settings(max_examples=60, deadline=None)
@given(programs())
def test_maximisers_are_feasible_and_as_good_as_the_multipliers_say(program):
    A, b, directions, start, size = program
    points, Y = maximise(A, b, directions, start)
    lengths = np.maximum(np.linalg.norm(directions, axis=1), 1e-300)
    assert ((points @ A.T - b) <= 1e-9 * size * np.linalg.norm(A, axis=1) + 1e-14).all()
    assert (Y >= 0).all()
    np.testing.assert_allclose(Y @ A, directions, atol=1e-8 * max(1, lengths.max()))
    np.testing.assert_allclose(np.einsum("ki,ki->k", directions, points), Y @ b, rtol=1e-9, atol=1e-6 * size * max(1, lengths.max()))
    # HiGHS has absolute tolerances.
    norms = np.where(A.any(axis=1), np.linalg.norm(A, axis=1), 1.0)
    rows, offsets = A / norms[:, None], (b - A @ start) / norms / size
    for c, point in list(zip(directions / lengths[:, None], (points - start) / size, strict=True))[:: len(directions) // 3]:
        value = -linprog(-c, rows, offsets, bounds=(None, None), method="highs-ds").fun
        assert c @ point == pytest.approx(value, rel=1e-6, abs=1e-6)


def test_a_corner_where_every_face_meets():
    """All rows go through the maximiser, as at the tip of a pyramid: most steps have no length."""
    rng = np.random.default_rng(0)
    A = rng.normal(size=(60, 5))
    A[:, 0] = np.abs(A[:, 0]) + 0.1
    A, b = np.concatenate([A, np.eye(5), -np.eye(5)]), np.concatenate([np.zeros(60), np.ones(10)])
    points, _ = maximise(A, b, np.eye(5)[:1], np.array([-0.9, 0, 0, 0, 0]) * 1e-3)
    np.testing.assert_allclose(points[0], 0, atol=1e-12)


@pytest.mark.parametrize(
    "A",
    [
        [[1.0, 0], [0, 1], [0, -1]],
        [[1.0, -1], [-1, 1]],
        [[0.0, 0]],
    ],
)
def test_a_direction_without_a_largest_value_is_refused(A):
    with pytest.raises(np.linalg.LinAlgError):
        maximise(np.array(A), np.ones(len(A)), np.array([[-1.0, -1]]), np.zeros(2))


def unit(A, b):
    lengths = np.linalg.norm(A, axis=1)
    return Polytope(A / lengths[:, None], b / lengths)


@given(programs(), st.floats(0.0, 5.0))
def test_the_deepest_point_is_that_of_highs_and_the_twin_without_points_is_told_by_multipliers(program, apart):
    A, b, _, start, size = program
    kept = np.linalg.norm(A, axis=1) > 0
    polytope = unit(A[kept], b[kept])
    m, n = polytope.C.shape
    # Two opposite faces are moved past each other; at 0 they are where they were.
    moved = Polytope(polytope.C, polytope.d - np.where(np.arange(m) >= m - 2 * n, apart * size, 0.0))
    point, depth, y = deepest(moved.C, moved.d, start)
    found = linprog(
        np.append(np.zeros(n), -1.0), A_ub=np.column_stack([moved.C, np.ones(m)]), b_ub=moved.d, bounds=(None, None), method="highs"
    )
    scale = size + np.abs(start).max()
    assert depth == pytest.approx(-found.fun, abs=1e-6 * scale)
    assert (moved.d - moved.C @ point).min() == pytest.approx(depth, abs=1e-7 * scale)
    assert (y >= 0).all()
    assert np.abs(y @ moved.C).max() <= 1e-7
    assert y @ moved.d == pytest.approx(depth, abs=1e-7 * scale)


@given(programs())
def test_a_corner_is_the_same_from_every_vertex_that_the_search_begins_at(program):
    A, b, directions, start, size = program
    kept = np.linalg.norm(A, axis=1) > 0
    polytope = unit(A[kept], b[kept])
    n, columns, work = len(start), np.ascontiguousarray(polytope.C.T), np.empty((WORK, len(polytope.d)))
    basis, edges, way = np.full(n, -1), np.empty((n, n)), np.zeros(n)
    for direction in directions:
        assert corner(columns, polytope.d, start, direction, basis, edges, work, way)
        warm = direction @ way
        assert corner(columns, polytope.d, start, direction, np.full(n, -1), np.empty((n, n)), work, way)
        assert warm == pytest.approx(direction @ way, abs=1e-7 * size * max(np.linalg.norm(direction), 1e-9))

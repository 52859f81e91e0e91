"""Planes between moving points: Wolfe's algorithm against cone programs of Drake's, and against points that it cannot have seen apart."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from pydrake.solvers import ClarabelSolver, MathematicalProgram

from certifier.partition.separate import Support, separate
from certifier.partition.wolfe import weigh

LEAST, ENOUGH = 3e-4, 0.8


def widest(A, B, u, radius_a, radius_b):
    """1/|z| of the shortest z whose function is at least 1 + r |its normal there| on either side; 0 for none."""
    D = 4 * (u.shape[1] + 1)
    program = MathematicalProgram()
    z, lengths = program.NewContinuousVariables(D), program.NewContinuousVariables(len(u))
    for row, length, points_a, points_b in zip(np.column_stack([np.ones(len(u)), u]), lengths, A, B, strict=True):
        cone = np.zeros((4, D + 1))
        cone[0, -1] = 1.0
        cone[1:, : 3 * len(row)] = np.kron(np.eye(3), row)
        program.AddLorentzConeConstraint(cone, np.zeros(4), [*z, length])
        for points, radius, sign in ((points_a, radius_a, 1), (points_b, radius_b, -1)):
            homogeneous = np.column_stack([points, np.ones(len(points))])
            rows = np.column_stack([sign * np.kron(homogeneous, row), np.full(len(points), -radius)])
            program.AddLinearConstraint(rows, np.ones(len(rows)), np.full(len(rows), np.inf), [*z, length])
    program.AddQuadraticCost(np.eye(D), np.zeros(D), z, is_convex=True)
    result = ClarabelSolver().Solve(program)
    return 1 / np.linalg.norm(result.GetSolution(z)) if result.is_success() else 0.0


NONE = Support(np.empty(0, np.int64), np.empty(0, np.int64), np.empty(0))


def found_for(A, B, u, radius_a, radius_b, N=None, z=None, begun=NONE):
    """What is found for clouds (N, v, 3) at configurations (N, k), of which the first ones count, and the plane."""
    z = np.zeros(4 * (u.shape[1] + 1)) if z is None else z.copy()
    lanes = [np.ascontiguousarray(points.transpose(1, 2, 0)) for points in (A, B)]
    many = len(u) if N is None else N
    found, support = separate(*lanes, np.ascontiguousarray(u.T), radius_a, radius_b, np.ones(len(u)), many, LEAST, ENOUGH, z, begun)
    return found, z, support


def values(A, B, u, radius_a, radius_b, z):
    """The least of the plane's function on either side, the radius times the normal's length subtracted."""
    at = np.column_stack([np.ones(len(u)), u]) @ z.reshape(4, -1).T
    length = np.linalg.norm(at[:, :3], axis=1)[:, None]
    f_a = np.einsum("nvc,nc->nv", A, at[:, :3]) + at[:, 3:] - radius_a * length
    f_b = -np.einsum("nvc,nc->nv", B, at[:, :3]) - at[:, 3:] - radius_b * length
    return min(f_a.min(), f_b.min())


def moving_points(seed, k, apart, radius):
    """Two clouds that move with u, ``apart`` between their middles."""
    rng = np.random.default_rng(seed)
    u = rng.uniform(-1, 1, (20, k))
    drift = rng.normal(size=(k, 3)) * 0.3
    A, B = (rng.normal(size=(1, v, 3)) * 0.2 + (u @ (drift + rng.normal(size=(k, 3)) * 0.05))[:, None] for v in (4, 6))
    way = rng.normal(size=3)
    return A + apart * way / np.linalg.norm(way), B, u, *(radius * rng.random(2))


@settings(max_examples=60)
@given(st.integers(0, 2**32 - 1), st.integers(1, 3), st.floats(0.0, 1.5), st.sampled_from([0.0, 0.2]))
@example(778866, 1, 0.75, 0.2)
@example(778866, 2, 0.75, 0.2)
def test_a_plane_is_found_where_there_is_one_and_its_margin_is_nearly_the_widest(seed, k, apart, radius):
    A, B, u, radius_a, radius_b = moving_points(seed, k, apart, radius)
    best = widest(A, B, u, radius_a, radius_b)
    found, z, support = found_for(A, B, u, radius_a, radius_b)
    check_plane(A, B, u, radius_a, radius_b, best, found, z, support)
    # What the first configurations came to is where all of them begin.
    _, z, begun = found_for(A, B, u, radius_a, radius_b, N=7)
    found, z, support = found_for(A, B, u, radius_a, radius_b, z=z, begun=begun)
    check_plane(A, B, u, radius_a, radius_b, best, found, z, support)


def check_plane(A, B, u, radius_a, radius_b, best, found, z, support):
    assert len(support.rows) == len(support.vertices) == len(support.weights)
    assert (support.weights > 0).all()
    assert support.weights.sum() == pytest.approx(1)
    assert ((-B.shape[1] <= support.vertices) & (support.vertices < A.shape[1])).all()
    if radius_a == radius_b == 0:
        signed = [A[i, v] if v >= 0 else -B[i, -1 - v] for i, v in zip(support.rows, support.vertices, strict=True)]
        points = [
            np.outer(np.append(p, 1.0 if v >= 0 else -1.0), np.append(1.0, u[i])).ravel()
            for p, i, v in zip(signed, support.rows, support.vertices, strict=True)
        ]
        assert support.weights @ points == pytest.approx(z, abs=1e-9)
    if found:
        margin = values(A, B, u, radius_a, radius_b, z) / np.linalg.norm(z)
        assert margin >= (ENOUGH - 1e-6) * best
        assert 0 < margin <= best * (1 + 1e-4)
    else:
        assert best <= 1.1 * LEAST


def test_both_answers_occur_on_the_clouds_of_this_file():
    """Each answer on at least a third of them, so that neither branch of the test above is idle."""
    answers = []
    for seed in range(60):
        A, B, u, radius_a, radius_b = moving_points(seed, 2, [0.0, 1.5][seed % 2], 0.2)
        answers.append(found_for(A, B, u, radius_a, radius_b)[0])
    assert 20 <= sum(answers) <= 40


def test_only_the_first_configurations_count():
    """Apart from each other at the first ten configurations and in each other's places at the others."""
    A, B, u, *_ = moving_points(0, 1, 1.5, 0.0)
    A[10:], B[10:, :4] = B[10:, :4], A[10:]
    assert found_for(A, B, u, 0.0, 0.0, N=10)[0]
    found, _, support = found_for(A, B, u, 0.0, 0.0, N=15)
    assert not found
    assert set(support.rows.tolist()) <= set(range(15))


@settings(max_examples=60)
@given(st.integers(0, 2**32 - 1), st.integers(1, 6), st.integers(6, 8))
def test_weights_come_to_the_point_of_a_hull_that_is_nearest_to_0(seed, count, D):
    """The points are affinely independent, so the weights are unique; the plane through the point found supports the hull of those kept."""
    rng = np.random.default_rng(seed)
    points = rng.normal(size=(count, D)) + rng.normal(size=D)
    G, w, rows = points @ points.T, np.zeros(count), np.arange(count)
    w[0] = 1.0
    kept = weigh(G.copy(), w, rows, count)
    assert 1 <= kept <= count
    assert (w[:kept] > 0).all()
    assert w[:kept].sum() == pytest.approx(1)
    x = w[:kept] @ points[rows[:kept]]
    assert points[rows[:kept]] @ x == pytest.approx(x @ x, rel=1e-6, abs=1e-9)
    assert np.linalg.norm(x) <= np.linalg.norm(points[0]) * (1 + 1e-9)


@pytest.mark.parametrize("seed", [236, 926, 958, 1708, *range(10)])
def test_a_plane_that_is_found_separates_at_all_configurations_far_out_too(seed):
    """Where doubles do not tell points apart any more, the search may end while it looks at a few configurations of many."""
    rng, k = np.random.default_rng(seed), 1 + seed % 5
    u, drift = rng.uniform(-0.3, 0.3, (120, k)), rng.normal(size=(k, 3)) * 0.3
    A, B = (1e7 * (rng.normal(size=(1, v, 3)) * 0.2 + (u @ (drift + rng.normal(size=(k, 3)) * 0.05))[:, None]) for v in (4, 6))
    A, radii = A + np.array([3e6 * (seed % 3), 0, 0]), 2e6 * (seed % 2) * rng.random(2)
    found, z, _ = found_for(A, B, u, *radii)
    assert not found or values(A, B, u, *radii, z) > 0

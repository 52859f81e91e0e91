"""The linear program of a face, against HiGHS, which solves its primal form."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import linprog

from certifier.polytopes.hinge import hinge_face

MARGIN = 0.1


def loss(face, rest):
    x, offset = face
    return float(np.maximum(rest @ x - offset + MARGIN, 0).sum())


def of_highs(far, near, rest):
    """The face of the least loss by HiGHS, over x, the offset, and a slack for every other point; None where there is none."""
    k, h = far.shape[1], len(rest)
    rows = np.concatenate(
        [
            np.column_stack([-far, np.ones(len(far)), np.zeros((len(far), h))]),
            np.column_stack([near, -np.ones(len(near)), np.zeros((len(near), h))]),
            np.column_stack([rest, -np.ones(h), -np.eye(h)]),
        ]
    )
    most = np.concatenate([np.zeros(len(far)), -np.ones(len(near)), np.full(h, -MARGIN)])
    costs = np.concatenate([np.zeros(k + 1), np.ones(h)])
    found = linprog(costs, A_ub=rows, b_ub=most, bounds=[(None, None)] * (k + 1) + [(0, None)] * h, method="highs")
    assert found.status in (0, 2)
    return (found.x[:k], float(found.x[k])) if found.status == 0 else None


def points_of(rng, k, apart):
    """Points to cut off, to keep, and others, in k dimensions; a way goes from those to keep to the others by ``apart``."""
    way = rng.normal(size=k)
    way *= apart / np.linalg.norm(way)
    far = way + 0.2 * rng.normal(size=(rng.integers(1, 20), k))
    near = np.concatenate([np.zeros((1, k)), 0.2 * rng.normal(size=(rng.integers(0, 6), k))])
    return far, near, rng.normal(size=(rng.integers(1, 300), k))


@settings(max_examples=60)
@given(st.integers(0, 2**32 - 1), st.integers(1, 9), st.sampled_from([0.0, 0.3, 1.0, 3.0]))
def test_it_is_the_face_that_loses_least(seed, k, apart):
    far, near, rest = points_of(np.random.default_rng(seed), k, apart)
    face, best = hinge_face(far, near, rest, MARGIN), of_highs(far, near, rest)
    assert (face is None) == (best is None)
    if face is not None and best is not None:
        x, offset = face
        size = np.linalg.norm(x)
        assert (far @ x - offset).min() > -1e-7 * (1 + size)
        assert (offset - 1 - near @ x).min() > -1e-7 * (1 + size)
        assert abs(loss(face, rest) - loss(best, rest)) < 1e-6 * (1 + loss(best, rest))


def test_points_that_no_plane_separates_have_no_face():
    rng = np.random.default_rng(0)
    near = rng.normal(size=(40, 3))
    inside = near[:5].mean(axis=0, keepdims=True)
    assert of_highs(inside, near, near) is None
    assert hinge_face(inside, near, near, MARGIN) is None
    assert hinge_face(near[:1], near[:1], rng.normal(size=(9, 3)), MARGIN) is None, "a point is not beyond itself"


@settings(max_examples=20)
@given(st.integers(0, 2**32 - 1))
def test_points_that_are_there_twice_and_in_a_plane_do_no_harm(seed):
    rng = np.random.default_rng(seed)
    far, near, rest = points_of(rng, 4, 1.5)
    rest = np.concatenate([rest, rest, far, near, np.round(rest)])
    for some in (far, near, rest):
        some[:, 3] = 0.0
    face, best = hinge_face(far, near, rest, MARGIN), of_highs(far, near, rest)
    assert (face is None) == (best is None)
    if face is not None and best is not None:
        assert abs(loss(face, rest) - loss(best, rest)) < 1e-6 * (1 + loss(best, rest))

"""Gibbs sampling against distributions that are uniform in q by construction: intervals, boxes, and rejection sampling."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats

from certifier.coordinates import ConfigurationSpace
from certifier.errors import RegionError
from certifier.model import Polytope
from certifier.polytopes.gibbs import uniform_in_q
from certifier.polytopes.sampling import hit_and_run

CHANCE = 1e-4
"""A test of samples fails by bad luck once in this many seeds; the seeds are fixed."""


def joints(*revolute):
    return ConfigurationSpace(np.zeros(len(revolute)), np.array(revolute))


def box(lower, upper):
    eye = np.eye(len(lower))
    return Polytope(np.concatenate([eye, -eye]), np.concatenate([upper, -np.asarray(lower)]).astype(float))


def box_in_q(reach, space):
    half = space.to_s(reach)
    return box(-half, half)


def is_uniform(values, lower, upper):
    return stats.kstest(values, "uniform", (lower, upper - lower)).pvalue > CHANCE


def test_samples_of_a_box_are_uniform_in_q_where_samples_uniform_in_s_are_not():
    """Revolute joints that turn by 170 degrees either way, and a prismatic one."""
    space, reach = joints(True, False, True), np.array([np.deg2rad(170), 0.4, 0.1])
    polytope = box_in_q(reach, space)
    q = space.to_q(uniform_in_q(polytope, space, 400, 10, seed=1).reshape(-1, 3))
    assert all(is_uniform(q[:, i], -reach[i], reach[i]) for i in range(3))
    assert not is_uniform(space.to_q(hit_and_run(polytope, np.zeros(3), 4000, seed=1))[:, 0], -reach[0], reach[0])


def by_rejection(polytope, space, reach, count, rng):
    """Points of the polytope that are uniform in q, from a box around it; at least ``count``."""
    found = []
    while sum(map(len, found)) < count:
        s = space.to_s(rng.uniform(-reach, reach, (100_000, len(reach))))
        found.append(s[polytope.contains(s)])
    return space.to_q(np.concatenate(found))


@pytest.mark.parametrize("seed", range(5))
def test_samples_of_a_skew_polytope_are_as_rejection_sampling_has_them(seed):
    """One sample a chain, so all are independent; compared along the axes and along random directions of q."""
    rng = np.random.default_rng(seed)
    n = 3
    space, reach = joints(True, True, False), np.array([2.6, 2.0, 1.0])
    limits, C = box_in_q(reach, space), rng.normal(size=(6, n))
    polytope = Polytope(np.concatenate([limits.C, C]), np.concatenate([limits.d, rng.uniform(0.3, 0.8, 6) * np.linalg.norm(C, axis=1)]))
    ours = space.to_q(uniform_in_q(polytope, space, 4000, 1, seed).reshape(-1, n))
    theirs = by_rejection(polytope, space, reach, 4000, rng)
    for direction in (*np.eye(n), *rng.normal(size=(5, n))):
        assert stats.ks_2samp(ours @ direction, theirs @ direction).pvalue > CHANCE


def test_a_thin_diagonal_polytope_is_filled():
    """Along the axes a chain moves by a twentieth of the polytope's length."""
    space, reach = joints(True, True), np.array([1.0, 1.0])
    limits, across = box_in_q(reach, space), np.array([[1.0, -1.0], [-1.0, 1.0]])
    polytope = Polytope(np.concatenate([limits.C, across]), np.concatenate([limits.d, [0.05, 0.05]]))
    ours = space.to_q(uniform_in_q(polytope, space, 2000, 1, seed=3).reshape(-1, 2))
    theirs = by_rejection(polytope, space, reach, 2000, np.random.default_rng(3))
    for direction in ([1.0, 1.0], [1.0, -1.0]):
        assert stats.ks_2samp(ours @ direction, theirs @ direction).pvalue > CHANCE


@settings(max_examples=30, deadline=None)
@given(st.integers(1, 6), st.integers(0, 2**32 - 1))
def test_samples_stay_in_the_polytope(n, seed):
    rng = np.random.default_rng(seed)
    limits, C = box(-rng.uniform(0.01, 9, n), rng.uniform(0.01, 9, n)), rng.normal(size=(5, n))
    polytope = Polytope(np.concatenate([limits.C, C]), np.concatenate([limits.d, rng.uniform(0.01, 1, 5)]))
    s = uniform_in_q(polytope, joints(*rng.random(n) < 0.5), 20, 3, seed)
    assert s.shape == (20, 3, n)
    assert polytope.contains(s, tolerance=1e-12).all()


def test_deterministic_for_a_seed():
    a, b, c = (uniform_in_q(box([-1, -1], [1, 1]), joints(True, True), 10, 5, seed) for seed in (5, 5, 6))
    assert np.array_equal(a, b)
    assert not np.array_equal(a, c)


def test_an_unbounded_polytope_is_refused():
    with pytest.raises(RegionError) as error:
        uniform_in_q(Polytope(np.array([[1.0, 0], [0, 1]]), np.ones(2)), joints(True, True), 5, 1, seed=0)
    assert error.value.code == "polytope_unbounded"

"""Appendix A: the constant N and its multipliers, in exact arithmetic and against the identity itself."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from certifier.errors import RegionError
from certifier.jobs.archimedean import archimedean
from certifier.model import Polytope
from certifier.verify.archimedean import check_archimedean


def limited(rng, n, m, size):
    """m random faces around a point inside, and limits on every axis."""
    center = rng.normal(size=n)
    C = np.concatenate([rng.normal(size=(m, n)), np.eye(n), -np.eye(n)])
    return Polytope(C, C @ center + size * rng.uniform(0.1, 2, len(C)))


@settings(max_examples=60, deadline=None)
@given(st.integers(1, 7), st.integers(0, 30), st.floats(-3, 1), st.integers(0, 2**32))
def test_every_bounded_polytope_is_proved_archimedean(n, m, size, seed):
    polytope = limited(np.random.default_rng(seed), n, m, 10**size)
    assert check_archimedean(polytope.C, polytope.d, archimedean(polytope))


@settings(max_examples=20, deadline=None)
@given(st.integers(1, 4), st.integers(0, 10), st.integers(0, 2**32))
def test_the_identity_of_the_docstring(n, m, seed):
    """N - |s|^2 written with squares and nonnegative multiples of the faces, at arbitrary points s, outside P too."""
    rng = np.random.default_rng(seed)
    polytope = limited(rng, n, m, 1.0)
    proof = archimedean(polytope)
    l, u = proof.lower, proof.upper
    assert min(proof.y.min(), proof.Y_lower.min(), proof.Y_upper.min()) >= 0
    for s in 3 * rng.normal(size=(20, n)):
        g = polytope.d - polytope.C @ s
        above = proof.Y_lower @ g + (-l - proof.Y_lower @ polytope.d)  # s - l: faces and a constant
        below = proof.Y_upper @ g + (u - proof.Y_upper @ polytope.d)
        constant = proof.N + l @ u - proof.y @ polytope.d
        rhs = (((u - s) ** 2 * above + (s - l) ** 2 * below) / (u - l)).sum() + proof.y @ g + constant
        assert rhs == pytest.approx(proof.N - s @ s, abs=1e-8 * (1 + s @ s) * (1 + proof.N) / (u - l).min())
        assert constant >= 0
        assert min((-l - proof.Y_lower @ polytope.d).min(), (u - proof.Y_upper @ polytope.d).min()) >= -1e-9


def test_the_unit_box_has_the_best_constant():
    n = 3
    cube = Polytope(np.concatenate([np.eye(n), -np.eye(n)]), np.ones(2 * n))
    assert abs(archimedean(cube).N - n) <= 1e-9


def test_wrong_numbers_are_refused():
    polytope = limited(np.random.default_rng(0), 3, 8, 1.0)
    proof = archimedean(polytope)
    far = np.array([np.linalg.norm(s) for s in (proof.lower, proof.upper)]).max()
    for wrong in (
        replace(proof, N=0.0),
        replace(proof, N=float("nan")),
        replace(proof, N=float("inf")),
        replace(proof, y=-proof.y),
        replace(proof, y=np.zeros_like(proof.y)),
        replace(proof, upper=proof.lower),
        replace(proof, upper=proof.upper - far),
        replace(proof, Y_lower=proof.Y_upper),
    ):
        assert not check_archimedean(polytope.C, polytope.d, wrong)
    assert not check_archimedean(polytope.C, polytope.d - 0.1, proof) or check_archimedean(polytope.C, polytope.d, proof)
    assert not check_archimedean(polytope.C, polytope.d + 0.1, proof)


def test_unbounded_polytopes_are_refused():
    with pytest.raises(RegionError) as error:
        archimedean(Polytope(np.array([[1.0, 0], [-1, 0], [0, 1], [1, 1]]), np.ones(4)))
    assert error.value.code in ("polytope_unbounded", "polytope_without_limits")

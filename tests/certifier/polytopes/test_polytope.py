"""Linear programs over polytopes against known answers, exact arithmetic and each other."""

import math
from fractions import Fraction
from itertools import product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pydrake.geometry.optimization import HPolyhedron
from scipy.optimize import linprog

from certifier.coordinates import ConfigurationSpace
from certifier.errors import RegionError
from certifier.model import Polytope
from certifier.polytopes.ellipsoid import inscribed_ellipsoid, volume, volume_bound, volume_in_q
from certifier.polytopes.polytope import (
    bound_multipliers,
    bounds,
    chebyshev_center,
    drop_redundant,
    support,
)
from certifier.polytopes.sampling import hit_and_run
from certifier.verify.box import Halfspaces


def box(lower, upper):
    eye = np.eye(len(lower))
    return Polytope(np.concatenate([eye, -eye]), np.concatenate([upper, -np.asarray(lower)]).astype(float))


def simplex(n):
    return Polytope(np.concatenate([np.ones((1, n)), -np.eye(n)]), np.append(1.0, np.zeros(n)))


def cross_polytope(n):
    return Polytope(np.array(list(product([-1.0, 1.0], repeat=n))), np.ones(2**n))


@st.composite
def limited_polytopes(draw, max_n=5, max_faces=25):
    """Random faces around a random centre, duplicates and scaled copies among them, and joint limits at the end; size 1e-3 to 10."""
    rng = np.random.default_rng(draw(st.integers(0, 2**32)))
    n, m = draw(st.integers(1, max_n)), draw(st.integers(0, max_faces))
    size = 10.0 ** draw(st.floats(-3, 1))
    center = rng.normal(size=n)
    C = rng.normal(size=(m, n))
    C /= np.linalg.norm(C, axis=1, keepdims=True)
    d = C @ center + size * rng.uniform(0.1, 2, m)
    copies = rng.integers(0, max(m, 1), draw(st.integers(0, 3)) if m else 0)
    factor = rng.choice([1.0, 2.0, 3.0], (len(copies), 1))
    limits = box(center - size * rng.uniform(0.5, 3, n), center + size * rng.uniform(0.5, 3, n))
    return Polytope(np.concatenate([C, C[copies] * factor, limits.C]), np.concatenate([d, d[copies] * factor[:, 0], limits.d])), center


def test_bounds_of_a_simplex():
    lo, hi = bounds(simplex(4))
    assert np.allclose(lo, 0, atol=1e-9)
    assert np.allclose(hi, 1, atol=1e-9)


@settings(max_examples=40, deadline=None)
@given(limited_polytopes())
def test_bound_multipliers_prove_a_tight_box_exactly(case):
    polytope, _ = case
    lo, hi, Y_lo, Y_hi = bound_multipliers(polytope)
    assert Halfspaces(polytope.C, polytope.d).lie_in_box(lo, hi, Y_lo, Y_hi)
    low, high = bounds(polytope)
    scale = 1 + np.abs(polytope.d).max()
    assert np.allclose(lo, low, atol=1e-8 * scale)
    assert np.allclose(hi, high, atol=1e-8 * scale)


@settings(max_examples=20, deadline=None)
@given(limited_polytopes(), st.integers(0, 2**32))
def test_the_exact_checker_refuses_what_is_not_proved(case, seed):
    """Infeasible twins: a bound that cuts off a point of the polytope has no proof, whatever the multipliers."""
    polytope, center = case
    lo, hi, Y_lo, Y_hi = bound_multipliers(polytope)
    rng = np.random.default_rng(seed)
    i = rng.integers(len(center))
    wrong = hi.copy()
    wrong[i] = np.nextafter(np.maximum(center[i], 0), -np.inf) if center[i] < hi[i] else -np.inf
    wrong[i] = min(wrong[i], center[i] - 1e-9)
    assert not Halfspaces(polytope.C, polytope.d).lie_in_box(lo, wrong, Y_lo, Y_hi)
    assert not Halfspaces(polytope.C, polytope.d).lie_in_box(lo, wrong, Y_lo, rng.exponential(size=Y_hi.shape))
    assert not Halfspaces(polytope.C, polytope.d).lie_in_box(lo, hi, Y_lo, -Y_hi)
    assert not Halfspaces(polytope.C, polytope.d).lie_in_box(lo, hi, Y_lo, np.full_like(Y_hi, np.nan))
    assert not Halfspaces(polytope.C, polytope.d).lie_in_box(lo, hi, Y_lo[:, 1:], Y_hi)


def test_the_exact_bound_is_exact():
    """0.1 is not a tenth: the residual 1 - 10 * double(0.1) is bounded by the row that bounds s alone."""
    C, d = np.array([[0.1], [1.0], [-1.0]]), np.array([0.1, 5.0, 0.0])
    bound = Halfspaces(C, d).upper_bound(np.ones(1), np.array([10.0, 0, 0]))
    tenth = Fraction(0.1)
    assert Fraction(int(bound.p), int(bound.q)) == 10 * tenth  # 1 - 10 * tenth < 0 meets the lower bound, which is 0
    assert Halfspaces(C[:2], d[:2]).upper_bound(np.ones(1), np.array([10.0, 0])) is None


@settings(max_examples=30, deadline=None)
@given(limited_polytopes(), st.integers(0, 2**32))
def test_support_is_proved_and_attained(case, seed):
    polytope, center = case
    c = np.random.default_rng(seed).normal(size=len(center))
    value, y = support(polytope, c)
    exact = Halfspaces(polytope.C, polytope.d).upper_bound(c, y)
    reached = -linprog(-c, polytope.C, polytope.d, bounds=(None, None)).fun
    assert exact is not None
    assert Fraction(int(exact.p), int(exact.q)) <= Fraction(value)
    assert abs(value - reached) <= 1e-7 * (1 + abs(reached))


def test_bound_multipliers_need_the_limits():
    with pytest.raises(RegionError) as error:
        bound_multipliers(cross_polytope(3))
    assert error.value.code == "polytope_without_limits"


def test_check_accepts_a_bounded_polytope():
    for polytope in (box([-1, 0], [1, 1e-3]), simplex(6), cross_polytope(4)):
        chebyshev_center(polytope)


@pytest.mark.parametrize(
    ("polytope", "code", "words"),
    [
        (Polytope(np.array([[1.0], [-1.0]]), np.array([0.0, -1.0])), "polytope_empty", "no point"),
        (Polytope(np.array([[1.0], [-1.0]]), np.array([0.0, 0.0])), "polytope_empty", "flat"),
        (Polytope(np.zeros((1, 1)), np.array([-1.0])), "polytope_empty", "no point"),
        (Polytope(np.array([[1.0, 0], [-1, 0], [0, 1]]), np.ones(3)), "polytope_unbounded", "elbow from below"),
        (Polytope(np.zeros((0, 2)), np.zeros(0)), "polytope_unbounded", "shoulder from above"),
        (Polytope(np.array([[1.0, 1], [-1, -1], [1, 2]]), np.ones(3)), "polytope_unbounded", "along [ 1., -1.]"),
        (Polytope(np.array([[1.0, -1], [-1, 1]]), np.ones(2)), "polytope_unbounded", "along"),
    ],
)
def test_check_refuses(polytope, code, words):
    with pytest.raises(RegionError) as error:
        chebyshev_center(polytope, ("shoulder", "elbow"))
    assert error.value.code == code
    assert words in error.value.message


@pytest.mark.parametrize("function", [bounds, drop_redundant, inscribed_ellipsoid])
def test_every_function_says_what_is_wrong_with_the_polytope(function):
    empty = Polytope(np.array([[1.0, 0], [-1, 0], [0, 1], [0, -1]]), np.array([0.0, -1, 1, 1]))
    unbounded = Polytope(np.array([[1.0, 0], [-1, 0], [0, 1]]), np.ones(3))
    for polytope, code in ((empty, "polytope_empty"), (unbounded, "polytope_unbounded")):
        with pytest.raises(RegionError) as error:
            function(polytope)
        assert error.value.code == code


@settings(max_examples=20, deadline=None)
@given(st.integers(1, 6), st.integers(0, 2**32))
def test_boundedness_agrees_with_the_support_values(n, seed):
    rng = np.random.default_rng(seed)
    m = int(rng.integers(1, 4 * n))
    polytope = Polytope(rng.normal(size=(m, n)), rng.uniform(0.1, 1, m))
    finite = all(linprog(c, polytope.C, polytope.d, bounds=(None, None)).status == 0 for c in np.concatenate([np.eye(n), -np.eye(n)]))
    if finite:
        chebyshev_center(polytope)
    else:
        with pytest.raises(RegionError, match=r"unbounded|bounds"):
            chebyshev_center(polytope)


def test_chebyshev_center_refuses():
    for rows, code in (([0.0, -1.0], "polytope_empty"), ([0.0, 0.0], "polytope_empty")):
        with pytest.raises(RegionError) as error:
            chebyshev_center(Polytope(np.array([[1.0], [-1.0]]), np.array(rows)))
        assert error.value.code == code
    with pytest.raises(RegionError) as error:
        chebyshev_center(Polytope(np.array([[1.0, 0], [0, 1]]), np.ones(2)))
    assert error.value.code == "polytope_unbounded"


def test_chebyshev_center_of_a_simplex():
    n = 3
    center, radius = chebyshev_center(simplex(n))
    expected = 1 / (n + math.sqrt(n))
    assert radius == pytest.approx(expected, abs=1e-9)
    assert np.allclose(center, expected, atol=1e-9)


@settings(max_examples=40, deadline=None)
@given(limited_polytopes(), st.integers(0, 3))
def test_drop_redundant_keeps_the_set(case, fixed):
    polytope, center = case
    m = len(polytope.d)
    kept = drop_redundant(polytope, fixed)
    assert set(range(max(m - fixed, 0), m)) <= set(kept.tolist())
    reduced = Polytope(polytope.C[kept], polytope.d[kept])
    for j in set(range(m)) - set(kept.tolist()):
        reached = -linprog(-polytope.C[j], reduced.C, reduced.d, bounds=(None, None)).fun
        assert reached <= polytope.d[j] + 1e-9 * (1 + abs(polytope.d[j]))
    s = hit_and_run(reduced, center, 200, 0)
    outwards = center + (s - center) * np.geomspace(1, 4, 200)[:, None]
    assert np.array_equal(reduced.contains(outwards), polytope.contains(outwards))


@settings(max_examples=20, deadline=None)
@given(limited_polytopes(max_faces=15))
def test_drop_redundant_finds_what_is_clearly_redundant(case):
    polytope, center = case
    redundant = Polytope(
        np.concatenate([polytope.C, polytope.C]), np.concatenate([polytope.d, polytope.d + 1e-3 * (polytope.d - polytope.C @ center)])
    )
    assert drop_redundant(redundant).max() < len(polytope.d)


def test_drop_redundant_of_equal_rows_keeps_the_limits():
    limits = box([-1, -1], [1, 1])
    polytope = Polytope(np.concatenate([[[1.0, 0]], [[1.0, 0]], limits.C]), np.concatenate([[1.0], [2.0], limits.d]))
    assert drop_redundant(polytope).tolist() == [2, 3, 4, 5]


def test_drop_redundant_of_scaled_copies_keeps_the_set():
    """No ray leaves through one of two equal faces alone, and no bound between them is strict."""
    kept = drop_redundant(Polytope(np.array([[1.0], [2.0], [-1.0], [-2.0]]), np.array([1.0, 2.0, 1.0, 2.0])))
    assert {0, 1} & set(kept.tolist())
    assert {2, 3} & set(kept.tolist())


@settings(max_examples=25, deadline=None)
@given(limited_polytopes())
def test_inscribed_ellipsoid_is_inside_and_as_large_as_a_ball(case):
    polytope, _ = case
    E = inscribed_ellipsoid(polytope)
    assert np.all(np.linalg.norm(polytope.C @ E.shape, axis=1) <= polytope.d - polytope.C @ E.center)
    assert np.allclose(E.shape, E.shape.T)
    assert np.linalg.eigvalsh(E.shape).min() > 0
    n, (_, radius) = len(E.center), chebyshev_center(polytope)
    ball = math.pi ** (n / 2) / math.gamma(n / 2 + 1) * radius**n
    assert E.volume >= ball * (1 - 1e-4)
    assert E.volume <= volume_bound(polytope)


def test_the_bound_of_the_ellipsoids_volume_is_reached_in_a_box():
    box = Polytope(np.concatenate([np.eye(3), -np.eye(3)]), np.array([0.1, 2.0, 3.0, 0.3, 1.0, 0.0]))
    assert volume_bound(box) == pytest.approx(inscribed_ellipsoid(box).volume, rel=1e-6)


@settings(max_examples=25, deadline=None)
@given(limited_polytopes())
def test_inscribed_ellipsoid_is_as_large_as_drakes(case):
    polytope, center = case
    size = (polytope.d - polytope.C @ center).max()
    scaled = HPolyhedron(polytope.C, (polytope.d - polytope.C @ center) / size)
    drakes = abs(np.linalg.det(np.linalg.inv(scaled.MaximumVolumeInscribedEllipsoid().A()))) * size ** len(center)
    assert np.linalg.det(inscribed_ellipsoid(polytope).shape) == pytest.approx(drakes, rel=1e-4)


def test_inscribed_ellipsoid_of_a_thin_sheared_box():
    """Largest ellipsoids follow affine maps: that of A [-1, 1]^n is A times the unit ball."""
    n = 4
    rng = np.random.default_rng(3)
    A = np.linalg.qr(rng.normal(size=(n, n)))[0] @ np.diag([1, 1e-1, 1e-2, 1e-3]) @ np.linalg.qr(rng.normal(size=(n, n)))[0]
    cube = box(-np.ones(n), np.ones(n))
    E = inscribed_ellipsoid(Polytope(cube.C @ np.linalg.inv(A), cube.d))
    assert E.volume == pytest.approx(abs(np.linalg.det(A)) * math.pi**2 / 2, rel=1e-4)
    assert np.allclose(E.shape @ E.shape, A @ A.T, atol=1e-4)


@pytest.mark.parametrize("n", range(2, 8))
def test_volume_of_known_bodies_is_within_its_error(n):
    """The squared distances in standard errors add up to about their number, so the error is neither wrong nor vain."""
    known = (
        (box(np.zeros(n), np.arange(1, n + 1)), math.factorial(n)),
        (simplex(n), 1 / math.factorial(n)),
        (cross_polytope(n), 2**n / math.factorial(n)),
    )
    distances = []
    for polytope, expected in known:
        value, stderr = volume(polytope, seed=n, rays=20_000, samples=2048)
        assert 0 < stderr < 0.06 * value
        distances.append((value - expected) / stderr)
    assert np.square(distances).sum() < 16.3  # chi-squared, 3 degrees of freedom, one in a thousand


def test_volume_is_deterministic_and_affine():
    polytope = box([-1, 0], [1, 0.5])
    first = volume(polytope, seed=7, rays=5000, samples=1024)
    assert first == volume(polytope, seed=7, rays=5000, samples=1024)
    assert first != volume(polytope, seed=8, rays=5000, samples=1024)


@pytest.mark.parametrize("revolute", [(True, True, True), (True, False, True), (False, False, False)])
def test_the_volume_in_q_of_a_box_is_within_its_error(revolute):
    """A box in s is a box in q: its sides are 2 arctan of the ends of those of joints that turn."""
    lower, upper = np.array([-0.9, 0.1, -0.2]), np.array([0.3, 1.4, 1.1])
    box = Polytope(np.concatenate([np.eye(3), -np.eye(3)]), np.concatenate([upper, -lower]))
    ends = [2 * np.arctan(s) if turns else s for s, turns in zip(np.stack([lower, upper], axis=1), revolute, strict=True)]
    exact = np.prod([high - low for low, high in ends])
    value, stderr = volume_in_q(box, ConfigurationSpace(np.zeros(3), np.array(revolute)), volume(box, seed=3), seed=3)
    assert abs(value - exact) < 4 * stderr
    assert stderr < 0.03 * exact

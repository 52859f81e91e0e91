"""Points near a polytope's boundary, and polynomials in Bernstein form against their values."""

from __future__ import annotations

import itertools
from functools import reduce
from math import comb

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from certifier.partition import bernstein as bernstein_form
from certifier.partition import positive
from certifier.partition.chords import chords
from certifier.partition.multipliers import PROVED, UNDECIDED
from certifier.proof import limits

SEEDS = st.integers(0, 2**32 - 1)


def bernstein(coefficients, t, degree):
    """The value at t, (k,), of the polynomial with these tensor-product Bernstein coefficients, the first coordinate slowest."""
    basis = np.ones(1)
    for x in t:
        basis = np.kron(basis, [comb(degree, i) * x**i * (1 - x) ** (degree - i) for i in range(degree + 1)])
    return float(basis @ coefficients)


@settings(max_examples=50)
@given(SEEDS, st.integers(1, 5))
def test_chords_end_close_to_the_boundary_and_inside(seed, n):
    rng = np.random.default_rng(seed)
    C = np.concatenate([rng.normal(size=(6, n)), np.eye(n), -np.eye(n)])
    C /= np.linalg.norm(C, axis=1)[:, None]
    d = rng.uniform(0.2, 1.0, len(C))
    start = np.zeros(n)
    targets = rng.normal(size=(10, n))
    points = chords(C, d, start, targets, 15, 3)
    assert points.shape == (10 + 2 * 15, n)
    slack = d - points @ C.T
    assert (slack > -1e-12).all()
    beyond = (targets @ C.T > d).any(axis=1)
    assert points[:10][~beyond] == pytest.approx(targets[~beyond], rel=1e-5)
    assert (slack[:10][beyond].min(axis=1) < 1e-4).all()
    assert (slack[10:].min(axis=1) < 1e-4).all()
    assert (points == chords(C, d, start, targets, 15, 3)).all()


def test_the_walk_of_the_chords_gets_about():
    """Its ends are near every face of a square, and in all its quarters."""
    C, d = np.concatenate([np.eye(2), -np.eye(2)]), np.ones(4)
    points = chords(C, d, np.full(2, 0.99), np.zeros((0, 2)), 100, 0)
    assert all((d - points @ C.T < 1e-4)[:, face].sum() >= 10 for face in range(4))
    assert len({tuple(quarter) for quarter in (points > 0).tolist()}) == 4


@settings(max_examples=50)
@given(SEEDS, st.integers(1, 3))
def test_elevated_coefficients_are_those_of_the_product(seed, k):
    rng = np.random.default_rng(seed)
    values, first, last, t = rng.normal(size=3**k), rng.normal(size=k), rng.normal(size=k), rng.random(k)
    product = bernstein(values, t, 2) * np.prod((1 - t) * first + t * last)
    assert bernstein(bernstein_form.elevate(values, first, last), t, 3) == pytest.approx(product, rel=1e-9, abs=1e-12)
    both = bernstein_form.elevate(np.stack([values, -2 * values], axis=-1).ravel(), first, last).reshape(-1, 2)
    assert (both == bernstein_form.elevate(values, first, last)[:, None] * [1, -2]).all()


@settings(max_examples=50)
@given(SEEDS, st.integers(1, 3))
def test_halves_are_the_polynomial_on_half_of_a_coordinate(seed, k):
    rng = np.random.default_rng(seed)
    A, t, axis = rng.normal(size=(2, 4**k)), rng.random(k), int(rng.integers(k))
    given_, low = A.copy(), np.empty_like(A)
    bernstein_form.halve(A, axis, k, low)
    for part, place in ((low, t[axis] / 2), (A, (1 + t[axis]) / 2)):
        where = t.copy()
        where[axis] = place
        for row in range(2):
            assert bernstein(part[row], t, 3) == pytest.approx(bernstein(given_[row], where, 3), rel=1e-9, abs=1e-12)


@settings(max_examples=50)
@given(SEEDS, st.integers(0, 3), st.integers(0, 2))
def test_a_polynomial_is_evaluated_where_the_weights_put_the_point(seed, k, o):
    """s = ((1 - t) w l + t v u)/((1 - t) w + t v) in the own coordinates; the others come in affinely."""
    rng = np.random.default_rng(seed)
    c, t, out = rng.normal(size=(1 + o, 4**k)), rng.random(k), rng.uniform(-1, 1, o)
    l, (w, v) = rng.normal(size=k), rng.uniform(0.2, 2.0, (2, k))
    u = l + rng.uniform(0.1, 2.0, k)
    s = ((1 - t) * w * l + t * v * u) / ((1 - t) * w + t * v)
    found = bernstein_form.evaluate(c, np.concatenate([s, out]), np.array([l, u, w, v]).reshape(4, k))
    assert found == pytest.approx(bernstein(c[0] + out @ c[1:], t, 3), rel=1e-9, abs=1e-11)


@settings(max_examples=50)
@given(SEEDS, st.integers(0, 2), st.integers(0, 2), st.integers(0, 2), st.integers(0, 3))
def test_the_least_control_value_is_below_the_function_everywhere(seed, k, o, r, m):
    """z_0 f - sum_j z_j g_j at random points of the box is a mean of control values, so it is no less than the least one."""
    rng = np.random.default_rng(seed)
    N = 4**k
    c, den = rng.normal(size=(1 + o, N)), rng.normal(size=(2, k, 4))
    den[0] = rng.uniform(0.5, 2.0, (k, 4))
    chosen = [den[0], *(np.concatenate([den[0, :i], den[1, i : i + 1], den[0, i + 1 :]]) for i in range(k))]
    T = np.array([reduce(np.multiply.outer, factors, np.ones(())).ravel() for factors in chosen])
    z, constant = rng.random(1 + m), rng.normal(size=m)
    own, outside, rest = (rng.normal(size=(m, size)) for size in (k, o, r))
    least, place = bernstein_form.lowest(z, c, den, constant, own, outside, rest, np.empty(k + o))
    assert 0 <= place < N
    assert bernstein_form.lowest(z * np.nan, c, den, constant, own, outside, rest, np.empty(k + o))[0] == -np.inf
    values = []
    signs = list(itertools.product((-1.0, 1.0), repeat=o + r))
    for ends in signs:
        x, y = np.array(ends[:o]), np.array(ends[o:])
        g = constant + outside @ x + rest @ y
        values.append(z[0] * (c[0] + x @ c[1:]) - (z[1:] @ g) * T[0] - z[1:] @ own @ T[1:])
    assert least == pytest.approx(np.min(values), rel=1e-9, abs=1e-12)
    assert least == pytest.approx(np.min(values, axis=0)[place], rel=1e-9, abs=1e-12)


def test_faces_help_only_in_pieces_that_turn_less_than_half_a_turn():
    """Else a proof would not hold any more when a face is moved in: where the denominator has a negative control value, less is more.

    One joint turns 300 degrees. f is two faces and a little more, so it is proved by both on the whole range, though it is negative there.
    """
    end = np.tan(np.radians(75))
    ends = np.array([[-end], [end], [np.cos(np.radians(75))], [np.cos(np.radians(75))]])
    den = bernstein_form.factors(np.array([[1.0, ends[2, 0] * ends[3, 0] * (1 - end * end), 1.0]]), ends)
    assert den[0].min() < 0
    own, rest = np.array([[-1.0, 1.0]]), np.zeros((0, 2))
    c = (np.ones(2) @ (0.5 * den[0, 0] + own.T * den[1, 0]) + 0.02)[None]
    assert c.min() < 0
    constant, outside = np.full(2, 0.5), np.zeros((0, 2))
    codes, counts, faces, values = (np.zeros(100, kind) for kind in (np.int8, np.int16, np.int16, np.float32))
    lengths, point, halvings = np.zeros(3, np.int64), np.zeros(1), np.zeros(1, np.int64)
    answer = positive.Answer(codes, counts, faces, values, lengths, point, halvings)
    question = positive.Question(c, den, ends, constant, own, outside, rest)
    assert positive.prove(question, 1e-7, 100, answer, np.empty((positive.DEPTH, 1, 4))) == PROVED
    assert codes[0] == 0, "all of the range is not proved at once"


def test_no_piece_is_halved_more_often_than_the_verifier_takes():
    """f = 1 - s on [0, 1] is not positive at 1, so the piece there is halved again and again, however many pieces are allowed."""
    ends = np.array([[0.0], [1.0], [1.0], [1.0]])
    den = bernstein_form.factors(np.ones((1, 3)), ends)
    codes, counts, faces, values = (np.zeros(4000, kind) for kind in (np.int8, np.int16, np.int16, np.float32))
    lengths, point, halvings = np.zeros(3, np.int64), np.zeros(1), np.zeros(1, np.int64)
    answer = positive.Answer(codes, counts, faces, values, lengths, point, halvings)
    question = positive.Question(den[0] - den[1], den, ends, np.zeros(0), np.zeros((1, 0)), np.zeros((0, 0)), np.zeros((0, 0)))
    # Precision counts by the whole range, so it is far below what double numbers can hold here.
    assert positive.prove(question, 1e-300, 1000, answer, np.empty((positive.DEPTH, 1, 4))) == UNDECIDED
    assert halvings[0] == limits.PIECE_DEPTH

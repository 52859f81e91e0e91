"""Integers in floating-point limbs against Python's own integers."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from certifier.errors import ProofError
from certifier.verify import limbs

integers = st.one_of(
    st.integers(-(2**400), 2**400), st.integers(-(2**17), 2**17), st.sampled_from([-(2**15), 2**15, -(2**31), 2**31 - 1, 0])
)


def value(x):
    """What limbs (w, ...) stand for, as an object array."""
    return sum(np.vectorize(int, otypes=[object])(limb) << limbs.BITS * i for i, limb in enumerate(x))


def matrices(rows, columns):
    return st.lists(st.lists(integers, min_size=columns, max_size=columns), min_size=rows, max_size=rows)


def is_normal(x):
    return (x[:-1] >= 0).all() and (x[:-1] < limbs.BASE).all() and (np.abs(x[-1] + 0.5) < limbs.BASE / 2).all()


@given(matrices(2, 3))
def test_limbs_stand_for_their_integers(rows):
    x = limbs.of_rows(rows)
    assert is_normal(x)
    assert value(x).tolist() == rows


@given(st.lists(st.integers(-(2**63), 2**63 - 1), min_size=1, max_size=5))
def test_limbs_of_an_array(values):
    x = limbs.of_array(np.array(values, dtype=np.int64))
    assert is_normal(x)
    assert value(x).tolist() == values


@given(matrices(2, 3), matrices(3, 4), matrices(2, 4))
def test_products_differences_and_sums_are_exact(first, second, third):
    A, B, C = (np.array(rows, dtype=object) for rows in (first, second, third))
    difference = limbs.difference(limbs.product(limbs.of_rows(first), limbs.of_rows(second)), limbs.of_rows(third))
    assert (value(difference) == A @ B - C).all()
    normal = limbs.normal(difference)
    assert is_normal(normal)
    assert (value(normal) == A @ B - C).all()
    assert limbs.absolute_sums(difference) == np.abs(A @ B - C).sum(axis=1).tolist()


def test_the_largest_limbs_do_not_round():
    """As many products of the largest limbs as are allowed, of one sign; one more is refused."""
    s = limbs.MAX_TERMS // 2
    row = [2**16 - 1 + (2**15 - 1) * 2**16] * s
    product = limbs.product(limbs.of_rows([row]), limbs.of_rows([[x] for x in row]))
    assert value(product)[0, 0] == s * row[0] ** 2
    assert np.abs(product).max() < 2**48
    with pytest.raises(ProofError):
        limbs.product(limbs.of_rows([[*row, 1]]), limbs.of_rows([[x] for x in [*row, 1]]))

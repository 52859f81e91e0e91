import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from certifier.conic.cone import inverse_cholesky
from certifier.conic.kernels import line_search, lowest_relative_eigenvalue


def stack(seed, size, count):
    rng = np.random.default_rng(seed)
    X = rng.normal(size=(count, size, size))
    return X @ np.swapaxes(X, 1, 2) + 1e-2 * np.eye(size), rng


@given(st.integers(0, 2**32 - 1), st.integers(1, 16), st.integers(1, 5))
def test_inverse_cholesky_factors(seed, size, count):
    X, _ = stack(seed, size, count)
    inverse = inverse_cholesky(X)
    np.testing.assert_allclose(inverse, np.linalg.inv(np.linalg.cholesky(X)), rtol=1e-6, atol=1e-8 * np.abs(inverse).max())


@given(st.integers(0, 2**32 - 1), st.integers(1, 8))
def test_an_indefinite_matrix_is_noticed(seed, size):
    X, _ = stack(seed, size, 3)
    X[1] -= (np.linalg.eigvalsh(X[1])[0] + 0.1) * np.eye(size)
    with pytest.raises(np.linalg.LinAlgError):
        inverse_cholesky(X)


@given(st.integers(0, 2**32 - 1), st.integers(1, 16), st.integers(1, 5))
def test_lowest_relative_eigenvalue(seed, size, count):
    X, rng = stack(seed, size, count)
    D = rng.normal(size=X.shape)
    D = D + np.swapaxes(D, 1, 2)
    inverse = inverse_cholesky(X)
    expected = np.linalg.eigvalsh(inverse @ D @ np.swapaxes(inverse, 1, 2)).min()
    found = lowest_relative_eigenvalue(inverse, D, 1e-3)
    assert found == pytest.approx(expected, rel=2e-3, abs=1e-9)


def test_a_line_along_which_nothing_moves_has_no_length():
    lengths = line_search(np.array([[0.0, 0.0], [0.5, -0.2]]), np.array([0.0, 0.1]))
    assert lengths[0] == 0.0
    assert np.isfinite(lengths[1])

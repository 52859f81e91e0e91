from math import comb

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from certifier.conic.basis import basis, dimension, exponents, rho, subsets
from certifier.pair.forecast import forecast
from certifier.scene import load_scene


@pytest.mark.parametrize(("k", "n", "expected"), [(4, 7, 432), (3, 7, 162), (2, 7, 60), (1, 7, 22), (0, 7, 8)])
def test_dimension_of_the_polynomial_space(k, n, expected):
    assert dimension(k, k, n - k) == expected
    space = basis(k, tuple(range(k)))
    assert len(space.points) + (n - k) * space.grid == expected


def test_dimension_without_joints_in_play():
    assert dimension(6, 0, 0) == len(basis(6, ()).points) == 3**6


def test_remark_3_a_seven_joint_chain_needs_gram_matrices_of_16_rows_not_3432():
    scene = load_scene("examples/iiwa_shelf/scene.yaml")
    costs = forecast(scene)
    assert max(max(cost.gram_a, cost.gram_b) for cost in costs) == 16
    assert comb(7 + 7, 7) == 3432


@pytest.mark.parametrize(("k", "cubic"), [*((k, tuple(range(k))) for k in range(6)), (3, ()), (3, (1,)), (4, (0, 3)), (6, ())])
def test_points_are_unisolvent_and_well_conditioned(k, cubic):
    space = basis(k, cubic)
    monomials = np.prod(space.points[:, None, :] ** exponents(k, cubic)[None], axis=2)
    assert np.linalg.matrix_rank(monomials) == len(space.points) == dimension(k, len(cubic), 0)
    assert np.linalg.cond(space.inverse) < 30


@given(st.integers(0, 4), st.integers(0, 2**32 - 1))
def test_functionals_evaluate_polynomials_of_the_space(k, seed):
    rng = np.random.default_rng(seed)
    cubic = tuple(np.flatnonzero(rng.random(k) < 0.7).tolist())
    space, u = basis(k, cubic), rng.uniform(-1, 1, (3, k))
    powers = exponents(k, cubic)
    weights, grid = space.functional(u)
    for chosen, functional, points in ((powers, weights, space.points), (powers[: space.grid], grid, space.points[: space.grid])):
        coefficients = rng.normal(size=len(chosen))
        values = np.prod(points[:, None, :] ** chosen[None], axis=2) @ coefficients
        expected = np.prod(u[:, None, :] ** chosen[None], axis=2) @ coefficients
        np.testing.assert_allclose(functional @ values, expected, atol=1e-9)


@pytest.mark.parametrize("k", [0, 1, 3])
def test_rho_is_the_scaled_products_of_distinct_coordinates(k):
    u = np.random.default_rng(k).uniform(-1, 1, (5, k))
    expected = np.stack([np.prod((np.sqrt(3) * u) ** subset, axis=1) for subset in subsets(k)], axis=1)
    np.testing.assert_allclose(rho(u), expected)

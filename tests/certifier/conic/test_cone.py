import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from certifier.conic.basis import basis, rho, subsets
from certifier.conic.cone import Centre, Cone, Factor, Weights


def random_cone(k, outside, faces, seed):
    """Some of the chain's joints in play, the others not."""
    rng = np.random.default_rng(seed)
    slopes, cubic = rng.normal(size=(faces, k + outside)) * 0.2, rng.random(k) < 0.5
    slopes[:, :k] *= cubic
    space = basis(k, tuple(np.flatnonzero(cubic).tolist()))
    return Cone.of_faces(space, np.ones(faces), slopes[:, :k], slopes[:, k:]), space, rng


def random_psd(rng, *shape):
    X = rng.normal(size=(*shape, shape[-1]))
    return X @ np.swapaxes(X, -1, -2) + 0.1 * np.eye(shape[-1])


def random_gram(rng, cone, count):
    return [random_psd(rng, count, *part.shape[:2]) for part in cone.parts]


@given(st.integers(0, 3), st.integers(0, 3), st.integers(1, 4), st.integers(0, 2**32 - 1))
def test_adjoint_is_the_transpose_of_values(k, outside, faces, seed):
    cone, _, rng = random_cone(k, outside, faces, seed)
    Q, x = random_gram(rng, cone, 2), rng.normal(size=(2, cone.N))
    inner = sum(np.vdot(part, Z) for part, Z in zip(Q, cone.adjoint(x), strict=True))
    np.testing.assert_allclose(np.vdot(cone.values(Q), x), inner, rtol=1e-9, atol=1e-9)


@given(st.integers(0, 3), st.integers(0, 3), st.integers(1, 4), st.integers(0, 2**32 - 1))
def test_schur_is_the_matrix_of_its_operator(k, outside, faces, seed):
    cone, _, rng = random_cone(k, outside, faces, seed)
    Q, S, x = random_gram(rng, cone, 2), random_gram(rng, cone, 2), rng.normal(size=(2, cone.N))
    products = [left @ Z @ right for left, Z, right in zip(Q, cone.adjoint(x), S, strict=True)]
    expected = cone.values([(product + np.swapaxes(product, -1, -2)) / 2 for product in products])
    lower = np.tril(cone.schur(Q, S))
    full = lower + np.swapaxes(np.tril(lower, -1), -1, -2)
    actual = np.einsum("rij,rj->ri", full, x)
    np.testing.assert_allclose(actual, expected, rtol=1e-9, atol=1e-9 * np.abs(expected).max())


@given(st.integers(0, 3), st.integers(0, 2), st.integers(0, 2**32 - 1))
def test_values_are_the_polynomial_at_the_points(k, outside, seed):
    """f_0 at a chain point is f there with the outside coordinates at zero; f_l is the slope in coordinate l."""
    cone, space, rng = random_cone(k, outside, 3, seed)
    Q = random_gram(rng, cone, 1)
    points = rng.uniform(-1, 1, (4, k))
    weights, grid = space.functional(points)
    whole = np.einsum("si,jil,sl->js", rho(points), Q[0][0], rho(points))
    values = cone.values(Q)[0]
    gA = np.array([weights @ row for row in cone.parts[0].values])
    expected = (gA * whole).sum(axis=0)
    for part, i in zip(Q[1:], (i for i in range(k) if i not in space.cubic), strict=True):
        without = rho(points)[:, subsets(k)[:, i] == 0]
        expected += (1 - points[:, i] ** 2) * np.einsum("si,il,sl->s", without, part[0, 0], without)
    np.testing.assert_allclose(weights @ values[: len(space.points)], expected, rtol=1e-8)
    for position in range(outside):
        block = values[len(space.points) + position * space.grid :][: space.grid]
        np.testing.assert_allclose(grid @ block, cone.parts[0].slopes[:, position] @ whole, rtol=1e-7, atol=1e-8)


def test_centre_has_the_gradient_asked_for():
    eye = np.eye(4)
    space = basis(2, (0, 1))
    cone = Cone.of_faces(space, np.ones(8), np.concatenate([eye, -eye])[:, :2] * 0.9, np.concatenate([eye, -eye])[:, 2:] * 0.9)
    w = np.zeros(cone.N)
    w[: len(space.points)] = np.prod(1 + space.points**2, axis=1)
    u = np.random.default_rng(0).uniform(-1, 1, (200, 4))
    functional, grid = space.functional(u[:, :2])
    start = np.concatenate([functional.mean(axis=0), *((u[:, [i]] * grid).mean(axis=0) for i in (2, 3))])
    centre = Centre(cone, w, start)
    np.testing.assert_allclose(cone.values(centre.Q)[0], w, atol=1e-4)
    assert np.linalg.eigvalsh(cone.adjoint(centre.x[None])[0]).min() > 0


def test_centre_of_a_w_outside_the_cone_is_refused():
    cone = Cone(2, Weights(np.eye(2), np.ones((1, 2)), np.zeros((1, 0))))
    with pytest.raises(np.linalg.LinAlgError):
        Centre(cone, np.array([1.0, -1.0]), np.array([2.0, 1.0]))


@given(st.integers(1, 6), st.integers(0, 2**32 - 1))
def test_factor_solves_with_lower_triangles_only(size, seed):
    rng = np.random.default_rng(seed)
    H = random_psd(rng, 3, size)
    right = rng.normal(size=(3, size, 2))
    factor = Factor(np.tril(H).copy())
    np.testing.assert_allclose(np.einsum("rij,rjp->rip", H, factor.solve(right)), right, atol=1e-8)
    with pytest.raises(np.linalg.LinAlgError):
        Factor(-np.tril(H))

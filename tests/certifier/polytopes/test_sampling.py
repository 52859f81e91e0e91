"""Hit-and-run against the distributions it must have."""

import numpy as np
import pytest
from scipy import stats

from certifier.errors import RegionError
from certifier.model import Polytope
from certifier.polytopes.sampling import hit_and_run


def box(lower, upper):
    eye = np.eye(len(lower))
    return Polytope(np.concatenate([eye, -eye]), np.concatenate([upper, -np.asarray(lower)]).astype(float))


@pytest.mark.parametrize("n", [1, 3, 7])
def test_samples_of_a_thin_box_are_uniform(n):
    """Widths from 1 to 1e-4: plain hit-and-run would need thousands of steps."""
    width = np.geomspace(1, 1e-4, n)
    s = hit_and_run(box(-width, width), np.zeros(n), 2000, seed=1)
    assert s.shape == (2000, n)
    for i in range(n):
        assert stats.kstest(s[:, i] / width[i], "uniform", (-1, 2)).pvalue > 1e-4


def test_samples_of_a_sheared_cube_are_uniform():
    n = 4
    A = np.linalg.inv(np.triu(np.full((n, n), 5.0), 1) + np.eye(n))
    cube = box(-np.ones(n), np.ones(n))
    s = hit_and_run(Polytope(cube.C @ A, cube.d), np.zeros(n), 3000, seed=2) @ A.T
    for i in range(n):
        assert stats.kstest(s[:, i], "uniform", (-1, 2)).pvalue > 1e-4


def test_samples_of_a_simplex_from_a_corner():
    """Coordinates of a uniform point of the simplex are Beta(1, n), wherever the chains start."""
    n = 5
    simplex = Polytope(np.concatenate([np.ones((1, n)), -np.eye(n)]), np.append(1.0, np.zeros(n)))
    s = hit_and_run(simplex, np.full(n, 1e-6), 3000, seed=3)
    assert simplex.contains(s).all()
    for i in range(n):
        assert stats.kstest(s[:, i], stats.beta(1, n).cdf).pvalue > 1e-4


def test_deterministic_for_a_seed():
    cube = box([-1, -1], [1, 1])
    a, b, c = (hit_and_run(cube, [0, 0], 50, seed=k) for k in (5, 5, 6))
    assert np.array_equal(a, b)
    assert not np.array_equal(a, c)


@pytest.mark.parametrize("count", [0, 1, 63, 65])
def test_any_count(count):
    assert hit_and_run(box([-1, -1, -1], [1, 1, 1]), np.zeros(3), count, seed=0).shape == (count, 3)


def test_start_must_be_inside():
    with pytest.raises(RegionError) as error:
        hit_and_run(box([-1, -1], [1, 1]), [1, 0], 5, seed=0)
    assert error.value.code == "start_outside"


def test_unbounded_polytope():
    with pytest.raises(RegionError) as error:
        hit_and_run(Polytope(np.array([[1.0, 0], [0, 1]]), np.ones(2)), [0, 0], 5, seed=0)
    assert error.value.code == "polytope_unbounded"

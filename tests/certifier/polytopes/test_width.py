"""How wide a polytope is in a thin direction, against known answers and straight motions that are walked in steps."""

import numpy as np
import pytest

from certifier.coordinates import ConfigurationSpace
from certifier.model import Polytope
from certifier.polytopes.polytope import chebyshev_center
from certifier.polytopes.sampling import hit_and_run
from certifier.polytopes.width import least_width_in_q


def arm(n: int) -> ConfigurationSpace:
    return ConfigurationSpace(np.zeros(n), np.ones(n, dtype=bool))


def within(lower, upper, C=(), d=()) -> Polytope:
    eye = np.eye(len(lower))
    return Polytope(np.concatenate([np.reshape(C, (-1, len(lower))), eye, -eye]), np.concatenate([d, upper, -np.asarray(lower)]))


def test_a_box_is_as_wide_as_the_joint_that_moves_least() -> None:
    lower, upper = np.array([-0.6, 0.7, -1.0]), np.array([0.5, 0.8, 1.0])
    expected = 2 * (np.arctan(0.8) - np.arctan(0.7))
    assert least_width_in_q(within(lower, upper), arm(3)) == pytest.approx(expected, rel=1e-12)


def test_a_slab_that_is_thin_in_no_joint_is_called_thin() -> None:
    """Both joints move by 90 degrees, and together. Around q*, |s_1 - s_2| <= 0.01 lets q_1 - q_2 move by 0.04."""
    slab = within([-0.4, -0.4], [0.4, 0.4], [[1.0, -1.0], [-1.0, 1.0]], [0.01, 0.01])
    assert least_width_in_q(slab, arm(2)) == pytest.approx(0.04 / np.sqrt(2), rel=1e-12)


def test_slides_are_measured_in_metres() -> None:
    space = ConfigurationSpace(np.zeros(2), np.array([True, False]))
    assert least_width_in_q(within([-1.0, -0.01], [1.0, 0.03]), space) == pytest.approx(0.04, rel=1e-12)


@pytest.mark.parametrize("seed", range(8))
def test_in_one_direction_no_straight_motion_is_longer(seed: int) -> None:
    """Motions are walked in both ways from points inside, in many directions. Steps of a thousandth are left out."""
    rng = np.random.default_rng(seed)
    normals = rng.normal(size=(6, 2))
    polytope = within([-1.5, -1.5], [1.5, 1.5], normals, normals @ rng.uniform(-1.0, 1.0, 2) + rng.uniform(0.02, 0.4, 6))
    space = arm(2)
    found = least_width_in_q(polytope, space)
    begin = space.to_q(hit_and_run(polytope, chebyshev_center(polytope)[0], 64, seed))
    steps = np.linspace(0, 4, 4001)[1:, None]

    def reach(q: np.ndarray, way: np.ndarray) -> float:
        inside = (space.to_s(q + steps * way) @ polytope.C.T <= polytope.d).all(axis=1)
        return float(steps[-1, 0] if inside.all() else steps[inside.argmin(), 0])

    angles = np.linspace(0, np.pi, 90, endpoint=False)
    ways = np.column_stack([np.cos(angles), np.sin(angles)])
    longest = min(max(reach(q, way) + reach(q, -way) for q in begin) for way in ways)
    assert 0.3 * found < longest <= found + 2e-3

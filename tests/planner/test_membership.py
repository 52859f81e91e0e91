"""Membership of points in regions, against one region and one inequality at a time."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from certifier.model import Joint, JointKind, Polytope, Scene
from planner.membership import MembershipIndex, to_s


def polytopes(rng: np.random.Generator, n: int, count: int) -> list[Polytope]:
    return [Polytope(rng.normal(size=(m, n)), rng.uniform(-0.5, 1.5, size=m)) for m in rng.integers(1, 9, size=count)]


@given(seed=st.integers(0, 2**32 - 1), n=st.integers(1, 7), regions=st.integers(1, 6), points=st.integers(1, 20))
def test_the_stacked_index_agrees_with_one_inequality_at_a_time(seed: int, n: int, regions: int, points: int) -> None:
    rng = np.random.default_rng(seed)
    stored, s = polytopes(rng, n, regions), rng.normal(size=(points, n))
    found = MembershipIndex(stored, n).locate(s)
    for i, point in enumerate(s):
        for j, polytope in enumerate(stored):
            distances = [(d - c @ point) / np.linalg.norm(c) for c, d in zip(polytope.C, polytope.d, strict=True)]
            assert found.margin[i, j] == pytest.approx(min(distances))
            if abs(min(distances)) > 1e-12:
                assert found.inside[i, j] == (min(distances) > 0) == bool(polytope.contains(point))


def test_no_regions_hold_nothing() -> None:
    found = MembershipIndex([], 3).locate(np.zeros((4, 3)))
    assert found.inside.shape == found.margin.shape == (4, 0)


def test_a_point_without_coordinates_is_outside_of_everything() -> None:
    everywhere = Polytope(np.zeros((1, 2)), np.ones(1))
    found = MembershipIndex([everywhere], 2).locate(np.array([[0.0, 0.0], [np.nan, 0.0]]))
    assert found.inside.tolist() == [[True], [False]]
    assert found.margin[1, 0] == -np.inf


def elbow() -> Scene:
    """One revolute joint, -1 to 2 rad, parametrised around 0.5."""
    eye = np.eye(4)
    turn = Joint("m/turn", JointKind.REVOLUTE, "world", "m/link", np.array([0.0, 0.0, 1.0]), eye, eye, 0, -1.0, 2.0)
    return Scene("elbow", (turn,), ("world", "m/link"), (), (), (), np.array([0.5]))


def test_a_full_turn_away_is_outside_although_s_is_the_same() -> None:
    scene = elbow()
    s = to_s(scene, np.array([[0.7], [0.7 + 2 * np.pi], [2.0], [2.1]]))
    assert s[0] == pytest.approx(np.tan(0.1))
    assert np.isfinite(s).ravel().tolist() == [True, False, True, False]

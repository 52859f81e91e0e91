"""Tubes about motions, against exact fractions and dense samples."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from planner.tubes import Tube, Tubes, follows

Numbers = st.floats(-2, 2, allow_nan=False).map(lambda x: round(x, 3))


def points(count: int, n: int) -> st.SearchStrategy[np.ndarray]:
    return st.lists(st.lists(Numbers, min_size=n, max_size=n), min_size=count, max_size=count).map(np.array)


def unlimited(n: int) -> tuple[np.ndarray, np.ndarray]:
    return np.full(n, -np.inf), np.full(n, np.inf)


def inside(tube: Tube, line: int, q: np.ndarray) -> bool:
    """Whether q is in the tube about a line, in exact fractions: the times that the joints allow have one in common."""
    low, high = Fraction(0), Fraction(1)
    for c, e, x in zip(tube.path[line].tolist(), tube.path[line + 1].tolist(), q.tolist(), strict=True):
        here, way, rho = Fraction(x) - Fraction(c), Fraction(e) - Fraction(c), Fraction(tube.rho)
        if way == 0:
            if abs(here) > rho:
                return False
            continue
        ends = sorted(((here - rho) / way, (here + rho) / way))
        low, high = max(low, ends[0]), min(high, ends[1])
    return low <= high


@given(points(4, 3), points(2, 3), st.floats(0.05, 1.0))
def test_spans_are_in_the_tubes_and_nothing_else_is(path, ends, rho):
    tube = Tube("one", path, rho)
    tubes = Tubes(unlimited(3), [tube])
    lines, spans = tubes.spans(*ends)
    found = dict(zip(tubes.place[lines].tolist(), spans.tolist(), strict=True))
    for line in range(3):
        first, last = found.get(line, (1.0, 0.0))
        for u in np.linspace(0, 1, 21):
            q = ends[0] + u * (ends[1] - ends[0])
            if first + 1e-9 < u < last - 1e-9:
                assert inside(tube, line, q)
            elif not first - 1e-9 <= u <= last + 1e-9:
                assert not inside(Tube("one", path, rho * (1 - 1e-9)), line, q)


@given(points(3, 2), points(1, 2), st.floats(0.05, 1.0))
def test_a_configuration_is_found_in_the_tubes_that_hold_it(path, q, rho):
    tube = Tube("one", path, rho)
    tubes = Tubes(unlimited(2), [Tube("far", path + 10, rho), tube])
    lines, times = tubes.at(q[0])
    assert (tubes.motion[lines] == 1).all()
    for line in range(2):
        if line in tubes.place[lines]:
            assert inside(tube, line, q[0])
        else:
            assert not inside(Tube("one", path, rho * (1 - 1e-9)), line, q[0])
    for line, time in zip(tubes.place[lines], times, strict=True):
        assert np.abs(path[line] + time * (path[line + 1] - path[line]) - q[0]).max() <= rho


@settings(max_examples=50)
@given(points(4, 3), st.floats(0.05, 0.5), st.floats(0, 1))
def test_a_path_follows_a_tube_only_if_all_of_it_is_inside(path, rho, part):
    tube, rng = Tube("one", path, rho), np.random.default_rng(0)
    fine = np.concatenate([path[i] + np.linspace(0, 1, 9)[:, None] * (path[i + 1] - path[i]) for i in range(3)])
    assert follows(tube, path)
    assert follows(tube, fine + rng.uniform(-1, 1, fine.shape) * rho * part * 0.999)
    far = fine.copy()
    far[13, 1] += 5.0
    assert not follows(tube, far)


def test_no_motions_hold_nothing():
    tubes = Tubes(unlimited(2), [])
    assert len(tubes) == 0
    assert len(tubes.at(np.zeros(2))[0]) == len(tubes.spans(np.zeros(2), np.ones(2))[0]) == 0


def test_a_tube_ends_at_the_joint_limits():
    tube = Tube("one", np.array([[0.0, 0.0], [1.0, 0.0]]), 0.2)
    tubes = Tubes((np.array([-1.0, -0.1]), np.array([1.0, 0.1])), [tube])
    assert len(tubes.at(np.array([0.5, 0.05]))[0]) == 1
    assert len(tubes.at(np.array([0.5, 0.15]))[0]) == len(tubes.at(np.array([1.1, 0.0]))[0]) == 0
    assert len(tubes.spans(np.array([0.5, 0.05]), np.array([0.5, 0.15]))[0]) == 0

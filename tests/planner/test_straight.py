"""Times of straight lines from rest to rest."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from planner.trajectory.straight import straight

Positions = st.lists(st.integers(-3000, 3000).map(lambda x: x / 1000), min_size=3, max_size=3).map(np.array)
Limits = st.lists(st.floats(-6, 6).map(lambda x: 10**x), min_size=3, max_size=3).map(np.array)


@given(Positions, Positions, Limits, Limits)
def test_a_line_keeps_its_limits_and_is_no_slower_than_it_has_to_be(a, b, speed, acceleration):
    q, t = straight(a, b, speed, acceleration, 0.1)
    assert np.array_equal(q[[0, -1]], [a, b])
    if (a == b).all():
        assert t.tolist() == [0, 0]
        return
    assert len(q) <= 200
    step = np.diff(t)[:, None]
    velocity = np.diff(q, axis=0) / step
    assert (np.abs(velocity) <= speed).all()
    assert (2 * np.abs(velocity[[0, -1]]) / step[[0, -1]] <= acceleration).all()
    assert (np.abs(np.diff(velocity, axis=0)) / ((step[1:] + step[:-1]) / 2) <= acceleration).all()
    way = np.abs(b - a)
    way = np.abs(b - a)
    moving = way > 0
    slowest = (way[moving] / speed[moving]).max() + 2 * np.sqrt((way[moving] / acceleration[moving]).max())
    assert t[-1] <= 1.5 * slowest
    part = (q - a) @ (b - a) / ((b - a) @ (b - a))
    assert (np.diff(part) >= -1e-12).all()
    assert np.allclose(q, a + part[:, None] * (b - a), atol=1e-9)

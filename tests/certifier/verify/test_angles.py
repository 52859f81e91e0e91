"""Cosines and sines in doubles, against ball arithmetic."""

from __future__ import annotations

import numpy as np
import pytest
from flint import arb, ctx

from certifier.errors import ProofError
from certifier.verify.angles import ERROR, LARGEST, cosines_and_sines


@pytest.fixture(autouse=True)
def _precise():
    with ctx.workprec(200):
        yield


def test_they_are_as_exact_as_is_said():
    rng = np.random.default_rng(0)
    turns = np.arange(-40, 41) * (np.pi / 8)
    scales = [rng.uniform(-scale, scale, 500) for scale in (1e-9, 1.0, 10.0, 1e3, LARGEST)]
    angles = np.concatenate([turns, np.nextafter(turns, np.inf), [0.0, LARGEST, -LARGEST], *scales])
    cosines, sines = cosines_and_sines(angles)
    for x, c, s in zip(angles, cosines, sines, strict=True):
        assert abs(arb(x).cos() - arb(c)) < ERROR
        assert abs(arb(x).sin() - arb(s)) < ERROR


@pytest.mark.parametrize("angle", [2 * LARGEST, np.inf, np.nan])
def test_larger_angles_are_refused(angle):
    with pytest.raises(ProofError):
        cosines_and_sines(np.array([0.0, angle]))

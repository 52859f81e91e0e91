"""What a statement prints is true as it is read."""

from __future__ import annotations

import math
import re
from dataclasses import replace
from fractions import Fraction

import pytest
from flint import fmpq
from hypothesis import given
from hypothesis import strategies as st

from certifier.proof.pair import PairProof
from certifier.verify.decimals import exactly, rounded_down, rounded_up
from certifier.verify.file import verify_file
from certifier.verify.pair import _lower_root, verify_pair
from certifier.verify.region import verify_region
from tests.certifier.proofs import files, region

finite = st.floats(allow_nan=False, allow_infinity=False)


@given(finite, st.integers(1, 17))
def test_the_decimals_enclose_the_double_closely(x, digits):
    low, high = Fraction(rounded_down(x, digits)), Fraction(rounded_up(x, digits))
    assert low <= Fraction(x) <= high
    assert high - low <= abs(Fraction(x)) * Fraction(10) ** (1 - digits)
    assert Fraction(exactly(x)) == Fraction(repr(x))
    assert float(exactly(x)) == x


@given(st.fractions(min_value=0).filter(bool), st.integers(-1200, 1200))
def test_the_root_is_a_lower_bound(x, power):
    """For numbers as tiny and as huge as rationals come; not a useless one between 2^-100 and 2^1000."""
    exact = x * Fraction(2) ** power
    root = _lower_root(fmpq(exact.numerator, exact.denominator))
    assert 0 <= Fraction(root) ** 2 <= exact
    if Fraction(2) ** -100 < exact < Fraction(2) ** 1000:
        assert Fraction(root) ** 2 > exact * (1 - Fraction(2) ** -50)


@pytest.mark.parametrize("x", [4, Fraction(1, 9), Fraction(2) ** -2200, Fraction(2) ** 1744, Fraction(2) ** 4000, (2**60 - 1) ** 2])
def test_the_root_of_awkward_numbers(x):
    exact = Fraction(x)
    assert Fraction(_lower_root(fmpq(exact.numerator, exact.denominator))) ** 2 <= exact


def test_a_region_states_bounds_on_the_safe_side():
    statement = verify_region(region())
    for gap in (0.1096, statement.gap):
        changed = replace(statement, gaps=dict.fromkeys(statement.gaps, gap), N=1.2345678)
        text = "\n".join(changed.lines())
        assert Fraction(re.search(r"at least (\S+) m", text)[1]) <= Fraction(gap)
        assert Fraction(re.search(r"\|s\|\^2 <= (\S+)", text)[1]) >= Fraction(1.2345678)


def test_a_region_states_the_models_numbers_exactly():
    """Padding, joint limits and the centre, whatever their digits."""
    statement = verify_region(region())
    limits = [replace(joint, lower=-math.pi / 7, upper=math.sqrt(2)) for joint in statement.scene.joints]
    changed = replace(statement.scene, joints=tuple(limits), q_star=statement.scene.q_star + 1 / 3, padding=1 / 300)
    text = "\n".join(replace(statement, scene=changed).lines())
    for x in (-math.pi / 7, math.sqrt(2), *changed.q_star.tolist(), 1 / 300):
        assert repr(x) in text


def test_a_pair_states_its_distance_rounded_down():
    data = files()["pair"]
    statement = verify_file(data)
    gap = verify_pair(PairProof.from_bytes(data, statement.scene)).gap
    (printed,) = (Fraction(found[1]) for found in (re.search(r"at least (\S+) m", line) for line in statement.lines) if found)
    assert Fraction(gap) * Fraction(99, 100) < printed <= Fraction(gap)

"""Multipliers as proofs store them."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from certifier.model import WORLD, Polytope
from certifier.partition.certification import CellCertification
from certifier.partition.multipliers import BITS, rounded
from certifier.proof.partition import EMPTY, PartitionProof
from tests.certifier.scenes import box, cube, planar_arm


def bits(value: float) -> int:
    """Returns how many bits a number has between its highest and its lowest one."""
    return abs(Fraction(float(value)).numerator).bit_length()


@given(st.floats(1e-30, 1e30))
def test_a_multiplier_is_the_nearest_number_of_few_bits(value: float) -> None:
    found = float(rounded(value))
    assert found == np.float32(found)
    assert abs(Fraction(found) - Fraction(value)) <= Fraction(value) / 2**BITS
    whole = Fraction(found) / Fraction(2) ** (int(np.floor(np.log2(found))) + 1 - BITS)
    assert whole.denominator == 1


def test_nothing_stays_nothing() -> None:
    assert rounded(0.0) == 0.0


def test_the_multipliers_of_a_proof_have_few_bits() -> None:
    scene = planar_arm(2, box("world/obstacle", WORLD, (0.3, 0.3, 0.3), (0.8, 1.2, 0.0)))
    rows = cube(scene, np.zeros(2), 0.25)
    narrow = Polytope(np.insert(rows.C, 4, [0.5, 1.0], axis=0), np.insert(rows.d, 4, 0.075))
    found = CellCertification(scene, narrow).certify(len(scene.pairs) - 1, 1000)
    proof = PartitionProof.from_bytes(found.proof or b"", scene)
    assert len(proof.multipliers)
    assert EMPTY not in proof.nodes
    assert all(bits(value) <= BITS for value in proof.multipliers)

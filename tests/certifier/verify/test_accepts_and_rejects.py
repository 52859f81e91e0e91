"""The verifier accepts what the certifier makes and rejects everything else: edited, scaled, truncated, hand-made."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from certifier.errors import ProofError
from certifier.jobs.region import certified_region
from certifier.model import WORLD, Scene, Volume
from certifier.pair.certification import Certification
from certifier.proof.pair import PairProof, Side
from certifier.proof.region import Implied, RegionProof
from certifier.verify.pair import verify_pair
from certifier.verify.region import verify_region
from tests.certifier.scenes import accepted, ball, box, cube, planar_arm


@cache
def instance() -> tuple[Scene, bytes]:
    """A two-link arm with a ball at its tip, a box obstacle, and the proof of a region for all its pairs."""
    base = planar_arm(2, box("world/obstacle", WORLD, (0.3, 0.3, 0.3), (0.8, 1.0, 0.0)))
    tip = ball("arm/link2/tip", "arm/link2", 0.05, (1.0, 0.0, 0.0))
    pair = type(base.pairs[0])("arm/link2/tip", "world/obstacle")
    scene = replace(base, geometries=(*base.geometries, tip), pairs=(*base.pairs, pair))
    region = cube(scene, 0.0, 0.1)
    shared = Certification(scene, region, np.zeros(2))
    proofs = {i: shared.certify(i).proof for i in range(len(scene.pairs))}
    return scene, certified_region(scene, accepted(region, np.zeros(2)), proofs, {}).proof


def pair_proof(index: int = 1) -> tuple[Scene, PairProof]:
    scene, _ = instance()
    alone = replace(scene, pairs=(scene.pairs[index],))
    return alone, PairProof.from_bytes(Certification(alone, cube(alone, 0.0, 0.1), np.zeros(2)).certify(0).proof, alone)


def test_a_valid_proof_says_what_it_proves():
    scene, data = instance()
    statement = verify_region(data)
    assert {(p.a, p.b) for p in statement.gaps} == {(p.a, p.b) for p in scene.pairs}
    assert statement.gap > 0
    text = "\n".join(statement.lines())
    assert scene.hash in text
    assert "exact" in text


def test_a_region_may_be_looser_along_a_normal_than_the_polytopes_of_its_proofs():
    """A cube's faces, which the region has no more, are parallel to the joint limits, which it has."""
    scene, data = instance()
    tilted = np.array([[1.0, 1.0], [1.0, -1.0], [-1.0, 1.0], [-1.0, -1.0]])
    region = scene.polytope(tilted, np.full(4, 0.05))
    parts = RegionProof.from_bytes(data).proofs
    proofs = {i: proof.to_bytes() for i, pair in enumerate(scene.pairs) for proof in parts if pair in proof.pairs}
    statement = verify_region(certified_region(scene, accepted(region, np.zeros(2)), proofs, {}).proof)
    assert statement.gap > 0


def rejected(proof, code=None):
    with pytest.raises(ProofError) as refusal:
        verify_pair(proof)
    assert code is None or refusal.value.code == code, refusal.value.code


@pytest.mark.parametrize("index", [0, 1, 2])
def test_false_statements_are_rejected(index):
    scene, proof = pair_proof(index)
    verify_pair(proof)
    rejected(replace(proof, t=proof.t * 1000), "proof_residual")
    rejected(replace(proof, t=0.0), "proof_margin")
    rejected(replace(proof, t=-proof.t), "proof_margin")
    rejected(replace(proof, volumes=proof.volumes[::-1]))
    rejected(replace(proof, plane=-proof.plane), "proof_residual")
    rejected(replace(proof, frame="nowhere"), "proof_frame")
    rejected(replace(proof, volumes=(replace(proof.volumes[0], geometries=("arm/link1/nothing",)), proof.volumes[1])), "proof_pair")
    rejected(replace(proof, ground=replace(proof.ground, d=proof.ground.d + 0.2)))
    rejected(replace(proof, ground=replace(proof.ground, C=-proof.ground.C)))
    rejected(replace(proof, ground=replace(proof.ground, half=proof.ground.half * 0.9)))
    rejected(replace(proof, sides=(proof.sides[0], replace(proof.sides[1], exponent=proof.sides[1].exponent + 10))), "proof_residual")
    rejected(replace(proof, sides=(replace(proof.sides[0], mantissa=proof.sides[0].mantissa[:, :-1]), proof.sides[1])))
    rejected(replace(proof, scene=replace(scene, padding=scene.padding + 0.5)))


def test_a_normal_longer_than_kappa_is_rejected():
    _, proof = pair_proof(2)
    rejected(replace(proof, kappa=proof.kappa / 10), "proof_norm")


def test_a_proof_of_another_model_is_rejected_even_if_it_claims_its_hash():
    """Edited kinematics: the identities no longer hold."""
    scene, proof = pair_proof(1)
    moved = scene.joints[1].X_PF.copy()
    moved[0, 3] += 1.0
    edited = replace(scene, joints=(scene.joints[0], replace(scene.joints[1], X_PF=moved)))
    with pytest.raises(ProofError) as refusal:
        PairProof.from_bytes(proof.to_bytes(), edited)
    assert refusal.value.code == "proof_scene"
    rejected(replace(proof, scene=edited), "proof_residual")


def test_a_hand_made_proof_with_tiny_residuals_is_rejected():
    """Touching bodies, a plane through the contact, squares that fit to 1e-6, and the claim of a margin of 1e-9."""
    scene = planar_arm(1, box("world/obstacle", WORLD, (0.2, 0.2, 0.2), (0.5, 0.15, 0.0)))
    free = planar_arm(1, box("world/obstacle", WORLD, (0.2, 0.2, 0.2), (0.5, 0.15 + 2e-6, 0.0)))
    result = Certification(free, cube(free, 0.0, 1e-7), np.zeros(1)).certify(0)
    assert result.proof is not None, result
    forged = replace(PairProof.from_bytes(result.proof, free), scene=scene)
    forged = replace(forged, volumes=(Volume.of(scene.geometry("arm/link1/bar")), Volume.of(scene.geometry("world/obstacle"))))
    rejected(forged, "proof_residual")
    rejected(replace(forged, t=1e-9), "proof_residual")


@settings(max_examples=60)
@given(st.integers(0, 2), st.integers(0, 1), st.data())
def test_a_changed_gram_factor_is_noticed(index, side, data):
    _, proof = pair_proof(index)
    chosen = proof.sides[side]
    mantissa = chosen.mantissa.copy()
    flat = mantissa.reshape(-1)
    large = np.flatnonzero(np.abs(flat) > 1 << 27)
    flat[large[data.draw(st.integers(0, len(large) - 1))]] *= -1
    flipped = Side(chosen.chain, mantissa, chosen.exponent)
    sides = (flipped, proof.sides[1]) if side == 0 else (proof.sides[0], flipped)
    try:
        statement = verify_pair(replace(proof, sides=sides))
    except ProofError:
        return
    # The statement may survive with a smaller margin, or whole if the sign only mirrors a column.
    assert statement.gap <= verify_pair(proof).gap * (1 + 1e-9)


@pytest.mark.parametrize("length", [0, 10, 1000, -1])
def test_a_truncated_file_is_malformed(length):
    with pytest.raises(ProofError) as refusal:
        verify_region(instance()[1][:length])
    assert refusal.value.code == "proof_malformed"


def test_a_region_that_drops_a_pair_or_grows_is_rejected():
    _, data = instance()
    region = RegionProof.from_bytes(data)
    for forged, code in (
        (replace(region, proofs=region.proofs[1:]), "proof_pairs"),
        (replace(region, d=region.d + 0.01), "proof_limits"),
        (replace(region, d=np.concatenate([region.d[:4] + 0.01, region.d[4:]])), "proof_ground"),
        (replace(region, C=region.C[4:], d=region.d[4:]), "proof_malformed"),
        (replace(region, interior=region.interior + 1.0), "proof_interior"),
        (replace(region, archimedean=replace(region.archimedean, N=region.archimedean.N / 2)), "proof_archimedean"),
    ):
        with pytest.raises(ProofError) as refusal:
            verify_region(forged.to_bytes())
        assert refusal.value.code in (code, "proof_archimedean"), refusal.value


def test_numbers_that_are_not_finite_are_malformed():
    _, data = instance()
    region = RegionProof.from_bytes(data)
    for value in (np.nan, np.inf):
        with pytest.raises(ProofError):
            verify_region(replace(region, interior=np.full(2, value)).to_bytes())


def grown_in_two() -> RegionProof:
    """A pair certified on a polytope whose face s_0 <= 0.1 went later, implied by others; the joint limit has its normal."""
    scene, larger = instance()[0], cube(instance()[0], 0.0, 0.1)
    shared = Certification(scene, larger, np.zeros(2))
    proofs = {i: shared.certify(i).proof for i in range(len(scene.pairs))}
    region = scene.polytope([[1.0, 1.0], [-1.0, 0.0], [0.0, 1.0], [0.0, -1.0]], [0.05, 0.1, 0.1, 0.02])
    return RegionProof.from_bytes(certified_region(scene, accepted(region, np.zeros(2)), proofs, {}).proof)


def test_faces_of_a_ground_that_went_are_implied_by_those_that_stayed():
    proof = grown_in_two()
    assert len(proof.implied.d) == 1
    assert len(verify_region(proof.to_bytes()).gaps) == len(proof.scene.pairs)


@pytest.mark.parametrize("change", ["offset", "multipliers", "missing"])
def test_implied_faces_that_are_not_proved_are_rejected(change):
    proof = grown_in_two()
    implied = proof.implied
    if change == "offset":
        implied = replace(implied, d=implied.d - 0.01)
    elif change == "multipliers":
        implied = replace(implied, Y=0.5 * implied.Y)
    else:
        implied = Implied(implied.C[:0], implied.d[:0], implied.Y[:0])
    with pytest.raises(ProofError):
        verify_region(replace(proof, implied=implied).to_bytes())

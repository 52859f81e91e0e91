"""Joint limits in s are doubles that leave no configuration within the limits out: with a steep face a rounding is metres."""

from __future__ import annotations

import numpy as np
import pytest
from flint import arb, ctx

from certifier.errors import ProofError
from certifier.model import WORLD, Joint, JointKind, Pair, Scene, Volume
from certifier.proof.ground import Ground
from certifier.proof.negative import WitnessProof
from certifier.proof.pair import PairProof, Side
from certifier.verify.pair import verify_pair
from certifier.verify.witness import verify_witness
from tests.certifier.scenes import ball, pose

X, Z = np.array([1.0, 0.0, 0.0]), np.array([0.0, 0.0, 1.0])


def slide_beside(first: Joint, q_star: float, obstacle: float) -> Scene:
    """A joint that moves nothing of interest, and one that slides a ball of 0.1 m along x towards a ball at the obstacle's place."""
    slide = Joint("slide", JointKind.PRISMATIC, WORLD, "b1", X, pose(), pose(), 1, -1.0, 100.0)
    balls = (ball("b1/ball", "b1", 0.1), ball("world/ball", WORLD, 0.1, (obstacle, 0.0, 0.0)))
    pairs = (Pair("b1/ball", "world/ball"),)
    return Scene("limits", (first, slide), (WORLD, "b0", "b1"), balls, pairs, (), np.array([q_star, 0.0]))


def claimed(scene: Scene, slope: float, d: float, half: float, hit: float) -> PairProof:
    """The balls never meet on slope s_0 + s_1 <= d, since s_0 is at least its limit and s_1 therefore at most 0."""
    n, m = 2, 1
    Y_upper, Y_lower = np.zeros((n, m + 2 * n)), np.zeros((n, m + 2 * n))
    Y_upper[0, m] = Y_lower[0, m + n] = Y_lower[1, m + n + 1] = Y_upper[1, 0] = 1.0
    Y_upper[1, m + n] = slope
    mid = np.array([(scene.s_lower[0] + scene.s_upper[0]) / 2, -0.5])
    h = 0.5000001
    ground = Ground(np.array([[slope, 1.0]]), np.array([d]), mid, np.array([half, h]), Y_lower, Y_upper)
    t, r, middle = min(0.1, hit / 8), 0.1, hit / 2
    plane = np.zeros((4, 3))
    plane[0, 0], plane[3, 0] = 1.0, -middle
    A = Side.rounded((), np.sqrt([[[[hit - middle - r - t]], [[1e-9]]]]))
    L0, L1 = np.zeros((2, 2)), np.zeros((2, 2))
    L0[0, 0], L1[0, 0] = np.sqrt(0.5 + middle - r - t - h), np.sqrt(h)
    B = Side.rounded((1,), np.array([[L0, L1]]))
    volumes = (Volume.of(scene.geometries[1]), Volume.of(scene.geometries[0]))
    inside = np.array([np.nextafter(scene.s_lower[0], np.inf), -0.9])
    return PairProof(scene, volumes, WORLD, ground, inside, plane, t, 1.0, (m + n + 1,), (A, B))


def test_a_steep_face_at_a_revolute_joints_limit_hides_no_collision():
    """At q_0 = -2, its limit, the face allows q_1 up to where the obstacle is; the limit rounded inwards said that it allows 0."""
    turn = Joint("turn", JointKind.REVOLUTE, WORLD, "b0", Z, pose(), pose(), 0, -2.0, 2.0)
    slope, gains = 2.0**57, {}
    with ctx.workprec(300):
        for k in range(1, 40):
            exactly = ((arb(-2.0) - arb(k / 100)) / 2).tan()
            gains[k / 100] = float(arb(slope) * (arb(float(exactly.mid())) - exactly)), float(exactly.mid())
    q_star, (gain, rounded) = max(gains.items(), key=lambda found: found[1][0])
    assert gain > 2
    scene = slide_beside(turn, q_star, float(int(0.9 * gain)))
    half = (scene.s_upper[0] - scene.s_lower[0]) / 2 * 1.00001
    with pytest.raises(ProofError) as refusal:
        verify_pair(claimed(scene, slope, rounded * slope, half, float(int(0.9 * gain))))
    assert refusal.value.code == "proof_box"


def test_a_centre_far_away_hides_no_collision():
    """At q = (-7, 5), within the limits, q_0 + q_1 <= 0 and the balls coincide; q_0 - q* was rounded by 7 m."""
    first = Joint("first", JointKind.PRISMATIC, WORLD, "b0", X, pose(), pose(), 0, -7.0, 7.0)
    for q_star in (1e17, 1e5):
        scene = slide_beside(first, q_star, 5.0)
        with pytest.raises(ProofError) as refusal:
            verify_pair(claimed(scene, 1.0, -q_star, 64.0, 5.0))
        assert refusal.value.code == ("proof_model" if q_star > 1e6 else "proof_box")


def test_a_witness_is_within_the_limits_beyond_their_rounding():
    first = Joint("first", JointKind.PRISMATIC, WORLD, "b0", X, pose(), pose(), 0, -0.1, 0.1)
    scene = slide_beside(first, 1e5, 5.0)
    none = np.zeros((0, 2)), np.zeros(0)
    one = (np.ones(1), np.ones(1))
    for s, holds in ((np.nextafter(scene.s_lower[0], np.inf), True), (scene.s_lower[0], False)):
        witness = WitnessProof(scene, scene.pairs[0], *none, np.array([s, 5.0]), one)
        if holds:
            verify_witness(witness)
        else:
            with pytest.raises(ProofError):
                verify_witness(witness)

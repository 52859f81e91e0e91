"""Programs with fewer joints in play than the scene has: what they prove is proved, what they do not is not disproved."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from certifier.conic.basis import dimension
from certifier.errors import ProofError
from certifier.growth.options import GrowthOptions
from certifier.growth.paper.options import PaperOptions
from certifier.jobs.local import grow
from certifier.kinematics import Kinematics
from certifier.model import WORLD, Pair
from certifier.outcome import Outcome
from certifier.pair.certification import Certification, certify_pair
from certifier.pair.forecast import forecast
from certifier.pair.frames import LARGEST
from certifier.proof.negative import DualProof
from certifier.proof.pair import PairProof
from certifier.scene import load_scene
from certifier.verify.dual import verify_dual
from certifier.verify.pair import verify_pair
from certifier.verify.region import verify_region
from tests.certifier.scenes import ball, box, cube, planar_arm, two_arms

TIPS = 8
"""The pair of the two last links, three joints on either side."""


@pytest.fixture
def at_rest(monkeypatch):
    """Every plane has to be at rest."""
    monkeypatch.setattr("certifier.pair.frames.AFFORDABLE", 0)
    monkeypatch.setattr("certifier.pair.frames.LARGEST", 0)
    monkeypatch.setattr("certifier.pair.frames.Frame.memory", lambda frame, _: len(frame.joints))


def proved(scene, region, index, center=None):
    result = Certification(scene, region, center).certify(index)
    assert result.outcome is Outcome.CERTIFIED, result
    proof = PairProof.from_bytes(result.proof, scene)
    assert verify_pair(proof).gap == result.margin
    return proof


@pytest.mark.usefixtures("at_rest")
@pytest.mark.parametrize("half", [0.01, 0.1, 0.3])
def test_a_plane_at_rest_separates_two_arms(half):
    scene = two_arms(3, apart=7.0)
    proof = proved(scene, cube(scene, 0.0, half), TIPS)
    assert not proof.plane[:, 1:].any()
    assert [side.chain for side in proof.sides] == [(0, 1, 2), (3, 4, 5)]
    assert len(proof.faces) == 2 * scene.n


@pytest.mark.usefixtures("at_rest")
def test_arms_that_touch_are_refuted_whatever_the_plane():
    scene = two_arms(3, apart=5.9)
    result = Certification(scene, cube(scene, 0.0, 0.1)).certify(TIPS)
    assert result.outcome is Outcome.REFUTED


@pytest.mark.usefixtures("at_rest")
def test_a_factor_that_is_changed_is_refused():
    scene = two_arms(3)
    proof = proved(scene, cube(scene, 0.0, 0.1), TIPS)
    side = proof.sides[0]
    for face in np.flatnonzero(side.mantissa.any(axis=(0, 2))):
        mantissa = side.mantissa.copy()
        mantissa[0, face] *= 2
        with pytest.raises(ProofError):
            verify_pair(replace(proof, sides=(replace(side, mantissa=mantissa), proof.sides[1])))


def hook():
    """A ball on the left arm that swings around one on the right arm: apart everywhere, but in each other's convex hulls."""
    scene = two_arms(1, apart=1.6, limit=1.2)
    left, right = ball("left/tip", "left/link1", 0.1, (1.0, 0.0, 0.0)), ball("right/tip", "right/link1", 0.1, (1.0, 0.0, 0.0))
    pair = replace(scene.pairs[0], a=left.name, b=right.name)
    return replace(scene, geometries=(left, right), pairs=(pair,))


def test_what_no_plane_at_rest_separates_is_left_open_and_a_plane_that_moves_settles_it(request):
    scene = hook()
    C, d = np.array([[0.0, 1.0], [0.0, -1.0]]), np.array([0.05, 0.05])
    region = scene.polytope(C, d)
    assert proved(scene, region, 0).plane[:3, 1:].any()
    request.getfixturevalue("at_rest")
    result = Certification(scene, region).certify(0)
    assert result.outcome is Outcome.INCONCLUSIVE
    assert result.proof is None
    assert "no plane at rest" in result.detail
    assert result.weakness is not None
    assert region.contains(result.weakness.points).all()
    assert (result.weakness.pull >= 0).all()
    assert result.weakness.pull.argmax() == 0


@pytest.mark.usefixtures("at_rest")
def test_growth_cuts_where_planes_at_rest_fail():
    scene = two_arms(2, apart=3.5)
    limits = scene.polytope([], [])
    assert any(Certification(scene, limits, np.full(4, 0.3)).certify(i).outcome is not Outcome.CERTIFIED for i in range(4))
    seed = {"method": "polytope", "C": limits.C.tolist(), "d": limits.d.tolist(), "center": [0.3] * 4}
    region = grow(scene, GrowthOptions(seed=seed, paper=PaperOptions(contractions=1, pushes=1, max_rounds=0)))
    assert verify_region(region.proof).gap > 0
    assert region.manifest["volume"]["ellipsoid"] > 0.01


def test_joints_that_are_not_between_the_bodies_cost_nothing():
    """The same pair of the same arms, alone and beside two more arms."""
    alone, extra = two_arms(3), two_arms(2, apart=30.0)
    renamed = {body: body if body == WORLD else f"other/{body}" for body in extra.bodies}
    joints = [
        replace(j, name=f"other/{j.name}", parent=renamed[j.parent], child=renamed[j.child], index=j.index + alone.n) for j in extra.joints
    ]
    bodies = [renamed[body] for body in extra.bodies if body != WORLD]
    beside = replace(alone, joints=(*alone.joints, *joints), bodies=(*alone.bodies, *bodies), q_star=np.zeros(alone.n + extra.n))
    costs = [forecast(scene)[TIPS] for scene in (alone, beside)]
    assert (costs[0].N_a, costs[0].N_b, costs[0].memory_bytes) == (costs[1].N_a, costs[1].N_b, costs[1].memory_bytes)
    proofs = [proved(scene, cube(scene, 0.0, 0.1), TIPS) for scene in (alone, beside)]
    assert proofs[0].plane[:, 1:].any()
    assert not proofs[1].plane[:, 1 + alone.n :].any()


def test_faces_in_other_joints_are_used_where_they_are_needed():
    """The second link's joints are kept from the obstacle by two faces together, each of which involves the third joint."""
    scene = planar_arm(3, box("world/obstacle", WORLD, (0.3, 0.3, 0.3), (1.0, 1.4, 0.0)))
    center, region = np.array([-0.2, -0.2, 0.0]), cube(scene, 0.0, 0.5)
    assert certify_pair(scene, 1, region, center).outcome is not Outcome.CERTIFIED
    faces = np.array([[1.0, 0.0, 1.0], [0.0, 1.0, -1.0]])
    proof = proved(scene, scene.polytope(np.concatenate([faces, region.C]), np.concatenate([[0.0, 0.1], region.d])), 1, center)
    assert {tuple(proof.ground.C[j]) for j in proof.faces if j < len(proof.ground.C)} >= {tuple(face) for face in faces}


@pytest.mark.parametrize("rounded", [False, True])
def test_a_dual_proof_covers_joints_that_are_not_in_play(rounded):
    """The program knew two of three joints; the proof is about planes that move with all of them."""
    scene = planar_arm(3, box("world/block", WORLD, (0.1, 0.1, 0.1), (1.2, 1.0, 0.0)), limit=2.5)
    tip = ball("tip", "arm/link2", 0.05, (1, 0, 0)) if rounded else box("tip", "arm/link2", (0.1, 0.1, 0.1), (1, 0, 0))
    scene = replace(scene, geometries=(*scene.geometries, tip), pairs=(Pair(tip.name, "world/block"),))
    center = np.array([0.0, 0.0, 0.1])
    results = [certify_pair(scene, 0, cube(scene, 0.0, half), center) for half in (0.2, 0.5, 0.6, 0.7, 0.8)]
    assert results[0].outcome is Outcome.CERTIFIED
    proofs = [DualProof.from_bytes(r.proof, scene) for r in results if r.outcome is Outcome.NOT_CERTIFIABLE]
    assert proofs, [r.outcome for r in results]
    for proof in proofs:
        assert verify_dual(proof).slack == 0
        k = len(Kinematics(scene).chain(proof.frame, tip.body))
        assert proof.moments[0].shape[1] == dimension(k, k, scene.n - k)


def test_every_pair_of_two_six_joint_arms_fits_a_small_machine():
    costs = forecast(load_scene("examples/dual_ur3e/scene.yaml"))
    assert max(cost.memory_bytes for cost in costs) <= LARGEST
    assert sum(cost.seconds for cost in costs) < 20
    wrists = next(cost for cost in costs if (cost.a, cost.b) == ("left/wrist_3/box", "right/wrist_3/box"))
    assert (wrists.joints, wrists.N_a, wrists.N_b) == (0, 3**6, 3**6)
    within = next(cost for cost in costs if (cost.a, cost.b) == ("left/base/box", "left/wrist_3/box"))
    assert (within.joints, within.N_a) == (6, dimension(3, 3, 3))

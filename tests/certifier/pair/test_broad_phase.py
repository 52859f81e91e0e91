"""Volumes of several geometries: they contain them exactly, their proofs hold, and no verdict changes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from flint import Ordering, fmpq_mpoly_ctx
from hypothesis import given
from hypothesis import strategies as st

from certifier.kinematics import Kinematics
from certifier.model import WORLD, Joint, JointKind, Pair, Scene
from certifier.outcome import Outcome
from certifier.pair.broad_phase import BroadPhase
from certifier.pair.certification import Certification
from certifier.proof.pair import PairProof
from certifier.verify.kinematics import ExactKinematics
from certifier.verify.pair import verify_pair
from certifier.verify.volume import check_volume
from tests.certifier.scenes import ball, box, cube, planar_arm, pose


def crowd(positions, weld=False) -> Scene:
    """A planar arm among blocks, on the world or on a stand welded to it."""
    base = planar_arm(2)
    bars = base.geometries[:2]
    body = "stand" if weld else WORLD
    blocks = [box(f"{body}/block{i}", body, (0.2, 0.2, 0.2), position) for i, position in enumerate(positions)]
    joints, bodies = base.joints, base.bodies
    if weld:
        joints += (Joint("stand/weld", JointKind.WELD, WORLD, "stand", np.zeros(3), pose((0.0, 0.0, 0.0), (1, 2, 3), 0.7), np.eye(4)),)
        bodies += ("stand",)
    pairs = tuple(Pair(*sorted((bar.name, block.name))) for bar in bars for block in blocks)
    return replace(base, joints=joints, bodies=bodies, geometries=(*bars, *blocks), pairs=pairs)


def shelf(near=()):
    """Sixteen blocks three metres away, and some more."""
    return [*((3.0 + 0.2 * i, 0.4 * j, 0.0) for i in range(4) for j in range(4)), *near]


@pytest.mark.parametrize("weld", [False, True])
def test_one_proof_covers_all_blocks_that_are_far(weld):
    scene = crowd(shelf(), weld)
    shared = Certification(scene, cube(scene, 0.0, 0.1), np.zeros(2))
    results = [shared.certify(index) for index in range(len(scene.pairs))]
    assert all(result.outcome is Outcome.CERTIFIED for result in results)
    assert len({result.proof for result in results}) == 2
    for index, result in enumerate(results):
        proof = PairProof.from_bytes(result.proof, scene)
        assert scene.pairs[index] in proof.pairs
        assert verify_pair(proof).gap == result.margin > 0


def test_a_block_in_the_way_is_found_and_the_others_keep_their_proofs():
    scene = crowd(shelf([(1.9, 0.0, 0.0)]))
    shared = Certification(scene, cube(scene, 0.0, 0.1), np.zeros(2))
    outcomes = {pair: shared.certify(index).outcome for index, pair in enumerate(scene.pairs)}
    refuted = {pair for pair, outcome in outcomes.items() if outcome is Outcome.REFUTED}
    assert refuted == {Pair("arm/link2/bar", "world/block16")}
    assert set(outcomes.values()) == {Outcome.CERTIFIED, Outcome.REFUTED}


def test_verdicts_are_those_of_single_pairs():
    rng = np.random.default_rng(5)
    scene = crowd([(*rng.uniform(-3, 3, 2), 0.0) for _ in range(30)])
    region = cube(scene, 0.0, 0.3)
    shared = Certification(scene, region, np.zeros(2))
    for index, pair in enumerate(scene.pairs):
        alone = replace(scene, pairs=(pair,))
        assert shared.certify(index).outcome is Certification(alone, region, np.zeros(2)).certify(0).outcome


def test_the_result_does_not_depend_on_the_order():
    scene = crowd(shelf([(1.9, 0.0, 0.0), (1.5, 0.9, 0.0)]))
    region, order = cube(scene, 0.0, 0.1), range(len(scene.pairs))
    forward, backward = (Certification(scene, region, np.zeros(2)) for _ in range(2))
    expected = {index: forward.certify(index).proof for index in order}
    assert {index: backward.certify(index).proof for index in reversed(order)} == expected


def test_a_body_with_many_vertices_is_certified_by_its_box():
    points = np.random.default_rng(0).normal(size=(60, 3))
    points = 0.1 * points / np.linalg.norm(points, axis=1)[:, None] + [3.0, 0.0, 0.0]
    scene = crowd([(3.0, 0.0, 0.0)])
    scene = replace(scene, geometries=(*scene.geometries[:2], replace(scene.geometries[2], vertices=points)))
    result = Certification(scene, cube(scene, 0.0, 0.1), np.zeros(2)).certify(0)
    assert result.outcome is Outcome.CERTIFIED
    assert [len(volume.vertices) for volume in PairProof.from_bytes(result.proof, scene).volumes] == [8, 8]


@given(st.integers(0, 2**32 - 1), st.integers(1, 12))
def test_every_volume_contains_its_geometries_exactly(seed, count):
    rng = np.random.default_rng(seed)
    weld = Joint(
        "tool/weld", JointKind.WELD, "arm/link2", "tool", np.zeros(3), pose(rng.normal(size=3), rng.normal(size=3), 1.0), np.eye(4)
    )
    base = planar_arm(2)
    bodies = ["tool" if rng.random() < 0.5 else "arm/link2" for _ in range(count)]
    parts = [
        ball(f"{body}/{i}", body, rng.uniform(0.01, 0.5), rng.normal(size=3))
        if rng.random() < 0.5
        else box(f"{body}/{i}", body, rng.uniform(0.01, 0.5, 3), rng.normal(size=3))
        for i, body in enumerate(bodies)
    ]
    pairs = tuple(Pair(*sorted((part.name, "world/obstacle"))) for part in parts)
    scene = replace(base, joints=(*base.joints, weld), bodies=(*base.bodies, "tool"), geometries=(*parts, base.geometries[-1]), pairs=pairs)
    tried = []
    broad_phase = BroadPhase(Kinematics(scene), tried.append)
    for pair in pairs:
        assert broad_phase.find(pair) is None
    exact = ExactKinematics.on_box(scene, fmpq_mpoly_ctx.get(["u0", "u1"], Ordering.lex), np.zeros(2), np.ones(2))
    assert len(tried) <= 2 * count
    for volumes in tried:
        for volume in volumes:
            check_volume(scene, exact, volume)

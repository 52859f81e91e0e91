"""Verdicts on small instances whose answer is known, each feasible class beside its infeasible twin."""

from __future__ import annotations

import numpy as np
import pytest

from certifier.errors import RegionError
from certifier.model import WORLD, JointKind
from certifier.outcome import Outcome, Stage
from certifier.pair.certification import Certification, certify_pair
from certifier.polytopes.closest import closest
from certifier.proof.pair import PairProof
from certifier.verify.pair import verify_pair
from tests.certifier.scenes import box, cube, obstacle, planar_arm


@pytest.mark.parametrize("shape", ["box", "ball"])
@pytest.mark.parametrize("kind", [JointKind.REVOLUTE, JointKind.PRISMATIC])
@pytest.mark.parametrize("links", [1, 2, 3])
def test_free_arm_is_certified_and_its_twin_refuted(links, kind, shape):
    free = planar_arm(links, obstacle(1.2, shape), kind=kind)
    region = cube(free, 0.0, 0.05)
    shared = Certification(free, region, np.zeros(links))
    for index in range(len(free.pairs)):
        result = shared.certify(index)
        assert result.outcome is Outcome.CERTIFIED, result
        statement = verify_pair(PairProof.from_bytes(result.proof, free))
        assert result.margin == statement.gap
        assert 0 < statement.gap <= _sampled_distance(free, index, region)
    blocked = planar_arm(links, obstacle(0.1, shape), kind=kind)
    results = [certify_pair(blocked, index, cube(blocked, 0.0, 0.05), np.zeros(links)) for index in range(len(blocked.pairs))]
    touching = [r for r in results if r.outcome is Outcome.REFUTED]
    assert touching
    assert all(r.stage is Stage.SCREEN and np.abs(r.witness_s).max() <= 0.05 for r in touching)
    assert not any(
        r.outcome is Outcome.CERTIFIED and _sampled_distance(blocked, i, cube(blocked, 0.0, 0.05)) <= 0 for i, r in enumerate(results)
    )


def _sampled_distance(scene, index, region):
    shared = Certification(scene, region)
    pair = scene.pairs[index]
    a, b = scene.geometry(pair.a), scene.geometry(pair.b)
    kinematics = shared._kinematics
    A, B = (kinematics.points(WORLD, g.body, g.vertices, shared.screen.configurations) for g in (a, b))
    return min(closest(x, y).gap for x, y in zip(A, B, strict=True)) - a.radius - b.radius - 2 * scene.padding


def test_a_pair_that_is_free_but_sweeps_around_the_obstacle_is_not_certifiable():
    """The link passes the obstacle on both sides within the polytope: collision somewhere, refuted; and never certified."""
    scene = planar_arm(1, box("world/obstacle", WORLD, (0.05, 0.05, 0.05), (0.9, 0.0, 0.0)), limit=2.5)
    result = certify_pair(scene, 0, cube(scene, 0.0, 1.5), np.array([1.2]))
    assert result.outcome is Outcome.REFUTED


def test_certified_region_can_be_enlarged_until_it_is_not():
    """Monotone: certified on a polytope means certified on its subsets; the answer flips once and only once along a ray of boxes."""
    scene = planar_arm(2, obstacle(0.9))
    outcomes = [certify_pair(scene, 1, cube(scene, 0.0, half), np.zeros(2)).outcome for half in (0.01, 0.05, 0.1, 0.2, 0.3, 0.5, 0.8)]
    certified = [outcome is Outcome.CERTIFIED for outcome in outcomes]
    assert certified[0]
    assert not certified[-1]
    assert certified == sorted(certified, reverse=True)
    assert Outcome.ERROR not in outcomes


def test_padding_is_part_of_the_certificate():
    gap = 0.1
    bare = planar_arm(1, box("world/obstacle", WORLD, (0.2, 0.2, 0.2), (0.5, 0.15 + gap, 0.0)))
    region = cube(bare, 0.0, 0.01)
    assert certify_pair(bare, 0, region).outcome is Outcome.CERTIFIED
    padded = planar_arm(1, box("world/obstacle", WORLD, (0.2, 0.2, 0.2), (0.5, 0.15 + gap, 0.0)), padding=0.03)
    result = certify_pair(padded, 0, region)
    assert result.outcome is Outcome.CERTIFIED
    assert result.margin < gap - 0.06
    too_much = planar_arm(1, box("world/obstacle", WORLD, (0.2, 0.2, 0.2), (0.5, 0.15 + gap, 0.0)), padding=0.06)
    assert certify_pair(too_much, 0, region).outcome is Outcome.REFUTED


def test_same_seed_same_answer_to_the_bit():
    scene = planar_arm(2, obstacle(1.0))
    first, second = (certify_pair(scene, 1, cube(scene, 0.0, 0.1), np.zeros(2), seed=3) for _ in range(2))
    assert first.proof == second.proof


def test_an_unbounded_or_empty_polytope_is_refused():
    scene = planar_arm(2)
    with pytest.raises(RegionError) as refusal:
        Certification(scene, scene.polytope([[1.0, 0.0], [-1.0, 0.0]], [-1.0, -1.0]))
    assert refusal.value.code == "polytope_empty"


@pytest.mark.parametrize("distance", [1e-3, 0.5, 10.0])
def test_closest_points_of_two_cubes(distance):
    cube_ = box("a", WORLD, (1.0, 1.0, 1.0)).vertices
    found = closest(cube_, cube_ + np.array([1.0 + distance, 0.2, 0.1]))
    assert found.distance == pytest.approx(distance, rel=1e-5)
    assert found.gap == pytest.approx(distance, rel=1e-5)
    assert closest(cube_, cube_ + 0.5).gap <= 0


def many_faces(scene, half, count, seed):
    """A polytope with many random faces around the origin."""
    rng = np.random.default_rng(seed)
    C = rng.normal(size=(count, scene.n))
    C /= np.linalg.norm(C, axis=1)[:, None]
    return scene.polytope(C, np.full(count, half))


@pytest.mark.parametrize("half", [0.1, 0.25, 0.4, 0.6])
def test_chosen_faces_give_the_verdict_of_all_faces(half, monkeypatch):
    scene = planar_arm(3, obstacle(0.9))
    region = many_faces(scene, half, 60, seed=1)
    chosen = [Certification(scene, region, np.zeros(3)).certify(i) for i in range(3)]
    at_once = [Certification(scene, region, np.zeros(3)).certify(i, every_face=True) for i in range(3)]
    monkeypatch.setattr("certifier.pair.face_choice.FACES_AT_A_TIME", 10**6)
    every = [Certification(scene, region, np.zeros(3)).certify(i) for i in range(3)]
    assert [result.outcome for result in at_once] == [result.outcome for result in every]
    assert [result.outcome for result in chosen] == [result.outcome for result in every]
    used = [len(PairProof.from_bytes(result.proof, scene).faces) for result in chosen if result.outcome is Outcome.CERTIFIED]
    assert all(count < 40 for count in used)

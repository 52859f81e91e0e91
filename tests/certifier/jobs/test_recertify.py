"""Regions of scenes that have changed: what is carried over, what is proved again, what is cut off, and what is refused."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from certifier.carry.carry import carry
from certifier.carry.robot import same_bodies
from certifier.errors import CirisError, ProofError, SceneError
from certifier.jobs.local import certify, recertify
from certifier.jobs.region import Region
from certifier.model import WORLD, Pair, Polytope
from certifier.pair.collisions import in_collision
from certifier.partition.bodies import Bodies
from certifier.partition.tree import Node
from certifier.polytopes.gibbs import uniform_in_q
from certifier.proof.region import RegionProof
from certifier.verify.region import verify_region
from tests.certifier.scenes import ball, box, planar_arm

POST = box("world/post", WORLD, (0.3, 0.3, 0.3), (1.5, 1.4, 0.0))
FAR = box("world/far", WORLD, (0.2, 0.2, 0.2), (-3.0, 0.0, 0.0))
SEED = [[0.0, 0.0]]


def scene(*obstacles, padding=0.0):
    """A planar arm with two links, all obstacles against both of them."""
    arm = planar_arm(2, padding=padding)
    links = arm.geometries[:2]
    pairs = tuple(Pair(*sorted((link.name, other.name))) for other in obstacles for link in links)
    return replace(arm, geometries=(*links, *obstacles), pairs=pairs)


OLD = scene(POST, FAR)


@cache
def region(half=0.2) -> Region:
    """A region of the old scene, |s| <= half, with one plane for each of many cells."""
    eye = np.eye(2)
    found = certify(OLD, Polytope(np.concatenate([eye, -eye]), np.full(4, half)), cells=300, assemble=True).region
    assert found is not None
    return found


def said(found: Region):
    return found.manifest["provenance"]["recertified"]


def named(pairs):
    return {frozenset((pair["a"], pair["b"])) for pair in pairs}


def samples(found: Region, count=100):
    polytope = Polytope(np.array(found.manifest["halfspace_normals"]), np.array(found.manifest["halfspace_offsets"]))
    return uniform_in_q(polytope, OLD, count, 10, 0).reshape(-1, OLD.n)


def links(obstacle):
    return {frozenset((f"arm/link{i}/bar", obstacle)) for i in (1, 2)}


def test_an_obstacle_that_is_added_far_away_is_proved_and_everything_else_is_carried_over():
    added = box("world/added", WORLD, (0.2, 0.2, 0.2), (0.0, -4.0, 0.0))
    found = recertify(scene(POST, FAR, added), region().proof, SEED)
    assert (named(said(found)["carried"]), named(said(found)["proved"])) == (links("world/post") | links("world/far"), links("world/added"))
    assert (said(found)["kept"]["value"], said(found)["cut"]) == (1.0, [])
    assert len(verify_region(found.proof).gaps) == 6
    assert said(found)["scene"] == OLD.hash


def test_an_obstacle_that_is_taken_away_leaves_the_region_as_it_is():
    found = recertify(scene(POST), region().proof, SEED)
    assert (len(said(found)["carried"]), said(found)["proved"], said(found)["kept"]["value"]) == (2, [], 1.0)
    assert list(verify_region(found.proof).gaps) == list(scene(POST).pairs)


def test_permuted_pairs_and_new_names_are_carried_over():
    renamed = scene(replace(FAR, name="world/a"), replace(POST, name="world/z"))
    turned = replace(renamed, pairs=renamed.pairs[::-1])
    found = recertify(turned, region().proof, SEED)
    assert named(said(found)["carried"]) == links("world/a") | links("world/z")
    assert list(verify_region(found.proof).gaps) == list(turned.pairs)


def test_names_that_changed_places_carry_over_by_numbers():
    """What was called post stands far away now, and what was far is called post."""
    exchanged = scene(replace(FAR, name=POST.name), replace(POST, name=FAR.name))
    worth = carry(RegionProof.from_bytes(region().proof), exchanged)
    assert sorted(worth.proofs) == [0, 1, 2, 3]
    for index, proof in worth.proofs.items():
        assert exchanged.pairs[index] in proof.pairs
    verify_region(recertify(exchanged, region().proof, SEED).proof)


def test_an_obstacle_of_the_same_name_that_reaches_out_of_what_was_proved_is_not_carried_over():
    nearer = box(POST.name, WORLD, (0.3, 0.3, 0.3), (1.5, 1.3, 0.0))
    worth = carry(RegionProof.from_bytes(region().proof), scene(nearer, FAR))
    about = {index for index, pair in enumerate(scene(nearer, FAR).pairs) if POST.name in (pair.a, pair.b)}
    for index in about & worth.proofs.keys():
        assert not any(np.array_equal(volume.vertices, POST.vertices) for volume in worth.proofs[index].volumes)


def test_a_smaller_obstacle_within_the_old_one_is_carried_over():
    smaller = ball(POST.name, WORLD, 0.1, (1.5, 1.4, 0.0))
    found = recertify(scene(smaller, FAR), region().proof, SEED)
    assert said(found)["kept"]["value"] == 1.0
    verify_region(found.proof)


def test_the_old_proof_proves_nothing_of_the_new_scene():
    """An attack: the old proofs with the new scene's document, or the new scene's obstacle where it is not."""
    old, on_seed = RegionProof.from_bytes(region().proof), scene(box(POST.name, WORLD, (0.3, 0.3, 0.3), (1.0, 0.0, 0.0)), FAR)
    forged = replace(old, scene=on_seed, proofs=tuple(replace(proof, scene=on_seed) for proof in old.proofs))
    with pytest.raises(ProofError):
        verify_region(forged.to_bytes())
    with pytest.raises(ProofError):
        verify_region(replace(old, scene=on_seed).to_bytes())
    fewer = replace(old, scene=scene(POST, FAR, replace(POST, name="world/other")))
    with pytest.raises(ProofError):
        verify_region(fewer.to_bytes())


def test_a_forged_proof_gives_no_region():
    """Planes that separate nothing are taken over as they are, and the region's verification refuses them."""
    old = RegionProof.from_bytes(region().proof)
    forged = replace(old, proofs=tuple(replace(proof, planes=-proof.planes) for proof in old.proofs))
    with pytest.raises(ProofError):
        recertify(OLD, forged.to_bytes(), SEED)


def test_an_obstacle_on_the_seed_revokes_the_region_in_words():
    on_seed = scene(box(POST.name, WORLD, (0.3, 0.3, 0.3), (1.0, 0.0, 0.0)), FAR)
    with pytest.raises(CirisError) as caught:
        recertify(on_seed, region().proof, SEED)
    assert caught.value.code == "revoked"
    assert "arm/link1/bar and world/post touch at q = (0.0, 0.0) deg" in caught.value.message


def test_a_thicker_padding_is_proved_again_and_nothing_is_carried_over():
    padded = scene(POST, FAR, padding=0.01)
    assert not carry(RegionProof.from_bytes(region().proof), padded).proofs
    found = recertify(padded, region().proof, SEED)
    assert verify_region(found.proof).scene.padding == 0.01


@pytest.mark.parametrize(
    ("change", "what"),
    [
        (lambda s: replace(s, q_star=np.array([0.1, 0.0])), "q\\* of joint arm/joint1"),
        (lambda s: replace(s, joints=(s.joints[0], replace(s.joints[1], upper=1.9))), "the range of joint arm/joint2"),
        (lambda s: replace(s, joints=(s.joints[0], replace(s.joints[1], axis=np.array([0.0, 1.0, 0.0])))), "the axis of joint arm/joint2"),
        (lambda s: planar_arm(3), "the old scene has 2 joints"),
    ],
)
def test_another_robot_is_refused(change, what):
    with pytest.raises(SceneError, match=what.replace("the axis", "the place or the axis")) as caught:
        same_bodies(OLD, change(OLD))
    assert caught.value.code == "other_robot"


PLACES = {
    "center": st.tuples(st.floats(-2.2, 2.2), st.floats(-2.2, 2.2)),
    "size": st.tuples(st.floats(0.05, 0.5), st.floats(0.05, 0.5)),
    "padding": st.sampled_from([0.0, 0.02]),
}


@settings(max_examples=3, deadline=None, suppress_health_check=list(HealthCheck))
@given(**PLACES)
def test_what_is_certified_again_holds_and_is_free(center, size, padding):
    holds_and_is_free(center, size, padding)


@pytest.mark.slow
@settings(max_examples=40, deadline=None, suppress_health_check=list(HealthCheck))
@given(**PLACES)
def test_what_is_certified_again_holds_and_is_free_anywhere(center, size, padding):
    holds_and_is_free(center, size, padding)


def holds_and_is_free(center, size, padding):
    """The region of a post that is anywhere, in any size: verified, free by another checker, and refused where it is not true."""
    changed = scene(box(POST.name, WORLD, (*size, 0.3), (*center, 0.0)), FAR, padding=padding)
    found = None
    with suppress(CirisError):
        found = recertify(changed, region().proof, SEED)
    if found is None:
        assert in_collision(replace(changed, padding=padding + 0.05), changed.to_s(SEED)).any(), "it is revoked only near the seed"
        return
    assert list(verify_region(found.proof).gaps) == list(changed.pairs)
    points = samples(found)
    assert not in_collision(changed, points).any()
    assert said(found)["kept"]["value"] <= 1.0
    # The infeasible twin: the same proofs about a scene with a post where the arm is at one of the samples.
    tip = np.array([np.cos(q := changed.to_q(points[0])[0]), np.sin(q), 0.0])
    twin = replace(changed, geometries=(*changed.geometries[:2], box(POST.name, WORLD, (0.2, 0.2, 0.3), tuple(tip)), FAR))
    proof = RegionProof.from_bytes(found.proof)
    with pytest.raises(ProofError):
        verify_region(replace(proof, scene=twin, proofs=tuple(replace(one, scene=twin) for one in proof.proofs)).to_bytes())


def test_cells_and_planes_of_before_are_tried_first(monkeypatch):
    """An obstacle that moved a little needs no new plane; one of which nothing is known does."""
    looked = []
    separate = Bodies.separate
    monkeypatch.setattr(Bodies, "separate", lambda self, cell, start: looked.append(1) or separate(self, cell, start))
    nearer = scene(box(POST.name, WORLD, (0.3, 0.3, 0.3), (1.5, 1.39, 0.0)), FAR)
    found = recertify(nearer, region().proof, SEED)
    with_old = len(looked)
    assert said(found)["kept"]["value"] == 1.0
    looked.clear()
    monkeypatch.setattr("certifier.partition.certification.try_again", lambda area, search, volumes, old: Node())
    recertify(nearer, region().proof, SEED)
    assert with_old < len(looked)

"""Proofs of motions by a dishonest hand: none is accepted that is not true."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from certifier.errors import ProofError
from certifier.model import Pair, Scene
from certifier.motion.search import search
from certifier.proof import limits
from certifier.proof.container import pack, unpack
from certifier.proof.motion import Motion, MotionProof, Space
from certifier.verify.motion import verify_motion
from tests.certifier.motions import distances, positions, raised, swing
from tests.certifier.proofs import motion
from tests.certifier.scenes import ball, planar_arm


def refused(proof: MotionProof) -> bool:
    try:
        verify_motion(proof)
    except ProofError:
        return True
    return False


def changed(array, rng):
    """The array with one number changed, by much or by little, and its index."""
    other = array.copy()
    place = tuple(rng.integers(length) for length in array.shape)
    other[place] = rng.choice([0.0, 1.0, -other[place], other[place] + rng.normal() * 10.0 ** rng.integers(-6, 1), rng.normal()])
    return other


def swung_past(proof: MotionProof) -> float:
    """How far the tip stays from the post, by the law of cosines, at 500 times of each piece, or how far it goes in."""
    tip, post = proof.scene.geometries
    if len(proof.motion.controls) != proof.motion.pieces * proof.motion.degree + 1:
        return -1.0
    q = np.concatenate([positions(proof.scene, proof.motion, k, np.linspace(0, 1, 500)) for k in range(proof.motion.pieces)])
    away = post.vertices[0, 0]
    return float(np.sqrt(1 + away**2 - 2 * away * np.cos(q)).min()) - tip.radius - post.radius - 2 * proof.scene.padding


@pytest.mark.parametrize("space", Space)
@pytest.mark.parametrize("degree", [1, 3])
def test_of_hundreds_of_single_changes_none_is_accepted_that_is_not_true(space, degree):
    """The motion passes at a millimetre. A changed plane or time says the same of it; a changed motion or scene is sampled."""
    scene = swing(1e-3)
    points = np.array([[-1.0], [0.3], [-0.2]] if degree == 1 else [[-1.0], [0.6], [-0.4], [0.2], [-0.9], [0.5], [-0.2]])
    found = search(scene, Motion(space, points if space is Space.Q else scene.to_s(points), degree)).proof
    rng, accepted, untrue = np.random.default_rng(0), 0, 0
    for _ in range(1000):
        kind = rng.choice(["normals", "ends", "counts", "controls", "degree", "swapped", "padding", "radius", "rho", "end", "dropped"])
        proof = found
        if kind in ("normals", "ends", "counts"):
            proof = replace(found, **{kind: changed(getattr(found, kind), rng)})
        elif kind == "controls":
            proof = replace(found, motion=replace(found.motion, controls=changed(found.motion.controls, rng)))
        elif kind == "degree":
            proof = replace(found, motion=replace(found.motion, degree=int(rng.choice([1, 2, 3, 6]))))
            if rng.random() < 0.5:  # with as many pieces as before, which is another motion
                controls = changed(found.motion.controls, rng)[: 2 * proof.motion.degree + 1]
                proof = replace(proof, motion=replace(proof.motion, controls=controls))
        elif kind == "swapped":
            pieces = found.motion.bezier[::-1]
            controls = np.concatenate([pieces[:, :-1].reshape(-1, 1), pieces[-1:, -1]])
            proof = replace(found, motion=replace(found.motion, controls=controls))
        elif kind == "padding":
            proof = replace(found, scene=replace(scene, padding=rng.uniform(0, 2e-3)))
        elif kind == "radius":
            post = replace(scene.geometries[1], radius=scene.geometries[1].radius + rng.uniform(-2e-3, 2e-3))
            proof = replace(found, scene=replace(scene, geometries=(scene.geometries[0], post)))
        elif kind == "end":
            proof = replace(found, end=rng.uniform(0, 1))
        elif kind == "rho":
            proof = replace(found, rho=10.0 ** rng.integers(-9, 1))
        else:
            keep = rng.integers(len(found.ends))
            proof = replace(found, ends=np.delete(found.ends, keep), normals=np.delete(found.normals, keep, axis=0))
        free = swung_past(proof) > 0.9 * proof.rho  # the tip moves by the tube's width where it is nearest, or hardly less
        untrue += not free
        if not refused(proof):
            accepted += 1
            assert free, kind
    assert accepted > 50
    assert untrue > 100


def test_a_pair_is_not_left_out():
    """Without the first pair, and with its intervals in the place of the second's."""
    scene, proof = motion()
    first = int(proof.counts[0].sum())
    half = replace(proof, counts=proof.counts[1:], frames=proof.frames[1:], ends=proof.ends[first:], normals=proof.normals[first:])
    assert refused(half)
    other = replace(scene, pairs=scene.pairs[1:])
    assert verify_motion(replace(half, scene=other)).gap > 0
    near = ball("world/near", "world", 0.2, (0.9, -0.5, 0.0))
    crowded = replace(scene, geometries=(*scene.geometries, near), pairs=(*scene.pairs, Pair("arm/link1/bar", near.name)))
    copied = replace(proof, scene=crowded, counts=np.concatenate([proof.counts, proof.counts[:1]]), frames=proof.frames[[0, 1, 0]])
    assert refused(replace(copied, ends=np.r_[proof.ends, proof.ends[:first]], normals=np.r_[proof.normals, proof.normals[:first]]))
    assert distances(crowded, positions(crowded, proof.motion, 0, np.linspace(0, 1, 100))).min() < 0


@pytest.mark.parametrize(
    "change",
    [
        {"rho": -1.0},
        {"rho": float("nan")},
        {"rho": 1e9},
        {"end": 0.0},
        {"end": 1.5},
        {"end": float("nan")},
        {"space": "r"},
        {"controls": np.zeros((1, 2))},
        {"controls": np.zeros((3, 3))},
        {"controls": np.full((3, 2), np.nan)},
        {"controls": np.full((3, 2), 1e9)},
        {"controls": np.full((3, 2), 2.5)},
        {"degree": 0},
        {"degree": -1},
        {"degree": 2},
        {"degree": 3},
        {"degree": 16},
        {"degree": 1.0},
        {"degree": True},
        {"degree": 10**30},
        {"frames": np.full(2, -1, np.int32)},
        {"frames": np.full(2, 3, np.int32)},
        {"frames": np.zeros(2)},
        {"counts": np.zeros((2, 2), np.int32)},
        {"counts": np.full((2, 2), 2**31 - 1, np.int32)},
        {"counts": np.full((2, 2), -1, np.int32)},
        {"ends": np.zeros(0)},
        {"normals": np.zeros((0, 3))},
    ],
    ids=str,
)
def test_hostile_files_are_refused(change):
    scene, proof = motion()
    header, arrays = unpack(proof.to_bytes(), "motion")
    header |= {name: value for name, value in change.items() if not isinstance(value, np.ndarray)}
    data = pack(header, {**arrays, **{name: value for name, value in change.items() if isinstance(value, np.ndarray)}})
    with pytest.raises(ProofError):
        verify_motion(MotionProof.from_bytes(data, scene))


def test_a_file_that_does_not_say_the_degree_is_refused_with_words():
    """As those were that held waypoints alone."""
    scene, proof = motion()
    header, arrays = unpack(proof.to_bytes(), "motion")
    del header["degree"]
    with pytest.raises(ProofError, match="degree is missing"):
        MotionProof.from_bytes(pack(header, {**arrays, "waypoints": arrays["controls"]}), scene)


@pytest.mark.parametrize("space", Space)
def test_a_control_point_beyond_the_limits_is_refused_where_the_motion_itself_is_within(space):
    scene = swing(0.5)
    proof = search(scene, Motion(space, np.array([[0.0], [0.1], [0.2], [0.0]]), 3)).proof
    assert verify_motion(proof).motion.degree == 3
    controls = np.array([[0.0], [scene.q_upper[0] + 0.1 if space is Space.Q else scene.s_upper[0] + 0.1], [0.2], [0.0]])
    assert positions(scene, Motion(space, controls, 3), 0, np.linspace(0, 1, 99)).max() < scene.q_upper[0]
    with pytest.raises(ProofError, match="a control point is not within the joint limits"):
        verify_motion(replace(proof, motion=Motion(space, controls, 3)))


def test_times_that_run_back_or_end_early_are_refused():
    _, proof = motion()
    for i in range(len(proof.ends)):
        for value in (0.0, -0.0, np.nextafter(proof.ends[i], -1), np.nextafter(proof.ends[i], 2), 2.0):
            ends = proof.ends.copy()
            ends[i] = value
            if refused(replace(proof, ends=ends)):
                continue
            assert proof.ends[i] != 1.0  # a time between two others may be another one by a rounding


def test_what_is_too_long_to_check_is_refused_before_it_is_checked(monkeypatch):
    _, proof = motion()
    monkeypatch.setattr(limits, "SWEPT", 100)
    with pytest.raises(ProofError) as refusal:
        verify_motion(proof)
    assert refusal.value.code == "proof_too_large"


def test_the_statement_names_the_motion_and_what_is_not_covered():
    scene, proof = motion()
    lines = verify_motion(proof).lines()
    assert lines[2] == "  from q = (-0.9, -0.4) rad"
    assert any("'arm/link1' and 'arm/link2'" in line and "not covered" in line for line in lines)
    assert len(json.dumps(lines)) < 2000
    curve = search(scene, raised(proof.motion, 3)).proof
    assert verify_motion(curve).lines()[:2] == [
        "a motion of 2 polynomial pieces of degree 3 in q:",
        "  joints 'arm/joint1', 'arm/joint2', all control points within their limits",
    ]
    plain = search(scene, proof.motion).proof
    assert not any("and at every configuration" in line for line in verify_motion(plain).lines())


def test_a_scene_without_pairs_proves_nothing():
    scene: Scene = replace(planar_arm(1), pairs=())
    empty = MotionProof(
        scene, Motion(Space.Q, np.zeros((2, 1))), 1.0, 0.0, np.zeros(0, np.int32), np.zeros((0, 1), np.int32), np.zeros(0), np.zeros((0, 3))
    )
    assert refused(empty)

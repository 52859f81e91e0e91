"""The poses that chains share, against those that are exact fractions."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace

import numpy as np
import pytest
from flint import ctx, fmpq

from certifier.errors import ProofError
from certifier.model import WORLD, Joint, JointKind, Pair, Scene
from certifier.proof.motion import Motion, MotionProof, Space
from certifier.verify import motion, places
from certifier.verify.chains import Chain
from certifier.verify.kinematics import ExactKinematics
from certifier.verify.motion import verify_motion
from certifier.verify.places import Places
from tests.certifier.motion.test_bounds import allowed
from tests.certifier.scenes import ball, pose, random_tree, slides_together


def doubles(rows):
    return np.array([[float(int(x.p) / int(x.q)) for x in row] for row in rows])


@pytest.mark.parametrize("seed", range(12))
def test_every_chain_has_the_exact_poses_to_an_ulp(seed):
    """From every body of a tree to every other one, and to itself, with one scene's places for all of them."""
    tree = random_tree(seed, bodies=9)
    if seed % 2:
        tree = slides_together(tree, seed)
    shared, exact = Places(tree), ExactKinematics.by_joint(tree)
    for frame in tree.bodies:
        for body in tree.bodies:
            chain = shared.chain(frame, body)
            if not allowed(tree, frame, body):
                continue
            axes, fixed = exact.linkage(frame, body)
            crossed = [(joint, upwards) for joint, upwards in exact.path(frame, body) if joint.index is not None]
            assert chain.joints.tolist() == [joint.index for joint, _ in crossed]
            assert chain.joints.size == len(crossed)
            for speed, (joint, _) in zip(chain.speeds.tolist(), crossed, strict=True):
                own = sum(fmpq(*x.as_integer_ratio()) ** 2 for x in joint.axis.tolist()) if joint.follows else fmpq(1)
                least = own if joint.kind is JointKind.PRISMATIC else fmpq(0)
                assert least <= fmpq(*speed.as_integer_ratio()) ** 2 <= least * (1 + fmpq(1, 2**38))
            signed = [(-1.0 if upwards else 1.0) * doubles([axis])[0] for axis, (_, upwards) in zip(axes, crossed, strict=True)]
            assert chain.axes.tolist() == [axis.tolist() for axis in signed]
            truth = np.array([doubles(rows) for rows in fixed])
            for found, exactly in ((chain.rotations, truth[:, :3, :3]), (chain.offsets, truth[:, :3, 3])):
                assert (np.abs(found - exactly) <= np.spacing(np.abs(exactly)) + 2.0**-199).all()


def welded(depth: int) -> Scene:
    """Two stacks of welds with offsets of a million metres, which cancel but for what 2^-60 of a rotation leaves."""
    rng, joints, bodies = np.random.default_rng(0), [], [WORLD]
    X = pose(rng.uniform(-1e6, 1e6, 3), rng.normal(size=3), 2.0)
    for side in ("a", "b"):
        for i in range(depth):
            kind = (JointKind.WELD, np.zeros(3)) if i or side == "b" else (JointKind.REVOLUTE, np.array([0.0, 0.0, 1.0]))
            ends = (0, -1.0, 1.0) if kind[0] is JointKind.REVOLUTE else (None, None, None)
            parent = f"{side}{i - 1}" if i else WORLD
            joints.append(
                Joint(f"j{side}{i}", kind[0], parent, f"{side}{i}", kind[1], *((X, np.eye(4)) if i % 2 else (np.eye(4), X)), *ends)
            )
            bodies.append(f"{side}{i}")
    return Scene("welded", tuple(joints), tuple(bodies), (), (), (), np.zeros(1))


def test_poses_of_which_a_million_metres_cancel_are_exact_to_an_ulp():
    scene = welded(64)
    chain, (_, fixed) = Places(scene).chain("a63", "b63"), ExactKinematics.by_joint(scene).linkage("a63", "b63")
    truth = np.array([doubles(rows) for rows in fixed])
    assert np.abs(chain.offsets - truth[:, :3, 3]).max() <= 2.0**-199 + np.spacing(np.abs(truth[:, :3, 3])).max()
    assert np.abs(chain.rotations - truth[:, :3, :3]).max() <= 2.0**-52


def test_the_precision_of_others_stays(monkeypatch):
    before = ctx.prec
    Places(welded(3)).chain("a2", "b2")
    monkeypatch.setattr(places, "BITS", 64)
    with pytest.raises(ProofError, match="fixed poses"):
        Places(welded(3)).chain("a2", "b2")
    assert ctx.prec == before


def test_a_proof_takes_what_is_shared_in_any_order():
    """The same statement, whether pairs of the same bodies follow each other or not, and however few are looked at together."""
    tree = random_tree(1, bodies=5)
    shapes = tuple(ball(f"{body}/ball{i}", body, 0.01, (i, 0.0, 0.0)) for body in tree.bodies for i in (0, 1))
    pairs = tuple(Pair(*sorted((a.name, b.name))) for a in shapes for b in shapes if a.body < b.body)
    scene = replace(tree, geometries=shapes, pairs=pairs)
    gaps = set()
    for order in (pairs, pairs[::-1], pairs[::2] + pairs[1::2]):
        world = replace(scene, pairs=order)
        gaps.add(verify_motion(resting(world)).gap)
    assert len(gaps) == 1


def test_what_is_computed_is_linear_in_the_file(monkeypatch):
    """Every joint's frames once, and how far a geometry reaches once for each chain to it, however many intervals and blocks there are."""
    tree = random_tree(1, bodies=6)
    shapes = tuple(ball(f"{body}/ball{i}", body, 0.01, (i, 0.0, 0.0)) for body in tree.bodies for i in range(4))
    pairs = tuple(Pair(*sorted((a.name, b.name))) for a in shapes for b in shapes if a.body < b.body)
    scene = replace(tree, geometries=shapes, pairs=pairs)
    proof = resting(scene)
    rng, each = np.random.default_rng(0), 5
    ends, normals = np.tile(np.arange(1, each + 1) / each, len(pairs)), np.repeat(proof.normals, each, axis=0)
    frames = rng.integers(0, len(scene.bodies), len(pairs)).astype(np.int32)
    poses = [doubles_at(scene, scene.bodies[i], proof.motion.controls[0]) for i in frames]
    turned = np.einsum("ijk,ij->ik", np.repeat([X[:3, :3] for X in poses], each, axis=0), normals)
    many = replace(proof, frames=frames, counts=proof.counts * each, ends=ends, normals=turned)
    calls = Counter()

    def counted(owner, name):
        function = getattr(owner, name)

        def call(*args):
            calls[name] += 1
            return function(*args)

        monkeypatch.setattr(owner, name, call)

    counted(places, "_rigid")
    counted(Chain, "reach")
    counted(motion, "_least")
    whole = verify_motion(many).gap
    assert calls["_rigid"] <= 4 * len(scene.joints)
    assert calls["reach"] <= 2 * len(pairs)
    assert calls["_least"] == len(shapes)
    calls.clear()
    monkeypatch.setattr(motion, "BLOCK", 7)
    assert verify_motion(many).gap == pytest.approx(whole, rel=1e-12)
    assert calls["_least"] <= 2 * (len(pairs) + 1 + each * len(pairs) // 7)


def resting(scene: Scene) -> MotionProof:
    """A motion that rests, with the direction between the balls' centres for every pair, in the world's frame."""
    q = np.full((2, scene.n), 0.1)
    normals = []
    for pair in scene.pairs:
        p = []
        for name in (pair.a, pair.b):
            geometry = scene.geometry(name)
            X = doubles_at(scene, geometry.body, q[0])
            p.append(X[:3, :3] @ geometry.vertices[0] + X[:3, 3])
        normals.append((p[0] - p[1]) / np.linalg.norm(p[0] - p[1]))
    count = len(scene.pairs)
    one = np.ones((count, 1), np.int32)
    return MotionProof(scene, Motion(Space.Q, q), 1.0, 0.0, np.zeros(count, np.int32), one, np.ones(count), np.array(normals))


def doubles_at(scene: Scene, body: str, q: np.ndarray) -> np.ndarray:
    X = np.eye(4)
    while body != WORLD:
        joint, moved = scene.joint_above[body], np.eye(4)
        if joint.kind is JointKind.REVOLUTE:
            moved = pose((0, 0, 0), joint.axis, q[joint.index])
        elif joint.kind is JointKind.PRISMATIC:
            moved = pose(joint.axis * q[joint.index])
        X, body = joint.X_PF @ moved @ np.linalg.inv(joint.X_BM) @ X, joint.parent
    return X

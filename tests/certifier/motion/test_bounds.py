"""The bounds on which proofs of motions rest, against dense sampling of random chains: of the search and of the verifier."""

from __future__ import annotations

import numpy as np
import pytest

from certifier.kinematics import Kinematics
from certifier.model import JointKind
from certifier.motion import chains as ours
from certifier.motion.intervals import acceleration, place
from certifier.proof.motion import Motion, MotionProof, Space
from certifier.verify.chains import Chain
from certifier.verify.kinematics import ExactKinematics, exact
from certifier.verify.motion import _acceleration, _Check
from certifier.verify.volume import placed
from tests.certifier.scenes import box, random_tree

TIMES = np.linspace(0, 1, 401)


def random_case(seed):
    """A random tree, two of its bodies, a box on the second one, and a motion over more than half a turn in q, or over limits in s."""
    rng = np.random.default_rng(seed)
    tree = random_tree(seed, bodies=8) if seed % 3 else random_tree(seed, (JointKind.REVOLUTE,), bodies=5)
    frame, body = rng.choice(tree.bodies, 2, replace=False)
    shape = box("shape", body, (0.3, 0.2, 0.1), tuple(rng.normal(size=3)))
    space = Space.S if seed % 2 else Space.Q
    size = rng.choice([0.01, 0.5, 3.0])
    return tree, str(frame), str(body), shape, Motion(space, rng.uniform(-size, size, (3, tree.n)))


def positions(tree, motion, piece, times):
    x = motion.waypoints[piece] + times[:, None] * (motion.waypoints[piece + 1] - motion.waypoints[piece])
    return (x, tree.to_q(x)) if motion.space is Space.S else (tree.to_s(x), x)


def without_pairs(tree, motion, rho):
    counts = np.zeros((0, motion.pieces), np.int32)
    return MotionProof(tree, motion, 1.0, rho, np.zeros(0, np.int32), counts, np.zeros(0), np.zeros((0, 3)))


def bounds(tree, frame, body, shape, motion, rho=0.0):
    """Levers, and the bounds of the acceleration on each piece, as the verifier and as the search computes them."""
    check, chain = _Check(without_pairs(tree, motion, rho)), Chain.between(tree, ExactKinematics.by_joint(tree), frame, body)
    pieces = np.arange(motion.pieces)
    rates, changes = check._rates(pieces, np.zeros(len(pieces)), np.ones(len(pieces)))
    levers, _ = chain.levers(shape.vertices, check._slid[:, chain.joints])
    side = ours.side(ours.chain(Kinematics.of(tree), frame, body), shape, check._slid)
    searched = [acceleration(side, side.levers[k], rates[k], changes[k]) for k in pieces]
    return chain, levers, _acceleration(chain, levers, rates, changes), side, searched


@pytest.mark.parametrize("seed", range(60))
def test_no_vertex_leaves_its_chord_farther_than_the_bound_says(seed):
    tree, frame, body, shape, motion = random_case(seed)
    kinematics = Kinematics.of(tree)
    chain, levers, bent, side, searched = bounds(tree, frame, body, shape, motion)
    assert side.levers == pytest.approx(levers, rel=1e-8)
    for piece in range(motion.pieces):
        s, q = positions(tree, motion, piece, TIMES)
        p = kinematics.points(frame, body, shape.vertices, s)
        chord = p[:1] + TIMES[:, None, None] * (p[-1:] - p[:1])
        assert np.linalg.norm(p - chord, axis=2).max() <= bent[piece] / 8 + 1e-12
        assert searched[piece] == pytest.approx(bent[piece], rel=1e-6, abs=1e-12)
        found, X, Y = np.empty_like(p[0]), np.empty((3, 4)), np.empty((3, 4))
        place(side, q[7], X, Y, found)
        assert found == pytest.approx(p[7], abs=1e-9)
    assert len(chain.joints) == len(kinematics.chain(frame, body))


def test_the_bound_of_one_joint_is_reached():
    """A link that turns half a turn leaves the chord by its length; the bound is pi^2/8 times that."""
    tree, frame, body, shape, motion = random_case(0)
    ratios = []
    for seed in range(60):
        tree, frame, body, shape, motion = random_case(seed)
        if len(Kinematics.of(tree).chain(frame, body)) == 1:
            *_, searched = bounds(tree, frame, body, shape, motion)
            p = Kinematics.of(tree).points(frame, body, shape.vertices, positions(tree, motion, 0, TIMES)[0])
            second = np.linalg.norm(np.diff(p, 2, axis=0), axis=2).max() * len(TIMES) ** 2
            ratios.append(second / max(searched[0], 1e-12))
    assert max(ratios) > 0.9


@pytest.mark.parametrize("seed", range(30))
def test_no_vertex_moves_farther_in_a_tube_than_the_levers_say(seed):
    tree, frame, body, shape, motion = random_case(seed)
    kinematics, rng, rho = Kinematics.of(tree), np.random.default_rng(seed), 0.2
    _, levers, *_ = bounds(tree, frame, body, shape, motion, rho)
    _, q = positions(tree, motion, 0, rng.uniform(size=300))
    near = q + rng.choice([-rho, rho], q.shape)
    p, moved = (kinematics.points(frame, body, shape.vertices, tree.to_s(x)) for x in (q, near))
    assert np.linalg.norm(p - moved, axis=2).max() <= rho * levers[0].sum() + 1e-12


@pytest.mark.parametrize("seed", range(20))
def test_positions_are_as_exact_as_is_said(seed):
    """Against exact fractions, in s."""
    tree, frame, body, shape, motion = random_case(2 * seed + 1)
    points = motion.waypoints
    proof = MotionProof(
        tree, motion, 1.0, 0.0, np.zeros(0, np.int32), np.zeros((0, motion.pieces), np.int32), np.zeros(0), np.zeros((0, 3))
    )
    check, chain = _Check(proof), Chain.between(tree, ExactKinematics.by_joint(tree), frame, body)
    _, size = chain.levers(shape.vertices, check._slid[:, chain.joints])
    (poses,) = check._poses([chain], np.array([0, 1]), np.array([0.0, 1.0]))
    for k, s in enumerate((points[0], points[2])):
        X = ExactKinematics.at(tree, [exact(x) for x in s]).pose(frame, body)
        X = [[x / X[3][3] for x in row] for row in X]
        for v in shape.vertices:
            truth = np.array([float(int(x.p) / int(x.q)) for x in placed(X, tuple(map(exact, v)))])
            assert np.linalg.norm(poses.R[k] @ v + poses.p[k] - truth) <= chain.error(size, check._inexact).max()
    assert chain.error(size, check._inexact).max() < 1e-10

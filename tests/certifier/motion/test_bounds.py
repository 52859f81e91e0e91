"""The bounds on which proofs of motions rest, against dense sampling of random chains: of the search and of the verifier."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from certifier.errors import ProofError
from certifier.kinematics import Kinematics
from certifier.model import JointKind, Pair
from certifier.motion.bodies import bodies_of, place, place_links
from certifier.motion.views import acceleration, levers_of, views_of
from certifier.proof.motion import Motion, Space
from certifier.verify.chains import poses
from certifier.verify.kinematics import ExactKinematics, exact
from certifier.verify.pieces import Pieces
from certifier.verify.places import Places
from certifier.verify.sides import Known
from certifier.verify.volume import placed
from tests.certifier.motions import coordinates
from tests.certifier.scenes import box, random_tree, slides_together

TIMES = np.linspace(0, 1, 401)


def random_case(seed):
    """A random tree, two of its bodies, a box on the second one, and a motion over more than half a turn in q, or over limits in s.

    The motion has two pieces of degree 1, 2, 3 or 7. Of two cases in five, the slides move together.
    """
    rng = np.random.default_rng(seed)
    tree = random_tree(seed, bodies=8) if seed % 3 else random_tree(seed, (JointKind.REVOLUTE,), bodies=5)
    if seed % 5 in (1, 2):
        tree = slides_together(tree, seed)
    frame, body = rng.choice(tree.bodies, 2, replace=False)
    while not allowed(tree, frame, body):
        frame, body = rng.choice(tree.bodies, 2, replace=False)
    shape = box("shape", str(body), (0.3, 0.2, 0.1), tuple(rng.normal(size=3)))
    other = box("other", str(frame), (0.1, 0.1, 0.1))
    tree = replace(tree, geometries=(shape, other), pairs=(Pair("shape", "other"),))
    space = Space.S if seed % 2 else Space.Q
    size = rng.choice([0.01, 0.5, 3.0])
    degree = (1, 2, 3, 7)[seed // 2 % 4]
    return tree, str(frame), str(body), shape, Motion(space, rng.uniform(-size, size, (2 * degree + 1, tree.n)), degree)


def allowed(tree, frame, body):
    """Says whether the verifier allows what moves together between two bodies."""
    try:
        ExactKinematics.by_joint(tree).path(frame, body)
    except ProofError:
        return False
    return True


def positions(tree, motion, piece, times):
    x = coordinates(motion, piece, times)
    return (x, tree.to_q(x)) if motion.space is Space.S else (tree.to_s(x), x)


def verified_side(tree, frame):
    """The side of the tree's first geometry, as the verifier has it."""
    sides, own = Known(tree).sides(np.array([tree.bodies.index(frame)]), np.zeros(1, np.int64))
    return sides.of(own)


def bounds(tree, frame, motion, rho=0.0, t0=0.0, t1=1.0):
    """Levers, and the bounds of the acceleration in a part of each piece, as the verifier and as the search computes them."""
    check, side = Pieces(tree, motion, rho), verified_side(tree, frame)
    pieces = np.arange(motion.pieces)
    rates, changes = check.rates(pieces, np.full(len(pieces), t0), np.full(len(pieces), t1))
    of_each = side.of(np.zeros(len(pieces), np.int64))
    levers = of_each.levers(of_each.slid(check.slid))
    views = views_of(tree)
    view = int(views.sides[-1, 0])  # the last choice is the frame of the second geometry's link
    own, searched = slice(*views.begins[view : view + 2]), []
    for k in pieces:
        ours, _ = levers_of(views, check.slid[k])
        assert ours[own] == pytest.approx(levers[k], rel=1e-8)
        searched.append(acceleration(views, view, ours, rates[k], changes[k]))
    return levers, of_each.accelerations(levers, rates, changes), searched


@pytest.mark.parametrize("seed", range(60))
def test_no_vertex_leaves_its_chord_farther_than_the_bound_says(seed):
    tree, frame, body, shape, motion = random_case(seed)
    kinematics = Kinematics.of(tree)
    t0, t1 = np.sort(np.random.default_rng(seed).uniform(size=2)) if seed % 5 else (0.0, 1.0)
    levers, bent, searched = bounds(tree, frame, motion, 0.0, t0, t1)
    bodies = bodies_of(tree)
    R, at = np.empty((len(bodies.parents), 3, 3)), np.empty((len(bodies.parents), 3))
    for piece in range(motion.pieces):
        s, q = positions(tree, motion, piece, t0 + TIMES * (t1 - t0))
        p = kinematics.points(frame, body, shape.vertices, s)
        chord = p[:1] + TIMES[:, None, None] * (p[-1:] - p[:1])
        assert np.linalg.norm(p - chord, axis=2).max() <= (t1 - t0) ** 2 * bent[piece] / 8 + 1e-12
        assert searched[piece] == pytest.approx(bent[piece], rel=1e-6, abs=1e-12)
        found = np.empty_like(p[0])
        place_links(bodies, q[7], R, at)
        place(bodies, 0, bodies.links[1], R, at, found)
        link = bodies.links[1]
        of_root = kinematics.points(tree.bodies[bodies.roots[link]], body, shape.vertices, s[7:8])[0]
        moved = found @ bodies.turned[link].T
        assert np.diff(moved, axis=0) == pytest.approx(np.diff(of_root, axis=0), abs=1e-9)
    assert levers.shape[1] == sum(joint.index is not None for joint, _ in kinematics.joints(frame, body))


def test_the_bound_of_one_joint_is_reached():
    """A link that turns half a turn leaves the chord by its length; the bound is pi^2/8 times that."""
    tree, frame, body, shape, motion = random_case(0)
    ratios = []
    for seed in range(60):
        tree, frame, body, shape, motion = random_case(seed)
        if len(Kinematics.of(tree).chain(frame, body)) == 1 and motion.degree == 1:
            *_, searched = bounds(tree, frame, motion)
            p = Kinematics.of(tree).points(frame, body, shape.vertices, positions(tree, motion, 0, TIMES)[0])
            second = np.linalg.norm(np.diff(p, 2, axis=0), axis=2).max() * len(TIMES) ** 2
            ratios.append(second / max(searched[0], 1e-12))
    assert max(ratios) > 0.9


@pytest.mark.parametrize("seed", range(30))
def test_no_vertex_moves_farther_in_a_tube_than_the_levers_say(seed):
    tree, frame, body, shape, motion = random_case(seed)
    kinematics, rng, rho = Kinematics.of(tree), np.random.default_rng(seed), 0.2
    levers, *_ = bounds(tree, frame, motion, rho)
    _, q = positions(tree, motion, 0, rng.uniform(size=300))
    near = q + rng.choice([-rho, rho], q.shape)
    p, moved = (kinematics.points(frame, body, shape.vertices, tree.to_s(x)) for x in (q, near))
    assert np.linalg.norm(p - moved, axis=2).max() <= rho * levers[0].sum() + 1e-12


@pytest.mark.parametrize("space", Space)
@pytest.mark.parametrize("degree", [1, 2, 3, 4, 7, 15])
def test_rates_and_their_changes_are_bounded_and_nearly_reached_in_short_intervals(degree, space):
    """Against differences of positions that are sampled finely; the tree has revolute and prismatic joints."""
    rng, tree = np.random.default_rng(degree), random_tree(1, bodies=6)
    motion = Motion(space, rng.uniform(-1.5, 1.5, (3 * degree + 1, tree.n)), degree)
    check = Pieces(tree, motion, 0.0)
    for width in (1.0, 0.2, 1e-2):
        t0 = rng.uniform(0, 1 - width, 12)
        piece = np.arange(12) % 3
        rates, changes = check.rates(piece, t0, t0 + width)
        for i in range(12):
            at = np.linspace(t0[i], t0[i] + width, 201)
            q, step = positions(tree, motion, piece[i], at)[1], width / 200
            rate, change = np.abs(np.diff(q, axis=0)).max(axis=0) / step, np.abs(np.diff(q, 2, axis=0)).max(axis=0) / step**2
            off = 1e-13 / step**2
            assert (rate <= rates[i] + 1e-9).all()
            assert (change <= changes[i] * (1 + 1e-9) + off).all()
            if width == 1e-2 and degree < 8:
                assert (rates[i] <= 1.2 * rate + 0.2).all()
                # In s, the two terms of a change may cancel, and their sizes are added.
                assert space is Space.S or (changes[i] <= 1.3 * change + 1.0 + off).all()


def exactly_at(motion, piece, time):
    """The motion's coordinates at a time of a piece, in fractions."""
    points, t = [[exact(x) for x in row] for row in motion.bezier[piece].tolist()], exact(time)
    while len(points) > 1:
        points = [[a + t * (b - a) for a, b in zip(p, q, strict=True)] for p, q in pairwise(points)]
    return points[0]


@pytest.mark.parametrize("seed", range(20))
def test_positions_are_as_exact_as_is_said(seed):
    """Against exact fractions, in s."""
    tree, frame, body, shape, motion = random_case(2 * seed + 1)
    check, chain = Pieces(tree, motion, 0.0), Places(tree).chain(frame, body)
    side = verified_side(tree, frame)
    error = side.errors(side.sizes(side.slid(check.slid.max(axis=0, keepdims=True))), check.inexact)[0]
    pieces, times = np.array([0, 1, 0, 1, 1]), np.array([0.0, 1.0, 0.3, 0.7, 1e-9])
    R, p = poses([chain], np.zeros(5, np.int64), np.arange(5), *check.positions(pieces, times))
    for k, (piece, time) in enumerate(zip(pieces, times, strict=True)):
        s = exactly_at(motion, piece, time)
        off = [exact(x) - truth for x, truth in zip(check.at(pieces, times)[0][k].tolist(), s, strict=True)]
        assert max(abs(float(x.p) / float(x.q)) for x in off) <= check.inexact / 2
        X = ExactKinematics.at(tree, s).pose(frame, body)
        X = [[x / X[3][3] for x in row] for row in X]
        for v in shape.vertices:
            truth = np.array([float(int(x.p) / int(x.q)) for x in placed(X, tuple(map(exact, v)))])
            assert np.linalg.norm(R[k] @ v + p[k] - truth) <= error
    assert error < 1e-10


@pytest.mark.parametrize("degree", [2, 3, 6, 15])
def test_derivatives_are_wrong_by_no_more_than_is_said(degree):
    """At the ends of intervals and as hulls on the pieces, against exact fractions, of control points that are large and nearly one."""
    rng, tree = np.random.default_rng(degree), random_tree(1, bodies=6)
    motion = Motion(Space.Q, 1e3 + 1e-9 * rng.normal(size=(2 * degree + 1, tree.n)), degree)
    check, t = Pieces(tree, motion, 0.0), float(rng.uniform())
    _, rates, changes = check.at(np.array([0]), np.array([t]))
    for i in range(tree.n):
        steps, hulls = [exact(x) for x in motion.bezier[0, :, i].tolist()], []
        for k in range(4):
            steps = [(degree - k) * (b - a) for a, b in pairwise(steps)]
            hulls.append(max((float(abs(x.p)) / float(x.q) for x in steps), default=0.0))
            if k < 2:
                derivative = steps
                while len(derivative) > 1:
                    derivative = [a + exact(t) * (b - a) for a, b in pairwise(derivative)]
                value = float(derivative[0].p) / float(derivative[0].q) if derivative else 0.0
                assert abs((rates, changes)[k][0, i] - value) <= check._wrong[k] / 8
        for k in range(4):
            assert hulls[k] <= check._hulls[k][0, i] * (1 + 1e-15)

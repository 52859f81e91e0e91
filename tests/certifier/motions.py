"""Motions for tests, and what dense sampling says of them, by kinematics and distances that neither the search nor the verifier uses."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.stats import binom

from certifier.kinematics import Kinematics
from certifier.model import WORLD, Pair
from certifier.polytopes.closest import closest
from certifier.proof.motion import Motion, Space
from tests.certifier.scenes import ball, planar_arm

TIP, POST = 0.05, 0.1


def swing(gap, padding=0.0, length=1.0):
    """A link with a ball at its tip, ``length`` metres from the joint, and a post that the ball misses by ``gap`` at 0."""
    post = ball("world/post", WORLD, POST, (length + TIP + POST + 2 * padding + gap, 0.0, 0.0))
    tip = ball("arm/link1/tip", "arm/link1", TIP, (length, 0.0, 0.0))
    return replace(planar_arm(1, post, padding=padding), geometries=(tip, post), pairs=(Pair(tip.name, post.name),))


def coordinates(motion, piece, times):
    """The motion's own coordinates at times of a piece, (N, n): the sum of its control points with Bernstein's polynomials."""
    weights = binom.pmf(np.arange(motion.degree + 1), motion.degree, np.asarray(times)[:, None])
    return weights @ motion.bezier[piece]


def positions(scene, motion, piece, times):
    """Joint positions at times of a piece, (N, n)."""
    x = coordinates(motion, piece, times)
    return x if motion.space is Space.Q else scene.to_q(x)


def raised(motion, degree):
    """The same motion with pieces of a higher degree."""
    pieces = motion.bezier
    while pieces.shape[1] <= degree:
        m = pieces.shape[1]
        part = np.arange(m + 1)[:, None] / m
        ends = np.zeros((len(pieces), 1, pieces.shape[2]))
        pieces = part * np.concatenate([ends, pieces], axis=1) + (1 - part) * np.concatenate([pieces, ends], axis=1)
    return Motion(motion.space, np.concatenate([pieces[:, :-1].reshape(-1, pieces.shape[2]), pieces[-1:, -1]]), degree)


def distances(scene, q):
    """Least distance of padded bodies at positions q, (N,)."""
    kinematics, found = Kinematics.of(scene), np.full(len(q), np.inf)
    for pair in scene.pairs:
        a, b = scene.geometry(pair.a), scene.geometry(pair.b)
        A, B = (kinematics.points(WORLD, g.body, g.vertices, scene.to_s(q)) for g in (a, b))
        reach = a.radius + b.radius + 2 * scene.padding
        found = np.minimum(found, [closest(A[i], B[i]).distance - reach for i in range(len(q))])
    return found


def least_distance(scene, motion: Motion, samples=200):
    """Least distance of padded bodies along a motion, by sampling."""
    times = np.linspace(0, 1, samples)
    return min(distances(scene, positions(scene, motion, k, times)).min() for k in range(motion.pieces))

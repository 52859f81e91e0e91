"""Motions for tests, and what dense sampling says of them, by kinematics and distances that neither the search nor the verifier uses."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from certifier.kinematics import Kinematics
from certifier.model import WORLD, Pair
from certifier.pair.closest import closest
from certifier.proof.motion import Motion, Space
from tests.certifier.scenes import ball, planar_arm

TIP, POST = 0.05, 0.1


def swing(gap, padding=0.0, length=1.0):
    """A link with a ball at its tip, ``length`` metres from the joint, and a post that the ball misses by ``gap`` at 0."""
    post = ball("world/post", WORLD, POST, (length + TIP + POST + 2 * padding + gap, 0.0, 0.0))
    tip = ball("arm/link1/tip", "arm/link1", TIP, (length, 0.0, 0.0))
    return replace(planar_arm(1, post, padding=padding), geometries=(tip, post), pairs=(Pair(tip.name, post.name),))


def positions(scene, motion, piece, times):
    """Joint positions at times of a piece, (N, n)."""
    start, end = motion.waypoints[piece], motion.waypoints[piece + 1]
    x = start + np.asarray(times)[:, None] * (end - start)
    return x if motion.space is Space.Q else scene.to_q(x)


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

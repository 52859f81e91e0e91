"""Many configurations are told apart here, in floating point, into those in which some pair of padded bodies touches and the others."""

from __future__ import annotations

from itertools import groupby

import numpy as np
from numpy.typing import NDArray

from certifier.kinematics import Kinematics
from certifier.model import Array, Geometry, Pair, Scene, Volume
from certifier.pair.closest import closest


def in_collision(scene: Scene, s: Array) -> NDArray[np.bool_]:
    """Returns at which of the points s, (N, n), some pair of the scene is not shown to be apart, padding included; (N,).

    The bodies are shown apart by a direction between them. Errors of rounding therefore make a configuration collide, never the contrary.
    """
    kinematics = Kinematics.of(scene)
    collides = np.zeros(len(s), dtype=bool)

    def bodies(pair: Pair) -> tuple[str, str]:
        return scene.geometry(pair.a).body, scene.geometry(pair.b).body

    for (frame, body), pairs in groupby(sorted(scene.pairs, key=bodies), key=bodies):
        X = kinematics.numerators(frame, body, s)
        R, p = X[:, :3, :3] / X[:, 3, 3, None, None], X[:, :3, 3] / X[:, 3, 3, None]
        for pair in pairs:
            left = np.flatnonzero(~collides)
            touching = _touching(scene.geometry(pair.a), scene.geometry(pair.b), R[left], p[left], 2 * scene.padding)
            collides[left[touching]] = True
    return collides


def touching(kinematics: Kinematics, volumes: tuple[Volume, Volume], s: Array) -> NDArray[np.bool_]:
    """Returns at which of the points s, (N, n), two volumes are not shown to be apart, padding included; (N,)."""
    a, b = volumes
    X = kinematics.numerators(a.body, b.body, s)
    R, p = X[:, :3, :3] / X[:, 3, 3, None, None], X[:, :3, 3] / X[:, 3, 3, None]
    return np.isin(np.arange(len(s)), _touching(a, b, R, p, 2 * kinematics.scene.padding))


def _touching(a: Geometry | Volume, b: Geometry | Volume, R: Array, p: Array, padding: float) -> NDArray[np.int64]:
    """Returns the indices of the poses of b's body in the frame of a's, R (k, 3, 3) and p (k, 3), at which the geometries touch.

    Args:
        padding: metres that are added to the distance that the two have to keep.
    """
    if len(a.vertices) < len(b.vertices):
        # The directions are tried on the vertices that move, so those are the fewer ones.
        R = np.swapaxes(R, 1, 2)
        a, b, p = b, a, -np.einsum("kij,kj->ki", R, p)
    A, reach = a.vertices, a.radius + b.radius + padding
    (center_a, size_a), (center_b, size_b) = _ball(a.vertices), _ball(b.vertices)
    left = np.flatnonzero(np.linalg.norm(R @ center_b + p - center_a, axis=1) <= size_a + size_b + reach)
    B = b.vertices @ np.swapaxes(R[left], 1, 2) + p[left, None]
    touching = []
    while len(left):
        found = closest(A, B[0])
        if found.gap > reach:
            apart = (A @ found.normal).min() - (B @ found.normal).max(axis=1) > reach
            apart[0] = True
        else:
            touching.append(left[0])
            apart = np.arange(len(left)) == 0
        left, B = left[~apart], B[~apart]
    return np.array(touching, dtype=np.int64)


def _ball(vertices: Array) -> tuple[Array, float]:
    """Returns the centre, (3,), and the radius of a ball that contains the vertices, in the frame and the unit of the vertices."""
    center = (vertices.min(axis=0) + vertices.max(axis=0)) / 2
    return center, float(np.linalg.norm(vertices - center, axis=1).max())

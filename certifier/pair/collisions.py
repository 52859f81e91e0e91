"""Many configurations are told apart here, in floating point, into those in which some pair of padded bodies touches and the others."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import groupby
from typing import Any

import numpy as np
from numpy.typing import NDArray

from certifier.kinematics import Kinematics
from certifier.model import Array, Geometry, Scene, Volume
from certifier.polytopes.closest import closest


def in_collision(scene: Scene, s: Array, room: float = 0.0) -> NDArray[np.bool_]:
    """Returns at which of the points s, (N, n), some pair of the scene is not shown to be apart, padding included; (N,).

    The bodies are shown apart by a direction between them. Errors of rounding therefore make a configuration collide, never the contrary.

    Args:
        room: metres by which the padded bodies have to be apart.
    """
    collides = np.zeros(len(s), dtype=bool)
    for index, (a, b), R, p in _poses(scene, s):
        left = np.flatnonzero(~collides)
        collides[left[_touching(a, b, R[left], p[left], 2 * scene.padding_of(scene.pairs[index]) + room)]] = True
    return collides


def contacts(scene: Scene, s: Array) -> list[list[int]]:
    """Returns for each of the points s, (N, n), the indices of the pairs that are not shown to be apart there, ascending."""
    found: list[list[int]] = [[] for _ in s]
    for index, (a, b), R, p in _poses(scene, s):
        for point in _touching(a, b, R, p, 2 * scene.padding_of(scene.pairs[index])).tolist():
            found[point].append(index)
    return [sorted(pairs) for pairs in found]


def _poses(scene: Scene, s: Array) -> Iterator[tuple[int, tuple[Geometry, Geometry], Array, Array]]:
    """Yields each pair's index and geometries, with the poses R (N, 3, 3) and p (N, 3) of the second's body in the frame of the first's."""
    kinematics = Kinematics.of(scene)
    pairs = [(index, scene.geometry(pair.a), scene.geometry(pair.b)) for index, pair in enumerate(scene.pairs)]

    def bodies(pair: tuple[int, Geometry, Geometry]) -> tuple[str, str]:
        return pair[1].body, pair[2].body

    for (frame, body), alike in groupby(sorted(pairs, key=bodies), key=bodies):
        X = kinematics.numerators(frame, body, s)
        R, p = X[:, :3, :3] / X[:, 3, 3, None, None], X[:, :3, 3] / X[:, 3, 3, None]
        for index, a, b in alike:
            yield index, (a, b), R, p


def answer_in_collision(payload: dict[str, Any]) -> NDArray[np.bool_]:
    """Answers :func:`in_collision` in a child process, for ``scene``, a document, and ``s``."""
    return in_collision(Scene.from_document(payload["scene"]), payload["s"])


def touching(kinematics: Kinematics, volumes: tuple[Volume, Volume], s: Array) -> NDArray[np.bool_]:
    """Returns at which of the points s, (N, n), two volumes are not shown to be apart, padding included; (N,)."""
    a, b = volumes
    X = kinematics.numerators(a.body, b.body, s)
    R, p = X[:, :3, :3] / X[:, 3, 3, None, None], X[:, :3, 3] / X[:, 3, 3, None]
    return np.isin(np.arange(len(s)), _touching(a, b, R, p, 2 * kinematics.scene.padding_between(volumes)))


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

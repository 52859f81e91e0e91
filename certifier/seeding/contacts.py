"""Compiled loops that look for contacts near a configuration, in s.

Near means near in the metric of an ellipsoid: |Q^-1 (s - c)| for its centre c and its shape Q. From a configuration in collision, the way
to the centre leads to the contact of one pair. From there the search goes on along the surface on which this pair touches: to the foot of
the centre on the tangent plane, and back to the surface on the way to the centre, as long as that is nearer.

IRIS-NP finds such contacts by nonlinear programs (Petersen and Tedrake, 2023), and IRIS-ZO stops at the first contact on the way to the
centre (Werner et al., 2024). Nothing here proves anything.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from certifier.collisions.free import distance_at, free_at_all, touching_at
from certifier.collisions.seen import Seen, seen_of
from certifier.model import Array, Pair, Polytope, Scene
from certifier.motion.bodies import Bodies, bodies_of

CLOSE = 1e-4
"""Bodies that are nearer than this, in metres, count as touching; or half as far apart as at the centre, if that is less."""
STEPS = 10
"""The search takes at most this many steps along the surface."""
HALVINGS, FIRST_HALVINGS = 10, 14
"""Halvings that find a contact on the way to the centre: after a step, and from a configuration in collision."""
SHORTER = 6
"""A step that leads to no nearer contact is halved this many times."""
LITTLE = 0.005
"""The search ends with a step that comes nearer by less than this part."""
_MOVE = 1e-5
"""Slopes of distances are differences over this much of s."""


class Contacts:
    """Looks for contacts of a scene's pairs."""

    def __init__(self, scene: Scene) -> None:
        self._scene, self._bodies, self._seen = scene, bodies_of(scene), seen_of(scene)
        self._order = np.arange(len(scene.pairs))

    @property
    def limits(self) -> Polytope:
        """Returns the joint limits in s."""
        return self._scene.polytope([], [])

    def free(self, s: Array) -> NDArray[np.bool_]:
        """Returns at which of the points s, (N, n), no pair touches; (N,)."""
        found: NDArray[np.bool_] = free_at_all(self._bodies, self._seen, np.ascontiguousarray(self._scene.to_q(s)), self._order)
        return found

    def touching(self, s: Array) -> dict[Pair, Array]:
        """Returns pair -> those of the points s, (N, n), at which it touches. A point counts for the first pair that is found."""
        found: dict[Pair, list[Array]] = {}
        for point, q in zip(s, np.ascontiguousarray(self._scene.to_q(s)), strict=True):
            if (pair := touching_at(self._bodies, self._seen, q, self._order)) >= 0:
                found.setdefault(self._scene.pairs[pair], []).append(point)
        return {pair: np.array(points) for pair, points in found.items()}

    def nearest(self, s: Array, center: Array, shape: Array) -> tuple[Array, Array]:
        """Returns contacts near the centre of an ellipsoid, (k, n), and how far they are in its metric, (k,).

        Args:
            s: (N, n) configurations in collision, from which the contacts are found. One that is free leads to none, nor does one whose
                pair touches at the centre.
            center, shape: (n,) and (n, n), symmetric.
        """
        contacts, far = np.empty(s.shape), np.empty(len(s))
        space = (self._scene.q_star, self._scene.revolute)
        frame = (center, shape, np.linalg.inv(shape))
        count = _nearest(self._bodies, self._seen, self._order, np.ascontiguousarray(s), *frame, *space, contacts, far)
        return contacts[:count], far[:count]


@njit(cache=True)
def _to_q(s: Array, q_star: Array, revolute: np.ndarray, q: Array) -> None:
    """Fills in the joint positions q at s."""
    for i in range(len(s)):
        q[i] = q_star[i] + (2.0 * math.atan(s[i]) if revolute[i] else s[i])


@njit(cache=True)
def _distance(bodies: Bodies, seen: Seen, pair: int, s: Array, q_star: Array, revolute: np.ndarray, q: Array, R: Array, p: Array) -> float:
    """Returns how far a pair's padded bodies are apart at s, metres; 0 or less where they touch. ``q``, ``R`` and ``p`` are filled in."""
    _to_q(s, q_star, revolute, q)
    return distance_at(bodies, seen, pair, q, R, p)


@njit(cache=True)
def _nearest(
    bodies: Bodies,
    seen: Seen,
    order: np.ndarray,
    points: Array,
    center: Array,
    shape: Array,
    inverse: Array,
    q_star: Array,
    revolute: np.ndarray,
    contacts: Array,
    far: Array,
) -> int:
    """Fills in contacts and how far they are, and returns their number."""
    n, links, count = len(center), len(bodies.parents), 0
    q, s, slope = np.empty(n), np.empty(n), np.empty(n)
    R, p = np.empty((links, 3, 3)), np.empty((links, 3))
    for point in points:
        _to_q(point, q_star, revolute, q)
        pair = touching_at(bodies, seen, q, order)
        if pair < 0:
            continue
        apart = _distance(bodies, seen, pair, center, q_star, revolute, q, R, p)
        if apart <= 0.0:
            continue
        close = min(CLOSE, 0.5 * apart)
        u = inverse @ (point - center)  # in the ellipsoid's metric, from its centre
        u *= _on_the_way(bodies, seen, pair, center, shape, u, close, FIRST_HALVINGS, q_star, revolute, q, R, p)
        length = np.sqrt(u @ u)
        for _ in range(STEPS):
            s[:] = center + shape @ u
            here = _distance(bodies, seen, pair, s, q_star, revolute, q, R, p)
            for i in range(n):
                s[i] += _MOVE
                slope[i] = (_distance(bodies, seen, pair, s, q_star, revolute, q, R, p) - here) / _MOVE
                s[i] -= _MOVE
            along = shape @ slope
            steep = along @ along
            if steep == 0.0:
                break
            foot, part, nearer = ((u @ along) / steep) * along, 1.0, length
            for _ in range(SHORTER):
                v = u + part * (foot - u)
                apart = _distance(bodies, seen, pair, center + shape @ v, q_star, revolute, q, R, p)
                if apart > close:  # where the surface bends away from the plane
                    v = v - 1.05 * (apart - close) / steep * along
                    apart = _distance(bodies, seen, pair, center + shape @ v, q_star, revolute, q, R, p)
                if apart <= close:
                    v = v * _on_the_way(bodies, seen, pair, center, shape, v, close, HALVINGS, q_star, revolute, q, R, p)
                    nearer = np.sqrt(v @ v)
                    if nearer < length:
                        break
                part *= 0.5
            if nearer >= length:
                break
            u, gained, length = v, length - nearer, nearer
            if gained < LITTLE * length:
                break
        contacts[count], far[count] = center + shape @ u, length
        count += 1
    return count


@njit(cache=True)
def _on_the_way(
    bodies: Bodies,
    seen: Seen,
    pair: int,
    center: Array,
    shape: Array,
    u: Array,
    close: float,
    halvings: int,
    q_star: Array,
    revolute: np.ndarray,
    q: Array,
    R: Array,
    p: Array,
) -> float:
    """Returns where on the way from the centre, at 0, to u in the ellipsoid's metric, at 1, a pair that touches there begins to."""
    lower, upper = 0.0, 1.0
    for _ in range(halvings):
        middle = 0.5 * (lower + upper)
        if _distance(bodies, seen, pair, center + middle * (shape @ u), q_star, revolute, q, R, p) <= close:
            upper = middle
        else:
            lower = middle
    return upper

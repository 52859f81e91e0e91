"""One volume of a pair on its side of a plane, on one cell: control points (certifier.partition.bernstein), and what they prove.

Between frame F and body B the kinematics have one factor T0 + T1 s + T2 s^2 for each joint. On a cell [l, u], let w, v be cos(q/2) at its
ends, or 1 for a slide. Then w^2 (T0 + T1 l + T2 l^2), w v (T0 + T1 (l + u)/2 + T2 l u), and v^2 (T0 + T1 u + T2 u^2) are the control
matrices of a factor. With these weights, equal steps in t are equal angles.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numba import njit

from certifier.model import Array, Volume
from certifier.partition import bernstein
from certifier.partition.area import Area
from certifier.partition.multipliers import PROVED, REFUTED
from certifier.partition.positive import DEPTH, Answer, Question, prove
from certifier.partition.tree import Streams

PRECISION = 1e-7
"""Control values have to be this much larger than 0, relative to what they are made of. The verifier asks for less."""
CODES, FACES = 4, 40
"""There is room for CODES nodes and FACES multipliers for every piece that a vertex may take."""


class Moving(NamedTuple):
    """One volume and how it moves in the frame of the plane.

    Attributes:
        terms: (F, 3, 4, 4) of the factors of its pose.
        joints: (F,) their position indices; -1 for a factor that does not move.
        own: (k,) the same of those that move, ascending; outside: (o,) those of the other joints in play.
        places: (k + o,) which joint in play each of these is.
        rest: (r,) the joints that are not in play.
        vertices: (V, 3) metres, in the body's own frame.
        sign: 1 for the positive side of the plane, -1 for the other.
        radius: metres, padding included.
        revolute: (n,) of all joints.
    """

    terms: Array
    joints: Array
    own: Array
    outside: Array
    places: Array
    rest: Array
    vertices: Array
    sign: float
    radius: float
    revolute: Array


class Proofs(NamedTuple):
    """Streams of proofs as :class:`certifier.partition.tree.Streams` has them; they are filled up to ``lengths``, (3,)."""

    pieces: Array
    counts: Array
    faces: Array
    multipliers: Array
    lengths: Array


class Side:
    """One volume of a pair, in the frame of the plane.

    Args:
        joints: position indices of the joints in play, ascending.
        sign: 1 for the positive side of the plane, -1 for the other.
        radius: metres, padding included.
    """

    def __init__(self, area: Area, frame: str, volume: Volume, joints: list[int], sign: float, radius: float) -> None:
        path = area.kinematics.path(frame, volume.body)
        still = np.array([np.eye(4), np.zeros((4, 4)), np.zeros((4, 4))])
        order = [-1 if factor.index is None else factor.index for factor in path]
        self.own = sorted(joint for joint in order if joint >= 0)
        self.outside = [j for j in joints if j not in self.own]
        self.moving = Moving(
            np.array([still, *(factor.terms for factor in path)]),
            np.array([-1, *order]),
            np.array(self.own, np.int64),
            np.array(self.outside, np.int64),
            np.array([joints.index(joint) for joint in self.own + self.outside], np.int64),
            np.array([joint for joint in range(area.scene.n) if joint not in joints and joint not in self.own], np.int64),
            np.array(volume.vertices, dtype=float),
            sign,
            radius,
            area.scene.revolute,
        )

    def renumbered(self, streams: Streams, play: Sequence[int]) -> Streams:
        """Returns streams with the numbers that the axes have where more joints are in play."""
        outside = [joint for joint in play if joint not in self.own]
        numbers = np.array([*range(len(self.own)), *(len(self.own) + outside.index(joint) for joint in self.outside)], np.int8)
        halved = streams.pieces >= 0
        pieces = streams.pieces.copy()
        pieces[halved] = numbers[pieces[halved]]
        return replace(streams, pieces=pieces)


@njit(cache=True)
def ends_of(moving: Moving, lower: Array, upper: Array) -> Array:
    """Returns the ends of a cell and the cosines of half the angles there, (4, n): the rows l, u, w and v."""
    ends = np.ones((4, len(lower)))
    ends[0], ends[1] = lower, upper
    for i in range(len(lower)):
        if moving.revolute[i]:
            ends[2, i], ends[3, i] = 1 / np.sqrt(1 + lower[i] * lower[i]), 1 / np.sqrt(1 + upper[i] * upper[i])
    return ends


@njit(cache=True)
def control_matrices(moving: Moving, ends: Array) -> tuple[Array, Array]:
    """Returns the control matrices of the volume's pose on a cell with these ends, (3^k, 4, 4), the first own joint slowest.

    The lower right elements of a factor are the denominator in one own joint. They are returned as well, (k, 3).
    """
    k = len(moving.own)
    X, Y, den, place = np.zeros((3**k, 4, 4)), np.zeros((3**k, 4, 4)), np.ones((k, 3)), np.zeros(k, np.int64)
    controls = np.empty((3, 4, 4))
    for a in range(4):
        X[0, a, a] = 1.0
    size, moved = 1, 0
    for f in range(len(moving.joints)):
        j, T = moving.joints[f], moving.terms[f]
        count = 1
        if j < 0:
            controls[0] = T[0]
        else:
            l, u, w, v = ends[0, j], ends[1, j], ends[2, j], ends[3, j]
            for a in range(4):
                for b in range(4):
                    t0, t1, t2 = T[0, a, b], T[1, a, b], T[2, a, b]
                    controls[0, a, b] = w * w * (t0 + l * (t1 + l * t2))
                    controls[1, a, b] = w * v * (t0 + (l + u) / 2 * t1 + l * u * t2)
                    controls[2, a, b] = v * v * (t0 + u * (t1 + u * t2))
            count = 3
            for e in range(k):
                if moving.own[e] == j:
                    place[moved] = e
            for c in range(3):
                den[place[moved], c] = controls[c, 3, 3]
            moved += 1
        for i in range(size):
            for c in range(count):
                for a in range(4):
                    x0, x1, x2, x3 = X[i, a, 0], X[i, a, 1], X[i, a, 2], X[i, a, 3]
                    for b in range(4):
                        t = x0 * controls[c, 0, b] + x1 * controls[c, 1, b]
                        Y[i * count + c, a, b] = t + x2 * controls[c, 2, b] + x3 * controls[c, 3, b]
        size *= count
        X, Y = Y, X
    ordered = True
    for e in range(k):
        ordered = ordered and place[e] == e
    if ordered:
        return X, den
    # X is in path order, the first joint of the path slowest.
    for i in range(size):
        rest, to = i, 0
        for e in range(k - 1, -1, -1):
            to += rest % 3 * 3 ** (k - 1 - place[e])
            rest //= 3
        Y[to] = X[i]
    return Y, den


@njit(cache=True)
def room_for(vertices: int, most: int) -> Proofs:
    """Returns room for the proofs of this many vertices, each of at most ``most`` pieces."""
    pieces = vertices * most
    return Proofs(
        np.empty(CODES * pieces, np.int8),
        np.empty(CODES * pieces, np.int16),
        np.empty(FACES * pieces, np.int16),
        np.empty(FACES * pieces, np.float32),
        np.zeros(3, np.int64),
    )


@njit(cache=True)
def prove_side(
    moving: Moving,
    plane: Array,
    lower: Array,
    upper: Array,
    C: Array,
    d: Array,
    faces: Array,
    most: int,
    proofs: Proofs,
    point: Array,
) -> int:
    """Proves that the volume is on its side of the plane on the polytope and a cell.

    Args:
        plane: (5, 1 + K), affine in s: the normal, the offset, and a bound of the normal's length.
        C, d: the polytope's faces that cut the cell; ``faces`` are their numbers.
        most: at most this many pieces are tried for one vertex.
        proofs: gets the streams of the proof behind what it holds.
        point: (n,) gets a point of the polytope and the cell where a vertex is not on its side, where there is one.

    Returns:
        PROVED, REFUTED, or -1 - j where there were too many pieces; j is the joint along which the pieces were halved most often.
    """
    own, outside, rest = moving.own, moving.outside, moving.rest
    k, o, r, m = len(own), len(outside), len(rest), len(d)
    mid, half = (lower + upper) / 2, (upper - lower) / 2
    ends = ends_of(moving, lower, upper)
    X, den = control_matrices(moving, ends)
    base, slopes = np.empty(4), np.empty((k + o, 4))
    for c in range(4):
        base[c] = moving.sign * plane[c, 0]
        for e in range(k + o):
            slopes[e, c] = moving.sign * plane[c, 1 + moving.places[e]]
    base[3] -= moving.radius * plane[4, 0]
    for e in range(k + o):
        slopes[e, 3] -= moving.radius * plane[4, 1 + moving.places[e]]
    own_ends, halves = np.empty((4, k)), np.empty((o, 4))
    for e in range(k):
        own_ends[:, e] = ends[:, own[e]]
    for e in range(o):
        base += slopes[k + e] * mid[outside[e]]
        halves[e] = slopes[k + e] * half[outside[e]]
    c = bernstein.polynomials(X, moving.vertices, base, slopes[:k], halves, own_ends)
    factors = bernstein.factors(den, own_ends)
    constant, by_own, by_outside, by_rest = d.copy(), np.empty((k, m)), np.empty((o, m)), np.empty((r, m))
    for j in range(m):
        for e in range(k):
            by_own[e, j] = -C[j, own[e]]
        for e in range(o):
            by_outside[e, j] = -C[j, outside[e]] * half[outside[e]]
            constant[j] -= C[j, outside[e]] * mid[outside[e]]
        for e in range(r):
            by_rest[e, j] = -C[j, rest[e]] * half[rest[e]]
            constant[j] -= C[j, rest[e]] * mid[rest[e]]
    V = len(moving.vertices)
    stack, spot = np.empty((DEPTH, 1 + o, 4**k)), np.zeros(k + o + r)
    found, where = room_for(V, most), np.zeros((V + 1, 3), np.int64)
    order, halvings = np.argsort(bernstein.leasts(c)), np.zeros(k + o, np.int64)
    ends_at = np.zeros((V, 3), np.int64)
    for vertex in order:
        a, b, e = found.lengths
        where[vertex] = found.lengths
        lengths = np.zeros(3, np.int64)
        halvings[:] = 0
        answer = Answer(
            found.pieces[a : a + CODES * most],
            found.counts[b : b + CODES * most],
            found.faces[e : e + FACES * most],
            found.multipliers[e : e + FACES * most],
            lengths,
            spot,
            halvings,
        )
        status = prove(Question(c[vertex], factors, own_ends, constant, by_own, by_outside, by_rest), PRECISION, most, answer, stack)
        if status == REFUTED:
            point[:] = mid
            for i in range(k):
                point[own[i]] = spot[i]
            for i in range(o):
                point[outside[i]] = mid[outside[i]] + half[outside[i]] * spot[k + i]
            for i in range(r):
                point[rest[i]] = mid[rest[i]] + half[rest[i]] * spot[k + o + i]
            return REFUTED
        if status != PROVED:
            most_halved = halvings.argmax()
            return -1 - (own[most_halved] if most_halved < k else outside[most_halved - k])
        for i in range(3):
            found.lengths[i] += lengths[i]
        ends_at[vertex] = found.lengths
    for vertex in range(V):
        a, b, e = proofs.lengths
        first, last = where[vertex], ends_at[vertex]
        lengths = last - first
        proofs.pieces[a : a + lengths[0]] = found.pieces[first[0] : last[0]]
        proofs.counts[b : b + lengths[1]] = found.counts[first[1] : last[1]]
        for i in range(lengths[2]):
            proofs.faces[e + i] = faces[found.faces[first[2] + i]]
            proofs.multipliers[e + i] = found.multipliers[first[2] + i]
        for i in range(3):
            proofs.lengths[i] += lengths[i]
    return PROVED

"""The polynomials of one volume on one cell in Bernstein form; certifier.verify.partition describes this form, and checks it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache

import numpy as np

from certifier.model import Array, Volume
from certifier.partition import bernstein
from certifier.partition.area import Area
from certifier.partition.multipliers import REFUTED, UNDECIDED
from certifier.partition.positive import DEPTH, Answer, Question, prove
from certifier.partition.tree import Streams, joined

PRECISION = 1e-7
"""Control values have to be this much larger than 0, relative to what they are made of. The verifier asks for less."""
ROOM = 4096
"""At most this many pieces are stored for a vertex, and ten times as many multipliers."""


class Side:
    """One volume of a pair, in the frame of the plane.

    Args:
        joints: position indices of the joints in play, ascending.
        sign: 1 for the positive side of the plane, -1 for the other.
        radius: metres, padding included.
    """

    def __init__(self, area: Area, frame: str, volume: Volume, joints: list[int], sign: float, radius: float) -> None:
        self.volume, self.sign, self.radius = volume, sign, radius
        self._path, self._joints = area.kinematics.path(frame, volume.body), joints
        self._order = [factor.index for factor in self._path if factor.index is not None]
        self.own = sorted(self._order)
        self.outside = [j for j in joints if j not in self.own]
        self._space = area.scene

    def ends(self, lower: Array, upper: Array) -> Array:
        """Returns the ends of a cell and the cosines of half the angles there, (4, n): the rows l, u, w and v."""
        bounds = np.array([lower, upper])
        return np.concatenate([bounds, self._space.cosine(bounds)])

    def control_matrices(self, ends: Array) -> tuple[Array, Array]:
        """Returns the control matrices of the volume's pose on a cell with these ends, (3^k, 4, 4), the first own joint slowest.

        The lower right elements of a factor are the denominator in one own joint. They are returned as well, (k, 3).
        """
        X, den = np.eye(4)[None], np.ones((len(self.own), 3))
        for factor in self._path:
            T = factor.terms
            if factor.index is None:
                X = X @ T[0]
                continue
            l, u, w, v = ends[:, factor.index]
            controls = [
                w * w * (T[0] + l * (T[1] + l * T[2])),
                w * v * (T[0] + (l + u) / 2 * T[1] + l * u * T[2]),
                v * v * (T[0] + u * (T[1] + u * T[2])),
            ]
            den[self.own.index(factor.index)] = [control[3, 3] for control in controls]
            X = (X[:, None] @ np.array(controls)).reshape(-1, 4, 4)
        k = len(self.own)
        if self._order != self.own:
            X = X.reshape((3,) * k + (4, 4)).transpose([self._order.index(j) for j in self.own] + [k, k + 1]).reshape(-1, 4, 4)
        return np.ascontiguousarray(X), den

    def renumbered(self, streams: Streams, play: Sequence[int]) -> Streams:
        """Returns streams with the numbers that the axes have where more joints are in play."""
        outside = [joint for joint in play if joint not in self.own]
        numbers = np.array([*range(len(self.own)), *(len(self.own) + outside.index(joint) for joint in self.outside)], np.int8)
        halved = streams.pieces >= 0
        pieces = streams.pieces.copy()
        pieces[halved] = numbers[pieces[halved]]
        return replace(streams, pieces=pieces)

    def prove(self, plane: Array, lower: Array, upper: Array, C: Array, d: Array, faces: Array, most: int) -> Streams | Array | int:
        """Proves that the volume is on its side of the plane on the polytope and a cell.

        Args:
            plane: (5, 1 + k), affine in s: the normal, the offset, and a bound of the normal's length.
            C, d: the polytope's faces that cut the cell; ``faces`` are their numbers.
            most: at most this many pieces are tried for one vertex.

        Returns:
            The streams of the proof; or a point (n,) of the polytope and the cell where a vertex is not on its side; or the joint along
            which the pieces were halved most often when they were too many.
        """
        mid, half = (lower + upper) / 2, (upper - lower) / 2
        own, outside = self.own, self.outside
        rest = [i for i in range(len(mid)) if i not in own and i not in outside]
        ends = self.ends(lower, upper)
        X, den = self.control_matrices(ends)
        plane, bound = self.sign * plane[:4], plane[4]
        plane[3] -= self.radius * bound
        slopes = {joint: plane[:, 1 + place] for place, joint in enumerate(self._joints)}
        ends = np.ascontiguousarray(ends[:, own])
        c = bernstein.polynomials(
            X,
            self.volume.vertices,
            plane[:, 0] + sum((slopes[j] * mid[j] for j in outside), np.zeros(4)),
            np.array([slopes[j] for j in own]).reshape(-1, 4),
            np.array([slopes[j] * half[j] for j in outside]).reshape(-1, 4),
            ends,
        )
        factors = bernstein.factors(den, ends)
        offset = d - C[:, outside] @ mid[outside] - C[:, rest] @ mid[rest]
        g = (
            np.ascontiguousarray(offset),
            np.ascontiguousarray(-C[:, own].T),
            np.ascontiguousarray((-C[:, outside] * half[outside]).T),
            np.ascontiguousarray((-C[:, rest] * half[rest]).T),
        )
        found: dict[int, Streams] = {}
        for vertex in np.argsort(bernstein.leasts(c)):
            codes, counts, numbers, values = _room()
            lengths, point, halvings = np.zeros(3, np.int64), np.zeros(len(mid)), np.zeros(len(own) + len(outside), np.int64)
            answer = Answer(codes, counts, numbers, values, lengths, point, halvings)
            status = prove(Question(c[vertex], factors, ends, *g), PRECISION, most, answer, _stack(len(outside), len(own)))
            if status == REFUTED:
                s = mid.copy()
                place = len(own) + len(outside)
                s[own] = point[: len(own)]
                s[outside] = mid[outside] + half[outside] * point[len(own) : place]
                s[rest] = mid[rest] + half[rest] * point[place:]
                return s
            if status == UNDECIDED:
                return int([*own, *outside][int(halvings.argmax())])
            a, b, e = lengths
            found[int(vertex)] = Streams(codes[:a].copy(), counts[:b].copy(), faces[numbers[:e]].astype(np.int16), values[:e].copy())
        return joined([found[vertex] for vertex in range(len(c))])


@lru_cache(maxsize=8)
def _stack(outside: int, own: int) -> Array:
    """Returns memory to work in, which all sides share, because a process may have hundreds of them."""
    return np.empty((DEPTH, 1 + outside, 4**own))


@lru_cache(maxsize=1)
def _room() -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Returns room for the codes, counts, faces and multipliers of one vertex, which all sides share."""
    return np.empty(ROOM, np.int8), np.empty(ROOM, np.int16), np.empty(10 * ROOM, np.int16), np.empty(10 * ROOM, np.float32)

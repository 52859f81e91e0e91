"""Polynomials in Bernstein form are proved positive on a polytope, one box of it after the other (certifier.partition.bernstein).

On a cell, f > 0 has to hold wherever all faces g_j are >= 0. A piece is a box in the own and the outside coordinates; the first piece is
the cell. Suppose that z_0 f - sum_j z_j g_j > 0 on a piece for some z >= 0. With z_0 = 1, f > sum_j z_j g_j >= 0 wherever the piece meets
the polytope. With z_0 = 0, sum_j z_j g_j < 0, so at each point of the piece some face is negative: the piece misses the polytope. A
polynomial is positive on a box if all of its control values are positive, so only these are computed. Where no z is found, the piece is
halved, and its halves begin with the last z of their parent.

Everything uses one thread. Nothing here is trusted: the verifier checks what is found.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

from certifier.model import Array
from certifier.partition.bernstein import alone, evaluate, extremes, halve, lowest, steepest
from certifier.partition.multipliers import MORE, PROVED, REFUTED, SLIGHT, UNDECIDED, choose, multipliers, rounded, violated
from certifier.polytopes.simplex import dot
from certifier.proof.limits import PIECE_DEPTH

ATTEMPTS = 4
"""A piece gets this many searches for multipliers, each with more faces."""
EARLY, HOPELESS = 16, 4.0
"""A proof is given up when, after EARLY pieces, what they have proved lets one expect HOPELESS times as many pieces as are allowed."""
DEPTH = 40
"""At most this many pieces wait while others are tried."""
WHOLE = 0.1
"""A piece is as precise as this part of the cell, at least."""
OUTSIDE = 1e-7
"""A point of the polytope may be beyond a face by this, relative to the magnitude of the face's values."""


class Question(NamedTuple):
    """A polynomial f and the faces g_j of a polytope, on a cell with k own, o outside and r other coordinates.

    Attributes:
        c: (1 + o, 4^k) of f, as for :func:`lowest`.
        den: (2, k, 4) the factors of the denominator.
        ends: (4, k) as for :func:`evaluate`.
        constant, own, outside, rest: (m,), (k, m), (o, m), (r, m) of the faces.
    """

    c: Array
    den: Array
    ends: Array
    constant: Array
    own: Array
    outside: Array
    rest: Array


class Answer(NamedTuple):
    """What :func:`prove` fills in.

    Attributes:
        codes, counts, faces, values: streams of the proof (certifier.proof.partition), written from ``lengths`` on.
        lengths: (3,) of codes, counts and faces; they are advanced.
        point: (k + o + r,) gets a point of the polytope where f < 0, when REFUTED: own coordinates as they are, the others in [-1, 1].
        halvings: (k + o,) counts how often each coordinate was halved.
    """

    codes: Array
    counts: Array
    faces: Array
    values: Array
    lengths: Array
    point: Array
    halvings: Array


class _Pieces(NamedTuple):
    """The pieces that wait, a stack of at most DEPTH.

    Attributes:
        c, den: (DEPTH, 1 + o, 4^k), (DEPTH, 2, k, 4) of f and of the denominator on each piece.
        center, half: (DEPTH, o) of each piece in the outside coordinates.
        z: (DEPTH, 1 + m) the multipliers that each piece begins with.
        level: (DEPTH,) how often the cell was halved to make each piece.
    """

    c: Array
    den: Array
    center: Array
    half: Array
    z: Array
    level: Array


class _Piece(NamedTuple):
    """One piece: its faces, the magnitudes that rounding errors are relative to, and what is found.

    Attributes:
        constant, outside: (m,), (o, m) of the faces in the coordinates of the piece.
        scale: (1 + m,) a bound of the control values of f, and of those of each face.
        whole: (1 + m,) the same of the cell.
        least: (1 + m,) control values have to be larger than the multipliers times this.
        f: (4^k,) the least values of f in the outside coordinates.
        z: (1 + m,) the multipliers that are found.
        near: (1 + n,) the multipliers that the last search found, of the chosen faces.
        chosen: numbers of the faces that were searched with.
        spot: (k + o + r,) where f is not positive, when a search refutes.
    """

    constant: Array
    outside: Array
    scale: Array
    whole: Array
    least: Array
    f: Array
    z: Array
    near: Array
    chosen: Array
    spot: Array


@njit(cache=True)
def prove(question: Question, precision: float, most: int, answer: Answer, stack: Array) -> int:
    """Proves that f > 0 wherever all g_j >= 0, on a cell that is halved where one set of multipliers is not enough.

    Where a joint turns by more than 180 degrees, the denominator has negative control values, and what is proved there with a face need not
    hold when the face is moved in. Such a piece is halved in this joint, unless f alone is positive.

    Args:
        precision: control values must be larger than this multiple of the magnitude of what they are made of.
        most: give up after this many pieces.
        stack: (DEPTH, 1 + o, 4^k) is overwritten.

    Returns:
        PROVED, REFUTED or UNDECIDED.
    """
    m = len(question.constant)
    pieces, piece = _begun(question, stack)
    top, count, done = 1, 0, 0.0
    while top:
        top -= 1
        count += 1
        weight, wide = _measure(question, pieces, top, piece)
        if count == 1:
            piece.whole[:] = piece.scale
        # The verifier's bound of rounding errors is about the whole cell.
        piece.least[:] = precision * np.maximum(piece.scale, WHOLE * piece.whole)
        least_of_f = alone(pieces.c[top], piece.f)
        found, searched = _inherited(question, pieces, top, piece, wide, least_of_f), 0
        if not found and m and wide < 0:
            kind, searched = _search(question, pieces, top, piece, weight, least_of_f)
            if kind == REFUTED:
                answer.point[:] = piece.spot
                return REFUTED
            found = kind == PROVED
        if found:
            if not _write(piece.z, answer):
                return UNDECIDED
            done += 0.5 ** pieces.level[top]
            continue
        hopeless = count >= EARLY and count > HOPELESS * done * most
        full = top + 2 > DEPTH or pieces.level[top] == PIECE_DEPTH or answer.lengths[0] >= len(answer.codes)
        if hopeless or full or count >= most:
            return UNDECIDED
        axis = wide if wide >= 0 else steepest(pieces.c[top], pieces.den.shape[2])
        answer.halvings[axis] += 1
        answer.codes[answer.lengths[0]] = axis
        answer.lengths[0] += 1
        _hand_down(pieces, top, piece, searched)
        _halve(pieces, top, axis)
        top += 2
    return PROVED


@njit(cache=True)
def _begun(question: Question, stack: Array) -> tuple[_Pieces, _Piece]:
    """Returns the stack with the cell as its only piece, and memory for the piece that is looked at."""
    c, m, k, o, r = question.c, len(question.constant), question.den.shape[1], question.c.shape[0] - 1, question.rest.shape[0]
    D = 1 + m
    pieces = _Pieces(
        stack, np.empty((DEPTH, 2, k, 4)), np.zeros((DEPTH, o)), np.ones((DEPTH, o)), np.empty((DEPTH, D)), np.zeros(DEPTH, np.int64)
    )
    pieces.c[0], pieces.den[0], pieces.z[0, :], pieces.z[0, 0] = c, question.den, 0.0, 1.0
    piece = _Piece(
        np.zeros(m),
        np.zeros((o, m)),
        np.zeros(D),
        np.zeros(D),
        np.zeros(D),
        np.empty(c.shape[1]),
        np.zeros(D),
        np.zeros(D),
        np.zeros(m, np.int64),
        np.zeros(k + o + r),
    )
    return pieces, piece


@njit(cache=True)
def _measure(question: Question, pieces: _Pieces, top: int, piece: _Piece) -> tuple[float, int]:
    """Fills in the faces and magnitudes of a piece.

    A control value of a face is that of an affine function times the denominator. The largest control value of the denominator is the
    product of those of its factors. The quotient of the largest values of a factor times its coordinate and of the factor bounds what an
    own coordinate adds.

    Returns:
        The largest control value of the denominator; and the last own coordinate in which the denominator has a negative control value, -1
        for none.
    """
    now, own, outside, rest = pieces.den[top], question.own, question.outside, question.rest
    m, k, o, r = len(question.constant), now.shape[1], outside.shape[0], rest.shape[0]
    low, high = extremes(pieces.c[top, 0])
    weight, wide, reach = 1.0, -1, np.zeros(k)
    for i in range(k):
        largest = 0.0
        for x in range(4):
            if now[0, i, x] < 0:
                wide = i
            largest = max(largest, abs(now[0, i, x]))
            reach[i] = max(reach[i], abs(now[1, i, x]))
        weight *= largest
        reach[i] /= largest
    piece.constant[:] = question.constant
    for i in range(o):
        for j in range(m):
            piece.constant[j] += outside[i, j] * pieces.center[top, i]
            piece.outside[i, j] = outside[i, j] * pieces.half[top, i]
    piece.scale[0] = max(high, -low)
    bound = piece.scale[1:]
    bound[:] = np.abs(piece.constant)
    for i in range(k):
        for j in range(m):
            bound[j] += abs(own[i, j]) * reach[i]
    for i in range(o):
        for j in range(m):
            bound[j] += abs(piece.outside[i, j])
    for i in range(r):
        for j in range(m):
            bound[j] += abs(rest[i, j])
    bound *= weight
    return weight, wide


@njit(cache=True)
def _inherited(question: Question, pieces: _Pieces, top: int, piece: _Piece, wide: int, least_of_f: float) -> bool:
    """Returns whether the multipliers that the piece begins with prove it, or f alone; ``piece.z`` gets those that do."""
    m, k, o = len(piece.constant), pieces.den.shape[2], len(piece.outside)
    z = piece.z
    z[:] = pieces.z[top]
    if wide >= 0:
        z[1:] = 0.0
    held, n = np.zeros(m, np.int64), 0
    for j in range(m):
        if z[1 + j] != 0.0:
            held[n] = j
            n += 1
    if n:
        some = np.empty(1 + n)
        some[0] = z[0]
        for x in range(n):
            some[1 + x] = z[1 + held[x]]
        rows = _rows(held, n, piece.constant, question.own, piece.outside, question.rest)
        if lowest(some, pieces.c[top], pieces.den[top], *rows, np.zeros(k + o))[0] > dot(z, piece.least):
            return True
    z[:] = 0.0
    z[0] = 1.0
    return least_of_f > piece.least[0]


@njit(cache=True)
def _search(question: Question, pieces: _Pieces, top: int, piece: _Piece, weight: float, least_of_f: float) -> tuple[int, int]:
    """Looks for multipliers of a few faces, and again with the faces that the point violates at which the search ended.

    Returns:
        PROVED, where ``piece.z`` proves the piece; REFUTED, where ``piece.spot`` is a point of the polytope with f < 0; or UNDECIDED. And
        the number of faces of the last search.
    """
    m = len(piece.constant)
    c, den, chosen, spot, near = pieces.c[top], pieces.den[top], piece.chosen, piece.spot, piece.near
    n = choose(piece.f, c, den, piece.constant, question.own, piece.outside, piece.scale, pieces.z[top], 0.5 * least_of_f, chosen)
    place = _first(piece.f, least_of_f)
    some, enough, beyond, worst = np.zeros(1 + m), np.zeros(1 + m), np.zeros(m), np.zeros(MORE, np.int64)
    for _ in range(ATTEMPTS):
        some[0], enough[0] = piece.scale[0], piece.least[0]
        for x in range(n):
            some[1 + x], enough[1 + x] = piece.scale[1 + chosen[x]], piece.least[1 + chosen[x]]
        rows = _rows(chosen, n, piece.constant, question.own, piece.outside, question.rest)
        kind = multipliers(c, den, *rows, some[: 1 + n], enough[: 1 + n], place, near[: 1 + n], spot)
        if kind == PROVED:
            piece.z[:] = 0.0
            piece.z[0] = near[0]
            piece.z[1 + chosen[:n]] = near[1 : 1 + n]
        if kind != REFUTED:
            return kind, n
        if not _within(question, pieces, top, spot):
            break
        if _beyond(question, piece, spot, weight, beyond):
            return (REFUTED if evaluate(question.c, spot, question.ends) < 0 else UNDECIDED), n
        before = n
        n = violated(beyond, chosen, n, worst)
        if n == before:
            break
    return UNDECIDED, n


@njit(cache=True)
def _within(question: Question, pieces: _Pieces, top: int, spot: Array) -> bool:
    """Returns whether a spot is in its piece, as a mean of control points need not be; its outside coordinates become those of the cell."""
    k, o = pieces.den.shape[2], pieces.center.shape[1]
    if len(spot) > k and np.abs(spot[k:]).max() > 1:
        return False
    for i in range(k):
        if not question.ends[0, i] <= spot[i] <= question.ends[1, i]:
            return False
    for i in range(o):
        spot[k + i] = pieces.center[top, i] + pieces.half[top, i] * spot[k + i]
    return True


@njit(cache=True)
def _beyond(question: Question, piece: _Piece, spot: Array, weight: float, beyond: Array) -> bool:
    """Returns whether a spot of the cell is in the polytope; ``beyond`` (m,) gets how far it is beyond each face, relative to that face."""
    own, outside, rest = question.own, question.outside, question.rest
    m, k, o, r = len(beyond), own.shape[0], outside.shape[0], rest.shape[0]
    beyond[:] = question.constant
    for i in range(k):
        for j in range(m):
            beyond[j] += own[i, j] * spot[i]
    for i in range(o):
        for j in range(m):
            beyond[j] += outside[i, j] * spot[k + i]
    for i in range(r):
        for j in range(m):
            beyond[j] += rest[i, j] * spot[k + o + i]
    inside = True
    for j in range(m):
        beyond[j] = -(beyond[j] * weight / piece.scale[1 + j] + OUTSIDE)
        inside = inside and beyond[j] <= 0
    return inside


@njit(cache=True)
def _write(z: Array, answer: Answer) -> bool:
    """Writes the multipliers of a piece into the streams; returns whether there was room."""
    lengths = answer.lengths
    if lengths[0] >= len(answer.codes) or lengths[1] >= len(answer.counts):
        return False
    answer.codes[lengths[0]] = -1 if z[0] > 0 else -2
    lengths[0] += 1
    used = 0
    for j in range(len(z) - 1):
        if z[1 + j] > 0:
            if lengths[2] >= len(answer.faces):
                return False
            answer.faces[lengths[2]], answer.values[lengths[2]] = j, z[1 + j]
            lengths[2] += 1
            used += 1
    answer.counts[lengths[1]] = used
    lengths[1] += 1
    return True


@njit(cache=True)
def _hand_down(pieces: _Pieces, top: int, piece: _Piece, searched: int) -> None:
    """Lets a piece's halves begin with the multipliers that the last search found, where f has a share in them."""
    near = piece.near
    pieces.z[top, 0] = 1.0
    if searched and near[0] > SLIGHT * near[: 1 + searched].max():
        for j in range(searched):
            pieces.z[top, 1 + piece.chosen[j]] = rounded(near[1 + j] / near[0])
    pieces.z[top + 1] = pieces.z[top]


@njit(cache=True)
def _halve(pieces: _Pieces, top: int, axis: int) -> None:
    """Halves a piece in a coordinate: the upper half takes its place, and the lower half comes next."""
    k = pieces.den.shape[2]
    c, den, center, half = pieces.c, pieces.den, pieces.center, pieces.half
    center[top + 1], half[top + 1] = center[top], half[top]
    pieces.level[top] += 1
    pieces.level[top + 1] = pieces.level[top]
    den[top + 1] = den[top]
    if axis < k:
        halve(c[top], axis, k, c[top + 1])
        upper, lower = den[top][:, axis].copy(), np.empty((2, 4))
        halve(upper, 0, 1, lower)
        den[top + 1, :, axis], den[top][:, axis] = lower, upper
        return
    i = axis - k
    c[top + 1] = c[top]
    for a in range(c.shape[2]):
        t = 0.5 * c[top, 1 + i, a]
        c[top + 1, 0, a] = c[top, 0, a] - t
        c[top, 0, a] = c[top, 0, a] + t
        c[top, 1 + i, a] = c[top + 1, 1 + i, a] = t
    half[top, i] *= 0.5
    half[top + 1, i] = half[top, i]
    center[top + 1, i] = center[top, i] - half[top, i]
    center[top, i] += half[top, i]


@njit(cache=True)
def _first(values: Array, value: float) -> int:
    """Returns the first place of a value that is among the values."""
    for place in range(len(values)):
        if values[place] == value:
            return place
    return 0


@njit(cache=True)
def _rows(chosen: Array, n: int, constant: Array, own: Array, outside: Array, rest: Array) -> tuple[Array, Array, Array, Array]:
    """Returns the constants and slopes of the first n chosen faces, one row for each, of those that stand in columns."""
    to_constant, to_own, to_outside, to_rest = np.empty(n), np.empty((n, len(own))), np.empty((n, len(outside))), np.empty((n, len(rest)))
    for x in range(n):
        j = chosen[x]
        to_constant[x] = constant[j]
        for i in range(len(own)):
            to_own[x, i] = own[i, j]
        for i in range(len(outside)):
            to_outside[x, i] = outside[i, j]
        for i in range(len(rest)):
            to_rest[x, i] = rest[i, j]
    return to_constant, to_own, to_outside, to_rest

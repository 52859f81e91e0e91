"""One side of a proof over a partition is brought here into control points of Bernstein polynomials, with bounds of what rounding does.

Let i be one of the k *own* joints, those between the frame F and the side's body, with [l, u] its range in a cell. With weights w0, w1 > 0

    s_i = ((1 - t) w0 l + t w1 u) / ((1 - t) w0 + t w1),   t in [0, 1],

runs over the range. A factor T0 + T1 s_i + T2 s_i^2 of the kinematics, times the square of the denominator, has the control matrices
w0^2 (T0 + T1 l + T2 l^2), w0 w1 (T0 + T1 (l + u)/2 + T2 l u) and w1^2 (T0 + T1 u + T2 u^2). Times the linear forms (w0, w1) for 1 or
(w0 l, w1 u) for s_i, it is of degree 3 and has four control matrices. The tensor product of such along the path, with the form for s_i at
no joint or at one, is X_FB's or s_i X_FB's. So there are 4^k control points alpha, of

    D = den,   T_i = den s_i,   C_0 = den f's part without tau,   C_o = den f's part with tau_o,

where the other joints o in play, the *outside* ones, are s_o = m_o + h_o tau_o with tau_o in [-1, 1], and f is the vertex' signed
distance +-(a'p + b) - r kappa (times |a|). den > 0 everywhere, whatever the signs of its control values. A joint that moves neither has
s = m + h tau over the box of the whole polytope. For multipliers lambda of the faces d_j - C_j s, with L = lambda'd and S = lambda'C,

    F(alpha) = z0 C_0 + (-L + sum_outside S_o m_o + sum_other (S_o m_o - |S_o| h_o)) D + sum_own S_i T_i - sum_outside |z0 C_o + S_o h_o D|

is positive for all alpha only if  den (z0 f - sum_j lambda_j (d_j - C_j s)) > 0  on the whole piece: for fixed taus this is a polynomial in
t whose control values are no less than F(alpha), up to the term of the other joints, which is den > 0 times its least value.

Halving an own joint's range is de Casteljau's algorithm at t = 1/2; halving an outside joint's replaces m, h by m -+ h/2, h/2.

Rounding
--------
All numbers are doubles. What they are exact for are the cell, the plane, kappa, the weights, the vertices, C, d and lambda; T is exact and
is rounded once. A computed number is a sum of products of inputs in which each product has been multiplied by at most K numbers 1 + e,
|e| <= u = 2^-53: K(x + y) <= max(K(x), K(y)) + 1, K(x y) <= K(x) + K(y) + 1, and a sum of m products in any order, with or without fused
operations, has m roundings at most. Absolute values change none of that. So it is wrong by at most ((1 + u)^K - 1) times its *size*, which
is the same expression in absolute values. The kinematics have

    K(l l) = K(w w) = K((l + u)/2) = 1,  K(control matrix) <= 7,  of degree 3: K <= 7 + 5 = 12 (w l, product, sum, division),
    K(b - r kappa) <= 2,  K(Z_0 + sum Z_o m_o) <= 17; times a joint's matrices for 1 and s_i: each time 12 + 4 + 1 more,
    vertices: each joint 12 + 4 more; for k <= 7 joints, of which at most 3 are multiplied to the rows and 4 to the vertices, and a sum of
    4 (1 + 4) products at last: K(C) <= (17 + 3 17) + 4 16 + 20 = 152,
    K(D), K(T) <= 7 12 + 7 = 91, products of one factor for each own joint, the entries [3][3] of the matrices,
    64 halvings, sums of 4 products, hence of 4 roundings each: K(C) <= 408,  K(D), K(T) <= 347,
    L and S of M multipliers: M + 1; times m_o (64 halvings), and the sum over n <= 64 joints: M + 1 + 65 + 66 = M + 132,
    times D and T, factor by factor, with a product and a sum for each, and S_i's own product: M + 132 + 7 (12 + 2) + 1 + 256 = M + 487,
    then C_0 is added, and 14 sums of two terms are subtracted at most: M + 503.

So K = M + 512 holds with room, and (1 + u)^K - 1 <= 1.01 K u. The size is not computed for every alpha: the largest of each factor's
entries gives an upper bound that holds for all of them, and for all pieces of a cell, as halving takes means. The bound 2 K u size leaves a
factor 1.9 for the roundings of the size itself.

Products may underflow: each is then wrong by 2^-1074 more. Every magnitude from which the sizes of C, D and T are made is at least 2^-40,
and no product has more than 20 factors, so its size is at least 2^-800. An underflow is therefore less than u times the size. It is
covered by a rounding, of which every product was given one. What underflows in L and S is less than u times the 2^-40 that is added to the
size of what multiplies D. Overflow makes something that is not finite, which is refused; with a zero of the matrices that halve, it may
make others so as well. Zeros round nothing.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property

import numpy as np

from certifier.model import Array, Volume
from certifier.verify.bernstein import HALVES, combined, half_of, products, raised
from certifier.verify.kinematics import ExactKinematics
from certifier.verify.streams import Sums

UNIT = 2.0**-53
ROUNDINGS = 512
LEAST = 2.0**-40
"""No magnitude in a size is smaller than this."""


def rounding(size: Array, multipliers: np.ndarray) -> Array:
    """Returns a bound of what rounding does to numbers of these sizes that have this many multipliers."""
    bound: Array = 2.0 * UNIT * (ROUNDINGS + multipliers) * size
    return bound


@dataclass(frozen=True)
class Box:
    """Holds the box around the polytope, as m +- h for every joint (each (n,)), with the magnitudes of its values."""

    mid: Array
    half: Array
    size: Array

    @classmethod
    def of(cls, lower: Array, upper: Array) -> Box:
        return cls(*_mid_half(lower, upper), np.maximum(np.maximum(np.abs(lower), np.abs(upper)), LEAST))


@dataclass(frozen=True)
class Control:
    """Holds the control values of V vertices on B pieces; kA own joints, kB outside ones, N = 4^kA.

    Attributes:
        c: (B, V, 1 + kB, N) C_0 and the C_o.
        factors: (B, kA, 4) the factors of D, of one own joint each.
        others: (B, kA, 4) what takes a factor's place in T_i.
        mid: (B, kB) m_o.
        half: (B, kB) h_o.
        c_size: (B, V, 1 + kB) sizes of c.
        dt_size: (B, 1 + kA) sizes of D and the T_i.
        mid_size: (B, kB) sizes of m_o and h_o.
    """

    c: Array
    factors: Array
    others: Array
    mid: Array
    half: Array
    c_size: Array
    dt_size: Array
    mid_size: Array

    @property
    def dt(self) -> Array:
        """Returns D and the T_i, (B, 1 + kA, N)."""
        B, own = self.factors.shape[:2]
        return combined(np.broadcast_to(np.eye(1 + own), (B, 1 + own, 1 + own)), self.factors, self.others, self.den)

    @cached_property
    def den(self) -> list[Array]:
        """Returns D's factors for no own joint, for the last one, for the last two multiplied, and so on; D, (B, N), is the last."""
        return products(self.factors)

    def single(self) -> Control:
        """Returns B V pieces of one vertex each; those of a piece's vertices follow each other."""
        B, V = self.c.shape[:2]
        alone = {name: getattr(self, name).reshape(B * V, 1, *getattr(self, name).shape[2:]) for name in ("c", "c_size")}
        return Control(**alone, **{name: np.repeat(getattr(self, name), V, axis=0) for name in _ARRAYS if name not in alone})

    def some(self, pieces: slice) -> Control:
        """Returns some of the pieces."""
        return Control(*(getattr(self, name)[pieces] for name in _ARRAYS))

    @classmethod
    def together(cls, parts: Sequence[Control], places: np.ndarray) -> Control:
        """Returns the pieces of all parts, each in its place."""
        first = parts[0]
        found = cls(*(np.empty((len(places), *getattr(first, name).shape[1:])) for name in _ARRAYS))
        begin = 0
        for part in parts:
            end = begin + len(part.c)
            for name in _ARRAYS:
                getattr(found, name)[places[begin:end]] = getattr(part, name)
            begin = end
        return found

    def halves(self, axis: int) -> tuple[Control, Control]:
        """Returns the lower and the upper half along an axis: first the own joints, then the outside ones."""
        own = self.factors.shape[1]
        if axis < own:
            return self._half(axis, False), self._half(axis, True)
        o = axis - own
        step = 0.5 * self.c[:, :, 1 + o]
        low, high = self.c.copy(), self.c.copy()
        low[:, :, 0] -= step
        high[:, :, 0] += step
        low[:, :, 1 + o] = high[:, :, 1 + o] = step
        half, mid_low, mid_high = self.half.copy(), self.mid.copy(), self.mid.copy()
        half[:, o] *= 0.5
        mid_low[:, o] -= half[:, o]
        mid_high[:, o] += half[:, o]
        return replace(self, c=low, mid=mid_low, half=half), replace(self, c=high, mid=mid_high, half=half)

    def _half(self, axis: int, upper: bool) -> Control:
        factors, others, own = self.factors.copy(), self.others.copy(), self.factors.shape[1]
        for values in (factors, others):
            values[:, axis] = values[:, axis] @ HALVES[upper].T
        return replace(self, c=half_of(self.c, axis, own, upper), factors=factors, others=others)


_ARRAYS = tuple(field.name for field in fields(Control))


class Side:
    """Holds one volume of a proof: how it moves in the frame, and which joints in play do that.

    Args:
        play: position indices of the joints in play, ascending.
        radius: of the volume, with the padding, in metres; a double that is not less.
        sign: 1 for the volume on the positive side of the planes, -1 for the other.

    Attributes:
        own: numbers among the joints in play of those between the frame and the volume's body, ascending.
        outside: numbers of the others in play.
    """

    def __init__(self, kinematics: ExactKinematics, frame: str, volume: Volume, radius: float, sign: float, play: Sequence[int]) -> None:
        self._play, self._radius, self._sign = list(play), radius, sign
        factors = kinematics.factors(frame, volume.body)
        terms = np.array([[[[float(int(x.p) / int(x.q)) for x in row] for row in T] for T in Ts] for _, Ts in factors])
        path = [self._play.index(i) for i, _ in factors if i is not None]
        self.own = sorted(path)
        self.outside = [i for i in range(len(play)) if i not in self.own]
        self._path = [self.own.index(i) for i in path]
        self._fixed = terms[0, 0]
        self._terms = terms[np.argsort(self._path)] if path else terms[:0]
        self._turns = self._terms[:, 2, 3, 3] != 0
        self._vertices = np.column_stack([volume.vertices, np.ones(len(volume.vertices))])

    @property
    def vertices(self) -> int:
        """Returns the number of the volume's vertices."""
        return len(self._vertices)

    @property
    def entries(self) -> int:
        """Returns how many control values one vertex has in one cell."""
        return (1 + len(self.outside)) * 4 ** len(self.own)

    def control(self, lower: Array, upper: Array, plane: Array, vertices: slice) -> Control:
        """Returns the control values of some vertices on B cells.

        Args:
            lower: (B, k) least values of the joints in play.
            upper: (B, k) largest values of the joints in play.
            plane: (B, 5, 1 + k) Z, and below it kappa, which bounds |a| on the cells.
        """
        l, u = lower[:, self.own], upper[:, self.own]
        w = np.stack([_weight(l, self._turns), _weight(u, self._turns)])
        mid, half = _mid_half(lower[:, self.outside], upper[:, self.outside])
        Z = self._sign * plane[:, :4]
        Z[:, 3] -= self._radius * plane[:, 4]
        slopes = Z[:, :, [1 + o for o in self.outside]]
        constant = Z[:, :, 0] + np.einsum("bro,bo->br", slopes, mid)
        own = Z[:, :, [1 + self.own[i] for i in self._path]]
        rows = np.concatenate([constant[:, None], own.swapaxes(1, 2), (slopes * half[:, None]).swapaxes(1, 2)], axis=1)
        matrices = _control_matrices(self._terms, l, u, w)
        one, s = raised(matrices, w), raised(matrices, np.stack([w[0] * l, w[1] * u]))
        h = self._vertices[vertices]
        c = self._values_of(rows, one, s, h)
        return Control(c, one[..., 3, 3], s[..., 3, 3], mid, half, *self._sizes(l, u, w, lower, upper, plane, h))

    def _values_of(self, rows: Array, one: Array, s: Array, h: Array) -> Array:
        """Returns c: the rows times the matrices of the path times the vertices.

        The first joints of the path are multiplied to the rows and the last ones to the vertices, so that the tables stay small until the
        two are multiplied.

        Args:
            rows: (B, 1 + kA + kB, 4) what is multiplied by 1, by the own s_i in the order of the path, and by the tau_o.
            one: (B, kA, 4, 4, 4) the control matrices of degree 3 of each own joint.
            s: (B, kA, 4, 4, 4) the same times s_i.
            h: (V, 4).
        """
        B, (V, k) = len(rows), (len(h), len(self._path))
        first, last = self._path[: k // 2], self._path[k // 2 :]
        left = rows[:, :, None]
        for i in first:
            left = _next_left(left, one[:, i], s[:, i])
        right = np.broadcast_to(h.T if k else self._fixed @ h.T, (B, 1, 4, V))[..., None]
        for i in reversed(last):
            right = _next_right(right, one[:, i], s[:, i])
        left = _in_order(left, 2, first)
        right = _in_order(right, 4, last).swapaxes(2, 3).swapaxes(1, 2)  # (B, V, 1 + joints of last, 4, M)
        shape = left.shape[2], right.shape[-1]
        own, outside = left[:, : 1 + len(last)], left[:, None, 1 + len(last) :]
        own = own.swapaxes(1, 2).reshape(B, 1, shape[0], -1)
        c = np.empty((B, V, 1 + outside.shape[2], *shape))
        np.matmul(own, right.reshape(B, V, -1, shape[1]), out=c[:, :, 0])
        np.matmul(outside, right[:, :, :1], out=c[:, :, 1:])
        return _in_order(c.reshape(B, V, -1, 4**k), 3, sorted(first) + sorted(last))

    def _sizes(self, l: Array, u: Array, w: Array, lower: Array, upper: Array, plane: Array, h: Array) -> tuple[Array, ...]:
        k = len(self.own)
        one = np.maximum(w.max(axis=0), LEAST)
        s = np.maximum(np.maximum(w[0] * np.abs(l), w[1] * np.abs(u)), LEAST)
        X = np.maximum(np.abs(self._fixed), LEAST)[None]
        if k:
            factors = np.maximum(_control_matrices(np.abs(self._terms), np.abs(l), np.abs(u), w).max(axis=2), LEAST)
            X = factors[:, self._path[0]]
            for i in self._path[1:]:
                X = X @ factors[:, i]
        size = np.maximum(np.maximum(np.abs(lower), np.abs(upper)), LEAST)
        Z = np.maximum(np.abs(plane[:, :4]), LEAST)
        Z[:, 3] += max(self._radius, LEAST) * np.maximum(np.abs(plane[:, 4]), LEAST)
        points = np.maximum(np.abs(h), LEAST) @ X.swapaxes(1, 2)  # (B, V, 4)
        terms = points @ Z  # (B, V, 1 + k)
        D = X[:, 3, 3]
        mid_size = 2.0 * size[:, self.outside]
        outside = terms[:, :, [1 + o for o in self.outside]] * mid_size[:, None]
        constant = terms[:, :, 0] + outside.sum(axis=-1)
        whole = one.prod(axis=1)
        ratio = s / one
        own = (terms[:, :, [1 + i for i in self.own]] * ratio[:, None]).sum(axis=-1)
        # Halving an outside joint adds up to the whole of C_o to C_0.
        c_size = whole[:, None, None] * np.concatenate([(constant + own + outside.sum(axis=-1))[..., None], outside], axis=-1)
        dt_size = (whole * D)[:, None] * np.concatenate([np.ones((len(l), 1)), ratio], axis=-1)
        return c_size, dt_size, mid_size

    def values(self, control: Control, z0: Array, sums: Sums, box: Box) -> tuple[Array, Array]:
        """Returns F, (B, V, N), and bounds of its errors, (B, V).

        Args:
            z0: (B, V) 1.0 or 0.0.
            sums: of the multipliers of each piece, (B, V).
            box: the box around the polytope.
        """
        own, outside = [self._play[i] for i in self.own], [self._play[o] for o in self.outside]
        other = [i for i in range(len(box.mid)) if i not in self._play]
        slope, slope_size = sums.slope, sums.slope_size
        constant = -sums.offset + slope[..., other] @ box.mid[other] - np.abs(slope[..., other]) @ box.half[other]
        constant = constant + (slope[..., outside] * control.mid[:, None]).sum(axis=-1)
        c = control.c if z0.all() else z0[..., None, None] * control.c
        if sums.count.any():
            weights = np.concatenate([constant[..., None], slope[..., own]], axis=-1)
            F = combined(weights, control.factors, control.others, control.den)
            F += c[:, :, 0]
            tilt = slope[..., outside] * control.half[:, None]
            for o in range(len(outside)):
                term = tilt[..., o, None] * control.den[-1][:, None]
                term += c[:, :, 1 + o]
                F -= np.abs(term, out=term)
        else:
            F = c[:, :, 0].copy()
            for o in range(len(outside)):
                F -= np.abs(c[:, :, 1 + o])
        constant_size = sums.offset_size + 2.0 * (slope_size[..., other] @ box.size[other])
        constant_size = constant_size + 2.0 * (slope_size[..., outside] * control.mid_size[:, None]).sum(axis=-1)
        size = z0 * control.c_size.sum(axis=-1) + (LEAST + constant_size) * control.dt_size[:, None, 0]
        size = size + (slope_size[..., own] * control.dt_size[:, None, 1:]).sum(axis=-1)
        return F, rounding(size, sums.count)


def _next_left(left: Array, one: Array, s: Array) -> Array:
    """Multiplies rows, (B, R, M, 4), by the next joint of the path, and returns (B, R - 1, 4 M, 4). Row 1 is of this joint's s_i."""
    B, R, M, _ = left.shape
    by_one, by_s = (x.swapaxes(1, 2).reshape(B, 4, 16) for x in (one, s))
    found = np.concatenate([left[:, :1], left[:, 2:]], axis=1) @ by_one[:, None]
    found[:, 0] += left[:, 1] @ by_s
    return found.reshape(B, R - 1, 4 * M, 4)


def _next_right(right: Array, one: Array, s: Array) -> Array:
    """Multiplies the joint of the path before them by columns, (B, T, 4, V, M), and returns (B, T + 1, 4, V, 4 M). Column 1 has its s_i."""
    B, T, _, V, M = right.shape
    columns = right.reshape(B, T, 4, V * M)
    by_one, by_s = one.reshape(B, 1, 16, 4) @ columns, s.reshape(B, 1, 16, 4) @ columns[:, :1]
    found = np.concatenate([by_one[:, :1], by_s, by_one[:, 1:]], axis=1)
    return found.reshape(B, T + 1, 4, 4, V, M).transpose(0, 1, 3, 4, 2, 5).reshape(B, T + 1, 4, V, 4 * M)


def _in_order(a: Array, axis: int, joints: Sequence[int]) -> Array:
    """Returns values whose axis stands for an axis of 4 for each of the joints, in ascending order of these."""
    if list(joints) == sorted(joints):
        return a
    k, shape = len(joints), a.shape
    split = a.reshape(*shape[:axis], *[4] * k, *shape[axis + 1 :])
    order = [*range(axis), *(axis + np.argsort(joints)), *range(axis + k, split.ndim)]
    return split.transpose(order).reshape(shape)


def _weight(s: Array, turns: np.ndarray) -> Array:
    """Returns the weight of an end of a range: with 1/sqrt(1 + s^2), t = 1/2 is the angle in the middle."""
    return np.where(turns, 1.0 / np.sqrt(1.0 + s * s), 1.0)


def _mid_half(lower: Array, upper: Array) -> tuple[Array, Array]:
    """Returns m and h of ranges, such that m +- h covers them."""
    mid = 0.5 * (lower + upper)
    return mid, np.nextafter(np.maximum(upper - mid, mid - lower), np.inf)


def _control_matrices(terms: Array, l: Array, u: Array, w: Array) -> Array:
    """Returns the control matrices, (B, k, 3, 4, 4), of factors with the terms (k, 3, 4, 4) on ranges [l, u], (B, k)."""
    T0, T1, T2 = terms[:, 0], terms[:, 1], terms[:, 2]

    def at(first: Array, second: Array, weight: Array) -> Array:
        found: Array = weight[..., None, None] * ((T0 + T1 * first[..., None, None]) + T2 * second[..., None, None])
        return found

    return np.stack([at(l, l * l, w[0] * w[0]), at(0.5 * (l + u), l * u, w[0] * w[1]), at(u, u * u, w[1] * w[1])], axis=2)

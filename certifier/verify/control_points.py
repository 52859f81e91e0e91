"""One side of a proof over a partition is brought here into control points of Bernstein polynomials, with bounds of what rounding does.

Let i be one of the k *own* joints, those between the frame F and the side's body, with [l, u] its range in a cell. With weights w0, w1 > 0

    s_i = ((1 - t) w0 l + t w1 u) / ((1 - t) w0 + t w1),   t in [0, 1],

runs over the range. A factor T0 + T1 s_i + T2 s_i^2 of the kinematics, times the square of the denominator, has the control matrices
w0^2 (T0 + T1 l + T2 l^2), w0 w1 (T0 + T1 (l + u)/2 + T2 l u) and w1^2 (T0 + T1 u + T2 u^2). Their tensor product along the path is X_FB's.
Times the linear forms (w0, w1) for 1 and (w0 l, w1 u) for s_i, everything is of degree 3 in each own joint: 4^k control points alpha, of

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

    K(l l) = K(w w) = K((l + u)/2) = 1,  K(control matrix) <= 7,  K(X) <= 7 + 11 (k - 1) <= 73 for k <= 7 (each product adds 7 + 1 + 3),
    K(vertex) <= K(X) + 4,  K(b - r kappa) <= 2,  K(Z_0 + sum Z_o m_o) <= 17,  K(a'p + b - r kappa) <= 17 + 77 + 4 = 98,
    degree 3: at most 5 for every own joint (w l, product, sum, division, sum), hence K(C), K(D), K(T) <= 98 + 35 = 133,
    64 halvings of 3 roundings each: K <= 325,
    L and S of M multipliers: M + 1; times m_o (64 halvings), and the sum over n <= 64 joints: M + 1 + 65 + 66 = M + 132,
    times D: M + 457; the sum of at most 8 + 14 + 2 terms: M + 481.

So K = M + 512 holds with room, and (1 + u)^K - 1 <= 1.01 K u. The size is not computed for every alpha: the largest of each factor's
entries gives an upper bound that holds for all of them, and for all pieces of a cell, as halving takes means. The bound 2 K u size leaves a
factor 1.9 for the roundings of the size itself.

Products may underflow: each is then wrong by 2^-1074 more. Every magnitude from which the sizes of C, D and T are made is at least 2^-40,
and no product has more than 20 factors, so its size is at least 2^-800. An underflow is therefore less than u times the size, and counts as
one of the roundings, of which every product was given one. What underflows in L and S is less than u times the 2^-40 that is added to the
size of what multiplies D. Overflow makes something that is not finite, which is refused.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from certifier.model import Array, Volume
from certifier.verify.kinematics import ExactKinematics
from certifier.verify.streams import Sums

UNIT = 2.0**-53
ROUNDINGS = 512
LEAST = 2.0**-40
"""No magnitude in a size is smaller than this."""


def rounding(size: Array, multipliers: np.ndarray) -> Array:
    """Returns a bound of what rounding does to numbers of these sizes that have so many multipliers."""
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
        dt: (B, 1 + kA, N) D and the T_i.
        mid: (B, kB) m_o.
        half: (B, kB) h_o.
        c_size: (B, V, 1 + kB) sizes of c.
        dt_size: (B, 1 + kA) sizes of dt.
        mid_size: (B, kB) sizes of m_o and h_o.
    """

    c: Array
    dt: Array
    mid: Array
    half: Array
    c_size: Array
    dt_size: Array
    mid_size: Array

    def part(self, box: int, vertices: np.ndarray) -> Control:
        """Returns some vertices on one of the pieces."""
        one = slice(box, box + 1)
        c, c_size = self.c[one, vertices], self.c_size[one, vertices]
        return Control(c, self.dt[one], self.mid[one], self.half[one], c_size, self.dt_size[one], self.mid_size[one])

    def halves(self, axis: int) -> tuple[Control, Control]:
        """Returns the lower and the upper half along an axis: first the own joints, then the outside ones."""
        own = self.dt.shape[1] - 1
        if axis < own:
            (c_low, c_high), (dt_low, dt_high) = _casteljau(self.c, axis, own), _casteljau(self.dt, axis, own)
            return self._with(c_low, dt_low, self.mid, self.half), self._with(c_high, dt_high, self.mid, self.half)
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
        return self._with(low, self.dt, mid_low, half), self._with(high, self.dt, mid_high, half)

    def _with(self, c: Array, dt: Array, mid: Array, half: Array) -> Control:
        return Control(c, dt, mid, half, self.c_size, self.dt_size, self.mid_size)


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
        return (1 + len(self._play)) * 4 ** len(self.own)

    def control(self, lower: Array, upper: Array, plane: Array, vertices: slice) -> Control:
        """Returns the control values of some vertices on B cells.

        Args:
            lower: (B, k) least values of the joints in play.
            upper: (B, k) largest values of the joints in play.
            plane: (B, 5, 1 + k) Z, and below it kappa, which bounds |a| on the cells.
        """
        B, k = len(lower), len(self.own)
        l, u = lower[:, self.own], upper[:, self.own]
        w = np.stack([_weight(l, self._turns), _weight(u, self._turns)])
        mid, half = _mid_half(lower[:, self.outside], upper[:, self.outside])
        Z = self._sign * plane[:, :4]
        Z[:, 3] -= self._radius * plane[:, 4]
        slopes = Z[:, :, [1 + o for o in self.outside]]
        constant = Z[:, :, 0] + np.einsum("bro,bo->br", slopes, mid)
        own = Z[:, :, [1 + i for i in self.own]]
        rows = np.concatenate([constant[:, None], own.swapaxes(1, 2), (slopes * half[:, None]).swapaxes(1, 2)], axis=1)
        X = self._pose(_control_matrices(self._terms, l, u, w))
        h = self._vertices[vertices]
        q = np.moveaxis((rows[:, None] @ X) @ h.T, 1, 3).swapaxes(1, 2)  # (B, V, 1 + k, 3^k)
        D = X[..., 3, 3]
        one, s = w, np.stack([w[0] * l, w[1] * u])
        c = _elevated(q.reshape(*q.shape[:3], *[3] * k), one, s, k)
        dt = D.reshape(B, 1, 1, *[3] * k)
        for i in range(k):
            dt = np.concatenate([_times(dt, 3 + i, one[:, :, i]), _times(dt[:, :, :1], 3 + i, s[:, :, i])], axis=2)
        dt = dt.reshape(B, 1 + k, -1)
        return Control(c, dt, mid, half, *self._sizes(l, u, w, lower, upper, plane, h))

    def _pose(self, matrices: Array) -> Array:
        """Returns the control matrices of X_FB, (B, 3^k, 4, 4), whose axes are the own joints in ascending order."""
        B, k = len(matrices), len(self._path)
        X = np.broadcast_to(self._fixed, (B, 1, 4, 4))
        for number, i in enumerate(self._path):
            X = matrices[:, i] if number == 0 else (X[:, :, None] @ matrices[:, None, i]).reshape(B, -1, 4, 4)
        X = X.reshape(B, *[3] * k, 4, 4).transpose(0, *(1 + np.argsort(self._path)), 1 + k, 2 + k) if k else X
        return X.reshape(B, 3**k, 4, 4)

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
        F = np.concatenate([constant[..., None], slope[..., own]], axis=-1) @ control.dt
        F += z0[..., None] * control.c[:, :, 0]
        tilt = slope[..., outside] * control.half[:, None]
        for o in range(len(outside)):
            F -= np.abs(z0[..., None] * control.c[:, :, 1 + o] + tilt[..., o, None] * control.dt[:, None, 0])
        constant_size = sums.offset_size + 2.0 * (slope_size[..., other] @ box.size[other])
        constant_size = constant_size + 2.0 * (slope_size[..., outside] * control.mid_size[:, None]).sum(axis=-1)
        size = z0 * control.c_size.sum(axis=-1) + (LEAST + constant_size) * control.dt_size[:, None, 0]
        size = size + (slope_size[..., own] * control.dt_size[:, None, 1:]).sum(axis=-1)
        return F, rounding(size, sums.count)


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


def _elevated(q: Array, one: Array, s: Array, k: int) -> Array:
    """Returns, (B, V, R, 4^k), q_0 + sum_i q_i s_i in the first row and the further rows after it, all times the linear forms.

    Args:
        q: (B, V, 1 + k + ..., 3, ..., 3) control values of degree 2: q_0, the q_i, and the further rows.
        one: (2, B, k) the linear forms of 1.
        s: (2, B, k) the linear forms of s_i.
    """
    for i in range(k):
        axis = 3 + i
        first = _times(q[:, :, :1], axis, one[:, :, i]) + _times(q[:, :, 1:2], axis, s[:, :, i])
        q = np.concatenate([first, _times(q[:, :, 2:], axis, one[:, :, i])], axis=2)
    return q.reshape(*q.shape[:3], -1)


def _times(a: Array, axis: int, b: Array) -> Array:
    """Returns the product, of degree 3 along an axis, of values of degree 2 and the linear form b, (2, B)."""
    a0, a1, a2 = np.moveaxis(a, axis, 0)
    b0, b1 = b.reshape(2, -1, *[1] * (a.ndim - 2))
    return np.stack([a0 * b0, (2.0 * a1 * b0 + a0 * b1) / 3.0, (a2 * b0 + 2.0 * a1 * b1) / 3.0, a2 * b1], axis=axis)


def _casteljau(a: Array, axis: int, k: int) -> tuple[Array, Array]:
    """Returns the control values, (..., 4^k), of the lower and the upper half along an axis of those of degree 3."""
    c0, c1, c2, c3 = np.moveaxis(a.reshape(*a.shape[:-1], *[4] * k), a.ndim - 1 + axis, 0)
    d0, d1, d2 = 0.5 * (c0 + c1), 0.5 * (c1 + c2), 0.5 * (c2 + c3)
    e0, e1 = 0.5 * (d0 + d1), 0.5 * (d1 + d2)
    f = 0.5 * (e0 + e1)
    low, high = (np.stack(values, axis=a.ndim - 1 + axis).reshape(a.shape) for values in ([c0, d0, e0, f], [f, e1, d2, c3]))
    return low, high

"""Rational forward kinematics as exact polynomials in u, s = mid + half u (C-IRIS eq. 4-6), from a scene's stored numbers.

With tau = tan(q*/2), the half-angle tangents add up to (tau + s)/(1 - tau s): R(q) has the half-angle cosine 1 - tau s and sine
tau + s, up to the common factor (1 + tau^2)(1 + s^2), which is the joint's denominator here. tau is rounded to a dyadic within
2^-100, so every rotation is exact, about an angle that is off by no more than that.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np
from flint import arb, ctx, fmpq, fmpq_mpoly, fmpq_mpoly_ctx

from certifier.model import WORLD, Array, Joint, JointKind, Scene

Matrix = list[list[fmpq_mpoly]]
Numbers = list[list[fmpq]]
_TAU_BITS = 110


def exact(x: float) -> fmpq:
    """A double as the rational number it is."""
    return fmpq(*float(x).as_integer_ratio())


def half_tangent(angle: float) -> fmpq:
    """A dyadic tau with |2 atan(tau) - angle| < 2^-100."""
    precision = ctx.prec
    ctx.prec = 256
    try:
        return fmpq(((arb(angle) / 2).tan() * arb(2) ** _TAU_BITS).floor().unique_fmpz()) / fmpq(2) ** _TAU_BITS
    finally:
        ctx.prec = precision


class ExactKinematics:
    """Numerators of positions as polynomials of the ring Q[u_0 .. u_{n-1}], or as numbers at one configuration."""

    def __init__(self, scene: Scene, s: list[Any], embed: Any) -> None:
        self._embed, self._s = embed, s
        self._q_star = scene.q_star
        self._above = {joint.child: joint for joint in scene.joints}

    @classmethod
    def on_box(cls, scene: Scene, ring: fmpq_mpoly_ctx, mid: Array, half: Array) -> ExactKinematics:
        """Polynomials in u, s = mid + half u."""
        s = [ring.constant(exact(m)) + exact(h) * u for m, h, u in zip(mid, half, ring.gens(), strict=True)]
        return cls(scene, s, ring.constant)

    @classmethod
    def at(cls, scene: Scene, s: list[fmpq]) -> ExactKinematics:
        """Numbers at the configuration s."""
        return cls(scene, s, fmpq)

    def path(self, frame: str, body: str) -> list[tuple[Joint, bool]]:
        """Joints from the frame's body to the body, each with whether it is crossed upwards."""
        up, down = self._to_world(frame), self._to_world(body)
        while up and down and up[-1] is down[-1]:
            up.pop()
            down.pop()
        return [(joint, True) for joint in up] + [(joint, False) for joint in reversed(down)]

    def _to_world(self, body: str) -> list[Joint]:
        joints: list[Joint] = []
        while body != WORLD:
            joints.append(self._above[body])
            body = joints[-1].parent
        return joints

    def pose(self, frame: str, body: str) -> Matrix:
        """(4, 4) polynomials or numbers: X_FB times its denominator, the entry [3][3] = prod (1 + tau_i^2)(1 + s_i^2)."""
        # Constant factors are multiplied as numbers.
        fixed, X = _identity(), None
        for joint, upwards in self.path(frame, body):
            outer, middle, inner = self._joint(joint, upwards)
            fixed = _multiply(fixed, outer)
            if middle is not None:
                moved = _multiply(fixed, middle)
                X, fixed = moved if X is None else _multiply(X, moved), _identity()
            fixed = _multiply(fixed, inner)
        return self._embedded(fixed) if X is None else _multiply(X, fixed)

    def fixed_pose(self, frame: str, body: str) -> list[list[fmpq]] | None:
        """(4, 4) X_FB of two bodies that are welded together, perhaps through others; None if a joint between them moves."""
        if any(joint.index is not None for joint, _ in self.path(frame, body)):
            return None
        return [[entry.coefficient(0) if entry != 0 else fmpq(0) for entry in row] for row in self.pose(frame, body)]

    def scale(self, frame: str, body: str) -> fmpq:
        """prod (1 + tau_i^2) over the revolute joints of the path: the least value of the denominator."""
        revolute = [joint for joint, _ in self.path(frame, body) if joint.kind is JointKind.REVOLUTE]
        taus = [half_tangent(float(self._q_star[joint.index])) for joint in revolute if joint.index is not None]
        product = fmpq(1)
        for tau in taus:
            product *= 1 + tau * tau
        return product

    def _embedded(self, rows: list[list[fmpq]]) -> Matrix:
        return [[self._embed(x) for x in row] for row in rows]

    def _joint(self, joint: Joint, upwards: bool) -> tuple[Numbers, Matrix | None, Numbers]:
        """The joint's fixed frame, its motion, and the other one."""
        first, last = (joint.X_BM, joint.X_PF) if upwards else (joint.X_PF, joint.X_BM)
        outer, inner = _rational(_doubles(first)), _inverse(_doubles(last))
        if joint.index is None:
            return outer, None, inner
        axis = [exact(-x if upwards else x) for x in joint.axis]
        s, q = self._s[joint.index], float(self._q_star[joint.index])
        if joint.kind is JointKind.PRISMATIC:
            middle = self._embedded(_identity())
            for i in range(3):
                middle[i][3] = axis[i] * (s + exact(q))
        else:
            tau = half_tangent(q)
            middle = self._rotation(axis, 1 - tau * s, tau + s)
        return outer, middle, inner

    def _rotation(self, axis: list[fmpq], cosine: fmpq_mpoly, sine: fmpq_mpoly) -> Matrix:
        """(c^2 + s^2) R about the axis for half-angle cosine and sine: (c^2 + s^2) I + 2 c s [u] + 2 s^2 [u]^2."""
        x, y, z = axis
        zero = fmpq(0)
        skew = [[zero, -z, y], [z, zero, -x], [-y, x, zero]]
        square = [[sum((skew[i][k] * skew[k][j] for k in range(3)), zero) for j in range(3)] for i in range(3)]
        norm, first, second = cosine * cosine + sine * sine, 2 * cosine * sine, 2 * sine * sine
        none = self._embed(zero)
        rows = [[(norm if i == j else none) + skew[i][j] * first + square[i][j] * second for j in range(3)] + [none] for i in range(3)]
        return [*rows, [none, none, none, norm]]


def _identity() -> Numbers:
    return [[fmpq(int(i == j)) for j in range(4)] for i in range(4)]


def _doubles(X: Array) -> bytes:
    return np.asarray(X, dtype=float).tobytes()


@lru_cache(maxsize=1024)
def _rational(X: bytes) -> Numbers:
    """The 16 doubles of a rigid transform, not to be changed."""
    return [[exact(x) for x in row] for row in np.frombuffer(X).reshape(4, 4)]


@lru_cache(maxsize=1024)
def _inverse(rigid: bytes) -> Numbers:
    """Of a rigid transform: the rotation is transposed."""
    X = _rational(rigid)
    R = [[X[j][i] for j in range(3)] for i in range(3)]
    p = [-sum((R[i][j] * X[j][3] for j in range(3)), fmpq(0)) for i in range(3)]
    return [[*R[i], p[i]] for i in range(3)] + [[fmpq(0), fmpq(0), fmpq(0), fmpq(1)]]


def _multiply(A: Any, B: Any) -> Any:
    """Of numbers, polynomials, or either and the other."""
    product, zero = [], 0 * A[0][0] * B[0][0]
    for row in A:
        terms = [(k, x) for k, x in enumerate(row) if x != 0]
        product.append([sum((x * B[k][j] for k, x in terms if B[k][j] != 0), start=zero) for j in range(4)])
    return product

"""Forward kinematics, which are rational, are formed here as exact polynomials in u, from the numbers that a scene stores.

The box gives s = mid + half u (C-IRIS eq. 4-6). With tau = tan(q*/2), the half-angle tangents add up to (tau + s)/(1 - tau s). So R(q)
has the half-angle cosine 1 - tau s and the half-angle sine tau + s, up to the common factor (1 + tau^2)(1 + s^2). This factor is the
joint's denominator here. tau is rounded to a dyadic number within 2^-100, so every rotation is exact, about an angle that is off by no
more than that.

The doubles of a rotation are hardly ever orthonormal, nor are those of an axis a unit vector. Taken literally, they would stretch bodies,
and the pose of B in A would not be the inverse of the pose of A in B.

So a matrix stands for the rotation of the quaternion that it gives (Shepperd, *Quaternion from rotation matrix*, 1978). An axis stands
for the unit vector of its stereographic projection. Quaternion and projection are rounded at 2^-ROUNDING_BITS. All poses are therefore
rational and exactly rigid. The axis of a slide that follows another joint is as long as it slides fast. It is no unit vector, and its
doubles are taken as they are.

A matrix that is an exact rotation already stands for itself, but for the rounding, and so does an exact unit vector. Any other differs
from what it stands for by at most ten times what its doubles miss being a rotation, or a unit vector, by. The quaternion's square norm is
a constant factor of the denominator.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np
from flint import arb, ctx, fmpq, fmpq_mpoly, fmpq_mpoly_ctx, fmpq_poly

from certifier.errors import ProofError
from certifier.model import WORLD, Array, Joint, JointKind, Scene

Matrix = list[list[fmpq_mpoly]]
Numbers = list[list[fmpq]]
_TAU_BITS = 110
ROUNDING_BITS = 60
"""Of a quaternion with an entry of 1 or more, and of an axis' projection, this many binary places are kept: finer than doubles near 1."""


def exact(x: float) -> fmpq:
    """Returns a double as the rational number that it is."""
    return fmpq(*float(x).as_integer_ratio())


def half_tangent(angle: float) -> fmpq:
    """Returns a dyadic tau with |2 atan(tau) - angle| < 2^-100."""
    with ctx.workprec(256):
        return fmpq(((arb(angle) / 2).tan() * arb(2) ** _TAU_BITS).floor().unique_fmpz()) / fmpq(2) ** _TAU_BITS


class ExactKinematics:
    """Computes numerators of positions, as polynomials of the ring Q[u_0 .. u_{n-1}] or as numbers at one configuration."""

    def __init__(self, scene: Scene, s: list[Any], embed: Any) -> None:
        self._embed, self._s = embed, s
        self._q_star = scene.q_star
        self._above = scene.joint_above

    @classmethod
    def on_box(cls, scene: Scene, ring: fmpq_mpoly_ctx, mid: Array, half: Array) -> ExactKinematics:
        """Returns the kinematics in polynomials of u, where s = mid + half u."""
        s = [ring.constant(exact(m)) + exact(h) * u for m, h, u in zip(mid, half, ring.gens(), strict=True)]
        return cls(scene, s, ring.constant)

    @classmethod
    def at(cls, scene: Scene, s: list[fmpq]) -> ExactKinematics:
        """Returns the kinematics in numbers at the configuration s."""
        return cls(scene, s, fmpq)

    @classmethod
    def by_joint(cls, scene: Scene) -> ExactKinematics:
        """Returns the kinematics for :meth:`factors`, in which every coordinate goes by the same letter."""
        return cls(scene, [fmpq_poly([0, 1])] * scene.n, lambda x: fmpq_poly([x]))

    def path(self, frame: str, body: str) -> list[tuple[Joint, bool]]:
        """Returns the joints from the frame's body to the body, each with whether it is crossed upwards, from child to parent.

        Raises:
            ProofError: two of the joints have the same position, and are not slides without another joint that moves between them. What is
                computed here would hold, but not what is made of it: that a polynomial has at most the degree 2 in a position. Such slides
                together are affine in it.
        """
        up, down = self._to_world(frame), self._to_world(body)
        while up and down and up[-1] is down[-1]:
            up.pop()
            down.pop()
        moving = [joint for joint in (*up, *reversed(down)) if joint.index is not None]
        parts = sum(not _slide_together(before, joint) for before, joint in zip([None, *moving], moving, strict=False))
        if len({joint.index for joint in moving}) < parts:
            raise ProofError("proof_model", f"two joints between {frame} and {body} move together, which no proof of a pair may use")
        return [(joint, True) for joint in up] + [(joint, False) for joint in reversed(down)]

    def positions(self, frame: str, body: str) -> list[int]:
        """Returns the position indices of the joints between two bodies, ascending, each of them once."""
        return sorted({joint.index for joint, _ in self.path(frame, body) if joint.index is not None})

    def _to_world(self, body: str) -> list[Joint]:
        joints: list[Joint] = []
        while body != WORLD:
            joints.append(self._above[body])
            body = joints[-1].parent
        return joints

    def pose(self, frame: str, body: str) -> Matrix:
        """Returns X_FB times its denominator, (4, 4), in polynomials or numbers.

        The denominator is the entry [3][3], a multiple of prod (1 + s_i^2).
        """
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

    def factors(self, frame: str, body: str) -> list[tuple[int | None, list[Numbers]]]:
        """Returns X_FB times its denominator as a product, in path order, with one factor T0 + T1 s_i + T2 s_i^2 for each position.

        A factor is the joint's position index i and its terms, each (4, 4). Welds are part of the factors, whose denominators, the
        entries [3][3], are 1 + s_i^2 or 1. Where no joint moves there is one constant factor, whose index is None.
        """
        found: list[tuple[int | None, Any]] = []
        fixed = _identity()
        for joint, upwards in self.path(frame, body):
            outer, middle, inner = self._joint(joint, upwards)
            fixed = _multiply(fixed, outer)
            if middle is not None:
                moved = _multiply(fixed, middle)
                if found and found[-1][0] == joint.index:
                    moved = _multiply(found.pop()[1], moved)
                found.append((joint.index, moved))
                fixed = _identity()
            fixed = _multiply(fixed, inner)
        if found:
            index, last = found.pop()
            found.append((index, _multiply(last, fixed)))
        else:
            found.append((None, self._embedded(fixed)))
        return [(index, [[[x[power] / X[3][3][0] for x in row] for row in X] for power in range(3)]) for index, X in found]

    def fixed_pose(self, frame: str, body: str) -> list[list[fmpq]] | None:
        """Returns X_FB, (4, 4), of two bodies that are welded together, perhaps through others; None if a joint between them moves."""
        if any(joint.index is not None for joint, _ in self.path(frame, body)):
            return None
        X = [
            [entry if isinstance(entry, fmpq) else entry.coefficient(0) if entry != 0 else fmpq(0) for entry in row]
            for row in self.pose(frame, body)
        ]
        return [[x / X[3][3] for x in row] for row in X]

    def linkage(self, frame: str, body: str) -> tuple[list[tuple[fmpq, ...]], list[Numbers]]:
        """Returns the axes of the joints that move between two bodies, in path order, and the constant poses between their frames.

        A joint's axis goes through the origin of its frame, and its motion moves no point of its axis. So a joint's frames on either side
        of the motion are treated as the same frame.

        Returns:
            the m axes as :func:`axis_of` has them, and m + 1 poses, (4, 4): of the first joint's frame in F, of each further joint's frame
            in that of the joint before it, and of B in the last joint's.
        """
        axes, poses, fixed = [], [], _identity()
        for joint, upwards in self.path(frame, body):
            outer, inner = self._fixed_frames(joint, upwards)
            fixed = _multiply(fixed, outer)
            if joint.index is not None:
                axes.append(tuple(axis_of(joint)))
                poses.append(fixed)
                fixed = _identity()
            fixed = _multiply(fixed, inner)
        return axes, [[[x / X[3][3] for x in row] for row in X] for X in (*poses, fixed)]

    def scale(self, frame: str, body: str) -> fmpq:
        """Returns the least value of the denominator, which is its value at s = 0."""
        product = fmpq(1)
        for joint, _ in self.path(frame, body):
            product *= rigid(_doubles(joint.X_PF))[3][3] * rigid(_doubles(joint.X_BM))[3][3]
            if joint.index is not None and joint.kind is JointKind.REVOLUTE:
                product *= 1 + half_tangent(float(self._q_star[joint.index])) ** 2
        return product

    def _embedded(self, rows: list[list[fmpq]]) -> Matrix:
        return [[self._embed(x) for x in row] for row in rows]

    def _joint(self, joint: Joint, upwards: bool) -> tuple[Numbers, Matrix | None, Numbers]:
        """Returns the joint's first fixed frame, its motion (None for a weld), and its last fixed frame, in the order of the path."""
        outer, inner = self._fixed_frames(joint, upwards)
        if joint.index is None:
            return outer, None, inner
        axis = [-x if upwards else x for x in axis_of(joint)]
        s, q = self._s[joint.index], float(self._q_star[joint.index])
        if joint.kind is JointKind.PRISMATIC:
            middle = self._embedded(_identity())
            for i in range(3):
                middle[i][3] = axis[i] * (s + exact(q))
        else:
            tau = half_tangent(q)
            middle = self._rotation(axis, 1 - tau * s, tau + s)
        return outer, middle, inner

    @staticmethod
    def _fixed_frames(joint: Joint, upwards: bool) -> tuple[Numbers, Numbers]:
        """Returns the poses before and behind the joint's motion on the path, each times its entry [3][3]."""
        first, last = (joint.X_BM, joint.X_PF) if upwards else (joint.X_PF, joint.X_BM)
        return rigid(_doubles(first)), _inverse(_doubles(last))

    def _rotation(self, axis: list[fmpq], cosine: fmpq_mpoly, sine: fmpq_mpoly) -> Matrix:
        """Returns (c^2 + s^2) R = (c^2 + s^2) I + 2 c s [u] + 2 s^2 [u]^2 for the half-angle cosine c and sine s.

        [u] is the cross-product matrix of the axis.
        """
        x, y, z = axis
        zero = fmpq(0)
        skew = [[zero, -z, y], [z, zero, -x], [-y, x, zero]]
        square = [[sum((skew[i][k] * skew[k][j] for k in range(3)), zero) for j in range(3)] for i in range(3)]
        norm, first, second = cosine * cosine + sine * sine, 2 * cosine * sine, 2 * sine * sine
        none = self._embed(zero)
        rows = [[(norm if i == j else none) + skew[i][j] * first + square[i][j] * second for j in range(3)] + [none] for i in range(3)]
        return [*rows, [none, none, none, norm]]


def _slide_together(first: Joint | None, second: Joint) -> bool:
    return first is not None and first.index == second.index and first.kind is second.kind is JointKind.PRISMATIC


def _identity() -> Numbers:
    return [[fmpq(int(i == j)) for j in range(4)] for i in range(4)]


def _doubles(X: Array) -> bytes:
    return np.asarray(X, dtype=float).tobytes()


@lru_cache(maxsize=1024)
def rigid(doubles: bytes) -> Numbers:
    """Returns the rigid transform that 16 doubles stand for, (4, 4), times its entry [3][3] > 0. The caller must not change it."""
    X = [[exact(x) for x in row] for row in np.frombuffer(doubles).reshape(4, 4)]
    (a, b, c, x), (d, e, f, y), (g, h, i, z), _ = X
    # Row j is 4 q_j q, for each entry q_j of the unit quaternion q. The largest |q_j| is at least a half.
    multiples = [
        [1 + a + e + i, h - f, c - g, d - b],
        [h - f, 1 + a - e - i, b + d, c + g],
        [c - g, b + d, 1 - a + e - i, f + h],
        [d - b, c + g, f + h, 1 - a - e + i],
    ]
    w, p, q, r = (_rounded(value) for value in max(enumerate(multiples), key=lambda row: row[1][row[0]])[1])
    norm = w * w + p * p + q * q + r * r
    return [
        [w * w + p * p - q * q - r * r, 2 * (p * q - w * r), 2 * (p * r + w * q), norm * x],
        [2 * (p * q + w * r), w * w - p * p + q * q - r * r, 2 * (q * r - w * p), norm * y],
        [2 * (p * r - w * q), 2 * (q * r + w * p), w * w - p * p - q * q + r * r, norm * z],
        [fmpq(0), fmpq(0), fmpq(0), norm],
    ]


@lru_cache(maxsize=1024)
def _inverse(doubles: bytes) -> Numbers:
    """Returns the inverse of the rigid transform that 16 doubles stand for, times the same entry [3][3]."""
    X, p = rigid(doubles), [exact(x) for x in np.frombuffer(doubles).reshape(4, 4)[:3, 3]]
    R = [[X[j][i] for j in range(3)] for i in range(3)]
    return [[*row, -sum((x * y for x, y in zip(row, p, strict=True)), fmpq(0))] for row in R] + [X[3]]


@lru_cache(maxsize=1024)
def unit(doubles: bytes) -> list[fmpq]:
    """Returns the unit vector that the three doubles of an axis stand for. The caller must not change it."""
    axis = [exact(x) for x in np.frombuffer(doubles)]
    pole = max(range(3), key=lambda i: abs(axis[i]))
    plane = [fmpq(0) if i == pole else _rounded(x / (1 + abs(axis[pole]))) for i, x in enumerate(axis)]
    square = sum((x * x for x in plane), fmpq(0))
    turned = (1 - square) / (1 + square)
    return [(turned if axis[pole] > 0 else -turned) if i == pole else 2 * x / (1 + square) for i, x in enumerate(plane)]


def axis_of(joint: Joint) -> list[fmpq]:
    """Returns the vector that a joint's axis stands for, along which it slides by its position, or about which it turns."""
    if has_speed(joint):
        return [exact(x) for x in joint.axis]
    return unit(_doubles(joint.axis))


def has_speed(joint: Joint) -> bool:
    """Returns whether a joint slides and follows another one: then the length of its axis is its speed. Other axes are unit vectors."""
    return joint.follows and joint.kind is JointKind.PRISMATIC


def _rounded(x: fmpq) -> fmpq:
    """Returns x rounded down to a multiple of 2^-ROUNDING_BITS."""
    return fmpq((x * 2**ROUNDING_BITS).floor()) / 2**ROUNDING_BITS


def _multiply(A: Any, B: Any) -> Any:
    """Returns the product of two matrices, each of which holds numbers or polynomials."""
    product, zero = [], 0 * A[0][0] * B[0][0]
    for row in A:
        terms = [(k, x) for k, x in enumerate(row) if x != 0]
        product.append([sum((x * B[k][j] for k, x in terms if B[k][j] != 0), start=zero) for j in range(4)])
    return product

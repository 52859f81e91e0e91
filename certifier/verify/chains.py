"""Chains of joints are evaluated here at many configurations, in doubles, with a bound of the error. docs/algorithm.md, 11, has the bounds.

The fixed poses between the joints are the exact ones of certifier.verify.kinematics, rounded to doubles once.

Let u = 2^-53, let Y be a computed number and y what it stands for, and let lengths and the norm that belongs to them measure errors. The
size of a vertex is the sum of all lengths on the way to it: |v|, that of each of the m + 1 offsets, and that of each slide.

- An offset or an axis, rounded to doubles, is wrong by at most u of its length, and a rotation by at most 2 u; both by 2^-200 more.
- The cosine and the sine of a joint are wrong by at most 2^-47, besides the angle's error: each is one of certifier.verify.angles, wrong by
  2^-49, or made of two such and of two quotients wrong by less than 5 u. So Rodrigues' formula is wrong by at most 2^-45 and the angle's
  error, its 30 roundings of numbers that are at most 1 included.
- A product of two rotations is rounded by at most 9 u. There are two for each joint.
- So the rotation before an offset, and the one before v, is wrong by at most m + 1 times 2^-44.5 and the angles' error, to first order. It
  multiplies a length, exactly one of those in the size. Both parts of the product, the rotation's error and what an entry's three products
  round, 6 u, are parts of this length, whatever it is added to.
- A position is a sum of 2 m + 1 vectors, each sum of which is at most the size. So they are rounded by (2 m + 1) u of it.
- n'(R v + p) is computed as (R'n)'v + n'p with three products each, rounded by 15 u of |n| times the size.

All that is a part of the size, (m + 3) (2^-44 + the angles' error) of it to first order, times |n|. Terms of higher order are a part of
that which is below 2^-9, because error() sees to it that the whole is below 2^-10; twice the angles' error has room for it. That no two
lengths are put together first is what makes this hold where they cancel. What is done with less of them, as n'R'v with the length of R v +
offset, is wrong by a part of their sum nevertheless.

What a slide is wrong by is added as it is: it moves what is behind it by that. Products that underflow are wrong by 2^-1074, times 1e8 m at
most, and there are fewer than 2^14 of them. The least size is 1e-150 m, of which the part is more than that.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from flint import fmpq

from certifier.errors import ProofError
from certifier.model import Array, JointKind, Scene
from certifier.verify.kinematics import ExactKinematics

UP = 1 + 2.0**-40
"""What fewer than 2^12 sums, products and quotients of numbers that are not negative give, times this, is not below what it stands for."""


@dataclass(frozen=True)
class Chain:
    """A chain leads from a frame to a body, over m joints that move, in path order.

    Attributes:
        joints: (m,) position indices.
        slides: (m,) whether each joint is prismatic.
        axes: (m, 3) unit vectors, reversed for a joint that is crossed from child to parent, each number rounded to a double.
        rotations: (m + 1, 3, 3) of the fixed poses before, between and behind the joints, each number rounded to a double.
        offsets: (m + 1, 3) of the fixed poses, metres, each number rounded to a double.
    """

    joints: np.ndarray
    slides: np.ndarray
    axes: Array
    rotations: Array
    offsets: Array

    @classmethod
    def between(cls, scene: Scene, kinematics: ExactKinematics, frame: str, body: str) -> Chain:
        """Returns the chain from a body's frame to a body."""
        moving = [(joint, upwards) for joint, upwards in kinematics.path(frame, body) if joint.index is not None]
        axes, poses = kinematics.linkage(frame, body)
        X = np.array([[[_rounded(x) for x in row] for row in pose] for pose in poses])
        signs = np.array([-1.0 if upwards else 1.0 for _, upwards in moving])
        return cls(
            np.array([joint.index for joint, _ in moving], dtype=np.int64),
            np.array([joint.kind is JointKind.PRISMATIC for joint, _ in moving], dtype=bool),
            np.array([[_rounded(x) for x in axis] for axis in axes]).reshape(-1, 3) * signs[:, None],
            X[:, :3, :3],
            X[:, :3, 3],
        )

    def levers(self, vertices: Array, slid: Array) -> Array:
        """Returns how far vertices can be from the joints' axes, in metres, rounded upwards.

        These bound motion. They may be much less than :meth:`sizes`, because a body's frame may be far from the body.

        Args:
            vertices: (V, 3) metres in the body's frame.
            slid: (K, m) how far each joint's position is from 0 at most, metres; only that of a prismatic joint matters.

        Returns:
            (K, m) distances from the axes, 1 for a prismatic joint. A change of one position moves no vertex farther than by the joint's
            lever times the change.
        """
        m = len(self.joints)
        levers = np.ones((len(slid), m))
        if not m:
            return levers
        tails = vertices @ self.rotations[m].T + self.offsets[m]
        # What is rounded in the tails, and in the numbers that they are made of: fewer than 2^4 roundings of 2^-53 in each product.
        rounded = 2.0**-45 * (_longest(vertices) + _longest(self.offsets[m:]))
        behind = np.full(len(slid), _longest(tails) + rounded)
        across: Array | float = _across(self.axes[m - 1], tails) + rounded
        for k in range(m - 1, -1, -1):
            if self.slides[k]:
                behind = behind + slid[:, k]
            else:
                levers[:, k] = across * UP
            if k:
                across = _across(self.axes[k - 1], self.offsets[k : k + 1]) + behind
                behind = behind + _longest(self.offsets[k : k + 1])
        return levers

    def sizes(self, vertices: Array, slid: Array) -> Array:
        """Returns the sum of all lengths on the way to the farthest vertex, (K,) metres, rounded upwards: what rounding is a part of.

        No two of the lengths are put together first, as what cancels in their sum does not cancel in what is rounded. The arguments are
        those of :meth:`levers`.
        """
        lengths = _longest(vertices) + sum(_longest(offset[None]) for offset in self.offsets)
        found: Array = (lengths + (slid * self.slides).sum(axis=1)) * UP
        return found

    def error(self, size: Array, inexact: float) -> Array:
        """Returns by how many metres a vertex' position, of sizes as :meth:`sizes` returns them, is wrong at most.

        Args:
            inexact: by how much the joints' positions are wrong at most, in radians or metres.

        Raises:
            ProofError: it is too large for the bound to hold.
        """
        part = (len(self.joints) + 3) * (2.0**-44 + 2 * inexact)
        if not part < 2.0**-10:
            raise ProofError("proof_too_large", "the positions of the motion are too large for doubles to tell where the bodies are")
        return size * part + int(self.slides.sum()) * inexact

    def poses(self, q: Array, cosines: Array, sines: Array) -> tuple[Array, Array]:
        """Returns the rotations and the positions of the body in the frame at N configurations, (N, 3, 3) and (N, 3).

        Args:
            q: (N, n) positions, of which those of prismatic joints matter.
            cosines, sines: (N, n) of the positions of revolute joints.
        """
        R = np.broadcast_to(self.rotations[0], (len(q), 3, 3))
        p = np.broadcast_to(self.offsets[0], (len(q), 3))
        for k, j in enumerate(self.joints):
            if self.slides[k]:
                p = p + (R @ self.axes[k]) * q[:, j, None]
            else:
                R = R @ _rotations(self.axes[k], cosines[:, j], sines[:, j])
            p = p + R @ self.offsets[k + 1]
            R = R @ self.rotations[k + 1]
        return R, p


def _rounded(x: fmpq) -> float:
    return float(int(x.p) / int(x.q))


def _longest(points: Array) -> float:
    """Returns the largest length of points, (V, 3), rounded upwards; what underflows is less than what is added."""
    return float(np.sqrt((points**2).sum(axis=1)).max()) * UP + 1e-150


def _across(axis: Array, points: Array) -> float:
    """Returns the largest distance of points, (V, 3), from the line along an axis through 0, rounded upwards."""
    return _longest(points @ _skew(axis).T) + 2.0**-45 * _longest(points)


def _rotations(axis: Array, cosines: Array, sines: Array) -> Array:
    """Returns the rotations about an axis, (N, 3, 3), by Rodrigues' formula."""
    K = _skew(axis)
    return np.eye(3) + sines[:, None, None] * K + (1.0 - cosines)[:, None, None] * (K @ K)


def _skew(axis: Array) -> Array:
    """Returns the matrix K, (3, 3), with K p the vector product of the axis and p."""
    x, y, z = axis
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])

"""Chains of joints are evaluated here at many configurations, in doubles, with a bound of the error. docs/algorithm.md, 11, has the bounds.

Let u = 2^-53, let Y be a computed number and y what it stands for, and let lengths and the norm that belongs to them measure errors. The
size of a vertex is the sum of all lengths on the way to it: |v|, that of each of the m + 1 offsets, and that of each slide, its position
times the length of its axis, which is 2^10 at most.

- An offset or an axis, rounded to doubles, is wrong by at most 2 u of its length, and a rotation by at most 4 u; all by 2^-199 more, as
  certifier.verify.places has it.
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
that which is below 2^-9, because certifier.verify.sides ensures that the whole is below 2^-10; twice the angles' error has room for it.
That no two lengths are put together first is what makes this hold where they cancel. What is done with less of them, as n'R'v with the
length of R v + offset, is wrong by a part of their sum nevertheless.

What the position of a slide is wrong by is added, times the length of its axis: it moves what is behind it by that. The 2^-199 of offsets
and rotations, and the 2^-1074 by which products that underflow are wrong, are multiplied by 2^30 m at most and by fewer than 2^14 numbers.
The least size is 2^-100 m, a part of which is more than that.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from certifier.model import Array

UP = 1 + 2.0**-40
"""What fewer than 2^12 sums, products and quotients of numbers that are not negative give, times this, is not below what it stands for."""


class Reach(NamedTuple):
    """Says how far a geometry reaches in the frame that the last joint of a chain moves, in metres, rounded upwards.

    Attributes:
        tail: from the frame's origin.
        across: from the last joint's axis; 0 without a joint.
        vertices: from the origin of the body's own frame.
    """

    tail: float
    across: float
    vertices: float


@dataclass(frozen=True)
class Chain:
    """A chain leads from a frame to a body, over m joints that move, in path order.

    Attributes:
        joints: (m,) position indices.
        speeds: (m,) by how many metres each prismatic joint slides for a metre of its position, rounded upwards; 0 for a revolute joint.
        axes: (m, 3) unit vectors, or as long as the joint slides fast, reversed for a joint that is crossed from child to parent, each
            number rounded to a double.
        rotations: (m + 1, 3, 3) of the fixed poses before, between and behind the joints, each number rounded to a double.
        offsets: (m + 1, 3) of the fixed poses, metres, each number rounded to a double.
    """

    joints: np.ndarray
    speeds: Array
    axes: Array
    rotations: Array
    offsets: Array

    def reach(self, vertices: Array) -> Reach:
        """Returns how far vertices, (V, 3) metres in the body's frame, reach."""
        tails, farthest = vertices @ self.rotations[-1].T + self.offsets[-1], float(lengths(vertices).max())
        # What is rounded in the tails: their numbers' 2^-52 and fewer than 2^4 roundings.
        rounded = 2.0**-45 * (farthest + float(lengths(self.offsets[-1:])[0]))
        from_axis = float(across(self.axes[-1:], tails).max()) + rounded if len(self.joints) else 0.0
        return Reach(float(lengths(tails).max()) + rounded, from_axis, farthest)


def poses(chains: Sequence[Chain], which: np.ndarray, at: np.ndarray, q: Array, cosines: Array, sines: Array) -> tuple[Array, Array]:
    """Returns the rotations and the positions of bodies in frames, (N, 3, 3) and (N, 3), at configurations.

    Args:
        chains: those with more joints first.
        which: (N,) the number of the chain, ascending.
        at: (N,) the number of the configuration.
        q: (T, n) positions, of which those of prismatic joints matter.
        cosines, sines: (T, n) of the positions of revolute joints.
    """
    joints, slides = np.concatenate([chain.joints for chain in chains]), np.concatenate([chain.speeds > 0 for chain in chains])
    axes, rotations, offsets = (np.concatenate([getattr(chain, name) for chain in chains]) for name in ("axes", "rotations", "offsets"))
    skew = np.moveaxis(_skew(axes), -1, 0)
    square = skew @ skew
    count = np.array([len(chain.joints) for chain in chains])
    first = (np.cumsum(count) - count)[which]  # of the chain's joints; a chain has one fixed pose more
    R, p = rotations[first + which], offsets[first + which]
    fewer = -count[which]
    for k in range(int(count.max(initial=0))):
        some = slice(int(np.searchsorted(fewer, -k)))  # those that have more joints than k
        joint = first[some] + k
        behind = joint + which[some] + 1
        if which[some][0] == which[some][-1]:  # one chain alone: its numbers are for all
            joint, behind = joint[:1], behind[:1]
        here, slide = (at[some], joints[joint]), slides[joint]
        if slide.any():
            p[some] += np.einsum("ijk,ik->ij", R[some], axes[joint]) * np.where(slide, q[here], 0.0)[:, None]
        if not slide.all():
            turn = np.where(slide, 0.0, sines[here])[:, None, None] * skew.take(joint, axis=0)
            turn += np.where(slide, 0.0, 1.0 - cosines[here])[:, None, None] * square.take(joint, axis=0)
            turn += np.eye(3)  # Rodrigues' formula
            R[some] = R[some] @ turn
        p[some] += np.einsum("ijk,ik->ij", R[some], offsets[behind])
        R[some] = _times(R[some], rotations.take(behind, axis=0))
    return R, p


def _times(R: Array, by: Array) -> Array:
    """Returns products of rotations, (N, 3, 3), with others, (N, 3, 3) or one for all."""
    found: Array = R @ by if len(by) > 1 else (R.reshape(-1, 3) @ by[0]).reshape(R.shape)
    return found


def lengths(points: Array) -> Array:
    """Returns the lengths of points, (V, 3), rounded upwards; what underflows is less than what is added."""
    found: Array = np.sqrt((points**2).sum(axis=1)) * UP + 2.0**-100
    return found


def across(axes: Array, points: Array) -> Array:
    """Returns the distances of points, (V, 3), from the lines along axes through 0, (V, 3) or one for all, rounded upwards."""
    products = axes[:, [1, 2, 0]] * points[:, [2, 0, 1]] - axes[:, [2, 0, 1]] * points[:, [1, 2, 0]]
    return lengths(products) + 2.0**-45 * lengths(points)


def _skew(axes: Array) -> Array:
    """Returns the matrices K, (3, 3, V), with K p the vector product of an axis, (V, 3), and p."""
    x, y, z = axes.T
    zero = np.zeros_like(x)
    return np.array([[zero, -z, y], [z, zero, -x], [-y, x, zero]])

"""The coordinates of joints: positions q, and tangent-space coordinates s about q* (C-IRIS, eq. 4).

    s_i = tan((q_i - q*_i) / 2)   of a revolute joint,      s_i = q_i - q*_i   of a prismatic one.

Only these do this arithmetic themselves: compiled kernels (certifier.motion, certifier.polytopes.gibbs, certifier.seeding.contacts), ball
arithmetic (planner.motion.curve), and the verifier, which shares no code with what it checks.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from flint import arb, ctx, fmpq
from numpy.typing import ArrayLike, NDArray

Array = NDArray[Any]


class ConfigurationSpace:
    """A configuration space has n joints, each with a position q and a tangent-space coordinate s.

    Arrays have a last axis of n, and as many others as the caller likes.

    Attributes:
        q_star: (n,) the positions at which s is 0, radians or metres.
        revolute: (n,) True where the joint is revolute, False where it is prismatic.
    """

    def __init__(self, q_star: Array, revolute: NDArray[np.bool_]) -> None:
        self.q_star, self.revolute = q_star, revolute

    def of(self, joints: int | list[int]) -> ConfigurationSpace:
        """Returns the space of some joints. That of a single one takes arrays of any shape."""
        return ConfigurationSpace(self.q_star[joints], self.revolute[joints])

    def to_s(self, q: ArrayLike) -> Array:
        """Returns the tangent-space coordinates of positions q."""
        return self.at_offset(np.asarray(q, dtype=float) - self.q_star)

    def to_q(self, s: ArrayLike) -> Array:
        """Returns the positions of tangent-space coordinates s."""
        return self.q_star + self.offset(np.asarray(s, dtype=float))

    def offset(self, s: Array) -> Array:
        """Returns how far from q* the joints are, q - q*, in radians or metres."""
        return np.where(self.revolute, 2 * np.arctan(s), s)

    def at_offset(self, offset: Array) -> Array:
        """Returns s for an offset q - q*."""
        return np.where(self.revolute, np.tan(offset / 2), offset)

    def has_s(self, q: Array) -> NDArray[np.bool_]:
        """Returns which positions have an s: those of revolute joints less than half a turn from q*, and all of prismatic ones."""
        return ~self.revolute | (np.abs(q - self.q_star) < np.pi)

    def turn(self, lower: Array, upper: Array) -> Array:
        """Returns how far the joints move from ``lower`` to ``upper``, both in s, in radians or metres."""
        return self.offset(upper) - self.offset(lower)

    def middle(self, lower: Array, upper: Array) -> Array:
        """Returns the s that is midway in q between two others."""
        return self.at_offset((self.offset(lower) + self.offset(upper)) / 2)

    def denominator(self, s: Array) -> Array:
        """Returns 1 + s^2 for revolute joints, the denominator of their rational kinematics, and 1 for prismatic ones."""
        return np.where(self.revolute, 1 + s * s, 1.0)

    def cosine(self, s: Array) -> Array:
        """Returns cos((q - q*) / 2) for revolute joints, and 1 for prismatic ones."""
        return 1 / np.sqrt(self.denominator(s))

    def slope(self, s: Array) -> Array:
        """Returns dq/ds. The product over the joints is the volume in q of an element of volume in s."""
        return np.where(self.revolute, 2.0, 1.0) / self.denominator(s)

    def scale(self, length: float) -> Array:
        """Returns what counts as 1 of each joint's positions, (n,): a radian, or this length in metres."""
        return np.where(self.revolute, 1.0, length)

    def nearest_s(self, q: Array) -> Array:
        """Returns s for positions q, (n,), rounded to nearest, the same on every machine.

        NumPy's tangent depends on the processor; the tangent of ball arithmetic does not.
        """
        offset = (q - self.q_star).tolist()
        with ctx.workprec(256):
            found = [float(arb(x / 2).tan().mid()) if revolute else x for x, revolute in zip(offset, self.revolute, strict=True)]
        return np.array(found)

    def outer_s(self, lower: Array, upper: Array) -> tuple[Array, Array]:
        """Returns the largest doubles that are no more than s at ``lower``, and the least that are no less than s at ``upper``, (n,) each.

        Args:
            lower, upper: (n,) positions q.
        """
        q_star, revolute = self.q_star.tolist(), self.revolute.tolist()
        least = [-_not_less(*joint) for joint in zip(q_star, lower.tolist(), revolute, strict=True)]
        return np.array(least), np.array([_not_less(*joint) for joint in zip(upper.tolist(), q_star, revolute, strict=True)])


def _not_less(q: float, base: float, revolute: bool) -> float:
    """Returns the least double that is no less than tan((q - base)/2), or than q - base."""
    difference = fmpq(*q.as_integer_ratio()) - fmpq(*base.as_integer_ratio())
    with ctx.workprec(4096):  # a difference of doubles is exact
        exactly = (arb(difference) / 2).tan() if revolute else arb(difference)
        nearest = float(exactly.mid())
        return nearest if arb(nearest) >= exactly else float(np.nextafter(nearest, np.inf))

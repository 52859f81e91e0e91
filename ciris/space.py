"""A space says what the coordinates s of a scene or a region mean: which joints there are, and q*."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from certifier.errors import RegionError

Array = NDArray[np.float64]
Straight = Literal["q", "s"]
"""The coordinates in which a motion is straight, or polynomial."""


def numbers(values: object, field: str) -> Array:
    """Returns finite numbers as an array of floats.

    Raises:
        RegionError: points, for what is no array of finite real numbers.
    """
    try:
        array = np.asarray(values)
        if array.dtype.kind in "biuf" and np.isfinite(array).all() and not np.ma.is_masked(values):
            return array.astype(float)
    except (TypeError, ValueError):
        pass
    message = "these are not finite numbers, as many in every row"
    raise RegionError("points", message, field=field, hint="give real numbers, such as joint positions")


def frozen(values: Any, dtype: Any = float) -> Any:
    """Returns a new array that nobody can write to."""
    array = np.array(values, dtype=dtype)
    array.setflags(write=False)
    return array


@dataclass(frozen=True, eq=False)
class Space:
    """The joints of a scene, in position order, and the tangent-space coordinates s about q*."""

    joints: tuple[str, ...]
    """Names of the n joints that have a position."""
    q_star: Array
    """(n,) the joint positions at which s is 0, in radians or metres."""
    q_lower: Array
    """(n,) lower limits, in radians or metres; for a joint that turns without end, the begin of the window that the scene covers."""
    q_upper: Array
    """(n,) upper limits."""
    revolute: NDArray[np.bool_]
    """(n,) True where s = tan((q - q*) / 2), False where s = q - q*."""

    def to_s(self, q: ArrayLike) -> Array:
        """Returns the tangent-space coordinates of joint positions, (..., n) -> (..., n).

        Raises:
            RegionError: wrong_length; outside_window, for a joint that is half a turn or more from q*, where s begins anew.
        """
        positions = self.points(q, "q")
        delta = positions - self.q_star
        outside = self.revolute & (np.abs(delta) >= np.pi)
        if outside.any():
            *at, joint = np.argwhere(outside)[0]
            value, centre = positions[(*at, joint)], self.q_star[joint]
            message = f"{self.joints[joint]} is {value:.9g} rad, which is half a turn or more from q* = {centre:.9g} rad"
            raise RegionError(
                "outside_window", message, field="q", hint=f"its limits are {self.q_lower[joint]:.9g} and {self.q_upper[joint]:.9g} rad"
            )
        return np.where(self.revolute, np.tan(delta / 2), delta)

    def to_q(self, s: ArrayLike) -> Array:
        """Returns the joint positions of tangent-space coordinates, (..., n) -> (..., n).

        Raises:
            RegionError: wrong_length.
        """
        given = self.points(s, "s")
        return self.q_star + np.where(self.revolute, 2 * np.arctan(given), given)

    def points(self, values: ArrayLike, field: str) -> Array:
        """Returns points as an array, (..., n).

        Raises:
            RegionError: points, wrong_length.
        """
        array, n = numbers(values, field), len(self.joints)
        if array.shape[-1:] != (n,):
            message = f"it has the shape {array.shape}, and the last number must be {n}, one for each joint"
            raise RegionError("wrong_length", message, field=field, hint=f"in the order {', '.join(self.joints)}")
        return array


class InSpace:
    """What lies in a space has its joints, and converts as it does."""

    space: Space

    @property
    def joints(self) -> tuple[str, ...]:
        """Names of the n joints, in the order of q."""
        return self.space.joints

    @property
    def q_star(self) -> Array:
        """(n,) the joint positions at which s is 0."""
        return self.space.q_star

    def to_s(self, q: ArrayLike) -> Array:
        """Returns the tangent-space coordinates of joint positions, (..., n) -> (..., n)."""
        return self.space.to_s(q)

    def to_q(self, s: ArrayLike) -> Array:
        """Returns the joint positions of tangent-space coordinates, (..., n) -> (..., n)."""
        return self.space.to_q(s)

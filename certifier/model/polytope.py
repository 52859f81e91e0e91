"""Polytopes and boxes in s, and the regions that the database keeps."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from certifier.document import LARGEST
from certifier.errors import RegionError
from certifier.model.joints import Array


@dataclass(frozen=True)
class Polytope:
    """A polytope is {s : C s <= d}, where C is (m, n) and d is (m,), both finite.

    The code that makes it decides whether the joint limits are among its rows. :meth:`given` checks what comes from users.
    """

    C: Array
    d: Array

    @classmethod
    def given(cls, C: Any, d: Any, n: int | None = None, field: str = "polytope") -> Polytope:
        """Returns a polytope from what users give: nested lists or arrays of numbers.

        Args:
            n: number of columns that C has to have; None for any. A C without rows is taken to have that many columns.
            field: field in which the user gave the polytope, for errors.

        Raises:
            RegionError: ``polytope_shape`` or ``polytope_not_finite``.
        """
        try:
            rows, offsets = np.array(C, dtype=float), np.array(d, dtype=float)
        except (TypeError, ValueError):
            raise RegionError("polytope_shape", "C and d must be lists of numbers, and the rows of C equally long", field=field) from None
        if rows.size == 0 and n is not None:
            rows = rows.reshape(0, n)
        if rows.ndim != 2 or offsets.shape != (len(rows),) or (n is not None and rows.shape[1] != n):
            hint = f"C must be m x {n or 'n'}, one column a joint in the scene's order, and d must have m numbers"
            message = f"C is {_size(rows)} and d is {_size(offsets)}"
            raise RegionError("polytope_shape", message, field=field, hint=hint)
        if not (np.abs(rows).max(initial=0.0) <= LARGEST and np.abs(offsets).max(initial=0.0) <= LARGEST):
            raise RegionError("polytope_not_finite", f"C and d must be finite numbers of at most {LARGEST:g}", field=field)
        return cls(rows, offsets)

    def contains(self, s: ArrayLike, tolerance: float = 0.0) -> NDArray[np.bool_]:
        """Returns which of the points s, (..., n), satisfy C s <= d + tolerance."""
        return np.all(np.asarray(s) @ self.C.T <= self.d + tolerance, axis=-1)


@dataclass(frozen=True)
class Box:
    """A box contains the polytope and gives it the coordinates u = (s - mid)/half.

    Attributes:
        mid: (n,) centre.
        half: (n,) half edges.
    """

    mid: Array
    half: Array

    @classmethod
    def around(cls, lower: Array, upper: Array) -> Box:
        """Returns the box of these bounds, rounded outwards."""
        mid = (lower + upper) / 2
        half = np.maximum(upper - mid, mid - lower)
        # Of a small box far from 0, the corners are rounded by more than the first of these.
        far = 8 * np.spacing(np.maximum(np.abs(lower), np.abs(upper)))
        return cls(mid, np.maximum(np.nextafter(half * (1 + 1e-12), np.inf), half + far))

    @property
    def lower(self) -> Array:
        """Returns the least doubles inside the box, (n,)."""
        return np.nextafter(self.mid - self.half, np.inf)

    @property
    def upper(self) -> Array:
        """Returns the largest doubles inside the box, (n,)."""
        return np.nextafter(self.mid + self.half, -np.inf)

    def to_u(self, s: Array) -> Array:
        return (s - self.mid) / self.half


@dataclass(frozen=True, eq=False)
class StoredRegion:
    """A stored region is a certified one as the database keeps it for planners.

    Attributes:
        guarantee: what its certificate is worth.
        C: (m, n) and d (m,), the half-spaces {s : C s <= d}, m >= 1, joint limits included.
        lower: (n,) lower corner of a box that contains the region, in s.
        upper: (n,) its upper corner.
    """

    id: str
    guarantee: str
    C: Array
    d: Array
    lower: Array
    upper: Array


def _size(array: Array) -> str:
    return " x ".join(map(str, array.shape)) or "a number"

"""The result of a polytope step is kept here as data."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from certifier.model import Array, Polytope


@dataclass(frozen=True, eq=False)
class Stepped:
    """Holds the moved polytope and the one that it came from; their rows correspond, and the joint limits come last in both.

    Attributes:
        polytope: the new rows.
        center: (n,) centre of the new inscribed ellipsoid, hence inside.
        base: the polytope that was stepped from, within the trust box and without the rows that no pair needs. What lies between base and
            polytope is feasible in (12) as well.
        growth: relative growth of the inscribed ellipsoid's volume, from the polytope that was given.
        info: JSON-able, what the step has to say of itself.
    """

    polytope: Polytope
    center: Array
    base: Polytope
    growth: float
    info: dict[str, Any]

    def to_document(self) -> dict[str, Any]:
        """Returns the step's result as JSON-able data."""
        return {
            "C": self.polytope.C.tolist(),
            "d": self.polytope.d.tolist(),
            "center": self.center.tolist(),
            "base_C": self.base.C.tolist(),
            "base_d": self.base.d.tolist(),
            "growth": self.growth,
            "info": self.info,
        }

    @classmethod
    def from_document(cls, document: dict[str, Any]) -> Stepped:
        """Does the inverse of :meth:`to_document`."""
        moved, base = (Polytope(np.array(document[C]), np.array(document[d])) for C, d in (("C", "d"), ("base_C", "base_d")))
        return cls(moved, np.array(document["center"]), base, document["growth"], document["info"])

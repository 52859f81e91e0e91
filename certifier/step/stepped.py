"""The result of a polytope step is kept here as data."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

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

"""A proposal is a polytope to certify, kept as data. Nothing in it is a proof."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from certifier.model import Array

NO_ROOM = ", and no region was found there"
TOO_LONG = ", which is too little to be seen beside it"
"""One of these is in ``info["hindrance"]`` of a proposal."""


def mend(hindrance: str) -> str:
    """Returns what to do about a hindrance."""
    if NO_ROOM in hindrance:
        return f"move {'the seed' if 'the seed is' in hindrance else 'it'} away from the contact"
    return "set narrower limits for the joint in the scene file"


@dataclass(frozen=True, eq=False)
class Proposal:
    """A proposal is a polytope to certify: {C s <= d} within the joint limits.

    Attributes:
        C, d: (m, n), (m,) the faces, |c_j| = 1 where IRIS made them; the joint limits are not among them.
        center: (n,) the seed in s (for ``polytope``, the centre), inside all faces and limits.
        contain: (k, n) what else the region has to contain, in s, inside all faces and limits as well.
        info: JSON-able: method, guarantee (``sampled`` when IRIS passed its statistical test, else ``none``), faces, seconds, and for
            IRIS termination, iterations, epsilon, delta, Drake's warnings, the random seed, and how many random seeds were tried.
            ``hindrance`` is the reason to give if no region can be grown, where one is known (:mod:`certifier.seeding.hindrance`).
    """

    C: Array
    d: Array
    center: Array
    contain: Array
    info: dict[str, Any]

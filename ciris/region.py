"""A certified region as arrays."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import datetime
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from certifier.outcome import Guarantee
from certifier.words import counted
from ciris.answers import NotCovered, QVolume, Share
from ciris.documents import SHORT, Document
from ciris.reading import values
from ciris.space import Array, InSpace, Space, frozen


@dataclass(frozen=True, eq=False, repr=False)
class RegionData(InSpace):
    """A polytope {s : C s <= d} in which the robot collides nowhere, which is proved, but for the pairs that are ``not_covered``.

    It has n joints and m faces.
    """

    id: str
    scene: str
    """Id of the scene."""
    scene_name: str
    job: str
    """Id of the job that made the region."""
    guarantee: Guarantee
    C: Array
    """(m, n) in s, one row a face, the joint limits among them."""
    d: Array
    """(m,)"""
    center: Array
    """(n,) a point inside, in s."""
    space: Space
    """What the coordinates s mean."""
    q_volume: QVolume | None
    """How large the region is in joint positions."""
    share: Share | None
    """How much of the proposal it keeps; None for a region that was not grown."""
    not_covered: NotCovered
    """The pairs of geometries that the proof is not about."""
    created_at: datetime
    manifest: Document
    """Everything else that is known of it: docs/architecture.md, "Manifest"."""

    def contains(self, q: ArrayLike) -> NDArray[np.bool_]:
        """Returns whether the region contains joint positions, (..., n) -> (...), as far as floating point can tell.

        Positions are taken literally: one that is a turn away is outside of the limits, and so of the region.

        Raises:
            RegionError: wrong_length.
        """
        positions = self.space.points(q, "q")
        within = ((self.space.q_lower <= positions) & (positions <= self.space.q_upper)).all(axis=-1)
        s = self.to_s(np.where(np.asarray(within)[..., None], positions, self.q_star))
        return np.asarray(within & (s @ self.C.T <= self.d).all(axis=-1))

    def __eq__(self, other: object) -> bool:
        """Regions are equal that have the same id, which no other region of any service has."""
        return isinstance(other, RegionData) and other.id == self.id

    def __hash__(self) -> int:
        return hash(self.id)

    def __repr__(self) -> str:
        size = f", {self.q_volume.value:.3g} {self.q_volume.unit}" if self.q_volume else ""
        has = f"{counted(len(self.joints), 'joint')}, {counted(len(self.d), 'face')}"
        return f"Region({self.id[:SHORT]} of {self.scene_name}: {has}{size}, {self.guarantee})"


def region_fields(document: Document) -> dict[str, Any]:
    """Returns the fields of a region that ``GET /v1/regions/{region}`` describes."""
    manifest = document["manifest"]
    given = manifest["space"]
    q_star, lower, upper = (frozen(given[name]) for name in ("q_star", "q_lower", "q_upper"))
    known = {
        "scene_name": manifest["scene"]["name"],
        "C": frozen(manifest["halfspace_normals"]),
        "d": frozen(manifest["halfspace_offsets"]),
        "center": frozen(manifest["interior_point"]),
        "space": Space(tuple(given["joints"]), q_star, lower, upper, frozen(given["revolute"], bool)),
    }
    return known | values(RegionData, document, known)

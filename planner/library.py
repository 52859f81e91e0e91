"""A library holds all regions of a scene as arrays, as of one version, ready for questions."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from certifier.model import Array, Polytope, StoredRegion
from planner.boxes import BoxGrid
from planner.rows import Rows

AT_ONCE = 200
"""Number of regions that are read at once."""


class Library:
    """Holds R >= 0 regions of an n-joint scene. It never changes: :meth:`changed` returns the next one.

    Attributes:
        version: counts the changes of the scene's regions.
        ids: the regions' ids, in the order of their numbers 0 to R - 1 here.
        guarantees: what each region's certificate is worth.
        lower: (R, n) lower corners of the boxes around the regions.
        upper: (R, n) upper corners.
        first: (R + 1,) where each region's faces begin among all, and their number.
        grid: finds boxes by points.
    """

    def __init__(self, n: int) -> None:
        self.version = 0
        self.ids: tuple[str, ...] = ()
        self.guarantees: tuple[str, ...] = ()
        self.first = np.zeros(1, dtype=np.intp)
        self.lower, self.upper = np.zeros((0, n)), np.zeros((0, n))
        self.grid = BoxGrid(self.lower, self.upper)
        self._faces = Rows(np.zeros((0, n + 1)))
        self._norms = Rows(np.zeros(0))

    def __len__(self) -> int:
        return len(self.ids)

    @property
    def n(self) -> int:
        return self.lower.shape[1]

    @property
    def faces(self) -> Array:
        """Returns the faces of all regions, (M, n + 1): c, then d. Those of a region that cut most off its box come first."""
        return self._faces.array

    @property
    def norms(self) -> Array:
        """Returns the lengths of the faces' normals, (M,); 1 for a normal of zeros."""
        return self._norms.array

    def rows(self, region: int) -> slice:
        """Returns where the faces of a region are among all."""
        return slice(int(self.first[region]), int(self.first[region + 1]))

    def polytope(self, region: int) -> Polytope:
        """Returns the half-spaces of a region, in the order of :attr:`faces`."""
        faces = self.faces[self.rows(region)]
        return Polytope(faces[:, :-1], faces[:, -1])

    def changed(self, version: int, ids: Sequence[str], added: Sequence[StoredRegion]) -> Library:
        """Returns the library of another version: the regions of this one whose ids are still there, and those added.

        Regions that are added cost no work on those that are there. Where some are gone, the faces of the others are copied once. Only the
        newest library of a scene may be changed.
        """
        there = set(ids)
        stays = np.array([id in there for id in self.ids], dtype=bool)
        return (self if stays.all() else self._only(stays))._plus(version, added)

    def _only(self, stays: NDArray[np.bool_]) -> Library:
        kept, library = np.flatnonzero(stays), Library(self.n)
        rows = np.repeat(stays, np.diff(self.first))
        library.ids, library.guarantees = tuple(self.ids[i] for i in kept), tuple(self.guarantees[i] for i in kept)
        library.first = np.concatenate([[0], np.cumsum(np.diff(self.first)[kept])])
        library.lower, library.upper = self.lower[kept], self.upper[kept]
        library.grid = BoxGrid(library.lower, library.upper)
        library._faces, library._norms = Rows(self.faces[rows]), Rows(self.norms[rows])
        return library

    def _plus(self, version: int, added: Sequence[StoredRegion]) -> Library:
        library = Library.__new__(Library)
        library.version = version
        library.ids = (*self.ids, *(region.id for region in added))
        library.guarantees = (*self.guarantees, *(region.guarantee for region in added))
        library.first = np.concatenate([self.first, self.first[-1] + np.cumsum([len(region.d) for region in added], dtype=np.intp)])
        library.lower = np.concatenate([self.lower, *(region.lower[None] for region in added)])
        library.upper = np.concatenate([self.upper, *(region.upper[None] for region in added)])
        library.grid = self.grid.plus(library.lower, library.upper)
        faces = np.concatenate([np.zeros((0, self.n + 1)), *(_sorted(region) for region in added)])
        norms = np.linalg.norm(faces[:, :-1], axis=1)
        library._faces, library._norms = self._faces.plus(faces), self._norms.plus(np.where(norms > 0, norms, 1.0))
        return library


def renewed(library: Library, roll: Callable[[], tuple[int, list[str]]], read: Callable[[Sequence[str]], list[StoredRegion]]) -> Library:
    """Returns the library with the regions that the scene has now. Only those that are new are read.

    Args:
        roll: returns the version of the scene's regions and their ids, in the order of their numbers.
        read: returns the regions with these ids; those that are gone are left out.

    Returns:
        The library as it is where a region was deleted in between: then the version is another one by now.
    """
    version, ids = roll()
    known = set(library.ids)
    new = [region_id for region_id in ids if region_id not in known]
    added = [region for begin in range(0, len(new), AT_ONCE) for region in read(new[begin : begin + AT_ONCE])]
    return library if len(added) < len(new) else library.changed(version, ids, added)


def _sorted(region: StoredRegion) -> Array:
    """Returns the faces (m, n + 1) of a region: first those that cut most off its box, which most points of the box are outside of."""
    spread = np.linalg.norm(region.C * (region.upper - region.lower), axis=1)
    slack = region.d - region.C @ (region.lower + region.upper) / 2
    order = np.argsort(slack / np.where(spread > 0, spread, 1.0), kind="stable")
    return np.column_stack([region.C, region.d])[order]

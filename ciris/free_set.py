"""A free set is what the map of a scene proves, as cells for quick lookups. A controller asks it in every cycle, without a service.

``ciris free-set PROOF`` checks a map's proof and writes the file. Loading it needs numpy and numba. docs/maps.md has figures.
"""

from __future__ import annotations

import json
import zipfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from certifier.errors import CirisError, RegionError, unreadable
from ciris.space import Array, InSpace, Space, frozen

FORMAT = 1
TOLERANCE = 1e-9
"""A configuration counts as open where it is nearer to an open cell than this, in radians or metres, in each joint. Where a joint has
limits beyond 1, it is this part of them. The tolerance covers rounding errors."""
AGAIN = "make it again from the map's proof: ciris free-set PROOF"


@dataclass(frozen=True)
class OpenPart:
    """A part of a motion for which nothing is proved about some pairs."""

    start: float
    end: float
    """From this share of the motion to that one, in [0, 1]."""
    pairs: tuple[tuple[str, str], ...]
    """The names of their geometries."""


@dataclass(frozen=True, eq=False, repr=False)
class FreeSet(InSpace):
    """Configurations that are proved to be free of collision, but for the pairs that the proof is not about."""

    scene: str
    """Hash of the scene."""
    name: str
    """Name of the scene."""
    space: Space
    clauses: tuple[tuple[tuple[str, str], ...], ...]
    """The pairs of geometries that share trees. All of them have to be proved apart at a configuration."""
    _cells: Any
    """ciris.lookups.Cells"""

    @classmethod
    def load(cls, path: str | Path) -> Self:
        """Reads what ``ciris free-set`` wrote. The file is no proof: it is as trustworthy as the place that it comes from.

        Raises:
            CirisError: no_file; free_set, for a file that is none, is damaged, or is of another version; not_installed, without numba.
        """
        try:
            from ciris.lookups import Cells
        except ModuleNotFoundError as error:
            raise CirisError("not_installed", f"{error.name} is not installed", hint="pip install 'ciris[monitor]'") from None
        try:
            with np.load(path, allow_pickle=False) as arrays:
                head = json.loads(str(arrays["head"]))
                if head["format"] != FORMAT:
                    raise CirisError("free_set", f"it has the format {head['format']}, not {FORMAT}", field=str(path), hint=AGAIN)
                joints = tuple(head["joints"])
                space = Space(joints, *(frozen(arrays[key]) for key in ("q_star", "q_lower", "q_upper")), frozen(arrays["revolute"], bool))
                limits = np.maximum(np.abs(space.q_lower), np.abs(space.q_upper))
                types = {"joint": np.int16, "cut": float, "upper": np.int32, "root": np.int32, "first": np.int32, "tree": np.int32}
                cells = Cells(
                    **{key: np.array(arrays[key], dtype) for key, dtype in types.items()}, tolerance=TOLERANCE * np.maximum(limits, 1)
                )
                clauses = tuple(tuple((str(a), str(b)) for a, b in pairs) for pairs in head["clauses"])
                found = cls(str(head["scene"]), str(head["name"]), space, clauses, cells)
            found._check()
        except OSError as error:
            raise CirisError("no_file", unreadable(error), field=str(path), hint="name the file that ciris free-set wrote") from None
        except (ValueError, KeyError, TypeError, EOFError, zipfile.BadZipFile):
            raise CirisError("free_set", "it is no free set, or is damaged", field=str(path), hint=AGAIN) from None
        return found

    def __repr__(self) -> str:
        return f"<FreeSet of {self.name}: {len(self.clauses)} groups of pairs, {len(self._cells.joint)} nodes>"

    def contains(self, q: ArrayLike) -> NDArray[np.bool_]:
        """Returns which configurations are proved to be free, (..., n) -> (...).

        Positions are taken literally: one that is a turn away is outside of the limits.

        Raises:
            RegionError: points, wrong_length.
        """
        from ciris.lookups import points

        given = self.space.points(q, "q")
        rows = np.ascontiguousarray(given.reshape(-1, len(self.joints)))
        found = np.empty(len(rows), bool)
        points(self._cells, rows, found)
        return (found & self._within(rows)).reshape(given.shape[:-1])

    def contains_motion(self, start: ArrayLike, end: ArrayLike) -> NDArray[np.bool_]:
        """Returns which motions that are straight in q are proved to be free all along, (..., n) and (..., n) -> (...).

        Raises:
            RegionError: points, wrong_length; motion, for another number of starts than of ends.
        """
        from ciris.lookups import motions

        first, rows, ends = self._ends(start, end)
        found = np.empty(len(rows), bool)
        motions(self._cells, rows, ends - rows, found)
        return (found & self._within(rows) & self._within(ends)).reshape(first.shape[:-1])

    def open_parts(self, start: ArrayLike, end: ArrayLike) -> tuple[OpenPart, ...]:
        """Returns where a motion from one configuration straight to another, (n,) each, is not proved to be free, for each group of pairs.

        Raises:
            RegionError: points, wrong_length; motion, for more than one; outside_limits, for an end beyond the joint limits.
        """
        from ciris.lookups import open_ranges

        first, rows, ends = self._ends(start, end)
        if first.ndim != 1:
            raise RegionError("motion", "these are several motions", field="start", hint="ask for one at a time")
        if not (self._within(rows) & self._within(ends)).all():
            hint = f"the limits are {self.space.q_lower.tolist()} and {self.space.q_upper.tolist()}"
            raise RegionError("outside_limits", "the motion leaves the joint limits", field="start, end", hint=hint)
        parts = []
        for clause, pairs in enumerate(self.clauses):
            for begin, until in _joined(open_ranges(self._cells, clause, rows[0], ends[0] - rows[0])):
                parts.append(OpenPart(begin, until, pairs))
        return tuple(sorted(parts, key=lambda part: (part.start, part.end)))

    def _ends(self, start: ArrayLike, end: ArrayLike) -> tuple[Array, Array, Array]:
        """Returns the starts as they were given, and starts and ends as rows."""
        first, second, n = self.space.points(start, "start"), self.space.points(end, "end"), len(self.joints)
        if first.shape != second.shape:
            raise RegionError("motion", f"the shapes are {first.shape} and {second.shape}", field="end", hint="give one end for each start")
        return first, np.ascontiguousarray(first.reshape(-1, n)), np.ascontiguousarray(second.reshape(-1, n))

    def _within(self, rows: Array) -> NDArray[np.bool_]:
        found: NDArray[np.bool_] = ((self.space.q_lower <= rows) & (rows <= self.space.q_upper)).all(axis=1)
        return found

    def _check(self) -> None:
        """Refuses arrays that compiled loops would read beyond their ends.

        Raises:
            ValueError: they are not what ``ciris free-set`` writes.
        """
        from ciris.lookups import DEPTH, OPEN, depth

        cells, n, N, space = self._cells, len(self.joints), len(self._cells.joint), self.space
        shapes = [
            *(array.shape == (n,) for array in (space.q_star, space.q_lower, space.q_upper, space.revolute)),
            *(array.shape == (N,) for array in (cells.joint, cells.cut, cells.upper)),
            *(array.ndim == 1 for array in (cells.root, cells.first, cells.tree)),
            N > 0 and len(self.clauses) > 0 and len(cells.first) == 1 + len(self.clauses),
        ]
        if not all(shapes):
            raise ValueError("the arrays have other shapes")
        inner = np.flatnonzero(cells.joint >= 0)
        values = [
            ((cells.joint >= OPEN) & (cells.joint < n)).all() and np.isfinite(cells.cut).all(),
            ((cells.upper[inner] > inner + 1) & (cells.upper[inner] < N)).all(),
            cells.first[0] == 0 and (np.diff(cells.first) > 0).all() and cells.first[-1] == len(cells.tree),
            ((cells.tree >= 0) & (cells.tree < len(cells.root))).all() and ((cells.root >= 0) & (cells.root < N)).all(),
        ]
        if not all(values) or depth(cells.joint, cells.upper) > DEPTH:
            raise ValueError("the arrays do not fit each other")


def _joined(ranges: Array) -> list[tuple[float, float]]:
    """Returns ranges in order, with those that overlap in one."""
    found: list[tuple[float, float]] = []
    for begin, end in sorted(ranges.tolist()):
        if found and begin <= found[-1][1]:
            found[-1] = found[-1][0], max(end, found[-1][1])
        else:
            found.append((begin, end))
    return found

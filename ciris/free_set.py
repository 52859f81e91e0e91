"""A free set is what the map of a scene proves, as cells for quick lookups. A controller asks it in every cycle, without a service.

``ciris free-set PROOF`` checks a map's proof and writes the file. Loading it needs numpy and numba. docs/maps.md has figures.
"""

from __future__ import annotations

import io
import json
import zipfile
import zlib
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from certifier.errors import CirisError, RegionError, unreadable
from certifier.words import counted
from ciris.space import Array, InSpace, Space, frozen

FORMAT, BEFORE = 2, 1
"""Files of the format before have no oblique cuts."""
TOLERANCE = 1e-9
"""A configuration counts as open within TOLERANCE of an open cell in each joint, in radians or metres. Where a joint's limits are beyond 1,
TOLERANCE is a part of the larger one. This covers rounding errors."""
BOXES = 20_000
"""A search for the nearest proved configuration ends after about this many boxes: a third of a second, where there are 50 pairs."""
BACK = 1e-6
"""What was found is moved towards what was asked for as far as this is proved, less this part of the way."""
LARGEST = 1 << 30
"""No file is read that has more bytes than this, packed or unpacked."""
DAMAGES = (
    EOFError,
    KeyError,
    MemoryError,
    NotImplementedError,
    OSError,
    RecursionError,
    RuntimeError,
    TypeError,
    ValueError,
    zipfile.BadZipFile,
    zlib.error,
)
"""What reading a damaged file may raise."""
AGAIN = "make it again from the map's proof: ciris free-set PROOF"


@dataclass(frozen=True)
class OpenPart:
    """A part of a motion for which nothing is proved about some pairs."""

    start: float
    end: float
    """From this share of the motion to that one, in [0, 1]."""
    pairs: tuple[tuple[str, str], ...]
    """The names of their geometries."""


@dataclass(frozen=True, eq=False)
class Closest:
    """The proved configuration that is nearest to another one."""

    q: Array | None
    """(n,); None where none was found."""
    distance: float | None
    """Euclidean distance in s; 0 where the other one is proved itself, None where none was found."""
    complete: bool
    """Whether none is nearer; before an oblique cut, by more than 0.001. False where the search ended early."""
    boxes: int
    """How many boxes the search looked at."""


@dataclass(frozen=True, eq=False, repr=False)
class FreeSet(InSpace):
    """Configurations that are proved to be free of collision. Pairs that the scene ignores are not covered."""

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

        It also asks each question once, so that what is compiled is there for the next ones.

        Raises:
            CirisError: no_file; free_set, for a file that is none, is damaged, or is of another version; not_installed, without numba;
                no_cache, where numba finds no directory for what it compiles.
        """
        try:
            with open(path, "rb") as file:
                data = file.read(LARGEST + 1)
        except OSError as error:
            raise CirisError("no_file", unreadable(error), field=str(path), hint="name the file that ciris free-set wrote") from None
        return cls.of_bytes(data, str(path))

    @classmethod
    def of_bytes(cls, data: bytes, name: str) -> Self:
        """Does as :meth:`load` with the bytes of a file.

        Args:
            name: what errors call the file.
        """
        try:
            from ciris import lookups
        except ModuleNotFoundError as error:
            raise CirisError("not_installed", f"{error.name} is not installed", hint="pip install 'ciris[monitor]'") from None
        except RuntimeError as error:
            hint = "set NUMBA_CACHE_DIR to a directory that this user may write to"
            raise CirisError("no_cache", f"what is compiled cannot be kept: {error}", field="NUMBA_CACHE_DIR", hint=hint) from None
        try:
            head, arrays = _read(data)
            if head["format"] == BEFORE:
                arrays["normals"] = np.zeros((0, len(head["joints"])))
            elif head["format"] != FORMAT:
                raise CirisError("free_set", f"it has the format {head['format']!r}, not {FORMAT}", field=name, hint=AGAIN)
            found = _checked(cls, head, arrays, lookups)
        except DAMAGES:
            raise CirisError("free_set", "it is no free set, or is damaged", field=name, hint=AGAIN) from None
        middle = (found.space.q_lower + found.space.q_upper) / 2
        found.contains(middle)
        found.contains_motion(middle, middle)
        found.open_parts(middle, middle)
        found.nearest(found.q_star, closer_than=0)
        return found

    def __repr__(self) -> str:
        return f"<FreeSet of {self.name}: {counted(len(self.clauses), 'group')} of pairs, {counted(len(self._cells.nodes), 'cut')}>"

    def contains(self, q: ArrayLike) -> NDArray[np.bool_]:
        """Returns which configurations are proved to be free, (..., n) -> (...).

        Positions are taken literally: one that is a turn away is outside of the limits.

        Raises:
            RegionError: points, wrong_length.
        """
        from ciris.lookups import points

        given = self.space.points(q, "q")
        found = np.empty(given.shape[:-1], bool)
        points(self._cells, np.ascontiguousarray(given.reshape(-1, len(self.joints))), found.reshape(-1))
        return found

    def contains_motion(self, start: ArrayLike, end: ArrayLike) -> NDArray[np.bool_]:
        """Returns which motions that are straight in q are proved to be free all along, (..., n) and (..., n) -> (...).

        Raises:
            RegionError: points, wrong_length; motion, for another number of starts than of ends.
        """
        from ciris.lookups import motions

        first, rows, ends = self._ends(start, end)
        found = np.empty(first.shape[:-1], bool)
        motions(self._cells, rows, ends, found.reshape(-1))
        return found

    def nearest(self, q: ArrayLike, *, closer_than: float = np.inf, boxes: int = BOXES) -> Closest:
        """Returns the configuration that is proved to be free and is nearest to q, (n,). q may be beyond the joint limits.

        :meth:`contains` says of it that it is free, after rounding too. Distances are computed in floating point.

        Args:
            closer_than: only what is closer than this counts, in s.
            boxes: the search ends after about this many boxes; with what it has found.

        Raises:
            RegionError: points; wrong_length, also for several configurations; outside_window, for a joint that is half a turn from q*.
        """
        from ciris.nearest import Aim, nearest

        space, given = self.space, self.space.points(q, "q")
        if given.ndim != 1:
            raise RegionError("wrong_length", f"it has the shape {given.shape}", field="q", hint="ask about one configuration at a time")
        if closer_than > 0 and self.contains(given):
            return Closest(given, 0.0, True, 0)
        aim, found = Aim(given, space.to_s(given)), np.full(len(given), np.nan)
        distance, looked, complete = nearest(self._cells, aim, float(closer_than), boxes, found)
        if np.isnan(found[0]):
            return Closest(None, None, complete, looked)
        if len(self._cells.normals):
            found, distance = self._nearer(found, given, distance)
        return Closest(found, distance, complete, looked)

    def _nearer(self, found: Array, q: Array, distance: float) -> tuple[Array, float]:
        """Returns where the motion from a proved configuration towards another one is proved without a gap, and its distance in s."""
        aim = np.clip(q, self.space.q_lower, self.space.q_upper)
        parts = self.proved_parts(found, aim)
        if not len(parts) or parts[0, 0] > 0:
            return found, distance
        nearer = found + (1 - BACK) * parts[0, 1] * (aim - found)
        left = float(np.linalg.norm(self.space.to_s(nearer) - self.space.to_s(q)))
        return (nearer, left) if left < distance and self.contains(nearer) else (found, distance)

    def open_parts(self, start: ArrayLike, end: ArrayLike) -> tuple[OpenPart, ...]:
        """Returns where a motion from one configuration straight to another, (n,) each, is not proved to be free, for each group of pairs.

        Raises:
            RegionError: points, wrong_length; motion, for more than one; outside_limits, for an end beyond the joint limits.
        """
        from ciris.lookups import open_ranges

        rows, ends = self._one(start, end)
        ranges, clauses = open_ranges(self._cells, rows, ends)
        parts = []
        for clause in np.unique(clauses).tolist():
            parts += [OpenPart(begin, until, self.clauses[clause]) for begin, until in _joined(ranges[clauses == clause])]
        return tuple(sorted(parts, key=lambda part: (part.start, part.end)))

    def proved_parts(self, start: ArrayLike, end: ArrayLike) -> Array:
        """Returns where a motion from one configuration straight to another, (n,) each, is proved to be free: shares of it, (k, 2).

        Raises:
            RegionError: as :meth:`open_parts`.
        """
        from ciris.lookups import open_ranges

        rows, ends = self._one(start, end)
        ordered = _joined(open_ranges(self._cells, rows, ends)[0])
        proved = zip([0.0, *(until for _, until in ordered)], [*(begin for begin, _ in ordered), 1.0], strict=True)
        return np.array([part for part in proved if part[0] < part[1]]).reshape(-1, 2)

    def share_of(self, path: ArrayLike) -> float:
        """Returns how much of a motion is proved to be free, as a share of its length. It is straight between waypoints, (k, n) in q.

        Raises:
            RegionError: as :meth:`open_parts`.
        """
        q = np.asarray(path, dtype=float)
        lengths = np.linalg.norm(np.diff(q, axis=0), axis=1)
        if not lengths.sum():
            return float(self.contains(q).all())
        left = [1.0 - np.diff(self.proved_parts(a, b), axis=1).sum() for a, b in pairwise(q)]
        return 1.0 - float(lengths @ left / lengths.sum())

    def _one(self, start: ArrayLike, end: ArrayLike) -> tuple[Array, Array]:
        """Returns the two ends of one motion, (n,) each, within the joint limits."""
        first, rows, ends = self._ends(start, end)
        if first.ndim != 1:
            raise RegionError("motion", "these are several motions", field="start", hint="ask for one at a time")
        for field, (q,) in (("start", rows), ("end", ends)):
            outside = np.flatnonzero((q < self.space.q_lower) | (q > self.space.q_upper))
            if len(outside):
                i = outside[0]
                unit = "rad" if self.space.revolute[i] else "m"
                hint = f"its limits are {self.space.q_lower[i]:.9g} and {self.space.q_upper[i]:.9g} {unit}"
                raise RegionError("outside_limits", f"{self.joints[i]} is {q[i]:.9g} {unit}, beyond its limits", field=field, hint=hint)
        return rows[0], ends[0]

    def _ends(self, start: ArrayLike, end: ArrayLike) -> tuple[Array, Array, Array]:
        """Returns the starts as they were given, and starts and ends as rows."""
        first, second, n = self.space.points(start, "start"), self.space.points(end, "end"), len(self.joints)
        if first.shape != second.shape:
            raise RegionError("motion", f"the shapes are {first.shape} and {second.shape}", field="end", hint="give one end for each start")
        return first, np.ascontiguousarray(first.reshape(-1, n)), np.ascontiguousarray(second.reshape(-1, n))


def _read(data: bytes) -> tuple[dict[str, Any], dict[str, NDArray[Any]]]:
    """Returns the head and the arrays of a file.

    Raises:
        ValueError: it is too large; or another one of DAMAGES.
    """
    with zipfile.ZipFile(io.BytesIO(data)) as parts:
        if sum(part.file_size for part in parts.infolist()) > LARGEST:
            raise ValueError("it is too large")
    with np.load(io.BytesIO(data), allow_pickle=False) as arrays:
        found = {name: arrays[name] for name in arrays.files}
    head = json.loads(str(found.pop("head")))
    if not isinstance(head, dict):
        raise TypeError("the head is no object")
    return head, found


def _checked(cls: type[FreeSet], head: dict[str, Any], arrays: dict[str, NDArray[Any]], lookups: Any) -> Any:
    """Returns the free set of what was read, after a check that compiled loops stay within the arrays, and end.

    Raises:
        ValueError: the arrays are not what ``ciris free-set`` writes; or another one of DAMAGES.
    """
    joints, clauses = head["joints"], tuple(tuple((str(a), str(b)) for a, b in pairs) for pairs in head["clauses"])
    n, N = len(joints), len(arrays["joint"])
    of_joints = dict.fromkeys(("q_star", "q_lower", "q_upper"), ((n,), "float64")) | {"revolute": ((n,), "bool")}
    of_nodes = {"joint": ((N,), "int16"), "cut": ((N,), "float64"), "upper": ((N,), "int32")}
    of_cuts = {"normals": ((np.count_nonzero(arrays["joint"] == lookups.OBLIQUE), n), "float64")}
    of_trees = {name: ((len(arrays[name]),), "int32") for name in ("root", "first", "tree")}
    shapes = of_joints | of_nodes | of_cuts | of_trees
    if {name: (array.shape, array.dtype.name) for name, array in arrays.items()} != shapes or not n or not N:
        raise ValueError("the arrays have other types or shapes")
    arrays = {name: frozen(array, array.dtype) for name, array in arrays.items()}
    space = Space(tuple(joints), arrays["q_star"], arrays["q_lower"], arrays["q_upper"], arrays["revolute"])
    tolerance = frozen(TOLERANCE * np.maximum(np.maximum(np.abs(space.q_lower), np.abs(space.q_upper)), 1))
    joint, cut, upper, root, first, tree = (arrays[name] for name in ("joint", "cut", "upper", "root", "first", "tree"))
    inner, oblique = np.flatnonzero(joint >= 0), np.flatnonzero(joint == lookups.OBLIQUE)
    parts = np.concatenate([inner + 1, upper[inner], root])
    fits = [
        all(isinstance(joint, str) for joint in joints),
        np.isfinite(space.q_star).all() and np.isfinite(tolerance).all() and (space.q_lower <= space.q_upper).all(),
        (joint >= lookups.OPEN).all() and (np.delete(joint, oblique) < n).all() and np.isfinite(cut).all(),
        (upper[inner] > inner + 1).all() and (upper[inner] < N).all() and np.isfinite(arrays["normals"]).all(),
        (upper[oblique] == oblique + 2).all() and (joint[np.minimum(oblique + 1, N - 1)] == lookups.PROVED).all(),
        # Each node is the root of a tree, or a part of one other node. So these are trees.
        len(parts) == N and (parts >= 0).all() and (parts < N).all() and np.bincount(parts, minlength=N).all(),
        len(first) == 1 + len(clauses) > 1 and first[0] == 0 and first[-1] == len(tree),
        (first[1:] > first[:-1]).all() and (tree >= 0).all() and (tree < len(root)).all(),
    ]
    if not all(fits) or lookups.depth(joint, upper) > lookups.DEPTH:
        raise ValueError("the arrays do not fit each other")
    nodes, number = lookups.nodes_of(joint, cut, upper)
    of_space = space.q_star, space.revolute, space.q_lower, space.q_upper
    faces = arrays["normals"], frozen(lookups.spans_of(arrays["normals"]), np.int32)
    cells = lookups.Cells(frozen(nodes, nodes.dtype), frozen(number[root], np.int32), first, tree, *faces, *of_space, tolerance)
    return cls(str(head["scene"]), str(head["name"]), space, clauses, cells)


def _joined(ranges: Array) -> list[tuple[float, float]]:
    """Returns ranges in order, with those that overlap in one."""
    found: list[tuple[float, float]] = []
    for begin, end in sorted(ranges.tolist()):
        if found and begin <= found[-1][1]:
            found[-1] = found[-1][0], max(end, found[-1][1])
        else:
            found.append((begin, end))
    return found

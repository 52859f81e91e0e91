"""The short routes between two configurations are found here, region by region, over the places where regions overlap.

A route goes straight in q between the witnesses of overlaps, which are the centres of the largest balls in them. A curve through the same
regions is shorter, so the shortest routes are candidates, and nothing more.
"""

from __future__ import annotations

import heapq
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.distance import cdist

from certifier.model import Array

LONGEST = 1.2
"""No route is taken that is this many times as long as the shortest."""


@dataclass(frozen=True, eq=False)
class Links:
    """Holds the overlaps of a scene's regions, E of them.

    Attributes:
        ends: (E, 2) numbers of the two regions in the library.
        witness: (E, n) centre of the largest ball inside of both, in s.
        depth: (E,) its radius, in s.
        q: (E, n) the witnesses' joint positions.
    """

    ends: NDArray[np.intp]
    witness: Array
    depth: Array
    q: Array


@dataclass(frozen=True)
class Route:
    """A route names regions, each of which overlaps the next, and these overlaps: one less."""

    regions: tuple[int, ...]
    overlaps: tuple[int, ...]


@dataclass(frozen=True, eq=False)
class Terminal:
    """One end of a motion: the regions that it may begin or end in, and the configuration q, (n,); None for any of a region."""

    regions: Sequence[int]
    q: Array | None


def routes(links: Links, start: Terminal, goal: Terminal, most: int) -> list[Route]:
    """Returns the shortest routes through each overlap, the shortest first, without repeats, at most ``most``.

    None is longer than LONGEST times the shortest. Where one region has both ends, the routes are of one region each.
    """
    common = [region for region in start.regions if region in goal.regions]
    if common:
        return [Route((region,), ()) for region in common[:most]]
    ahead, came, limit = _sweep(links, start, goal, np.inf)
    behind, goes, _ = _sweep(links, goal, start, limit)
    # Entry 2e + k of the first is about going through overlap e into its end k; of the second, about coming out of it the other way.
    length = ahead + behind.reshape(-1, 2)[:, ::-1].ravel()
    found: dict[tuple[int, ...], Route] = {}
    for entry in np.argsort(length, kind="stable").tolist():
        if not np.isfinite(length[entry]) or len(found) == most:
            break
        entries = _chain(came, entry)[::-1] + [other ^ 1 for other in _chain(goes, entry ^ 1)[1:]]
        regions = (_into(links, entries[0] ^ 1), *(_into(links, each) for each in entries))
        if len(set(regions)) == len(regions):
            found.setdefault(regions, Route(regions, tuple(each // 2 for each in entries)))
    return list(found.values())


def _into(links: Links, entry: int) -> int:
    """Returns the region that an entry leads into."""
    return int(links.ends.flat[entry])


def _chain(before: NDArray[np.intp], entry: int) -> list[int]:
    """Returns an entry and those before it, back to the end that the sweep began at."""
    entries = [entry]
    while before[entries[-1]] >= 0:
        entries.append(int(before[entries[-1]]))
    return entries


def _sweep(links: Links, begin: Terminal, end: Terminal, limit: float) -> tuple[Array, NDArray[np.intp], float]:
    """Returns how far it is from one end of the motion through each overlap, both ways.

    Args:
        limit: no route that is longer is looked for, nor one longer than LONGEST times the shortest.

    Returns:
        The lengths in q, (2E,), infinite where no route leads: entry 2e + k is about going through overlap e into its end k. The entry
        before each, (2E,); -1 for none. And the least limit.
    """
    into = links.ends.ravel()
    order = np.argsort(into, kind="stable")
    regions, first = np.unique(into[order], return_index=True)
    entering = dict(zip(regions.tolist(), np.split(order, first)[1:], strict=True))
    to_begin, to_end = (np.repeat(_distance(links, terminal), 2) for terminal in (begin, end))
    last = np.isin(into, end.regions)
    length, before = np.full(len(into), np.inf), np.full(len(into), -1)
    heap: list[tuple[float, int]] = []

    def reach(entries: NDArray[np.intp], lengths: Array, sources: NDArray[np.intp] | int) -> float:
        """Takes shorter ways to entries, and returns the least limit."""
        least = lengths + to_end[entries]
        better = (lengths < length[entries]) & (least <= limit)
        entries, least = entries[better], least[better]
        length[entries], before[entries] = lengths[better], np.broadcast_to(sources, better.shape)[better]
        nearest: dict[int, float] = {}
        for region, reached in zip(into[entries].tolist(), least.tolist(), strict=True):
            nearest[region] = min(reached, nearest.get(region, np.inf))
        for region, reached in nearest.items():
            heapq.heappush(heap, (reached, region))
        return min(limit, LONGEST * float(least[last[entries]].min(initial=np.inf)))

    for region in begin.regions:
        leaving = entering.get(region, order[:0]) ^ 1
        limit = reach(leaving, to_begin[leaving], -1)
    swept: dict[int, float] = {}
    while heap and heap[0][0] <= limit:
        region = heapq.heappop(heap)[1]
        entries = entering[region]
        # A region is gone through again where an entry of it has become shorter since it was.
        total = float(length[entries].sum(where=np.isfinite(length[entries])))
        if swept.get(region) == total:
            continue
        swept[region] = total
        places = links.q[entries // 2]
        lengths = length[entries][:, None] + cdist(places, places)
        np.fill_diagonal(lengths, np.inf)  # in and out through the same overlap
        source = lengths.argmin(axis=0)
        limit = reach(entries ^ 1, lengths[source, np.arange(len(entries))], entries[source])
    return length, before, limit


def _distance(links: Links, terminal: Terminal) -> Array:
    """Returns the distance in q of each witness to an end of the motion, (E,); 0 where that may be any point of a region."""
    return np.zeros(len(links.q)) if terminal.q is None else np.linalg.norm(links.q - terminal.q, axis=1)

"""A path of waypoints is covered here: segment by segment, until its end or until a point that no region is proved to contain."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from itertools import pairwise

import numpy as np

from certifier.model import Array, Scene
from planner.library import Library
from planner.membership import locate, to_s
from planner.motion.cover import cover
from planner.motion.straight_q import StraightInQ
from planner.motion.straight_s import StraightInS
from planner.nearest import Nearest, nearest


class Space(StrEnum):
    """Names the coordinates in which a motion is straight between two waypoints."""

    Q = "q"
    """Joint positions, in radians or metres."""
    S = "s"
    """Tangent-space coordinates."""


@dataclass(frozen=True)
class Stretch:
    """Says that a region contains all of the path from begin to end, in the unit of the path's times."""

    begin: float
    end: float
    region: int


@dataclass(frozen=True)
class Uncovered:
    """Describes where a path stops being covered.

    Attributes:
        time: the path is covered up to here. What follows, or this very point, is not proved to be in any region.
        segment: number of the segment, from 0 on.
        q: (n,) the configuration at that time.
        s: (n,) the same in s; None where a joint is outside its limits or its window.
        next: the nearest region that does not contain this configuration; None where there is none, or no s.
    """

    time: float
    segment: int
    q: Array
    s: Array | None
    next: Nearest | None


@dataclass(frozen=True)
class Covering:
    """Says how much of a path is covered: the stretches in order, and where they stop, if that is not the path's end."""

    stretches: tuple[Stretch, ...]
    uncovered: Uncovered | None


def follow(library: Library, scene: Scene, space: Space, waypoints: Array, times: Sequence[float]) -> Covering:
    """Covers a path with certified regions.

    Args:
        waypoints: (k, n), k >= 2, in the coordinates of ``space``, in which the path is straight between them. The doubles are taken
            literally.
        times: k ascending numbers, when the path is at each waypoint. They only name the points of the path.
    """
    stretches: list[Stretch] = []
    for i, (a, b) in enumerate(pairwise(waypoints)):
        last = stretches[-1].region if stretches else None
        line = StraightInS(library, a, b) if space is Space.S else StraightInQ(library, scene, a, b, last)
        found = cover(line)
        for piece in found.pieces:
            begin, end = (_time(times[i], times[i + 1], t) for t in (piece.begin, piece.end))
            if stretches and stretches[-1].region == piece.region:
                stretches[-1] = replace(stretches[-1], end=end)
            else:
                stretches.append(Stretch(begin, end, piece.region))
        if found.uncovered is not None:
            time, point = _time(times[i], times[i + 1], found.uncovered), a + found.uncovered * (b - a)
            held = {stretches[-1].region} if stretches else set()
            return Covering(tuple(stretches), _uncovered(library, scene, space, time, i, point, held))
    return Covering(tuple(stretches), None)


def _time(begin: float, end: float, t: float) -> float:
    return end if t == 1 else begin + t * (end - begin)


def _uncovered(library: Library, scene: Scene, space: Space, time: float, segment: int, point: Array, held: set[int]) -> Uncovered:
    if space is Space.S:
        q, s = scene.to_q(point), point
    else:
        q, s = point, to_s(scene, point[None])[0]
        if not np.isfinite(s).all():
            return Uncovered(time, segment, q, None, None)
    without = held | set(locate(library, s[None]).region.tolist())
    return Uncovered(time, segment, q, s, nearest(library, s, without))

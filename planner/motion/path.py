"""A path is covered here: segment by segment, until its end or until a point that no region is proved to contain."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from certifier.model import Array, Scene
from certifier.positions import check_magnitude
from ciris.free_set import FreeSet
from planner.library import Library
from planner.membership import locate, to_s
from planner.motion.beside import Beside
from planner.motion.cover import Cover, Line, Piece, cover
from planner.motion.curve import Curve, at
from planner.motion.space import Space
from planner.motion.straight_s import StraightInS
from planner.nearest import Nearest, nearest
from planner.tubes import Tubes


@dataclass(frozen=True)
class Stretch:
    """Says that a region contains all of the path from begin to end, in the unit of the path's times.

    From the number of regions on, ``region`` counts the motions whose tubes contain it; the number after them is the map's.
    """

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


def follow(
    library: Library,
    scene: Scene,
    space: Space,
    controls: Array,
    times: Sequence[float],
    degree: int = 1,
    tubes: Tubes | None = None,
    free: FreeSet | None = None,
) -> Covering:
    """Covers a path with certified regions, and where it is straight in q with the tubes of proved motions and with a map's free set.

    A segment that the map covers from end to end is the map's. Elsewhere it is the region, the tube or the map that goes on for longest.

    Args:
        controls: (k m + 1, n), k >= 1, in the coordinates of ``space``: control points of k segments of degree m. Those of segment i are
            from number i m to (i + 1) m. Of degree 1 they are waypoints, between which the path is straight. The doubles are taken
            literally.
        times: k + 1 ascending numbers, when the path is where segments begin and end. They only name the points of the path.

    Raises:
        RegionError: number_too_large, for a control point.
    """
    check_magnitude(controls, "controls")
    straight = degree == 1
    if not straight or space is Space.S:
        tubes = free = None
    by_map = np.zeros(len(controls), bool) if free is None else free.contains_motion(controls[:-1], controls[1:])
    the_map = len(library) + (0 if tubes is None else len(tubes))
    stretches: list[Stretch] = []
    for i in range((len(controls) - 1) // degree):
        segment = controls[i * degree : (i + 1) * degree + 1]
        last = stretches[-1].region if stretches and stretches[-1].region < len(library) else None
        if by_map[i]:
            found = Cover((Piece(0.0, 1.0, the_map),), None)
        else:
            line: Line = StraightInS(library, *segment) if straight and space is Space.S else Curve(library, scene, space, segment, last)
            found = cover(Beside(line, tubes, free, len(library), *segment) if straight and space is Space.Q else line)
        for piece in found.pieces:
            begin, end = (_time(times[i], times[i + 1], t) for t in (piece.begin, piece.end))
            if stretches and stretches[-1].region == piece.region:
                stretches[-1] = replace(stretches[-1], end=end)
            else:
                stretches.append(Stretch(begin, end, piece.region))
        if found.uncovered is not None:
            time, point = _time(times[i], times[i + 1], found.uncovered), at(segment, found.uncovered)
            held = {region for region in (stretches[-1].region,) if region < len(library)} if stretches else set()
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

"""A trajectory is planned here: along the straight line where that is covered, or else along a short route through the regions.

Where a curve goes is Drake's word, in floating point. What is returned is checked like anybody's path: every straight line between two of
its configurations is proved to be in certified regions (:mod:`planner.motion`), or nothing is returned.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from certifier.model import Array, Polytope, Scene
from planner.library import Library
from planner.membership import locate, to_s
from planner.motion.path import Stretch, Uncovered, follow
from planner.motion.space import Space
from planner.nearest import project
from planner.overlap import Gap, components, gap
from planner.trajectory.routes import Links, Route, Terminal, routes
from planner.trajectory.stretch import stretched

SPEED, ACCELERATION = 1.0, 2.0
"""Limits of every joint where nobody gives others, in rad/s and rad/s² (or m/s and m/s²)."""
ROUTES = 5
"""Number of routes for which curves are made; the shortest curve counts."""
MARGIN = 1e-3
"""A curve keeps this far, in s, from the faces of its regions, or a quarter of the depth of its overlaps where that is less."""
FINENESS = ({"steps": 24, "spacing": 0.05}, {"steps": 96, "spacing": 0.0125})
"""In how many steps a curve is looked at in each region, and how far a joint moves between two configurations of an answer, in radians or
metres. The second is tried when the result of the first was not covered.
"""

Optimise = Callable[[dict[str, Any]], dict[str, Any] | None]
"""This is :func:`planner.trajectory.curve.optimised`, in whatever process Drake is."""


@dataclass(frozen=True, eq=False)
class Limits:
    """What each joint may do: speed (n,), in rad/s or m/s, and acceleration (n,), in rad/s² or m/s²; all positive."""

    speed: Array
    acceleration: Array


@dataclass(frozen=True, eq=False)
class Trajectory:
    """A covered trajectory, straight in q between its configurations.

    Attributes:
        q: (k, n) configurations, k >= 2, the ends among them.
        t: (k,) seconds, ascending from 0; all 0 where the two ends are the same.
        stretches: the regions that contain it, in order, in seconds.
    """

    q: Array
    t: Array
    stretches: tuple[Stretch, ...]

    @property
    def length(self) -> float:
        """Returns the length in q: of the vector of all joint positions, in radians (and metres)."""
        return float(np.linalg.norm(np.diff(self.q, axis=0), axis=1).sum())


@dataclass(frozen=True)
class Outside:
    """No region contains an end of the motion: s, (n,); None where a joint is outside its limits."""

    end: str
    s: Array | None


@dataclass(frozen=True)
class Apart:
    """The two ends are in components that no known overlap joins.

    Attributes:
        start: number of regions of the component of the start.
        goal: the same of the goal.
        gap: where these two components come nearest to each other; ``a`` is of the start's.
    """

    start: int
    goal: int
    gap: Gap


@dataclass(frozen=True)
class Unproved:
    """There are routes, but no trajectory along them was found that is proved to be covered; ``uncovered`` says where the last was not."""

    uncovered: Uncovered | None


Answer = Trajectory | Outside | Apart | Unproved


def plan(library: Library, scene: Scene, links: Links, start: Array | int, goal: Array | int, limits: Limits, optimise: Optimise) -> Answer:
    """Returns a trajectory from rest to rest, or why there is none.

    Args:
        start, goal: a configuration (n,), or a region's number: any of its configurations then. A joint that turns a whole turn and more
            goes to the goal's pose in the turn that it starts in.
    """
    if isinstance(start, int) and isinstance(goal, int) and start == goal:
        start = scene.to_q(inner(library, start))
    first, last = (_terminal(library, scene, end) for end in (start, goal))
    for name, given, end in (("start", start, first), ("goal", goal, last)):
        if not end.regions and not isinstance(given, int):
            s = to_s(scene, given[None])[0]
            return Outside(name, s if np.isfinite(s).all() else None)
    turns = np.zeros(scene.n) if isinstance(start, int) else start - scene.in_windows(start)

    def tried(task: dict[str, Any]) -> Trajectory | Unproved:
        """Returns what Drake makes of a task, if that is covered."""
        arm = {"q_star": scene.q_star, "revolute": scene.revolute}
        found = optimise({**task, **arm, "speed": limits.speed, "acceleration": limits.acceleration})
        if found is None:
            return Unproved(None)
        q, t = found["q"], found["t"]
        for place, end in ((0, first), (-1, last)):
            if end.q is not None:
                q[slice(None) if t[-1] == 0 else place] = end.q
        q = q + turns
        if not isinstance(start, int):
            q[slice(None) if t[-1] == 0 else 0] = start
        t = stretched(q, t, limits.speed, limits.acceleration)  # far from q* the turns have rounded the differences
        covering = follow(library, scene, Space.Q, q, t.tolist())
        return Trajectory(q, t, covering.stretches) if covering.uncovered is None else Unproved(covering.uncovered)

    line = _straight(library, scene, first, last)
    if line is not None:
        found = tried({"line": line, **FINENESS[0]})
        if isinstance(found, Trajectory):
            return found
    ways = routes(links, first, last, ROUTES)
    if not ways:
        return _apart(library, links, first, last)
    task = _through(library, scene, links, ways, first, last)
    coarse = tried({**task, **FINENESS[0]})
    return coarse if isinstance(coarse, Trajectory) else tried({**task, **FINENESS[1]})


def _terminal(library: Library, scene: Scene, end: Array | int) -> Terminal:
    if isinstance(end, int):
        return Terminal([end], None)
    return Terminal(locate(library, to_s(scene, end[None])).region.tolist(), scene.in_windows(end))


def _straight(library: Library, scene: Scene, start: Terminal, goal: Terminal) -> Array | None:
    """Returns the straight line in q, (2, n), if it is covered: nothing is shorter."""
    if start.q is None or goal.q is None:
        return None
    line = np.stack([start.q, goal.q])
    return line if follow(library, scene, Space.Q, line, [0.0, 1.0]).uncovered is None else None


def _through(library: Library, scene: Scene, links: Links, ways: Sequence[Route], start: Terminal, goal: Terminal) -> dict[str, Any]:
    """Returns the task of going along one of several routes."""
    s = [None if end.q is None else scene.to_s(end.q) for end in (start, goal)]
    depths = [links.depth[overlap] for route in ways for overlap in route.overlaps]
    margin = min([MARGIN, *(depth / 4 for depth in depths)])
    used = sorted({region for route in ways for region in route.regions})
    return {
        "polytopes": [vars(_moved_in(library, region, margin, [x for x in s if x is not None])) for region in used],
        "routes": [
            {"regions": [used.index(region) for region in route.regions], "via": links.witness[list(route.overlaps)]} for route in ways
        ],
        "start": s[0],
        "goal": s[1],
    }


def _moved_in(library: Library, region: int, margin: float, keep: Sequence[Array]) -> Polytope:
    """Returns a region with its faces moved in by the margin, in s, but no farther than to the points ``keep`` that it contains."""
    polytope, norms = library.polytope(region), library.norms[library.rows(region)]
    C, d = polytope.C / norms[:, None], polytope.d / norms
    inner = d - margin
    for s in keep:
        if (C @ s <= d).all():
            inner = np.maximum(inner, C @ s)
    return Polytope(C, inner)


def inner(library: Library, region: int) -> Array:
    """Returns a point (n,) of a region, in s."""
    polytope, norms = library.polytope(region), library.norms[library.rows(region)]
    point = project(polytope.C / norms[:, None], polytope.d / norms, (library.lower[region] + library.upper[region]) / 2)
    assert point is not None, "a certified region has room for a ball"
    return point


def _apart(library: Library, links: Links, start: Terminal, goal: Terminal) -> Apart:
    """Says of the components of the ends that lie nearest to each other how far apart they are."""
    parts = components(len(library), [(a, b) for a, b in links.ends.tolist()])
    of_start = [part for part in parts if set(part) & set(start.regions)]
    of_goal = [part for part in parts if set(part) & set(goal.regions)]
    apart = [Apart(len(a), len(b), near) for a in of_start for b in of_goal if (near := gap(library, a, b)) is not None]
    return min(apart, key=lambda found: found.gap.distance)

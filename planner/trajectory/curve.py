"""Drake makes curves of routes here, and trajectories of curves. Only a child process loads this module, because it loads Drake.

The regions of a route are known, so of a graph of convex sets (Marcucci et al., Motion Planning around Obstacles with Convex
Optimization) one convex program is left: a Bézier curve in s for each region, whose control points are in the region, so all of it is.
Consecutive curves have the same velocity where they meet.

What is minimised is the length of the control polygon, each joint weighed by dq/ds where the curve is in the region, so that it is near
the length in q. The length alone would bunch control points at corners, where the robot had to stop; the sum of squares of the polygon's
edges keeps them apart.
"""

from __future__ import annotations

import logging
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydrake.geometry.optimization import GraphOfConvexSetsOptions, HPolyhedron, Point
from pydrake.planning import GcsTrajectoryOptimization
from pydrake.solvers import ClarabelSolver
from pydrake.trajectories import CompositeTrajectory

from certifier.coordinates import ConfigurationSpace
from certifier.model import Array
from planner.trajectory.timing import STILL, length, timed

ORDER = 3
"""Order of the Bézier curves. Three is the least at which a curve can have given velocities at both ends."""
EVEN = 1.0
"""Weight of the squares of the control polygon's edges, beside their lengths."""
NEAREST = 2
"""Number of faces for each joint, the nearest to a place of the route, that are in the first program."""
BEYOND = 1e-7
"""A control point that is so far beyond a face, in s, is beyond it; the solver is that exact."""
STRAIGHT = 65
"""Number of points at which a straight line is looked at."""

logging.getLogger("drake").setLevel(logging.WARNING)


def optimised(payload: dict[str, Any]) -> dict[str, Any] | None:
    """Returns a timed trajectory: ``q`` (k, n) and ``t`` (k,); None where Drake finds none. A child process runs this function.

    Args:
        payload: either ``line`` (2, n), to be followed straight in q; or ``routes``, each with the numbers of its ``regions`` among the
            ``polytopes``, C (m, n) and d (m,), the rows of C of length 1, and points ``via`` in the overlaps of consecutive ones; with
            ``start`` and ``goal`` in s, (n,), or None for any point. Always ``q_star`` and ``revolute`` of the arm, ``speed`` and
            ``acceleration``, (n,) each, ``steps``: in how many a curve is looked at in each region, and ``spacing``: how far a joint may
            move between two configurations.
    """
    curve = _straight(payload["line"]) if "line" in payload else _shortest(payload)
    if curve is None:
        return None
    # Where the curve goes from one region into the next, there may be little room: no chord may cut that corner.
    through = list(range(payload["steps"], len(curve) - 1, payload["steps"])) if "routes" in payload else []
    trajectory = timed(curve, through, payload["speed"], payload["acceleration"], payload["spacing"])
    return None if trajectory is None else {"q": trajectory[0], "t": trajectory[1]}


def _straight(line: Array) -> Array:
    part = np.linspace(0, 1, STRAIGHT)[:, None]
    return (1 - part) * line[0] + part * line[1]


def _shortest(payload: dict[str, Any]) -> Array | None:
    """Returns points of the shortest curve of all routes, (m, n), in q; None where no route has one."""
    curves = [curve for route in payload["routes"] if (curve := _Curve(route, payload)).improve()]
    if not curves:
        return None
    best = min(curves, key=lambda curve: length(curve.points()))
    best.improve()
    points = best.points()
    if length(points) <= STILL and (payload["start"] is None or payload["goal"] is None):
        return points[[-1 if payload["start"] is None else 0]]  # the end that is free is where the other one is
    return points


class _Curve:
    """The curve of a route. Its weights are those of where the route goes, and when it is improved, of where the curve itself goes.

    Most faces of the regions are far from the curve. So the program begins with those that are nearest to the places of the route, and
    those that a control point is beyond are added, until there are none.
    """

    def __init__(self, route: dict[str, Any], payload: dict[str, Any]) -> None:
        self._payload, self._space = payload, ConfigurationSpace(payload["q_star"], payload["revolute"])
        self._polytopes = [payload["polytopes"][region] for region in route["regions"]]
        self._start, self._goal = payload["start"], payload["goal"]
        first, *between = [s for s in (self._start, *route["via"], self._goal) if s is not None]
        last = between[-1] if between else first
        places = [first, *route["via"], last]
        self._middles = [(a + b) / 2 for a, b in pairwise(places)]
        self._faces = [_nearest(polytope, ends) for polytope, ends in zip(self._polytopes, pairwise(places), strict=True)]
        self._path: CompositeTrajectory | None = None

    def improve(self) -> bool:
        """Finds the curve with its present weights. Returns whether there is one, now or from before."""
        path = self._found()
        if path is not None:
            self._path, self._middles = path, [path.value(i + 0.5)[:, 0] for i in range(len(self._polytopes))]
        return self._path is not None

    def points(self) -> Array:
        """Returns points of the curve, (m, n), in q."""
        assert self._path is not None
        u = np.linspace(0, len(self._polytopes), self._payload["steps"] * len(self._polytopes) + 1)
        return self._space.to_q(self._path.vector_values(u).T)

    def _found(self) -> CompositeTrajectory | None:
        """Returns the shortest curve in s, with a parameter of 1 in each region; None where there is none."""
        while (path := self._solved()) is not None:
            beyond = [
                (polytope["C"] @ path.segment(i).control_points() > polytope["d"][:, None] + BEYOND).any(axis=1) & ~self._faces[i]
                for i, polytope in enumerate(self._polytopes)
            ]
            if not any(faces.any() for faces in beyond):
                return path
            self._faces = [known | more for known, more in zip(self._faces, beyond, strict=True)]
        return None

    def _solved(self) -> CompositeTrajectory | None:
        """Returns the shortest curve in s within the faces so far."""
        program = GcsTrajectoryOptimization(len(self._middles[0]))
        chain = []
        for polytope, faces, middle in zip(self._polytopes, self._faces, self._middles, strict=True):
            inside = program.AddRegions([HPolyhedron(polytope["C"][faces], polytope["d"][faces])], [], ORDER, h_min=1.0, h_max=1.0)
            weight = np.diag(self._space.slope(middle))
            inside.AddPathLengthCost(weight)
            inside.AddPathEnergyCost(EVEN * weight)
            chain.append(inside)
        before, behind = (
            [] if s is None else [program.AddRegions([Point(s)], [], 0, h_min=0.0, h_max=0.0)] for s in (self._start, self._goal)
        )
        chain = [*before, *chain, *behind]
        for one, following in pairwise(chain):
            program.AddEdges(one, following, edges_between_regions=[(0, 0)])
        program.AddPathContinuityConstraints(1)
        options = GraphOfConvexSetsOptions()
        options.restriction_solver = ClarabelSolver()
        path, result = program.SolveConvexRestriction([part.Vertices()[0] for part in chain], options)
        return program.NormalizeSegmentTimes(path) if result.is_success() else None


def _nearest(polytope: dict[str, Array], ends: tuple[Array, Array]) -> NDArray[np.bool_]:
    """Returns which faces of a region, (m,), are among the nearest to where a route enters it, where it leaves it, or to midway."""
    chosen = np.zeros(len(polytope["d"]), dtype=bool)
    for s in (ends[0], (ends[0] + ends[1]) / 2, ends[1]):
        chosen[np.argsort(polytope["d"] - polytope["C"] @ s)[: NEAREST * len(s)]] = True
    return chosen


def warm_up() -> None:
    """Loads what the first curve needs, by making one around a corner."""
    eye = np.eye(2)
    corridors = [{"C": np.concatenate([eye, -eye]), "d": np.array(d)} for d in ([1.0, 0.2, 0.0, 0.0], [1.0, 1.0, -0.8, 0.0])]
    ends = {"start": np.array([0.1, 0.1]), "goal": np.array([0.9, 0.9])}
    arm = {"q_star": np.zeros(2), "revolute": np.ones(2, dtype=bool), "speed": np.ones(2), "acceleration": np.ones(2)}
    route = {"regions": [0, 1], "via": np.array([[0.9, 0.1]])}
    optimised({"polytopes": corridors, "routes": [route], **ends, **arm, "steps": 24, "spacing": 0.05})

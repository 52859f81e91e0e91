"""Drake makes curves of routes here, and trajectories of curves. Only a child process loads this module, because it loads Drake.

The regions of a route are known, so of a graph of convex sets (Marcucci et al., Motion Planning around Obstacles with Convex
Optimization) one convex program is left: a Bézier curve in s for each region, whose control points are in the region, so all of it is.
Consecutive curves have the same velocity where they meet.

What is minimised is the length of the control polygon, each joint weighed by dq/ds where the route is in the region, so that it is near
the length in q. The length alone would bunch control points at corners, where the robot had to stop; the sum of squares of the polygon's
edges keeps them apart.
"""

from __future__ import annotations

import logging
from itertools import pairwise
from typing import Any

import numpy as np
from pydrake.geometry.optimization import GraphOfConvexSetsOptions, HPolyhedron, Point
from pydrake.planning import GcsTrajectoryOptimization
from pydrake.solvers import ClarabelSolver
from pydrake.trajectories import CompositeTrajectory

from certifier.model import Array
from planner.trajectory.timing import STILL, length, timed

ORDER = 3
"""Order of the Bézier curves. Three is the least at which a curve can have given velocities at both ends."""
EVEN = 1.0
"""Weight of the squares of the control polygon's edges, beside their lengths."""
STRAIGHT = 65
"""A straight line is looked at in so many points."""

logging.getLogger("drake").setLevel(logging.WARNING)


def optimised(payload: dict[str, Any]) -> dict[str, Any] | None:
    """Returns a timed trajectory: ``q`` (k, n) and ``t`` (k,); None where Drake finds none. A child process runs this function.

    Args:
        payload: either ``line`` (2, n), to be followed straight in q; or ``routes``, each with the ``polytopes`` of its regions, C (m, n)
            and d (m,), and points ``via`` in the overlaps of consecutive ones, with ``start`` and ``goal`` in s, (n,), or None for any
            point. Always ``q_star`` and ``revolute`` of the arm, ``speed`` and ``acceleration``, (n,) each, ``steps``: in how many a curve
            is looked at in each region, and ``spacing``: how far a joint may move between two configurations.
    """
    if "line" in payload:
        part = np.linspace(0, 1, STRAIGHT)[:, None]
        curve = (1 - part) * payload["line"][0] + part * payload["line"][1]
    else:
        curves = [found for route in payload["routes"] if (found := _through(route, payload)) is not None]
        if not curves:
            return None
        curve = min(curves, key=length)
        if length(curve) <= STILL and (payload["start"] is None or payload["goal"] is None):
            curve = curve[[-1 if payload["start"] is None else 0]]  # the end that is free is where the other one is
    trajectory = timed(curve, payload["speed"], payload["acceleration"], payload["spacing"])
    return None if trajectory is None else {"q": trajectory[0], "t": trajectory[1]}


def _through(route: dict[str, Any], payload: dict[str, Any]) -> Array | None:
    """Returns points of the curve of a route, (m, n), in q. It is found twice, the second time with weights of where the first one goes."""
    start, goal, via = payload["start"], payload["goal"], list(route["via"])
    known = [*([] if start is None else [start]), *via, *([] if goal is None else [goal])]
    places = [known[0] if start is None else start, *via, known[-1] if goal is None else goal]
    middles = [(a + b) / 2 for a, b in pairwise(places)]

    def shortest() -> CompositeTrajectory | None:
        return _shortest(route["polytopes"], [_slope(s, payload["revolute"]) for s in middles], start, goal)

    first = shortest()
    if first is None:
        return None
    middles = [first.value(i + 0.5)[:, 0] for i in range(len(middles))]
    path = shortest() or first
    s = path.vector_values(np.linspace(path.start_time(), path.end_time(), payload["steps"] * len(middles) + 1)).T
    return np.array(payload["q_star"] + np.where(payload["revolute"], 2 * np.arctan(s), s))


def _shortest(
    polytopes: list[dict[str, Array]], weights: list[Array], start: Array | None, goal: Array | None
) -> CompositeTrajectory | None:
    """Returns the shortest curve in s through the polytopes, with a parameter of 1 in each; None where there is none."""
    program = GcsTrajectoryOptimization(len(weights[0]))
    chain = []
    for polytope, weight in zip(polytopes, weights, strict=True):
        inside = program.AddRegions([HPolyhedron(polytope["C"], polytope["d"])], [], ORDER, h_min=1.0, h_max=1.0)
        inside.AddPathLengthCost(np.diag(weight))
        inside.AddPathEnergyCost(EVEN * np.diag(weight))
        chain.append(inside)
    for s, place in ((start, 0), (goal, len(chain) + 1)):
        if s is not None:
            chain.insert(place, program.AddRegions([Point(s)], [], 0, h_min=0.0, h_max=0.0))
    for one, next_one in pairwise(chain):
        program.AddEdges(one, next_one, edges_between_regions=[(0, 0)])
    program.AddPathContinuityConstraints(1)
    options = GraphOfConvexSetsOptions()
    options.restriction_solver = ClarabelSolver()
    path, result = program.SolveConvexRestriction([part.Vertices()[0] for part in chain], options)
    return program.NormalizeSegmentTimes(path) if result.is_success() else None


def _slope(s: Array, revolute: Array) -> Array:
    """Returns dq/ds at s, (..., n)."""
    return np.where(revolute, 2 / (1 + s**2), 1.0)

"""OMPL as people use it: RRT-Connect, then its simplifier, with Drake's checker at samples of each straight line.

Drake knows no conditions, so the checker asks the pairs that stand for these, at the same samples. It stands beside our planner in
``ciris bench plan``. What lies between the samples is not known.
"""

from __future__ import annotations

import time
from dataclasses import replace

import numpy as np
from ompl import geometric, util

from certifier.collisions.free import free_at
from certifier.collisions.seen import seen_of
from certifier.conditioned import condition_of, without_conditions
from certifier.model import Array, Scene
from certifier.motion.bodies import bodies_of
from certifier.seeding.drake_iris import checker
from planner.sampling.search import positions, space_of, state_of

RESOLUTION = 0.05
"""A straight line is looked at in steps of at most this length in q, in radians and metres: 2.9 degrees where one joint turns."""
util.setLogLevel(util.LOG_ERROR)


class Ompl:
    """Plans in a scene, within its joint limits."""

    def __init__(self, scene: Scene) -> None:
        self._checker = checker(without_conditions(scene))
        alone = replace(scene, pairs=tuple(pair for pair in scene.pairs if condition_of(scene, pair)))
        self._conditions = (bodies_of(alone), seen_of(alone)) if alone.pairs else None
        self._order = np.arange(len(alone.pairs))
        self._setup = geometric.SimpleSetup(space_of(scene.q_lower, scene.q_upper))
        self._space = self._setup.getSpaceInformation()
        self._setup.setStateValidityChecker(lambda state: self._holds(positions(state, scene.n)))
        self._space.setStateValidityCheckingResolution(RESOLUTION / self._space.getMaximumExtent())

    def _holds(self, q: Array) -> bool:
        """Says whether nothing collides at joint positions q, (n,), and each condition is kept."""
        return self._keeps(q) and self._checker.CheckConfigCollisionFree(q)

    def _keeps(self, q: Array) -> bool:
        return self._conditions is None or bool(free_at(*self._conditions, q, self._order))

    def plan(self, start: Array, goal: Array, seconds: float) -> tuple[Array | None, float]:
        """Returns a path, (k, n), between two free configurations, or None where none was found in time; and the seconds that it took."""
        begin = time.perf_counter()
        self._setup.clear()
        self._setup.setStartAndGoalStates(state_of(self._space, start), state_of(self._space, goal))
        self._setup.setPlanner(geometric.RRTConnect(self._space))
        self._setup.solve(seconds)
        if not self._setup.haveExactSolutionPath():
            return None, time.perf_counter() - begin
        self._setup.simplifySolution()
        path = np.array([positions(state, len(start)) for state in self._setup.getSolutionPath().getStates()])
        return path, time.perf_counter() - begin

    def fails(self, path: Array, points: int) -> bool:
        """Says whether Drake finds a collision, or a condition is not kept, at one of this many points along a path, (k, n)."""
        along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(path, axis=0), axis=1))])
        at = np.linspace(0.0, along[-1], points)
        q = np.column_stack([np.interp(at, along, joint) for joint in path.T])
        return not (all(map(self._keeps, q)) and all(self._checker.CheckConfigsCollisionFree(list(q))))

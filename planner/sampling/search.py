"""OMPL searches here for a path between configurations. Only a child process loads this module, because it loads OMPL.

RRT-Connect (Kuffner and LaValle, ICRA 2000) finds a path, and OMPL's simplifier shortens it. Both ask whether straight lines in q are free
of collisions; certifier.collisions.free answers for all of a line, so nothing is missed between samples.
"""

from __future__ import annotations

import time

import numpy as np
from ompl import base, geometric, util

from certifier.collisions.bodies import bodies_of
from certifier.collisions.free import CLOSE, free_along, free_at
from certifier.model import Array, Scene

STEP, PART = 1.0, 0.05
"""A tree grows by steps of at most this length in q, in radians and metres, or of this part of the box' diagonal where that is more."""

util.setLogLevel(util.LOG_ERROR)
util.RNG.setSeed(1)  # the same question has the same answer, as far as time allows


class Search:
    """Searches in the joint space of a scene.

    Args:
        lower, upper: (n,) the box of joint positions that it stays in, radians or metres.
        padding: metres that are added around every body, beyond the scene's padding.
    """

    def __init__(self, scene: Scene, lower: Array, upper: Array, padding: float = 0.0) -> None:
        self._bodies, self._n = bodies_of(scene, padding), scene.n
        self._order = np.arange(len(self._bodies.pairs))
        space = base.RealVectorStateSpace()
        for bounds in zip(lower.tolist(), upper.tolist(), strict=True):
            space.addDimension(*bounds)
        self._space = base.SpaceInformation(space)
        self._space.setStateValidityChecker(lambda state: self.is_free(self._q(state)))
        self._space.setMotionValidator(_Lines(self._space, self))
        self._space.setup()

    def is_free(self, q: Array) -> bool:
        """Says whether no pair touches at joint positions q, (n,)."""
        return bool(free_at(self._bodies, q, self._order))

    def sees(self, a: Array, b: Array) -> bool:
        """Says whether no pair touches on the straight line in q from a to b, (n,) each."""
        return bool(free_along(self._bodies, a, b, self._order, CLOSE))

    def path(self, start: Array, goal: Array, until: float) -> Array | None:
        """Returns a path, (k, n), straight in q between its rows and free of collisions; None where none was found in time.

        Args:
            start, goal: (n,) free joint positions in the box.
            until: when to give up, as time.monotonic() tells it.
        """
        if self.sees(start, goal):
            return np.array([start, goal])
        in_time = base.PlannerTerminationCondition(lambda: time.monotonic() > until)
        asked = base.ProblemDefinition(self._space)
        asked.setStartAndGoalStates(self._state(start), self._state(goal))
        planner = geometric.RRTConnect(self._space)
        planner.setRange(max(STEP, PART * self._space.getMaximumExtent()))
        planner.setProblemDefinition(asked)
        planner.setup()
        planner.solve(in_time)
        if not asked.hasExactSolution():
            return None
        found = asked.getSolutionPath()
        geometric.PathSimplifier(self._space).simplify(found, in_time)
        points = np.array([self._q(state) for state in found.getStates()])
        points[0], points[-1] = start, goal
        return points

    def _state(self, q: Array) -> base.State:
        state = self._space.allocState()
        state[0 : self._n] = q.tolist()
        return state

    def _q(self, state: base.State) -> Array:
        return np.array(state[0 : self._n])


class _Lines(base.MotionValidator):
    """Answers OMPL's question whether a straight line is free."""

    def __init__(self, space: base.SpaceInformation, search: Search) -> None:
        super().__init__(space)
        self._search = search

    def checkMotion(self, a: base.State, b: base.State) -> bool:
        return self._search.sees(self._search._q(a), self._search._q(b))

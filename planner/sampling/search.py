"""OMPL searches here for a path between configurations. Only a child process loads this module, because it loads OMPL.

RRT-Connect (Kuffner and LaValle, ICRA 2000) finds a path, and OMPL's simplifier shortens it. Both ask whether straight lines in q are free
of collisions; certifier.collisions.free answers for all of a line, so nothing is missed between samples.
"""

from __future__ import annotations

import time

import numpy as np
from ompl import base, geometric, util

from certifier.collisions.free import CLOSE, free_along, free_at
from certifier.collisions.seen import seen_of
from certifier.model import Array, Scene
from certifier.motion.bodies import bodies_of

STEP, PART = 1.0, 0.05
"""A tree grows by steps of at most this length in q, in radians and metres, or of this part of the box' diagonal where that is more."""

util.setLogLevel(util.LOG_ERROR)
util.RNG.setSeed(1)  # the same question has the same answer, as far as time allows


def space_of(lower: Array, upper: Array) -> base.RealVectorStateSpace:
    """Returns OMPL's space of the joint positions between two, (n,) each."""
    space = base.RealVectorStateSpace()
    for bounds in zip(lower.tolist(), upper.tolist(), strict=True):
        space.addDimension(*bounds)
    return space


def state_of(space: base.SpaceInformation, q: Array) -> base.State:
    """Returns OMPL's state of joint positions, (n,)."""
    state = space.allocState()
    state[0 : len(q)] = q.tolist()
    return state


def positions(state: base.State, n: int) -> Array:
    """Returns the joint positions of a state, (n,)."""
    return np.array(state[0:n])


class Search:
    """Searches in the joint space of a scene.

    Args:
        lower, upper: (n,) the box of joint positions that it stays in, radians or metres.
        padding: metres that are added around every body, beyond the scene's padding.
    """

    def __init__(self, scene: Scene, lower: Array, upper: Array, padding: float = 0.0) -> None:
        self._bodies, self._seen = bodies_of(scene), seen_of(scene, padding)
        self._order, self._box = np.arange(len(scene.pairs)), (lower, upper)

    def is_free(self, q: Array) -> bool:
        """Says whether no pair touches at joint positions q, (n,)."""
        return bool(free_at(self._bodies, self._seen, q, self._order))

    def sees(self, a: Array, b: Array) -> bool:
        """Says whether no pair touches on the straight line in q from a to b, (n,) each."""
        return bool(free_along(self._bodies, self._seen, a, b, self._order, CLOSE))

    def path(self, start: Array, goal: Array, until: float) -> Array | None:
        """Returns a path, (k, n), straight in q between its rows and free of collisions; None where none was found in time.

        Args:
            start, goal: (n,) free joint positions in the box.
            until: when to give up, as time.monotonic() tells it.
        """
        if self.sees(start, goal):
            return np.array([start, goal])
        lower, upper = self._box
        if not ((lower <= goal) & (goal <= upper)).all():
            return None
        in_time = base.PlannerTerminationCondition(lambda: time.monotonic() > until)
        space, n = base.SpaceInformation(space_of(*self._box)), len(start)  # nothing that OMPL calls may hold it: it would never be freed
        space.setStateValidityChecker(lambda state: self.is_free(positions(state, n)))
        space.setMotionValidator(_Lines(space, n, self))
        space.setup()
        asked = base.ProblemDefinition(space)
        asked.setStartAndGoalStates(state_of(space, start), state_of(space, goal))
        planner = geometric.RRTConnect(space)
        planner.setRange(max(STEP, PART * space.getMaximumExtent()))
        planner.setProblemDefinition(asked)
        planner.setup()
        planner.solve(in_time)
        if not asked.hasExactSolution():
            return None
        found = asked.getSolutionPath()
        geometric.PathSimplifier(space).simplify(found, in_time)
        points = np.array([positions(state, n) for state in found.getStates()])
        points[0], points[-1] = start, goal
        return points


class _Lines(base.MotionValidator):
    """Answers OMPL's question whether a straight line is free, in n joint positions."""

    def __init__(self, space: base.SpaceInformation, n: int, search: Search) -> None:
        super().__init__(space)
        self._n, self._search = n, search

    def checkMotion(self, a: base.State, b: base.State) -> bool:
        return self._search.sees(positions(a, self._n), positions(b, self._n))

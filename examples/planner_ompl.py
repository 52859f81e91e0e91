"""Plans with OMPL's RRTConnect, and certifies the path: where it collides between OMPL's samples, OMPL plans again around the contact.

    python examples/planner_ompl.py planar-2dof --start 0 0 --goal 1.0 -1.5

OMPL checks configurations, not motions, here by the service. So it misses contacts between them, and ``certify_path`` cannot. After a
contact OMPL avoids that configuration, and looks twice as often. It needs the package ``ompl`` beside ``ciris[client]``.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from ompl import base, geometric, util

import ciris

Array = NDArray[np.float64]

RESOLUTION = 0.05
"""At first OMPL looks at a motion in steps of this part of the longest one. Finer steps cost questions, and the proof needs none."""
SHORTENING = 1.0
"""Seconds in which OMPL makes a path shorter and simpler."""
AVOIDED = 0.01
"""A configuration this near to a contact, as a part of each joint's range, is avoided afterwards."""


class Planner:
    """Plans paths in a scene of the service that keep away from the contacts that were found."""

    def __init__(self, service: ciris.Service, scene: ciris.Scene, patience: float) -> None:
        self.service, self.scene, self.patience = service, scene, patience
        self.contacts: list[Array] = []
        self.resolution = RESOLUTION
        self._range = scene.space.q_upper - scene.space.q_lower
        n = len(scene.joints)
        space, bounds = base.RealVectorStateSpace(n), base.RealVectorBounds(n)
        for i, (lower, upper) in enumerate(zip(scene.space.q_lower, scene.space.q_upper, strict=True)):
            bounds.setLow(i, lower)
            bounds.setHigh(i, upper)
        space.setBounds(bounds)
        self._space = space

    def free(self, state: Sequence[float]) -> bool:
        """Says whether a configuration is free as far as the service's floating point and the contacts so far tell."""
        q = np.array([state[i] for i in range(len(self.scene.joints))])
        if any((np.abs(q - contact) < AVOIDED * self._range).all() for contact in self.contacts):
            return False
        (found,) = self.service.client.contacts(self.scene.id, [q.tolist()])["contacts"]
        return not found["pairs"] and not found["outside"]

    def path(self, start: Sequence[float], goal: Sequence[float]) -> Array | None:
        """Returns the waypoints of a path that OMPL believes in, (k, n); None if it finds none."""
        setup = geometric.SimpleSetup(self._space)
        setup.setStateValidityChecker(self.free)
        setup.getSpaceInformation().setStateValidityCheckingResolution(self.resolution)
        setup.setStartAndGoalStates(self._state(start), self._state(goal))
        setup.setPlanner(geometric.RRTConnect(setup.getSpaceInformation()))
        setup.solve(self.patience)
        if not setup.haveExactSolutionPath():
            return None
        setup.simplifySolution(SHORTENING)
        found = setup.getSolutionPath()
        return np.array([[found.getState(k)[i] for i in range(len(start))] for k in range(found.getStateCount())])

    def _state(self, q: Sequence[float]) -> base.State:
        state = self._space.allocState()
        for i, value in enumerate(q):
            state[i] = value
        return state

    def certified(self, start: Sequence[float], goal: Sequence[float], tries: int = 10) -> Array | None:
        """Returns the waypoints of a path that is proved to be free of collision, straight in q between them; None if none is found."""
        for _ in range(tries):
            waypoints = self.path(start, goal)
            if waypoints is None:
                return None
            motion = self.service.certify_path(self.scene, waypoints)
            if motion:
                return waypoints
            if motion.stop is None:
                return None
            print(f"{motion.stop.a} and {motion.stop.b} touch between OMPL's samples: planning again", file=sys.stderr)
            self.contacts.append(motion.stop.q)
            self.resolution /= 2
        return None


def main() -> int:
    parser = argparse.ArgumentParser(description="Plans with OMPL, and certifies the path by a service.")
    parser.add_argument("scene", help="name or id of a scene that the service knows")
    for end in ("start", "goal"):
        parser.add_argument(f"--{end}", required=True, nargs="+", type=float, metavar="Q", help="joint positions, in radians or metres")
    parser.add_argument("--patience", type=float, default=10, help="seconds that OMPL may look for a path")
    asked = parser.parse_args()
    util.setLogLevel(util.LogLevel.LOG_WARN)
    try:
        with ciris.connect() as service:
            scene = service.scene(asked.scene)
            ends = [scene.space.points(q, end).tolist() for q, end in ((asked.start, "start"), (asked.goal, "goal"))]
            waypoints = Planner(service, scene, asked.patience).certified(*ends)
    except ciris.CirisError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    if waypoints is None:
        print("no certified path was found", file=sys.stderr)
        return 1
    for waypoint in waypoints:
        print(", ".join(f"{x:.6g}" for x in waypoint))
    print("the whole path is proved to be free of collision", file=sys.stderr)
    return 0


if __name__ == "__main__":
    sys.exit(main())

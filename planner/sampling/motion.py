"""A path becomes a motion here: rounded at its corners, with times, and proved.

What is certified is the path, with the widest tube. The motion with times has more configurations, and has to be in the tube; where it is
not, the motion itself is certified. If nothing is certified, a motion that stops at the corners follows the path exactly.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from certifier.jobs.motion import MotionVerdict, certify
from certifier.model import Array, Scene
from certifier.outcome import Outcome
from certifier.proof import limits
from certifier.proof.motion import Motion, Space
from planner.sampling.corners import rounded
from planner.sampling.route import Route
from planner.sampling.search import Search
from planner.trajectory.straight import straight
from planner.trajectory.stretch import stretched
from planner.trajectory.timing import timed
from planner.tubes import Tube, follows

SPACING = 0.1
"""How far a joint moves between two configurations of an answer, in radians or metres."""
FINE = 0.05
"""How far a joint moves between two points of the curve that gets times, in radians or metres."""


@dataclass(frozen=True, eq=False)
class Proved:
    """A motion with its proof.

    Attributes:
        q: (K, n) configurations of the motion, straight in q between them.
        t: (K,) their times in seconds.
        path: (k, n) the path that is certified, straight in q between its points. The motion is in the tube about it.
        verdict: on the path.
    """

    q: Array
    t: Array
    path: Array
    verdict: MotionVerdict


def prove(
    scene: Scene,
    search: Search,
    route: Route,
    speed: Array,
    acceleration: Array,
    accepts: Callable[[Array], bool] = lambda q: True,
) -> Proved | None:
    """Returns a certified motion from rest to rest along a path; None where none could be certified.

    Args:
        search: says which lines are free.
        speed, acceleration: (n,) limits of every joint.
        accepts: says whether a motion, (K, n), may be the answer.
    """
    for path, q, t in _candidates(search, route, speed, acceleration):
        q = np.clip(q, *scene.own_limits)
        t = stretched(q, t, speed, acceleration)
        if not accepts(q):
            continue
        for certified in (path, q):
            if (len(certified) - 1) * len(scene.pairs) > limits.INTERVALS:
                break
            verdict = certify(scene, Motion(Space.Q, certified), tube=True)
            if verdict.outcome is not Outcome.CERTIFIED or verdict.statement is None:
                break
            if certified is q or follows(Tube("", certified, verdict.statement.rho), q):
                return Proved(q, t, certified, verdict)
    return None


def within(scene: Scene, tube: Tube, path: Array, speed: Array, acceleration: Array) -> tuple[Array, Array] | None:
    """Returns configurations (K, n) and times (K,) of a motion from rest to rest along a path, (k, n); None where it leaves the tube."""
    for make in (_on_curve, _at_rest):
        found = make(path, speed, acceleration)
        if found is None:
            continue
        q, t = np.clip(found[0], *scene.own_limits), found[1]
        t = stretched(q, t, speed, acceleration)
        if follows(tube, q):
            return q, t
    return None


def _candidates(search: Search, route: Route, speed: Array, acceleration: Array) -> Iterator[tuple[Array, Array, Array]]:
    """Yields paths with configurations of motions along them and their times: first one with round corners, then one that stops there."""
    path = rounded(route.path, search.sees, route.kept)
    found = _on_curve(path, speed, acceleration)
    if found is not None:
        yield path, *found
    yield route.path, *_at_rest(route.path, speed, acceleration)


def _on_curve(path: Array, speed: Array, acceleration: Array) -> tuple[Array, Array] | None:
    """Returns a motion along a path, (k, n), that rests at its ends alone: configurations (K, n) and times (K,); or None."""
    return timed(*_fine(path), speed, acceleration, SPACING, straight_between=True)


def _at_rest(path: Array, speed: Array, acceleration: Array) -> tuple[Array, Array]:
    """Returns a motion along a path, (k, n), that rests at every point of it: configurations (K, n) and times (K,)."""
    return _joined([straight(a, b, speed, acceleration, SPACING) for a, b in pairwise(path)])


def _fine(points: Array) -> tuple[Array, list[int]]:
    """Returns points on the lines between points, (m, n), in which no joint moves by more than FINE from one to the next.

    One line alone remains as it is: it needs no curve.

    Returns:
        The points, (M, n), and the numbers of those that were given, without the first and the last.
    """
    if len(points) == 2:
        return points, []
    parts = [points[:1]]
    for a, b in pairwise(points):
        u = np.linspace(0, 1, max(1, int(np.ceil(np.abs(b - a).max() / FINE))) + 1)[1:, None]
        parts.append((1 - u) * a + u * b)
    return np.concatenate(parts), (np.cumsum([len(part) for part in parts])[1:-1] - 1).tolist()


def _joined(parts: list[tuple[Array, Array]]) -> tuple[Array, Array]:
    """Returns motions one after the other, each from rest to rest, as one."""
    q, t = parts[0]
    for more, later in parts[1:]:
        q, t = np.concatenate([q, more[1:]]), np.concatenate([t, t[-1] + later[1:]])
    return q, t

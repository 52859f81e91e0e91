"""This is what a child process does to find a motion: it searches for a path, makes a motion of it, and certifies the motion. It also
certifies the motions of others (``certify_in_child``), so that one process knows all about motions.

The shortest path often slides along something. So the search begins with a little padding around all bodies, and goes on with less where
that leaves no way, or where the ends themselves are closer to something.
"""

from __future__ import annotations

import base64
import json
import time
from dataclasses import asdict
from functools import partial
from typing import Any

import numpy as np

from certifier.collisions.seen import seen_of
from certifier.jobs.motion import certify, swing
from certifier.jobs.motion import certify_in_child as certify_in_child
from certifier.model import Array, Scene
from certifier.proof.motion import Motion, Space
from planner.poses.inverse import inverse
from planner.poses.line import keeps, line
from planner.sampling.ends import box, in_collision, outside_limits
from planner.sampling.motion import Proved, prove, within
from planner.sampling.route import Route, route
from planner.sampling.search import Search
from planner.tubes import Tube

PADDINGS = (2e-3, 2e-4, 0.0)
"""Metres that are added around every body, in one search after the other, until a motion is certified."""
GOALS = 8
"""A pose is reached by at most this many configurations, of which the motion goes to the cheapest."""
WITHIN = 0.5
"""The path along a line takes this part of the tolerances."""
LONGER = 1.02
"""A path that is longer than this many times the straight line is a detour."""
SHARE = 0.04
"""A search with padding takes this part of the time that is left at most: either it is quick, or the padding leaves no way."""


def keep(text: str) -> Scene:
    """Returns the scene of a document, for all calls about it. The process that forks the children calls this function."""
    scene = Scene.from_document(json.loads(text))
    middle = (scene.q_lower + scene.q_upper) / 2
    for padding in PADDINGS:
        seen_of(scene, padding)
    certify(scene, Motion(Space.Q, np.array([middle, middle])), tube=True)  # what it computes about the scene is kept as well
    return scene


def planned(payload: dict[str, Any], scene: Scene) -> dict[str, Any]:
    """Returns a certified motion, or why there is none. A child process runs this function.

    Args:
        payload: ``points`` (m, n), the start and what the motion has to go through after it; ``goals`` (k, n), of which it goes to the
            cheapest that it reaches; instead of goals a ``pose``, with ``frame``, ``position`` and ``rpy``, and with it perhaps a ``line``,
            the tolerances ``metres`` and ``radians``; ``speed`` and ``acceleration`` (n,), limits of every joint; ``seconds``, how long to
            search.

    Returns:
        ``q`` (K, n), ``t`` (K,); the ``path`` (k, n), with the ``tube`` about it in which q is; and the ``planes`` that prove it, a file
        without the scene in base 64. Or a ``reason``:

        - ``outside_limits`` or ``in_collision``, with ``where``, which is ``start``, ``via[i]``, ``goal[i]`` or ``pose``, and the
          attributes of OutsideLimits or InCollision;
        - ``unreachable``, with the configuration ``q`` nearest to the pose, and how far it is off in ``metres`` and ``radians``;
        - ``line``, with ``part``, how much of the line there is a motion for, ``how`` as planner.poses.line.Line has its reason, or
          ``collision``, and ``joint``, or the geometries ``a`` and ``b``;
        - ``no_motion`` where none was found in time;
        - ``not_certified``.

    Raises:
        RegionError: as planner.poses.frame.frame_of and pose_of; the field names the place in the pose.
    """
    points, goals, pose = list(payload["points"]), list(payload.get("goals", [])), payload.get("pose")
    until = time.monotonic() + payload["seconds"]
    bounds = box(scene, [*points, *goals])
    free = Search(scene, *bounds)
    wrong = _wrong(scene, free, points, goals)
    if wrong is not None:
        return wrong
    if pose is not None and payload.get("line") is not None:
        return _along(scene, free, points[0], payload)
    if pose is not None:
        asked = pose["frame"], pose["position"], pose["rpy"]
        found = inverse(scene, *asked, points[-1], free.is_free, wanted=GOALS, seconds=payload["seconds"] / 4)
        if found.reason == "unreachable":
            return {"reason": "unreachable", "q": found.nearest, "metres": found.metres, "radians": found.radians}
        if found.reason == "in_collision":
            return {"reason": "in_collision", "where": "pose", **asdict(in_collision(scene, found.nearest))}
        goals = list(found.q)
        bounds = box(scene, [*points, *goals])
    goals = [goal for goal in goals if outside_limits(scene, goal) is None]
    reason = "no_motion"
    for padding in PADDINGS:
        search = Search(scene, *bounds, padding)
        if not all(search.is_free(point) for point in points):
            continue
        left = until - time.monotonic()
        path = route(scene, search, points, goals, until - left * SHARE if padding else until)
        if path is None:
            continue
        proved = prove(scene, search, path, payload["speed"], payload["acceleration"])
        if proved is not None:
            return _answer(proved)
        reason = "not_certified"
    return {"reason": reason}


def timed_within(payload: dict[str, Any], scene: Scene) -> dict[str, Any]:
    """Returns a motion in the tube of a proved one: ``q`` (K, n) and ``t`` (K,), or nothing. A child process runs this function.

    It returns nothing as well where the path is a detour, and the straight line from its start to its end is free.

    Args:
        payload: ``path`` (k, n), which is in the tube; ``proved`` (m, n), the path of the proved motion, and ``tube``, half the width about
            it; ``speed`` and ``acceleration`` (n,), limits of every joint.
    """
    path = payload["path"]
    detour = np.linalg.norm(np.diff(path, axis=0), axis=1).sum() > LONGER * np.linalg.norm(path[-1] - path[0])
    if detour and Search(scene, *box(scene, list(path)), PADDINGS[0]).sees(path[0], path[-1]):
        return {}
    tube = Tube("", payload["proved"], payload["tube"])
    found = within(scene, tube, payload["path"], payload["speed"], payload["acceleration"])
    return {} if found is None else {"q": found[0], "t": found[1]}


def _along(scene: Scene, search: Search, start: Array, payload: dict[str, Any]) -> dict[str, Any]:
    """Returns a certified motion along a straight line of a frame, or how far there is one."""
    pose, tolerance = payload["pose"], payload["line"]
    asked = pose["frame"], start, pose["position"], pose["rpy"]
    # The motion with its times leaves the path a little, so the path takes a part of the tolerance alone.
    found = line(scene, *asked, **{name: WITHIN * value for name, value in tolerance.items()})
    for i in range(len(found.q) - 1):
        if not search.sees(found.q[i], found.q[i + 1]):
            stop = certify(scene, Motion(Space.Q, found.q[i : i + 2])).stop
            pair = {} if stop is None else {"a": stop.pair.a, "b": stop.pair.b}
            return {"reason": "line", "how": "collision", "part": found.parts[i], **pair}
    if found.reason is not None:
        return {"reason": "line", "how": found.reason, "part": found.parts[-1], "joint": found.joint}
    path = Route(found.q, tuple(range(1, len(found.q) - 1)))
    on_line = partial(keeps, scene, *asked, **tolerance)
    proved = prove(scene, search, path, payload["speed"], payload["acceleration"], on_line)
    return {"reason": "not_certified"} if proved is None else _answer(proved)


def _answer(proved: Proved) -> dict[str, Any]:
    verdict = proved.verdict
    assert verdict.statement is not None
    assert verdict.planes is not None
    planes = base64.b64encode(verdict.planes).decode()
    return {"q": proved.q, "t": proved.t, "path": proved.path, "tube": verdict.statement.rho, "planes": planes}


def _wrong(scene: Scene, search: Search, points: list[Array], goals: list[Array]) -> dict[str, Any] | None:
    """Returns what is wrong with the start, with a point, or with all of the goals; None where nothing is."""
    for i, point in enumerate(points):
        if problem := _problem(scene, search, point, "start" if i == 0 else f"via[{i - 1}]"):
            return problem
    problems = [_problem(scene, search, goal, f"goal[{i}]") for i, goal in enumerate(goals)]
    return problems[0] if problems and all(problems) else None


def _problem(scene: Scene, search: Search, q: Array, where: str) -> dict[str, Any] | None:
    beyond = outside_limits(scene, q)
    if beyond is not None:
        return {"reason": "outside_limits", "where": where, **asdict(beyond)}
    return None if search.is_free(q) else {"reason": "in_collision", "where": where, **asdict(in_collision(scene, q))}


def warm_up() -> None:
    """Loads the compiled functions and the libraries that a motion needs, by finding some for a ball that swings about a post."""
    scene, ends, each = swing(), np.array([[-0.5], [0.5]]), {"speed": np.ones(1), "acceleration": np.ones(1), "seconds": 1.0}
    planned({"points": ends[:1], "goals": ends[1:], **each}, scene)
    pose = {"frame": "arm/link", "position": np.zeros(3), "rpy": np.array([0.0, 0.0, 0.5])}
    for tolerance in (None, {"metres": 1e-3, "radians": 1e-2}):
        planned({"points": ends[:1], "pose": pose, "line": tolerance, **each}, scene)

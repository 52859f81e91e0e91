"""Seeds: where regions are best grown next.

A given path is covered from its start on. Components are joined along a route between them. What else is free and uncovered is looked at
in samples: a region is grown where many of them see one another.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from itertools import zip_longest

import numpy as np

from certifier.model import Array, Scene
from planner.cover.ground import Collides, clique, free_samples, seen_from_each_other, sees
from planner.cover.known import Known
from planner.cover.machine import TRIES
from planner.cover.routes import FINE, along, route
from planner.cover.state import CoverState, Purpose, Scouted, Task
from planner.membership import locate, to_s
from planner.motion.path import follow
from planner.motion.space import Space
from planner.overlap import gap

TARGETS, DRAWN = 64, 2000
"""A seed is chosen among TARGETS uncovered configurations, of DRAWN that are free; or of more, while fewer are found."""
DRAWS = 10
BUSY = 0.1
"""What is seen from the seed of a region that grows counts so much for the next seed."""
MOST = 3
"""Number of seeds that are chosen for uncovered configurations."""
SPACING = 0.005
"""Routes are looked at in points that are this part of the joint limits' diagonal apart, in s."""
ROOTS = 60
"""A route begins and ends at one of at most this many points of a component."""
JOINS = 2
"""Number of routes that one look searches for."""
BACK = 4
"""A region that goes on with a path begins this many points before the path's uncovered part."""


def proposals(scene: Scene, collides: Collides, known: Known, state: CoverState, seen: Scouted) -> Scouted:
    """Returns what was seen with what to grow next, the best first, and with what cannot be joined.

    Nothing is proposed for what a region grows for already, or what was tried too often.
    """
    return _Search(scene, collides, known, state, seen).proposed()


class _Search:
    """Searches for the next seeds of one look."""

    def __init__(self, scene: Scene, collides: Collides, known: Known, state: CoverState, seen: Scouted) -> None:
        self._scene, self._collides, self._known, self._state, self._seen = scene, collides, known, state, seen
        self._rng = np.random.default_rng([state.options.random_seed, state.looks])
        self._spacing = SPACING * float(np.linalg.norm(scene.s_upper - scene.s_lower))
        self._obstacles: list[str] = []

    def proposed(self) -> Scouted:
        options, seen = self._state.options, self._seen
        paths = [self._on_path(i) for i in self._open(Purpose.PATH, (i for i, part in enumerate(seen.paths) if part < 1))]
        leads = [task for task in (*paths, *self._joins()) if task is not None]
        enough = options.enough is None or seen.coverage >= options.enough
        mixed = [task for both in zip_longest(leads, [] if enough else self._covering()) for task in both if task is not None]
        return replace(seen, proposals=tuple(mixed), obstacles=tuple(self._obstacles))

    def _open(self, purpose: Purpose, numbers: Iterable[int]) -> list[int]:
        """Returns of what a task may be about those that no region grows for and that were not tried too often."""
        busy = {task.key for task in self._state.growing.values()}
        keys = [(number, Task((), purpose, number).key) for number in numbers]
        return [number for number, key in keys if key not in busy and self._state.failed.get(key, 0) < TRIES]

    def _on_path(self, number: int) -> Task | None:
        """Returns a region for the first part of a given path that is not covered."""
        path = np.array(self._state.options.paths[number])
        stop = follow(self._known.library, self._scene, Space.Q, path, range(len(path))).uncovered
        if stop is None:
            return None
        rest = np.concatenate([stop.q[None], path[stop.segment + 1 :]])
        before = path[stop.segment]
        step = stop.q - before
        pulled = stop.q - step * min(1.0, BACK * self._spacing / max(float(np.linalg.norm(step)), 1e-12))
        s = to_s(self._scene, along(np.concatenate([pulled[None], rest]), self._spacing))
        return self._stretch(s[np.isfinite(s).all(axis=1)], Purpose.PATH, number)

    def _joins(self) -> list[Task | None]:
        """Returns regions that lead from one component towards another."""
        seen, known = self._seen, self._known
        home = next((part for part in seen.connect if part is not None), 0)
        away = {i: part for i, part in enumerate(seen.connect) if part not in (None, home)}
        wanted = [(Purpose.JOIN, i, home, away[i] or 0) for i in self._open(Purpose.JOIN, away)]
        if self._state.options.connected:
            firsts = {min(regions): part for part, regions in enumerate(known.parts) if part}
            wanted += [(Purpose.LINK, first, 0, firsts[first]) for first in self._open(Purpose.LINK, firsts)]
        return [self._joining(*join) for join in wanted[:JOINS]]

    def _joining(self, purpose: Purpose, number: int, here: int, there: int) -> Task | None:
        """Returns a region for the first part of a route to another component that is outside of this one; None without a route."""
        nearest = gap(self._known.library, list(self._known.parts[there]))
        starts, ends = self._roots(here), self._roots(there)
        if nearest is not None:
            ends = np.concatenate([nearest.s_a[None], ends])
            if self._known.part_of[nearest.b] == here:
                starts = np.concatenate([nearest.s_b[None], starts])
        corners = route(self._scene, self._collides, starts, ends, self._rng)
        if corners is None:
            end = f"connect[{number}]" if purpose is Purpose.JOIN else f"region {self._known.library.ids[number]}"
            self._obstacles.append(f"no collision-free motion to the component of {end} was found")
            return None
        points = along(corners, self._spacing)
        hits = locate(self._known.library, points)
        inside = np.isin(np.arange(len(points)), hits.point[self._known.part_of[hits.region] == here])
        covered = np.isin(np.arange(len(points)), hits.point)
        leaves = int(np.flatnonzero(~inside)[0]) if not inside.all() else len(points) - 1
        again = np.flatnonzero(covered[leaves:])
        last = leaves + int(again[0]) if len(again) else len(points) - 1
        return self._stretch(points[max(leaves - 1, 0) : last + 1], purpose, number)

    def _roots(self, part: int) -> Array:
        """Returns points in s, (k, n), of a component, to begin routes at."""
        witnesses = self._known.witnesses_in(part)
        some = witnesses[self._rng.permutation(len(witnesses))[:ROOTS]]
        given = [q for q, at in zip(self._state.options.connect, self._seen.connect, strict=True) if at == part]
        boxes = list(self._known.parts[part])[:ROOTS]
        middles = (self._known.library.lower[boxes] + self._known.library.upper[boxes]) / 2
        hits = locate(self._known.library, middles)
        inside = np.unique(hits.point[np.isin(hits.region, boxes)])
        s = to_s(self._scene, np.array(given).reshape(-1, self._scene.n))
        return np.concatenate([s, some, middles[inside]])

    def _stretch(self, points: Array, purpose: Purpose, number: int) -> Task | None:
        """Returns a region from the first of the points (k, n) in s to as far along them as it sees; less far after failures."""
        if not len(points):
            return None
        failed = self._state.failed.get(Task((), purpose, number).key, 0)
        ends = np.unique(np.linspace(0, len(points) - 1, 33).astype(int))[::-1]
        sees_all = sees(self._collides, np.repeat(points[:1], len(ends), axis=0), points[ends], FINE)
        last = int(ends[np.flatnonzero(sees_all)[0]]) if sees_all.any() else 0
        last = last // 2**failed
        seed, begin, end = (points[last] + points[0]) / 2, points[0], points[last]
        contain = () if failed == TRIES - 1 or last == 0 else (self._q(begin), self._q(end))
        return Task(self._q(seed), purpose, number, contain)

    def _covering(self) -> list[Task]:
        """Returns regions for free configurations that are in none: one for each of a few cliques among them."""
        targets = self._uncovered()
        if not len(targets):
            return []
        visible = seen_from_each_other(self._collides, targets)
        weights = np.ones(len(targets))
        for task in self._state.growing.values():
            seed = np.repeat(to_s(self._scene, np.array([task.q])), len(targets), axis=0)
            weights[sees(self._collides, seed, targets)] = BUSY
        tasks: list[Task] = []
        while len(tasks) < MOST and (weights > 0).any():
            members = clique(visible, weights)
            tasks.append(Task(self._q(self._middle(targets[members])), Purpose.COVER))
            weights[members] = 0.0
        return tasks

    def _uncovered(self) -> Array:
        found: list[Array] = []
        for _ in range(DRAWS):
            drawn = free_samples(self._scene, self._collides, DRAWN, self._rng)
            covered = np.unique(locate(self._known.library, drawn).point)
            found.append(np.delete(drawn, covered, axis=0))
            if sum(map(len, found)) >= TARGETS:
                break
        return np.concatenate(found)[:TARGETS]

    def _middle(self, members: Array) -> Array:
        """Returns the mean of points in s, (k, n), where it is free and sees them; else the point that is nearest to it."""
        mean = members.mean(axis=0)
        if not self._collides(mean[None])[0] and sees(self._collides, np.repeat(mean[None], len(members), axis=0), members).all():
            return mean
        nearest: Array = members[np.linalg.norm(members - mean, axis=1).argmin()]
        return nearest

    def _q(self, s: Array) -> tuple[float, ...]:
        return tuple(self._scene.to_q(s).tolist())

"""Seeds: where regions are best grown next.

A given path is covered from its start on. Components are joined along a route between them. What else is free and uncovered is looked at
in samples: a region is grown where many of them see one another.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace
from itertools import product, zip_longest

import numpy as np
from numpy.typing import NDArray

from certifier.model import Array, Scene
from planner.cover.ground import Collides, clique, free_samples, seen_from_each_other, sees
from planner.cover.known import Known
from planner.cover.machine import TRIES
from planner.cover.routes import FINE, along, routes, straight
from planner.cover.state import CoverState, Purpose, Scouted, Task
from planner.membership import locate, to_s
from planner.motion.path import follow
from planner.motion.space import Space
from planner.overlap import gap

TARGETS, DRAWN = 64, 2000
"""A seed is chosen among TARGETS uncovered configurations, of DRAWN that are free; or of more, while fewer are found."""
DRAWS = 10
BUSY = 0.1
"""The weight, for the next seed, of what is seen from the seed of a region that still grows."""
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

    Nothing is proposed for what a region grows for already, or what was tried too often, and no region that cannot be a new one.
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
        """Returns a region for the first part of a route to another component that is outside of this one; None without a new one."""
        found = False
        for corners in self._routes(here, there):
            found = True
            task = self._stretch(self._outside(corners, here), purpose, number)
            if task is not None:
                return task
        end = f"connect[{number}]" if purpose is Purpose.JOIN else f"region {self._known.library.ids[number]}"
        motion = f"collision-free motion to the component of {end}"
        self._obstacles.append(f"no region is left to try along a {motion}" if found else f"no {motion} was found")
        return None

    def _routes(self, here: int, there: int) -> Iterator[Array]:
        """Yields routes from one component to another, (k, n) in s, the straight lines between nearest and given points first."""
        known, starts, ends = self._known, self._roots(here), self._roots(there)
        nearest = gap(known.library, list(known.parts[there]), list(known.parts[here]))
        assert nearest is not None, "a component has regions"
        pairs = [(nearest.s_b, nearest.s_a), *product(self._given_in(here), self._given_in(there))]
        first, second = np.array(pairs).transpose(1, 0, 2)
        yield from straight(self._collides, first, second)
        yield from routes(self._scene, self._collides, starts, ends, self._rng)

    def _outside(self, corners: Array, here: int) -> Array:
        """Returns points, (k, n) in s, of the first part of a route that is outside of a component, from just inside of it on."""
        points = along(corners, self._spacing)
        hits = locate(self._known.library, points)
        inside = np.isin(np.arange(len(points)), hits.point[self._known.part_of[hits.region] == here])
        covered = np.isin(np.arange(len(points)), hits.point)
        leaves = int(np.flatnonzero(~inside)[0]) if not inside.all() else len(points) - 1
        again = np.flatnonzero(covered[leaves:])
        last = leaves + int(again[0]) if len(again) else len(points) - 1
        return points[max(leaves - 1, 0) : last + 1]

    def _roots(self, part: int) -> Array:
        """Returns points in s, (k, n), of a component, to begin routes at."""
        witnesses = self._known.witnesses_in(part)
        some = witnesses[self._rng.permutation(len(witnesses))[:ROOTS]]
        boxes = list(self._known.parts[part])[:ROOTS]
        middles = (self._known.library.lower[boxes] + self._known.library.upper[boxes]) / 2
        hits = locate(self._known.library, middles)
        inside = np.unique(hits.point[np.isin(hits.region, boxes)])
        return np.concatenate([self._given_in(part), some, middles[inside]])

    def _given_in(self, part: int) -> Array:
        """Returns the configurations to connect that are in a component, (k, n) in s."""
        given = [q for q, at in zip(self._state.options.connect, self._seen.connect, strict=True) if at == part]
        return to_s(self._scene, np.array(given).reshape(-1, self._scene.n))

    def _stretch(self, points: Array, purpose: Purpose, number: int) -> Task | None:
        """Returns a region from the first of the points (k, n) in s to as far along them as it sees; less far after failures.

        If that one is not new, it is one that reaches half as far, and so on; at last one around a single point. None if none is new.
        """
        if not len(points):
            return None
        failed = self._state.failed.get(Task((), purpose, number).key, 0)
        ends = np.unique(np.linspace(0, len(points) - 1, 33).astype(int))[::-1]
        sees_all = sees(self._collides, np.repeat(points[:1], len(ends), axis=0), points[ends], FINE)
        far = int(ends[np.flatnonzero(sees_all)[0]]) if sees_all.any() else 0
        lasts = [far // 2**half for half in range(failed, TRIES)]
        tasks = [self._task(points[[0, last]], purpose, number) for last in lasts[:-1] if last]
        middle, outside = points[[0, lasts[-1]]].mean(axis=0), points[self._uncovered_of(points)]
        tasks += [Task(self._q(s), purpose, number) for s in (middle, *outside[:1])]
        return next(filter(self._is_new, tasks), None)

    def _task(self, ends: Array, purpose: Purpose, number: int) -> Task:
        """Returns a region that contains both ends, (2, n) in s, of a line."""
        return Task(self._q(ends.mean(axis=0)), purpose, number, (self._q(ends[0]), self._q(ends[1])))

    def _is_new(self, task: Task) -> bool:
        """Returns whether a region was not asked for yet, and no region holds all of its points: it might become the same one again."""
        points = to_s(self._scene, np.array([task.q, *task.contain]))
        held = np.bincount(locate(self._known.library, points).region, minlength=1)
        return task.request not in self._state.tried and int(held.max()) < len(points)

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
        return list(filter(self._is_new, tasks))

    def _uncovered(self) -> Array:
        found: list[Array] = []
        for _ in range(DRAWS):
            drawn = free_samples(self._scene, self._collides, DRAWN, self._rng)
            found.append(drawn[self._uncovered_of(drawn)])
            if sum(map(len, found)) >= TARGETS:
                break
        return np.concatenate(found)[:TARGETS]

    def _uncovered_of(self, points: Array) -> NDArray[np.intp]:
        """Returns the numbers of those of the points s, (k, n), that are in no region."""
        return np.setdiff1d(np.arange(len(points)), locate(self._known.library, points).point)

    def _middle(self, members: Array) -> Array:
        """Returns the mean of points in s, (k, n), where it is free, in no region and sees them; else the point that is nearest to it."""
        mean = members.mean(axis=0)
        alone = len(self._uncovered_of(mean[None])) and not self._collides(mean[None])[0]
        if alone and sees(self._collides, np.repeat(mean[None], len(members), axis=0), members).all():
            return mean
        nearest: Array = members[np.linalg.norm(members - mean, axis=1).argmin()]
        return nearest

    def _q(self, s: Array) -> tuple[float, ...]:
        return tuple(self._scene.to_q(s).tolist())

"""Drake's IRIS covers a scene without certificates, by the rules that the service's covers have for their seeds.

A region counts as soon as it is proposed. What part of it collides is measured too, with samples.
"""

from __future__ import annotations

import multiprocessing
import time
from collections.abc import Callable
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from functools import partial
from typing import Any

import numpy as np
from pydrake.planning import IrisZoOptions

from certifier import stored
from certifier.errors import CirisError
from certifier.model import Scene, StoredRegion
from certifier.pair.collisions import in_collision
from certifier.polytopes.gibbs import uniform_in_q
from certifier.polytopes.polytope import bounds
from certifier.seeding.options import Method, SeedOptions
from certifier.seeding.proposal import Proposal
from certifier.seeding.propose import propose
from planner.cover.known import Known
from planner.cover.look import Look
from planner.cover.machine import advance, begin
from planner.cover.options import CoverOptions
from planner.cover.result import said
from planner.cover.state import Ended, Finish, Late, Move, Moved, Report, Scout, Scouted, Task, Watch
from planner.library import Library
from planner.overlap import beside, overlap

CHAINS, EACH = 100, 10
"""The colliding part of a region is estimated from CHAINS chains with EACH samples."""


class _Regions:
    """Holds the regions so far, and their overlaps."""

    def __init__(self, scene: Scene) -> None:
        self._scene, self._library = scene, Library(scene.n)
        self._edges: list[tuple[int, int, list[float]]] = []
        self.colliding: list[float] = []

    @property
    def known(self) -> Known:
        return Known.of(self._library, self._edges)

    def add(self, proposal: Proposal) -> None:
        polytope, number = self._scene.polytope(proposal.C, proposal.d), len(self._library)
        stored = StoredRegion(str(number), "sampled", polytope.C, polytope.d, *bounds(polytope))
        self._library = self._library.changed(number + 1, [*self._library.ids, stored.id], [stored])
        for other in beside(self._library, number, range(number)):
            common = overlap(self._library, other, number)
            if common is not None:
                self._edges.append((other, number, common.witness.tolist()))
        samples = uniform_in_q(polytope, self._scene, CHAINS, EACH, 0).reshape(-1, self._scene.n)
        self.colliding.append(float(in_collision(self._scene, samples).mean()))


def cover(
    scene: Scene,
    options: dict[str, Any],
    processes: int,
    seconds: float,
    tell: Callable[[dict[str, Any]], None],
    method: Method = Method.IRIS,
) -> dict[str, Any]:
    """Covers a scene with what IRIS proposes, until the goals are reached or the time is over. Returns the run's document.

    Args:
        options: as of a cover; those about certifying have no effect.
        tell: hears of every look at the scene.
        method: which IRIS proposes.
    """
    parsed, start = CoverOptions.from_document(options), time.monotonic()
    look, regions = Look(scene, partial(in_collision, scene), parsed), _Regions(scene)
    points: list[dict[str, Any]] = []
    growing: dict[Future[dict[str, Any]], int] = {}
    late, failed = False, 0
    with ProcessPoolExecutor(processes, multiprocessing.get_context("spawn")) as pool:
        transition = begin(parsed)
        while not isinstance(transition.action, Finish):
            action = transition.action
            report: Report | None = None
            left = seconds - (time.monotonic() - start)
            if left <= 0 and not late:
                late, report = True, Late()
            elif isinstance(action, Scout):
                report = look(regions.known, transition.state)
            elif isinstance(action, Move):
                report = Moved(())  # regions alone are compared
            elif action.stop:
                report = Ended(dict.fromkeys(transition.state.growing, "given up"))
            else:
                growing |= {
                    pool.submit(_iris, scene.to_document(), _seed(task, parsed, method)): number for number, task in action.begin.items()
                }
                transition = type(transition)(transition.state, Watch())  # these are begun
                done, _ = wait(growing, max(left, 0.0), FIRST_COMPLETED)
                ended = {growing.pop(future): _came(future, regions) for future in done}
                failed += sum(why is not None for why in ended.values())
                report = Ended(ended) if ended else None
            transition = transition if report is None else advance(transition.state, report)
            known = said(transition.state)
            if isinstance(report, Scouted) and known is not None:
                points.append(point(time.monotonic() - start, known))
                tell(points[-1])
        for process in multiprocessing.active_children():
            process.terminate()
    return {
        "points": points,
        "reason": transition.action.reason,
        "seconds": time.monotonic() - start,
        "begun": transition.state.begun,
        "without_region": failed,
        "colliding": {"mean": float(np.mean(regions.colliding)), "largest": float(np.max(regions.colliding))}
        if regions.colliding
        else None,
    }


def point(seconds: float, known: dict[str, Any]) -> dict[str, Any]:
    """Returns what is kept of a look at the scene, with the seconds since the beginning."""
    names = ("regions", "components", "largest", "connect", "begun")
    coverage = {name: known["coverage"][key] for name, key in (("coverage", "value"), ("stderr", "stderr"))}
    return {"seconds": seconds, **coverage, **{name: known[name] for name in names}}


def _seed(task: Task, options: CoverOptions, method: Method) -> dict[str, Any]:
    """Returns the options of one region; IrisZo has Drake's own, which ask for less than the service's."""
    more: dict[str, Any] = {}
    if method is Method.IRIS_ZO:
        drakes = IrisZoOptions().sampled_iris_options
        same = ("epsilon", "delta", "max_iterations", "max_iterations_separating_planes")
        more = {name: getattr(drakes, name) for name in same}
        more |= {"tolerance": drakes.relative_termination_threshold, "margin": drakes.configuration_space_margin}
    return SeedOptions(method=method, q=task.q, contain=task.contain, random_seed=options.random_seed, **more).to_document()


def _iris(scene: dict[str, Any], seed: dict[str, Any]) -> dict[str, Any]:
    """Runs in a process of the pool."""
    return dict(stored.document(propose(Scene.from_document(scene), SeedOptions.from_document(seed))))


def _came(future: Future[dict[str, Any]], regions: _Regions) -> str | None:
    """Takes the region of a process; returns why there is none."""
    try:
        regions.add(stored.value(Proposal, future.result()))
    except CirisError as error:
        return error.message
    return None

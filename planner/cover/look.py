"""One look at a scene: how much of it its regions cover, and which are connected.

What is covered is estimated from samples that have nothing to do with the choice of seeds. So a seed counts for nothing by itself.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from certifier.errors import RegionError
from certifier.model import Array, Scene
from planner.cover.ground import Collides, free_samples
from planner.cover.known import Known
from planner.cover.options import CoverOptions, Q
from planner.cover.seeds import proposals
from planner.cover.state import CoverState, Scouted
from planner.membership import Hits, locate, to_s
from planner.motion.path import follow
from planner.motion.space import Space

SAMPLES = 4000
"""The coverage is estimated from this many collision-free configurations."""
SPACING = 0.005
"""A path is tested in points that are this part of the joint limits' diagonal apart, in s."""


class Look:
    """Looks at one scene for one cover. Its samples stay the same from one look to the next.

    Args:
        collides: tells which configurations are in collision.

    Raises:
        RegionError: nothing_free; seed_in_collision or path_in_collision for what was given.
    """

    def __init__(self, scene: Scene, collides: Collides, options: CoverOptions) -> None:
        self._scene, self._collides, self._options = scene, collides, options
        self._check_given()
        self._samples = free_samples(scene, collides, SAMPLES, np.random.default_rng(options.random_seed))

    def _check_given(self) -> None:
        for name, given in (("seeds", self._options.seeds), ("connect", self._options.connect)):
            for i in np.flatnonzero(self._collides(self._in_s(given))).tolist():
                message = "bodies touch, or are nearer than the padding, at this configuration"
                raise RegionError("seed_in_collision", message, field=f"options.{name}[{i}]", hint="`ciris scene check --q` says which")
        spacing = SPACING * float(np.linalg.norm(self._scene.s_upper - self._scene.s_lower))
        for i, path in enumerate(self._options.paths):
            corners = self._in_s(path)
            for segment, (a, b) in enumerate(pairwise(corners)):
                t = np.linspace(0, 1, max(int(np.linalg.norm(b - a) / spacing), 1) + 1)[:, None]
                q = np.array(path[segment]) * (1 - t) + np.array(path[segment + 1]) * t
                if self._collides(self._in_s(q)).any():
                    message = f"bodies touch, or are nearer than the padding, between waypoints {segment} and {segment + 1}"
                    raise RegionError("path_in_collision", message, field=f"options.paths[{i}]", hint="`ciris certify-path` says which")

    def _in_s(self, q: Sequence[Sequence[float]] | Array) -> Array:
        return to_s(self._scene, np.array(q, dtype=float).reshape(-1, self._scene.n))

    def __call__(self, known: Known, state: CoverState) -> Scouted:
        """Returns what is covered and which regions are connected; unless the cover is ending, also what is best grown next."""
        hits = locate(known.library, self._samples)
        pairs = np.unique(np.column_stack([hits.point, known.part_of[hits.region]]), axis=0)
        held = np.bincount(pairs[:, 1], minlength=len(known.parts))
        known = known.ordered(np.argsort(-held, kind="stable"))
        seen = Scouted(
            version=known.library.version,
            regions=len(known.library),
            samples=len(self._samples),
            covered=len(np.unique(hits.point)),
            components=tuple(len(regions) for regions in known.parts),
            largest=int(held.max(initial=0)),
            seeds=tuple(part is not None for part in self._parts_at(known, self._options.seeds)),
            connect=self._parts_at(known, self._options.connect),
            paths=tuple(self._covered(known, path) for path in self._options.paths),
            obstacles=() if state.last is None else state.last.obstacles,
        )
        return seen if state.closing is not None else proposals(self._scene, self._collides, known, state, seen)

    def _parts_at(self, known: Known, given: Sequence[Q]) -> tuple[int | None, ...]:
        """Returns for each configuration the component of the region that it is deepest in; None where it is in none."""
        return deepest(locate(known.library, self._in_s(given)), known.part_of, len(given))

    def _covered(self, known: Known, path: Sequence[Q]) -> float:
        """Returns which part of a path is covered, in waypoints."""
        stop = follow(known.library, self._scene, Space.Q, np.array(path), range(len(path))).uncovered
        return 1.0 if stop is None else stop.time / (len(path) - 1)


def deepest(hits: Hits, part_of: NDArray[np.intp], count: int) -> tuple[int | None, ...]:
    """Returns for each of ``count`` points the component of the region that it is deepest in; None where it is in none."""
    found: list[int | None] = [None] * count
    for point, region in zip(hits.point[::-1].tolist(), hits.region[::-1].tolist(), strict=True):
        found[point] = int(part_of[region])
    return tuple(found)

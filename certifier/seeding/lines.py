"""The straight lines in s between the points that a region shall hold are looked at here, before anything is proposed.

A region is convex in s. So it holds all of the straight line between any two of its points, and where bodies touch on such a line, no
region holds both ends.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations

from certifier.errors import RegionError
from certifier.model import Array, Scene
from certifier.motion.intervals import RESOLUTION
from certifier.motion.search import search
from certifier.outcome import Outcome
from certifier.proof.motion import Motion, Space
from certifier.seeding.free import Nearest, named


def check_lines(scene: Scene, points: Array, ends: Sequence[Nearest]) -> list[Nearest]:
    """Refuses points of which no region can hold two, and returns the nearest pair on the line between any two others.

    Bodies that are at most 1e-7 m apart count as touching, as for every motion. So a line is left out where they are so near at an end.

    Args:
        points: (k, n) in s, strictly within the limits.
        ends: what is known of each of them, as :func:`certifier.seeding.free.check_free` returns it.

    Raises:
        RegionError: ``contain_blocked``; it names the pair and the first configuration of contact on the line.
    """
    if not scene.pairs:
        return []
    near = []
    for i, j in combinations(range(len(points)), 2):
        motion, start, end = Motion(Space.S, points[[i, j]]), named(ends[i].field), named(ends[j].field)
        found = search(scene, motion, clearance=True)
        place = found.stop or found.nearest
        if place is None or min(ends[i].distance, ends[j].distance) <= RESOLUTION:
            continue
        q = scene.to_q(motion.at(place.piece, place.time))
        if found.stop is not None and found.stop.outcome is Outcome.REFUTED:
            at, pair = ", ".join(f"{x:.9g}" for x in q), place.pair
            message = f"{pair.a} and {pair.b} touch at q = {at}, on the straight line in s from {start} to this configuration"
            hint = "a region holds all of that line: leave one of its ends out, or have `ciris cover --connect` grow several regions"
            raise RegionError("contain_blocked", message, field=ends[j].field, hint=hint)
        near.append(Nearest(q, f"the line from {start} to {end}", place.distance, place.pair))
    return near

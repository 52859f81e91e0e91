"""What lies between the points that a region shall hold is looked at here, before anything is proposed.

A region is convex in s. So it holds all of the straight line between any two of its points, and where bodies touch on such a line, no
region holds both ends. It also holds the hull of all points. Samples of the hull may show a contact that is on none of these lines.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations

import numpy as np

from certifier.broken import trouble
from certifier.errors import RegionError
from certifier.model import Array, Pair, Scene
from certifier.motion.intervals import RESOLUTION
from certifier.motion.search import search
from certifier.outcome import Outcome
from certifier.proof.motion import Motion, Space
from certifier.seeding.contacts import Contacts
from certifier.seeding.free import Nearest, named
from certifier.words import joint_positions

SAMPLES = 2000
"""The hull of three points or more is looked at in this many samples."""
_OR_COVER = "or have `ciris cover --connect` grow several regions"


def check_lines(scene: Scene, points: Array, ends: Sequence[Nearest]) -> list[Nearest]:
    """Refuses points of which no region can hold two, and returns the nearest pair on the line between any two others.

    Bodies that are at most 1e-7 m apart count as touching, as for every motion. So a line is left out where they are so near at an end.

    Args:
        points: (k, n) in s, strictly within the limits.
        ends: what is known of each of them, as :func:`certifier.seeding.free.check_free` returns it.

    Raises:
        RegionError: ``contain_blocked``; it names the pair and the first configuration of contact on the line, or one in the hull.
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
            message = f"{_touch(scene, place.pair, q)}, on the straight line in s from {start} to this configuration"
            hint = f"a region holds all of that line: leave one of its ends out, {_OR_COVER}"
            raise RegionError("contain_blocked", message, field=ends[j].field, hint=hint)
        near.append(Nearest(q, f"the line from {start} to {end}", place.distance, place.pair))
    if len(points) > 2 and min(end.distance for end in ends) > RESOLUTION:
        _check_hull(scene, points)
    return near


def _check_hull(scene: Scene, points: Array) -> None:
    """Refuses points where something touches at a sample of their hull.

    Raises:
        RegionError: ``contain_blocked``.
    """
    samples, contacts = np.random.default_rng(0).dirichlet(np.ones(len(points)), SAMPLES) @ points, Contacts(scene)
    for pair, found in contacts.touching(samples[~contacts.free(samples)]).items():
        message = f"{_touch(scene, pair, scene.to_q(found[0]))}, between the configurations that the region has to hold"
        hint = f"a region holds all that is between them in s: leave one of them out, {_OR_COVER}"
        raise RegionError("contain_blocked", message, field="seed.contain", hint=hint)


def _touch(scene: Scene, pair: Pair, q: Array) -> str:
    return f"{trouble(scene, pair, q)} at q = {joint_positions(q, scene.units, digits=9)}"

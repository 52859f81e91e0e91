"""Contacts in corners of a proposal, which hardly any sample shows, are found by descents and cut off here.

Growth would find each of them and cut it off while it certifies cells, one after the other. Around a face that barely passes a contact,
bodies nearly touch, and cells have to be small. So the bodies keep a distance here.

A pair that few joints move takes few cells, whose planes come as near to contact as they have to. So only the other pairs are looked at.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from certifier.isolation.telling import tell
from certifier.model import Array, Pair, Polytope, Scene, Volume
from certifier.partition.area import Area
from certifier.partition.bodies import Bodies
from certifier.partition.frames import choose_frame
from certifier.partition.parted import long_pairs
from certifier.partition.scouts import scouted, with_others
from certifier.partition.together import THIN, gaps_between, together, volumes_of
from certifier.polytopes.cutting import BARELY, cut, samples_of

DISTANCE, PART = 0.005, 0.2
"""Metres that bodies keep between them, or this part of their distance at the points to keep, if that is less."""
ROUNDS, LOOKS = 24, 2
"""In at most ROUNDS rounds, all long pairs are looked at LOOKS times at most, and in between those that had contacts."""


def without_contacts(scene: Scene, polytope: Polytope, points: Array) -> Polytope:
    """Returns the part of a polytope that is left when contacts in its corners are cut off.

    Args:
        polytope: joint limits included, as its last rows.
        points: (k, n) points in s that stay inside.

    Raises:
        RegionError: the polytope is empty or unbounded.
    """
    apart, around = _apart(scene, points), polytope
    grouped = together(apart, samples_of(scene, polytope)[::THIN], points)
    others = {other for members in grouped.values() for other in members}
    pieces = {i: (i, *grouped.get(i, ())) for i in long_pairs(scene) if i not in others}
    active, looks = pieces, 1
    for seed in range(ROUNDS):
        tell(faces=len(polytope.d) - 2 * scene.n)
        found = list(_found(apart, polytope, active, seed))
        if found:
            made = cut(scene, polytope, points, [(joints, contacts, 1.0) for _, joints, contacts in found], around, BARELY)
            if made.polytope is None or made.polytope is polytope:
                break
            polytope, around = made.polytope, made.around
            active = {first: pieces[first] for first, _, _ in found}
        elif active is pieces or looks == LOOKS:
            break
        else:
            active, looks = pieces, looks + 1
    return polytope


def _apart(scene: Scene, points: Array) -> Scene:
    """Returns a scene whose pairs have larger paddings, by what they are to keep between them."""

    def wider(pair: Pair) -> Pair:
        a, b = (Volume.of(scene.geometry(name)) for name in (pair.a, pair.b))
        gap = gaps_between(scene, a, b, points).min()
        return replace(pair, padding=scene.padding_of(pair) + max(0.0, min(DISTANCE, PART * float(gap))))

    return replace(scene, pairs=tuple(wider(pair) for pair in scene.pairs))


def _found(scene: Scene, polytope: Polytope, pieces: dict[int, tuple[int, ...]], seed: int) -> Iterator[tuple[int, tuple[int, ...], Array]]:
    """Yields each piece that touches, by its first pair, with the joints between its bodies and contacts of it, (w, n)."""
    area = Area.of(scene, polytope, seed)
    for first, members in pieces.items():
        volumes = volumes_of(scene, [scene.pairs[i] for i in members])
        frame, joints = choose_frame(area.kinematics, volumes, area.lower, area.upper)
        bodies = Bodies(area, frame, volumes)
        if contacts := scouted(area, bodies, seed):
            yield first, tuple(joints), np.array(with_others(area, bodies, joints, contacts))

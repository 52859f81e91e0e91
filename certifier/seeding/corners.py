"""Contacts in corners of a proposal, which hardly any sample shows, are found by descents and cut off here.

Growth would find each of them and cut it off while it certifies cells, one after the other. Around a face that barely passes a contact,
bodies nearly touch, and cells have to be small. So the bodies keep a distance here.

So do the slim volumes of growth (certifier.partition.levels) where they hardly touch otherwise. Where they touch in corners alone, these
corners take growth most of its cells, because the bodies themselves need cells that are narrow in one joint more.

A pair that few joints move takes few cells, whose planes come as near to contact as they have to. So only the other pairs are looked at.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from certifier.isolation.telling import tell
from certifier.kinematics import Kinematics
from certifier.model import Array, Polytope, Scene, Volume
from certifier.pair.broad_phase import Volumes
from certifier.partition.area import Area
from certifier.partition.bodies import Bodies
from certifier.partition.coarse import slim_volumes
from certifier.partition.frames import choose_frame
from certifier.partition.parted import long_pairs
from certifier.partition.scouts import scouted, with_others
from certifier.partition.together import THIN, gaps_between, together, volumes_of
from certifier.polytopes.cutting import BARELY, cut, samples_of
from certifier.polytopes.polytope import without_redundant

DISTANCE, PART = 0.01, 0.4
"""Metres that bodies keep between them, or this part of their distance at the points to keep, if that is less."""
SLIM_DISTANCE, SLIM_PART = 0.02, 0.5
"""The same of slim volumes."""
TOUCHING = 0.01
"""Slim volumes that touch at more than this share of the samples keep nothing between them: faces before them would lose too much."""
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
    around, samples = polytope, samples_of(scene, polytope)[::THIN]
    grouped = together(scene, samples, points)
    others = {other for members in grouped.values() for other in members}
    all_pieces = [list(_to_keep_apart(scene, (i, *grouped.get(i, ())), points, samples)) for i in long_pairs(scene) if i not in others]
    active, looks = all_pieces, 1
    for seed in range(ROUNDS):
        tell(faces=len(polytope.d) - 2 * scene.n)
        found = list(_found(scene, polytope, active, seed))
        if found:
            made = cut(scene, polytope, points, [(joints, contacts, 1.0) for _, joints, contacts in found], around, BARELY)
            if made.polytope is None or made.polytope is polytope:
                break
            polytope, around = without_redundant(made.polytope, fixed=2 * scene.n), made.around
            active = [piece for piece, _, _ in found]
        elif active is all_pieces or looks == LOOKS:
            break
        else:
            active, looks = all_pieces, looks + 1
    return polytope


def _to_keep_apart(scene: Scene, members: tuple[int, ...], points: Array, samples: Array) -> Iterator[Volumes]:
    """Yields what to keep apart for pairs that share a certificate: their volumes, and slim ones, larger by what is to lie between."""
    kinematics, volumes = Kinematics.of(scene), volumes_of(scene, [scene.pairs[i] for i in members])

    def larger(one: Volume, other: Volume, most: float, part: float) -> Volumes:
        gap = float(gaps_between(scene, one, other, points).min())
        return replace(one, radius=one.radius + max(0.0, min(most, part * gap))), other

    yield larger(*volumes, DISTANCE, PART)
    slims = slim_volumes(kinematics, *volumes), slim_volumes(kinematics, *volumes[::-1])
    if any(slims):
        one, other = ((*slim, own)[0] for slim, own in zip(slims, volumes, strict=True))
        apart = (gaps_between(scene, one, other, points) > 0).all()
        if apart and (gaps_between(scene, one, other, samples) <= 0).mean() <= TOUCHING:
            yield larger(one, other, SLIM_DISTANCE, SLIM_PART)


def _found(
    scene: Scene, polytope: Polytope, pieces: list[list[Volumes]], seed: int
) -> Iterator[tuple[list[Volumes], tuple[int, ...], Array]]:
    """Yields each piece in which volumes touch, with the joints between the first ones that do, and contacts of these, (w, n)."""
    area = Area.of(scene, polytope, seed)
    for piece in pieces:
        for volumes in piece:
            frame, joints = choose_frame(area.kinematics, volumes, area.lower, area.upper)
            bodies = Bodies(area, frame, volumes)
            if contacts := scouted(area, bodies, seed):
                yield piece, tuple(joints), np.array(with_others(area, bodies, joints, contacts))
                break

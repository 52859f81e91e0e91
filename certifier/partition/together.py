"""Pairs of the same two rigid parts are grouped here to share one certificate, where one volume for all of a part's geometries suffices.

A rigid part is a link with all that is welded to it: a hand with its palm, fingers and camera, or a link that is modelled by many balls.
A plane that separates a volume around them from a board separates each of them, and one partition takes about as long as that of one
geometry. The volume may touch what none of the geometries does, so it is taken only where it loses next to nothing of the polytope.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence

import numpy as np

from certifier.kinematics import Kinematics
from certifier.model import WORLD, Array, Geometry, Pair, Scene, Volume
from certifier.partition.hulls import gaps, hull
from certifier.proof import limits

THIN = 8
"""One in this many samples of a polytope is enough to say which pairs share one certificate."""
LOST = 0.002
"""Two volumes touch at no more than this share of the samples. Samples at which two of the geometries themselves touch do not count.
Faces for the contacts of two volumes lose no more than this share in one round of a growth, where the group can be divided."""
ROOM = 0.5
"""At the points to keep, two volumes keep at least this part of the distance of the geometries."""
MARGIN = 1e-9
"""A volume is larger than what it has to contain by this, in metres, because welds are rounded."""

Together = dict[int, tuple[int, ...]]
"""Pair index -> the other pairs, by their indices, that share its certificate."""


def together(scene: Scene, samples: Array, keep: Array) -> Together:
    """Returns which pairs share one certificate.

    Args:
        samples: (S, n) configurations of the polytope, uniform in q.
        keep: (k, n) configurations at which volumes keep ROOM.
    """
    kinematics = Kinematics.of(scene)
    numbers = {frozenset((pair.a, pair.b)): index for index, pair in enumerate(scene.pairs)}
    clusters = _clusters(scene)
    found: Together = {}
    for i, first in enumerate(clusters):
        for second in clusters[:i]:
            if kinematics.rigid_root(first[0].body) != kinematics.rigid_root(second[0].body):
                for members in _joined(scene, first, second, numbers, samples, keep):
                    found[members[0]] = tuple(members[1:])
    return found


def divided(scene: Scene, members: Sequence[int], contacts: Array, keep: Array) -> Together | None:
    """Returns smaller groups of the pairs of a group whose volumes touch; None where its geometries touch there as well.

    Args:
        contacts: (S, n) configurations at which the volumes of the group touch.
        keep: as for :func:`together`.
    """
    first, second = _sides(scene, [scene.pairs[index] for index in members])
    numbers = {frozenset((scene.pairs[index].a, scene.pairs[index].b)): index for index in members}
    found = _joined(scene, first, second, numbers, contacts, keep)
    return None if found == [sorted(members)] else {index: tuple(others) for index, *others in found}


def volumes_of(scene: Scene, pairs: Sequence[Pair]) -> tuple[Volume, Volume]:
    """Returns the two volumes around the geometries of pairs between the same two rigid parts; one pair has the geometries themselves."""
    kinematics = Kinematics.of(scene)
    first, second = _sides(scene, pairs)
    return _volume(kinematics, first), _volume(kinematics, second)


def _sides(scene: Scene, pairs: Sequence[Pair]) -> tuple[list[Geometry], list[Geometry]]:
    """Returns the geometries of pairs between the same two rigid parts, those of either part."""
    kinematics = Kinematics.of(scene)
    geometries = [scene.geometry(name) for name in sorted({n for pair in pairs for n in (pair.a, pair.b)})]
    root = kinematics.rigid_root(scene.geometry(pairs[0].a).body)
    first, second = ([g for g in geometries if (kinematics.rigid_root(g.body) == root) == here] for here in (True, False))
    return first, second


def _volume(kinematics: Kinematics, geometries: Sequence[Geometry]) -> Volume:
    """Returns the hull of geometries that are welded to each other and have the same radius, or a box around it if that has fewer vertices.

    The box is the smallest one of those along the axes of the geometries' bodies.
    """
    if len(geometries) == 1:
        return Volume.of(geometries[0])
    radius, names, bodies = geometries[0].radius, tuple(g.name for g in geometries), dict.fromkeys(g.body for g in geometries)
    around = {body: np.concatenate(placed(kinematics, geometries, body)) for body in bodies}
    if len(around[geometries[0].body]) <= limits.CORNERS:
        return Volume(names, geometries[0].body, around[geometries[0].body], radius if len(bodies) == 1 else radius + MARGIN)
    body = min(bodies, key=lambda body: float(np.ptp(around[body], axis=0).prod()))
    ends = around[body].min(axis=0) - MARGIN, around[body].max(axis=0) + MARGIN
    return Volume(names, body, np.array(list(itertools.product(*zip(*ends, strict=True)))), radius)


def placed(kinematics: Kinematics, geometries: Sequence[Geometry], body: str) -> list[Array]:
    """Returns the vertices of geometries in the frame of a body that they are welded to, (N, 3) each, in metres."""
    here = np.zeros((1, kinematics.scene.n))
    return [kinematics.points(body, geometry.body, geometry.vertices, here)[0] for geometry in geometries]


def _clusters(scene: Scene) -> list[list[Geometry]]:
    """Returns the geometries that pairs are about, those of one rigid part with the same radius together, each obstacle by itself."""
    kinematics, found = Kinematics.of(scene), dict[tuple[str, float, str], list[Geometry]]()
    for name in dict.fromkeys(name for pair in scene.pairs for name in (pair.a, pair.b)):
        geometry = scene.geometry(name)
        root = kinematics.rigid_root(geometry.body)
        found.setdefault((root, geometry.radius, name if root == WORLD else ""), []).append(geometry)
    return list(found.values())


def _joined(
    scene: Scene, first: list[Geometry], second: list[Geometry], numbers: dict[frozenset[str], int], samples: Array, keep: Array
) -> list[list[int]]:
    """Returns the pairs, by their indices, of each two volumes around geometries of either list that suffice; other pairs stay alone."""
    if len(first) * len(second) == 1:
        return []
    asked = [numbers.get(frozenset((a.name, b.name))) for a in first for b in second]
    known = sorted(index for index in asked if index is not None)
    if not known:
        return []
    same_padding = len({scene.padding_of(scene.pairs[index]) for index in known}) == 1
    if same_padding and len(known) == len(asked) and _will_do(scene, first, second, samples, keep):
        return [known]
    larger, other = (first, second) if len(first) >= len(second) else (second, first)
    return [members for half in halves(Kinematics.of(scene), larger) for members in _joined(scene, half, other, numbers, samples, keep)]


def halves(kinematics: Kinematics, geometries: list[Geometry]) -> tuple[list[Geometry], list[Geometry]]:
    """Returns the lower and the upper half of geometries welded together, along the axis in which their centres lie farthest apart.

    The axis is one of those of the first one's body.
    """
    centers = np.array([vertices.mean(axis=0) for vertices in placed(kinematics, geometries, geometries[0].body)])
    order = np.argsort(centers[:, np.argmax(np.ptp(centers, axis=0))], kind="stable")
    ordered = [geometries[place] for place in order]
    return ordered[: len(ordered) // 2], ordered[len(ordered) // 2 :]


def _will_do(scene: Scene, first: list[Geometry], second: list[Geometry], samples: Array, keep: Array) -> bool:
    """Returns whether two volumes keep the distance that they have to keep."""
    kinematics = Kinematics.of(scene)
    one, other = _volume(kinematics, first), _volume(kinematics, second)
    own = [(Volume.of(a), Volume.of(b)) for a in first for b in second]
    room = np.min([gaps_between(scene, a, b, keep) for a, b in own], axis=0)
    if (gaps_between(scene, one, other, keep) <= ROOM * room).any():
        return False
    touching = samples[gaps_between(scene, one, other, samples) <= 0]
    excused = np.zeros(len(touching), dtype=bool)
    for a, b in own if len(touching) else []:
        excused |= gaps_between(scene, a, b, touching) <= 0
    return bool((~excused).sum() <= LOST * len(samples))


def gaps_between(scene: Scene, one: Volume, other: Volume, X: Array) -> Array:
    """Returns how far two volumes are apart at configurations, (N,), in metres, padding subtracted; not positive where they touch."""
    kinematics = Kinematics.of(scene)
    padding = scene.padding_between((one, other))
    bodies = [hull(kinematics, one.body, v, v.radius + padding, np.zeros(3), 1.0) for v in (one, other)]
    found: Array = gaps(*bodies, X)
    return found

"""Pairs of the same two bodies are grouped here to share one certificate, where the hulls of their geometries suffice.

A link is often modelled by many balls. A plane that separates the hull of a link's balls from a board separates each of them, and one
partition takes about as long as that of one ball. A hull may touch what none of its balls does, so hulls are taken only where they
lose next to nothing of the proposal.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from certifier.kinematics import Kinematics
from certifier.model import WORLD, Array, Geometry, Pair, Scene, Volume
from certifier.partition.hulls import gaps, hull
from certifier.proof import limits

THIN = 8
"""One in this many samples of a proposal is enough to say which pairs share one certificate."""
LOST = 0.002
"""Two hulls touch at no more than this share of the samples. Samples at which two of the geometries themselves touch do not count."""

Together = dict[int, tuple[int, ...]]
"""Pair index -> the other pairs, by their indices, that share its certificate."""


def together(scene: Scene, samples: Array, keep: Array) -> Together:
    """Returns which pairs share one certificate.

    Args:
        samples: (S, n) configurations of the proposal.
        keep: (k, n) configurations at which hulls must not touch.
    """
    numbers = {frozenset((pair.a, pair.b)): index for index, pair in enumerate(scene.pairs)}
    clusters = _clusters(scene)
    found: Together = {}
    for i, first in enumerate(clusters):
        for second in clusters[:i]:
            if first[0].body != second[0].body:
                for members in _joined(scene, first, second, numbers, samples, keep):
                    found[members[0]] = tuple(members[1:])
    return found


def volumes_of(scene: Scene, pairs: Sequence[Pair]) -> tuple[Volume, Volume]:
    """Returns the two hulls of the geometries of pairs between the same two bodies; one pair has the geometries themselves."""
    body = scene.geometry(pairs[0].a).body
    names = sorted({name for pair in pairs for name in (pair.a, pair.b)})
    geometries = [scene.geometry(name) for name in names]
    return _hull([g for g in geometries if g.body == body]), _hull([g for g in geometries if g.body != body])


def _hull(geometries: Sequence[Geometry]) -> Volume:
    """Returns the hull of geometries of one body that have the same radius."""
    vertices = np.concatenate([geometry.vertices for geometry in geometries])
    return Volume(tuple(geometry.name for geometry in geometries), geometries[0].body, vertices, geometries[0].radius)


def _clusters(scene: Scene) -> list[list[Geometry]]:
    """Returns the geometries that pairs are about, those of one link with the same radius together, each obstacle by itself."""
    kinematics, found = Kinematics.of(scene), dict[tuple[str, float, str], list[Geometry]]()
    for name in dict.fromkeys(name for pair in scene.pairs for name in (pair.a, pair.b)):
        geometry = scene.geometry(name)
        moves = kinematics.rigid_root(geometry.body) != WORLD
        found.setdefault((geometry.body, geometry.radius, "" if moves else name), []).append(geometry)
    return list(found.values())


def _joined(
    scene: Scene, first: list[Geometry], second: list[Geometry], numbers: dict[frozenset[str], int], samples: Array, keep: Array
) -> list[list[int]]:
    """Returns the pairs, by their indices, of each two hulls of geometries of either list that suffice; other pairs stay alone."""
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
    return [members for half in _halves(larger) for members in _joined(scene, half, other, numbers, samples, keep)]


def _halves(geometries: list[Geometry]) -> tuple[list[Geometry], list[Geometry]]:
    """Returns the lower and the upper half of geometries along the axis in which their centres lie farthest apart."""
    centers = np.array([geometry.vertices.mean(axis=0) for geometry in geometries])
    order = np.argsort(centers[:, np.argmax(np.ptp(centers, axis=0))], kind="stable")
    ordered = [geometries[place] for place in order]
    return ordered[: len(ordered) // 2], ordered[len(ordered) // 2 :]


def _will_do(scene: Scene, first: list[Geometry], second: list[Geometry], samples: Array, keep: Array) -> bool:
    """Returns whether two hulls have few vertices and keep the distance that they have to keep."""
    one, other = _hull(first), _hull(second)
    if max(len(one.vertices), len(other.vertices)) > limits.CORNERS or (_gaps(scene, one, other, keep) <= 0).any():
        return False
    touching = samples[_gaps(scene, one, other, samples) <= 0]
    excused = np.zeros(len(touching), dtype=bool)
    for a in first if len(touching) else []:
        for b in second:
            excused |= _gaps(scene, Volume.of(a), Volume.of(b), touching) <= 0
    return bool((~excused).sum() <= LOST * len(samples))


def _gaps(scene: Scene, one: Volume, other: Volume, X: Array) -> Array:
    """Returns how far two volumes are apart at configurations, (N,), in metres, padding subtracted; not positive where they touch."""
    kinematics = Kinematics.of(scene)
    padding = scene.padding_between((one, other))
    bodies = [hull(kinematics, one.body, v, v.radius + padding, np.zeros(3), 1.0) for v in (one, other)]
    found: Array = gaps(*bodies, X)
    return found

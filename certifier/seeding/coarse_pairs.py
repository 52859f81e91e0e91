"""IRIS keeps clear of what growth will part by faces: coarse volumes join a scene here as geometries of their own.

Growth certifies a hand with the ball about it, whatever the wrist does, and cuts off where the ball touches. IRIS, which knows the ball,
has its faces there from the beginning, at the nearest contact. So they lose less than those that growth adds (docs/trials.md).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from certifier.model import Array, Geometry, Pair, Polytope, Scene, Volume
from certifier.partition.parted import long_pairs, parted
from certifier.seeding.rating import samples_of

NO_LENGTH = 1e-9
"""A capsule that is shorter than this, in metres, is a ball to Drake, which knows no capsule without length."""


@dataclass(frozen=True)
class Shape:
    """The shape of a volume and the body that it is fixed to.

    Attributes:
        corners: the vertices' coordinates, as bytes.
    """

    body: str
    corners: bytes
    radius: float


CoarsePairs = dict[tuple[Shape, Shape], tuple[Volume, Volume]]
"""The shapes of two volumes that faces keep apart -> the volumes, those of the pair with the largest padding."""


def coarse_pairs_of(scene: Scene, polytope: Polytope, points: Array) -> CoarsePairs:
    """Returns the volumes that faces keep apart on a polytope, where they are not geometries of the scene.

    Args:
        polytope: joint limits included.
        points: (k, n) points in s that stay inside.

    Raises:
        RegionError: the polytope is empty or unbounded.
    """
    found: CoarsePairs = {}
    if not long_pairs(scene):
        return found
    for bodies in parted(scene, polytope, samples_of(scene, polytope), points):
        if all(volume.is_geometry_of(scene) for volume in bodies.volumes):
            continue
        first, second = (Shape(volume.body, volume.vertices.tobytes(), volume.radius) for volume in bodies.volumes)
        known = found.get((first, second))
        if known is None or scene.padding_between(known) < scene.padding_between(bodies.volumes):
            found[first, second] = bodies.volumes
    return found


def with_coarse_pairs(scene: Scene, coarse: CoarsePairs) -> Scene:
    """Returns a scene with volumes as geometries and pairs of its own. Their names begin with two slashes, as no other ones do."""
    new: dict[Shape, Geometry] = {}
    pairs = []
    for keys, volumes in coarse.items():
        names = []
        for key, volume in zip(keys, volumes, strict=True):
            if volume.is_geometry_of(scene):
                names.append(volume.geometries[0])
                continue
            if key not in new:
                corners = volume.vertices
                if np.ptp(corners, axis=0).max() < NO_LENGTH:
                    corners = corners[:1]
                new[key] = Geometry(f"//{len(new)}", volume.body, corners, volume.radius, {})
            names.append(new[key].name)
        pairs.append(Pair(*sorted(names), padding=scene.padding_between(volumes)))
    return replace(scene, geometries=(*scene.geometries, *new.values()), pairs=(*scene.pairs, *pairs))

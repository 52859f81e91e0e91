"""This module names what faces will have to separate, before any cell is looked at: the volumes that growth keeps apart by faces.

A pair that few joints move takes few cells, whose planes come as near to contact as they have to. So only the other pairs are looked at.
"""

from __future__ import annotations

from certifier.kinematics import Kinematics
from certifier.model import Array, Polytope, Scene
from certifier.partition.area import Area
from certifier.partition.bodies import Bodies
from certifier.partition.hulls import gaps
from certifier.partition.levels import LONG
from certifier.partition.search import Search
from certifier.partition.shared import Shared
from certifier.partition.together import THIN, together, volumes_of


def long_pairs(scene: Scene) -> list[int]:
    """Returns the indices of the pairs that LONG joints move or more."""
    kinematics = Kinematics.of(scene)
    bodies_of = [(scene.geometry(pair.a).body, scene.geometry(pair.b).body) for pair in scene.pairs]
    return [index for index, (a, b) in enumerate(bodies_of) if len(kinematics.chain(a, b)) >= LONG]


def parted(scene: Scene, polytope: Polytope, samples: Array, keep: Array) -> list[Bodies]:
    """Returns the volumes that faces keep apart, of every pair that LONG joints move or more.

    Pairs that share one certificate have the same volumes, which are returned once.

    Args:
        polytope: joint limits included.
        samples: (k, n) of the polytope, uniform in q.
        keep: (k, n) configurations that stay inside.

    Raises:
        RegionError: the polytope is empty or unbounded.
    """
    long = long_pairs(scene)
    if not long:
        return []
    area = Area.of(scene, polytope, 0)
    shared, joined = Shared(area), together(scene, samples[::THIN], keep)
    others = {other for members in joined.values() for other in members}
    found = []
    for index in long:
        if index not in others:
            volumes = volumes_of(scene, [scene.pairs[i] for i in (index, *joined.get(index, ()))])
            search = Search(area, shared, volumes, keep)
            found.append(search.parted or search.bodies)
    return found


def touched(scene: Scene, polytope: Polytope, samples: Array, keep: Array) -> float:
    """Returns the share of samples at which volumes touch that faces keep apart; its arguments and errors are those of :func:`parted`."""
    left = samples
    for bodies in parted(scene, polytope, samples, keep):
        left = left[gaps(*bodies.hulls, left) > 0]
    return 1 - len(left) / len(samples)

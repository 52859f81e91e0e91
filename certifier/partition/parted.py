"""How much of a polytope faces will have to part is looked at here, before any cell is: where volumes touch that faces keep apart.

A pair that few joints move takes few cells, whose planes come as near to contact as they have to. So only the others are looked at.
"""

from __future__ import annotations

from certifier.model import Array, Polytope, Scene
from certifier.partition.area import Area
from certifier.partition.hulls import gaps
from certifier.partition.levels import LONG
from certifier.partition.search import Search
from certifier.partition.shared import Shared
from certifier.partition.together import THIN, together, volumes_of


def touched(scene: Scene, polytope: Polytope, samples: Array, keep: Array) -> float:
    """Returns the share of samples at which volumes touch that faces keep apart, of pairs that LONG joints move or more.

    Args:
        polytope: joint limits included.
        samples: (S, n) points of the polytope.
        keep: (k, n) configurations that stay inside.

    Raises:
        RegionError: the polytope is empty or unbounded.
    """
    area = Area.of(scene, polytope, 0)
    shared, joined = Shared(area), together(scene, samples[::THIN], keep)
    others = {other for members in joined.values() for other in members}
    left = samples
    for index in range(len(scene.pairs)):
        if index in others:
            continue
        volumes = volumes_of(scene, [scene.pairs[i] for i in (index, *joined.get(index, ()))])
        if len(area.kinematics.chain(*(volume.body for volume in volumes))) >= LONG:
            search = Search(area, shared, volumes, faces=True)
            left = left[gaps(*(search.parted or search.bodies).hulls, left) > 0]
    return 1 - len(left) / len(samples)

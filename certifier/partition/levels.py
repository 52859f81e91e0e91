"""Which coarse volumes are tried in the cells of a pair is chosen here: fat balls that few joints move, then slim ones, then the bodies.

A volume that many joints move takes many cells, because each of them has to be narrow in all of these joints. A fat ball that stands for
all of the hand, whatever the wrist does, takes few as long as the bodies are far apart, and all pairs with the hand share what is found for
it (certifier.partition.shared). Where the balls come too close, a cell goes on to the next level.
"""

from __future__ import annotations

import itertools
from typing import NamedTuple

import numpy as np

from certifier.model import Array, Volume
from certifier.partition.area import Area
from certifier.partition.coarse import common_balls, slim_volumes
from certifier.partition.hulls import gaps, hull
from certifier.proof import limits
from certifier.proof.partition import Coarse

APART, LOOKED = (0.99, 1.0), 500
"""The fattest balls are apart at the first share of LOOKED configurations, the next ones at the second share. Of two chains, all are apart
at the first share."""

LONG = 5
"""Coarse volumes are tried where at least this many joints move one body against the other."""
MANY_JOINTS = 7
"""Where at least this many joints move one body against the other, cells that are narrow in all of them are far too many."""

Level = tuple[int, int]
"""The numbers of the volumes of a level: 0 for a volume itself, i for the coarse one with the number i - 1."""


class Levels(NamedTuple):
    """Says which volumes the cells of two volumes are tried with.

    Attributes:
        coarse: the coarse volumes of either, which the polytope does not matter to.
        levels: a cell tries the last one first; the first one is that of the volumes themselves.
        fat: the place of the first level of fat balls.
        two_chains: whether both have coarse volumes, and MANY_JOINTS or more move them, as those of two hands. Then every level but the
            first leaves out joints of one chain or the other, and cuts that are made for it may not help the next one.
    """

    coarse: Coarse
    levels: list[Level]
    fat: int
    two_chains: bool


def levels_of(area: Area, frame: str, volumes: tuple[Volume, Volume], apart: tuple[float, float] = APART, apart_by: float = 0.0) -> Levels:
    """Returns the levels of two volumes: of fewer than LONG joints, that of the volumes themselves alone.

    Of two chains, there is one for every number of joints with which balls are apart at most configurations. So slim levels are kept
    when faces make fatter ones come apart at all configurations that are looked at. The fatter ones still touch in corners, where faces to
    separate them lose far more (docs/trials.md).

    Args:
        frame: any body; distances are computed in its frame.
        apart: as APART.
        apart_by: balls count as apart where they are so by more than this, in metres.
    """
    kinematics, (a, b) = area.kinematics, volumes
    if len(kinematics.chain(a.body, b.body)) < LONG:
        return Levels(((), ()), [(0, 0)], 1, False)
    slim = slim_volumes(kinematics, a, b), slim_volumes(kinematics, b, a)
    balls = common_balls(kinematics, a, b), common_balls(kinematics, b, a)
    first, second = ((*few, *more)[: limits.COARSE] for few, more in zip(slim, balls, strict=True))
    known = (a, *first), (b, *second)

    def moving(level: Level) -> int:
        return len(kinematics.chain(known[0][level[0]].body, known[1][level[1]].body))

    slender = len(slim[0]), len(slim[1])
    levels: list[Level] = [(min(i, slender[0]), min(i, slender[1])) for i in range(1 + max(slender))]
    two_chains = bool(first and second) and moving((0, 0)) >= MANY_JOINTS
    fat = itertools.product(*([0, *range(1 + number, len(volumes))] for number, volumes in zip(slender, known, strict=True)))
    candidates = sorted((level for level in fat if 0 < moving(level) < moving(levels[-1])), key=moving)
    fats: list[Level] = []
    shares = list(range(len(apart)))
    for _, alternatives in itertools.groupby(candidates, key=moving):
        room = {level: _room(area, frame, (known[0][level[0]], known[1][level[1]]), apart) for level in alternatives}
        best = max(room, key=lambda level: float(room[level][shares[0]]))
        if room[best][shares[0]] > apart_by:
            fats.append(best)
        if not two_chains:
            shares = [share for share in shares if room[best][share] <= apart_by]
        if not shares:
            break
    return Levels((first, second), levels + fats[::-1], len(levels), two_chains)


def _room(area: Area, frame: str, volumes: tuple[Volume, Volume], apart: tuple[float, float]) -> Array:
    """Returns how far apart the volumes are at each of these shares of the configurations, in metres; not positive where they touch."""
    padding = area.scene.padding_between(volumes)
    hulls = [hull(area.kinematics, frame, v, v.radius + padding, np.zeros(3), 1.0) for v in volumes]
    room: Array = np.quantile(gaps(*hulls, area.samples[:LOOKED]), [1 - share for share in apart])
    return room

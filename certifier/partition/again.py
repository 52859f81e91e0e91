"""The partition that a pair had when its bodies were a little different is tried again here, cell by cell.

Its cuts are made again. In every cell the old plane is tried, where the planes are still in the same frame; that a cell misses the
polytope is shown anew. Cells where this fails stay open, and the search goes on with them alone. What holds is proved of the bodies as
they are now, so nothing depends on what the old proof was worth.
"""

from __future__ import annotations

from certifier.model import Array, Volume
from certifier.partition.area import Area
from certifier.partition.cell import Cell
from certifier.partition.search import Search
from certifier.partition.tree import Node, of_streams
from certifier.proof.partition import STREAMS, PartitionProof

_Key = tuple[object, ...] | None
"""The numbers of a coarse volume; None for a volume itself."""


def try_again(area: Area, search: Search, volumes: tuple[Volume, Volume], old: PartitionProof) -> Node:
    """Returns the tree of two volumes on the area that an old proof leads to; its open cells are what did not hold.

    Args:
        search: that of the two volumes.
        old: a proof about two bodies that were much like these, in the same order or the other.
    """
    seeds = _Seeds(search, volumes, old)
    root = Node()
    waiting = [(seeds.root, root, area.lower, area.upper, area.samples)]
    while waiting:
        was, node, lower, upper, samples = waiting.pop()
        while was.kind >= 0 and not lower[was.kind] < was.value < upper[was.kind]:
            was = was.children[int(was.value <= lower[was.kind])]
        if was.kind >= 0 and was.kind in search.joints:
            node.kind, node.value, node.children = was.kind, was.value, (Node(), Node())
            middle_up, middle_low = upper.copy(), lower.copy()
            middle_up[was.kind] = middle_low[was.kind] = was.value
            below = samples[:, was.kind] <= was.value
            waiting.append((was.children[1], node.children[1], middle_low, upper, samples[~below]))
            waiting.append((was.children[0], node.children[0], lower, middle_up, samples[below]))
        else:
            search.settle_as(Cell.at(area, node, lower, upper, samples), *seeds.of(was))
    return root


class _Seeds:
    """Holds the old tree, and says which plane to try in a cell of it."""

    def __init__(self, search: Search, volumes: tuple[Volume, Volume], old: PartitionProof) -> None:
        vertices = [len(a.vertices) + len(b.vertices) for a, b in old.chosen]
        self.root = of_streams({name: getattr(old, name) for name in STREAMS}, vertices, 1)[0]
        turned = not set(volumes[0].geometries) & set(old.volumes[0].geometries)
        self._sign = -1.0 if turned else 1.0
        self._usable = old.frame == search.frame and old.planes.shape[2] == 1 + len(search.joints)
        levels = {tuple(map(_key, chosen, volumes)): level for level, chosen in enumerate(search.volumes_of_levels)}
        keys = (tuple(map(_key, chosen, old.volumes)) for chosen in old.chosen)
        self._levels = [levels.get(key[::-1] if turned else key, 0) for key in keys]

    def of(self, was: Node) -> tuple[Array | None, int]:
        """Returns the plane to try in the cell of an old node, and the level of the bodies that it is about."""
        if was.plane is None or not self._usable:
            return None, 0
        return self._sign * was.plane[:4], self._levels[was.choice]


def _key(chosen: Volume, own: Volume) -> _Key:
    return None if chosen is own else (chosen.body, chosen.radius, (chosen.vertices + 0.0).tobytes())

"""The map of a scene is held here as data: for its pairs, the cells of the joint space in which they are proved apart.

A pair's map is a partition of the box of its joints (certifier.proof.partition), some cells of which are open: nothing is said about
them. It is about the pair's own scene (certifier.proof.sub_scene), so it serves every scene with such a pair. One map may be about
several pairs between the same two rigid parts, and several maps may be about one pair. A configuration is proved to be free where every
pair of the scene has a map that has a plane there.

Nothing here decides whether a proof holds: certifier.verify does. docs/proofs.md describes the file.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, Self

import numpy as np

from certifier.document import Node
from certifier.errors import ProofError
from certifier.model import Array, Pair, Scene, Volume
from certifier.proof import limits
from certifier.proof.container import FORMAT, Arrays, head, malformed, pack, unpack, unpacked_size
from certifier.proof.partition import OBLIQUE, OPEN, PLANE, PartitionProof
from certifier.proof.separation import Common
from certifier.proof.sub_scene import sub_scene, way


@dataclass(frozen=True)
class PairMap(PartitionProof):
    """Holds the cells in which two volumes are proved apart, and those that are open.

    It is about a scene whose joints are those between the volumes (certifier.proof.sub_scene). The nodes of the tree of cuts may be OPEN
    or OBLIQUE. The lower part of an oblique cut is {s in the cell: normal . s <= v}, with v its place in ``cuts``, and is a leaf with a
    plane. Its multipliers are of this face, so ``faces`` is empty. The upper part is a tree for the whole cell, with the lower part.

    Attributes:
        normals: (O, n) of the oblique cuts, in the order of the nodes.
    """

    KIND: ClassVar[str] = "cells"
    NODES: ClassVar[tuple[int, ...]] = (PLANE, OPEN, OBLIQUE)

    normals: Array

    def own(self, number: Callable[[Volume], int]) -> tuple[dict[str, Any], dict[str, np.ndarray]]:
        header, arrays = super().own(number)
        return header, arrays | {"normals": self.normals}

    @classmethod
    def read(cls, common: Common, header: dict[str, Node], volumes: Sequence[Volume], arrays: Arrays, prefix: str) -> Self:
        part = PartitionProof.read(common, header, volumes, arrays, prefix)
        name = f"{prefix}/normals"
        normals = arrays.floats(name) if arrays.has(name) else np.zeros((0, common.scene.n))  # maps of before had no oblique cuts
        return cls(**vars(part), normals=normals)

    @property
    def offsets(self) -> Array:
        """Returns v of each oblique cut, (O,)."""
        return self.cuts[self.nodes[self.nodes >= 0] == OBLIQUE]


@dataclass(frozen=True)
class MapProof:
    """Holds the map of a scene.

    Attributes:
        pairs: which pairs of the scene each of the maps is about, in the order of the map's own.
        maps: they are about what :func:`sub_scene` gives for these pairs.
    """

    scene: Scene
    pairs: tuple[tuple[Pair, ...], ...]
    maps: tuple[PairMap, ...]

    def to_bytes(self) -> bytes:
        """Returns the map as a file, in which each pair's map is a file of its own."""
        header = {
            "format": FORMAT,
            "kind": "map",
            "scene": self.scene.to_document(),
            "pairs": [[[pair.a, pair.b] for pair in pairs] for pairs in self.pairs],
        }
        return pack(header, {f"map/{i}": np.frombuffer(part.to_bytes(), np.int8) for i, part in enumerate(self.maps)})

    @classmethod
    def from_bytes(cls, data: bytes, check: Callable[[Scene], None] = lambda _: None) -> MapProof:
        """Reads what :meth:`to_bytes` writes.

        Args:
            check: refuses a scene that makes no sense, before anything is made of it; of files from strangers it has to.

        Raises:
            ProofError: the file is no map, or too large; or what ``check`` raises.
        """
        header, unpacked = unpack(data, "map")
        with malformed():
            fields, arrays = head(header, "pairs"), Arrays(unpacked)
            scene = Scene.from_document(header["scene"])
            check(scene)
            known = {(pair.a, pair.b): pair for pair in scene.pairs}
            pairs = tuple(_pairs(node, known) for node in fields["pairs"].items(limits.PROOFS))
            _check_size(scene, pairs)
            maps, size = list[PairMap](), 0
            for i, about in enumerate(pairs):
                file = arrays.take(f"map/{i}", "int8").tobytes()
                size += unpacked_size(file)
                if size > limits.UNPACKED_BYTES:
                    raise ProofError("proof_too_large", f"the trees of a map have more than {limits.UNPACKED_BYTES} bytes")
                maps.append(PairMap.from_bytes(file, sub_scene(scene, about).scene))
            arrays.end()
            return cls(scene, pairs, tuple(maps))


def _check_size(scene: Scene, pairs: Sequence[Sequence[Pair]]) -> None:
    """Refuses a map whose trees together have too many vertices and joints. Each tree counts those of its own pairs."""
    cost = {geometry.name: len(geometry.vertices) + len(way(scene, geometry.body)) for geometry in scene.geometries}
    if sum(cost[name] for about in pairs for pair in about for name in (pair.a, pair.b)) > limits.CONTAINED:
        raise ProofError("proof_too_large", "the trees of a map are about more vertices and joints than are checked")


def _pairs(node: Node, known: Mapping[tuple[str, str], Pair]) -> tuple[Pair, ...]:
    """Returns pairs of the scene from their names."""
    found = []
    for item in node.items(limits.PAIRS):
        names = item.two()
        pair = known.get((names[0].text(), names[1].text()))
        if pair is None:
            raise ProofError("proof_pair", f"{item.where} is no pair of the scene")
        found.append(pair)
    if not found:
        raise ProofError("proof_pair", f"{node.where} names no pair")
    return tuple(found)

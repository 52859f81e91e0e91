"""An outline says which cells a partition has and the state of each, without planes and multipliers. It proves nothing.

The outlines of a proof are read from its file without inflating the rest of it. A search over partitions writes an outline of what it
leaves (certifier.partition.certification), so that people can look at a pair while it is worked on, and after its job has ended.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import islice, pairwise
from typing import Any, NamedTuple

import numpy as np

from certifier.model import Array, Scene, Volume
from certifier.proof.container import FORMAT, pack, some_of, unpack
from certifier.proof.partition import EMPTY, OPEN, PLANE, PartitionProof
from certifier.proof.separation import DEFAULT_FORM

KIND = "outline"
FOLDED = -4
"""The cell of this node is divided further, which this outline does not show."""


class Counts(NamedTuple):
    """Says how many cells have a plane, how many miss the polytope, and how many are open."""

    plane: int
    empty: int
    open: int


class Tree(NamedTuple):
    """Holds a tree of cuts as certifier.proof.partition does, perhaps with OPEN and FOLDED nodes; or several, one after the other.

    Attributes:
        nodes: int8, in preorder, the lower part first.
        cuts: where each cut is, in s.
        choices: int8, of each leaf with a plane.
    """

    nodes: np.ndarray
    cuts: Array
    choices: np.ndarray

    @property
    def open(self) -> int:
        """Returns how many nodes are OPEN."""
        return int((self.nodes == OPEN).sum())

    def ends(self) -> np.ndarray:
        """Returns where the nodes below each node end, the node itself included: the number of the first node after them."""
        waiting = np.cumsum(np.where(self.nodes >= 0, 1, -1))
        places, least = np.arange(len(waiting)), waiting.min(initial=0)
        # A node ends where one tree less is waiting than before it, for the first time from there on.
        order = np.sort((waiting - least) * len(waiting) + places)
        before = np.concatenate([[0], waiting[:-1]])
        found = np.searchsorted(order, (before - 1 - least) * len(waiting) + places)
        return order[found] % len(waiting) + 1

    def path(self, s: Array) -> list[int]:
        """Returns the nodes of the one tree whose cells hold the point s, (n,), from the root to a leaf; on a cut, the lower part's."""
        ends, inner = self.ends(), _sums(self.nodes >= 0)
        found = [0]
        while (joint := self.nodes[found[-1]]) >= 0:
            node = found[-1]
            found.append(node + 1 if s[joint] <= self.cuts[inner[node]] else int(ends[node + 1]))
        return found

    def split(self) -> list[Tree]:
        """Returns the trees one by one."""
        waiting = np.cumsum(np.where(self.nodes >= 0, 1, -1))
        lowest = np.minimum.accumulate(np.concatenate([[0], waiting]))
        ends = np.flatnonzero(lowest[1:] < lowest[:-1]) + 1
        return self._cut_at(ends)[:-1]

    def grafted(self, below: Sequence[Tree]) -> Tree:
        """Returns the trees with others in the places of the open nodes; there is one for each, in order."""
        first, *others = self._cut_at(np.flatnonzero(self.nodes == OPEN))
        joined = [first]
        for tree, after in zip(below, others, strict=True):
            joined += [tree, after._replace(nodes=after.nodes[1:])]
        return Tree(*(np.concatenate(streams) for streams in zip(*joined, strict=True)))

    def _cut_at(self, places: np.ndarray) -> list[Tree]:
        inner, planes = (_sums(kind)[places] for kind in (self.nodes >= 0, self.nodes == PLANE))
        streams = (np.split(stream, at) for stream, at in ((self.nodes, places), (self.cuts, inner), (self.choices, planes)))
        return [Tree(*part) for part in zip(*streams, strict=True)]


ONE_PLANE, ONE_OPEN = (
    Tree(np.array([kind], dtype=np.int8), np.zeros(0), np.zeros(choices, dtype=np.int8)) for kind, choices in ((PLANE, 1), (OPEN, 0))
)


def _sums(flags: np.ndarray) -> np.ndarray:
    """Returns how many flags are set before each place, and in all."""
    return np.concatenate([[0], np.cumsum(flags)])


@dataclass(frozen=True)
class Silhouette:
    """Says what a volume is, without its vertices.

    Attributes:
        geometries: the names of the geometries that it contains.
        body: the body that it is fixed to.
        vertices: how many vertices it has.
        radius: in metres, without the padding.
        own: it is exactly the one geometry that it names.
    """

    geometries: tuple[str, ...]
    body: str
    vertices: int
    radius: float
    own: bool

    @classmethod
    def of(cls, volume: Volume, scene: Scene) -> Silhouette:
        return cls(volume.geometries, volume.body, len(volume.vertices), float(volume.radius), volume.is_geometry_of(scene))


Sides = tuple[tuple[Silhouette, ...], tuple[Silhouette, ...]]
"""For either volume: the volume itself, and then the coarse ones that a leaf may choose in its place."""


@dataclass(frozen=True, eq=False)
class Outline:
    """Holds the cells of one partition, or of what a search was given of one.

    Attributes:
        joints: position indices of the joints in play, ascending.
        lower, upper: (n,) the root cell of the partition, in s.
        sides: what the leaves' planes separate.
        tree: the tree of cuts; one after the other where a search was given several cells.
        folded: what is below every FOLDED node of the tree, in order.
    """

    joints: tuple[int, ...]
    lower: Array
    upper: Array
    sides: Sides
    tree: Tree
    folded: tuple[Counts, ...] = ()

    @property
    def chosen(self) -> list[tuple[Silhouette, Silhouette]]:
        """Returns what a leaf's plane separates, by the leaf's choice."""
        first, second = self.sides
        return [(a, b) for b in second for a in first]

    def cell(self, path: Sequence[int]) -> tuple[Array, Array]:
        """Returns the bounds (n,) of the cell of the last node of a path of the tree."""
        lower, upper, inner = self.lower.copy(), self.upper.copy(), _sums(self.tree.nodes >= 0)
        for above, node in pairwise(path):
            bound = upper if node == above + 1 else lower
            bound[self.tree.nodes[above]] = self.tree.cuts[inner[above]]
        return lower, upper

    @property
    def counts(self) -> Counts:
        """Returns how many leaves of each kind there are, with those below FOLDED nodes."""
        shown = [int((self.tree.nodes == kind).sum()) for kind in (PLANE, EMPTY, OPEN)]
        return Counts(*map(sum, zip(shown, *self.folded, strict=True)))

    def to_bytes(self) -> bytes:
        """Returns the outline, in which nothing is folded, as a file."""
        header = {
            "format": FORMAT,
            "kind": KIND,
            "joints": list(self.joints),
            "sides": [[vars(one) for one in side] for side in self.sides],
        }
        return pack(header, {"lower": self.lower, "upper": self.upper, **self.tree._asdict()})

    @classmethod
    def from_bytes(cls, data: bytes) -> Outline:
        """Reads what :meth:`to_bytes` writes.

        Raises:
            ProofError: the file is no outline.
        """
        header, arrays = unpack(data, KIND)
        first, second = (tuple(Silhouette(**{**one, "geometries": tuple(one["geometries"])}) for one in side) for side in header["sides"])
        tree = Tree(*(arrays[name] for name in Tree._fields))
        return cls(tuple(header["joints"]), arrays["lower"], arrays["upper"], (first, second), tree)

    def gone_on(self, rounds: Sequence[Sequence[Outline | None]]) -> Outline:
        """Returns the outline with what later rounds have made of its open cells, which were divided among each round's parts in turn.

        Args:
            rounds: for each later round, in order, what each of its parts has left; None for a part that has left nothing yet.
        """
        made, given = [], self.tree.open
        for parts in rounds:
            count = len(parts)
            trees = [[ONE_OPEN] * len(range(i, given, count)) if part is None else part.tree.split() for i, part in enumerate(parts)]
            made.append(trees)
            given = sum(tree.open for some in trees for tree in some)
        below = [ONE_OPEN] * given
        for trees in reversed(made):
            left = iter(below)
            grown = [[tree.grafted(list(islice(left, tree.open))) for tree in some] for some in trees]
            below = [grown[cell % len(grown)][cell // len(grown)] for cell in range(sum(map(len, grown)))]
        return replace(self, tree=self.tree.grafted(below))

    def shown(self, most: int) -> Outline:
        """Returns the outline with at most ``most`` nodes, at least one. Cells are folded from a depth on, the same one for all."""
        nodes, cuts, choices = self.tree
        if len(nodes) <= most:
            return self
        ends, level, last = self.tree.ends(), np.array([0]), np.array([0])
        kept = np.zeros(len(nodes), dtype=bool)
        while kept.sum() + len(level) <= most:
            kept[level], last = True, level
            cut = level[nodes[level] >= 0]
            level = np.concatenate([cut + 1, ends[cut + 1]])
        folded = np.sort(last[nodes[last] >= 0])
        before = [_sums(nodes == kind) for kind in (PLANE, EMPTY, OPEN)]
        below = tuple(Counts(*(int(sums[ends[node]] - sums[node]) for sums in before)) for node in folded)
        left = nodes.copy()
        left[folded] = FOLDED
        tree = Tree(left[kept], cuts[(kept & (left >= 0))[nodes >= 0]], choices[kept[nodes == PLANE]])
        return replace(self, tree=tree, folded=below)


@dataclass(frozen=True, eq=False)
class ProofOutline:
    """Says how a proof separates two volumes.

    Attributes:
        form: that of the proof: ``pair``, one plane on all of the polytope, or ``partition``.
        cells: its cells; a single one with a plane where the form is ``pair``.
    """

    form: str
    cells: Outline


def outlines(data: bytes, scene: Scene) -> list[ProofOutline]:
    """Returns the outlines of the proofs in a file about a region of the scene, or about a pair, in order. They are read, not checked.

    Raises:
        ProofError: the file is no such file, or beyond the limits.
    """
    header, arrays = some_of(data, _is_outline)
    volumes = [_silhouette(scene, arrays, i, volume) for i, volume in enumerate(header["volumes"])]
    return [_outline(scene, arrays, i, proof, volumes) for i, proof in enumerate(header["proofs"])]


def _is_outline(name: str) -> bool:
    *folder, last = name.split("/")
    return last in {"ground": ("mid", "half"), "volume": ("vertices", "radius"), "proof": Tree._fields}.get(folder[0] if folder else "", ())


def _silhouette(scene: Scene, arrays: dict[str, np.ndarray], i: int, header: dict[str, Any]) -> Silhouette:
    names = tuple(header["geometries"])
    if "body" not in header:
        return Silhouette.of(Volume.of(scene.geometry(names[0])), scene)
    return Silhouette(names, header["body"], len(arrays[f"volume/{i}/vertices"]), arrays[f"volume/{i}/radius"].item(), own=False)


def _outline(scene: Scene, arrays: dict[str, np.ndarray], i: int, header: dict[str, Any], volumes: Sequence[Silhouette]) -> ProofOutline:
    form, ground = header.get("form", DEFAULT_FORM), f"ground/{header['ground']}"
    coarse = header.get("coarse", ((), ()))
    first, second = ((volumes[own], *(volumes[number] for number in others)) for own, others in zip(header["volumes"], coarse, strict=True))
    tree = Tree(*(arrays[f"proof/{i}/{name}"] for name in Tree._fields)) if form == PartitionProof.KIND else ONE_PLANE
    mid, half = arrays[f"{ground}/mid"], arrays[f"{ground}/half"]
    joints = _joints_in_play(scene, header["frame"], (one.body for one in (*first, *second)))
    return ProofOutline(form, Outline(joints, mid - half, mid + half, (first, second), tree))


def _joints_in_play(scene: Scene, frame: str, bodies: Iterable[str]) -> tuple[int, ...]:
    """Returns the position indices of the joints between the frame and any of the bodies, ascending."""
    here = _to_the_world(scene, frame)
    between = set().union(*(here ^ _to_the_world(scene, body) for body in {*bodies}))
    return tuple(sorted({index for _, index in between}))


def _to_the_world(scene: Scene, body: str) -> set[tuple[str, int]]:
    """Returns the names and the position indices of the joints that move between a body and the world."""
    found, joint = set[tuple[str, int]](), scene.joint_above.get(body)
    while joint is not None:
        found |= set() if joint.index is None else {(joint.name, joint.index)}
        joint = scene.joint_above.get(joint.parent)
    return found

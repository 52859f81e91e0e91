"""Pairs that share a tree: what their cells are tried with, and what a piece of work on open cells gives."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from certifier.errors import ProofError
from certifier.kinematics import Kinematics
from certifier.map import engine
from certifier.map.descent import in_order, lengths_of, preorder
from certifier.map.settle import CONTACTS, LEVELS, Levels
from certifier.model import Array, Box, Pair, Scene
from certifier.partition.area import Area
from certifier.partition.bodies import Bodies
from certifier.partition.frames import choose_frame
from certifier.partition.levels import MANY_JOINTS, levels_of
from certifier.partition.together import volumes_of
from certifier.partition.tree import ALL
from certifier.proof.ground import Ground
from certifier.proof.map import PairMap
from certifier.proof.partition import OBLIQUE, OPEN, PLANE, STREAMS, choices_of
from certifier.proof.sub_scene import sub_scene
from certifier.verify.partition import PartitionCheck

SAMPLES = 500
"""The volumes of a level are chosen by this many configurations."""
APART = (0.3, 0.7)
"""The fattest balls of a tree are apart at the first share of all configurations, the next ones at the second share
(certifier.partition.levels). Cells in which they touch mostly are tried with the next level."""
APART_BY = 0.03
"""They are apart by more than this, in metres. Where balls are nearer, only narrow cells have planes."""
PIECES = 25
"""A vertex may take this many pieces; a cell that needs more is cut, because its pieces take longer to verify than those of two cells."""
TOGETHER = 256
"""This many cells are verified at once."""


class OpenCells(NamedTuple):
    """Open cells of a tree.

    Attributes:
        lower, upper: (C, k) their bounds.
        level: (C,) how many levels, the finest ones, are to be tried.
        contacts, known: (C, CONTACTS, k), (C,) configurations at which the volumes of this level touch.
        waits: (C,) as certifier.map.engine.Work has it.
        samples: (C + 1,) where the numbers of a cell's samples begin in ``numbers``.
        numbers: the numbers of samples.
    """

    lower: Array
    upper: Array
    level: Array
    contacts: Array
    known: Array
    waits: Array
    samples: Array
    numbers: Array

    def some(self, which: Array) -> OpenCells:
        """Returns some of the cells."""
        begin, places = _ranges(self.samples[which], self.samples[which + 1])
        return self.of([array[which] for array in self[:6]], begin, self.numbers[places])

    @classmethod
    def of(cls, of_cells: Sequence[Array], samples: Array, numbers: Array) -> OpenCells:
        return cls._make([*of_cells, samples, numbers])

    def with_more(self, others: OpenCells) -> OpenCells:
        """Returns these cells and then others."""
        parts = [np.concatenate(both) for both in zip(self[:6], others[:6], strict=True)]
        samples = np.concatenate([self.samples, self.samples[-1] + others.samples[1:]])
        return self.of(parts, samples, np.concatenate([self.numbers, others.numbers]))


def _ranges(first: Array, last: Array) -> tuple[Array, Array]:
    """Returns the numbers from each first one to each last one, which is left out, one range after the other; and where each begins."""
    lengths = last - first
    begin = np.concatenate([[0], np.cumsum(lengths)])
    return begin, np.repeat(first - begin[:-1], lengths) + np.arange(begin[-1])


class Proved(NamedTuple):
    """Planes with their proofs.

    Attributes:
        planes, choices, pieces, counts, multipliers: as a proof holds them.
        lengths: (planes, 3) how many nodes of pieces, pieces, and multipliers each plane has.
    """

    planes: Array
    choices: Array
    pieces: Array
    counts: Array
    multipliers: Array
    lengths: Array

    @classmethod
    def nothing(cls, k: int) -> Proved:
        """Returns no planes of k joints."""
        none = np.zeros(0, np.int8)
        return cls(np.zeros((0, 5, 1 + k)), none, none, none.astype(np.int16), none.astype(np.float32), np.zeros((0, 3), np.int64))

    @classmethod
    def together(cls, parts: Sequence[Proved]) -> Proved:
        """Returns the planes of all parts."""
        return cls(*map(np.concatenate, zip(*parts, strict=True)))

    def some(self, which: Array) -> Proved:
        """Returns some of the planes, in this order."""
        ends = np.cumsum(self.lengths, axis=0)
        several = (in_order(array, ends[:, i].copy(), which) for i, array in enumerate((self.pieces, self.counts, self.multipliers)))
        return Proved._make([self.planes[which], self.choices[which], *several, self.lengths[which]])

    @property
    def bytes(self) -> int:
        """Returns how many bytes they have in a proof."""
        return sum(array.nbytes for array in self[:-1])


class Found(NamedTuple):
    """What a piece of work leaves of the cells that it was given.

    Attributes:
        looked: how many cells were looked at.
        nodes, cuts, normals: a tree for each cell, one after the other, as a proof holds them.
        proved: the planes, in the order of the nodes.
        left: the open cells, in the order of the nodes.
    """

    looked: int
    nodes: Array
    cuts: Array
    normals: Array
    proved: Proved
    left: OpenCells

    @classmethod
    def of_none(cls, k: int) -> Found:
        """Returns what is found of no cells, of k joints."""
        bounds, none = np.zeros((0, k)), np.zeros(0, np.int64)
        return cls.nothing(OpenCells(bounds, bounds, none, np.zeros((0, CONTACTS, k)), none, none, np.zeros(1, np.int64), none))

    @classmethod
    def nothing(cls, given: OpenCells) -> Found:
        """Returns the cells as they were, but that they are not looked at any more."""
        C, k = given.lower.shape
        left = given._replace(level=np.zeros(C, np.int64))
        return cls(0, np.full(C, OPEN, np.int8), np.zeros(0), np.zeros((0, k)), Proved.nothing(k), left)

    @property
    def bytes(self) -> int:
        """Returns about how many bytes it has in a proof."""
        return int(9 * len(self.nodes) + self.normals.nbytes + self.proved.bytes)


class PairTree:
    """What the cells of some pairs between the same two rigid parts are tried with.

    Args:
        pairs: of the scene; one tree is about all of them.

    Attributes:
        scene: what the pairs are about; ``positions`` says which positions of the whole scene its joints have.
    """

    def __init__(self, whole: Scene, pairs: Sequence[Pair]) -> None:
        self.pairs, (self.scene, self.positions) = tuple(pairs), sub_scene(whole, pairs)
        self._area = limits_of(self.scene)
        self._volumes = volumes_of(self.scene, self.scene.pairs)
        self._frame, _ = choose_frame(self._area.kinematics, self._volumes, self._area.lower, self._area.upper)
        self._coarse, levels, _, two_chains = levels_of(self._area, self._frame, self._volumes, APART, APART_BY)
        chosen = choices_of(self._volumes, self._coarse)
        choices = [i + (1 + len(self._coarse[0])) * j for i, j in levels[:1] + levels[1:][-LEVELS + 1 :]]
        bodies = [Bodies(self._area, self._frame, chosen[choice]) for choice in choices]
        compiled = [each.pair._replace(pieces=PIECES) for each in bodies]
        self._pairs = tuple(compiled + compiled[:1] * (LEVELS - len(compiled)))
        self._check = PartitionCheck(self.scene, self._area.ground, {}, {})
        revolute = self.scene.revolute
        scales = np.array([np.where(revolute, 1.0, each.extent) for each in bodies])
        self._levels = Levels(len(bodies), np.array(choices, np.int8), scales, revolute, len(bodies[0].joints) >= MANY_JOINTS, two_chains)

    @property
    def joints(self) -> int:
        """Returns how many joints move the fattest volumes of the tree."""
        return len(self._pairs[self._levels.number - 1].joints)

    def root(self, numbers: Array) -> OpenCells:
        """Returns the cell of all configurations within the joint limits, with samples of these numbers."""
        cells = self.cells(self._area.lower[None].copy(), self._area.upper[None].copy())
        return cells._replace(samples=np.array([0, len(numbers)]), numbers=numbers)

    def cells(self, lower: Array, upper: Array) -> OpenCells:
        """Returns open cells with these bounds, (C, k) each, of which nothing is known, without samples."""
        C, k = lower.shape
        none = np.zeros(C, np.int64)
        return OpenCells(lower, upper, none + ALL, np.zeros((C, CONTACTS, k)), none, none, np.zeros(C + 1, np.int64), none[:0])

    def is_of(self, former: PairMap) -> bool:
        """Says whether a map is about the very volumes and frame of this tree, so that the tree may go on with it."""
        none = {name: getattr(former, name)[:0] for name in (*STREAMS, "normals")}
        ours = self.proof(none["nodes"], none["cuts"], none["normals"], Proved.nothing(self.scene.n))
        return replace(former, **none).to_bytes() == ours.to_bytes()

    def proved(self, former: PairMap) -> Proved:
        """Returns the planes of a map of this tree."""
        vertices = np.array([sum(len(volume.vertices) for volume in chosen) for chosen in former.chosen])
        lengths = lengths_of(former.pieces, former.counts, vertices[former.choices])
        return Proved(former.planes, former.choices, former.pieces, former.counts, former.multipliers, lengths)

    def advance(self, given: OpenCells, samples: Array, weights: Array, most: int, water: float) -> Found:
        """Works on open cells until ``most`` were looked at, or none has samples of more weight than ``water``.

        Args:
            samples, weights: (S, k), (S,), in the coordinates of the tree's joints; ``given`` has their numbers.
        """
        C, k = given.lower.shape
        work = engine.empty(C, most, k)
        for array, of_cells in zip((work.lower, work.upper, work.level, work.contacts, work.known, work.waits), given[:6], strict=True):
            array[:C] = of_cells
        work.begin[:C], work.end[:C] = given.samples[:-1], given.samples[1:]
        order = given.numbers.copy()
        size, looked, kept, streams = engine.advance(self._pairs, self._levels, work, C, order, samples, weights, most, water)
        nodes, cuts, numbers = preorder(work.kinds, work.values, work.children, size, C)
        opened, by_place = numbers[nodes == OPEN], work.plane[numbers[nodes == PLANE]]
        begin, places = _ranges(work.begin[opened], work.end[opened])
        of_open = (work.lower, work.upper, work.level, work.contacts, work.known, work.waits)
        left = OpenCells.of([array[opened] for array in of_open], begin, order[places])
        held = kept.held[0]
        lengths = np.diff(kept.bounds[: held + 1], axis=0)
        proved = Proved._make([kept.planes[:held], kept.choices[:held], *streams, lengths]).some(by_place)
        return Found(looked, nodes, cuts, work.normals[work.plane[numbers[nodes == OBLIQUE]]], proved, left)

    def verified(self, given: OpenCells, found: Found) -> Found:
        """Returns what a piece of work has found if the verifier accepts it. Else its cells stay open, and are not looked at any more."""
        proof = self.proof(found.nodes, found.cuts, found.normals, found.proved)
        try:
            check = self._check.prepared(proof, list(zip(given.lower, given.upper, strict=True)))
            for cells in check.cells(TOGETHER):
                check.gap(cells)
        except ProofError:
            return Found.nothing(given)
        return found

    def proof(self, nodes: Array, cuts: Array, normals: Array, proved: Proved) -> PairMap:
        """Returns the map that trees of this pair are (:class:`Found` says what the arguments are)."""
        planes, choices, pieces, counts, multipliers, _ = proved
        arrays = (nodes, cuts, planes, choices, pieces, counts, np.zeros(0, np.int16), multipliers, normals)
        return PairMap(self.scene, self._volumes, self._frame, self._area.ground, self._area.center, self._coarse, *arrays)


def limits_of(scene: Scene) -> Area:
    """Returns all configurations within the joint limits as the search for planes sees them."""
    n, box = scene.n, Box.around(*scene.outer_limits)
    eye, none = np.eye(n), np.zeros((n, n))
    ground = Ground(np.zeros((0, n)), np.zeros(0), box.mid, box.half, np.hstack([none, eye]), np.hstack([eye, none]))
    polytope = scene.polytope(np.zeros((0, n)), np.zeros(0))
    q = np.random.default_rng(0).uniform(scene.q_lower, scene.q_upper, size=(SAMPLES, n))
    middle = scene.to_s((scene.q_lower + scene.q_upper) / 2)
    return Area(scene, Kinematics.of(scene), polytope, box.lower, box.upper, middle, scene.to_s(q), ground, np.ones(2 * n), polytope)

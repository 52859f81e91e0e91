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
from certifier.proof.partition import OPEN, PLANE, STREAMS, choices_of
from certifier.proof.sub_scene import sub_scene
from certifier.verify.partition import PartitionCheck

SAMPLES = 500
"""The volumes of a level are chosen by this many configurations."""
APART = (0.3, 0.7)
"""The fattest balls of a tree are apart at the first share of all configurations, the next ones at the second share
(certifier.partition.levels). Cells in which they touch mostly are tried with the next level."""
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
        samples: (C + 1,) where the numbers of a cell's samples begin in ``numbers``.
        numbers: the numbers of samples.
    """

    lower: Array
    upper: Array
    level: Array
    contacts: Array
    known: Array
    samples: Array
    numbers: Array

    def some(self, which: Array) -> OpenCells:
        """Returns some of the cells."""
        begin, places = _ranges(self.samples[which], self.samples[which + 1])
        return self.of([array[which] for array in self[:5]], begin, self.numbers[places])

    @classmethod
    def of(cls, of_cells: Sequence[Array], samples: Array, numbers: Array) -> OpenCells:
        lower, upper, level, contacts, known = of_cells
        return cls(lower, upper, level, contacts, known, samples, numbers)

    def with_more(self, others: OpenCells) -> OpenCells:
        """Returns these cells and then others."""
        parts = [np.concatenate(both) for both in zip(self[:5], others[:5], strict=True)]
        samples = np.concatenate([self.samples, self.samples[-1] + others.samples[1:]])
        return self.of(parts, samples, np.concatenate([self.numbers, others.numbers]))


def _ranges(first: Array, last: Array) -> tuple[Array, Array]:
    """Returns the numbers from each first one to each last one, which is left out, one range after the other; and where each begins."""
    lengths = last - first
    begin = np.concatenate([[0], np.cumsum(lengths)])
    return begin, np.repeat(first - begin[:-1], lengths) + np.arange(begin[-1])


class Found(NamedTuple):
    """What a piece of work leaves of the cells that it was given.

    Attributes:
        looked: how many cells were looked at.
        nodes, cuts, planes, choices, pieces: a tree for each cell, one after the other, as a proof holds them.
        lengths: (planes, 2) how many nodes of pieces, and how many pieces, each plane has.
        left: the open cells, in the order of the nodes.
    """

    looked: int
    nodes: Array
    cuts: Array
    planes: Array
    choices: Array
    pieces: Array
    lengths: Array
    left: OpenCells

    @classmethod
    def of_none(cls, k: int) -> Found:
        """Returns what is found of no cells, of k joints."""
        none = np.zeros((0, k))
        return cls.nothing(
            OpenCells(none, none, none[:, 0], np.zeros((0, CONTACTS, k)), none[:, 0], np.zeros(1, np.int64), np.zeros(0, np.int64))
        )

    @classmethod
    def nothing(cls, given: OpenCells) -> Found:
        """Returns the cells as they were, but that they are not looked at any more."""
        C, k = given.lower.shape
        none = np.zeros(0, np.int8)
        left = given._replace(level=np.zeros(C, np.int64))
        return cls(0, np.full(C, OPEN, np.int8), np.zeros(0), np.zeros((0, 5, 1 + k)), none, none, np.zeros((0, 2), np.int64), left)


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
        self._coarse, levels, _, two_chains = levels_of(self._area, self._frame, self._volumes, APART)
        chosen = choices_of(self._volumes, self._coarse)
        choices = [i + (1 + len(self._coarse[0])) * j for i, j in levels[:1] + levels[1:][-LEVELS + 1 :]]
        bodies = [Bodies(self._area, self._frame, chosen[choice]) for choice in choices]
        compiled = [each.pair._replace(pieces=PIECES) for each in bodies]
        self._pairs = tuple(compiled + compiled[:1] * (LEVELS - len(compiled)))
        self._check = PartitionCheck(self.scene, self._area.ground, {}, {})
        revolute = self.scene.revolute
        scales = np.array([np.where(revolute, 1.0, each.extent) for each in bodies])
        self._levels = Levels(len(bodies), np.array(choices, np.int8), scales, revolute, len(bodies[0].joints) >= MANY_JOINTS, two_chains)

    def root(self, numbers: Array) -> OpenCells:
        """Returns the cell of all configurations within the joint limits, with samples of these numbers."""
        cells = self.cells(self._area.lower[None].copy(), self._area.upper[None].copy())
        return cells._replace(samples=np.array([0, len(numbers)]), numbers=numbers)

    def cells(self, lower: Array, upper: Array) -> OpenCells:
        """Returns open cells with these bounds, (C, k) each, of which nothing is known, without samples."""
        C, k = lower.shape
        none = np.zeros(C, np.int64)
        return OpenCells(lower, upper, none + ALL, np.zeros((C, CONTACTS, k)), none, np.zeros(C + 1, np.int64), none[:0])

    def is_of(self, former: PairMap) -> bool:
        """Says whether a map is about the very volumes and frame of this tree, so that the tree may go on with it."""
        none = {name: getattr(former, name)[:0] for name in STREAMS}
        lengths = np.zeros((0, 2), np.int64)
        ours = self.proof(none["nodes"], none["cuts"], none["planes"], none["choices"], none["pieces"], lengths)
        return replace(former, **none).to_bytes() == ours.to_bytes()

    def lengths(self, former: PairMap) -> Array:
        """Returns how many nodes of pieces, and how many pieces, each plane of a map of this tree has, (P, 2)."""
        vertices = np.array([sum(len(volume.vertices) for volume in chosen) for chosen in former.chosen])
        return lengths_of(former.pieces, vertices[former.choices])

    def advance(self, given: OpenCells, samples: Array, weights: Array, most: int, water: float) -> Found:
        """Works on open cells until ``most`` were looked at, or none has samples of more weight than ``water``.

        Args:
            samples, weights: (S, k), (S,), in the coordinates of the tree's joints; ``given`` has their numbers.
        """
        C, k = given.lower.shape
        work = engine.empty(C + 2 * most, k)
        work.lower[:C], work.upper[:C], work.level[:C], work.contacts[:C], work.known[:C] = given[:5]
        work.begin[:C], work.end[:C] = given.samples[:-1], given.samples[1:]
        order = given.numbers.copy()
        size, looked, kept, pieces = engine.advance(self._pairs, self._levels, work, C, order, samples, weights, most, water)
        nodes, cuts, numbers = preorder(work.kinds, work.values, work.children, size, C)
        opened, by_place = numbers[nodes == OPEN], work.plane[numbers[nodes == PLANE]]
        begin, places = _ranges(work.begin[opened], work.end[opened])
        of_cells = (work.lower, work.upper, work.level, work.contacts, work.known)
        left = OpenCells.of([array[opened] for array in of_cells], begin, order[places])
        ordered, lengths = in_order(pieces, np.ascontiguousarray(kept.bounds[1:, 0]), by_place), np.diff(kept.bounds, axis=0)
        return Found(looked, nodes, cuts, kept.planes[by_place], kept.choices[by_place], ordered, lengths[by_place], left)

    def verified(self, given: OpenCells, found: Found) -> Found:
        """Returns what a piece of work has found if the verifier accepts it. Else its cells stay open, and are not looked at any more."""
        proof = self.proof(found.nodes, found.cuts, found.planes, found.choices, found.pieces, found.lengths)
        try:
            check = self._check.prepared(proof, list(zip(given.lower, given.upper, strict=True)))
            for cells in check.cells(TOGETHER):
                check.gap(cells)
        except ProofError:
            return Found.nothing(given)
        return found

    def proof(self, nodes: Array, cuts: Array, planes: Array, choices: Array, pieces: Array, lengths: Array) -> PairMap:
        """Returns the map that trees of this pair are (:class:`Found` says what the arguments are)."""
        area, none = self._area, np.zeros(0)
        counts = np.zeros(int(lengths[:, 1].sum()), np.int16)
        arrays = (nodes, cuts, planes, choices, pieces, counts, none.astype(np.int16), none.astype(np.float32))
        return PairMap(self.scene, self._volumes, self._frame, area.ground, area.center, self._coarse, *arrays)


def limits_of(scene: Scene) -> Area:
    """Returns all configurations within the joint limits as the search for planes sees them."""
    n, box = scene.n, Box.around(*scene.outer_limits)
    eye, none = np.eye(n), np.zeros((n, n))
    ground = Ground(np.zeros((0, n)), np.zeros(0), box.mid, box.half, np.hstack([none, eye]), np.hstack([eye, none]))
    polytope = scene.polytope(np.zeros((0, n)), np.zeros(0))
    q = np.random.default_rng(0).uniform(scene.q_lower, scene.q_upper, size=(SAMPLES, n))
    middle = scene.to_s((scene.q_lower + scene.q_upper) / 2)
    return Area(scene, Kinematics.of(scene), polytope, box.lower, box.upper, middle, scene.to_s(q), ground, np.ones(2 * n), polytope)

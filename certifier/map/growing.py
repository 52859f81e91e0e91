"""The map of a scene while it grows: samples say where work is worth most, rounds deal it out, and trees take what was found.

Samples are uniform in q and free of collision. A sample weighs the more, the fewer trees are open at it, because it counts as proved only
when none is. A cell weighs as much as the samples in it. What is proved is estimated with other samples, which weigh nothing.
The rounds are the same whatever the machine does, so the same effort gives the same map.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise, product
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from certifier.map.descent import Descent
from certifier.map.pair import Found, OpenCells, PairTree, Proved
from certifier.map.trees import Pairs, Plan
from certifier.model import Array, Scene
from certifier.proof import limits
from certifier.proof.map import MapProof, PairMap
from certifier.proof.partition import OBLIQUE, PLANE, STREAMS

HELD, FIRST, MOST_BATCHES = 4000, 8000, 16
"""HELD samples say what is proved; FIRST ones say where work is, at first. At most MOST_BATCHES times as many are drawn for that."""
WANTED, BATCH = 4000, 8192
"""A batch of BATCH new samples is drawn before a round, while fewer than WANTED are open."""
LEAST, GROWTH, MOST = 64, 0.1, 2000
"""A round begins with this share of the cells that were looked at before, but with no fewer than LEAST and no more than MOST cells."""
DEEPER, WATER = 4, 0.5
"""Of the cells that a round begins with, and those that they are cut into, DEEPER times as many are looked at, as long as they weigh
WATER times as much as the lightest of them."""
TASK = 64
"""A task begins with at most this many cells."""
FULL = 0.9
"""A map ends with this part of the bytes that the verifier reads."""
TAKEN_OVER = 0.6
"""At most this part of them comes from a former map."""
DEMAND = 1000.0
"""A configuration that was asked for weighs as much as this many samples."""
HAIR = 1e-8
"""A configuration on a cut is proved if the cells on all sides are: these hold configurations beside it, by HAIR in each joint, radians or
metres. Lookups need 1e-9 (ciris.free_set).
"""
ON_WAYS = 512
"""Before a round, twice as many configurations are drawn on the motions that were asked for. Those not proved yet weigh DEMAND in all."""
SIDES, BESIDE = 128, 20_000
"""At most SIDES configurations beside each one that was asked for are looked at, and about BESIDE beside all of them get cells."""


class Task(NamedTuple):
    """Work on some open cells of a tree.

    Attributes:
        pairs: which name the tree.
        nodes: the cells' nodes in it.
        numbers: of the samples that the cells hold; ``given`` has their places among these.
    """

    pairs: Pairs
    nodes: Array
    numbers: Array
    given: OpenCells
    samples: Array
    weights: Array
    most: int
    water: float


class Coverage(NamedTuple):
    """The estimated share of the free configurations that are proved, and its standard error."""

    share: float
    error: float


@dataclass
class Tree:
    """A tree with its open cells.

    Attributes:
        cells: the open cells, with the numbers of the samples in them.
        nodes: (C,) their nodes.
        found: the planes that were found, in the order in which they were.
    """

    pair: PairTree
    descent: Descent
    cells: OpenCells
    nodes: Array
    found: list[Proved]

    @classmethod
    def of(cls, pair: PairTree, former: PairMap | None = None) -> Tree:
        """Returns a tree without cuts, or one that goes on with a former map of the same pairs, where that has the same volumes."""
        k = pair.scene.n
        tree = cls(pair, Descent(k), pair.root(np.zeros(0, np.int64)), np.zeros(1, np.int64), [Proved.nothing(k)])
        if former is not None and pair.is_of(former):
            tree.nodes = tree.descent.add(tree.nodes, former.nodes, former.cuts, former.normals)
            tree.cells = pair.cells(*tree.descent.boxes(*(bounds[0] for bounds in tree.cells[:2])))
            tree.found.append(pair.proved(former))
        return tree

    @property
    def bytes(self) -> int:
        """Returns about how many bytes the tree has in a proof."""
        return 9 * self.descent.size + self.descent.normals.nbytes + sum(part.bytes for part in self.found)

    def insert(self, numbers: Array, samples: Array) -> Array:
        """Adds samples, (S, n) with these numbers, to the open cells that they lie in, and returns the numbers of those that do."""
        leaves = self.descent.leaves(np.ascontiguousarray(samples[:, self.pair.positions]))
        row = np.full(self.descent.size, -1)
        row[self.nodes] = np.arange(len(self.nodes))
        rows = row[leaves]
        kept = numbers[rows >= 0]
        lengths = np.diff(self.cells.samples)
        all_rows = np.concatenate([np.repeat(np.arange(len(lengths)), lengths), rows[rows >= 0]])
        order = np.argsort(all_rows, kind="stable")
        begin = np.concatenate([[0], np.cumsum(np.bincount(all_rows, minlength=len(lengths)))])
        self.cells = self.cells._replace(samples=begin, numbers=np.concatenate([self.cells.numbers, kept])[order])
        return kept

    def weights(self, of_samples: Array) -> Array:
        """Returns the weights of the open cells, (C,); 0 for those that are not looked at any more."""
        sums = np.concatenate([[0.0], np.cumsum(of_samples[self.cells.numbers])])
        found: Array = sums[self.cells.samples[1:]] - sums[self.cells.samples[:-1]]
        return np.where(self.cells.level > 0, found, 0.0)

    def take(self, nodes: Array, found: Found) -> None:
        """Puts what was found in the places of open cells; ``found`` has the numbers of samples."""
        opened = self.descent.add(nodes, found.nodes, found.cuts, found.normals)
        stay = np.flatnonzero(~np.isin(self.nodes, nodes))
        self.nodes = np.concatenate([self.nodes[stay], opened])
        self.cells = self.cells.some(stay).with_more(found.left)
        self.found.append(found.proved)


def _as_fits(former: MapProof) -> dict[str, PairMap]:
    """Returns the maps of a former map by what they are about, as many as leave room for new cells."""
    sizes = np.cumsum([sum(getattr(part, name).nbytes for name in (*STREAMS, "normals")) for part in former.maps])
    return {part.scene.hash: part for part, size in zip(former.maps, sizes, strict=True) if size <= TAKEN_OVER * limits.UNPACKED_BYTES}


class Trees:
    """The trees of a map of a scene.

    Args:
        former: a map of this scene or another one. Trees about the same bodies on the same joints go on with what it proves.

    Attributes:
        trees: those that work is or was done on.
        taken_over: those that go on with the former map, in the order in which they came.
    """

    def __init__(self, scene: Scene, former: MapProof | None = None) -> None:
        self.scene, self.trees, self.taken_over = scene, dict[Pairs, Tree](), list[Pairs]()
        self._pairs = dict[Pairs, PairTree]()
        self._former = {} if former is None else _as_fits(former)

    def tree(self, pairs: Pairs) -> Tree:
        """Returns the tree of some pairs, a new one if there is none."""
        if pairs not in self.trees:
            pair = self.pair(pairs)
            tree = self.trees[pairs] = Tree.of(pair, self._former.get(pair.scene.hash))
            if len(tree.found) > 1:
                self.taken_over.append(pairs)
        return self.trees[pairs]

    def pair(self, pairs: Pairs) -> PairTree:
        """Returns what the cells of some pairs are tried with."""
        if pairs not in self._pairs:
            self._pairs[pairs] = PairTree(self.scene, pairs)
        return self._pairs[pairs]

    @property
    def planes(self) -> int:
        """Returns how many cells are proved."""
        return sum(tree.descent.held for tree in self.trees.values())

    def contains(self, samples: Array) -> Array:
        """Returns which configurations, (S, n) in s, are proved to be free, (S,)."""
        proved: dict[object, Array] = {pair: np.zeros(len(samples), dtype=bool) for pair in self.scene.pairs}
        for pairs, tree in self.trees.items():
            leaves = tree.descent.leaves(np.ascontiguousarray(samples[:, tree.pair.positions]))
            apart = tree.descent.kinds[leaves] == PLANE
            for pair in pairs:
                proved[pair] |= apart
        return np.logical_and.reduce(list(proved.values())) if proved else np.ones(len(samples), dtype=bool)

    def proof(self) -> MapProof:
        """Returns the map as a proof, with the trees that something was found for, in the order of their pairs."""
        number = {pair: i for i, pair in enumerate(self.scene.pairs)}
        worked = [pairs for pairs, tree in self.trees.items() if len(tree.found) > 1]
        worked.sort(key=lambda pairs: [number[pair] for pair in pairs])
        maps = []
        for pairs in worked:
            tree = self.trees[pairs]
            nodes, cuts, normals, held = tree.descent.in_order()
            maps.append(tree.pair.proof(nodes, cuts, normals, Proved.together(tree.found).some(held)))
        return MapProof(self.scene, tuple(worked), tuple(maps))


def beside(scene: Scene, at: Array, most: int = SIDES) -> Array:
    """Returns configurations a hair beside others in all joints, (D, K, n) in s: one in each direction, or in some of them.

    Args:
        at: (D, n) configurations in s.
        most: K is at most this.
    """
    every = 2**scene.n <= most
    signs = np.array(list(product((1.0, -1.0), repeat=scene.n))) if every else np.random.default_rng(0).choice((1.0, -1.0), (most, scene.n))
    hairs = np.where(scene.revolute, HAIR * (1 + at**2) / 2, HAIR * np.maximum(1.0, np.abs(at)))
    found: Array = np.clip(at[:, None] + signs * hairs[:, None], scene.s_lower, scene.s_upper)
    return found


class Growing(Trees):
    """A map that grows.

    Args:
        at: (D, n) configurations in s that are wanted first; those in collision are left out.
        seed: of every random choice.
        former: as for :class:`Trees`.
        ways: (W, 2, n) joint positions q where straight motions begin and end that are wanted first.

    Attributes:
        looked: how many cells were looked at.
        refused: how many tasks were given up because the verifier refused what they found.
    """

    def __init__(self, scene: Scene, at: Array, seed: int = 0, former: MapProof | None = None, ways: Array | None = None) -> None:
        super().__init__(scene, former)
        self._ways = np.zeros((0, 2, scene.n)) if ways is None else ways
        self._rng = np.random.default_rng(seed)
        self._samples, self._value = np.zeros((0, scene.n)), np.zeros(0)
        self._open, self.looked = np.zeros(0, np.int64), 0
        self._plan, self._bytes, self.refused = Plan(scene), 0, 0
        first, held = self._free(FIRST), self._free(HELD)  # before there are trees, so that what a former map proves is among them
        self._add(first, 1.0)
        self._held = slice(len(first), len(first) + self._add(held, 0.0))
        at = np.concatenate([at, scene.to_s(self._ways.reshape(-1, scene.n))])
        wanted = beside(scene, at[self._plan.free(at)], min(SIDES, max(1, BESIDE // max(1, len(at)))))
        sides = wanted.reshape(-1, scene.n)
        begin = len(self._samples)
        self._wanted = slice(begin, begin + self._add(sides[self._plan.free(sides)], DEMAND / wanted.shape[1]))
        self._bytes = sum(tree.bytes for tree in self.trees.values())

    @property
    def coverage(self) -> Coverage:
        """Returns what is proved, as the held samples say."""
        held = self._open[self._held]
        if not len(held):
            return Coverage(0.0, 1.0)
        share = float((held == 0).mean())
        return Coverage(share, float(np.sqrt(max(share * (1 - share), 1 / len(held)) / len(held))))

    @property
    def wants(self) -> bool:
        """Returns whether a configuration that was asked for is in an open cell that is looked at still."""
        return bool(self._useful[self._wanted].any())

    @property
    def _useful(self) -> NDArray[np.bool_]:
        """Returns which samples are open, (S,), but in no cell that is not looked at any more: such a sample is never proved."""
        found = self._open > 0
        for tree in self.trees.values():
            found[tree.cells.numbers[np.repeat(tree.cells.level == 0, np.diff(tree.cells.samples))]] = False
        return found

    @property
    def full(self) -> bool:
        """Returns whether the verifier would not read a larger map."""
        return self._bytes > FULL * limits.UNPACKED_BYTES or len(self.trees) >= limits.PROOFS

    def round(self) -> list[Task]:
        """Returns the tasks of the next round, in an order that is always the same; none where nothing is left to do."""
        self._draw()
        of_samples = np.where(self._useful, self._value / np.maximum(self._open, 1), 0.0)
        names = list(self.trees)
        weights = [self.trees[name].weights(of_samples) for name in names]
        number = np.repeat(np.arange(len(names)), [len(w) for w in weights])
        row, weight = np.concatenate([np.arange(len(w)) for w in weights] or [number]), np.concatenate(weights or [np.zeros(0)])
        best = np.lexsort((row, number, -weight))
        best = best[: np.count_nonzero(weight > 0)]
        begin = min(max(LEAST, int(GROWTH * self.looked)), MOST)
        if not len(best):
            return []
        water = WATER * float(weight[best[min(begin, len(best) - 1)]])
        chosen = np.sort(best[:begin])
        tasks = []
        for i in np.unique(number[chosen]).tolist():
            rows = row[chosen[number[chosen] == i]]
            tasks += [self._task(names[i], rows[a : a + TASK], of_samples, water) for a in range(0, len(rows), TASK)]
        return tasks

    def take(self, task: Task, found: Found) -> None:
        """Takes what was found for a task; the order does not matter to the map."""
        tree = self.trees[task.pairs]
        left = found.left._replace(numbers=task.numbers[found.left.numbers])
        self._open[task.numbers] -= 1
        self._open[left.numbers] += 1
        tree.take(task.nodes, found._replace(left=left))
        self.looked += found.looked
        self.refused += found.looked == 0
        self._bytes += found.bytes

    def _task(self, name: Pairs, rows: Array, of_samples: Array, water: float) -> Task:
        tree = self.trees[name]
        given = tree.cells.some(rows)
        numbers = given.numbers
        samples = np.ascontiguousarray(self._samples[numbers][:, tree.pair.positions])
        given = given._replace(numbers=np.arange(len(numbers)))
        return Task(name, tree.nodes[rows], numbers, given, samples, of_samples[numbers], DEEPER * len(rows), water)

    def _draw(self) -> None:
        """Draws samples where the map is open: on the motions that are wanted, and anywhere if few are left there."""
        if len(self._ways):
            on_ways = self._beside(np.concatenate([self._on_ways(), self._on_cuts()]))
            self._add(on_ways, DEMAND / max(1, len(on_ways)))
        if np.count_nonzero(self._useful & (self._value > 0)) < WANTED:
            self._add(self._drawn(BATCH), 1.0)

    def _add(self, samples: Array, value: float) -> int:
        """Adds configurations, (S, n) in s and free of collision, which weigh this, and returns how many they are."""
        begin = len(self._samples)
        self._samples = np.concatenate([self._samples, samples])
        self._value = np.concatenate([self._value, np.full(len(samples), value)])
        self._open = np.concatenate([self._open, np.zeros(len(samples), np.int64)])
        for pairs, places in self._plan.assigned(samples, lambda pairs: self.pair(pairs).joints).items():
            self._open[self.tree(pairs).insert(begin + places, samples[places])] += 1
        return len(samples)

    def _free(self, count: int) -> Array:
        """Returns configurations of the scene that are free of collision, at most this many, in s."""
        found: list[Array] = []
        for _ in range(MOST_BATCHES):
            found.append(self._drawn(count))
            if sum(map(len, found)) >= count:
                break
        return np.concatenate(found)[:count]

    def _drawn(self, count: int) -> Array:
        """Draws configurations and returns those that are free of collision, and that the map does not prove yet, in s."""
        return self._left(self._rng.uniform(self.scene.q_lower, self.scene.q_upper, size=(count, self.scene.n)))

    def _on_ways(self) -> Array:
        """Draws joint positions on the motions that are wanted, by their lengths."""
        begin, way = self._ways[:, 0], self._ways[:, 1] - self._ways[:, 0]
        lengths = np.concatenate([[0.0], np.cumsum(np.linalg.norm(way, axis=1))])
        at = lengths[-1] * (np.arange(ON_WAYS) + self._rng.uniform(size=ON_WAYS)) / ON_WAYS
        which = np.clip(np.searchsorted(lengths, at, side="right") - 1, 0, len(way) - 1)
        part = (at - lengths[which]) / np.maximum(np.diff(lengths)[which], np.finfo(float).tiny)
        found: Array = begin[which] + np.clip(part, 0.0, 1.0)[:, None] * way[which]
        return found

    def _on_cuts(self) -> Array:
        """Draws joint positions where the motions that are wanted cross cuts. Two cells may touch there alone."""
        trees = list(self.trees.values())
        sizes = np.cumsum([0, *(tree.descent.size for tree in trees)])
        drawn, which = self._rng.integers(max(1, sizes[-1]), size=ON_WAYS), self._rng.integers(len(self._ways), size=ON_WAYS)
        found = []
        for tree, (first, last) in zip(trees, pairwise(sizes), strict=True):
            mine = (first <= drawn) & (drawn < last)
            kinds, cuts = tree.descent.kinds[drawn[mine] - first], tree.descent.values[drawn[mine] - first]
            inner = (kinds >= 0) & (kinds != OBLIQUE)
            joints, (begin, end) = tree.pair.positions[kinds[inner]], self._ways[which[mine][inner]].swapaxes(0, 1)
            at = np.zeros(begin.shape)
            row = np.arange(len(at))
            at[row, joints] = cuts[inner]
            way = end - begin
            with np.errstate(divide="ignore", invalid="ignore"):
                part = (self.scene.to_q(at)[row, joints] - begin[row, joints]) / way[row, joints]
            crossed = (part >= 0) & (part <= 1)
            found.append(begin[crossed] + part[crossed, None] * way[crossed])
        return np.concatenate([np.zeros((0, self.scene.n)), *found])

    def _beside(self, q: Array) -> Array:
        """Returns joint positions a hair beside others, (S, n), which may lie on cuts, as far as they are left, in s."""
        signs = self._rng.choice((1.0, -1.0), q.shape)
        return self._left(np.clip(q + HAIR * signs, self.scene.q_lower, self.scene.q_upper))

    def _left(self, q: Array) -> Array:
        """Returns those of joint positions, (S, n), that are free of collision, and that the map does not prove yet, in s."""
        samples = self.scene.to_s(q)
        samples = samples[~self.contains(samples)] if self.trees else samples
        return samples[self._plan.free(samples)]

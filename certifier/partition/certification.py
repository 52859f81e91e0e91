"""Pairs are certified over partitions of a polytope here; what was begun on a larger polytope can be gone on with, in parts.

What was found                                     -> the outcome and what comes with it
every cell has a plane, or misses the polytope     -> certified, with the proof, which the verifier has checked
a configuration in contact                         -> refuted, with the configuration and what is proved already
a narrow cell in which no plane keeps them apart   -> too_close, with a configuration, their distance there, and what is proved already
the limit of cells is reached                      -> inconclusive, with what is proved already and where open cells are

Of a pair that was begun, a part that leaves no cell open is inconclusive as well, until the subtrees of all parts are put together.
"""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from enum import Enum

import numpy as np

from certifier.errors import ProofError
from certifier.kinematics import Kinematics
from certifier.model import Array, Polytope, Scene
from certifier.outcome import Outcome, Stage
from certifier.pair.broad_phase import BroadPhase, Volumes
from certifier.pair.result import PairResult, Weakness
from certifier.partition.again import try_again
from certifier.partition.area import Area
from certifier.partition.bodies import Bodies
from certifier.partition.chords import chords
from certifier.partition.hulls import approach, gaps
from certifier.partition.scouts import scouted, with_others
from certifier.partition.search import Report, Search
from certifier.partition.shared import Shared
from certifier.partition.subtrees import Subtrees, dealt, open_cells, put_together
from certifier.partition.together import Together, volumes_of
from certifier.partition.tree import Node, OpenCell, to_streams
from certifier.polytopes.closest import closest
from certifier.polytopes.proved import ProvedBox
from certifier.polytopes.simplex import deepest
from certifier.proof.negative import WitnessProof
from certifier.proof.outline import Outline, Silhouette, Tree
from certifier.proof.partition import OPEN, STREAMS, Coarse, PartitionProof, choices_of
from certifier.verify.pair import check_ground, check_interior
from certifier.verify.separations import gap_of_share
from certifier.verify.witness import check_witness

GROUP_CELLS = 8
"""Volumes of several geometries are given up after this many cells."""
NEAR, POINTS_OF_A_CELL = 0.002, 8
"""Points of an open cell are named at which the bodies are as near as this, relative to their extent, and one at least."""
AROUND = 0.1
"""Open cells of hard pairs are cut off where the bodies are nearer than this, relative to their extent."""
LOOKS_AGAIN = 8
"""Where cells stay open, this many searches for a contact follow the first one; one search misses contacts in a small corner."""
LOOKING = 3
"""At most this many parts of a round look for contacts in all of the polytope, each elsewhere."""
MOST_POINTS = 2000
"""A result names at most this many configurations."""


class CutOff(Enum):
    """Says of which open cells a result names points, because they will be cut off. Contacts are named in any case.

    Where faces separate volumes that fewer joints move, points are always named: in cells where these volumes touch, or with ALL in all
    cells. Once faces keep these volumes apart, no other ones are needed.
    """

    CONTACTS = "contacts"
    """None of them."""
    NEAR = "near"
    """Of those where the bodies are as near as AROUND."""
    COARSELY = "coarsely"
    """Of those where the fat balls touch that they are tried with next, so that these become enough; else of those without fat balls."""
    ALL = "all"
    """All of them."""


class CellCertification:
    """Holds everything that the pairs of one polytope share.

    Args:
        polytope: its last 2n rows are the joint limits.
        seed: seeds the samples.
        box: the root cell, proved around a polytope of which P is a part (:meth:`ProvedBox.on`); None for P's smallest box. What was begun
            must have had the same one.
        together: pairs that share one certificate with others; None for none. What was begun must have had the same ones.
        keep: (k, n) points that stay inside, where faces will be added to the polytope: there, cells of hard pairs are cut in other ways.
            None where the polytope stays as it is.
        finer: as :class:`certifier.partition.area.Area` has it.

    Raises:
        RegionError: the polytope is empty or unbounded.
    """

    def __init__(
        self,
        scene: Scene,
        polytope: Polytope,
        seed: int = 0,
        box: ProvedBox | None = None,
        together: Together | None = None,
        keep: Array | None = None,
        finer: float = 1.0,
    ) -> None:
        self._scene, self._together, self._keep = scene, together or {}, keep
        self._area = Area.of(scene, polytope, seed, box, finer)
        check_ground(scene, self._area.ground)
        check_interior(scene, self._area.ground, self._area.center)
        self._shared = Shared(self._area)
        self._broad_phase = BroadPhase(Kinematics.of(scene), self._attempt)
        self._looked = 0
        self._last: tuple[int, Sequence[Sequence[bytes]], PartitionProof] | None = None

    def certify(self, index: int, cells: int, cut_off: CutOff = CutOff.CONTACTS, former: PartitionProof | None = None) -> PairResult:
        """Certifies pair ``scene.pairs[index]``, alone or with others that the same proof covers.

        Args:
            cells: end after this many cells.
            cut_off: which points of open cells the result names, because they will be cut off.
            former: a proof about bodies that were much like these, whose cells and planes are tried first; None where there is none.
        """
        start, pair, volumes, self._looked = time.perf_counter(), self._scene.pairs[index], self._volumes(index), 0
        names = [name for volume in volumes for name in volume.geometries]
        result = self._broad_phase.find(pair, names) or self._begin(volumes, cells, cut_off, former)
        return replace(result, seconds=time.perf_counter() - start, looked=self._looked)

    def go_on(
        self, index: int, cells: int, left: Sequence[bytes], part: int = 0, parts: int = 1, cut_off: CutOff = CutOff.CONTACTS
    ) -> PairResult:
        """Goes on with the open cells of a pair that belong to one part.

        Args:
            cells, cut_off: as for :meth:`certify`.
            left: the ``subtrees`` of the round before, in the order of its parts, on a polytope of which this one is a part.
            part: the number of this part, from 0.
            parts: how many parts the round has.
        """
        start, volumes = time.perf_counter(), self._volumes(index)
        search = Search(self._area, self._shared, volumes, self._keep)
        given = dealt(open_cells(left), part, parts)
        contacts = scouted(self._area, search.bodies, 1 + part) if part < LOOKING else []
        report = search.run(given, cells)
        result = self._left(search, volumes, given, replace(report, contacts=contacts + report.contacts), cut_off)
        return replace(result, seconds=time.perf_counter() - start, looked=report.cells)

    def put_together(self, index: int, rounds: Sequence[Sequence[bytes]], part: int = 0, parts: int = 1) -> PairResult:
        """Certifies a part of a pair of which no cell is open any more; the pair is certified when all its parts are.

        Args:
            rounds: the ``subtrees`` of all rounds, in order, each in the order of its parts.
            part: the number of this part, from 0; the first one returns the proof.
            parts: the cells to verify are divided among this many parts.
        """
        start = time.perf_counter()
        # One process often verifies several parts of a pair, one after the other.
        if self._last is None or self._last[:2] != (index, rounds):
            volumes = self._volumes(index)
            search = Search(self._area, self._shared, volumes, self._keep)
            vertices = [len(a.vertices) + len(b.vertices) for a, b in choices_of(volumes, search.coarse)]
            root = put_together(rounds, len(self._area.ground.d), 2 * self._scene.n, vertices)
            self._last = index, rounds, self._proof(search, volumes, root)
        result = self._verified(self._last[2], part, parts)
        return replace(result, seconds=time.perf_counter() - start)

    def _volumes(self, index: int) -> Volumes:
        return volumes_of(self._scene, [self._scene.pairs[i] for i in (index, *self._together.get(index, ()))])

    def _attempt(self, volumes: Volumes) -> PairResult | None:
        search, root = Search(self._area, self._shared, volumes, self._keep), Node()
        self._looked += search.run([OpenCell(root, self._area.lower, self._area.upper)], GROUP_CELLS).cells
        if any(node.kind == OPEN for node in root.preorder()):
            return None
        result = self._verified(self._proof(search, volumes, root))
        return result if result.outcome is Outcome.CERTIFIED else None

    def _begin(self, volumes: Volumes, cells: int, cut_off: CutOff, former: PartitionProof | None) -> PairResult:
        area, search = self._area, Search(self._area, self._shared, volumes, self._keep)
        contacts = scouted(area, search.bodies, 0)
        root = Node() if former is None else try_again(area, search, volumes, former)
        given = [OpenCell(root, area.lower, area.upper)]
        report = Report(contacts=contacts) if contacts else search.run(root.open_cells(area.lower, area.upper), cells)
        self._looked += report.cells
        if any(node.kind == OPEN for node in root.preorder()):
            if self._keep is None and not report.contacts:  # where faces are added, every round looks again
                looks = (scouted(area, search.bodies, seed) for seed in range(1, 1 + LOOKS_AGAIN))
                report = replace(report, contacts=next(filter(None, looks), []))
            return self._left(search, volumes, given, report, cut_off)
        return self._verified(self._proof(search, volumes, root))

    def _proof(self, search: Search, volumes: Volumes, root: Node) -> PartitionProof:
        """Returns the proof that a tree without open cells is."""
        streams = to_streams([root], len(search.joints))
        coarse, streams["choices"] = _chosen(search.coarse, streams["choices"])
        return PartitionProof(self._scene, volumes, search.frame, self._area.ground, self._area.center, coarse, **streams)

    def _verified(self, proof: PartitionProof, part: int = 0, parts: int = 1) -> PairResult:
        """Returns the result of a part of a pair that has a proof of all its cells."""
        try:
            gap = gap_of_share(self._scene, proof, part, parts)
        except ProofError as error:
            return PairResult(Outcome.INCONCLUSIVE, Stage.CELLS, detail=f"the proof found does not hold: {error}")
        # Cells that miss the polytope say nothing about a distance.
        margin = gap if np.isfinite(gap) else None
        return PairResult(Outcome.CERTIFIED, Stage.CELLS, margin=margin, proof=None if part else proof.to_bytes())

    def _left(self, search: Search, volumes: Volumes, given: Sequence[OpenCell], report: Report, cut_off: CutOff) -> PairResult:
        """Returns the result of a pair that is not certified yet, with what its search has left."""
        left = Subtrees.of(given, len(self._area.ground.d))
        points = with_others(self._area, search.bodies, search.joints, report.contacts)
        contacts = min(len(points), MOST_POINTS)
        bodies = search.bodies
        if cut_off is not CutOff.CONTACTS or search.parted is not None:
            bodies, of_cells = self._of_cells(search, left.open_cells, cut_off)
            points += of_cells
        if bodies is search.bodies:
            points += [point for cell in report.narrow for point in cell]
        found = np.array(points[:MOST_POINTS]).reshape(-1, self._scene.n)
        joints = () if bodies is search.bodies else tuple(bodies.joints)
        weakness = Weakness(found, np.zeros(self._scene.n), contacts=contacts, joints=joints)
        streams = to_streams(left.roots, len(search.joints))
        subtrees, outline, count = left.to_bytes(streams), self._outline(search, volumes, streams).to_bytes(), len(left.open_cells)
        result = PairResult(Outcome.INCONCLUSIVE, Stage.CELLS, subtrees=subtrees, outline=outline, open_cells=count, weakness=weakness)
        if report.contacts:
            return self._refuted(search, volumes, report.contacts[0], result)
        if report.narrow:
            s, distance = self._nearest(search, np.concatenate(report.narrow))
            detail = f"the padded bodies are {1000 * distance:.3g} mm apart, too close for a plane"
            return replace(result, outcome=Outcome.TOO_CLOSE, witness_s=s, detail=detail)
        if not count:
            return replace(result, detail="no cell is open; the cells are yet to be put together and verified")
        inside = report.left / len(self._area.samples)
        share = f"{100 * inside:.2g} %" if inside >= 1e-4 else "less than 0.01 %"
        open_ = "1 cell is" if count == 1 else f"{count} cells are"
        detail = f"{open_} open, with {share} of the polytope, as samples say; this round searched {report.cells}"
        return replace(result, detail=detail)

    def _outline(self, search: Search, volumes: Volumes, streams: dict[str, Array]) -> Outline:
        """Returns the outline of what a search has left, which has these streams."""
        first, second = (
            tuple(Silhouette.of(volume, self._scene) for volume in (own, *coarse))
            for own, coarse in zip(volumes, search.coarse, strict=True)
        )
        tree = Tree(*(streams[name] for name in Tree._fields))
        return Outline(tuple(search.joints), self._area.lower, self._area.upper, (first, second), tree)

    def _refuted(self, search: Search, volumes: Volumes, s: Array, found: PairResult) -> PairResult:
        """Returns the result of a pair that touches at s, with the proof of that, which the verifier has checked."""
        names = {name for volume in volumes for name in volume.geometries}
        pair = next((pair for pair in self._scene.pairs if {pair.a, pair.b} == names), None)
        if pair is None:  # a contact of boxes about several geometries says nothing about them
            return found
        A, B = (self._area.kinematics.points(search.frame, volume.body, volume.vertices, s[None])[0] for volume in volumes)
        weights = closest(A, B).weights
        if pair.a != volumes[0].geometries[0]:
            weights = weights[1], weights[0]
        witness = WitnessProof(self._scene, pair, self._area.ground.C, self._area.ground.d, s, weights)
        try:
            check_witness(witness)
        except ProofError as error:
            detail = f"the contact found does not hold: {error}"
            return replace(found, outcome=Outcome.TOO_CLOSE, witness_s=s, detail=detail)
        return replace(found, outcome=Outcome.REFUTED, witness_s=s, proof=witness.to_bytes())

    def _of_cells(self, search: Search, cells: Sequence[OpenCell], cut_off: CutOff) -> tuple[Bodies, list[Array]]:
        """Returns the bodies that faces will keep apart, and points of the polytope in the cells where these are near.

        Coarsely, the bodies are the fat balls that most of the cells are tried with next, if they are.
        """
        found: list[Array] = []
        bodies = search.bodies
        if search.parted is not None and cut_off is not CutOff.ALL:
            bodies = search.parted
        elif cut_off is CutOff.COARSELY and cells:
            bodies = Counter(search.at_hand(node) for node, _, _ in cells).most_common(1)[0][0]
            cells = [cell for cell in cells if search.at_hand(cell.node) is bodies]
        within = NEAR if bodies is not search.bodies else AROUND if cut_off is CutOff.NEAR else np.inf
        for _, lower, upper in cells:
            if len(found) >= MOST_POINTS:
                break
            _, C, d = self._area.inside(lower, upper)
            middle, depth, _ = deepest(C, d, (lower + upper) / 2)
            if depth <= 0:
                continue
            X = np.concatenate([middle[None], chords(C, d, middle, np.zeros((0, len(lower))), POINTS_OF_A_CELL, 0)])
            nearest = np.argsort(gaps(*bodies.hulls, X), kind="stable")
            s = X[nearest[0]].copy()
            approach(*bodies.hulls, np.array(bodies.joints), (upper - lower) / 2, C, d, s, 4, 0.0)
            X = np.concatenate([s[None], X[nearest]])
            distances = gaps(*bodies.hulls, X)
            if distances[0] < within:
                found += [X[0], *X[1:][distances[1:] < NEAR]]
        return bodies, found

    def _nearest(self, search: Search, configurations: Array) -> tuple[Array, float]:
        """Returns the configuration at which the bodies are nearest, and their distance there in metres, padding subtracted."""
        distances = gaps(*search.bodies.hulls, configurations)
        place = int(distances.argmin())
        return configurations[place], max(float(distances[place]) * search.bodies.extent, 0.0)


def _chosen(coarse: Coarse, choices: np.ndarray) -> tuple[Coarse, np.ndarray]:
    """Returns the coarse volumes that leaves choose, and their choices among these."""
    j, i = np.divmod(choices, 1 + len(coarse[0]))
    used = [np.unique([0, *numbers]) for numbers in (i, j)]
    first, second = (tuple(volumes[number - 1] for number in kept[1:]) for volumes, kept in zip(coarse, used, strict=True))
    among = np.searchsorted(used[0], i) + len(used[0]) * np.searchsorted(used[1], j)
    return (first, second), among.astype(STREAMS["choices"])

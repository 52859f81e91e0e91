"""Pairs are certified over partitions of a polytope here; what was begun on a larger polytope can be gone on with.

What was found                                     -> the outcome and what comes with it
every cell has a plane, or misses the polytope     -> certified, with the proof, which the verifier has checked
a configuration in contact                         -> refuted, with the configuration and what is proved already
a narrow cell in which no plane keeps them apart   -> too_close, with a configuration, their distance there, and what is proved already
so many cells were looked at                       -> inconclusive, with what is proved already and where open cells are
"""

from __future__ import annotations

import time
from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from certifier.errors import ProofError
from certifier.kinematics import Kinematics
from certifier.model import Array, Box, Polytope, Scene, Volume
from certifier.outcome import Outcome, Stage
from certifier.pair.broad_phase import BroadPhase, Volumes
from certifier.pair.closest import closest
from certifier.pair.result import PairResult, Weakness
from certifier.partition.area import Area
from certifier.partition.chords import chords
from certifier.partition.hulls import approach, gaps
from certifier.partition.search import Report, Search
from certifier.partition.tree import Node
from certifier.polytopes.simplex import deepest
from certifier.proof.negative import WitnessProof
from certifier.proof.partition import STREAMS, PartitionProof
from certifier.verify.pair import check_ground, check_interior
from certifier.verify.separations import statements
from certifier.verify.witness import check_witness

GROUP_CELLS = 8
"""Volumes of several geometries are given up after this many cells."""
NEAR_CONTACTS = 48
"""So many configurations about a contact are looked at, at each of SCALES, to see how far it reaches."""
SCALES = (0.5, 0.2, 0.07, 0.02)
NEAR, POINTS_OF_A_CELL = 0.002, 8
"""Points of an open cell are named at which the bodies are as near as this, relative to their extent, and one at least."""
MOST_POINTS = 2000
"""A result names at most this many configurations."""


class CellCertification:
    """Holds everything that the pairs of one polytope share.

    Args:
        polytope: its last 2n rows are the joint limits.
        seed: seeds the samples.
        box: the root cell, which contains P; None for P's smallest box. What was begun must have had the same one.

    Raises:
        RegionError: the polytope is empty or unbounded.
    """

    def __init__(self, scene: Scene, polytope: Polytope, seed: int = 0, box: Box | None = None) -> None:
        self._scene = scene
        self._area = Area.of(scene, polytope, seed, box)
        check_ground(scene, self._area.ground)
        check_interior(scene, self._area.ground, self._area.center)
        self._covariance = np.cov(self._area.samples.T).reshape(scene.n, scene.n)
        self._broad_phase = BroadPhase(Kinematics.of(scene), self._together)

    def certify(self, index: int, cells: int, begun: bytes | None = None, ending: bool = False) -> PairResult:
        """Certifies pair ``scene.pairs[index]``, alone or with others that the same proof covers.

        Args:
            cells: end after so many cells.
            begun: the ``partition`` of an earlier result of this pair, on a polytope of which this one is a part.
            ending: what is still open will be cut off, so the result names points of all open cells.
        """
        start, pair = time.perf_counter(), self._scene.pairs[index]
        result = None if begun else self._broad_phase.find(pair)
        if result is None:
            volumes = (Volume.of(self._scene.geometry(pair.a)), Volume.of(self._scene.geometry(pair.b)))
            result = self._certify(volumes, cells, begun, ending)
        return replace(result, seconds=time.perf_counter() - start)

    def _together(self, volumes: Volumes) -> PairResult | None:
        result = self._certify(volumes, GROUP_CELLS, None, False)
        return result if result.outcome is Outcome.CERTIFIED else None

    def _certify(self, volumes: Volumes, cells: int, begun: bytes | None, ending: bool) -> PairResult:
        search = Search(self._area, volumes)
        root = Node() if begun is None else self._begun(begun)
        report = search.run(root, cells)
        proof = PartitionProof(
            self._scene,
            volumes,
            search.frame,
            self._area.ground,
            self._area.center,
            search.coarse,
            **root.to_streams(len(search.joints)),
        )
        still_open = root.open_cells(self._area.lower, self._area.upper)
        if not still_open:
            try:
                statement = statements(self._scene, [proof])[0]
            except ProofError as error:
                return PairResult(Outcome.INCONCLUSIVE, Stage.CELLS, detail=f"the proof found does not hold: {error}")
            return PairResult(Outcome.CERTIFIED, Stage.CELLS, margin=statement.gap, proof=proof.to_bytes())
        return self._open(search, volumes, report, [(lower, upper) for _, lower, upper in still_open], proof.to_bytes(), ending)

    def _begun(self, data: bytes) -> Node:
        """Returns the tree that was begun; faces were added since before the joint limits, so the limits have other numbers now."""
        proof = PartitionProof.from_bytes(data, self._scene)
        added, limits = len(self._area.ground.d) - len(proof.ground.d), len(proof.ground.d) - 2 * self._scene.n
        arrays = {name: getattr(proof, name) for name in STREAMS}
        arrays["faces"] = np.where(proof.faces >= limits, proof.faces + added, proof.faces).astype(np.int16)
        return Node.of_streams(arrays, {choice: sum(len(volume.vertices) for volume in both) for choice, both in proof.chosen.items()})

    def _open(
        self, search: Search, volumes: Volumes, report: Report, cells: list[tuple[Array, Array]], begun: bytes, ending: bool
    ) -> PairResult:
        points = self._contacts(search, report.contacts)
        if ending:
            points += self._of_cells(search, cells)
        points += [point for cell in report.narrow for point in cell]
        weakness = Weakness(np.array(points[:MOST_POINTS]).reshape(-1, self._scene.n), np.zeros(self._scene.n))
        found = PairResult(Outcome.INCONCLUSIVE, Stage.CELLS, partition=begun, open_cells=len(cells), weakness=weakness)
        if report.contacts:
            return self._refuted(search, volumes, report.contacts[0], found)
        if report.narrow:
            s, distance = self._nearest(search, np.concatenate(report.narrow))
            detail = f"the padded bodies are {distance:.3g} m apart at the configuration named, too close for a plane"
            return replace(found, outcome=Outcome.TOO_CLOSE, witness_s=s, detail=detail)
        inside = sum(((self._area.samples >= low) & (self._area.samples <= up)).all(axis=1).mean() for low, up in cells)
        detail = f"{len(cells)} cells, {100 * float(inside):.2g} % of the polytope, are open after {report.cells} cells"
        return replace(found, detail=detail)

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

    def _contacts(self, search: Search, contacts: list[Array]) -> list[Array]:
        """Returns the contacts with others about them, which show how far a contact reaches."""
        found: list[Array] = []
        rng = np.random.default_rng(len(contacts))
        polytope, J = self._area.polytope, search.joints
        root = np.linalg.cholesky(self._covariance[np.ix_(J, J)] + 1e-12 * np.eye(len(J)))
        for contact in contacts:
            near = np.tile(contact, (len(SCALES) * NEAR_CONTACTS, 1))
            scales = np.repeat(SCALES, NEAR_CONTACTS)[:, None]
            near[:, J] += scales * rng.normal(size=(len(near), len(J))) @ root.T / np.sqrt(len(J))
            near = near[polytope.contains(near)]
            found += [contact, *near[gaps(*search.bodies.hulls, near) <= 0]]
        return found

    def _of_cells(self, search: Search, cells: Iterable[tuple[Array, Array]]) -> list[Array]:
        """Returns points of the polytope in the cells: of every cell where the bodies are nearest, and where they are near."""
        found: list[Array] = []
        for lower, upper in cells:
            _, C, d = self._area.inside(lower, upper)
            middle, depth, _ = deepest(C, d, (lower + upper) / 2)
            if depth <= 0:
                continue
            X = np.concatenate([middle[None], chords(C, d, middle, np.zeros((0, len(lower))), POINTS_OF_A_CELL, 0)])
            nearest = np.argsort(gaps(*search.bodies.hulls, X), kind="stable")
            s = X[nearest[0]].copy()
            approach(*search.bodies.hulls, np.array(search.bodies.joints), (upper - lower) / 2, C, d, s, 4, 0.0)
            X = np.concatenate([s[None], X[nearest]])
            distances = gaps(*search.bodies.hulls, X)
            found += [X[0], *X[1:][distances[1:] < NEAR]]
        return found

    def _nearest(self, search: Search, configurations: Array) -> tuple[Array, float]:
        """Returns the configuration at which the bodies are nearest, and their distance there in metres, padding subtracted."""
        distances = gaps(*search.bodies.hulls, configurations)
        place = int(distances.argmin())
        return configurations[place], max(float(distances[place]) * search.bodies.extent, 0.0)

"""This module shows how pairs are proved: the proofs of a region, and the cells of a pair, proved and open.

Nothing is checked here. What is shown as certified was verified before it was stored.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from operator import attrgetter
from threading import Lock
from typing import Any

import numpy as np
from cachetools import LRUCache, cachedmethod

from api.schemas.cells import CellCounts, Partition, ProofKind, RegionPair, SeparatingPlane
from api.schemas.scenes import PairInfo
from certifier.errors import CirisError
from certifier.model import Array, Scene
from certifier.proof.outline import Outline, ProofOutline, Silhouette, outlines
from certifier.proof.partition import PLANE, PartitionProof
from certifier.proof.planes import Planes, planes
from db import pairs, proofs, subtrees
from db.models import RegionRow
from db.session import Database
from db.states import PairState
from planner.membership import to_s

MOST_NODES = 200_000
"""Largest number of nodes in an answer."""
KEPT_NODES = 5_000_000
"""Each process keeps the outlines of the regions that were asked about last, up to this many nodes together."""
KEPT_NUMBERS = 5_000_000
"""Each process keeps the planes of the pairs that were asked about last, up to this many numbers together."""
NAMED = 3
"""A volume that stands for more geometries is named by this many of them."""


class OutlinesKept:
    """Keeps the outlines of proof files, and the planes of some proofs. A file never changes, and may have a hundred
    megabytes, which take long to read.
    """

    def __init__(self) -> None:
        self._kept: LRUCache[str, list[ProofOutline]] = LRUCache(KEPT_NODES, getsizeof=_size)
        self._planes: LRUCache[tuple[str, int], Planes] = LRUCache(KEPT_NUMBERS, getsizeof=lambda known: min(KEPT_NUMBERS, known.Z.size))
        self._lock = Lock()

    @cachedmethod(attrgetter("_kept"), key=lambda self, database, digest, scene: digest, lock=attrgetter("_lock"))
    def of(self, database: Database, digest: str, scene: Scene) -> list[ProofOutline]:
        """Returns the outlines of the proofs in the file with this digest."""
        with database.read() as session:
            data = proofs.get(session, digest)
        return outlines(data, scene)

    @cachedmethod(attrgetter("_planes"), key=lambda self, database, digest, number, outline: (digest, number), lock=attrgetter("_lock"))
    def planes_of(self, database: Database, digest: str, number: int, outline: ProofOutline) -> Planes:
        """Returns the planes of the proof with this number, and this outline, in the file with this digest."""
        with database.read() as session:
            data = proofs.get(session, digest)
        return planes(data, number, outline)


def _size(known: Sequence[ProofOutline]) -> int:
    """Returns the number of nodes. The outlines of one file are kept however large they are."""
    return min(KEPT_NODES, sum(len(one.cells.tree.nodes) for one in known))


def numbered(scene: Scene, index: int) -> PairInfo:
    """Returns the pair with this index.

    Raises:
        CirisError: pair_not_found.
    """
    if not 0 <= index < len(scene.pairs):
        message = f"there is no pair {index}: the numbers of the scene's pairs are less than {len(scene.pairs)}"
        raise CirisError("pair_not_found", message, field="pair", hint="/v1/scenes/{id}/pairs lists them")
    pair = scene.pairs[index]
    return PairInfo(index=index, a=pair.a, b=pair.b)


def of_region(scene: Scene, region: RegionRow, known: Sequence[ProofOutline]) -> list[RegionPair]:
    """Describes the proof of each pair of a region, whose file has these outlines."""
    proved, number = region.manifest["pairs"], _number_of(region.manifest)
    covers: dict[int, list[int]] = {}
    for index, place in number.items():
        covers.setdefault(place, []).append(index)
    return [
        RegionPair(
            index=index,
            a=pair.a,
            b=pair.b,
            kind=_kind(known[number[index]]),
            cells=sum(known[number[index]].cells.counts),
            proved_distance=proved[index]["margin"],
            margin=proved[index]["margin"],
            shares_with=[other for other in covers[number[index]] if other != index],
        )
        for index, pair in enumerate(scene.pairs)
    ]


def of_region_pair(scene: Scene, region: RegionRow, known: Sequence[ProofOutline], index: int) -> Partition:
    """Describes the cells of a pair of a region."""
    proof = known[_number_of(region.manifest)[index]]
    return partition(scene, index, proof.cells, PairState.CERTIFIED, _kind(proof))


def plane_at(database: Database, kept: OutlinesKept, scene: Scene, region: RegionRow, index: int, q: Array) -> SeparatingPlane:
    """Returns the plane of a pair's proof in the cell that holds the configuration q, (n,).

    Raises:
        CirisError: cells_not_found, where the region does not contain q.
    """
    number = _number_of(region.manifest)[index]
    proof = kept.of(database, region.proof_digest, scene)[number]
    tree, s = proof.cells.tree, to_s(scene, q[None])[0]
    inside = bool(np.all(region.arrays["C"] @ s <= region.arrays["d"]))  # s is NaN outside of the limits
    path = tree.path(s) if inside else []
    if not path or tree.nodes[path[-1]] != PLANE:
        message = f"the region does not contain the configuration, so no cell of pair {index} is proved about it"
        raise CirisError("cells_not_found", message, field="q", hint="/v1/regions/{id}/configurations has some of its configurations")
    found = kept.planes_of(database, region.proof_digest, number, proof)
    place = int((tree.nodes[: path[-1]] == PLANE).sum())
    pair, volumes, lower_upper = numbered(scene, index), proof.cells.chosen[int(tree.choices[place])], proof.cells.cell(path)
    swapped = pair.a not in volumes[0].geometries
    first, second = volumes[::-1] if swapped else volumes
    return SeparatingPlane(
        pair=pair,
        cell=path[-1],
        lower=lower_upper[0].tolist(),
        upper=lower_upper[1].tolist(),
        volumes=(_in_words(first), _in_words(second)),
        frame=found.frame,
        joints=list(found.joints),
        Z=(-found.Z[place] if swapped else found.Z[place]).tolist(),
    )


def _number_of(manifest: Mapping[str, Any]) -> dict[int, int]:
    """Returns pair index -> the number of its proof in the region's file, which has the proofs in the order of the pairs."""
    digests = [pair["proof_digest"] for pair in manifest["pairs"]]
    place = {digest: number for number, digest in enumerate(dict.fromkeys(digests))}
    return {index: place[digest] for index, digest in enumerate(digests)}


def _kind(proof: ProofOutline) -> ProofKind:
    return ProofKind.PARTITION if proof.form == PartitionProof.KIND else ProofKind.PROGRAM


def of_job_pair(database: Database, kept: OutlinesKept, scene: Scene, job_id: str, index: int, iteration: int | None) -> Partition:
    """Describes the cells of a pair as a job has left them in an iteration, or in its last one.

    Raises:
        CirisError: cells_not_found.
    """
    with database.read() as session:
        found = pairs.with_pair(session, job_id, index, iteration)
        if found is None:
            where = "an iteration" if iteration is None else f"iteration {iteration}"
            raise _without_cells(index, f"the job has not begun {where} with it")
        row, parts = found
        own = parts[0].pair_index
        state = pairs.state_of_parts([PairState(part.state) for part in parts])
        begun = row.action["begun"].get(str(own), row.index)
        left = subtrees.outlines(session, job_id, own, begun, row.index)
        counts = pairs.parts_of(session, job_id, own, left)
    if state is PairState.CERTIFIED:
        proof = kept.of(database, parts[0].proof_digest or "", scene)[0]
        return partition(scene, index, proof.cells, state, _kind(proof), row.index)
    if row.action["cells"] == 1:
        raise _without_cells(index, f"one plane on all of the polytope was tried for it in iteration {row.index}, and it is {state}")
    cells = _gone_on(left, counts)
    if cells is None:
        raise _without_cells(index, f"no search has left cells of it in iteration {row.index}, where it is {state}")
    return partition(scene, index, cells, state, ProofKind.PARTITION, row.index)


def _without_cells(index: int, why: str) -> CirisError:
    hint = "/v1/jobs/{id}/pairs has its outcome"
    return CirisError("cells_not_found", f"pair {index} has no cells: {why}", field="pair", hint=hint)


def _gone_on(left: Mapping[int, Mapping[int, bytes | None]], counts: Mapping[int, int]) -> Outline | None:
    """Returns the cells of a pair from what the parts of its rounds have left, by iteration; None where nothing is known of the first."""
    known: list[list[Outline | None]] = []
    for number, parts in left.items():
        files = [parts.get(part) for part in range(counts[number])]
        known.append([None if data is None else Outline.from_bytes(data) for data in files])
        if None in files:  # Nobody knows which cells the rounds after it were given.
            break
    return None if not known or known[0][0] is None else known[0][0].gone_on(known[1:])


def partition(scene: Scene, index: int, cells: Outline, state: PairState, kind: ProofKind, iteration: int | None = None) -> Partition:
    """Describes the cells of a pair, with at most MOST_NODES nodes."""
    pair, shown = numbered(scene, index), cells.shown(MOST_NODES)
    # A proof of several pairs may have the pair's geometries the other way round.
    swapped = pair.a not in cells.sides[0][0].geometries
    words = [(_in_words(a), _in_words(b)) for a, b in cells.chosen]
    return Partition(
        pair=pair,
        state=state,
        certified=state is PairState.CERTIFIED,
        iteration=iteration,
        kind=kind,
        joints=list(cells.joints),
        lower=cells.lower.tolist(),
        upper=cells.upper.tolist(),
        q_star=scene.q_star.tolist(),
        revolute=scene.revolute.tolist(),
        nodes=shown.tree.nodes.tolist(),
        cuts=shown.tree.cuts.tolist(),
        choices=shown.tree.choices.tolist(),
        volumes=[(b, a) for a, b in words] if swapped else words,
        counts=CellCounts(**shown.counts._asdict()),
        folded=[CellCounts(**counts._asdict()) for counts in shown.folded],
    )


def _in_words(volume: Silhouette) -> str:
    """Says what a leaf's plane separates, such as "a ball of radius 0.21 m about hand and 2 more, fixed to link4"."""
    if volume.own:
        return volume.geometries[0]
    some, more = ", ".join(volume.geometries[:NAMED]), len(volume.geometries) - NAMED
    shapes = {1: f"a ball of radius {volume.radius:.3g} m", 2: f"a capsule of radius {volume.radius:.3g} m"}
    return f"{shapes.get(volume.vertices, 'a box')} about {some}{f' and {more} more' if more > 0 else ''}, fixed to {volume.body}"

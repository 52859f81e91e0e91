"""The trees of a proof over a partition (certifier.proof.partition) are read strictly here: every stream to its end, and no further."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from certifier.errors import ProofError
from certifier.model import Array
from certifier.proof import limits
from certifier.proof.ground import Ground
from certifier.proof.map import PairMap
from certifier.proof.partition import EMPTY, OBLIQUE, OPEN, PLANE, STREAMS, PartitionProof

_MULTIPLIED = 1 << 16
"""About this many multipliers are added up at once."""


def malformed(proof: PartitionProof, problem: str) -> ProofError:
    """Returns the error that a proof's streams make no sense."""
    return ProofError("proof_malformed", f"{proof.title}: {problem}")


@dataclass(frozen=True)
class Cells:
    """Holds some leaves of the tree of cuts, one after the other.

    Attributes:
        number: (B,) of each leaf among all leaves, in the order of the nodes.
        plane: (B,) number of its plane, or of the planes before it where it has none.
        empty: (B,) whether it misses the polytope.
        lower: (B, k) least values of the joints in play.
        upper: (B, k) largest values of the joints in play.
    """

    number: np.ndarray
    plane: np.ndarray
    empty: np.ndarray
    lower: Array
    upper: Array


class Cuts:
    """Holds the tree of cuts of a proof, which is checked to be one.

    Args:
        play: position indices of the joints in play, ascending.
        trees: how many trees the nodes are, one after the other; the proof itself is one.

    Raises:
        ProofError: the streams make no trees, or some that are too large.
    """

    def __init__(self, proof: PartitionProof, play: list[int], trees: int = 1) -> None:
        for name, kind in STREAMS.items():
            array = getattr(proof, name)
            if array.dtype != kind or array.ndim != (3 if name == "planes" else 1):
                raise malformed(proof, f"{name} are {array.dtype} of shape {array.shape}")
        nodes = proof.nodes
        if len(nodes) > limits.NODES:
            raise ProofError("proof_too_large", f"{proof.title}: {len(nodes)} nodes; at most {limits.NODES} are checked")
        if not np.isin(nodes, [*proof.NODES, *play]).all():
            raise malformed(proof, "a node cuts a joint that does not move one of the bodies in the frame, or is of no kind")
        ends = _ends(nodes)
        if len(ends) != trees or ends[-1] != len(nodes):
            raise malformed(proof, "the tree of cuts ends before or after its last node")
        if len(proof.cuts) != np.count_nonzero(nodes >= 0):
            raise malformed(proof, f"there are {len(proof.cuts)} cuts for {np.count_nonzero(nodes >= 0)} nodes that cut")
        if proof.planes.shape != (np.count_nonzero(nodes == PLANE), 5, 1 + len(play)):
            raise malformed(proof, f"the planes are {proof.planes.shape}")
        if not (np.isfinite(proof.cuts).all() and np.isfinite(proof.planes).all()):
            raise malformed(proof, "a cut or a plane is not finite")
        oblique = np.flatnonzero(nodes == OBLIQUE)
        if isinstance(proof, PairMap):
            if proof.normals.shape != (len(oblique), proof.scene.n):
                raise malformed(proof, f"the normals of {len(oblique)} oblique cuts are {proof.normals.shape}")
            if not np.isfinite(proof.normals).all():
                raise malformed(proof, "the normal of an oblique cut is not finite")
        if not (nodes[oblique + 1] == PLANE).all():
            raise malformed(proof, "the lower part of an oblique cut is no cell with a plane")
        self._proof, self._play = proof, play

    def cells(self, roots: Sequence[tuple[Array, Array]], most: int) -> Iterator[Cells]:
        """Yields all leaves but those that are open, at most ``most`` together.

        Args:
            roots: the least and the largest values of the joints in play, (k,) each, in the cell of every tree.

        Raises:
            ProofError: a cut is not inside the cell that it divides, or the tree is too deep.
        """
        proof, column = self._proof, {joint: i for i, joint in enumerate(self._play)}
        cuts, planes, pending = iter(proof.cuts.tolist()), 0, [(0, *root) for root in reversed(roots)]
        found: list[tuple[int, int, bool, Array, Array]] = []
        number = 0
        for node in proof.nodes.tobytes():
            depth, lower, upper = pending.pop()
            if node == OBLIQUE:  # both parts are taken to be the whole cell; the multipliers of the lower one are of the cut
                if depth == limits.CUT_DEPTH:
                    raise self._too_deep()
                pending += [(depth + 1, lower, upper)] * 2
                next(cuts)
                continue
            if node < 128:  # an int8 that is not negative
                i, cut = column[node], next(cuts)
                if not lower[i] < cut < upper[i]:
                    raise malformed(proof, f"joint {node} is cut at {cut:g}, outside of the cell from {lower[i]:g} to {upper[i]:g}")
                if depth == limits.CUT_DEPTH:
                    raise self._too_deep()
                middle_upper, middle_lower = upper.copy(), lower.copy()
                middle_upper[i] = middle_lower[i] = cut
                pending += [(depth + 1, middle_lower, upper), (depth + 1, lower, middle_upper)]
                continue
            has_plane = node == PLANE + 256
            if node != OPEN + 256:
                found.append((number, planes, not has_plane, lower, upper))
            planes += has_plane
            number += 1
            if len(found) == most:
                yield _together(found)
                found = []
        if found:
            yield _together(found)

    def _too_deep(self) -> ProofError:
        return ProofError("proof_too_large", f"{self._proof.title}: a cell is cut more than {limits.CUT_DEPTH} times")


def _together(found: list[tuple[int, int, bool, Array, Array]]) -> Cells:
    return Cells(*(np.array(column) for column in zip(*found, strict=True)))


class Pieces:
    """Holds the trees of pieces of a proof, which are checked to be trees.

    Args:
        axes: numbers of axes, all of them in play, of which either volume's pieces may be halved along any.

    Raises:
        ProofError: the streams make no trees, or one that is too large, or a leaf has no volumes that it could have.
    """

    def __init__(self, proof: PartitionProof, axes: int) -> None:
        self._vertices = [(len(first.vertices), len(second.vertices)) for first, second in proof.chosen]
        self._proof = proof
        pieces, choices = proof.pieces, proof.choices
        if len(choices) != len(proof.planes) or not ((choices >= 0) & (choices < len(self._vertices))).all():
            raise malformed(proof, f"the {len(choices)} choices are not one of 0 to {len(self._vertices) - 1} for each of the planes")
        if len(pieces) > limits.PIECES:
            raise ProofError("proof_too_large", f"{proof.title}: {len(pieces)} nodes of pieces; at most {limits.PIECES} are checked")
        if pieces.size and not (pieces.min() >= EMPTY and pieces.max() < axes):
            raise malformed(proof, f"a piece is halved along an axis that is not there, or is of no kind; there are {axes}")
        self._bounds = np.concatenate([np.zeros(1, dtype=np.int64), _ends(pieces)])
        trees = np.array([sum(counts) for counts in self._vertices])[choices]
        self._first = np.concatenate([np.zeros(1, dtype=np.int64), np.cumsum(trees)])
        if len(self._bounds) != 1 + self._first[-1] or self._bounds[-1] != len(pieces):
            raise malformed(proof, f"the pieces are not {self._first[-1]} trees, one for each vertex of each plane")
        self._rank = np.cumsum(pieces < 0, dtype=np.int32)
        self._upper = np.zeros(len(pieces), dtype=np.int32)

    def start(self, plane: np.ndarray, choice: int, side: int) -> np.ndarray:
        """Returns, (B, V), where the trees of a volume's vertices begin in the stream of pieces, for planes of these numbers, (B,).

        All of the planes have the same choice.
        """
        vertices = self._vertices[choice]
        first = self._first[plane] + (vertices[0] if side else 0)
        return self._bounds[first[:, None] + np.arange(vertices[side])]

    def kind(self, at: np.ndarray) -> np.ndarray:
        """Returns the nodes there: PLANE, EMPTY, or the axis that is halved."""
        return self._proof.pieces[at]

    def rank(self, at: np.ndarray) -> np.ndarray:
        """Returns how many pieces come before the ones there."""
        return self._rank[at] - 1

    def before(self, plane: np.ndarray) -> np.ndarray:
        """Returns how many pieces come before those of the planes of these numbers."""
        begin = self._bounds[self._first[plane]]
        return np.where(begin > 0, self._rank[begin - 1] if self._rank.size else 0, 0)

    def find_upper_parts(self, start: np.ndarray) -> None:
        """Finds where the upper parts begin in the trees that begin there, which :meth:`upper_part` then returns.

        Raises:
            ProofError: a tree is too large.
        """
        begins = start[self.kind(start) >= 0]
        for begin, end in zip(begins.tolist(), self._bounds[np.searchsorted(self._bounds, begins, "right")].tolist(), strict=True):
            if end - begin > limits.TREE:
                raise ProofError("proof_too_large", f"{self._proof.title}: a vertex has more than {limits.TREE} nodes of pieces")
            kinds = self._proof.pieces[begin:end].tolist()
            found = [0] * len(kinds)
            heads: list[int] = []
            for i in reversed(range(len(kinds))):
                if kinds[i] >= 0:
                    heads.pop()
                    found[i] = begin + heads.pop()
                heads.append(i)
            self._upper[begin:end] = found

    def upper_part(self, at: np.ndarray) -> np.ndarray:
        """Returns where the upper parts of nodes that are halved begin; the lower ones are next."""
        return self._upper[at]


@dataclass(frozen=True)
class Sums:
    """Holds lambda'd and lambda'C of the multipliers of some pieces, and the same of absolute values.

    Attributes:
        offset: (...) lambda'd.
        slope: (..., n) lambda'C.
        offset_size: (...) lambda'|d|.
        slope_size: (..., n) lambda'|C|.
        count: (...) numbers of multipliers.
    """

    offset: Array
    slope: Array
    offset_size: Array
    slope_size: Array
    count: np.ndarray


class Multipliers:
    """Holds the multipliers of a proof, of its pieces and of its EMPTY nodes, which are checked to be nonnegative and of faces there are.

    Args:
        pieces: those of the proof.

    Raises:
        ProofError: they are not.
    """

    def __init__(self, proof: PartitionProof, ground: Ground, pieces: Pieces) -> None:
        counts = proof.counts
        wanted = np.count_nonzero(proof.nodes == EMPTY) + np.count_nonzero(proof.pieces < 0)
        if len(counts) != wanted or (counts.size and not (counts.min() >= 0 and counts.max() <= limits.FACES)):
            raise malformed(proof, f"{len(counts)} counts of multipliers, for {wanted} pieces, or one that is none")
        total = int(counts.sum(dtype=np.int64))
        self._start = np.cumsum(counts, dtype=np.int64) - counts
        if isinstance(proof, PairMap):
            self._C, self._d, self._faces = proof.normals, proof.offsets, self._of_oblique_cuts(proof, pieces, total)
        else:
            self._C, self._d, self._faces = ground.C, ground.d, proof.faces
        if not len(self._faces) == len(proof.multipliers) == total:
            raise malformed(proof, f"{len(self._faces)} faces and {len(proof.multipliers)} multipliers where {total} belong")
        if total and not (self._faces.min() >= 0 and self._faces.max() < len(self._d)):
            raise malformed(proof, f"a multiplier is of a face that is not there; there are {len(self._d)}")
        if total and not (proof.multipliers.min() >= 0 and np.isfinite(proof.multipliers).all()):
            raise malformed(proof, "a multiplier is negative or not finite")
        self._proof, self._counts = proof, counts
        # EMPTY nodes and planes share the stream of counts, in the order of the nodes.
        leaves = proof.nodes[proof.nodes < 0]
        self._empty_before = np.cumsum(leaves == EMPTY, dtype=np.int32) - (leaves == EMPTY)

    def _of_oblique_cuts(self, proof: PairMap, pieces: Pieces, total: int) -> np.ndarray:
        """Returns the face of each multiplier of a map: the cut of which its cell is the lower part.

        Raises:
            ProofError: a cell that is none has multipliers, or the proof names faces of its own.
        """
        if len(proof.faces):
            raise malformed(proof, "a map names the faces of multipliers")
        lower = np.concatenate([[False], proof.nodes[:-1] == OBLIQUE])[proof.nodes == PLANE]
        ends = np.append(self._start, total)
        many = np.diff(np.append(ends[pieces.before(np.arange(len(lower)))], total))
        if many[~lower].any():
            raise malformed(proof, "a cell that is no part of an oblique cut has multipliers")
        return np.repeat(np.cumsum(lower) - 1, many)

    def count(self, number: np.ndarray, rank: np.ndarray) -> np.ndarray:
        """Returns how many multipliers pieces of leaves have, (...), given as in :meth:`of_pieces`."""
        return self._counts[rank + self._empty_before[number]]

    def of_pieces(self, number: np.ndarray, rank: np.ndarray) -> Sums:
        """Returns the sums of pieces of leaves, (...), each given by its leaf's number and its rank among all pieces."""
        return self._sums(rank + self._empty_before[number])

    def of_empty(self, number: np.ndarray, rank: np.ndarray) -> Sums:
        """Returns the sums of EMPTY leaves, (...), each given by its number and the number of pieces before it."""
        return self._sums(rank + self._empty_before[number])

    def _sums(self, at: np.ndarray) -> Sums:
        flat, C, d = at.reshape(-1), self._C, self._d
        count = self._counts[flat].astype(np.int64)
        sums: Array = np.zeros((len(flat), C.shape[1] + 1))
        sizes = np.zeros_like(sums)
        end = np.cumsum(count)
        some = np.flatnonzero(count)
        for part in np.split(some, np.flatnonzero(np.diff(end[some] // _MULTIPLIED)) + 1) if some.size else ():
            first = end[part] - count[part]
            index = np.repeat(self._start[flat[part]] - (first - first[0]), count[part]) + np.arange(count[part].sum())
            face, weight = self._faces[index], self._proof.multipliers[index].astype(float)[:, None]
            terms = weight * np.column_stack([C[face], d[face]])
            sums[part] = np.add.reduceat(terms, first - first[0], axis=0)
            sizes[part] = np.add.reduceat(np.abs(terms), first - first[0], axis=0)
        shape = at.shape
        return Sums(
            sums[:, -1].reshape(shape),
            sums[:, :-1].reshape(*shape, -1),
            sizes[:, -1].reshape(shape),
            sizes[:, :-1].reshape(*shape, -1),
            count.reshape(shape),
        )


def _ends(stream: np.ndarray) -> np.ndarray:
    """Returns where each of the binary trees of a stream in preorder ends (behind its last node); an unfinished one has no end."""
    open_ = np.cumsum(np.where(stream >= 0, np.int8(1), np.int8(-1)), dtype=np.int32)
    least = np.minimum.accumulate(open_)
    before = np.concatenate([np.zeros(1, dtype=np.int32), least[:-1]])
    return np.flatnonzero(np.minimum(least, 0) < np.minimum(before[: len(least)], 0)) + 1

"""This proof says that a motion is free of collisions: it divides the time of every piece, for every pair, and gives each part a plane."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from certifier.errors import CirisError, ProofError
from certifier.model import Array, Scene
from certifier.proof import limits
from certifier.proof.container import FORMAT, Arrays, head, malformed, pack, unpack
from certifier.proof.separation import same_scene

KIND = "motion"


class Space(StrEnum):
    """The space says in which coordinates a motion is a polynomial of time, piece by piece."""

    Q = "q"
    S = "s"

    def limits(self, scene: Scene) -> tuple[Array, Array]:
        """Returns the joint limits that control points keep to, (n,) each: the joints' own ones in q; rounded outwards to doubles in s."""
        return scene.own_limits if self is Space.Q else scene.outer_limits


@dataclass(frozen=True)
class Motion:
    """A motion is made of polynomial pieces of one degree m, in Bernstein form. The time of each runs from 0 to 1.

    Piece k has the control points from number k m to (k + 1) m: it begins at the first of them and ends at the last, where the next piece
    begins. Of degree 1 it goes straight from waypoint to waypoint.

    Attributes:
        space: whether the control points are joint positions q, in radians or metres, or the coordinates s.
        controls: (P m + 1, n) control points of P pieces, one or more.
        degree: m, 1 or more.
    """

    space: Space
    controls: Array
    degree: int = 1

    @property
    def pieces(self) -> int:
        """Returns the number of pieces, P."""
        return (len(self.controls) - 1) // self.degree

    @property
    def waypoints(self) -> Array:
        """Returns where pieces begin and end, (P + 1, n)."""
        return self.controls[:: self.degree]

    @property
    def bezier(self) -> Array:
        """Returns the control points of every piece, (P, m + 1, n), which cannot be written to."""
        return sliding_window_view(self.controls, self.degree + 1, axis=0)[:: self.degree].swapaxes(1, 2)

    def beginning(self, pieces: int) -> Motion:
        """Returns the first pieces."""
        return Motion(self.space, self.controls[: pieces * self.degree + 1], self.degree)

    def at(self, piece: int, time: float) -> Array:
        """Returns the motion's coordinates, (n,), at a time of a piece, from 0 to 1; they are rounded. Source: de Casteljau."""
        points = self.controls[piece * self.degree : (piece + 1) * self.degree + 1]
        while len(points) > 1:
            points = points[:-1] + time * (points[1:] - points[:-1])
        return points[0]


@dataclass(frozen=True)
class MotionProof:
    """Holds planes that keep every pair of the scene apart all along a motion, or along its beginning (docs/proofs.md).

    The arrays of intervals hold, one after the other, those of the first pair: of its first piece in the order of time, of its second
    piece, and so on; then those of the next pair.

    Attributes:
        end: the time of the last piece up to which the motion is proved, above 0; 1 where all of it is.
        rho: the tube: joint positions that are off by this much, in radians or metres, are proved as well.
        frames: (R,) int32, for every one of the scene's R pairs, the number of the body in whose frame its planes are constant.
        counts: (R, P) int32, in how many intervals the time of each piece is divided for each pair.
        ends: (I,) when each interval ends; it begins where the one before ends, or at 0.
        normals: (I, 3) of the planes, unit vectors to rounding that point from b to a.
    """

    scene: Scene
    motion: Motion
    end: float
    rho: float
    frames: np.ndarray
    counts: np.ndarray
    ends: Array
    normals: Array

    def to_bytes(self) -> bytes:
        """Returns the proof as a file."""
        said = {"space": self.motion.space.value, "degree": self.motion.degree, "end": self.end, "rho": self.rho}
        header = {"format": FORMAT, "kind": KIND, "scene_hash": self.scene.hash, **said}
        arrays = {name: getattr(self, name) for name in ("frames", "counts", "ends", "normals")}
        return pack(header, {"controls": self.motion.controls, **arrays})

    @classmethod
    def from_bytes(cls, data: bytes, scene: Scene) -> MotionProof:
        """Reads what :meth:`to_bytes` writes.

        Raises:
            ProofError: the file is no proof about a motion, or one about another scene.
        """
        header, unpacked = unpack(data, KIND)
        with malformed():
            fields, arrays = head(header, "space", "degree", "end", "rho"), Arrays(unpacked)
            same_scene(fields, scene)
            space = fields["space"].text()
            if space not in set(Space):
                raise CirisError("document", f"{space[:40]!r} is no space of a motion", field="header.space")
            degree = fields["degree"].count()
            frames, counts = arrays.take("frames", "int32"), arrays.take("counts", "int32")
            controls, ends, normals = (arrays.floats(name) for name in ("controls", "ends", "normals"))
            arrays.end()
            end, rho = (float(fields[name].number()) for name in ("end", "rho"))
        proof = cls(scene, Motion(Space(space), controls, degree), end, rho, frames, counts, ends, normals)
        proof.check_shapes()
        return proof

    def check_shapes(self) -> None:
        """Checks that the arrays fit each other and the scene.

        Raises:
            ProofError: proof_malformed.
        """
        pairs, controls, degree = len(self.scene.pairs), self.motion.controls, self.motion.degree
        if not 1 <= degree <= limits.DEGREE:
            raise ProofError("proof_malformed", f"the motion's degree is {degree}, where 1 to {limits.DEGREE} belong")
        if controls.ndim != 2 or controls.shape[1] != self.scene.n or len(controls) < 2 or (len(controls) - 1) % degree:
            problem = f"the control points are {controls.shape}, where ({degree} for each piece and one more, {self.scene.n}) belong"
            raise ProofError("proof_malformed", problem)
        if self.frames.shape != (pairs,) or self.counts.shape != (pairs, self.motion.pieces):
            problem = f"frames are {self.frames.shape} and counts {self.counts.shape}, for {pairs} pairs on {self.motion.pieces} pieces"
            raise ProofError("proof_malformed", problem)
        if self.counts.size and self.counts.min() < 1:
            raise ProofError("proof_motion", "a pair has no interval on a piece of the motion")
        total = int(self.counts.sum(dtype=np.int64))
        if self.ends.shape != (total,) or self.normals.shape != (total, 3):
            problem = f"ends are {self.ends.shape} and normals {self.normals.shape}, for {total} intervals"
            raise ProofError("proof_malformed", problem)

"""The clearance of a region: the least distance of the padded bodies over all of it, bounded from both sides.

Configurations bound it from above. From below, the region is certified again in a scene with more padding, just less than they allow.
"""

from __future__ import annotations

import base64
from collections.abc import Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Any

import numpy as np
from scipy.optimize import minimize

from certifier.conditioned import without_conditions
from certifier.growth.pairs import alike
from certifier.jobs.parallel import side_by_side
from certifier.kinematics import Kinematics
from certifier.model import Array, Pair, Polytope, Scene
from certifier.motion.nearest import separation
from certifier.outcome import Outcome
from certifier.pair.result import PairResult
from certifier.partition.certification import CellCertification
from certifier.polytopes.sampling import hit_and_run
from certifier.proof.region import RegionProof, read_part
from certifier.verify import uncovered
from certifier.verify.file import read_file
from certifier.verify.region import verify_region

SAMPLES, DESCENTS, STEPS = 4000, 24, 60
"""SAMPLES configurations are sampled. From at most DESCENTS of them, the distance is followed downwards, in at most STEPS steps."""
EACH = 3
"""At most this many descents begin with one pair."""
DIFFERENCE, INWARDS = 1e-6, 1e-9
"""Derivatives are differences over DIFFERENCE of s. The end of a descent is moved back inwards by the part INWARDS of its way."""
SHARE, METRES = 0.1, 1e-4
"""A clearance is proved to this part of itself, or to this many metres, whichever is more."""
TRIES = 12
"""A region is certified again at most this many times."""
CELLS, FINER = 50_000, 16.0
"""Each time, at most CELLS cells of each pair are looked at. They are cut finer than those of a growth, by the factor FINER."""


@dataclass(frozen=True)
class Nearest:
    """Names a pair and a configuration of a region.

    Attributes:
        s: (n,) the configuration.
        distance: of the padded bodies there, metres.
    """

    pair: Pair
    s: Array
    distance: float


@dataclass(frozen=True)
class RegionClearance:
    """Says how far apart the padded bodies of a region are.

    Attributes:
        distance: metres, a proved lower bound over all of the region.
        nearest: where they come closest, as far as was found.
        proof: the region's proof file in the scene with more padding, which proves the distance; None where the region's own proof does.
    """

    scene: Scene
    distance: float
    nearest: Nearest
    proof: bytes | None

    @property
    def tight(self) -> bool:
        """Returns whether the distance of ``nearest`` is larger by at most 10 % or 0.1 mm."""
        return _proved_of(self.nearest.distance) <= self.distance <= self.nearest.distance

    def document(self) -> dict[str, Any]:
        """Returns it as JSON-able data, whose keys are stable (docs/proofs.md)."""
        nearest, q = self.nearest, self.scene.to_q(self.nearest.s)
        return {
            "scene": {"name": self.scene.name, "hash": self.scene.hash},
            "clearance": self.distance,
            "tight": self.tight,
            "nearest": {"a": nearest.pair.a, "b": nearest.pair.b, "q": q.tolist(), "distance": nearest.distance},
            "not_covered_summary": uncovered.document(self.scene)["summary"],
        }


def clearance(data: bytes, processes: int = 1, seed: int = 0) -> RegionClearance:
    """Returns the clearance of a region.

    Args:
        data: its proof file.
        processes: how many processes verify and certify.
        seed: of the samples.

    Raises:
        ProofError: the file is no region's proof, or one that does not hold.
        SceneError: ``no_pairs``.
    """
    proof, known = RegionProof.from_bytes(data), verify_region(data, processes).gap
    scene, polytope = without_conditions(proof.scene), Polytope(proof.C, proof.d)  # They are no distances between bodies.
    scene.check_pairs("PROOF")
    distances = _Distances(scene)
    nearest, file, share = _sampled(distances, polytope, proof.interior, seed), None, 1.0
    for _ in range(TRIES):
        wanted = share * _proved_of(nearest.distance)
        if known >= wanted:
            break
        padded = _padded(scene, wanted / 2)
        results = _certified(padded, proof, processes, seed)
        if all(result.outcome is Outcome.CERTIFIED for result in results):
            file = _assembled(padded, proof, results)
            more = min(Fraction(padded.padding_of(pair)) - Fraction(scene.padding_of(pair)) for pair in scene.pairs)
            shown = 2 * more + Fraction(verify_region(file, processes).gap)
            known = _rounded_down(shown)
            break
        witnesses = [result.witness_s for result in results if result.witness_s is not None]
        nearer = min((distances.nearest(s) for s in witnesses if polytope.contains(s)), key=lambda found: found.distance, default=nearest)
        if nearer.distance < nearest.distance:
            nearest = distances.followed(nearer, polytope)
        else:
            share /= 2
    return RegionClearance(scene, known, nearest, file)


def _proved_of(distance: float) -> float:
    """Returns how large a distance is to be proved where one of ``distance`` occurs, in metres."""
    return max(0.0, distance - max(SHARE * distance, METRES))


def _rounded_down(value: Fraction) -> float:
    """Returns a double that is no larger."""
    return float(np.nextafter(float(value), -np.inf))


def _padded(scene: Scene, more: float) -> Scene:
    """Returns a scene with this much more padding around every geometry, in metres."""
    pairs = [pair if pair.padding is None else replace(pair, padding=pair.padding + more) for pair in scene.pairs]
    return replace(scene, padding=scene.padding + more, pairs=tuple(pairs))


def _certified(scene: Scene, proof: RegionProof, processes: int, seed: int) -> list[PairResult]:
    """Certifies the pairs of a scene with more padding on a region."""
    search = CellCertification(scene, scene.polytope(proof.C, proof.d), seed, finer=FINER)
    work = [(index, 0) for index in range(len(scene.pairs))]
    return list(side_by_side(lambda index, _: search.certify(index, CELLS), work, processes, lambda index: alike(scene, index)))


def _assembled(scene: Scene, proof: RegionProof, results: Sequence[PairResult]) -> bytes:
    """Returns the proof file of the same region in a scene with more padding."""
    files = dict.fromkeys(result.proof for result in results if result.proof is not None)
    parts = tuple(read_part(data, scene) for data in files)
    return replace(proof, scene=scene, proofs=parts).to_bytes()


class _Distances:
    """Measures how far the padded bodies of a scene are apart, in floating point."""

    def __init__(self, scene: Scene) -> None:
        self._scene, self._kinematics, self.pairs = scene, Kinematics.of(scene), scene.pairs

    def of(self, pair: Pair, s: Array) -> Array:
        """Returns the distances of a pair at configurations (k, n) in s, metres; 0 or less where they overlap."""
        a, b = self._scene.geometry(pair.a), self._scene.geometry(pair.b)
        frame = self._kinematics.bodies_between(a.body, b.body)[0]
        A, B = (self._kinematics.points(frame, g.body, g.vertices, s) for g in (a, b))
        reach, normal = a.radius + b.radius + 2 * self._scene.padding_of(pair), np.empty(3)
        return np.array([separation(A[i], B[i], normal) - reach for i in range(len(s))])

    def nearest(self, s: Array) -> Nearest:
        """Returns the nearest pair at a configuration (n,)."""
        return min((Nearest(pair, s, float(self.of(pair, s[None])[0])) for pair in self._scene.pairs), key=lambda found: found.distance)

    def followed(self, start: Nearest, polytope: Polytope) -> Nearest:
        """Returns where a pair comes closest near a configuration, or the start. Source: SciPy's SLSQP."""
        n, pair = len(start.s), start.pair

        def both(s: Array) -> tuple[float, Array]:
            found = self.of(pair, np.concatenate([s[None], s + DIFFERENCE * np.eye(n), s - DIFFERENCE * np.eye(n)]))
            return float(found[0]), (found[1 : n + 1] - found[n + 1 :]) / (2 * DIFFERENCE)

        inside = {"type": "ineq", "fun": lambda s: polytope.d - polytope.C @ s, "jac": lambda s: -polytope.C}
        s = minimize(both, start.s, jac=True, method="SLSQP", constraints=[inside], options={"maxiter": STEPS, "ftol": 1e-9}).x
        # The end is on faces, to rounding; what is a little inwards is inside.
        s = s + INWARDS * (start.s - s)
        if not polytope.contains(s):
            return start
        return min(start, Nearest(pair, s, float(self.of(pair, s[None])[0])), key=lambda found: found.distance)


def _sampled(distances: _Distances, polytope: Polytope, inside: Array, seed: int) -> Nearest:
    """Returns where padded bodies come closest, as samples and descents say."""
    s = hit_and_run(polytope, inside, SAMPLES, seed)
    starts: list[Nearest] = []
    for pair in distances.pairs:
        found = distances.of(pair, s)
        starts += [Nearest(pair, s[i], float(found[i])) for i in np.argsort(found)[:EACH]]
    starts.sort(key=lambda start: start.distance)
    return min((distances.followed(start, polytope) for start in starts[:DESCENTS]), key=lambda found: found.distance)


def clearance_in_child(payload: dict[str, Any]) -> dict[str, Any]:
    """Returns the document of a region's clearance, with the ``units`` of joint positions, and the ``proof`` in base 64 or None.

    A child process runs this function.

    Args:
        payload: the ``path`` of the region's proof file, and ``processes``, as for :func:`clearance`.

    Raises:
        CirisError: no_file, when the file cannot be read.
        ProofError: as :func:`clearance`.
    """
    found = clearance(read_file(payload["path"]), payload["processes"])
    return {
        **found.document(),
        "units": [*found.scene.units],
        "proof": None if found.proof is None else base64.b64encode(found.proof).decode(),
    }

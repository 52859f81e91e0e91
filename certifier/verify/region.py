"""The verifier checks a region's proof exactly here.

Every pair of the scene is separated on the whole region, or ProofError says why not.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from certifier.errors import ProofError
from certifier.model import NO_PAIRS, Pair, Scene
from certifier.proof import limits
from certifier.proof.ground import Ground
from certifier.proof.region import RegionProof
from certifier.verify.archimedean import check_archimedean
from certifier.verify.box import Halfspaces, limited, within_limits
from certifier.verify.conditions import conditions
from certifier.verify.decimals import exactly, rounded_down, rounded_up
from certifier.verify.kinematics import exact
from certifier.verify.paddings import paddings
from certifier.verify.pair import check_ground
from certifier.verify.scene import check_scene, following
from certifier.verify.separations import Progress, statements
from certifier.verify.uncovered import not_covered
from certifier.words import counted


@dataclass(frozen=True)
class RegionStatement:
    """States what a valid proof proves.

    Attributes:
        faces: number of half-spaces, joint limits included.
        gaps: for every pair of the scene, in its order, a lower bound in metres of the distance between the two (padded) bodies.
        N: bound with |s|^2 <= N on the region (Archimedean, appendix A).
    """

    scene: Scene
    faces: int
    gaps: dict[Pair, float]
    N: float

    @property
    def gap(self) -> float:
        """Returns the least certified distance in metres over all pairs of bodies (0 when there is no pair)."""
        return min(self.between_bodies.values(), default=0.0)

    @property
    def between_bodies(self) -> dict[Pair, float]:
        """Returns the gaps of the pairs that prove no condition."""
        return {pair: self.gaps[pair] for pair in self.scene.body_pairs}

    def lines(self) -> list[str]:
        """Returns the statement in plain words."""
        scene = self.scene
        joints = [
            f"  '{j.name}': {exactly(lower)} to {exactly(upper)} {j.unit} (centre {exactly(q)})"
            for j, lower, upper, q in zip(scene.moving, scene.q_lower, scene.q_upper, scene.q_star, strict=True)
        ]
        gaps = self.between_bodies
        closest = min(gaps, key=gaps.__getitem__, default=None)
        return [
            f"scene of hash {scene.hash}",
            f"{scene.n} {'joint' if scene.n == 1 else 'joints'}, within their limits:",
            *joints,
            *following(scene),
            f"a bounded, non-empty polytope of {self.faces} half-spaces in tangent space; |s|^2 <= {rounded_up(self.N, 6)}",
            f"{counted(len(gaps), 'pair')} of bodies separated at every configuration of it" if gaps else NO_PAIRS,
            *conditions(scene),
            *paddings(scene),
            *([f"least distance, padded, at least {rounded_down(self.gap)} m: '{closest.a}' and '{closest.b}'"] if closest else []),
            *not_covered(scene),
            "guarantee: exact (rigorous arithmetic; the parsed model taken at its word)",
        ]


def verify_region(data: bytes, processes: int = 1, progress: Progress | None = None) -> RegionStatement:
    """Checks a region's proof file and returns what it proves.

    Args:
        processes: how many processes check the proofs of the pairs.
        progress: receives how many of how many parts they have checked.

    Raises:
        ProofError: the file is malformed or the proof does not hold.
    """
    proof = RegionProof.from_bytes(data)
    scene = proof.scene
    check_scene(scene)
    _check_polytope(proof)
    _check_implied(proof)
    for ground in {id(part.ground): part.ground for part in proof.proofs}.values():
        check_ground(scene, ground)
        _check_inside(proof, ground)
    gaps: dict[Pair, float] = {}
    for statement in statements(scene, proof.proofs, processes, progress):
        for pair in statement.pairs:
            gaps[pair] = max(statement.gap, gaps.get(pair, 0.0))
    missing = next((pair for pair in scene.pairs if pair not in gaps), None)
    if missing:
        raise ProofError("proof_pairs", f"no proof covers the pair {missing.a} and {missing.b}")
    return RegionStatement(scene, len(proof.d), {pair: gaps[pair] for pair in scene.pairs}, proof.archimedean.N)


def _check_polytope(proof: RegionProof) -> None:
    """Checks that the region has the joint limits among its rows and a point strictly inside, and is Archimedean, hence bounded."""
    scene, n = proof.scene, proof.scene.n
    if max(proof.d.size, proof.implied.d.size) > limits.FACES:
        raise ProofError("proof_too_large", f"the region has more than {limits.FACES} half-spaces, or implies more")
    if proof.C.shape != (proof.d.size, n) or proof.d.ndim != 1 or proof.interior.shape != (n,):
        raise ProofError("proof_malformed", "the region's arrays do not fit the scene")
    rows = limited(scene, np.zeros((0, n)), np.zeros(0))
    if not _among(proof.C, proof.d, rows.C, rows.d):
        raise ProofError("proof_limits", "the joint limits are not among the region's half-spaces")
    if not within_limits(scene, proof.interior):
        raise ProofError("proof_interior", "the interior point is not within the joint limits")
    point = [exact(x) for x in proof.interior]
    for c, d in zip(proof.C, proof.d, strict=True):
        if not sum(exact(x) * s for x, s in zip(c, point, strict=True)) < exact(d):
            raise ProofError("proof_interior", "the interior point is not strictly inside the region")
    if not check_archimedean(proof.C, proof.d, proof.archimedean):
        raise ProofError("proof_archimedean", "the multipliers do not prove the region Archimedean")


def _check_implied(proof: RegionProof) -> None:
    """Checks that the multipliers prove the implied half-spaces."""
    implied, n = proof.implied, proof.scene.n
    h = implied.d.size
    if implied.d.shape != (h,) or implied.C.shape != (h, n) or implied.Y.shape != (h, len(proof.d)):
        raise ProofError("proof_malformed", "the implied half-spaces do not fit the region")
    rows = Halfspaces(proof.C, proof.d)
    for c, d, y in zip(implied.C, implied.d, implied.Y, strict=True):
        if not rows.lie_in(c, float(d), y):
            raise ProofError("proof_implied", "the multipliers do not prove a half-space around the region")


def _check_inside(proof: RegionProof, ground: Ground) -> None:
    """Checks that every face of the ground is a half-space of the region or an implied one, or one of them moved outwards."""
    C, d = np.concatenate([proof.C, proof.implied.C]), np.concatenate([proof.d, proof.implied.d])
    if not _among(C, d, ground.C, ground.d):
        raise ProofError("proof_ground", "a pair's proof is about a polytope that does not contain the region")


def _among(C: np.ndarray, d: np.ndarray, rows: np.ndarray, offsets: np.ndarray) -> bool:
    """Returns whether every one of ``rows`` is a row of C, with an offset that is no smaller than the one in d."""
    least: dict[bytes, float] = {}
    for c, offset in zip(C + 0.0, d, strict=True):
        least[c.tobytes()] = min(offset, least.get(c.tobytes(), np.inf))
    return all(least.get(c.tobytes(), np.inf) <= offset for c, offset in zip(rows + 0.0, offsets, strict=True))

"""The verifier checks a refutation here: at a configuration of the polytope a point of one padded body lies in the other, to TOLERANCE.

The configuration is rational, so the positions of the two points are exact. Bodies that just touch do so at no rational configuration.
The tolerance is there for that.
"""

from __future__ import annotations

from dataclasses import dataclass

from flint import fmpq

from certifier.conditioned import contact_refutes
from certifier.errors import ProofError
from certifier.model import Array, Pair
from certifier.proof.negative import WitnessProof
from certifier.verify.box import Halfspaces, within_limits
from certifier.verify.kinematics import ExactKinematics, exact
from certifier.verify.scene import check_scene

TOLERANCE = 1e-6
"""Two padded bodies that are at most this far apart, in metres, count as touching."""


@dataclass(frozen=True)
class WitnessStatement:
    """States what a valid witness proves: at s, in the polytope, the padded bodies of the pair touch, or nearly so, to TOLERANCE."""

    pair: Pair
    s: Array


def verify_witness(proof: WitnessProof) -> WitnessStatement:
    """Checks a refutation and returns what it proves.

    Raises:
        ProofError: the refutation does not hold.
    """
    check_scene(proof.scene)
    return check_witness(proof)


def check_witness(proof: WitnessProof) -> WitnessStatement:
    """Checks a refutation in a scene that :func:`check_scene` has accepted, and returns what it proves.

    Raises:
        ProofError: the refutation does not hold.
    """
    scene, s = proof.scene, proof.s
    n, m = scene.n, proof.d.size
    if proof.C.shape != (m, n) or proof.d.shape != (m,) or s.shape != (n,):
        raise ProofError("proof_malformed", "the arrays of the witness do not fit the scene")
    if proof.pair not in scene.pairs:
        raise ProofError("proof_pair", f"{proof.pair.a} and {proof.pair.b} are not a pair of the scene")
    if not contact_refutes(scene, proof.pair):
        raise ProofError("proof_witness", "a contact of what stands for a ball does not show that anything is outside of the ball")
    if not (within_limits(scene, s) and Halfspaces(proof.C, proof.d).contains(s)):
        raise ProofError("proof_witness", "the configuration is not in the polytope, or not within the joint limits")
    point = [exact(x) for x in s]
    a, b = scene.geometry(proof.pair.a), scene.geometry(proof.pair.b)
    X = ExactKinematics.at(scene, point).pose(a.body, b.body)
    p, other = (_mean(g.vertices, w) for g, w in zip((a, b), proof.weights, strict=True))
    q = [sum((X[i][j] * other[j] for j in range(3)), X[i][3]) / X[3][3] for i in range(3)]
    reach = exact(a.radius) + exact(b.radius) + 2 * exact(scene.padding_of(proof.pair)) + exact(TOLERANCE)
    if not sum(((x - y) ** 2 for x, y in zip(p, q, strict=True)), fmpq(0)) <= reach * reach:
        raise ProofError("proof_witness", f"{a.name} and {b.name} do not touch at the configuration")
    return WitnessStatement(proof.pair, s)


def _mean(vertices: Array, weights: Array) -> list[fmpq]:
    if weights.shape != (len(vertices),) or not (weights >= 0).all() or not weights.any():
        raise ProofError("proof_malformed", "the weights of the witness are no convex weights")
    exactly = [exact(w) for w in weights]
    total = sum(exactly, fmpq(0))
    return [sum((w * exact(v[i]) for w, v in zip(exactly, vertices, strict=True)), fmpq(0)) / total for i in range(3)]

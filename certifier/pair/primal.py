"""Proofs are made here from the solver's Gram matrices (certifier.proof.pair says what proofs consist of)."""

from __future__ import annotations

import numpy as np

from certifier.conic.basis import subsets
from certifier.conic.interior_point import Solution
from certifier.model import Array, Volume
from certifier.pair.frames import Frame
from certifier.pair.program import Sides
from certifier.proof.ground import Ground
from certifier.proof.pair import PairProof, Side


def pair_proof(sides: Sides, volumes: tuple[Volume, Volume], frame: Frame, ground: Ground, solution: Solution, kind: str) -> PairProof:
    """Makes the proof of a feasible point; the verifier says whether it holds once it is rounded.

    Args:
        kind: type of the Gram factors' numbers, one of BITS.

    Raises:
        np.linalg.LinAlgError: a Gram matrix is not positive definite.
    """
    scene, joints, j = sides.kinematics.scene, list(sides.joints), len(sides.joints)
    m, n = len(ground.d), scene.n
    moving = solution.y[: 4 * (j + 1)].reshape(4, j + 1)
    plane = np.zeros((4, n + 1))
    plane[:, 0] = moving[:, 0] - moving[:, 1:] @ sides.u_c[joints]
    plane[:, 1:][:, joints] = moving[:, 1:]
    kappa = float(solution.y[4 * (j + 1)]) if len(solution.y) > 4 * (j + 1) + 1 else 0.0
    resting = [i for i in frame.path if i not in joints]
    faces = (*sides.faces, *(first + i for i in resting for first in (m, m + n)))
    found = []
    for chain, Q in zip((frame.chain_a, frame.chain_b), solution.Q[:2], strict=True):
        whole = subsets(len(chain))
        factor = np.zeros((len(Q[0]), 1 + len(faces), len(whole), len(whole)))
        factor[:, : 1 + len(sides.faces)] = _factor(Q[0] / sides.scales[:, None, None], whole)
        for part, i in zip(Q[1:], (i for i in chain if i not in joints), strict=True):
            at = 1 + len(sides.faces) + 2 * resting.index(i)
            factor[:, at : at + 2] = _of_range(_factor(part, whole[whole[:, chain.index(i)] == 0])[:, 0], chain.index(i), whole)
        found.append(Side.rounded(chain, factor, kind))
    return PairProof(scene, volumes, frame.body, ground, sides.center, plane, solution.t, kappa, faces, (found[0], found[1]))


def _factor(Q: Array, members: np.ndarray) -> Array:
    """Returns Cholesky factors in plain monomials of Gram matrices in the functions of basis.rho.

    Args:
        members: which coordinates each function is a product of, as in basis.subsets.
    """
    return np.linalg.cholesky(Q) * np.sqrt(3.0) ** members.sum(axis=1)[:, None]


def _of_range(factor: Array, place: int, whole: np.ndarray) -> Array:
    """Returns factors for the faces 1 + u_i and 1 - u_i, (V, 2, L, L), that together give 1 - u_i^2 times the given squares.

    (1 - u^2) q^2 = (1 + u) ((1 - u) q)^2 / 2 + (1 - u) ((1 + u) q)^2 / 2.

    Args:
        factor: (V, L/2, L/2) factors of the squares of the functions without u_i.
        place: where u_i is among the chain's coordinates.
    """
    without, with_ = np.flatnonzero(whole[:, place] == 0), np.flatnonzero(whole[:, place] == 1)
    found = np.zeros((len(factor), 2, len(whole), len(whole)))
    for face, sign in enumerate((-1.0, 1.0)):
        found[:, face, without[:, None], without] = factor / np.sqrt(2)
        found[:, face, with_[:, None], without] = sign * factor / np.sqrt(2)
    return found

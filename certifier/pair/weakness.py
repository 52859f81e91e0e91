"""The weakness of a pair is found here: where its program fails and what would help targeted contraction (certifier.growth.paper)."""

from __future__ import annotations

import numpy as np

from certifier.conic.basis import subsets
from certifier.conic.interior_point import Solution
from certifier.model import Array, Polytope
from certifier.pair.frames import Frame
from certifier.pair.program import Sides

LEAST_MASS = 0.15
"""The mean of a functional counts if its mass is more than this part of the largest mass."""


def weak_points(frame: Frame, sides: Sides, solution: Solution) -> Array:
    """Returns the means (w, n) of the pseudo-moments that carry weight."""
    found = [sides.means(chain, x) for chain, x in zip((frame.chain_a, frame.chain_b), solution.x[:2], strict=True)]
    means, mass = (np.concatenate(parts) for parts in zip(*found, strict=True))
    return means[mass > LEAST_MASS * mass.max()]


def pull(frame: Frame, sides: Sides, faces: Polytope, solution: Solution) -> Array:
    """Returns what the program's optimum gains, to first order, when a joint's range shrinks towards the centre, (n,).

    The derivative for a face's offset is <Q_j, Lambda_0(x)>, and twice that for the weight 1 - u_i^2. A face of the box belongs to its
    joint. Any other face belongs to its joints by their parts in its reach.

    Args:
        faces: P's faces, of which ``sides`` uses some.
    """
    n = len(sides.u_c)
    share = np.abs(np.concatenate([faces.C * sides.box.half, np.eye(n), np.eye(n)]))
    share /= share.sum(axis=1, keepdims=True)
    gains, found = np.zeros(len(sides.faces)), np.zeros(n)
    for chain, Q, x in zip((frame.chain_a, frame.chain_b), solution.Q[:2], solution.x[:2], strict=True):
        whole = sides.cone(chain)[0].adjoint(x)[0][:, 0]
        gains += np.einsum("rkij,rij->k", Q[0][:, 1:], whole)
        for part, i in zip(Q[1:], (i for i in chain if i not in sides.joints), strict=True):
            without = np.flatnonzero(subsets(len(chain))[:, chain.index(i)] == 0)
            found[i] += 2 * float(np.einsum("rij,rij->", part[:, 0], whole[:, without[:, None], without]))
    found += gains @ share[list(sides.faces)]
    return found

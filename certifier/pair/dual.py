"""Dual proofs are made here from the solver's dual points (certifier.verify.dual says what they prove, and what not).

The solver ends with sum_r A_r'x_r = lam a and lam < 0. Here a is a multiple of sum_r A_r'x_w, and x_w is the centre, an interior
point of the dual cone. So x_r + mu x_w with mu > 0 is in the interior too, and its sum vanishes to rounding.

Changing a few moments makes the rest of the sum vanish. Pivoted QR factorisations choose equations that are independent
and moments that meet them well.
"""

from __future__ import annotations

import numpy as np
from scipy.linalg import qr

from certifier.conic.interior_point import Block
from certifier.model import Array, Pair
from certifier.pair.frames import Frame
from certifier.pair.program import Sides
from certifier.proof.ground import Ground
from certifier.proof.negative import DualProof
from certifier.verify.moments import monomials, table

RANK_TOLERANCE = 1e-9
TRACE_SHARE = 1e-7
"""Yaa is made smaller by this part of the trace of Y, so that rounding does not make it too large."""


def dual_proof(sides: Sides, pair: Pair, frame: Frame, ground: Ground, blocks: list[Block], x: list[Array]) -> DualProof:
    """Makes the proof from a dual point x of the pair's program; the verifier says whether it holds.

    Args:
        blocks: the program (certifier.pair.program.build).
        x: the solver's x, a list over the blocks of (R, N).
    """
    scene, n = sides.kinematics.scene, sides.kinematics.scene.n
    centres: Array = np.sum([np.einsum("rnp,n->p", b.columns, b.centre.x) for b in blocks], axis=0)[:-1]
    sums: Array = np.sum([np.einsum("rnp,rn->p", b.columns, v) for b, v in zip(blocks, x, strict=True)], axis=0)[:-1]
    mu = -(sums @ centres) / (centres @ centres)
    x = [v + mu * b.centre.x for b, v in zip(blocks, x, strict=True)]
    chains = (frame.chain_a, frame.chain_b)
    moments = [_moments(sides, chain, v) for chain, v in zip(chains, x[:2], strict=True)]
    rounded = len(blocks) > 2
    A, where = _equations(sides, pair, frame, moments)
    A = A[:, 3 * (n + 1) :] if rounded else A
    equations, rows = _independent(A)
    entries = where[rows]
    values = np.concatenate([m.ravel() for m in moments])
    change = np.linalg.solve(A[np.ix_(rows, equations)].T, -(values @ A)[equations])
    for (side, vertex, monomial), c in zip(entries, change, strict=True):
        moments[side][vertex, monomial] += c
    normal = (np.zeros((0, 0)), np.zeros((0, 0)))
    if rounded:
        Y = blocks[2].cone.adjoint(x[2])[0][0, 0]
        aa, bb = (Y[:3, :3] + Y[:3, :3].T) / 2, _lifted((Y[3:, 3:] + Y[3:, 3:].T) / 2, sides)
        normal = (aa - TRACE_SHARE * np.trace(Y) * np.eye(3), bb)
    named = tuple(int(k) for k in np.sort(equations))
    return DualProof(scene, pair, frame.body, ground, sides.center, (moments[0], moments[1]), named, entries, normal)


def _moments(sides: Sides, chain: tuple[int, ...], x: Array) -> Array:
    """Returns the values of functionals on the monomials, (R, N), the joints that are not in play being at the centre.

    Args:
        x: (R, N') the functionals in the sampled basis.
    """
    space, outside = sides.space(chain), sides.outside(chain)
    exponents = monomials(chain, sides.kinematics.scene.n)
    inside = np.prod(space.points[:, None, :] ** exponents[None, :, list(chain)], axis=2)
    size = len(space.points)
    moments = x[:, :size] @ inside
    for joint in (i for i in range(exponents.shape[1]) if i not in chain):
        others = exponents[:, joint] == 1
        if joint in outside:
            start = size + outside.index(joint) * space.grid
            moments[:, others] = x[:, start : start + space.grid] @ inside[: space.grid, others]
        else:
            moments[:, others] *= sides.u_c[joint]
    return moments


def _equations(sides: Sides, pair: Pair, frame: Frame, moments: list[Array]) -> tuple[Array, np.ndarray]:
    """Returns what every moment adds to R, (moments, 4 (n + 1)), and which moment it is: (moments, 3) side, vertex, monomial."""
    scene, n = sides.kinematics.scene, sides.kinematics.scene.n
    rows, where = [], []
    for side, (name, chain, held) in enumerate(zip((pair.a, pair.b), (frame.chain_a, frame.chain_b), moments, strict=True)):
        geometry, index = scene.geometry(name), table(chain, n)
        grid = np.arange(index.shape[1])[:, None] // 3 ** np.arange(len(chain)) % 3
        u = sides.points(chain)[: len(grid)]
        X = sides.kinematics.numerators(frame.body, geometry.body, sides.box.mid + sides.box.half * u)
        p = np.einsum("sij,vj->svi", X, np.column_stack([geometry.vertices, np.ones(len(geometry.vertices))]))
        monomial_values = np.prod(u[:, None, list(chain)] ** grid[None], axis=2)
        coefficients = np.linalg.solve(monomial_values, p.reshape(len(u), -1)).reshape(len(grid), len(held), 4)
        A = np.zeros((len(held), held.shape[1], 4, n + 1))
        for e in range(n + 1):
            A[..., e][:, index[e]] += (1 - 2 * side) * np.swapaxes(coefficients, 0, 1)
        rows.append(A.reshape(-1, 4 * (n + 1)))
        vertex, monomial = np.divmod(np.arange(held.size), held.shape[1])
        where.append(np.column_stack([np.full(held.size, side), vertex, monomial]))
    return np.concatenate(rows), np.concatenate(where)


def _independent(A: Array) -> tuple[np.ndarray, np.ndarray]:
    """Returns columns of A, (rows, K), that are independent, and as many rows in which these columns are independent, well-conditioned."""
    columns = A / np.maximum(np.linalg.norm(A, axis=0), np.finfo(float).tiny)
    _, R, order = qr(columns, mode="economic", pivoting=True)
    diagonal = np.abs(np.diag(R))
    equations = np.sort(order[: int((diagonal > RANK_TOLERANCE * diagonal[0]).sum())])
    _, _, pivots = qr(A[:, equations].T, mode="economic", pivoting=True)
    return equations, pivots[: len(equations)]


def _lifted(bb: Array, sides: Sides) -> Array:
    """Returns Ybb of all joints, (n + 1, n + 1), from Ybb of the joints in play.

    The other joints are at the centre; their diagonal is free up to Ybb_00.
    """
    n, at = len(sides.u_c), [0, *(1 + i for i in sides.joints)]
    lift = np.zeros((n + 1, len(at)))
    lift[1:, 0] = sides.u_c
    lift[at] = np.eye(len(at))
    lifted = lift @ bb @ lift.T
    rest = [i for i in range(n + 1) if i not in at]
    lifted[rest, rest] = lifted[0, 0]
    return (lifted + lifted.T) / 2

"""A primal-dual path-following method solves the pair program, with the HKM direction and Mehrotra's predictor-corrector.

    maximise t  over y = (z, t), Q :   A_r z - t w_r = sum_j g_j rho' Q_rj rho  for every rational r,   a'z = 1,   Q_rj psd
    dual:       minimise lam over x :  sum_r A_r' x_r = lam a,   sum_r w_r' x_r = 1,   Lambda_j(x_r) psd

These two are a weak-duality pair: t <= lam. The normalisation is a = sum_r A_r' x_w, where x_w is the centre of the cone for w, an
interior point of the dual cone. So every certificate has a'z > 0 and can be scaled to meet it.

A point with t > 0 whose residual can be absorbed is a certificate. A dual point with lam < 0 proves that no certificate of this form
exists. The method looks for both in every iteration, and the first one found ends the search.

Start: let H be the Hessian at x_w and B_r = [A_r, -w_r]. Let y minimise sum_r |B_r y|^2 in the metric H^-1 subject to a'y = 1, so that
sum_r B_r' H^-1 B_r y is a multiple of a. For T large enough, z, t - T and Q_r = T Q_w + Q_w Lambda(H^-1 B_r y) Q_w are primal feasible,
x_r ~ x_w - H^-1 B_r y / T is dual feasible, and Q_r Lambda(x_r) = T I to first order. So the start is close to the central path, and it
alone certifies an easy pair.

Sources: Helmberg, Rendl, Vanderbei, Wolkowicz (1996); Kojima, Shindoh, Hara (1997); Mehrotra (1992). Symbols are as in
certifier.conic.cone.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from itertools import islice

import numpy as np
from scipy.linalg import lu_factor, lu_solve

from certifier.conic.cone import Centre, Cone, Factor, inverse_cholesky, symmetrise
from certifier.conic.kernels import lowest_relative_eigenvalue
from certifier.model import Array

DUAL_TOLERANCE = 1e-9
GAP_TOLERANCE = 1e-9
START_SPREAD = 0.8
"""The start may deviate from the central path by this much, relatively."""
RIDGE = 1e-13
"""The normal equations get this relative ridge, because some plane coefficients may have no column: no rational depends on them."""
STEP_TOLERANCE = 1e-3


class Status(StrEnum):
    """The status says how the method ended."""

    FEASIBLE = "feasible"
    """A point was found with t > 0 and every Q psd, at which the identities hold to rounding."""
    INFEASIBLE = "infeasible"
    """A dual feasible point with lam < 0 was found."""
    BOUNDARY = "boundary"
    """The optimal margin is zero to working accuracy, so neither answer can be had."""
    ITERATION_LIMIT = "iteration_limit"
    """The iteration limit was reached first."""
    NUMERICAL = "numerical"
    """A factorisation failed before either answer was found."""


@dataclass(frozen=True)
class Block:
    """A block consists of R rationals that share a cone.

    Attributes:
        cone: the cone of all R.
        columns: (R, N, p) the linear map y -> A_r z - t w; the last column is -w.
        centre: the point of the dual cone that belongs to w.
    """

    cone: Cone
    columns: Array
    centre: Centre


@dataclass(frozen=True)
class Solution:
    """Holds what the method ended with.

    Attributes:
        y: (p,) the unknowns (z, t).
        lam: the dual objective.
        Q: a list over blocks of lists over the parts of the cone, of (R, K, L, L).
        x: a list over blocks, of (R, N).
    """

    status: Status
    y: Array
    lam: float
    Q: list[list[Array]]
    x: list[Array]
    iterations: int

    @property
    def t(self) -> float:
        return float(self.y[-1])


def solve(blocks: list[Block], max_iterations: int = 60, gap: float = np.inf) -> Solution:
    """Solves the program over ``blocks``.

    Args:
        gap: a certificate is taken once the gap is below this multiple of its margin. inf takes the first certificate, 1 takes one near
            the middle of the central path.
    """
    method = _PathFollowing(blocks, gap)
    status, iteration = None, 0
    while status is None and iteration < max_iterations:
        try:
            status = method.iterate()
        except np.linalg.LinAlgError:
            status = Status.NUMERICAL
        iteration += status is None
    if status not in (Status.FEASIBLE, Status.INFEASIBLE) and method.settles():
        status = Status.FEASIBLE
    return method.solution(status or Status.ITERATION_LIMIT, iteration)


class _PathFollowing:
    """Carries out the iteration; Gram matrices and their duals are lists over the parts of all blocks' cones, one after the other."""

    def __init__(self, blocks: list[Block], gap: float) -> None:
        self.gap = gap
        self.blocks, self.p = blocks, blocks[0].columns.shape[2]
        self.degree = sum(len(b.columns) * b.cone.degree for b in blocks)
        self.target = np.append(np.zeros(self.p - 1), -1.0)
        a: Array = np.sum([np.einsum("rnp,n->p", b.columns, b.centre.x) for b in blocks], axis=0)
        a[-1] = 0.0
        self.a = a / np.linalg.norm(a)
        self.y = self._least_deviation()
        deviations = [b.columns @ self.y for b in blocks]
        images = [_preimage(b, v) for b, v in zip(blocks, deviations, strict=True)]
        T = max(float(np.abs(relative).max()) for part in images for _, relative in part) / START_SPREAD
        self.y[-1] -= T
        self.Q = [T * Q + dQ for b, part in zip(blocks, images, strict=True) for Q, (dQ, _) in zip(b.centre.Q, part, strict=True)]
        x = [b.centre.x - b.centre.solve(v) / T for b, v in zip(blocks, deviations, strict=True)]
        mass = sum(float(-b.columns[0, :, -1] @ v.sum(axis=0)) for b, v in zip(blocks, x, strict=True))
        self.x = [v / mass for v in x]
        self.Z = self._adjoint(self.x)
        self.lam = float(self.a @ self._moments())

    def _least_deviation(self) -> Array:
        """Returns the y with a'y = 1 whose B_r y are smallest in the metric of the centres."""
        images = [b.centre.factor.forward(np.moveaxis(b.columns, 0, 1).reshape(1, b.cone.N, -1)).reshape(-1, self.p) for b in self.blocks]
        y = np.linalg.solve(_ridged(np.sum([image.T @ image for image in images], axis=0)), self.a)
        return y / (self.a @ y)

    def _adjoint(self, x: list[Array]) -> list[Array]:
        return [Z for b, v in zip(self.blocks, x, strict=True) for Z in b.cone.adjoint(v)]

    def _by_block(self, Q: list[Array]) -> list[list[Array]]:
        rest = iter(Q)
        return [list(islice(rest, len(b.cone.parts))) for b in self.blocks]

    def _values(self, Q: list[Array]) -> list[Array]:
        return [b.cone.values(part) for b, part in zip(self.blocks, self._by_block(Q), strict=True)]

    def _moments(self) -> Array:
        """Returns sum_r B_r' x_r, (p,)."""
        return np.sum([np.einsum("rnp,rn->p", b.columns, x) for b, x in zip(self.blocks, self.x, strict=True)], axis=0)

    def settles(self) -> bool:
        """Returns whether the present point is a certificate, however wide the gap; if so, it becomes the solution."""
        self.gap = np.inf
        return self.y[-1] > 0 and self._settle(self.y, self.Q)

    def solution(self, status: Status, iterations: int) -> Solution:
        return Solution(status, self.y, self.lam, self._by_block(self.Q), self.x, iterations)

    def iterate(self) -> Status | None:
        """Tests for an answer, then takes one predictor-corrector step."""
        blocks = self.blocks
        primal = [b.columns @ self.y - v for b, v in zip(blocks, self._values(self.Q), strict=True)]
        dual = self.target + self.lam * self.a - self._moments()
        gap = self._inner(self.Q, self.Z)
        if self.y[-1] > 0 and self._settle(self.y, self.Q):
            return Status.FEASIBLE
        if self.lam < 0 and np.abs(dual).max() < DUAL_TOLERANCE * max(1.0, abs(self.lam)):
            return Status.INFEASIBLE
        if gap < GAP_TOLERANCE:
            return Status.BOUNDARY

        inverse_chol_Q = [inverse_cholesky(Q) for Q in self.Q]
        inverse_chol_Z = [inverse_cholesky(Z) for Z in self.Z]
        S = [np.swapaxes(Li, -1, -2) @ Li for Li in inverse_chol_Z]
        factors, images, M = [], [], np.zeros((self.p, self.p))
        for b, Q, Si in zip(blocks, self._by_block(self.Q), self._by_block(S), strict=True):
            factor = Factor(b.cone.schur(Q, Si))
            image = factor.forward(b.columns)
            flat = image.reshape(-1, self.p)
            M += flat.T @ flat
            factors.append(factor)
            images.append(image)
        border = np.zeros((self.p + 1, self.p + 1))
        border[: self.p, : self.p], border[: self.p, -1], border[-1, : self.p] = _ridged(M), self.a, self.a
        lu = lu_factor(border, check_finite=False)

        def direction(centres: list[Array]) -> tuple[Array, float, list[Array], list[Array], list[Array]]:
            """Returns the Newton step for Q Z = centre: values(dQ) - B dy = primal, dZ = Lambda(dx)."""
            forwards, right = [], np.zeros(self.p)
            for value, r, factor, image in zip(self._values(centres), primal, factors, images, strict=True):
                v = factor.forward((value - r)[:, :, None])
                right += np.einsum("rnp,rnq->p", image, v)
                forwards.append(v)
            solution = lu_solve(lu, np.append(right - dual, 0.0), check_finite=False)
            dy, dlam = solution[:-1], float(solution[-1])
            dx = [f.backward(v - (image @ dy)[:, :, None])[:, :, 0] for f, v, image in zip(factors, forwards, images, strict=True)]
            dZ = self._adjoint(dx)
            dQ = [C - symmetrise(Q @ d @ Si) for C, Q, d, Si in zip(centres, self.Q, dZ, S, strict=True)]
            return dy, dlam, dx, dZ, dQ

        mu = gap / self.degree
        dy, _, _, dZ, dQ = direction([-Q for Q in self.Q])
        step_Q, step_Z = self._steps(inverse_chol_Q, inverse_chol_Z, dQ, dZ, 0.99)
        y = self.y + step_Q * dy
        if y[-1] > 0 and self._settle(y, [Q + step_Q * d for Q, d in zip(self.Q, dQ, strict=True)]):
            return Status.FEASIBLE
        predicted = self._inner(
            [Q + step_Q * d for Q, d in zip(self.Q, dQ, strict=True)], [Z + step_Z * d for Z, d in zip(self.Z, dZ, strict=True)]
        )
        sigma = min(1.0, max(1e-3, (max(predicted, 0.0) / gap) ** 2))
        if min(step_Q, step_Z) < 0.2:
            sigma = max(sigma, 0.3)
        centres = [sigma * mu * Si - Q - symmetrise(a @ b @ Si) for Q, Si, a, b in zip(self.Q, S, dQ, dZ, strict=True)]
        dy, dlam, dx, dZ, dQ = direction(centres)
        step_Q, step_Z = self._steps(inverse_chol_Q, inverse_chol_Z, dQ, dZ, 0.95)
        self.y = self.y + step_Q * dy
        self.Q = [symmetrise(Q + step_Q * d) for Q, d in zip(self.Q, dQ, strict=True)]
        self.lam += step_Z * dlam
        self.x = [x + step_Z * d for x, d in zip(self.x, dx, strict=True)]
        self.Z = self._adjoint(self.x)
        return None

    def _settle(self, y: Array, Q: list[Array]) -> bool:
        """Returns whether (y, Q) with t > 0 is a certificate once its residuals are absorbed; if so, it becomes the solution.

        Q + t Q_w + dQ with values(dQ) = residual is a Gram matrix of A_r z itself. The margin becomes half of the largest multiple of the
        unit that leaves this matrix psd.
        """
        z = np.append(y[:-1], 0.0)
        if self._inner(Q, self.Z) > self.gap * y[-1]:
            return False
        whole, margin = [], np.inf
        for b, given in zip(self.blocks, self._by_block(Q), strict=True):
            shifted = [matrices + y[-1] * centre for matrices, centre in zip(given, b.centre.Q, strict=True)]
            corrections = _correction(b, b.columns @ z - b.cone.values(shifted))
            for matrices, correction, unit_Q in zip(shifted, corrections, b.centre.unit_Q, strict=True):
                candidate = symmetrise(matrices + correction)
                try:
                    inverse_chol = inverse_cholesky(candidate)
                except np.linalg.LinAlgError:
                    return False
                margin = min(margin, _longest(inverse_chol, np.broadcast_to(-unit_Q, candidate.shape)))
                whole.append(candidate)
        t = margin / 2
        if not np.isfinite(t):
            return False
        self.y = np.append(y[:-1], t)
        self.Q = [symmetrise(W - t * Q) for W, Q in zip(whole, (Q for b in self.blocks for Q in b.centre.unit_Q), strict=True)]
        return True

    @staticmethod
    def _inner(Q: list[Array], Z: list[Array]) -> float:
        return float(sum(np.vdot(a, b) for a, b in zip(Q, Z, strict=True)))

    @staticmethod
    def _steps(
        inverse_chol_Q: list[Array], inverse_chol_Z: list[Array], dQ: list[Array], dZ: list[Array], fraction: float
    ) -> tuple[float, float]:
        """Returns the given fraction of the longest primal and dual steps that stay psd, at most 1 each."""
        step_Q = min(_longest(Li, d) for Li, d in zip(inverse_chol_Q, dQ, strict=True))
        step_Z = min(_longest(Li, d) for Li, d in zip(inverse_chol_Z, dZ, strict=True))
        return min(1.0, fraction * step_Q), min(1.0, fraction * step_Z)


def _ridged(M: Array) -> Array:
    diagonal = np.diag(M)
    return M + np.diag(RIDGE * (diagonal + diagonal.max()))


def _correction(block: Block, v: Array) -> list[Array]:
    """Returns the smallest dQ in the metric of the centre with values(dQ) = v, which is Q_w Lambda(H^-1 v) Q_w.

    v is (R, N), and dQ is (R, K, L, L) for every part.
    """
    return [Q @ Z @ Q for Q, Z in zip(block.centre.Q, block.cone.adjoint(block.centre.solve(v)), strict=True)]


def _preimage(block: Block, v: Array) -> list[tuple[Array, Array]]:
    """Returns the dQ of :func:`_correction` and its eigenvalues relative to Q_w, for every part."""
    found = []
    for Q, inner in zip(block.centre.Q, block.cone.adjoint(block.centre.solve(v)), strict=True):
        chol = np.linalg.cholesky(Q)
        found.append((Q @ inner @ Q, np.linalg.eigvalsh(np.swapaxes(chol, -1, -2) @ inner @ chol)))
    return found


def _longest(inverse_chol: Array, direction: Array) -> float:
    """Returns the largest a with L L' + a D psd, over a stack."""
    L = direction.shape[-1]
    lowest = lowest_relative_eigenvalue(inverse_chol.reshape(-1, L, L), direction.reshape(-1, L, L), STEP_TOLERANCE)
    return np.inf if lowest >= 0 else -1 / lowest

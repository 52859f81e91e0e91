"""Weighted sums of squares in the sampled basis: one cone for all rationals of one side of a pair.

    K = { v : v(u) = sum_j g_j(u) rho(u)' Q_j rho(u), Q_j psd },   g_j(u) = gA_j(u_A) + sum_l e_jl u_l,   g_0 = 1
    dual cone: x with Lambda_j(x) = sum_i (g_j x)_i rho_i rho_i' psd for every j
    barrier F(x) = -sum_j log det Lambda_j(x), Hessian with weights Q_j = Lambda_j^-1 in :meth:`Cone.schur`.

Because rho_i rho_i' has rank one, the Schur complement is a sum of Hadamard products
H = sum_j (g_j g_j') o (rho Q_j rho') o (rho S_j rho'), formed over the chain's points only (basis.py) and expanded by the
slopes e_jl (Papp and Yildiz 2019; Loefberg and Parrilo 2004).
Shapes: R rationals, K weights, L = 2^k, N_A chain points, M = 3^k of them the grid, o outside joints, N = N_A + o M.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import blas, lapack

from certifier.basis import Basis
from certifier.kernels import adjoint, cholesky_inverse, line_search, schur, values
from certifier.model import Array

MAX_NEWTON = 12
NEWTON_TOLERANCE = 1e-3


class Cone:
    """The cone of one side.

    Args:
        rho: (N_A, L) values of rho at the chain's points.
        grid: M, how many leading points carry the outside joints.
        weights: (K, N_A) chain part of every g_j at the points; row 0 is 1 for a pair's side.
        slopes: (K, o) coefficient of every outside coordinate in every g_j.
    """

    def __init__(self, rho: Array, grid: int, weights: Array, slopes: Array) -> None:
        self.rho, self.grid, self.weights, self.slopes = rho, grid, np.ascontiguousarray(weights), np.ascontiguousarray(slopes)
        self.N = len(rho) + slopes.shape[1] * grid
        self.K, self.L = len(weights), rho.shape[1]
        self._products = (rho[:, :, None] * rho[:, None, :]).reshape(len(rho), -1)
        self._transposed = np.ascontiguousarray(self._products.T)

    @classmethod
    def of_faces(cls, basis: Basis, constant: Array, chain: Array, outside: Array) -> Cone:
        """The cone of 1 and the faces g_j = constant_j + chain_j' u_A + outside_j' u_out, (m,), (m, k), (m, o)."""
        weights = np.concatenate([np.ones((1, len(basis.points))), constant[:, None] + chain @ basis.points.T])
        slopes = np.concatenate([np.zeros((1, outside.shape[1])), outside])
        return cls(basis.rho, basis.grid, weights, slopes)

    @property
    def degree(self) -> int:
        """Barrier parameter of one rational."""
        return self.K * self.L

    def adjoint(self, x: Array) -> Array:
        """Lambda_j(x): (R, N) -> (R, K, L, L)."""
        found = adjoint(self.weights, self.slopes, self.grid, self._products, np.ascontiguousarray(x))
        return found.reshape(len(x), self.K, self.L, self.L)

    def values(self, Q: Array) -> Array:
        """Coordinates of sum_j g_j rho' Q_j rho: (R, K, L, L) -> (R, N)."""
        return values(self.weights, self.slopes, self.grid, self._transposed, Q.reshape(-1, self.L**2))

    def schur(self, Q: Array, S: Array) -> Array:
        """H of x -> values(Q Lambda(x) S), symmetrised: (R, K, L, L) twice -> (R, N, N), lower triangles only."""
        H = np.zeros((len(Q), self.N, self.N))
        schur(self.rho, self.weights, self.slopes, self.grid, Q, S, H)
        return H


class Factor:
    """Cholesky factors U'U of a stack of Schur complements (R, N, N), given by their lower triangles and overwritten.

    Raises:
        np.linalg.LinAlgError: a matrix is not numerically positive definite.
    """

    def __init__(self, H: Array) -> None:
        self._upper = []
        for matrix in H:
            upper, info = lapack.dpotrf(matrix.T, lower=0, clean=0, overwrite_a=1)
            if info != 0:
                raise np.linalg.LinAlgError("Schur complement is not positive definite")
            self._upper.append(upper)

    def forward(self, right: Array) -> Array:
        """U'^-1 right: (R, N, p) -> (R, N, p)."""
        return self._triangular(right, 0)

    def backward(self, right: Array) -> Array:
        """U^-1 right: (R, N, p) -> (R, N, p)."""
        return self._triangular(right, 1)

    def _triangular(self, right: Array, transposed: int) -> Array:
        solution = right.copy(order="C")
        for upper, block in zip(self._upper, solution, strict=True):
            # Seen from Fortran, the block is its transpose; it is overwritten in place.
            blas.dtrsm(1.0, upper, block.T, side=1, trans_a=transposed, overwrite_b=1)
        return solution

    def solve(self, right: Array) -> Array:
        """(U'U)^-1 right: (R, N, p) -> (R, N, p)."""
        return self.backward(self.forward(right))


def inverse_cholesky(X: Array) -> Array:
    """Inverses of the lower Cholesky factors of positive definite matrices, (..., L, L).

    Raises:
        np.linalg.LinAlgError: a matrix is not positive definite.
    """
    inverse = np.empty_like(X)
    L = X.shape[-1]
    if not cholesky_inverse(X.reshape(-1, L, L), inverse.reshape(-1, L, L)):
        raise np.linalg.LinAlgError("matrix is not positive definite")
    return inverse


def symmetrise(X: Array) -> Array:
    """(X + X')/2 over the last two axes."""
    return 0.5 * (X + np.swapaxes(X, -1, -2))


@dataclass(frozen=True)
class Conjugate:
    """Where -grad F(x_r) = s_r, for R points s_r inside the cone: F*(s) = max over x of -s'x - F(x), with gradient -x and Hessian H(x)^-1.

    Attributes:
        x: (R, N), near the maximisers.
        Q: (R, K, L, L) = Lambda(x)^-1.
        step: (R, N) Newton's next step, not taken; decrement: (R,) its length in the metric of the Hessian.
        factor: Cholesky factors of the Hessians at x.
        value: (R,) F*(s) to second order in the step.
    """

    x: Array
    Q: Array
    step: Array
    decrement: Array
    factor: Factor
    value: Array


def conjugate(cone: Cone, s: Array, start: Array, tolerance: float, max_iterations: int) -> Conjugate:
    """Newton's method with exact line search, (R, N) points s from (R, N) interior points of the dual cone.

    It ends when all decrements are under the tolerance, or with the iterations; for an s outside the cone they do not fall.

    Raises:
        np.linalg.LinAlgError: a point is seen to be outside the cone, or the cone is numerically degenerate.
    """
    inner = np.einsum("rn,rn->r", s, start)
    if not (inner > 0).all():
        raise np.linalg.LinAlgError("the point is not in the cone")
    x = start * (cone.degree / inner)[:, None]
    for iteration in range(max_iterations + 1):
        inverse_chol = inverse_cholesky(cone.adjoint(x))
        Q = np.swapaxes(inverse_chol, -1, -2) @ inverse_chol
        residual = cone.values(Q) - s
        factor = Factor(cone.schur(Q, Q))
        step = factor.solve(residual[:, :, None])[:, :, 0]
        square = np.maximum(np.einsum("rn,rn->r", residual, step), 0.0)
        decrement = np.sqrt(square)
        if decrement.max() < tolerance or iteration == max_iterations:
            break
        relative = np.linalg.eigvalsh(inverse_chol @ cone.adjoint(step) @ np.swapaxes(inverse_chol, -1, -2)).reshape(len(x), -1)
        lengths = np.where(decrement < 0.1, 1.0, line_search(relative, np.einsum("rn,rn->r", s, step)))
        x = x + lengths[:, None] * step
    determinants = -2 * np.log(np.diagonal(inverse_chol, axis1=2, axis2=3)).sum(axis=(1, 2))
    return Conjugate(x, Q, step, decrement, factor, determinants - np.einsum("rn,rn->r", s, x) + square / 2)


class Centre:
    """An interior point x of the dual cone whose polynomial w = -grad F(x) resembles ``unit``: some of Newton's method towards it.

    Any interior point would do; the nearer w is to the unit in which the margin is wanted, the better the margin. On wide polytopes the
    way is long, and the rest of it not worth the time.

    Args:
        unit: (N,) an interior polynomial of the cone; start: (N,) an interior point of the dual cone.

    Attributes:
        x: (N,) the point; w: (N,) = values(Q).
        Q: (K, L, L) = Lambda(x)^-1.
        factor: Cholesky factor of the Hessian H at x.
        unit_Q: (K, L, L) with values(unit_Q) = unit, the smallest in the metric of x.

    Raises:
        np.linalg.LinAlgError: the cone is numerically degenerate.
    """

    def __init__(self, cone: Cone, unit: Array, start: Array) -> None:
        found = conjugate(cone, unit[None], start[None], NEWTON_TOLERANCE, MAX_NEWTON)
        self.x, self.Q, self.factor = found.x[0], found.Q[0], found.factor
        self.w = cone.values(found.Q)[0]
        self.unit_Q = self.Q @ cone.adjoint(self.solve(unit[None]))[0] @ self.Q

    def solve(self, v: Array) -> Array:
        """H^-1 v, (R, N) -> (R, N)."""
        return self.factor.solve(v.T[None])[0].T

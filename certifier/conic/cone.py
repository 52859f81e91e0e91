"""Weighted sums of squares form a cone in the sampled basis: one cone serves all rationals of one side of a pair.

    K = { v : v(u) = sum_j g_j(u) rho(u)' Q_j rho(u), Q_j psd },   g_j(u) = gA_j(u_A) + sum_l e_jl u_l,   g_0 = 1
    dual cone: x with Lambda_j(x) = sum_i (g_j x)_i rho_i rho_i' psd for every j
    barrier F(x) = -sum_j log det Lambda_j(x), Hessian with weights Q_j = Lambda_j^-1 in :meth:`Cone.schur`.

Because rho_i rho_i' has rank one, the Schur complement is a sum of Hadamard products,
H = sum_j (g_j g_j') o (rho Q_j rho') o (rho S_j rho'). It is formed over the chain's points only (basis.py) and expanded by the
slopes e_jl (Papp and Yildiz 2019; Loefberg and Parrilo 2004).

Shapes: R rationals, K weights, L functions, N_A chain points, M = 3^k of them the grid, o outside joints, N = N_A + o M.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.linalg import blas, lapack

from certifier.conic.basis import Basis, subsets
from certifier.conic.kernels import adjoint, cholesky_inverse, line_search, schur, substitute, values
from certifier.model import Array

SMALL = 48
"""Up to this many unknowns, the call of a triangular solver takes longer than a compiled loop."""
MAX_NEWTON = 12
NEWTON_TOLERANCE = 1e-3


@dataclass(frozen=True, eq=False)
class Weights:
    """The weights g_j multiply sums of squares of the same functions.

    Attributes:
        rho: (N_A, L) values of the functions at the chain's points.
        values: (K, N_A) chain part of every g_j at the points.
        slopes: (K, o) coefficient of every outside coordinate in every g_j.
    """

    rho: Array
    values: Array
    slopes: Array

    @cached_property
    def products(self) -> Array:
        """Returns the products rho_i rho_i', (N_A, L^2)."""
        return (self.rho[:, :, None] * self.rho[:, None, :]).reshape(len(self.rho), -1)

    @cached_property
    def transposed(self) -> Array:
        """Returns the same products as (L^2, N_A)."""
        return np.ascontiguousarray(self.products.T)

    @property
    def shape(self) -> tuple[int, int, int]:
        """Returns the shape of a rational's Gram matrices, (K, L, L)."""
        K, L = len(self.values), self.rho.shape[1]
        return K, L, L


class Cone:
    """The cone belongs to one side of a pair.

    Args:
        grid: M, how many leading points carry the outside joints.
        parts: the weights, one part for every set of functions; for a pair's side the first weight is 1. Gram matrices are lists over
            the parts.
    """

    def __init__(self, grid: int, *parts: Weights) -> None:
        self.grid, self.parts = grid, parts
        self._points, outside = len(parts[0].rho), parts[0].slopes.shape[1]
        self.N = self._points + outside * grid

    @classmethod
    def of_faces(cls, basis: Basis, constant: Array, chain: Array, outside: Array) -> Cone:
        """Returns the cone of 1, of the faces, and of the ranges of those chain coordinates that may not have degree 3.

        The faces are g_j = constant_j + chain_j' u_A + outside_j' u_out. The range of a coordinate counts by 1 - u_i^2 with the functions
        without u_i.

        Args:
            constant: (m,) value of every face at u = 0.
            chain: (m, k) slopes in the chain's coordinates.
            outside: (m, o) slopes in the outside coordinates.
        """
        weights = np.concatenate([np.ones((1, len(basis.points))), constant[:, None] + chain @ basis.points.T])
        slopes = np.concatenate([np.zeros((1, outside.shape[1])), outside])
        still, functions = np.zeros((1, outside.shape[1])), subsets(basis.k)
        ranges = [
            Weights(np.ascontiguousarray(basis.rho[:, functions[:, i] == 0]), 1 - basis.points[None, :, i] ** 2, still)
            for i in range(basis.k)
            if i not in basis.cubic
        ]
        return cls(basis.grid, Weights(basis.rho, weights, slopes), *ranges)

    @property
    def degree(self) -> int:
        """Returns the barrier parameter of one rational."""
        return sum(K * L for K, L, _ in (part.shape for part in self.parts))

    def adjoint(self, x: Array) -> list[Array]:
        """Returns Lambda_j(x): (R, N) -> (R, K, L, L) for every part."""
        x = np.ascontiguousarray(x)
        return [adjoint(p.values, p.slopes, self.grid, p.products, x).reshape(len(x), *p.shape) for p in self.parts]

    def values(self, Q: Sequence[Array]) -> Array:
        """Returns the coordinates of sum_j g_j rho' Q_j rho: (R, K, L, L) for every part -> (R, N)."""
        total = np.zeros((len(Q[0]), self.N))
        for part, matrices in zip(self.parts, Q, strict=True):
            total += values(part.values, part.slopes, self.grid, part.transposed, matrices.reshape(-1, part.products.shape[1]))
        return total

    def schur(self, Q: Sequence[Array], S: Sequence[Array]) -> Array:
        """Returns the matrix H of x -> values(Q Lambda(x) S), symmetrised, of which only the lower triangles are filled.

        Q and S are (R, K, L, L) for every part, and H is (R, N, N).
        """
        H = np.zeros((len(Q[0]), self.N, self.N))
        for part, left, right in zip(self.parts, Q, S, strict=True):
            schur(part.rho, part.values, part.slopes, self.grid, left, right, H)
        return H


class Factor:
    """Holds the Cholesky factors U'U of a stack of Schur complements (R, N, N), which are given by their lower triangles and overwritten.

    Raises:
        np.linalg.LinAlgError: a matrix is not numerically positive definite.
    """

    def __init__(self, H: Array) -> None:
        self._lower, self._upper = H, []
        for matrix in H:
            # Seen from Fortran, the lower triangle is the upper one.
            upper, info = lapack.dpotrf(matrix.T, lower=0, clean=0, overwrite_a=1)
            if info != 0:
                raise np.linalg.LinAlgError("Schur complement is not positive definite")
            self._upper.append(upper)

    def forward(self, right: Array) -> Array:
        """Returns U'^-1 right: (R, N, p) -> (R, N, p)."""
        return self._triangular(right, 0)

    def backward(self, right: Array) -> Array:
        """Returns U^-1 right: (R, N, p) -> (R, N, p)."""
        return self._triangular(right, 1)

    def _triangular(self, right: Array, transposed: int) -> Array:
        solution = right.copy(order="C")
        if self._lower.shape[1] <= SMALL:
            substitute(self._lower, solution, bool(transposed))
            return solution
        for upper, block in zip(self._upper, solution, strict=True):
            # Seen from Fortran, the block is its transpose; it is overwritten in place.
            blas.dtrsm(1.0, upper, block.T, side=1, trans_a=transposed, overwrite_b=1)
        return solution

    def solve(self, right: Array) -> Array:
        """Returns (U'U)^-1 right: (R, N, p) -> (R, N, p)."""
        return self.backward(self.forward(right))


def inverse_cholesky(X: Array) -> Array:
    """Returns the inverses of the lower Cholesky factors of positive definite matrices, (..., L, L).

    Raises:
        np.linalg.LinAlgError: a matrix is not positive definite.
    """
    inverse = np.empty_like(X)
    L = X.shape[-1]
    if not cholesky_inverse(X.reshape(-1, L, L), inverse.reshape(-1, L, L)):
        raise np.linalg.LinAlgError("matrix is not positive definite")
    return inverse


def symmetrise(X: Array) -> Array:
    """Returns (X + X')/2 over the last two axes."""
    return 0.5 * (X + np.swapaxes(X, -1, -2))


def relative_eigenvalues(inverse_chol: Sequence[Array], D: Sequence[Array]) -> Array:
    """Returns the eigenvalues of all L^-1 D L^-T of a rational, (R, degree), from (R, K, L, L) for every part."""
    found = [np.linalg.eigvalsh(Li @ d @ np.swapaxes(Li, -1, -2)) for Li, d in zip(inverse_chol, D, strict=True)]
    return np.concatenate([part.reshape(len(part), -1) for part in found], axis=1)


@dataclass(frozen=True)
class Conjugate:
    """Holds the points x_r at which -grad F(x_r) = s_r, for R points s_r inside the cone.

    They attain the maximum in F*(s) = max over x of -s'x - F(x), which has the gradient -x and the Hessian H(x)^-1.

    Attributes:
        x: (R, N), near the maximisers.
        Q: Lambda(x)^-1, (R, K, L, L) for every part.
        step: (R, N) Newton's next step, not taken.
        decrement: (R,) length of that step in the metric of the Hessian.
        factor: Cholesky factors of the Hessians at x.
        value: (R,) F*(s) to second order in the step.
    """

    x: Array
    Q: list[Array]
    step: Array
    decrement: Array
    factor: Factor
    value: Array


def conjugate(cone: Cone, s: Array, start: Array, tolerance: float, max_iterations: int) -> Conjugate:
    """Runs Newton's method with exact line search for (R, N) points s, from (R, N) interior points of the dual cone.

    It ends when all decrements are under the tolerance or when the iterations are used up. For an s outside the cone the decrements do not
    fall.

    Raises:
        np.linalg.LinAlgError: a point is seen to be outside the cone, or the cone is numerically degenerate.
    """
    inner = np.einsum("rn,rn->r", s, start)
    if not (inner > 0).all():
        raise np.linalg.LinAlgError("the point is not in the cone")
    x = start * (cone.degree / inner)[:, None]
    for iteration in range(max_iterations + 1):
        inverse_chol = [inverse_cholesky(Z) for Z in cone.adjoint(x)]
        Q = [np.swapaxes(Li, -1, -2) @ Li for Li in inverse_chol]
        residual = cone.values(Q) - s
        factor = Factor(cone.schur(Q, Q))
        step = factor.solve(residual[:, :, None])[:, :, 0]
        square = np.maximum(np.einsum("rn,rn->r", residual, step), 0.0)
        decrement = np.sqrt(square)
        if decrement.max() < tolerance or iteration == max_iterations:
            break
        relative = relative_eigenvalues(inverse_chol, cone.adjoint(step))
        lengths = np.where(decrement < 0.1, 1.0, line_search(relative, np.einsum("rn,rn->r", s, step)))
        x = x + lengths[:, None] * step
    determinants = sum(-2 * np.log(np.diagonal(Li, axis1=2, axis2=3)).sum(axis=(1, 2)) for Li in inverse_chol)
    return Conjugate(x, Q, step, decrement, factor, determinants - np.einsum("rn,rn->r", s, x) + square / 2)


class Centre:
    """The centre is an interior point x of the dual cone whose polynomial w = -grad F(x) resembles ``unit``.

    Newton's method goes some of the way towards ``unit``. Any interior point would do, but the nearer w is to the unit in which the margin
    is wanted, the better the margin. On wide polytopes the way is long, and the rest of it is not worth the time.

    Args:
        unit: (N,) an interior polynomial of the cone.
        start: (N,) an interior point of the dual cone.

    Attributes:
        x: (N,) the point.
        w: (N,) its polynomial, values(Q).
        Q: Lambda(x)^-1, (1, K, L, L) for every part.
        factor: Cholesky factor of the Hessian H at x.
        unit_Q: like Q, with values(unit_Q) = unit; of all such matrices the smallest in the metric of x.

    Raises:
        np.linalg.LinAlgError: the cone is numerically degenerate.
    """

    def __init__(self, cone: Cone, unit: Array, start: Array) -> None:
        found = conjugate(cone, unit[None], start[None], NEWTON_TOLERANCE, MAX_NEWTON)
        self.x, self.Q, self.factor = found.x[0], found.Q, found.factor
        self.w = cone.values(found.Q)[0]
        self.unit_Q = [Q @ Z @ Q for Q, Z in zip(self.Q, cone.adjoint(self.solve(unit[None])), strict=True)]

    def solve(self, v: Array) -> Array:
        """Returns H^-1 v, (R, N) -> (R, N)."""
        return self.factor.solve(v.T[None])[0].T

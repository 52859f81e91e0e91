"""A barrier method solves programs whose cones are coupled by few unknowns, so that Newton's system has the shape of an arrow.

    minimise  f(y) + sum_r F*_r(constant_r + local_r z_p + coupled_r y) + sum_p b_p(z_p)    over y, z_1, z_2, ...

for rationals r in groups p. f is a weighted objective with a barrier of y, and b_p is a barrier of z_p.

F* is the barrier of the cone K_r. It is conjugate to the barrier F of the dual cone of K_r (certifier.conic.cone):
F*(s) = max over x of -s'x - F(x), with gradient -x and Hessian H(x)^-1. Newton's method finds x, starting from the last one.

The outer Newton's method is in (y, z). In its system every z_p meets y alone, so a group is eliminated as soon as its rationals have been
added up. A rational is formed, factored, added and forgotten. What is kept of it is its x and, as far as a fixed amount of memory goes,
its factor. Every iterate is feasible.

The cones are from Papp and Yildiz (2019), the method is from Nesterov and Nemirovskii (1994).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from certifier.conic.cone import Cone, Factor, conjugate, inverse_cholesky, relative_eigenvalues
from certifier.model import Array

CENTRED = 0.3
"""A rational's x is good enough this close to the maximiser, in the norm of its Hessian; the Newton step from there is used as well."""
MAX_CENTRING = 200
"""After this many Newton steps a rational is taken to be outside its cone."""
BOUNDARY = 0.9
"""A step may go this share of the way to the nearest boundary."""
MAX_ITERATIONS = 80
MAX_HALVINGS = 8
FACTOR_BYTES = 128 * 2**20
"""Factors are kept for the second pass of an iteration up to this many bytes; what does not fit is formed again."""

Term = Callable[[Array], tuple[float, Array, Array]]
"""A term is a convex function: it returns its value, inf outside its domain, its gradient (k,) and its Hessian (k, k)."""


class Rationals(Protocol):
    """Rationals are R points of one cone, as functions of z and y.

    Attributes:
        start: (N,) a point inside the dual cone, where the search for x begins.
        coupled: (q,) indices into y of what the points depend on.
    """

    cone: Cone
    start: Array
    coupled: Array

    def __len__(self) -> int:
        """Returns R."""

    def columns(self) -> tuple[Array, Array, Array]:
        """Returns constant (R, N), local (R, N, p) and coupled (R, N, q)."""


@dataclass(frozen=True)
class Group:
    """A group consists of the rationals that share the unknowns z.

    Attributes:
        start: (p,) z at the start.
        barrier: the barrier b_p of z.
    """

    blocks: Sequence[Rationals]
    start: Array
    barrier: Term


@dataclass(frozen=True)
class _Eliminated:
    """Keeps a group's share of Newton's system: the step of z_p is -(gradient + matrix dy[index])."""

    index: Array
    gradient: Array
    matrix: Array


class Arrow:
    """Holds the iterates of the method and their Newton system.

    Args:
        y: (k,) start of the coupled unknowns.
        tick: called with the iteration's number after every group of every pass; an exception that it raises ends the method.

    Raises:
        np.linalg.LinAlgError: the start is not inside some cone.
    """

    def __init__(self, groups: Sequence[Group], y: Array, tick: Callable[[int], None]) -> None:
        self.groups, self.tick = groups, tick
        self.y, self.z = y, [group.start for group in groups]
        self.iterations = 0
        self._x = [[block.start[None].repeat(len(block), axis=0) for block in group.blocks] for group in groups]
        self._accumulate()

    def reach(self, dy: Array) -> float:
        """Returns how far y may move along dy, with z fixed, before some cone is known to end."""
        return self._limits(dy, [np.zeros_like(z) for z in self.z])[0]

    def shift(self, dy: Array) -> None:
        """Moves y by dy; the new y must be feasible.

        Raises:
            np.linalg.LinAlgError: it is not.
        """
        self.y = self.y + dy
        self._accumulate()

    def minimise(self, f: Term, tolerance: float) -> float:
        """Runs Newton's method until the function is within about ``tolerance`` of its minimum, and returns the last decrement.

        The method ends early, at a feasible point, after MAX_ITERATIONS or when rounding stops all progress.
        """
        decrement = np.inf
        while self.iterations < MAX_ITERATIONS:
            try:
                dy, dz, decrement = self._direction(f)
            except np.linalg.LinAlgError:
                break
            if decrement**2 < 2 * tolerance:
                break
            self.iterations += 1
            if not self._step(f, dy, dz):
                break
        return decrement

    def _accumulate(self) -> None:
        """Centres every rational and adds up Newton's system, group by group."""
        k, kept = len(self.y), 0
        self._matrix, self._gradient, self._value, self._square = np.zeros((k, k)), np.zeros(k), 0.0, 0.0
        self._eliminated: list[_Eliminated] = []
        self._factors: list[list[Factor | None]] = []
        for group, z, xs in zip(self.groups, self.z, self._x, strict=True):
            index = np.unique(np.concatenate([block.coupled for block in group.blocks]))
            p, size = len(z), len(z) + len(index)
            M, g, factors = np.zeros((size, size)), np.zeros(size), []
            value, g[:p], M[:p, :p] = group.barrier(z)
            for i, block in enumerate(group.blocks):
                constant, local, coupled = block.columns()
                found = conjugate(block.cone, constant + local @ z + coupled @ self.y[block.coupled], xs[i], CENTRED, MAX_CENTRING)
                if found.decrement.max() >= CENTRED:
                    raise np.linalg.LinAlgError("a point is not in its cone")
                xs[i] = found.x + found.step
                where = np.concatenate([np.arange(p), p + np.searchsorted(index, block.coupled)])
                columns = np.concatenate([local, coupled], axis=2)
                image = found.factor.forward(columns).reshape(-1, len(where))
                M[np.ix_(where, where)] += image.T @ image
                g[where] -= np.einsum("rnp,rn->p", columns, xs[i])
                value += float(found.value.sum())
                kept += xs[i].shape[0] * xs[i].shape[1] ** 2 * 8
                factors.append(found.factor if kept <= FACTOR_BYTES else None)
            solved = cho_solve(cho_factor(M[:p, :p]), np.column_stack([g[:p], M[:p, p:]]))
            self._matrix[np.ix_(index, index)] += M[p:, p:] - M[p:, :p] @ solved[:, 1:]
            self._gradient[index] += g[p:] - M[p:, :p] @ solved[:, 0]
            self._value += value
            self._square += float(g[:p] @ solved[:, 0])
            self._eliminated.append(_Eliminated(index, solved[:, 0], solved[:, 1:]))
            self._factors.append(factors)
            self.tick(self.iterations)

    def _direction(self, f: Term) -> tuple[Array, list[Array], float]:
        """Returns Newton's step in y and in z, and its decrement."""
        _, g, H = f(self.y)
        gradient = g + self._gradient
        solved = cho_solve(cho_factor(H + self._matrix), gradient)
        dy = -solved
        dz = [-(part.gradient + part.matrix @ dy[part.index]) for part in self._eliminated]
        return dy, dz, float(np.sqrt(gradient @ solved + self._square))

    def _limits(self, dy: Array, dz: list[Array]) -> tuple[float, list[list[Array]]]:
        """Returns the longest step that explicit Gram matrices show to be feasible, and how every x follows a step of length 1.

        With v = H(x)^-1 ds, the point s + a ds has the Gram matrices Q + a Q Lambda(v) Q.
        """
        longest, moves = np.inf, []
        for group, xs, factors, dz_p in zip(self.groups, self._x, self._factors, dz, strict=True):
            row = []
            for block, x, factor in zip(group.blocks, xs, factors, strict=True):
                _, local, coupled = block.columns()
                ds = local @ dz_p + coupled @ dy[block.coupled]
                inverse = [inverse_cholesky(Z) for Z in block.cone.adjoint(x)]
                if factor is None:
                    Q = [np.swapaxes(Li, -1, -2) @ Li for Li in inverse]
                    factor = Factor(block.cone.schur(Q, Q))
                v = factor.solve(ds[:, :, None])[:, :, 0]
                relative = relative_eigenvalues(inverse, block.cone.adjoint(v))
                longest = min(longest, 1 / max(-float(relative.min()), 1e-300))
                # x - a v is where Newton's method starts next; it must stay inside the dual cone.
                row.append(v / np.maximum(1.0, relative.max(axis=1) / 0.7)[:, None])
            moves.append(row)
            self.tick(self.iterations)
        return longest, moves

    def _step(self, f: Term, dy: Array, dz: list[Array]) -> bool:
        """Takes a step along the direction that lowers the function; returns False when no such step was found and nothing has moved."""
        longest, moves = self._limits(dy, dz)
        y, z, xs = self.y, self.z, [list(row) for row in self._x]
        before = f(y)[0] + self._value
        length = min(1.0, BOUNDARY * longest)
        while not self._inside(f, y + length / BOUNDARY * dy, [a + length / BOUNDARY * b for a, b in zip(z, dz, strict=True)]):
            length *= 0.8
        for _ in range(MAX_HALVINGS):
            self.y = y + length * dy
            self.z = [a + length * b for a, b in zip(z, dz, strict=True)]
            self._x = [[x - length * v for x, v in zip(row, move, strict=True)] for row, move in zip(xs, moves, strict=True)]
            length /= 2
            try:
                self._accumulate()
            except np.linalg.LinAlgError:
                continue
            if f(self.y)[0] + self._value < before:
                return True
        self.y, self.z, self._x = y, z, xs
        self._accumulate()
        return False

    def _inside(self, f: Term, y: Array, z: list[Array]) -> bool:
        """Returns whether y and every z_p are in the domains of their barriers."""
        return bool(np.isfinite(f(y)[0])) and all(np.isfinite(group.barrier(z_p)[0]) for group, z_p in zip(self.groups, z, strict=True))

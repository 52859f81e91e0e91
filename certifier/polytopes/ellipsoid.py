"""The largest ellipsoid inside a polytope P = {s : C s <= d}, C (m, n), d (m,), is found here, and P's own volume, in s and in q."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from certifier.coordinates import ConfigurationSpace
from certifier.errors import RegionError
from certifier.model import Array, Polytope
from certifier.polytopes.polytope import SCALED, bounds, chebyshev_center
from certifier.polytopes.sampling import CHAINS, hit_and_run

_GAP = 1e-9
"""The method ends at this average complementarity. Then the logarithm of the volume is within m times this of the largest possible."""
_RESIDUAL = 1e-8
_ITERATIONS = 100
_SHRINK = 1 - 1e-9


@dataclass(frozen=True)
class Ellipsoid:
    """An ellipsoid is the set {Q u + center : |u| <= 1}.

    Attributes:
        center: (n,).
        shape: Q, (n, n) symmetric positive definite.
    """

    center: Array
    shape: Array

    @cached_property
    def volume(self) -> float:
        """Returns the n-dimensional volume: |det Q| times the unit ball's."""
        return _unit_ball(len(self.center)) * abs(float(np.linalg.det(self.shape)))


def inscribed_ellipsoid(polytope: Polytope) -> Ellipsoid:
    """Returns the ellipsoid of largest volume inside P, to about 1e-7 in volume.

    It is shrunk so that |Q c_j| <= d_j - c_j'center holds in floating point for every row.

    Raises:
        RegionError: ``ellipsoid_failed`` when the method does not converge, or as :func:`certifier.polytopes.polytope.chebyshev_center`.
    """
    start, _ = chebyshev_center(polytope)
    rows = polytope.C.any(axis=1)
    C, d = polytope.C[rows], polytope.d[rows]
    try:
        x, square = _largest(C / (d - C @ start)[:, None])
    except np.linalg.LinAlgError as error:
        raise RegionError("ellipsoid_failed", "no inscribed ellipsoid was found", field="polytope", hint=SCALED) from error
    center = start + x
    eigenvalues, axes = np.linalg.eigh(square)
    shape = (axes * np.sqrt(eigenvalues)) @ axes.T
    reach = float(((d - C @ center) / np.linalg.norm(C @ shape, axis=1)).min())
    return Ellipsoid(center, shape * (min(1.0, reach) * _SHRINK))


def volume_bound(polytope: Polytope) -> float:
    """Returns an upper bound of the inscribed ellipsoid's volume: the volume of the ellipsoid inscribed in P's bounding box.

    It takes a fraction of the time of the inscribed ellipsoid itself.

    Raises:
        RegionError: as :func:`certifier.polytopes.polytope.chebyshev_center`.
    """
    lower, upper = bounds(polytope)
    return _unit_ball(len(lower)) * float(np.prod((upper - lower) / 2))


def _unit_ball(n: int) -> float:
    return math.pi ** (n / 2) / math.gamma(n / 2 + 1)


def _largest(A: Array) -> tuple[Array, Array]:
    """Returns the centre x (n,) and the square E^2 (n, n) of the largest ellipsoid {x + E u} in {A x <= 1}.

    That is: maximise log det E subject to |E a_i| + a_i'x <= 1. The method is the primal-dual one of Zhang and Gao, *On numerical solution
    of the maximum volume ellipsoid problem* (SIOPT 2003), with E^-2 = A' diag(y) A eliminated. The remaining unknowns are h_i = |E a_i|,
    the slacks z and the multipliers y:

        A'(y h) = 0,   h + z = 1 - A x,   y z = mu.

    Raises:
        np.linalg.LinAlgError: the method does not converge.
    """
    m, n = A.shape
    x, slack = np.zeros(n), np.ones(m)
    h = np.sqrt(np.einsum("ij,ij->i", A @ np.linalg.inv(A.T @ A), A))
    y = np.full(m, h.max() ** 2)
    z = np.maximum(0.1, 1 - h / h.max())
    for _ in range(_ITERATIONS):
        yA = y[:, None] * A
        square = np.linalg.inv(A.T @ yA)
        Q = A @ square @ A.T
        h = np.sqrt(Q.diagonal())
        yz = y * z
        gap = float(yz.sum()) / m
        mu = max(min(0.5, gap) * gap, _GAP)
        central, primal, dual = mu - yz, slack - h - z, h @ yA
        residual = max(float(np.abs(r).max()) for r in (central, primal, dual))
        if residual < _RESIDUAL and mu == _GAP:
            return x, square
        weight = 2 * y * h
        G = Q * Q * (y[:, None] * y)
        G.flat[:: m + 1] += weight * z
        missing = primal - central / y
        # One factorisation serves both systems: dy = T dx - v.
        solved = np.linalg.solve(G, np.column_stack([(h + z)[:, None] * yA, weight * missing, weight[:, None] * A]))
        P = (weight[:, None] * solved[:, :n] - yA).T
        dx = np.linalg.solve(P @ A, P @ missing - dual)
        towards = A @ dx
        dy = solved[:, n + 1 :] @ dx - solved[:, n]
        dz = central / y - z * dy
        length = max(0.75, 1 - residual) / max(1.0, float((towards / slack).max()), -float(dy.min()), float((-dz / z).max()))
        x, slack, y, z = x + length * dx, slack - length * towards, y * (1 + length * dy), z + length * dz
    raise np.linalg.LinAlgError("no convergence")


def volume(polytope: Polytope, seed: int, rays: int = 200_000, samples: int = 16_384) -> tuple[float, float]:
    """Returns P's volume and its standard error, by sampling; the same seed gives the same result.

    With the inscribed ellipsoid E and a radius R, vol(P) = vol(P cap R E) / Pr[s in R E]. Independent rays rho(theta) give the numerator,
    vol(E) mean(min(rho, R)^n). Hit-and-run in P gives the probability. R is the median of a first sample, so neither part has a heavy tail.
    The probability's error is taken between independent chains.

    Args:
        rays: number of rays for the numerator.
        samples: number of samples for the probability, a multiple of ``CHAINS``.

    Raises:
        RegionError: as :func:`inscribed_ellipsoid`.
    """
    n = polytope.C.shape[1]
    E = inscribed_ellipsoid(polytope)
    rounded = Polytope(polytope.C @ E.shape, polytope.d - polytope.C @ E.center)
    seeds = [int(k) for k in np.random.SeedSequence(seed).generate_state(3)]
    R = float(np.median(np.linalg.norm(hit_and_run(rounded, np.zeros(n), 4 * CHAINS, seeds[0]), axis=1)))
    radius = np.linalg.norm(hit_and_run(rounded, np.zeros(n), samples, seeds[1]), axis=1)
    inside = (radius.reshape(-1, CHAINS) <= R).mean(axis=0)

    direction = np.random.default_rng(seeds[2]).normal(size=(rays, n))
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    capped = np.minimum(1 / (direction @ (rounded.C / rounded.d[:, None]).T).max(axis=1), R) ** n

    value = E.volume * capped.mean() / inside.mean()
    relative = math.hypot(_standard_error(capped) / capped.mean(), _standard_error(inside) / inside.mean())
    return float(value), float(value * relative)


def volume_in_q(
    polytope: Polytope, space: ConfigurationSpace, in_s: tuple[float, float], seed: int, samples: int = 16_384
) -> tuple[float, float]:
    """Returns P's volume in joint positions q and its standard error, by sampling; the same seed gives the same result.

    It is the volume in s times the mean over P of the product of the slopes dq_i/ds_i. Hit-and-run in P gives the mean, and its error is
    taken between independent chains.

    Args:
        space: the joints.
        in_s: what :func:`volume` returned for P.
        samples: a multiple of ``CHAINS``.

    Raises:
        RegionError: as :func:`inscribed_ellipsoid`.
    """
    value, error = in_s
    s = hit_and_run(polytope, inscribed_ellipsoid(polytope).center, samples, seed)
    scale = np.prod(space.slope(s), axis=1).reshape(-1, CHAINS).mean(axis=0)
    relative = math.hypot(error / value, _standard_error(scale) / scale.mean())
    return float(value * scale.mean()), float(value * scale.mean() * relative)


def _standard_error(x: Array) -> float:
    return float(x.std(ddof=1)) / math.sqrt(len(x))

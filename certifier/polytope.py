"""Linear programs and volumes of polytopes P = {s : C s <= d}, C (m, n), d (m,).

Values found by a linear program are accurate to its tolerance (1e-10). What has to hold for certain rests on weak
duality instead: for multipliers y >= 0 and a box [l, u] around P,

    c's = y'C s + (c - y'C)'s <= y'd + sum_i max(r_i l_i, r_i u_i),   r = c - y'C,

plus a bound on the rounding of the right-hand side itself.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydrake.geometry.optimization import HPolyhedron
from scipy.optimize import linprog
from scipy.sparse import csr_array

from certifier.errors import RegionError
from certifier.model import Array, Polytope
from certifier.sampling import CHAINS, hit_and_run

_TOLERANCE = 1e-10
_FLAT = 1e-9
_SHRINK = 1 - 1e-9
_RAYS = 2048


@dataclass(frozen=True)
class Ellipsoid:
    """{Q u + center : |u| <= 1}.

    Attributes:
        center: (n,).
        shape: Q, (n, n) symmetric positive definite.
    """

    center: Array
    shape: Array

    @cached_property
    def volume(self) -> float:
        """n-dimensional volume: |det Q| times the unit ball's."""
        n = len(self.center)
        return math.pi ** (n / 2) / math.gamma(n / 2 + 1) * abs(float(np.linalg.det(self.shape)))


def bounds(polytope: Polytope) -> tuple[Array, Array]:
    """Support values along the axes: the smallest box around P, (n,) and (n,).

    Raises:
        RegionError: as :func:`check`.
    """
    n = polytope.C.shape[1]
    values, _ = _supports(polytope, np.concatenate([np.eye(n), -np.eye(n)]))
    return -values[n:], values[:n]


def bound_multipliers(polytope: Polytope) -> tuple[Array, Array, Array, Array]:
    """A box around P with the multipliers that prove it in exact arithmetic.

    Every axis needs a row on either side that bounds it alone, as the joint limits do; residuals are absorbed there.

    Returns:
        (lo, hi, Y_lo, Y_hi), (n,), (n,), (n, m), (n, m): Y >= 0, row i of Y_hi proves s_i <= hi_i and that of Y_lo
        proves -s_i <= -lo_i. Bounds are rounded outwards.

    Raises:
        RegionError: ``polytope_without_limits``, or as :func:`check`.
    """
    n = polytope.C.shape[1]
    axes = np.concatenate([np.eye(n), -np.eye(n)])
    limits, rows = _axis_limits(polytope)
    _, Y = _supports(polytope, axes)
    values = _proved_bounds(polytope, axes, Y, -limits[n:], limits[:n])
    at_limit = values >= limits
    Y[at_limit] = 0
    scale = np.abs(polytope.C[rows[at_limit]]).max(axis=1)
    # Rounded down, so that the residual is positive and meets the very same row.
    Y[at_limit, rows[at_limit]] = np.where(scale == 1, 1, np.nextafter(1 / scale, 0))
    values = np.minimum(values, limits)
    return -values[n:], values[:n], Y[n:], Y[:n]


def support(polytope: Polytope, c: Array) -> tuple[float, Array]:
    """An upper bound of c's on P, rounded upwards, with the multipliers y (m,) that prove it as in :func:`bound_multipliers`.

    Raises:
        RegionError: ``polytope_without_limits``, or as :func:`check`.
    """
    n = polytope.C.shape[1]
    limits, _ = _axis_limits(polytope)
    _, Y = _supports(polytope, c[None])
    return float(_proved_bounds(polytope, c[None], Y, -limits[n:], limits[:n])[0]), Y[0]


def check(polytope: Polytope, names: tuple[str, ...] | None = None) -> None:
    """Refuse a polytope that is empty, flat or unbounded.

    Args:
        names: (n,) joint names for the messages.

    Raises:
        RegionError: ``polytope_empty`` when no ball of positive radius fits inside, ``polytope_unbounded`` naming a
            direction v with C v <= 0.
    """
    C = polytope.C
    ball = _largest_ball(polytope, at_most=1.0)
    if ball.status == 2:
        raise RegionError("polytope_empty", "no point satisfies C s <= d", field="polytope")
    if ball.status == 0 and -ball.fun <= _FLAT:
        raise RegionError("polytope_empty", f"the polytope is flat: no ball of radius {_FLAT:g} fits inside", field="polytope")
    for sign, word in ((1.0, "above"), (-1.0, "below")):
        free = np.flatnonzero((sign * C <= 0).all(axis=0))
        if free.size:
            joint = names[free[0]] if names else f"s[{free[0]}]"
            raise RegionError(
                "polytope_unbounded", f"no row bounds {joint} from {word}", field="polytope", hint="add the joint limits as rows"
            )
    # Stiemke: either some v has C v <= 0, C v != 0, or a positive combination of the rows vanishes; then P is bounded iff C has full rank.
    # With C v >= -1 the optimum is 0, or at most -1.
    C = C[C.any(axis=1)] / np.linalg.norm(C[C.any(axis=1)], axis=1, keepdims=True)
    cone = linprog(C.sum(axis=0), np.concatenate([C, -C]), np.repeat([0.0, 1.0], len(C)), bounds=(None, None), method="highs-ds")
    if cone.status != 0:
        raise RegionError("polytope_numerics", f"the linear program for unbounded directions failed: {cone.message}", field="polytope")
    if cone.fun < -0.5:
        raise _unbounded(cone.x)
    if np.linalg.matrix_rank(C, tol=_FLAT) < C.shape[1]:
        raise _unbounded(np.linalg.svd(C).Vh[-1])


def _unbounded(direction: Array) -> RegionError:
    v = np.array2string(direction / np.abs(direction).max(), precision=4, separator=", ", suppress_small=True)
    return RegionError("polytope_unbounded", f"the polytope is unbounded along {v}", field="polytope", hint="add the joint limits as rows")


def chebyshev_center(polytope: Polytope) -> tuple[Array, float]:
    """Centre (n,) and radius of a largest ball inside P; P may be unbounded as long as the balls are not.

    Raises:
        RegionError: as :func:`check`.
    """
    ball = _largest_ball(polytope, at_most=None)
    if ball.status != 0 or -ball.fun <= _FLAT:
        raise _failure(polytope, ball)
    return ball.x[:-1], float(-ball.fun)


def _largest_ball(polytope: Polytope, at_most: float | None) -> Any:
    n = polytope.C.shape[1]
    A = np.column_stack([polytope.C, np.linalg.norm(polytope.C, axis=1)])
    box = [(None, None)] * n + [(0, at_most)]
    return linprog(np.append(np.zeros(n), -1.0), A, polytope.d, bounds=box, method="highs-ds", options=_options())


_CLEARLY = 1e-9
"""Relative distance by which a row must be redundant to go, so that whoever proves it again succeeds as well."""


def drop_redundant(polytope: Polytope, fixed: int = 0) -> NDArray[np.int64]:
    """Indices, ascending, of rows that suffice to describe P. Never enlarges the set: rows go only when strict dual bounds
    on P's bounding box prove them from the rows that stay, so some weakly redundant rows remain.

    The box does no harm: on a way out of P through rows that went, the first of them to be reached would be reached in the
    box, where the bounds hold. Rows are called needed when a ray from inside leaves P through them alone; each round tries
    all others against these, and shoots at the points where that fails (Clarkson's algorithm).

    Args:
        fixed: this many rows at the end stay whatever happens (the joint limits, say).

    Raises:
        RegionError: as :func:`check`.
    """
    lo, hi = bounds(polytope)
    center = chebyshev_center(polytope)[0]
    margin = 1e-6 * (1 + hi - lo)
    lo, hi = lo - margin, hi + margin
    stays = np.arange(len(polytope.d)) >= len(polytope.d) - fixed
    rows = np.flatnonzero(~_repeated(polytope) | stays)
    distinct = Polytope(polytope.C[rows], polytope.d[rows])
    needed, idle = stays[rows], np.zeros(len(rows), dtype=bool)
    rays = np.random.default_rng(0).normal(size=(_RAYS, len(center))) * (hi - lo)
    needed |= _left_through(distinct, center, np.concatenate([rays, distinct.C * (hi - lo) ** 2]))
    while not (needed | idle).all():
        tried = np.flatnonzero(~needed & ~idle)
        known, directions = Polytope(distinct.C[needed], distinct.d[needed]), distinct.C[tried]
        points, Y = _maximise(known, directions, list(zip(lo, hi, strict=True)))
        proved = _proved_bounds(known, directions, Y, lo, hi) < distinct.d[tried] - _CLEARLY * (1 + np.abs(distinct.d[tried]))
        idle[tried[proved]] = True
        found = _left_through(distinct, center, points[~proved] - center) & ~needed
        needed |= found if found.any() else ~idle
    return rows[needed]


def _repeated(polytope: Polytope) -> NDArray[np.bool_]:
    """(m,) True where a row with the same normal and a smaller offset, or the same offset further down, makes the row idle."""
    order = np.lexsort((-np.arange(len(polytope.d)), polytope.d))
    _, first = np.unique(polytope.C[order], axis=0, return_index=True)
    repeated = np.ones(len(polytope.d), dtype=bool)
    repeated[order[first]] = False
    return repeated


def _left_through(polytope: Polytope, center: Array, rays: Array) -> NDArray[np.bool_]:
    """(m,) True for rows through which alone some ray (r, n) from the centre leaves P."""
    with np.errstate(divide="ignore", invalid="ignore"):
        speed = rays @ polytope.C.T
        time = np.where(speed > 0, (polytope.d - polytope.C @ center) / speed, np.inf)
    first, second = np.partition(time, 1, axis=1)[:, :2].T
    rows = np.zeros(len(polytope.d), dtype=bool)
    rows[time.argmin(axis=1)[first < (1 - 1e-9) * second]] = True
    return rows


def inscribed_ellipsoid(polytope: Polytope) -> Ellipsoid:
    """The ellipsoid of largest volume inside P (Boyd and Vandenberghe, section 8.4.2), to the solver's accuracy in
    volume, shrunk so that |Q c_j| <= d_j - c_j'center holds in floating point for every row.

    Raises:
        RegionError: ``ellipsoid_failed`` when the solver does not succeed, or as :func:`check`.
    """
    lo, hi = bounds(polytope)
    mid, width = (lo + hi) / 2, (hi - lo) / 2
    C = polytope.C * width
    scale = np.linalg.norm(C, axis=1)
    rows = scale > 0
    scaled = HPolyhedron(C[rows] / scale[rows, None], (polytope.d - polytope.C @ mid)[rows] / scale[rows])
    try:
        found = scaled.MaximumVolumeInscribedEllipsoid()
    except RuntimeError as error:
        raise RegionError("ellipsoid_failed", f"no inscribed ellipsoid was found: {error}", field="polytope") from error
    center = mid + width * found.center()
    U, S, _ = np.linalg.svd(width[:, None] * np.linalg.inv(found.A()))
    shape = (U * S) @ U.T
    reach = float(((polytope.d - polytope.C @ center)[rows] / np.linalg.norm(polytope.C[rows] @ shape, axis=1)).min())
    if reach < 0.5:
        raise RegionError("ellipsoid_failed", f"the ellipsoid found leaves the polytope (factor {reach:.3g})", field="polytope")
    return Ellipsoid(center, shape * (min(1.0, reach) * _SHRINK))


def volume(polytope: Polytope, seed: int, rays: int = 200_000, samples: int = 16_384) -> tuple[float, float]:
    """P's volume and its standard error, by sampling; deterministic for a seed.

    With the inscribed ellipsoid E and a radius R, vol(P) = vol(P cap R E) / Pr[s in R E]: independent rays rho(theta)
    give the numerator, vol(E) mean(min(rho, R)^n), and hit-and-run in P the probability. R is the median of a first
    sample, so neither part has a heavy tail; the probability's error is taken between independent chains.

    Args:
        samples: a multiple of ``CHAINS``.

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


def _standard_error(x: Array) -> float:
    return float(x.std(ddof=1)) / math.sqrt(len(x))


def _supports(polytope: Polytope, directions: Array) -> tuple[Array, Array]:
    """Support values (k,) of P and multipliers (k, m) >= 0 for directions (k, n)."""
    points, Y = _maximise(polytope, directions, (None, None))
    return np.einsum("ki,ki->k", directions, points), Y


def _maximise(polytope: Polytope, directions: Array, box: Any) -> tuple[Array, Array]:
    """Maximisers (k, n) in P and the box, and the faces' multipliers (k, m) >= 0, as one block-diagonal linear program.

    Args:
        box: bounds of s in scipy's form.
    """
    k, (m, n) = len(directions), polytope.C.shape
    columns = np.arange(n) + n * np.repeat(np.arange(k), m)[:, None]
    A = csr_array((np.tile(polytope.C.ravel(), k), columns.ravel(), n * np.arange(k * m + 1)), shape=(k * m, k * n))
    box = box * k if isinstance(box, list) else box
    result = linprog(-directions.ravel(), A, np.tile(polytope.d, k), bounds=box, method="highs-ds", options=_options())
    if result.status != 0:
        raise _failure(polytope, result)
    return result.x.reshape(k, n), np.maximum(-result.ineqlin.marginals, 0).reshape(k, m)


def _options() -> dict[str, float]:
    return {"primal_feasibility_tolerance": _TOLERANCE, "dual_feasibility_tolerance": _TOLERANCE}


def _failure(polytope: Polytope, result: Any) -> RegionError:
    """What is wrong with P, for a linear program that found no optimum."""
    try:
        check(polytope)
    except RegionError as error:
        return error
    return RegionError("polytope_numerics", f"a linear program over the polytope failed: {result.message}", field="polytope")


def _proved_bounds(polytope: Polytope, directions: Array, Y: Array, lo: Array, hi: Array) -> Array:
    """(k,) upper bounds of the directions (k, n) on P, inside the box [lo, hi], by the multipliers Y (k, m); rounding included."""
    C, d = polytope.C, polytope.d
    r = directions - Y @ C
    values = Y @ d + np.maximum(r * lo, r * hi).sum(axis=1)
    magnitude = Y @ np.abs(d) + (Y @ np.abs(C) + np.abs(directions)) @ np.maximum(np.abs(lo), np.abs(hi))
    return values + 4 * (sum(C.shape) + 2) * np.finfo(float).eps * magnitude


def _axis_limits(polytope: Polytope) -> tuple[Array, NDArray[np.int64]]:
    """(2n,) bounds of the directions e_i, then -e_i, by single rows, rounded up, and the row (2n,) each comes from.

    Raises:
        RegionError: ``polytope_without_limits``.
    """
    C, d = polytope.C, polytope.d
    n = C.shape[1]
    limits, rows = np.full(2 * n, np.inf), np.zeros(2 * n, dtype=np.int64)
    for j in np.flatnonzero((C != 0).sum(axis=1) == 1):
        i = int(np.flatnonzero(C[j])[0])
        a = abs(C[j, i])
        limit = d[j] if a == 1 else np.nextafter(d[j] / a, np.inf)
        side = i if C[j, i] > 0 else n + i
        if limit < limits[side]:
            limits[side], rows[side] = limit, j
    if np.isinf(limits).any():
        side = int(np.flatnonzero(np.isinf(limits))[0])
        raise RegionError(
            "polytope_without_limits",
            f"no row bounds s[{side % n}] alone from {'above' if side < n else 'below'}",
            field="polytope",
            hint="add the joint limits as rows",
        )
    return limits, rows

"""Linear programs are solved here over polytopes P = {s : C s <= d}, C (m, n), d (m,).

Values found by a linear program (certifier.polytopes.simplex) are accurate to rounding. What has to hold for certain rests on weak
duality instead: for multipliers y >= 0 and a box [l, u] around P,

    c's = y'C s + (c - y'C)'s <= y'd + sum_i max(r_i l_i, r_i u_i),   r = c - y'C,

and a bound on the rounding of the right-hand side itself is added.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numba import njit
from numpy.typing import NDArray

from certifier.errors import RegionError
from certifier.model import Array, Polytope
from certifier.polytopes import simplex

_FLAT = 1e-9
_RAYS = 2048


def bounds(polytope: Polytope) -> tuple[Array, Array]:
    """Returns the smallest box around P, lower (n,) and upper (n,), from the support values along the axes.

    Raises:
        RegionError: as :func:`chebyshev_center`.
    """
    return _bounds(polytope, chebyshev_center(polytope)[0])


def _bounds(polytope: Polytope, inside: Array) -> tuple[Array, Array]:
    n = len(inside)
    axes = np.concatenate([np.eye(n), -np.eye(n)])
    points, _ = _maximise(polytope, axes, inside)
    values = np.einsum("ki,ki->k", axes, points)
    return -values[n:], values[:n]


def faces_to_opposite(polytope: Polytope) -> Array:
    """Returns for each row c's <= d how far c's goes on P, (m,): from its least value to d, which is its largest where the row is a face.

    Raises:
        RegionError: as :func:`chebyshev_center`.
    """
    points, _ = _maximise(polytope, -polytope.C, chebyshev_center(polytope)[0])
    return polytope.d - np.einsum("ki,ki->k", polytope.C, points)


def bound_multipliers(polytope: Polytope, inside: Array | None = None) -> tuple[Array, Array, Array, Array]:
    """Returns a box around P with the multipliers that prove it in exact arithmetic.

    Every axis needs a row on either side that bounds it alone, as the joint limits do; residuals are absorbed there.

    Args:
        inside: (n,) a point inside, if one is known.

    Returns:
        (lo, hi, Y_lo, Y_hi), of shapes (n,), (n,), (n, m), (n, m). Y >= 0; row i of Y_hi proves s_i <= hi_i, and row i of Y_lo proves
        -s_i <= -lo_i. Bounds are rounded outwards.

    Raises:
        RegionError: ``polytope_without_limits``, or as :func:`chebyshev_center`.
    """
    n = polytope.C.shape[1]
    axes = np.concatenate([np.eye(n), -np.eye(n)])
    limits, rows = _axis_limits(polytope)
    _need_limits(limits)
    _, Y = _maximise(polytope, axes, chebyshev_center(polytope)[0] if inside is None else inside)
    values = _proved_bounds(polytope, axes, Y, -limits[n:], limits[:n])
    at_limit = values >= limits
    Y[at_limit] = 0
    scale = np.abs(polytope.C[rows[at_limit]]).max(axis=1)
    # The multiplier is rounded down, so that the residual is positive and the very same row bounds it.
    Y[at_limit, rows[at_limit]] = np.where(scale == 1, 1, np.nextafter(1 / scale, 0))
    values = np.minimum(values, limits)
    return -values[n:], values[:n], Y[n:], Y[:n]


def support(polytope: Polytope, c: Array) -> tuple[float, Array]:
    """Returns an upper bound of c's on P, rounded upwards, with the multipliers y (m,) that prove it as in :func:`bound_multipliers`.

    Raises:
        RegionError: ``polytope_without_limits``, or as :func:`chebyshev_center`.
    """
    n = polytope.C.shape[1]
    limits, _ = _axis_limits(polytope)
    _need_limits(limits)
    _, Y = _maximise(polytope, c[None], chebyshev_center(polytope)[0])
    return float(_proved_bounds(polytope, c[None], Y, -limits[n:], limits[:n])[0]), Y[0]


def chebyshev_center(polytope: Polytope, names: tuple[str, ...] | None = None) -> tuple[Array, float]:
    """Returns the centre (n,) and the radius of a largest ball inside P; refuses a polytope that is empty, flat or unbounded.

    Args:
        names: (n,) joint names for the messages.

    Raises:
        RegionError: ``polytope_empty`` when no ball of positive radius fits inside; ``polytope_unbounded``, which names a joint or a
            direction v with C v <= 0.
    """
    C, d, norms = polytope.C, polytope.d, np.linalg.norm(polytope.C, axis=1)
    rows = norms > 0
    if (d[~rows] < 0).any():
        raise _empty()
    for sign, word in ((1.0, "above"), (-1.0, "below")):
        free = np.flatnonzero((sign * C <= 0).all(axis=0))
        if free.size:
            joint = names[free[0]] if names else f"s[{free[0]}]"
            raise RegionError(
                "polytope_unbounded", f"no row bounds {joint} from {word}", field="polytope", hint="add the joint limits as rows"
            )
    if np.isinf(_axis_limits(polytope)[0]).any():
        _check_cone(C)
    # Where P is empty, the radius is negative: its size is how far all faces would have to move.
    balls = Polytope(np.column_stack([C, norms])[rows], d[rows])
    start = np.append(np.zeros(C.shape[1]), (d[rows] / norms[rows]).min())
    point = _maximise(balls, np.eye(len(start))[-1:], start)[0][0]
    center, radius = point[:-1], float(point[-1])
    if radius < 0:
        raise _empty()
    if radius <= _FLAT:
        message = f"the polytope is flat: no ball of radius {_FLAT:g} fits inside"
        raise RegionError("polytope_empty", message, field="polytope", hint="move its faces apart")
    return center, radius


def _check_cone(C: Array) -> None:
    """Refuses faces C s <= d for which some direction v != 0 has C v <= 0."""
    # By Stiemke's lemma either some v has C v <= 0, C v != 0, or a positive combination of the rows vanishes. In the second case P is
    # bounded iff C has full rank. With C v >= -1 the optimum is 0, or at most -1.
    C = C[C.any(axis=1)] / np.linalg.norm(C[C.any(axis=1)], axis=1, keepdims=True)
    if np.linalg.matrix_rank(C, tol=_FLAT) < C.shape[1]:
        raise _unbounded(np.linalg.svd(C).Vh[-1])
    cone, inside = Polytope(np.concatenate([C, -C]), np.repeat([0.0, 1.0], len(C))), np.zeros(C.shape[1])
    direction = _maximise(cone, -C.sum(axis=0, keepdims=True), inside)[0][0]
    if C.sum(axis=0) @ direction < -0.5:
        raise _unbounded(direction)


def _empty() -> RegionError:
    return RegionError("polytope_empty", "no point satisfies C s <= d", field="polytope", hint="look at the signs and at the joint limits")


def _unbounded(direction: Array) -> RegionError:
    v = np.array2string(direction / np.abs(direction).max(), precision=4, separator=", ", suppress_small=True)
    return RegionError("polytope_unbounded", f"the polytope is unbounded along {v}", field="polytope", hint="add the joint limits as rows")


SCALED = "scale the rows of C to length 1, and leave out rows that nearly repeat others"
"""This is what to do where the numbers of a polytope are too hard."""
_CLEARLY = 1e-9
"""A row must be redundant by this relative distance to be dropped, so that another proof that it is redundant succeeds as well."""


def drop_redundant(polytope: Polytope, fixed: int = 0, inside: Array | None = None) -> NDArray[np.int64]:
    """Returns the indices, ascending, of rows that suffice to describe P.

    The set is never enlarged: rows are dropped only when strict dual bounds on P's bounding box prove them from the rows that stay. So
    some weakly redundant rows remain.

    The box does no harm. On a way out of P through dropped rows, the first of them to be reached would be reached in the box, where the
    bounds hold.

    Rows are called needed when a ray from inside leaves P through them alone. Each round tries all other rows against these, and shoots
    rays at the points where that fails (Clarkson's algorithm).

    Args:
        fixed: this many rows at the end stay in every case, for instance the joint limits.
        inside: (n,) a point well inside, if one is known.

    Raises:
        RegionError: as :func:`chebyshev_center`.
    """
    center = chebyshev_center(polytope)[0] if inside is None else inside
    lo, hi = _bounds(polytope, center)
    margin = 1e-6 * (1 + hi - lo)
    lo, hi = lo - margin, hi + margin
    stays = np.arange(len(polytope.d)) >= len(polytope.d) - fixed
    rows = np.flatnonzero(~_repeated(polytope) | stays)
    distinct = Polytope(polytope.C[rows], polytope.d[rows])
    needed, idle = stays[rows], np.zeros(len(rows), dtype=bool)
    rays = _directions(len(center)) * (hi - lo)
    needed |= _left_through(distinct, center, np.concatenate([rays, distinct.C * (hi - lo) ** 2]))
    while not (needed | idle).all():
        tried = np.flatnonzero(~needed & ~idle)
        known, directions = Polytope(distinct.C[needed], distinct.d[needed]), distinct.C[tried]
        points, Y = _maximise(_boxed(known, lo, hi), directions, center)
        Y = Y[:, : len(known.d)]
        proved = _proved_bounds(known, directions, Y, lo, hi) < distinct.d[tried] - _CLEARLY * (1 + np.abs(distinct.d[tried]))
        idle[tried[proved]] = True
        found = _left_through(distinct, center, points[~proved] - center) & ~needed
        needed |= found if found.any() else ~idle
    return rows[needed]


def without_redundant(polytope: Polytope, fixed: int = 0) -> Polytope:
    """Returns the same set with the rows of :func:`drop_redundant` alone; its arguments and errors are the same."""
    kept = drop_redundant(polytope, fixed)
    return Polytope(polytope.C[kept], polytope.d[kept])


@lru_cache(maxsize=16)
def _directions(n: int) -> Array:
    """Returns random directions (_RAYS, n), which are always the same."""
    return np.random.default_rng(0).normal(size=(_RAYS, n))


def _repeated(polytope: Polytope) -> NDArray[np.bool_]:
    """Returns for every row, (m,), whether another row with the same normal makes it idle.

    That other row has a smaller offset, or it has the same offset and comes further down.
    """
    order = np.lexsort((-np.arange(len(polytope.d)), polytope.d))
    _, first = np.unique(polytope.C[order], axis=0, return_index=True)
    repeated = np.ones(len(polytope.d), dtype=bool)
    repeated[order[first]] = False
    return repeated


def _left_through(polytope: Polytope, center: Array, rays: Array) -> NDArray[np.bool_]:
    """Returns for every row, (m,), whether some ray (r, n) from the centre leaves P through this row alone."""
    rows = np.zeros(len(polytope.d), dtype=bool)
    _leave(polytope.C, polytope.d - polytope.C @ center, rays, rows)
    return rows


@njit(cache=True)
def _leave(C: Array, slack: Array, rays: Array, rows: NDArray[np.bool_]) -> None:
    """Marks the rows through which alone some ray leaves P; slack is how far the centre is from the faces."""
    for ray in rays:
        through, first, second = 0, np.inf, np.inf
        for j in range(len(C)):
            speed = 0.0
            for i in range(len(ray)):
                speed += C[j, i] * ray[i]
            if speed > 0 and slack[j] < second * speed:
                second = slack[j] / speed
                if second < first:
                    through, first, second = j, second, first
        if first < (1 - 1e-9) * second:
            rows[through] = True


def _maximise(polytope: Polytope, directions: Array, start: Array) -> tuple[Array, Array]:
    """Does what :func:`certifier.polytopes.simplex.maximise` does, for a bounded P."""
    try:
        return simplex.maximise(polytope.C, polytope.d, directions, start)
    except np.linalg.LinAlgError as error:
        raise RegionError("polytope_numerics", "a linear program over the polytope failed", field="polytope", hint=SCALED) from error


def _boxed(polytope: Polytope, lo: Array, hi: Array) -> Polytope:
    """Returns P within a box, whose faces come last."""
    eye = np.eye(len(lo))
    return Polytope(np.concatenate([polytope.C, eye, -eye]), np.concatenate([polytope.d, hi, -lo]))


def _proved_bounds(polytope: Polytope, directions: Array, Y: Array, lo: Array, hi: Array) -> Array:
    """Returns upper bounds (k,) of the directions (k, n) on P, inside the box [lo, hi], by the multipliers Y (k, m), rounding included."""
    C, d = polytope.C, polytope.d
    r = directions - Y @ C
    values = Y @ d + np.maximum(r * lo, r * hi).sum(axis=1)
    magnitude = Y @ np.abs(d) + (Y @ np.abs(C) + np.abs(directions)) @ np.maximum(np.abs(lo), np.abs(hi))
    return values + 4 * (sum(C.shape) + 2) * np.finfo(float).eps * magnitude


def _axis_limits(polytope: Polytope) -> tuple[Array, NDArray[np.int64]]:
    """Returns bounds (2n,) of the directions e_i, then -e_i, by single rows, and the row (2n,) that each bound comes from.

    A bound is rounded up, and it is inf where no single row gives one.
    """
    C, d = polytope.C, polytope.d
    n = C.shape[1]
    rows = np.full(2 * n, -1)
    _single_rows(np.ascontiguousarray(C), np.ascontiguousarray(d), rows)
    a = np.abs(C[rows, np.tile(np.arange(n), 2)])
    with np.errstate(divide="ignore", invalid="ignore"):
        limits = np.where(a == 1, d[rows], np.nextafter(d[rows] / a, np.inf))
    return np.where(rows < 0, np.inf, limits), rows


@njit(cache=True)
def _single_rows(C: Array, d: Array, rows: NDArray[np.int64]) -> None:
    """Fills in the row that alone gives the least bound, for e_i, then -e_i; -1 stays where there is none."""
    m, n = C.shape
    for j in range(m):
        axis, entries = 0, 0
        for i in range(n):
            if C[j, i] != 0:
                axis, entries = i, entries + 1
        if entries == 1:
            side = axis if C[j, axis] > 0 else n + axis
            held = rows[side]
            if held < 0 or d[j] / abs(C[j, axis]) < d[held] / abs(C[held, axis]):
                rows[side] = j


def _need_limits(limits: Array) -> None:
    """Raises RegionError, ``polytope_without_limits``, where single rows do not bound every axis."""
    if np.isinf(limits).any():
        side, n = int(np.flatnonzero(np.isinf(limits))[0]), len(limits) // 2
        raise RegionError(
            "polytope_without_limits",
            f"no row bounds s[{side % n}] alone from {'above' if side < n else 'below'}",
            field="polytope",
            hint="add the joint limits as rows",
        )

"""IRIS in s-space grows a large polytope that is probably free of collisions (C-IRIS, appendix B.4 and C, algorithm 2).

It alternates. Around the contacts that are nearest in the metric of an ellipsoid (:mod:`certifier.seeding.contacts`), faces tangent to the
ellipsoid cut a polytope from the joint limits. The next ellipsoid is the largest one in this polytope. The alternation leaves corners that
collide. :mod:`certifier.seeding.trim` cuts these off in the end, by faces that lose least.

Where growth will keep coarse volumes apart by faces (:mod:`certifier.seeding.coarse_pairs`), the alternation goes on beside these volumes.

Deits and Tedrake, "Computing Large Convex Regions of Obstacle-Free Space through Semidefinite Programming", 2014; Petersen and Tedrake,
"Growing Convex Collision-Free Regions in Configuration Space using Nonlinear Programming", 2023; Werner et al., "Faster Algorithms for
Growing Collision-Free Convex Polytopes in Robot Configuration Space", 2024.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from certifier.isolation.telling import tell
from certifier.model import Array, Polytope, Scene
from certifier.outcome import Guarantee
from certifier.polytopes.ellipsoid import Ellipsoid, inscribed_ellipsoid
from certifier.polytopes.proved import needed_faces
from certifier.polytopes.sampling import hit_and_run
from certifier.scene.hull import nearest_in_hull
from certifier.seeding.coarse_pairs import coarse_pairs_of, with_coarse_pairs
from certifier.seeding.contacts import Contacts
from certifier.seeding.options import SeedOptions
from certifier.seeding.trim import Trim

START_RADIUS = 1e-2
"""The first ellipsoid is a ball in s with this radius."""
SAMPLES, NEAR = 2000, 60
"""In each round of faces, contacts are looked for from the NEAR colliding ones of this many samples, those nearest in the metric."""
FEW, MOST = 1 / 3, 0.25
"""A round of faces is the last one of an alternation if at most the share MOST of the samples collides, and FEW times the share that does
within the joint limits. The fewer faces there are, the larger is the next ellipsoid, and the more is left to cut off in the end.
"""
LEAST_ROOM = 1e-5
"""A contact that is nearer than this, in s, to the hull of the points to keep gets no face."""
BESIDE = 2
"""The volumes that growth will part are chosen this many times, each time on the last polytope."""
BESIDE_ITERATIONS = 2
"""At most this many alternations follow each choice."""

AGAIN, LEAST_KEPT = 2, 0.6
"""Where the ellipsoid in what the samples leave is narrower by this factor than one of the alternations, all of this is tried again with
other random numbers, AGAIN times at most in all. Then what collides lies between the seed and most of the polytope, or next to the seed,
and cutting it off may have left a sliver."""


def iris(scene: Scene, points: Array, options: SeedOptions) -> tuple[Array, Array, dict[str, Any]]:
    """Returns the faces (m, n), (m,) of an IRIS region around points of s, and an account.

    |c_j| = 1, and the joint limits are left out. The points are inside, if their straight lines are free. The result is the same for the
    same random seed.

    Args:
        points: (k, n) points in s, the seed first, all strictly within the limits.

    Returns:
        (C, d, account); the account's keys are guarantee, termination, iterations, epsilon, delta, warnings.

    Raises:
        RegionError: as :func:`certifier.polytopes.ellipsoid.inscribed_ellipsoid`.
    """
    rng = np.random.default_rng(options.random_seed or 0)
    best: _Found | None = None
    for _ in range(AGAIN):
        best = _found(scene, points, options, rng, best.volume if best else 0.0) or best
        if best is None or best.kept >= LEAST_KEPT:
            break
    assert best is not None, "there is a first time"
    turn, trim = best.turn, best.trim
    trim.by_descents()
    polytope, passed = trim.polytope, trim.passed
    C, d = needed_faces(scene, polytope.C[: -2 * scene.n], polytope.d[: -2 * scene.n], points)
    guarantee = Guarantee.SAMPLED if passed else Guarantee.NONE
    warnings = [] if passed else [f"more than {options.epsilon:g} of the polytope may collide: too many faces would be needed"]
    account = {"guarantee": guarantee, "termination": turn.termination, "iterations": turn.iterations, "warnings": warnings}
    return C, d, {"epsilon": options.epsilon, "delta": options.delta, **account}


@dataclass(frozen=True, eq=False)
class _Found:
    """Holds a region.

    Attributes:
        turn: the last of the alternations.
        trim: what samples show to collide is cut off its polytope.
        volume: of the largest ellipsoid in the polytope of ``trim``.
        kept: how wide this ellipsoid is, as a part of the widest one of the alternations, in the mean over all directions.
    """

    turn: _Turn
    trim: Trim
    volume: float
    kept: float


def _found(scene: Scene, points: Array, options: SeedOptions, rng: np.random.Generator, least: float) -> _Found | None:
    """Alternates between faces and ellipsoid, and cuts off the corners that samples show to collide.

    Returns None as soon as the largest ellipsoid in the polytope is seen to be no larger than ``least``.
    """
    contacts, limits = Contacts(scene), scene.polytope([], [])
    samples = hit_and_run(limits, points[0], SAMPLES, int(rng.integers(2**31)))
    few = min(MOST, FEW * float((~contacts.free(samples)).mean()))
    start = _Turn(limits, Ellipsoid(points[0], START_RADIUS * np.eye(scene.n)), 0)
    turn = _alternated(contacts, points, start, few, options.max_iterations, options, rng)
    widest = turn.ellipsoid.volume
    for _ in range(BESIDE):
        coarse = coarse_pairs_of(scene, turn.polytope, points)
        if not coarse:
            break
        begin = _Turn(turn.polytope, turn.ellipsoid, turn.iterations)
        contacts = Contacts(with_coarse_pairs(scene, coarse))
        turn = _alternated(contacts, points, begin, few, BESIDE_ITERATIONS, options, rng)
        widest = max(widest, turn.ellipsoid.volume)
    trim = Trim(scene, turn.polytope, points, options, rng)
    ellipsoid = trim.by_samples(least)
    if ellipsoid is None:
        return None
    return _Found(turn, trim, ellipsoid.volume, float((ellipsoid.volume / widest) ** (1 / scene.n)))


@dataclass(frozen=True, eq=False)
class _Turn:
    """Holds a result of an alternation.

    Attributes:
        ellipsoid: the largest one in the polytope, or what the first faces are tangent to.
        termination: ``tolerance``, where the last ellipsoid was hardly larger than the one before, or ``iteration_limit``.
    """

    polytope: Polytope
    ellipsoid: Ellipsoid
    iterations: int
    termination: str = "iteration_limit"


def _alternated(
    contacts: Contacts, points: Array, start: _Turn, few: float, most: int, options: SeedOptions, rng: np.random.Generator
) -> _Turn:
    """Alternates between faces and ellipsoid, and returns the turn with the largest ellipsoid.

    Args:
        few: a round of faces is the last one if at most this share of the samples collides.
        most: number of alternations.
    """
    best, volume, shape, center = None, 0.0, start.ellipsoid.shape, points[0]
    for iteration in range(start.iterations + 1, start.iterations + most + 1):
        if contacts.free(start.ellipsoid.center[None])[0]:
            center = start.ellipsoid.center
        polytope = _faces(contacts, points, Ellipsoid(center, shape), few, options, rng)
        ellipsoid = inscribed_ellipsoid(polytope)
        gained = ellipsoid.volume > (1 + options.tolerance) * volume
        start = _Turn(polytope, ellipsoid, iteration, "iteration_limit" if gained else "tolerance")
        if best is None or ellipsoid.volume > volume:
            best, volume = start, ellipsoid.volume
        if not gained:
            break
        shape = ellipsoid.shape
    assert best is not None, "there is an iteration at least"
    return _Turn(best.polytope, best.ellipsoid, start.iterations, start.termination)


def _faces(contacts: Contacts, points: Array, ellipsoid: Ellipsoid, few: float, options: SeedOptions, rng: np.random.Generator) -> Polytope:
    """Returns the joint limits with faces before the contacts that are nearest to the centre in the ellipsoid's metric."""
    center, inverse = ellipsoid.center, np.linalg.inv(ellipsoid.shape)
    found = contacts.limits
    for _ in range(options.max_iterations_separating_planes):
        inside = center if (found.C @ center < found.d).all() else points[0]
        samples = hit_and_run(found, inside, SAMPLES, int(rng.integers(2**31)))
        colliding = samples[~contacts.free(samples)]
        if len(colliding) <= few * SAMPLES:
            break
        order = np.argsort(np.linalg.norm((colliding - center) @ inverse, axis=1), kind="stable")
        near, far = contacts.nearest(colliding[order[:NEAR]], center, ellipsoid.shape)
        faces: list[tuple[Array, float]] = []
        for k in np.argsort(far, kind="stable"):
            if all(row @ near[k] < offset for row, offset in faces):
                face = _face(near[k], center, inverse, points, options.margin)
                faces += [] if face is None else [face]
        if not faces:
            break
        C, d = np.array([row for row, _ in faces]), np.array([offset for _, offset in faces])
        found = Polytope(np.concatenate([C, found.C]), np.concatenate([d, found.d]))
        tell(faces=len(found.d) - len(contacts.limits.d))
    return found


def _face(contact: Array, center: Array, inverse: Array, points: Array, margin: float) -> tuple[Array, float] | None:
    """Returns the face (n,), offset before a contact, |c| = 1, with all points to keep inside; None where there is none.

    It is tangent to the ellipsoid. Where that loses a point, it is perpendicular, in the ellipsoid's metric, to the way to the nearest
    point of the hull of those to keep.
    """
    nearest, _ = nearest_in_hull(np.zeros(len(contact)), (points - contact) @ inverse)  # in the ellipsoid's metric, from the contact
    for way in (inverse @ (contact - center), -nearest):
        row = inverse @ way
        row /= max(float(np.linalg.norm(row)), 1e-300)
        kept, offset = float((points @ row).max()), float(contact @ row)
        if offset - kept > LEAST_ROOM:
            return row, max(offset - margin, (kept + offset) / 2)
    return None

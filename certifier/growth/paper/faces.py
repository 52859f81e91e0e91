"""Targeted contraction adds faces that cut away where the program (11) of a pair fails, and little else.

The result for a pair that is not certifiable has the means of its dual point's pseudo-moments: points where no certificate of this degree
exists. It also has the derivatives of the program's optimum with respect to the joints' ranges.

The polytope is measured by an ellipsoid about its analytic centre. Distances in it are taken from the hull of the centre and the points
to keep.

    a mean farther than ``near``     -> a face between it and the hull
    all means nearer                 -> the pair fails because it turns too far: the joint where that helps most gets a shorter
                                        range, all its joints do when that has not helped for long
    a collision                      -> a face, wherever it is

Faces have normals in the joints between the two bodies only, because the other joints do not move one body relative to the other. Where
only planes at rest were tried, the program knows the joints' ranges alone, and a face has its normal in one joint.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import nnls

from certifier.model import Array, Polytope, Scene
from certifier.pair.result import Weakness
from certifier.polytopes.polytope import bounds, without_redundant
from certifier.polytopes.proved import cleaned

BACKOFF, BACKOFF_GROWTH, LARGEST_BACKOFF = 0.2, 1.2, 0.6
"""A face moves from the mean towards the hull by a part of the distance.

That part is BACKOFF at first. It is multiplied by BACKOFF_GROWTH each time the same pair fails, up to LARGEST_BACKOFF.
"""
SHORTER = 0.6
"""This share of a joint's range is left on either side of the centre."""
PATIENCE = 12
"""After this many attempts all of a pair's joints are shortened at once."""
KEPT_SLACK = 0.05
"""This part of a joint's range stays free around the points to keep."""
SMALLEST_RANGE = 1e-6
NEAR_RANGES = 0.5
"""Where a face is a shorter range on one side, a mean gets a face from this share of the distance ``near`` on."""
_HULL_WEIGHT = 1e3


@dataclass(frozen=True)
class Failure:
    """A failure is a pair that is not certified on the polytope.

    Attributes:
        joints: position indices of the joints between its bodies.
        weakness: where it fails; without points nothing is known but that it fails. Where only the joints' ranges count, a face helps in
            one joint alone.
        attempts: how often faces were added for this pair before.
    """

    joints: tuple[int, ...]
    weakness: Weakness
    attempts: int


@dataclass(frozen=True)
class Measure:
    """A measure is the ellipsoid {center + shape v : |v| <= 1}, where covariance = shape shape'.

    Attributes:
        center: (n,).
        covariance: (n, n).
    """

    center: Array
    covariance: Array


def measure(polytope: Polytope, start: Array) -> Measure:
    """Returns the analytic centre with sqrt(2) times Dikin's ellipsoid there, which for a box is the inscribed ellipsoid.

    Args:
        start: (n,) a point strictly inside.
    """
    C, d, s = polytope.C, polytope.d, start
    for _ in range(200):
        scaled = C / (d - C @ s)[:, None]
        gradient, hessian = scaled.sum(axis=0), scaled.T @ scaled
        step = -np.linalg.solve(hessian, gradient)
        decrement = float(np.sqrt(max(-gradient @ step, 0.0)))
        if decrement < 1e-8:
            break
        s = s + step / (1 + decrement if decrement > 0.25 else 1.0)
    scaled = C / (d - C @ s)[:, None]
    return Measure(s, 2 * np.linalg.inv(scaled.T @ scaled))


def contract(scene: Scene, polytope: Polytope, ellipsoid: Measure, keep: Array, failures: list[Failure], near: float) -> Polytope | None:
    """Returns the polytope with faces added for every failure, without redundant faces.

    Args:
        polytope: its last 2n rows are the joint limits; so are the result's.
        keep: (k, n) points that stay inside.
        near: distance in the ellipsoid from which on a mean gets a face; a face at distance 1 does not cut the ellipsoid.

    Returns:
        None when a joint's range would become too short to go on.
    """
    limits = 2 * scene.n
    C, d = [polytope.C[:-limits]], [polytope.d[:-limits]]
    for failure in failures:
        if failure.weakness.ranges_alone:
            worst = replace(failure, joints=(_worst_joint(scene, polytope, failure),))
            found = _face(ellipsoid, keep, worst, NEAR_RANGES * near)
        else:
            found = _face(ellipsoid, keep, failure, near)
        if found is None:
            found = _shorter_range(scene, polytope, ellipsoid, keep, failure)
        if found is None:
            return None
        rows, offsets = cleaned(*found, scene.s_lower, scene.s_upper, keep)
        C.append(rows)
        d.append(offsets)
    limited = scene.polytope(np.concatenate(C), np.concatenate(d))
    return without_redundant(limited, fixed=limits)


def _face(ellipsoid: Measure, keep: Array, failure: Failure, near: float) -> tuple[Array, Array] | None:
    """Returns a face before the farthest mean; None when all means are near and none is a collision."""
    if not len(failure.weakness.points):
        return None
    joints = list(failure.joints)
    root = np.linalg.inv(np.linalg.cholesky(ellipsoid.covariance[np.ix_(joints, joints)]))
    hull = np.concatenate([ellipsoid.center[None], keep])[:, joints]
    best: tuple[float, Array, Array] | None = None
    for point in failure.weakness.points[:, joints]:
        system = np.vstack([root @ (hull - point).T, np.full((1, len(hull)), _HULL_WEIGHT)])
        weights, _ = nnls(system, np.append(np.zeros(len(joints)), _HULL_WEIGHT))
        nearest = weights @ hull / weights.sum()
        distance = float(np.linalg.norm(root @ (point - nearest)))
        if best is None or distance > best[0]:
            best = distance, point, nearest
    assert best is not None
    distance, point, nearest = best
    if distance == 0 or (distance < near and failure.weakness.pull.any()):
        return None
    backoff = min(LARGEST_BACKOFF, BACKOFF * BACKOFF_GROWTH**failure.attempts)
    normal = root.T @ root @ (point - nearest)
    normal /= np.linalg.norm(normal)
    row = np.zeros(len(ellipsoid.center))
    row[joints] = normal
    return row[None], np.array([normal @ nearest + (1 - backoff) * (normal @ (point - nearest))])


def _shorter_range(scene: Scene, polytope: Polytope, ellipsoid: Measure, keep: Array, failure: Failure) -> tuple[Array, Array] | None:
    """Returns two faces for each joint to shorten, one on either side of the centre; None when a range is too short already.

    The joint to shorten is the one that turns far and where a shorter range helps. After PATIENCE attempts it is all of the pair's joints.
    """
    lower, upper = bounds(polytope)
    center = ellipsoid.center
    joints = [_worst_joint(scene, polytope, failure)] if failure.attempts < PATIENCE else list(failure.joints)
    width = (upper - lower)[joints]
    if width.min() < SMALLEST_RANGE:
        return None
    middle, kept = center[joints], keep[:, joints]
    low = np.minimum(middle - SHORTER * (middle - lower[joints]), kept.min(axis=0) - KEPT_SLACK * width)
    high = np.maximum(middle + SHORTER * (upper[joints] - middle), kept.max(axis=0) + KEPT_SLACK * width)
    rows = np.eye(len(center))[joints]
    return np.concatenate([rows, -rows]), np.concatenate([high, -low])


def _worst_joint(scene: Scene, polytope: Polytope, failure: Failure) -> int:
    """Returns the joint of the pair that turns far and where a shorter range helps."""
    turn = scene.turn(*bounds(polytope))
    gain = turn * failure.weakness.pull if len(failure.weakness.points) else turn
    return max(failure.joints, key=lambda i: float(gain[i]))

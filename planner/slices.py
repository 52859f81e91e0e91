"""A region is cut here with a plane of two joint axes, where the other joints stay at a configuration."""

from __future__ import annotations

import numpy as np

from certifier.model import Array, Polytope, Scene

POINTS_PER_EDGE = 12
"""Number of points with which an edge that is bent in q is drawn."""


def slice_polygon(polytope: Polytope, s: Array, axes: tuple[int, int], lower: Array, upper: Array) -> Array:
    """Returns the corners (k, 2), anticlockwise, of the part of P whose other coordinates are those of s; (0, 2) where it is empty.

    Args:
        s: (n,) a point.
        axes: the two coordinates that change.
        lower, upper: (2,) bounds of these two.
    """
    x, y = axes
    A = polytope.C[:, [x, y]]
    rest = s.copy()
    rest[[x, y]] = 0.0
    b = polytope.d - polytope.C @ rest
    corners = np.array([[lower[0], lower[1]], [upper[0], lower[1]], [upper[0], upper[1]], [lower[0], upper[1]]])
    size = np.linalg.norm(A, axis=1)
    if (b[size == 0] < 0).any():
        return np.zeros((0, 2))
    A, b = A[size > 0] / size[size > 0, None], b[size > 0] / size[size > 0]
    while len(corners):
        # The face that cuts deepest comes first, so that most faces never cut.
        beyond = (corners @ A.T - b).max(axis=0)
        face = int(np.argmax(beyond)) if len(b) else -1
        if face < 0 or beyond[face] <= 0:
            break
        corners = _cut(corners, A[face], b[face])
        A, b = np.delete(A, face, axis=0), np.delete(b, face)
    return corners


def _cut(corners: Array, normal: Array, offset: float) -> Array:
    """Returns the corners of the part of a convex polygon (k, 2) on the inner side of a line."""
    slack = offset - corners @ normal
    kept: list[Array] = []
    for i, (here, there) in enumerate(zip(slack, np.roll(slack, -1), strict=True)):
        if here >= 0:
            kept.append(corners[i])
        if here * there < 0:
            following = corners[(i + 1) % len(corners)]
            kept.append(corners[i] + (following - corners[i]) * here / (here - there))
    return np.array(kept).reshape(-1, 2)


def outline_in_q(scene: Scene, corners: Array, axes: tuple[int, int]) -> Array:
    """Returns the outline (k, 2) in joint positions of a polygon (k, 2) of a slice in s, whose straight edges are bent in q."""
    place = np.arange(POINTS_PER_EDGE)[None, :, None] / POINTS_PER_EDGE
    along = corners[:, None] + place * (np.roll(corners, -1, axis=0) - corners)[:, None]
    s = np.zeros((along.shape[0] * along.shape[1], scene.n))
    s[:, axes] = along.reshape(-1, 2)
    outline: Array = scene.to_q(s)[:, axes]
    return outline


def slice_points(q: Array, axes: tuple[int, int], lower: Array, upper: Array, size: int) -> Array:
    """Returns the configurations (size * size, n) at the middles of the squares of a slice; the first axis changes fastest.

    Args:
        q: (n,) where the other joints stay.
        lower, upper: (2,) where the slice begins and ends, in joint positions.
    """
    middle = (np.arange(size) + 0.5) / size
    xs, ys = (low + middle * (high - low) for low, high in zip(lower, upper, strict=True))
    points = np.tile(q, (size * size, 1))
    points[:, axes[0]], points[:, axes[1]] = np.tile(xs, size), np.repeat(ys, size)
    return points

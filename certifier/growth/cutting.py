"""A face cuts off what cannot be certified and loses as little of the polytope as it can, by q-volume.

A linear program finds it: all points of a corner that has to go lie beyond the face, all points to keep lie before it, and of samples of
the polytope that are uniform in q as few as possible lie beyond. "As few" is replaced by the hinge loss, as in a support vector machine.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.optimize import linprog

from certifier.model import Array, Polytope, Scene
from certifier.polytopes.gibbs import uniform_in_q

CHAINS, EACH = 100, 8
"""So many chains give so many samples each, for the faces of one round."""
CORNER = 0.6
"""The points of one corner lie within this distance of each other, in standard deviations of the samples."""
MOST_POINTS = 64
MOST_FACES = 8
"""A pair gets at most this many faces in one round."""
CLEAR, CLEARER = 0.005, 0.2
"""A face is moved away from what it cuts off, by CLEAR standard deviations and by CLEARER of the depth of what it cuts off."""


def cut(scene: Scene, polytope: Polytope, keep: Array, corners: Sequence[tuple[tuple[int, ...], Array]], seed: int) -> Polytope | None:
    """Returns the polytope with faces that cut off the points given.

    Args:
        polytope: its last 2n rows are the joint limits; new faces are added before them, and no face is dropped.
        keep: (k, n) points that stay inside.
        corners: for each pair that failed, the joints between its bodies and the points (w, n) to cut off.

    Returns:
        None where nothing can be cut off without a point to keep.
    """
    limits = 2 * scene.n
    samples = uniform_in_q(polytope, scene.revolute, CHAINS, EACH, seed).reshape(-1, scene.n)
    scale = np.where(samples.std(axis=0) > 0, samples.std(axis=0), 1.0)
    C, d = polytope.C, polytope.d
    blocked = False
    for joints, points in corners:
        J = list(joints)
        for _ in range(MOST_FACES):
            left = points[(points @ C.T < d).all(axis=1)]
            if not len(left):
                break
            distance = np.linalg.norm((left - left[0])[:, J] / scale[J], axis=1)
            near = left[np.argsort(distance, kind="stable")[:MOST_POINTS]]
            near = near[: max(1, int((np.sort(distance)[:MOST_POINTS] < CORNER).sum()))]
            found = _face(near[:, J], keep[:, J], samples[:, J], scale[J])
            if found is None and len(near) > 1:
                found = _face(near[:1, J], keep[:, J], samples[:, J], scale[J])
            if found is None:
                # Others of the pair's points may go all the same; this one is left to the next round.
                points, blocked = points[(points != left[0]).any(axis=1)], True
                continue
            row = np.zeros(scene.n)
            row[J], offset = found
            C, d = np.insert(C, len(d) - limits, row, axis=0), np.insert(d, len(d) - limits, offset)
            samples = samples[samples @ row <= offset]
    return None if blocked and len(d) == len(polytope.d) else Polytope(C, d)


def _face(beyond: Array, keep: Array, samples: Array, scale: Array) -> tuple[Array, float] | None:
    """Returns a face (k,), offset in the pair's joints, |c| = 1; None where no face has both on their sides."""
    k, h = len(scale), len(samples)
    middle = keep[0]
    far, near, rest = ((points - middle) / scale for points in (beyond, keep, samples))
    A = np.block(
        [
            [-far, np.ones((len(far), 1)), np.zeros((len(far), h))],
            [near, -np.ones((len(near), 1)), np.zeros((len(near), h))],
            [rest, -np.ones((h, 1)), -np.eye(h)],
        ]
    )
    b = np.concatenate([np.zeros(len(far)), -np.ones(len(near) + h)])
    bounds = [(None, None)] * (k + 1) + [(0, None)] * h
    found = linprog(np.concatenate([np.zeros(k + 1), np.ones(h)]), A_ub=A, b_ub=b, bounds=bounds, method="highs")
    if found.status != 0:
        return None
    normal, offset = found.x[:k] / scale, float(found.x[k])
    depth = float((far @ found.x[:k]).max()) - offset
    room = offset - float((near @ found.x[:k]).max())
    offset -= min(CLEAR * float(np.linalg.norm(found.x[:k])) + CLEARER * depth, 0.5 * room)
    length = float(np.linalg.norm(normal))
    return normal / length, float((offset + normal @ middle) / length)

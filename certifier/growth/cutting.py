"""A face cuts off what cannot be certified and loses as little of the polytope as it can, by q-volume.

A linear program finds it: all points of a corner that has to go lie beyond the face, all points to keep lie before it, and of samples of
the polytope that are uniform in q as few as possible lie beyond. "As few" is replaced by the hinge loss, as in a support vector machine.
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Sequence

import numpy as np
from scipy.optimize import linprog

from certifier.model import Array, Polytope, Scene
from certifier.polytopes.gibbs import uniform_in_q

CHAINS, EACH = 1000, 16
"""So many chains give so many samples each, for the faces of one round."""
ENOUGH = 2000
"""With fewer samples left, others are drawn."""
DRAWN = 4
TAIL, AGAIN, MARGIN = 400, 3, 0.1
"""A program sees TAIL samples, the farthest ones on the way to a corner, and others that it loses in AGAIN rounds. The hinge loss begins
MARGIN before the face, relative to the distance from the points to keep."""
CORNER = 0.6
"""The points of one corner lie within this distance of each other, in standard deviations of the samples."""
MOST_POINTS = 64
MOST_FACES = 16
"""A pair gets at most this many faces in one round."""
CLEAR, CLEARER = 0.005, 0.2
"""A face is moved away from what it cuts off, by CLEAR standard deviations and by CLEARER of the depth of what it cuts off."""


def cut(
    scene: Scene, polytope: Polytope, keep: Array, corners: Sequence[tuple[tuple[int, ...], Array, float]], around: Polytope
) -> Polytope | None:
    """Returns the polytope with faces that cut off the points given.

    Args:
        polytope: its last 2n rows are the joint limits; new faces are added before them, and no face is dropped.
        keep: (k, n) points that stay inside.
        corners: for each pair that failed, the joints between its bodies, the points (w, n) to cut off, and the share of the polytope that
            one face may lose at most.
        around: a polytope of which this one is a part, the same one for all rounds; its samples are drawn once.

    Returns:
        None where nothing can be cut off without a point to keep.
    """
    limits = 2 * scene.n
    samples = _samples(scene, around)
    samples = samples[polytope.contains(samples)]
    if len(samples) < ENOUGH:
        samples = _samples(scene, polytope)
    scale = np.where(samples.std(axis=0) > 0, samples.std(axis=0), 1.0)
    C, d = polytope.C, polytope.d
    blocked = False
    for joints, points, most in corners:
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
            loss = 0.0 if found is None else float((samples[:, J] @ found[0] > found[1]).mean())
            if loss > most:
                points = points[~(points[:, None] == near).all(axis=2).any(axis=1)]
                continue
            if found is None:
                # Others of the pair's points may go all the same; this one is left to the next round.
                points, blocked = points[(points != left[0]).any(axis=1)], True
                continue
            row = np.zeros(scene.n)
            row[J], offset = found
            C, d = np.insert(C, len(d) - limits, row, axis=0), np.insert(d, len(d) - limits, offset)
            samples = samples[samples @ row <= offset]
    return None if blocked and len(d) == len(polytope.d) else Polytope(C, d)


_drawn: OrderedDict[tuple[str, bytes, bytes], Array] = OrderedDict()
"""These samples were drawn last, by scene and polytope; at most DRAWN of them are kept."""


def _samples(scene: Scene, polytope: Polytope) -> Array:
    """Returns samples of a polytope, (S, n), uniform in q; the same ones for the same polytope."""
    key = scene.hash, polytope.C.tobytes(), polytope.d.tobytes()
    if key not in _drawn:
        _drawn[key] = uniform_in_q(polytope, scene.revolute, CHAINS, EACH, 0).reshape(-1, scene.n)
        if len(_drawn) > DRAWN:
            _drawn.popitem(last=False)
    return _drawn[key]


def _face(beyond: Array, keep: Array, samples: Array, scale: Array) -> tuple[Array, float] | None:
    """Returns a face (k,), offset in the pair's joints, |c| = 1; None where no face has both on their sides."""
    middle = keep[0]
    far, near, rest = ((points - middle) / scale for points in (beyond, keep, samples))
    # Only samples on the way to what is cut off can be lost; those that are lost all the same join them.
    mean = rest.mean(axis=0)
    way = np.linalg.solve(np.cov(rest.T).reshape(len(scale), -1) + 1e-9 * np.eye(len(scale)), far.mean(axis=0) - mean)
    chosen = np.argsort(-(rest @ way), kind="stable")[:TAIL]
    found = _hinge(far, near, rest[chosen])
    for _ in range(AGAIN):
        more = np.empty(0) if found is None else np.setdiff1d(np.flatnonzero(rest @ found[0] > found[1]), chosen)[:TAIL]
        if not len(more):
            break
        chosen = np.concatenate([chosen, more])
        found = _hinge(far, near, rest[chosen])
    if found is None:
        return None
    x, offset = found
    depth, room = float((far @ x).max()) - offset, offset - float((near @ x).max())
    offset -= min(CLEAR * float(np.linalg.norm(x)) + CLEARER * depth, 0.5 * room)
    normal = x / scale
    length = float(np.linalg.norm(normal))
    return normal / length, float((offset + normal @ middle) / length)


def _hinge(far: Array, near: Array, rest: Array) -> tuple[Array, float] | None:
    """Returns a face (k,), offset with ``far`` beyond it, ``near`` before it, and few of ``rest`` (h, k) beyond it; None without one."""
    h, k = rest.shape
    A = np.block(
        [
            [-far, np.ones((len(far), 1)), np.zeros((len(far), h))],
            [near, -np.ones((len(near), 1)), np.zeros((len(near), h))],
            [rest, -np.ones((h, 1)), -np.eye(h)],
        ]
    )
    b = np.concatenate([np.zeros(len(far)), -np.ones(len(near)), np.full(h, -MARGIN)])
    bounds = [(None, None)] * (k + 1) + [(0, None)] * h
    found = linprog(np.concatenate([np.zeros(k + 1), np.ones(h)]), A_ub=A, b_ub=b, bounds=bounds, method="highs")
    return (found.x[:k], float(found.x[k])) if found.status == 0 else None

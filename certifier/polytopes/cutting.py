"""A face cuts off what cannot be certified and loses as little of the polytope as it can, by q-volume.

Contacts often lie along a face of the proposal, so faces of the polytope are moved in where that loses least. Elsewhere a linear program
finds a new face: all points of a corner that has to go lie beyond the face, all points to keep lie before it, and of samples of
the polytope that are uniform in q as few as possible lie beyond. "As few" is replaced by the hinge loss, as in a support vector machine.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from cachetools import LRUCache, cached

from certifier.model import Array, Polytope, Scene
from certifier.polytopes.gibbs import uniform_in_q
from certifier.polytopes.hinge import hinge_face
from certifier.polytopes.proved import cleaned

CHAINS, EACH = 1000, 16
"""CHAINS chains give EACH samples each, for the faces of one round."""
ENOUGH = 2000
"""With fewer samples left, others are drawn."""
FEWEST = 200
"""With fewer samples left in the middle of a round, others are drawn: without samples, a program cannot tell how much it cuts off."""
DRAWN = 4
TAIL, AGAIN, MARGIN = 400, 3, 0.1
"""A program sees TAIL samples, the farthest ones on the way to a corner, and others that it loses in AGAIN rounds. The hinge loss begins
MARGIN before the face, relative to the distance from the points to keep."""
CORNER = 0.6
"""The points of one corner lie within this distance of each other, in standard deviations of the samples."""
MOST_POINTS = 64
MOST_FACES = 16
"""A pair gets at most this many faces in one round."""
TRIED = 8
"""At most this many faces of the polytope are tried: moving one of them in may lose less than a new face does."""
BETTER = 2.0
"""A new face has to be this many times as good as one that is moved in, because every face makes later cells more expensive."""
CLEAR, CLEARER = 0.005, 0.2
"""A face is moved away from what it cuts off, by CLEAR standard deviations and by CLEARER of the depth of what it cuts off."""
LEAST_ROOM = 1e-6
"""A face is not put nearer to a point to keep than this, in standard deviations. Nearer ones would halve their distance again and again."""
BARELY = 1e-6
"""A point that is beyond a face by less than this is on it, as far as rounding can tell."""


def lost_together(*shares: float) -> float:
    """Returns the share that is lost when each of these is lost of what those before it have left."""
    return 1 - math.prod(1 - share for share in shares)


@dataclass(frozen=True, eq=False)
class Cut:
    """Holds the result of cutting points off a polytope.

    Attributes:
        polytope: the polytope with faces that cut points off, itself where no face loses little enough; None where nothing can be cut off
            without a point to keep.
        made: for each corner, the result of its faces.
        around: the polytope whose samples were used last, for the next round.
    """

    polytope: Polytope | None
    made: list[Made]
    around: Polytope


@dataclass(frozen=True, eq=False)
class Made:
    """Holds the result of the faces of one corner.

    Attributes:
        faces: how many were added or moved in.
        lost: the share of the polytope that they cut off.
        s: (n,) the point for which the face that lost most was made; None without a face.
    """

    faces: int = 0
    lost: float = 0.0
    s: Array | None = None


def cut(
    scene: Scene,
    polytope: Polytope,
    keep: Array,
    corners: Sequence[tuple[tuple[int, ...], Array, float]],
    around: Polytope,
    beyond: float = 0.0,
) -> Cut:
    """Cuts off the points given.

    A face of the polytope is moved in, or a new one is added, whichever cuts off more points for what it loses.

    Args:
        polytope: its last 2n rows are the joint limits; new faces are added before them, and no face is dropped.
        keep: (k, n) points that stay inside.
        corners: for each pair that failed, the joints between its bodies, the points (w, n) to cut off, and the share of the polytope that
            its faces may lose together.
        around: a polytope of which this one is a part; its samples are used where ENOUGH of them are in this one. They are drawn once, if
            one round after the other receives the polytope that the round before returns.
        beyond: points that are beyond a face by less than this are not cut off yet.
    """
    if not any(len(points) for _, points, _ in corners):
        return Cut(polytope, [Made()] * len(corners), around)
    limits = 2 * scene.n
    samples = samples_of(scene, around)
    samples = samples[polytope.contains(samples)]
    if len(samples) < ENOUGH:
        around, samples = polytope, samples_of(scene, polytope)
    scale = np.where(samples.std(axis=0) > 0, samples.std(axis=0), 1.0)
    C, d = polytope.C, polytope.d.copy()
    blocked = False
    made = []

    def cutting_off(near: Array, J: list[int]) -> list[_Face]:
        faces = [*_moved_in(C, d, limits, near, J, keep, scale), *_new(scene, near, J, keep, samples, scale)]
        # Where a point to keep is too near, a face would hardly move, and the same points would have to go again and again.
        return [face for face in faces if (near @ face.row >= face.offset + beyond).all()]

    for joints, points, most in corners:
        J, left_to_lose = list(joints), most
        losses: list[tuple[float, Array]] = []
        for _ in range(MOST_FACES):
            left = points[(points @ C.T < d + beyond).all(axis=1)]
            if not len(left):
                break
            distance = np.linalg.norm((left - left[0])[:, J] / scale[J], axis=1)
            near = left[np.argsort(distance, kind="stable")[:MOST_POINTS]]
            near = near[: max(1, int((np.sort(distance)[:MOST_POINTS] < CORNER).sum()))]
            faces = cutting_off(near, J)
            if not faces and len(near) > 1:
                near = near[:1]
                faces = cutting_off(near, J)
            rated = [(face, float((samples @ face.row > face.offset).mean())) for face in faces]
            cheap = [(face, loss) for face, loss in rated if loss <= left_to_lose]
            if not cheap:
                # Others of the pair's points may be cut off anyway; these are left to the next round.
                blocked = blocked or not faces
                points = points[~(points[:, None] == near).all(axis=2).any(axis=1)]
                continue
            gains = [float((left @ face.row >= face.offset).sum()) / (loss + 1 / len(samples)) for face, loss in cheap]
            worth = [gain / (BETTER if face.replaces is None else 1.0) for gain, (face, _) in zip(gains, cheap, strict=True)]
            best, loss = cheap[int(np.argmax(worth))]
            if best.replaces is None:
                C, d = np.insert(C, len(d) - limits, best.row, axis=0), np.insert(d, len(d) - limits, best.offset)
            else:
                d[best.replaces] = best.offset
            losses.append((loss, near[0]))
            left_to_lose -= loss
            samples = samples[samples @ best.row <= best.offset]
            if len(samples) < FEWEST:
                around = Polytope(C, d)
                samples = samples_of(scene, around)
        worst = max(losses, key=lambda lost: lost[0], default=(0.0, None))
        made.append(Made(len(losses), lost_together(*(loss for loss, _ in losses)), worst[1]))
    if not any(one.faces for one in made):
        return Cut(None if blocked else polytope, made, around)
    return Cut(Polytope(C, d), made, around)


@dataclass(frozen=True, eq=False)
class _Face:
    """A face row @ s <= offset that cuts points off.

    Attributes:
        replaces: the number of the polytope's face that it replaces; None for a new face.
    """

    row: Array
    offset: float
    replaces: int | None = None


def _moved_in(C: Array, d: Array, limits: int, beyond: Array, joints: list[int], keep: Array, scale: Array) -> list[_Face]:
    """Returns the faces of the polytope in these joints that cut off the points when they are moved in least, at most TRIED of them.

    A face in other joints would not cut off what it is about: bodies that touch do so whatever the joints are that move neither. The
    joint limits, which are the last rows, stay where they are; a new face is put before one of them.
    """
    norms = np.linalg.norm(C * scale, axis=1)
    depths = (d - beyond @ C.T).max(axis=0)
    usable = np.flatnonzero((np.delete(C, joints, axis=1) == 0).all(axis=1))
    faces = []
    for k in usable[np.argsort((depths / norms)[usable], kind="stable")[:TRIED]]:
        room = d[k] - depths[k] - float((keep @ C[k]).max())
        if room > LEAST_ROOM * norms[k]:
            clear = min(CLEAR * norms[k] + CLEARER * depths[k], 0.5 * room)
            faces.append(_Face(C[k], float(d[k] - depths[k] - clear), int(k) if k < len(d) - limits else None))
    return faces


def _new(scene: Scene, beyond: Array, joints: list[int], keep: Array, samples: Array, scale: Array) -> list[_Face]:
    """Returns the new face in these joints that cuts off the points and loses least, if there is one."""
    found = _face(beyond[:, joints], keep[:, joints], samples[:, joints], scale[joints])
    if found is None:
        return []
    row = np.zeros(len(scale))
    row[joints] = found[0]
    (row,), (offset,) = cleaned(row[None], np.array([found[1]]), scene.s_lower, scene.s_upper, keep)
    return [_Face(row, float(offset))]


@cached(LRUCache(DRAWN), key=lambda scene, polytope: (scene.hash, polytope.C.tobytes(), polytope.d.tobytes()))
def samples_of(scene: Scene, polytope: Polytope) -> Array:
    """Returns samples of a polytope, (S, n), uniform in q; the same ones for the same polytope."""
    return uniform_in_q(polytope, scene, CHAINS, EACH, 0).reshape(-1, scene.n)


def _face(beyond: Array, keep: Array, samples: Array, scale: Array) -> tuple[Array, float] | None:
    """Returns a face (k,), offset in the pair's joints, |c| = 1; None where no face has both on their sides, with room."""
    middle = keep[0]
    far, near, rest = ((points - middle) / scale for points in (beyond, keep, samples))
    # Only samples on the way to what is cut off can be lost; those that are lost anyway join them.
    mean = rest.mean(axis=0)
    way = np.linalg.solve(np.cov(rest.T).reshape(len(scale), -1) + 1e-9 * np.eye(len(scale)), far.mean(axis=0) - mean)
    chosen = np.argsort(-(rest @ way), kind="stable")[:TAIL]
    found = hinge_face(far, near, rest[chosen], MARGIN)
    for _ in range(AGAIN):
        more = np.empty(0) if found is None else np.setdiff1d(np.flatnonzero(rest @ found[0] > found[1]), chosen)[:TAIL]
        if not len(more):
            break
        chosen = np.concatenate([chosen, more])
        found = hinge_face(far, near, rest[chosen], MARGIN)
    if found is None:
        return None
    x, offset = found
    depth, room = float((far @ x).max()) - offset, offset - float((near @ x).max())
    if room <= LEAST_ROOM * float(np.linalg.norm(x)):
        return None
    offset -= min(CLEAR * float(np.linalg.norm(x)) + CLEARER * depth, 0.5 * room)
    normal = x / scale
    length = float(np.linalg.norm(normal))
    return normal / length, float((offset + normal @ middle) / length)

"""Each pair as one geometry that moves in the frame of the other one's link, as arrays for the compiled loops of this room."""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np

from certifier.model import Array, Scene
from certifier.motion.bodies import bodies_of
from certifier.motion.views import levers_of, views_of


class Seen(NamedTuple):
    """Holds the P pairs of a scene.

    Attributes:
        pairs: (P, 2) numbers of the geometry that rests and of the one that moves. It is the way round with the smaller levers.
        reaches: (P,) the radii and the padding of both geometries, metres.
        begins: (P + 1,) where each pair's joints begin in the arrays below, and their length.
        joints: (J,) position indices of the joints between both.
        slides: (J,) whether each of them is prismatic.
        levers: (J,) how far a vertex moves at most where the joint moves by 1: metres, and 1 for a prismatic joint.
    """

    pairs: np.ndarray
    reaches: Array
    begins: np.ndarray
    joints: np.ndarray
    slides: np.ndarray
    levers: Array


@lru_cache(maxsize=16)
def seen_of(scene: Scene, padding: float = 0.0) -> Seen:
    """Returns the pairs of a scene.

    Args:
        padding: metres that are added around every body, beyond the scene's padding.
    """
    bodies, views = bodies_of(scene), views_of(scene)
    lower, upper = scene.own_limits
    levers, _ = levers_of(views, np.maximum(np.abs(lower), np.abs(upper)))
    # A pair's first choice is the frame of a, and its last one that of b.
    seen = [(views.sides[first, 1], views.sides[last, 0]) for first, last in zip(views.first[:-1], views.first[1:] - 1, strict=True)]
    joints = [[slice(views.begins[view], views.begins[view + 1]) for view in two] for two in seen]
    turned = [bool(levers[b].sum() > levers[a].sum()) for b, a in joints]
    chosen = [two[which] for two, which in zip(joints, turned, strict=True)]
    index = np.concatenate([np.zeros(0, dtype=np.int64), *(np.arange(own.start, own.stop) for own in chosen)])
    return Seen(
        pairs=np.array([pair[::-1] if swap else pair for pair, swap in zip(bodies.pairs, turned, strict=True)]).reshape(-1, 2),
        reaches=bodies.reaches + 2 * padding,
        begins=np.concatenate([[0], np.cumsum([own.stop - own.start for own in chosen], dtype=np.int64)]),
        joints=views.joints[index],
        slides=views.slides[index],
        levers=levers[index],
    )

"""Each pair as one geometry that moves in the frame of the other one's link, as arrays for the compiled loops of this room."""

from __future__ import annotations

from functools import lru_cache
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from certifier.model import Array, Scene
from certifier.motion.bodies import bodies_of
from certifier.motion.views import Views, levers_of, views_of


class Seen(NamedTuple):
    """Holds the P pairs of a scene.

    Attributes:
        pairs: (P, 2) numbers of the geometry that rests and of the one that moves. It is the way round with the smaller levers.
        reaches: (P,) the radii and the padding of both geometries, metres.
        moving: (P,) the view of the geometry that moves, from the link of the other one.
        views: of the scene.
        levers: (J,) of all joints of the views, for positions within the joints' limits.
    """

    pairs: np.ndarray
    reaches: Array
    moving: np.ndarray
    views: Views
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
    widths = np.array([levers[first:last].sum() for first, last in pairwise(views.begins)])
    # A pair's first choice is the frame of a, in which b moves, and its last one that of b, in which a moves.
    moving = np.column_stack([views.sides[views.first[:-1], 1], views.sides[views.first[1:] - 1, 0]]).reshape(-1, 2)
    turned = widths[moving[:, 0]] > widths[moving[:, 1]]
    return Seen(
        pairs=np.where(turned[:, None], bodies.pairs[:, ::-1], bodies.pairs),
        reaches=bodies.reaches + 2 * padding,
        moving=np.where(turned, moving[:, 1], moving[:, 0]),
        views=views,
        levers=levers,
    )

"""Small scenes made of numbers, for tests that need a scene and no robot file."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from certifier.model import Geometry, Joint, JointKind, Pair, Scene


def box_seed(s: ArrayLike, half_width: float, **more: Any) -> dict[str, Any]:
    """The seed of a growth that begins with a box in s around s, as a given polytope."""
    s = np.asarray(s, dtype=float)
    eye = np.eye(len(s))
    C, d = np.concatenate([eye, -eye]), np.concatenate([s + half_width, half_width - s])
    return {"method": "polytope", "C": C.tolist(), "d": d.tolist(), "center": s.tolist(), **more}


def slider(name: str = "slider", posts: int = 1) -> Scene:
    """A slider along x with a ball on it, and ``posts`` balls on the ground beside its way; every ball is 0.1 m in radius."""
    eye = np.eye(4)
    slide = Joint("model/slide", JointKind.PRISMATIC, "world", "model/cart", np.array([1.0, 0.0, 0.0]), eye, eye, 0, -1.0, 1.0)
    cart = Geometry("model/cart/ball", "model/cart", np.zeros((1, 3)), 0.1, {"kind": "sphere", "radius": 0.1})
    ground = tuple(
        Geometry(f"world/post{i}", "world", np.array([[0.0, 0.5 + i, 0.0]]), 0.1, {"kind": "sphere", "radius": 0.1}) for i in range(posts)
    )
    return Scene(
        name=name,
        joints=(slide,),
        bodies=("world", "model/cart"),
        geometries=(cart, *ground),
        pairs=tuple(Pair("model/cart/ball", post.name) for post in ground),
        ignored=(),
        q_star=np.zeros(1),
    )

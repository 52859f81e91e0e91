"""Options of the jobs that the tests submit."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike


def box_around(s: ArrayLike, radius: float) -> dict[str, Any]:
    """A certify job for the box of this radius around s."""
    s = np.asarray(s, dtype=float)
    eye = np.eye(len(s))
    C, d = np.concatenate([eye, -eye]), np.concatenate([s + radius, radius - s])
    return {"kind": "certify", "seed": {"C": C.tolist(), "d": d.tolist(), "center": s.tolist()}, "random_seed": 0}


def grow_box(q: list[float], half_width: float, **options: Any) -> dict[str, Any]:
    """A grow job from a box around a seed."""
    return {"kind": "grow", "seed": {"method": "box", "q": q, "half_width": half_width}, "bisection_steps": 2, "max_rounds": 0, **options}

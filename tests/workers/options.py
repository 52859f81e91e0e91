"""Options of the jobs that the tests submit."""

from __future__ import annotations

from typing import Any

from numpy.typing import ArrayLike

from tests.scenes import box_seed


def box_around(s: ArrayLike, radius: float) -> dict[str, Any]:
    """A certify job for the box of this radius around s."""
    seed = box_seed(s, radius)
    del seed["method"]
    return {"kind": "certify", "seed": seed, "random_seed": 0}


def grow_box(s: ArrayLike, half_width: float, **options: Any) -> dict[str, Any]:
    """A grow job that begins with a box around s."""
    return {"kind": "grow", "seed": box_seed(s, half_width), **options}

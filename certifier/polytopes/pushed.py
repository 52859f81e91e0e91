"""The faces of a polytope are pushed out from a point, or pulled in to it."""

from __future__ import annotations

import numpy as np

from certifier.model import Array, Polytope
from certifier.polytopes.polytope import without_redundant


def pushed(polytope: Polytope, center: Array, reach: float, within: Polytope) -> Polytope:
    """Returns a polytope with its faces farther from the centre by the factor ``reach``, within another polytope.

    Args:
        polytope: its last 2n rows are the joint limits, which do not move.
        center: (n,) the point that the faces move away from.
        within: a polytope that the result stays inside; its last 2n rows are the joint limits, and so are the result's.
    """
    limits = 2 * len(center)
    C, d = polytope.C[:-limits], polytope.d[:-limits]
    moved = Polytope(np.concatenate([C, within.C]), np.concatenate([C @ center + reach * (d - C @ center), within.d]))
    return without_redundant(moved, fixed=limits)

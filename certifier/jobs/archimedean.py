"""The Archimedean property of a bounded polytope is proved here by constructing its certificate (C-IRIS, appendix A)."""

from __future__ import annotations

import numpy as np

from certifier.model import Polytope
from certifier.polytopes.polytope import bound_multipliers, support
from certifier.proof.region import Archimedean


def archimedean(polytope: Polytope) -> Archimedean:
    """Returns the constant N and the multipliers of :class:`Archimedean`, which says what they prove.

    N is the smallest constant that the box [l, u] allows, rounded up: the maximum over P of (l + u)'s, less sum l_i u_i.
    The multipliers hold in exact arithmetic; ``certifier.verify.archimedean.check_archimedean`` checks that they do.

    Raises:
        RegionError: ``polytope_without_limits`` when an axis is not bounded by single rows, or as ``polytope.chebyshev_center``.
    """
    lower, upper, Y_lower, Y_upper = bound_multipliers(polytope)
    value, y = support(polytope, lower + upper)
    size = np.maximum(np.abs(lower), np.abs(upper))
    rounding = 8 * (len(size) + 4) * np.finfo(float).eps * float(size @ size)
    return Archimedean(value - float(lower @ upper) + rounding, lower, upper, Y_lower, Y_upper, y)

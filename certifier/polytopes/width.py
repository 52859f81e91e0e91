"""How wide a polytope is in a thin direction of joint space. Its volume alone does not tell whether it is thin."""

from __future__ import annotations

import numpy as np

from certifier.coordinates import ConfigurationSpace
from certifier.model import Polytope
from certifier.polytopes.polytope import bounds, faces_to_opposite


def least_width_in_q(polytope: Polytope, space: ConfigurationSpace) -> float:
    """Returns the length of a straight motion in q, in radians and metres, that is the longest within P in some direction of q, or longer.

    The directions are those of the joints, and one for each face c's <= d. On P, c's goes over an interval of a length w. Let s_i change by
    f_i or more for every radian or metre of q_i. A motion by t in the direction of c_i f_i changes c's by t |c_i f_i| or more, as every
    joint's part has the sign of its own c_i. So t is w / |c_i f_i| or less.

    Raises:
        RegionError: as :func:`certifier.polytopes.polytope.chebyshev_center`.
    """
    lower, upper = bounds(polytope)
    slowest = 1 / space.slope(np.clip(0.0, lower, upper))
    across = faces_to_opposite(polytope) / np.linalg.norm(polytope.C * slowest, axis=1)
    return float(min(across.min(), space.turn(lower, upper).min()))

"""The verifier checks here, exactly, that P = {s : C s <= d} is Archimedean (C-IRIS, appendix A, definition 1).

The proof gives a box l_i <= s_i <= u_i around P. The identity

    (s_i - l_i)(u_i - s_i) = [(u_i - s_i)^2 (s_i - l_i) + (s_i - l_i)^2 (u_i - s_i)] / (u_i - l_i)

makes the left-hand side a combination of the bounds s_i - l_i and u_i - s_i with squares as multipliers. Moreover

    N - sum_i s_i^2 = sum_i (s_i - l_i)(u_i - s_i) + [N + sum_i l_i u_i - sum_i (l_i + u_i) s_i].

Every bound is a nonnegative combination of faces plus a nonnegative constant. So is the affine remainder in brackets.
"""

from __future__ import annotations

import numpy as np

from certifier.model import Array
from certifier.proof.region import Archimedean
from certifier.verify.box import Halfspaces
from certifier.verify.kinematics import exact


def check_archimedean(C: Array, d: Array, proof: Archimedean) -> bool:
    """Returns True when the numbers prove, in exact arithmetic, that {C s <= d} is Archimedean with the constant N.

    The slope l + u of the remainder is not a double in general. The check splits it into its double c and the rest e. It bounds
    the product e's over the box.
    """
    rows = Halfspaces(C, d)
    if not rows.lie_in_box(proof.lower, proof.upper, proof.Y_lower, proof.Y_upper) or not np.all(proof.lower < proof.upper):
        return False
    c = proof.lower + proof.upper
    bound = rows.upper_bound(c, proof.y)
    if bound is None or not np.isfinite(proof.N):
        return False
    for lower, upper, rounded in zip(proof.lower, proof.upper, c, strict=True):
        low, high = exact(lower), exact(upper)
        rest = low + high - exact(rounded)
        bound += rest * (high if rest > 0 else low) - low * high
    return bound <= exact(proof.N)

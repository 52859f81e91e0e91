"""Says why a growth that has ended has no region, and what to do about it."""

from __future__ import annotations

from certifier.errors import CirisError
from certifier.growth.whole import REVOKED

DEADLINE = "the deadline was reached"
"""The reason of a growth that had no time left."""


def refusal(reason: str, late: bool) -> CirisError:
    """Returns the error of a growth that ended without a certified region.

    Args:
        reason: why it ended, in a sentence.
        late: whether its time had run out by then.
    """
    if reason.startswith(REVOKED):
        return CirisError("revoked", reason, hint="grow a region of the new scene from another seed")
    return CirisError("not_grown", reason, hint="allow more time" if late else "try another seed, or look at the pair named")

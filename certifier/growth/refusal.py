"""Says why a growth that has ended has no region, and what to do about it."""

from __future__ import annotations

from certifier.errors import CirisError, RegionError
from certifier.growth.whole import REVOKED
from certifier.seeding.proposal import NO_ROOM, TOO_LONG, mend

DEADLINE = "the deadline was reached"
"""The reason of a growth that had no time left."""
THIN = "the space that remains around the seed is too thin to continue"
"""The reason of a growth that reached a polytope whose interior is too small for doubles. Users did not give that polytope."""


def ended_by(error: CirisError, hindrance: str) -> CirisError:
    """Returns what to say of an error that has ended a growth after its seeding, in terms of what users have given.

    Args:
        hindrance: as :class:`certifier.growth.state.Start` has it.
    """
    about_polytope = isinstance(error, RegionError) and error.field in ("polytope", "start")
    return refusal(hindrance or THIN, late=False) if about_polytope else error


def at_deadline(hindrance: str) -> str:
    """Returns the reason of a growth without a region whose time has run out; more time does not help where something hinders it."""
    return hindrance or DEADLINE


def refusal(reason: str, late: bool) -> CirisError:
    """Returns the error of a growth that ended without a certified region.

    Args:
        reason: why it ended, in a sentence.
        late: whether its time had run out by then.
    """
    if reason.startswith(REVOKED):
        return CirisError("revoked", reason, hint="grow a region of the new scene from another seed")
    if NO_ROOM in reason or TOO_LONG in reason:
        return CirisError("not_grown", reason, hint=mend(reason))
    return CirisError("not_grown", reason, hint="allow more time" if late else "try another seed, or look at the pair named")

"""Says why a growth that has ended has no region, and what to do about it."""

from __future__ import annotations

from certifier.conditioned import condition_of
from certifier.conditions import called
from certifier.errors import CirisError, RegionError
from certifier.growth.state import GrowthState
from certifier.growth.whole import REVOKED
from certifier.model import Scene
from certifier.outcome import DEADLINE
from certifier.seeding.proposal import NO_ROOM, TOO_LONG, mend

THIN = "the space that remains around the seed is too thin to continue"
"""The reason of a growth that reached a polytope whose interior is too small for doubles. Users did not give that polytope."""


def ended_by(error: CirisError, hindrance: str) -> CirisError:
    """Returns what to say of an error that has ended a growth after its seeding, in terms of what users have given.

    Args:
        hindrance: as :class:`certifier.growth.state.Start` has it.
    """
    about_polytope = isinstance(error, RegionError) and error.field in ("polytope", "start")
    return refusal(hindrance or THIN, late=False) if about_polytope else error


def at_deadline(scene: Scene, state: GrowthState | None, told: str) -> str:
    """Returns the reason of a growth without a region whose time has run out, with what hinders it.

    Args:
        told: what is known to hinder a proposal that is not made yet; "" where nothing is.
    """
    hindrance = told if state is None or state.start is None else state.start.hindrance
    if hindrance or state is None or not state.obstacles:
        return f"{DEADLINE}; {hindrance}" if hindrance else DEADLINE
    index, worst = max(state.obstacles.items(), key=lambda item: item[1].times)
    pair, rounds = scene.pairs[index], "1 round" if worst.times == 1 else f"{worst.times} rounds"
    stands = "was" if condition_of(scene, pair) else "were"
    return f"{DEADLINE}; {called(pair.a, pair.b)} {stands} in the way of a region in {rounds}"


def refusal(reason: str, late: bool) -> CirisError:
    """Returns the error of a growth that ended without a certified region.

    Args:
        reason: why it ended, in a sentence.
        late: whether its time had run out by then.
    """
    if reason.startswith(REVOKED):
        return CirisError("revoked", reason, hint="grow a region of the new scene from another seed")
    if NO_ROOM in reason or TOO_LONG in reason:
        return CirisError("not_grown", reason, hint=f"allow more time, or {mend(reason)}" if late else mend(reason))
    look = "look at the pair named"
    if not late:
        return CirisError("not_grown", reason, hint="try another seed" if reason == THIN else f"try another seed, or {look}")
    return CirisError("not_grown", reason, hint="allow more time" if reason == DEADLINE else f"allow more time, or {look}")

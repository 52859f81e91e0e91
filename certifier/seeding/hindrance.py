"""This module says what hinders a region, in terms of what users have given, in case no region can be grown from their seed.

A seed may be free and still next to contact. A slide may be far longer than the robot. Only trying shows
whether a region can be grown anyway.
"""

from __future__ import annotations

from collections.abc import Sequence

from certifier.collisions.clearance import Clearance
from certifier.conditions import condition_named
from certifier.model import Pair, Scene
from certifier.seeding.free import Nearest, named, nearest_free, written
from certifier.seeding.limits import too_long
from certifier.seeding.proposal import NO_ROOM

NEAR = 5e-3
"""A seed that is nearer to contact than this, in metres, is next to it."""
ROOM = (20e-3, 10e-3, 5e-3)
"""Such a seed has a neighbour named where every pair has the first of these distances, in metres, that is found within reach."""
REACH = 0.3
"""The neighbour is within this part of the joints' half ranges."""


def hindrance(scene: Scene, checked: Sequence[Nearest]) -> str:
    """Returns what is likely to keep a region from growing around these configurations; "" where nothing is known.

    Args:
        checked: the nearest pair at the seed and at every other configuration to keep, then those on the lines between these.
    """
    # A line is no nearer to contact than its ends but by rounding, where an end is the nearest.
    tight = min(checked, key=lambda one: round(one.distance, 6), default=None)
    if tight is not None and tight.pair is not None and tight.distance <= NEAR:
        return _next_to_contact(scene, tight)
    return too_long(scene)


def _next_to_contact(scene: Scene, tight: Nearest) -> str:
    assert tight.pair is not None
    text = f"{named(tight.field)} is {1e3 * tight.distance:.3g} mm from {_end_of(tight.pair)}{NO_ROOM}"
    clearance, q = Clearance(scene), scene.in_windows(tight.q)
    found = ((room, nearest_free(scene, clearance, q, room, REACH)) for room in ROOM)
    room, roomy = next((known for known in found if known[1] is not None), (0.0, None))
    if roomy is None:
        return text
    return f"{text}; at q = {written(scene, clearance, roomy, room)} every pair is {1e3 * room:g} mm apart or more"


def _end_of(pair: Pair) -> str:
    """Returns in words where a pair touches."""
    condition = condition_named(pair.a, pair.b)
    return f"contact of {pair.a} and {pair.b}" if condition is None else f"where the condition '{condition}' ends"

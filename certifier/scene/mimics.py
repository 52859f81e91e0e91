"""Where joints that others mimic can be held is found here: all of them have to be within their limits."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from certifier.errors import SceneError
from certifier.scene.joints import EXACT, Coupling


@dataclass(frozen=True)
class Mimic:
    """One joint follows another: its position is ``factor`` times the leader's, plus ``offset``, in radians or metres."""

    follower: str
    leader: str
    factor: float
    offset: float


def mimic_of(coupling: Coupling) -> Mimic | None:
    """Returns a coupling of two joints as a mimic joint. The follower has the factor 1, as Drake writes it; if both have, it is the second.

    It is None for a coupling of another number of joints.
    """
    if len(coupling.factors) != 2:
        return None
    (one, by_one), (other, by_other) = coupling.factors.items()
    if by_other == 1:
        return Mimic(other, one, -by_one, coupling.constant)
    return Mimic(one, other, -by_other / by_one, coupling.constant / by_one)


def at_rest(mimics: Sequence[Mimic], limits: Mapping[str, tuple[float, float]], wanted: Mapping[str, float]) -> dict[str, float]:
    """Returns positions for the joints that lead and for those that follow them, the leaders' as near to those wanted as all limits allow.

    Joints that follow each other in a circle are left out.

    Args:
        limits: by joint, radians or metres.
        wanted: by joint; 0 for those that are missing.

    Raises:
        SceneError: ``scene_model``, where a joint can nowhere be within its limits.
    """
    followers = {mimic.follower for mimic in mimics}
    lines = {mimic.leader: (mimic.leader, 1.0, 0.0) for mimic in mimics if mimic.leader not in followers}
    for _ in mimics:
        for mimic in mimics:
            if mimic.leader in lines:
                leader, factor, offset = lines[mimic.leader]
                lines[mimic.follower] = leader, mimic.factor * factor, mimic.factor * offset + mimic.offset
    ranges = {leader: limits[leader] for leader, _, _ in lines.values()}
    for joint, (leader, factor, offset) in lines.items():
        ends = sorted((limit - offset) / factor for limit in limits[joint]) if factor else (-np.inf, np.inf)
        ranges[leader] = lower, upper = max(ranges[leader][0], ends[0]), min(ranges[leader][1], ends[1])
        if lower > upper + EXACT:
            message = (
                f"joint {joint} follows {leader}, as {factor:g} times its position plus {offset:g}; no position of {leader} has it and all "
                f"other joints that follow within their limits, for {joint} {limits[joint][0]:g} to {limits[joint][1]:g}"
            )
            raise SceneError("scene_model", message, field="directives", hint="mend the limits, the multiplier or the offset in the model")
    rest = {leader: float(np.clip(wanted.get(leader, 0.0), *ends)) for leader, ends in ranges.items()}
    return {joint: factor * rest[leader] + offset for joint, (leader, factor, offset) in lines.items()}

"""Pushes: all faces of the best region move out from its centre, within the proposal or the joint limits, and targeted faces
contract the result. A push counts when the inscribed ellipsoid has grown."""

from __future__ import annotations

from dataclasses import replace

from certifier.growth.actions import Transition
from certifier.growth.state import Cuts, GrowthState, Start
from certifier.growth.targeted import pushed, trim
from certifier.growth.trials import effort, is_worth_it
from certifier.model import Scene

PUSH, SMALLEST_PUSH = 1.5, 0.1
"""Factor by which faces are pushed out at first; the least growth tried."""


def next_push(scene: Scene, state: GrowthState, start: Start, reach: float = PUSH) -> Transition | None:
    """Begins the next push of the best region that may come to more, as far as that or less far; None when there were enough."""
    best, rows = state.best, scene.polytope([], []) if start.given else start.rows
    assert best is not None
    while state.pushes < effort(scene, state, "pushes") and reach - 1 >= SMALLEST_PUSH:
        polytope = pushed(scene, best.polytope, best.center, reach, rows)
        state = replace(state, pushes=state.pushes + 1, reach=reach)
        if is_worth_it(state, polytope):
            return trim(scene, replace(state, cuts=Cuts()), start, "push", polytope)
        reach = less(reach)
    return None


def further(state: GrowthState) -> float:
    """How far to push after a push that came through: twice as far when nothing had to be cut."""
    return PUSH if state.cuts.attempts else 1 + 2 * (state.reach - 1)


def less(reach: float) -> float:
    """How far to push after a push that far came to nothing."""
    return 1 + (reach - 1) / 2

"""A push moves all faces of the best region out from its centre and lets targeted faces contract the result.

The faces stay within the proposal or the joint limits. A push counts when the inscribed ellipsoid has grown.
"""

from __future__ import annotations

from dataclasses import replace

from certifier.growth.actions import Transition
from certifier.growth.paper.state import Cuts, PaperState
from certifier.growth.paper.targeted import trim
from certifier.growth.paper.trials import effort, is_worth_it
from certifier.growth.state import Start
from certifier.model import Scene
from certifier.polytopes.pushed import pushed

PUSH, SMALLEST_PUSH = 1.5, 0.1
"""PUSH is the factor by which faces are pushed out at first. A factor below 1 + SMALLEST_PUSH is not tried."""


def next_push(scene: Scene, state: PaperState, start: Start, reach: float = PUSH) -> Transition | None:
    """Begins the next push of the best region that may result in a larger one; returns None when there were enough.

    Args:
        reach: factor by which the faces move out; smaller factors follow where it promises nothing.
    """
    best, rows = state.best, scene.polytope([], []) if state.given else start.rows
    assert best is not None
    while state.pushes < effort(scene, state, "pushes") and reach - 1 >= SMALLEST_PUSH:
        polytope = pushed(best.polytope, best.center, reach, rows)
        state = replace(state, pushes=state.pushes + 1, reach=reach)
        if is_worth_it(state, polytope):
            return trim(scene, replace(state, cuts=Cuts()), start, "push", polytope)
        reach = less(reach)
    return None


def further(state: PaperState) -> float:
    """Returns how far to push after a push that succeeded: PUSH, or twice as far as the last time when nothing had to be cut."""
    return PUSH if state.cuts.attempts else 1 + 2 * (state.reach - 1)


def less(reach: float) -> float:
    """Returns how far to push after a push as far as ``reach`` failed."""
    return 1 + (reach - 1) / 2

"""Algorithm 1 of C-IRIS with appendix B.4: contract until certified, push the faces out again, alternate (11) with (12).

This module says what follows what. Its neighbours know how each phase goes.
"""

from __future__ import annotations

from dataclasses import replace

from certifier.conditions import fails
from certifier.growth.actions import Finish, Outcomes, Transition
from certifier.growth.paper.pushes import further, less, next_push
from certifier.growth.paper.rounds import after_round, next_round
from certifier.growth.paper.state import Bisection, PaperState
from certifier.growth.paper.targeted import contraction_starts, cut, next_contraction
from certifier.growth.paper.uniform import bisect, shrink
from certifier.growth.state import Start
from certifier.model import Scene
from certifier.outcome import combine
from certifier.polytopes.polytope import chebyshev_center
from certifier.seeding.options import Method


def begin(scene: Scene, state: PaperState, start: Start, method: str | None) -> Transition:
    """Asks for the first certification.

    Args:
        method: where the proposal comes from, as its ``info`` says.
    """
    state = replace(state, given=method in (Method.BOX, Method.POLYTOPE))
    if state.asked.contraction == "uniform":
        center, radius = chebyshev_center(start.rows)
        start = replace(start, keep=center[None])
        return shrink(scene, replace(state, start=start), start, Bisection(center, radius, state.asked.bisection_steps, 1.0))
    transition = next_contraction(scene, state, start)
    assert transition is not None, "before there is a region every contraction is worth it"
    return transition


def after_certification(scene: Scene, state: PaperState, start: Start, report: Outcomes, accepted: bool) -> Transition:
    """Returns what follows a certification: more of the same phase, or else the next phase."""
    label = report.action.label
    if label == "round":
        return after_round(scene, _suspecting(state, report), start, accepted)
    if label == "contract" and state.asked.contraction == "uniform":
        state = _suspecting(state, report)
        return bisect(scene, state, start, report) or _push_or_step(scene, state, start)
    if label == "contract":
        return _after_contraction(scene, state, start, report)
    if report.complete:
        return _push_or_step(scene, state, start, further(state))
    return cut(scene, state, start, report) or _push_or_step(scene, state, start, less(state.reach))


def _after_contraction(scene: Scene, state: PaperState, start: Start, report: Outcomes) -> Transition:
    starts = contraction_starts(scene, state)
    if not report.complete:
        following = cut(scene, state, start, report)
        if following is not None:
            return following
        if state.best is None and state.contractions >= len(starts):
            pair = scene.pairs[report.failures[0]]
            reason = f"not even a small region around the seed can be certified: {fails(pair.a, pair.b, 'are too close')} there"
            return Transition(state, Finish(combine(list(report.outcomes.values())), reason))
    elif state.reach > 1 and not state.cuts.attempts:
        # The given polytope was pushed out and nothing had to be cut, so its faces go on outwards.
        return _push_or_step(scene, state, start, further(state))
    _, near = starts[-1]  # The pushes use that of the last contraction, begun or not.
    return next_contraction(scene, state, start) or _push_or_step(scene, replace(state, near=near), start)


def _push_or_step(scene: Scene, state: PaperState, start: Start, reach: float | None = None) -> Transition:
    """Returns the next push, or the alternation when there were enough pushes."""
    push = next_push(scene, state, start) if reach is None else next_push(scene, state, start, reach)
    return push or next_round(scene, state, start)


def _suspecting(state: PaperState, report: Outcomes) -> PaperState:
    """Returns the state in which the pairs that failed now come first the next time."""
    failures = report.failures
    return replace(state, suspects=(*failures, *(i for i in state.suspects if i not in failures)))

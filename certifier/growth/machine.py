"""A region is grown by a pure state machine: propose, contract until certified, push the faces out again, alternate (11) with (12).

It follows appendix B.4 and Algorithm 1 of C-IRIS. :func:`begin` and :func:`advance` decide what to do next and compute nothing heavy.
The caller (the service's coordinator, or :mod:`certifier.jobs.local`) carries out the action and reports back.

This module says what follows what. Its neighbours know how each phase goes.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from certifier.errors import RegionError
from certifier.growth.actions import Candidate, Certify, Failed, Finish, Outcomes, Propose, Report, Transition
from certifier.growth.again import begin_again
from certifier.growth.options import GrowthOptions
from certifier.growth.pushes import further, less, next_push
from certifier.growth.refusal import ended_by
from certifier.growth.rounds import after_round, certify_step, next_round
from certifier.growth.state import Best, Bisection, GrowthState, Start
from certifier.growth.targeted import contraction_starts, cut, next_contraction
from certifier.growth.trials import certify
from certifier.growth.uniform import bisect, shrink
from certifier.growth.whole import after_cells, begin_whole, keeps_more
from certifier.model import Polytope, Scene
from certifier.outcome import Outcome, combine
from certifier.polytopes.ellipsoid import inscribed_ellipsoid
from certifier.polytopes.polytope import chebyshev_center
from certifier.positions import check_magnitude
from certifier.seeding.options import IRIS, IRIS_SEEDS, Method
from certifier.seeding.proposal import Proposal
from certifier.step.stepped import Stepped


def begin(scene: Scene, options: GrowthOptions) -> Transition:
    """Returns the first action of a job.

    Raises:
        RegionError: a ``certify`` job without C and d, with the wrong number of columns, or with a number that is too large.
    """
    state = GrowthState(options)
    if options.kind == "grow":
        seed = options.seed.get("random_seed")
        return Transition(state, Propose({**options.seed, "random_seed": options.random_seed % IRIS_SEEDS if seed is None else seed}))
    if options.kind == "recertify":
        return begin_again(scene, state)
    if "C" not in options.seed or "d" not in options.seed:
        raise RegionError("polytope_missing", "a polytope needs C and d", field="polytope", hint="give both")
    given, center = Polytope.given(options.seed["C"], options.seed["d"], scene.n), options.seed.get("center")
    limited = scene.polytope(given.C, given.d)
    if center is not None:
        check_magnitude(center, "polytope.center")
        center = np.array(center)
    return certify(scene, state, "given", limited, center, failures=None, cells=options.cells or 1)


def advance(scene: Scene, state: GrowthState, report: Report) -> Transition:
    """Returns what follows a report; the state is the one of the last transition and is not changed."""
    hindrance = _hindrance(state, report)
    try:
        transition = _advanced(scene, state, report)
    except RegionError as error:
        transition = _failed(state, Failed(ended_by(error, hindrance)))
    if hindrance and isinstance(transition.action, Finish) and transition.state.best is None:
        return replace(transition, action=replace(transition.action, reason=hindrance))
    return transition


def _hindrance(state: GrowthState, report: Report) -> str:
    if isinstance(report, Proposal):
        return str(report.info.get("hindrance", ""))
    return "" if state.start is None else state.start.hindrance


def _advanced(scene: Scene, state: GrowthState, report: Report) -> Transition:
    if isinstance(report, Outcomes):
        return _certified(scene, state, report)
    if isinstance(report, Proposal):
        return _proposed(scene, state, report)
    if isinstance(report, Stepped):
        return certify_step(scene, state, report)
    return _failed(state, report)


def _failed(state: GrowthState, report: Failed) -> Transition:
    if state.best is not None:
        return Transition(state, Finish(Outcome.CERTIFIED, f"certified; growth ended early: {report.error}"))
    return Transition(state, Finish(Outcome.ERROR, str(report.error)))


def _proposed(scene: Scene, state: GrowthState, proposal: Proposal) -> Transition:
    limited = scene.polytope(proposal.C, proposal.d)
    norms = np.linalg.norm(limited.C, axis=1)
    rows = Polytope(limited.C / norms[:, None], limited.d / norms)
    method = proposal.info.get("method")
    given, hindrance = method in (Method.BOX, Method.POLYTOPE), _hindrance(state, proposal)
    contraction = state.options.contraction or ("whole" if method in IRIS else "targeted")
    if contraction != "uniform":
        start = Start(rows, proposal.center, np.concatenate([proposal.center[None], proposal.contain]), given, hindrance)
        if contraction == "whole":
            return begin_whole(scene, replace(state, start=start), start)
        transition = next_contraction(scene, replace(state, start=start), start)
        assert transition is not None, "before there is a region every contraction is worth it"
        return transition
    center, radius = chebyshev_center(rows)
    start = Start(rows, proposal.center, center[None], given, hindrance)
    return shrink(scene, replace(state, start=start), start, Bisection(center, radius, state.options.bisection_steps, 1.0))


def _certified(scene: Scene, state: GrowthState, report: Outcomes) -> Transition:
    action = report.action
    if action.label == "given":
        candidate = _candidate(state, report, None) if report.complete else None
        return Transition(state, Finish(combine(list(report.outcomes.values())), "the given polytope, every pair"), candidate)
    candidate = None
    if report.complete:
        volume = inscribed_ellipsoid(action.polytope).volume
        if state.best is None or _better(scene, state.start, action, volume, state.best):
            candidate = _candidate(state, report, volume)
            center = chebyshev_center(action.polytope)[0] if action.center is None else action.center
            state = replace(state, best=Best(action.iteration, action.polytope, center, volume))
    assert state.start is not None, "what is certified comes from a proposal"
    return replace(_after(scene, state, state.start, report, candidate is not None), candidate=candidate)


def _better(scene: Scene, start: Start | None, action: Certify, volume: float, best: Best) -> bool:
    """Returns whether a certified polytope is better than the best so far: by its share of the proposal where it is certified by cells,
    and else by its inscribed ellipsoid, which is what contractions, pushes and rounds make larger."""
    if action.label == "cells" and start is not None:
        return keeps_more(scene, start, action.polytope, best.polytope)
    return volume > best.ellipsoid_volume


def _candidate(state: GrowthState, report: Outcomes, volume: float | None) -> Candidate:
    action, seed = report.action, None if state.start is None else state.start.seed
    proofs = {**dict.fromkeys(action.pairs, action.iteration), **action.reuse}
    return Candidate(action.iteration, action.polytope, action.center, seed, volume, proofs, action.together, state.obstacles)


def _after(scene: Scene, state: GrowthState, start: Start, report: Outcomes, accepted: bool) -> Transition:
    """Returns what follows a certification: more of the same phase, or else the next phase."""
    label = report.action.label
    if label == "cells":
        return after_cells(scene, state, start, report)
    if label == "round":
        return after_round(scene, _suspecting(state, report), start, accepted)
    if label == "contract" and state.options.contraction == "uniform":
        state = _suspecting(state, report)
        return bisect(scene, state, start, report) or _push_or_step(scene, state, start)
    if label == "contract":
        return _after_contraction(scene, state, start, report)
    if report.complete:
        return _push_or_step(scene, state, start, further(state))
    return cut(scene, state, start, report) or _push_or_step(scene, state, start, less(state.reach))


def _after_contraction(scene: Scene, state: GrowthState, start: Start, report: Outcomes) -> Transition:
    starts = contraction_starts(scene, state, start)
    if not report.complete:
        following = cut(scene, state, start, report)
        if following is not None:
            return following
        if state.best is None and state.contractions >= len(starts):
            pair = scene.pairs[report.failures[0]]
            reason = f"not even a small region around the seed can be certified: {pair.a} and {pair.b} are too close there"
            return Transition(state, Finish(combine(list(report.outcomes.values())), reason))
    elif state.reach > 1 and not state.cuts.attempts:
        # The given polytope was pushed out and nothing had to be cut, so its faces go on outwards.
        return _push_or_step(scene, state, start, further(state))
    _, near = starts[-1]  # The pushes use that of the last contraction, begun or not.
    return next_contraction(scene, state, start) or _push_or_step(scene, replace(state, near=near), start)


def _push_or_step(scene: Scene, state: GrowthState, start: Start, reach: float | None = None) -> Transition:
    """Returns the next push, or the alternation when there were enough pushes."""
    push = next_push(scene, state, start) if reach is None else next_push(scene, state, start, reach)
    return push or next_round(scene, state, start)


def _suspecting(state: GrowthState, report: Outcomes) -> GrowthState:
    """Returns the state in which the pairs that failed now come first the next time."""
    failures = report.failures
    return replace(state, suspects=(*failures, *(i for i in state.suspects if i not in failures)))
